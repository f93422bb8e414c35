"""Files that are whole or not there, and folders that are gone when the process is."""

import errno
import os
import platform
import re
import shutil
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

RULE = "must be in a folder that can be written to, with room for it"
PREFIX = f"hovercraft_{os.getpid()}_"
"""Of all temporary folders of this process."""
OURS = re.compile(r"hovercraft_(\d+)_\w+")
SAFE = re.compile(r"[A-Za-z0-9_./\\:~ -]*")
"""A path that pythonfmu's wrapper survives: with others the process dies while an FMU is loaded."""
DAY = 86400.0
"""s"""

_unfinished: set[Path] = set()


@contextmanager
def written(path: Path) -> Iterator[Path]:
    """Where to write instead: what is there afterwards takes the place of `path`, whose folder is made.

    After an error, or where one stops, what stood there before still does, and nothing else. What is no regular file,
    as /dev/stdout, is written to as it is.

    Raises:
        OSError: it cannot be written; it names the path.
    """
    target = Path(os.path.realpath(path))
    if target.exists() and not target.is_file() and not target.is_dir():
        try:
            yield path
        except OSError as error:
            raise OSError(error.errno, error.strerror or str(error), str(path)) from error
        return
    unfinished = target.with_name(f".{target.name}.{platform.node()}.{os.getpid()}")  # a folder may be shared
    _unfinished.add(unfinished)
    try:
        _check_target(path)
        target.parent.mkdir(parents=True, exist_ok=True)
        yield unfinished
        unfinished.replace(target)
    except OSError as error:
        if str(error.filename or "") == str(path):
            raise
        raise OSError(error.errno, f"{RULE} ({error.strerror or error})", str(path)) from error
    finally:
        with suppress(OSError):
            unfinished.unlink(missing_ok=True)
        _unfinished.discard(unfinished)


def write_whole(path: Path, content: bytes) -> None:
    """Write a file at once or not at all. Raises as `written` does."""
    with written(path) as unfinished:
        unfinished.write_bytes(content)


def check_writable(path: Path) -> None:
    """Try it, before the work is done; nothing is made. Raises as `written` does."""
    if path.exists() and not path.is_file() and not path.is_dir():
        return
    above = _check_target(path)
    probe = above / f".{path.name}.{os.getpid()}"
    try:
        probe.touch()
    except OSError as error:
        raise OSError(error.errno, f"{RULE} ({error.strerror})", str(path)) from error
    finally:
        with suppress(OSError):
            probe.unlink(missing_ok=True)


def _check_target(path: Path) -> Path:
    """The folder above it that is there."""
    try:
        if path.is_dir():
            raise OSError(errno.EISDIR, "must be a file, and is a folder", str(path))
        above = next(folder for folder in (*path.parents, Path("/")) if folder.exists() or folder.is_symlink())
        if not above.is_dir():
            raise OSError(errno.ENOTDIR, f"must be in a folder, and {above} is a file", str(path))
        if not path.is_absolute():
            os.getcwd()  # it may be deleted
    except OSError as error:
        if error.filename == str(path):
            raise
        raise OSError(error.errno, f"{RULE} ({error.strerror})", str(path)) from error
    return above


# ---- folders


def temporary_folder() -> tempfile.TemporaryDirectory[str]:
    """One that is deleted when it is closed, with a path that a Python FMU survives where there is one."""
    root = tempfile.gettempdir()
    if not SAFE.fullmatch(root):
        others = (place for place in ("/tmp", "/var/tmp") if os.access(place, os.W_OK | os.X_OK))  # noqa: S108
        root = next(others, root)
    _clear_left(root)
    return tempfile.TemporaryDirectory(prefix=PREFIX, dir=root, ignore_cleanup_errors=True)


def check_survived(folder: str) -> None:
    """Raises OSError where a Python FMU would end the process when it is loaded from there."""
    if not SAFE.fullmatch(folder):
        raise OSError(
            f"{folder}: the temporary folder must have no letters but A to Z, no # + ( % , @ and the like in its path: "
            "a Python FMU ends the process there; set TMPDIR to another one, or take a native FMU"
        )


@cache
def _clear_left(root: str) -> None:
    """Delete what a process of ours that was killed has left there more than a day ago."""
    for entry in os.scandir(root):
        match = OURS.fullmatch(entry.name)
        with suppress(OSError):
            if match and _is_left(entry, int(match[1])):
                shutil.rmtree(entry.path, ignore_errors=True)


def _is_left(entry: "os.DirEntry[str]", process: int) -> bool:
    about = entry.stat(follow_symlinks=False)
    mine = not hasattr(os, "getuid") or about.st_uid == os.getuid()
    if not (entry.is_dir(follow_symlinks=False) and mine and time.time() - about.st_mtime > DAY):
        return False
    if os.name == "posix":
        try:
            os.kill(process, 0)
        except ProcessLookupError:
            return True
        return False
    return True  # its files could not be deleted while it runs


def clear() -> None:
    """Delete what this process has begun to write, and its temporary folders: it ends in the middle of something."""
    for unfinished in list(_unfinished):
        with suppress(OSError):
            unfinished.unlink(missing_ok=True)
    for root in {tempfile.tempdir, "/tmp", "/var/tmp"} - {None}:  # noqa: S108
        for folder in Path(str(root)).glob(f"{PREFIX}*"):
            shutil.rmtree(folder, ignore_errors=True)
