"""Where files are: in a folder, or at an address that fsspec knows, as s3://bucket/folder; each whole, or not there."""

import errno
import os
import platform
import re
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import urlsplit

from ..whole import written

PUT_WHOLE = {"s3", "s3a", "gs", "gcs", "abfs", "abfss", "az", "adl", "oci", "oss", "memory"}
"""Stores in which a file is there when all of it has come; elsewhere it is written aside and takes its name then."""
ADDRESS = re.compile(r"([A-Za-z0-9+.-]{2,}(::[A-Za-z0-9+.-]+)*)://.*", re.DOTALL)
PAUSES = tuple(0.1 * 2**i for i in range(7))
"""s, before what failed is tried again: a store that fails once in ten times ends no sweep of a million files."""
LASTING = (FileNotFoundError, FileExistsError, IsADirectoryError, NotADirectoryError, PermissionError,
           ImportError, LookupError, TypeError, ValueError)  # fmt: skip
LASTING_NUMBERS = {errno.EDQUOT, errno.EFBIG, errno.EINVAL, errno.ENAMETOOLONG, errno.ENOSPC, errno.EROFS}
RULE = "must be a place that can be read and written"

Returned = TypeVar("Returned")


@dataclass(frozen=True)
class Place:
    """A folder or an address; names in it are as runs/00000.parquet. It means the same to a worker that it is sent to.

    Credentials are taken as the library of that store takes them, from its environment or its files.
    """

    given: str
    """As people are told it."""
    address: str
    """In full."""

    def __str__(self) -> str:
        return self.given

    @property
    def folder(self) -> Path | None:
        """None: it is an address."""
        return None if ADDRESS.fullmatch(self.address) else Path(self.address)

    @property
    def store(self) -> tuple[Any, str]:
        """fsspec's file system, and the path there."""
        return _store(self.address)

    @property
    def _put_whole(self) -> bool:
        return bool(set(_protocols(self.store[0])) & PUT_WHOLE)

    def path(self, name: str) -> str:
        """Of a file, as its file system knows it."""
        return f"{self.store[1].rstrip('/')}/{name}"

    def names(self, within: str) -> list[str]:
        """The names of the files there, in any order; none where nothing is."""

        def listed() -> list[str]:
            if self.folder:
                return os.listdir(self.folder / within)
            store = self.store[0]
            store.invalidate_cache()  # another one may have written since
            paths: list[str] = store.ls(self.path(within), detail=False)
            return [path.rpartition("/")[2] for path in paths]

        try:
            return self._tried(listed, FileNotFoundError)
        except FileNotFoundError:
            return []

    def read(self, name: str, last: int | None = None) -> bytes:
        """A file, or so many bytes at its end. Raises FileNotFoundError where it is not there."""
        start = -last if last else None
        return bytes(self._tried(lambda: self.store[0].cat_file(self.path(name), start=start), FileNotFoundError))

    def write(self, name: str, content: bytes) -> None:
        """What was there is replaced; what is written is on the disk afterwards."""
        self._tried(partial(self._write_file if self.folder else self._write_there, name, content))

    def _write_file(self, name: str, content: bytes) -> None:
        with written(Path(self.address, name)) as path, path.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())

    def _write_there(self, name: str, content: bytes) -> None:
        store, path = self.store[0], self.path(name)
        if self._put_whole:
            store.pipe_file(path, content)
            return
        within, _, last = path.rpartition("/")
        aside = f"{within}/.{last}.{platform.node()}.{os.getpid()}"
        store.makedirs(within, exist_ok=True)
        store.pipe_file(aside, content)
        store.mv(aside, path)

    def create(self, name: str, content: bytes) -> None:
        """As `write`. Raises FileExistsError where it is there; two who do it at once are told apart by most stores."""

        def created() -> None:
            store, path = self.store
            if not self._put_whole:  # where it is, that would make a bucket
                store.makedirs(path, exist_ok=True)
            store.pipe_file(self.path(name), content, mode="create")

        self._tried(created, FileExistsError)

    def remove(self, names: Iterable[str]) -> None:
        """Those that are there."""
        for name in names:
            with suppress(FileNotFoundError):
                self._tried(partial(self.store[0].rm_file, self.path(name)), FileNotFoundError)

    def rename(self, name: str, new: str) -> None:
        """Nothing where it is not there."""
        with suppress(FileNotFoundError):
            self._tried(partial(self.store[0].mv, self.path(name), self.path(new)), FileNotFoundError)

    def clear_up(self, process: int) -> None:
        """Delete what a process of this machine, which was ended, has begun to write to a folder."""
        for left in self.folder.glob(f"*/.*.{platform.node()}.{process}") if self.folder else ():
            left.unlink(missing_ok=True)

    def _tried(self, operation: Callable[[], Returned], expected: type[OSError] | None = None) -> Returned:
        """What it returns, at last; what may pass is tried again.

        Raises what a library of a store raises as OSError, what is expected as it is.
        """
        for pause in (*PAUSES, 0.0):
            try:
                return operation()
            except Exception as error:
                failed = error
            if _lasts(failed):
                break
            time.sleep(pause)
        if (expected and isinstance(failed, expected)) or (self.folder and isinstance(failed, OSError)):
            raise failed
        raise OSError(f"output = {self.given!r}: {RULE}; {_said(failed)}") from failed


def _lasts(error: Exception) -> bool:
    """Whether it will be the same a moment later."""
    return (
        isinstance(error, LASTING)
        or (isinstance(error, OSError) and error.errno in LASTING_NUMBERS)
        or "Credential" in type(error).__name__  # as those of s3:// and gs:// have it, which are no OSError
    )


def _said(error: Exception) -> str:
    """On one line."""
    return f"{type(error).__name__}: {next(iter(str(error).splitlines()), '')}"


def _protocols(store: Any) -> tuple[str, ...]:
    given = store.protocol
    return (given,) if isinstance(given, str) else tuple(given)


@lru_cache(maxsize=8)
def _store(address: str) -> tuple[Any, str]:
    if not ADDRESS.fullmatch(address):  # in which url_to_fs would take :: and the like for its own
        from fsspec.implementations.local import LocalFileSystem

        return LocalFileSystem(), address
    from fsspec.core import url_to_fs

    found: tuple[Any, str] = url_to_fs(address)
    return found


def place_of(output: str | os.PathLike[str]) -> Place:
    """The place that is meant.

    Raises:
        ValueError: an address with credentials, or of a store that nobody knows or whose library is not installed.
    """
    given = os.fspath(output)
    if not ADDRESS.fullmatch(given):
        return Place(given, os.path.abspath(given))
    _check_open(given)
    try:
        store, path = _store(given)
    except ImportError as error:
        missing = getattr(error.__cause__, "name", None) or "its library"
        raise ValueError(
            f"output = {given!r}: must be of a store whose library is installed: pip install {missing}"
        ) from error
    except Exception as error:
        raise ValueError(
            f"output = {given!r}: must be a folder, or an address as s3://bucket/folder; {_said(error)}"
        ) from error
    return Place(path, path) if "file" in _protocols(store) else Place(given, given)


def _check_open(address: str) -> None:
    """A command is seen by others: on the screen, in its history, in the list of processes."""
    parts = urlsplit(address)
    login, _, host = parts.netloc.rpartition("@")
    if ":" in login or parts.query:
        shown = f"{parts.scheme}://{host}{parts.path}"
        raise ValueError(
            f"output = {shown!r}: must be without credentials and options: the library of {parts.scheme}:// takes them "
            "from the environment and its own files"
        )
