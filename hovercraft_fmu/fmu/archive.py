"""Archives: written at once or not at all, the same bytes whenever and wherever they are made."""

import errno
import hashlib
import io
import os
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path


def write_archive(path: str | os.PathLike[str], make: Callable[[], bytes], suffix: str = ".fmu") -> Path:
    """Write what `make` makes to `path` (its folder is made) and return the path.

    Raises:
        ValueError: the name does not end in the suffix.
        OSError: the file cannot be written; one that stood there before still does.
    """
    path = Path(path)
    check_target(path, suffix)
    content = make()
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        _replace(path, content)
    except OSError as error:  # it names a file that nobody asked for
        rule = "must be in a folder that can be written to, with room for it"
        raise OSError(error.errno, f"{rule} ({error.strerror})", str(path)) from error
    return path


def check_target(path: Path, suffix: str) -> None:
    """Raises as `write_archive` does where it can be told beforehand that a file cannot be written."""
    if path.suffix != suffix:
        raise ValueError(f"path = {str(path)!r}: must end in {suffix}")
    if path.is_dir():
        raise OSError(errno.EISDIR, "must be a file, and is a folder", str(path))
    above = next(folder for folder in path.parents if folder.exists())
    if not above.is_dir():
        raise OSError(errno.ENOTDIR, f"must be in a folder, and {above} is a file", str(path))


def _replace(path: Path, content: bytes) -> None:
    unfinished = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        unfinished.write_bytes(content)
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)


def zipped(files: Mapping[str, bytes]) -> bytes:
    """An archive of these files, by path."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name in sorted(files):
            info = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            info.compress_type = zipfile.ZIP_DEFLATED
            info.create_system = 3  # Unix, wherever it was built
            info.external_attr = 0o644 << 16
            archive.writestr(info, files[name])
    return buffer.getvalue()


def digest(files: Mapping[str, bytes]) -> str:
    """32 hexadecimal digits, of names and contents."""
    total = hashlib.sha256()
    for name in sorted(files):
        total.update(f"{name}\0{len(files[name])}\0".encode() + files[name])
    return total.hexdigest()[:32]
