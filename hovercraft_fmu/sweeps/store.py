"""A sweep's results: Parquet files in one place, one a chunk of runs, each written whole or not at all.

Every file says which sweep it is of, which chunk it is, how many rows it has, and the SHA-256 of all its bytes.
"""

import errno
import hashlib
import json
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from .place import Place

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

RUNS, TRAJECTORIES, STATEMENT = "runs", "trajectories", "sweep.json"
KEY = b"hovercraft_fmu"
"""Of the metadata: JSON; see `packed`."""
SAME = ("study", "engine", "fmu_sha256", "hovercraft_fmu", "runs", "chunk")
"""What must be the same where a sweep goes on; the rest of the metadata may differ."""
OF_ONE_FILE = ("what", "number", "rows", "sha256")
"""What the metadata of one file alone has."""
NAME = re.compile(r"\d{5,}\.parquet")
BLANK = b"0" * 64
FOOTER = 2**16
"""Bytes at the end of a Parquet file in which its metadata is, but for a study with long inputs."""
READERS, WAITING = 16, 1000
"""Threads that look at the files of an object store, where each takes a round trip; and files that wait for them."""
SEAL = re.compile(rb'"sha256": "([0-9a-f]{64})"')


class Part(NamedTuple):
    """An n-th of a sweep's chunks: every n-th one, from the k-th on."""

    k: int
    """From 1"""
    n: int

    def __contains__(self, chunk: object) -> bool:
        return isinstance(chunk, int) and chunk % self.n == self.k - 1


WHOLE = Part(1, 1)


class Store:
    """The place of one sweep: runs/00000.parquet, ..., and trajectories/ where they are kept.

    Its sweep.json says which sweep it is of, before there is a chunk: to who starts another one, and to every worker,
    which so knows that it sees the same place.

    Args:
        place: see `Place`.
        about: the metadata of the sweep.
        part: see `Part`; what others make is not looked at.
        alone: nobody else is at work there.

    Raises:
        ValueError: it holds another sweep's results, or other files.
        OSError: it cannot be read or written.
    """

    def __init__(self, place: Place, about: Mapping[str, Any], part: Part = WHOLE, alone: bool = False) -> None:
        self.place = place
        self.done: set[int] = set()
        """The numbers of the chunks that are there, of this part."""
        self.spoiled: list[str] = []
        """What was set aside, and why: it must be made anew."""
        numbers = chunk_numbers(place, RUNS)
        stated = statement(place)
        if stated and (numbers or not alone):
            self._check_same(different(stated, about))
        wrong: dict[str, str] = {}
        for number, found in _looked_at(place, [number for number in numbers if number in part], about):
            wrong |= found
            if not found:
                self.done.add(number)
        if not self.done:
            self._check_same(next((why for why in wrong.values() if why.startswith(ANOTHER)), ""))
        for name, why in wrong.items():
            what, _, file = name.partition("/")
            place.rename(name, f"{what}/.{file}.spoiled")
            self.spoiled.append(f"{place}/{name}: {why}")
        if not stated or different(stated, about):
            self._state(about, anew=stated is None)

    def missing(self, chunks: Iterable[int]) -> list[int]:
        """Those of them that are not there, now."""
        there = set(chunk_numbers(self.place, RUNS))
        return [chunk for chunk in chunks if chunk not in there]

    def _check_same(self, why: str) -> None:
        if why:
            raise ValueError(f"{self.place}: holds the results of {why}: name another output, or overwrite it")

    def _state(self, about: Mapping[str, Any], anew: bool) -> None:
        content = json.dumps({name: about[name] for name in SAME}).encode()
        try:
            if anew:
                self.place.create(STATEMENT, content)
                return
        except FileExistsError:  # in this moment; or it is damaged
            self._check_same(different(statement(self.place) or about, about))
        self.place.write(STATEMENT, content)


def statement(place: Place) -> dict[str, Any] | None:
    """What sweep.json says; None: it is not there, or damaged."""
    try:
        return dict(json.loads(place.read(STATEMENT)))
    except (FileNotFoundError, TypeError, ValueError):
        return None


@contextmanager
def store(place: Place, about: Mapping[str, Any], part: Part = WHOLE, overwrite: bool = False) -> Iterator[Store]:
    """The store; a folder for this process alone, or for those that make parts of that sweep.

    Raises as `Store` does; ValueError: another process has it; `overwrite`, which deletes what is there, of a part.
    """
    if overwrite and part != WHOLE:
        raise ValueError("overwrite: must not be given with part: it would delete what other parts have made")
    with _locked(place.folder, shared=part != WHOLE) if place.folder else nullcontext(False) as alone:
        if alone and place.folder:
            for left in place.folder.glob("*/.*.parquet.*[0-9]"):  # of one that was killed
                left.unlink(missing_ok=True)
        if overwrite:
            files = (chunk_file(what, n) for what in (RUNS, TRAJECTORIES) for n in chunk_numbers(place, what))
            place.remove([*files, STATEMENT])
        yield Store(place, about, part, alone)


@contextmanager
def _locked(folder: Path, shared: bool) -> Iterator[bool]:
    """Whether nobody else is at work there, as far as the file system tells."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / ".lock").open("a+b") as lock:  # the system lets go of it when the process ends, however it does
        try:
            if sys.platform != "win32":
                fcntl.flock(lock, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
            elif not shared:  # there are none on Windows
                lock.seek(0)
                msvcrt.locking(lock.fileno(), msvcrt.LK_NBLCK, 1)
        except (BlockingIOError, PermissionError) as error:
            raise ValueError(f"{folder}: another sweep is at work here: wait for it, or name another folder") from error
        except OSError as error:
            if error.errno not in (errno.ENOSYS, errno.ENOLCK, errno.ENOTSUP):
                raise
            shared = True  # no locks there, as in some file systems of clusters
        yield not shared


# ---- what is there


ANOTHER = "another sweep ("


def chunk_numbers(place: Place, what: str) -> list[int]:
    """The numbers of the chunks that are there, in their order. Raises ValueError where there are other files."""
    found = [name for name in place.names(what) if name.endswith(".parquet") and not name.startswith(".")]
    for name in found:
        if not NAME.fullmatch(name):
            raise ValueError(f"{place}/{what}/{name}: is none of a sweep's files: move it elsewhere")
    return sorted(int(name.partition(".")[0]) for name in found)


def chunk_file(what: str, number: int) -> str:
    """The name of a chunk's file."""
    return f"{what}/{number:05}.parquet"


def _looked_at(place: Place, chunks: list[int], about: Mapping[str, Any]) -> Iterator[tuple[int, dict[str, str]]]:
    """Each chunk with those of its files that are none of that sweep, and why; one after the other in a folder."""

    def wrong(chunk: int) -> tuple[int, dict[str, str]]:
        files = (chunk_file(what, chunk) for what in about["files"])
        return chunk, {file: why for file in files if (why := _wrong(place, file, about))}

    if place.folder:
        yield from map(wrong, chunks)
        return
    with ThreadPoolExecutor(READERS) as pool:
        for i in range(0, len(chunks), WAITING):
            yield from pool.map(wrong, chunks[i : i + WAITING])


def _wrong(place: Place, name: str, about: Mapping[str, Any]) -> str:
    """Why a file is none of that sweep; '' where it is right."""
    try:
        there = opened(place, name)[0] if place.folder else _stated(place, name)
    except FileNotFoundError:
        return "is missing"
    except ValueError as error:
        return str(error)
    return different(there, about) or misplaced(name, there)


def different(there: Mapping[str, Any], about: Mapping[str, Any]) -> str:
    """How what a file says of itself is that of another sweep; '' where it is this one's."""
    names = [name for name in SAME if there.get(name) != about.get(name)]
    return f"{ANOTHER}{', '.join(names)} differ)" if names else ""


def misplaced(name: str, there: Mapping[str, Any]) -> str:
    """Why a file is not where it belongs; '' where it is."""
    if chunk_file(there["what"], there["number"]) != name:
        return f"is chunk {there['number']} of the {there['what']}, under another name"
    return ""


def _stated(place: Place, name: str) -> dict[str, Any]:
    """The metadata of a file at an address, by its end alone where that is one: a store looks after the bytes that it
    was given, and to fetch all of them takes long. Whoever reads the rows checks them. Raises as `opened` does.
    """
    try:
        return _metadata(place.read(name, last=FOOTER))
    except FileNotFoundError:
        raise
    except (OSError, ValueError):
        return opened(place, name)[0]


def opened(place: Place, name: str) -> tuple[dict[str, Any], bytes]:
    """The metadata and the content of a file that is as it was written. Raises ValueError: it is not."""
    content = place.read(name)
    seals = list(SEAL.finditer(content))
    if len(seals) != 1:
        raise ValueError("is no file of a sweep, or cut: it has no checksum")
    begin, end = seals[0].span(1)
    view, checksum = memoryview(content), hashlib.sha256()  # a copy of a large file takes room
    for part in (view[:begin], BLANK, view[end:]):
        checksum.update(part)
    if checksum.hexdigest().encode() != view[begin:end]:
        raise ValueError("is damaged: its checksum is another one")
    return _metadata(content), content


def _metadata(content: bytes) -> dict[str, Any]:
    try:  # whoever can work out a checksum may still have written anything
        about = dict(json.loads(pq.read_schema(pa.BufferReader(content)).metadata[KEY]))
        int(about["number"]), str(about["what"])
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise ValueError("is none that a sweep wrote") from error
    return about


# ---- tables


def packed(table: pa.Table, about: Mapping[str, Any], what: str, number: int) -> bytes:
    """The content of a Parquet file that says where its rows come from, and what it is of the sweep."""
    into = pa.BufferOutputStream()
    own = dict(zip(OF_ONE_FILE, (what, number, table.num_rows, BLANK.decode()), strict=True))
    # a dictionary of numbers that are all different takes time and room
    pq.write_table(table.replace_schema_metadata({KEY: json.dumps({**about, **own})}), into, use_dictionary=False)
    content: bytes = into.getvalue().to_pybytes()
    return content.replace(BLANK, hashlib.sha256(content).hexdigest().encode())


def runs_table(
    numbers: NDArray[np.int64],
    samples: Mapping[str, NDArray[Any]],
    columns: Mapping[str, NDArray[np.float64]],
    warnings: NDArray[np.int32],
    errors: list[str | None],
) -> pa.Table:
    """A row a run: its number, what was swept, what was kept, the FMU's warnings, its error.

    Nothing (null): of a run that failed; an event that did not happen.
    """
    failed = np.array([error is not None for error in errors])
    made = {
        "run": pa.array(numbers),
        **{name: pa.array(values) for name, values in samples.items()},
        **{name: pa.array(values, mask=failed | np.isnan(values)) for name, values in columns.items()},
        "warnings": pa.array(warnings, mask=failed),
        "error": pa.array(errors, pa.string()),
    }
    return pa.table(made)


def trajectories_table(
    numbers: NDArray[np.int64], times: NDArray[np.float64], columns: Mapping[str, NDArray[np.float64]]
) -> pa.Table:
    """A row a point of time: the run, the time [s], what was kept, shape (runs, points) each."""
    made = {
        "run": pa.array(np.repeat(numbers, len(times))),
        "time": pa.array(np.tile(times, len(numbers))),
        **{name: pa.array(np.ascontiguousarray(values).ravel()) for name, values in columns.items()},
    }
    return pa.table(made)
