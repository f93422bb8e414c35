"""Where files are: in a folder, or at an address that fsspec knows, as s3://bucket/folder; each whole, or not there."""

import os
import platform
import re
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from ..whole import written

PUT_WHOLE = {"s3", "s3a", "gs", "gcs", "abfs", "abfss", "az", "adl", "oci", "oss", "memory"}
"""Stores in which a file is there when all of it has come; elsewhere it is written aside and takes its name then."""
ADDRESS = re.compile(r"([A-Za-z0-9+.-]{2,}(::[A-Za-z0-9+.-]+)*)://.*", re.DOTALL)
RULE = "must be a place that can be read and written"


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

    def path(self, name: str) -> str:
        """Of a file, as its file system knows it."""
        return f"{self.store[1].rstrip('/')}/{name}"

    def names(self, within: str) -> list[str]:
        """The names of the files there, in any order; none where nothing is."""
        with self._told():
            try:
                if self.folder:
                    return os.listdir(self.folder / within)
                store = self.store[0]
                store.invalidate_cache()  # another one may have written since
                paths: list[str] = store.ls(self.path(within), detail=False)
                return [path.rpartition("/")[2] for path in paths]
            except FileNotFoundError:
                return []

    def read(self, name: str) -> bytes:
        """Raises FileNotFoundError where it is not there."""
        with self._told():
            content: bytes = self.store[0].cat_file(self.path(name))
            return content

    def write(self, name: str, content: bytes) -> None:
        """What was there is replaced; what is written is on the disk afterwards."""
        with self._told():
            if self.folder:
                with written(self.folder / name) as aside, aside.open("wb") as file:
                    file.write(content)
                    file.flush()
                    os.fsync(file.fileno())
                return
            store, path = self.store[0], self.path(name)
            if set(_protocols(store)) & PUT_WHOLE:
                store.pipe_file(path, content)
                return
            within, _, last = path.rpartition("/")
            begun = f"{within}/.{last}.{platform.node()}.{os.getpid()}"
            store.makedirs(within, exist_ok=True)
            store.pipe_file(begun, content)
            store.mv(begun, path)

    def create(self, name: str, content: bytes) -> None:
        """As `write`. Raises FileExistsError where it is there; two who do it at once are told apart by most stores."""
        with self._told():
            store, path = self.store
            store.makedirs(path, exist_ok=True)
            store.pipe_file(self.path(name), content, mode="create")

    def remove(self, names: Iterable[str]) -> None:
        """Those that are there."""
        with self._told():
            for name in names:
                with suppress(FileNotFoundError):
                    self.store[0].rm_file(self.path(name))

    def rename(self, name: str, new: str) -> None:
        """Nothing where it is not there."""
        with self._told(), suppress(FileNotFoundError):
            self.store[0].mv(self.path(name), self.path(new))

    def clear_up(self, process: int) -> None:
        """Delete what a process of this machine, which was ended, has begun to write to a folder."""
        for left in self.folder.glob(f"*/.*.{platform.node()}.{process}") if self.folder else ():
            left.unlink(missing_ok=True)

    @contextmanager
    def _told(self) -> Iterator[None]:
        """What a library of a store raises, as OSError; no file, and a file already, as they are."""
        try:
            yield
        except (FileNotFoundError, FileExistsError):
            raise
        except Exception as error:
            if self.folder and isinstance(error, OSError):
                raise
            raise OSError(f"output = {self.given!r}: {RULE}; {_said(error)}") from error


def _said(error: Exception) -> str:
    """On one line."""
    return f"{type(error).__name__}: {next(iter(str(error).splitlines()), '')}"


def _protocols(store: Any) -> tuple[str, ...]:
    given = store.protocol
    return (given,) if isinstance(given, str) else tuple(given)


@lru_cache(maxsize=8)
def _store(address: str) -> tuple[Any, str]:
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
