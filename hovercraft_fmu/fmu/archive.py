"""Archives: written at once or not at all, the same bytes whenever and wherever they are made."""

import hashlib
import io
import os
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

from ..whole import check_writable, write_whole


def write_archive(path: str | os.PathLike[str], make: Callable[[], bytes], suffix: str = ".fmu") -> Path:
    """Write what `make` makes to `path` (its folder is made) and return the path.

    Raises:
        ValueError: the name does not end in the suffix.
        OSError: the file cannot be written; one that stood there before still does.
    """
    path = Path(path)
    check_target(path, suffix)
    write_whole(path, make())
    return path


def check_target(path: Path, suffix: str) -> None:
    """Raises as `write_archive` does where it can be told beforehand that a file cannot be written."""
    if path.suffix != suffix:
        raise ValueError(f"path = {str(path)!r}: must end in {suffix}")
    check_writable(path)


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
