"""Where a sweep's results are: a folder of Parquet files, one a chunk of runs, each written whole or not at all.

Every file says which sweep it is of, which chunk it is, how many rows it has, and the SHA-256 of all its bytes.
"""

import hashlib
import json
import os
import re
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from ..whole import written

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

RUNS, TRAJECTORIES = "runs", "trajectories"
KEY = b"hovercraft_fmu"
"""Of the metadata: JSON; see `packed`."""
SAME = ("study", "engine", "fmu_sha256", "hovercraft_fmu", "runs", "chunk")
"""What must be the same where a sweep goes on; the rest of the metadata may differ."""
OF_ONE_FILE = ("what", "number", "rows", "sha256")
"""What the metadata of one file alone has."""
NAME = re.compile(r"\d{5,}")
BLANK = b"0" * 64
SEAL = re.compile(rb'"sha256": "([0-9a-f]{64})"')


class Store:
    """The folder of one sweep: runs/00000.parquet, ..., and trajectories/ where they are kept.

    Raises:
        ValueError: the folder holds another sweep's results, or other files.
        OSError: it cannot be read or written.
    """

    def __init__(self, folder: Path, about: Mapping[str, Any]) -> None:
        self.folder = folder
        self.done: set[int] = set()
        """The numbers of the chunks that are there."""
        self.spoiled: list[str] = []
        """What was set aside, and why: it must be made anew."""
        wrong: dict[Path, str] = {}
        for path in chunk_files(folder, RUNS):
            whole = [folder / what / path.name for what in about["files"]]
            found = {each: why for each in whole if (why := _wrong(each, about))}
            wrong |= found
            if not found:
                self.done.add(int(path.stem))
        another = [why for why in wrong.values() if why.startswith(ANOTHER)]
        if another and not self.done:
            raise ValueError(
                f"{folder}: holds the results of {another[0]}: name another folder as output, or overwrite it"
            )
        for path, why in wrong.items():
            if path.exists():
                path.replace(path.with_name(f".{path.name}.spoiled"))
            self.spoiled.append(f"{path}: {why}")

    def write(self, chunk: int, files: Mapping[str, bytes]) -> None:
        """Write the files of a chunk; see `packed`. Its runs come last: where they are, all of it is."""
        for what in sorted(files, key=lambda what: what == RUNS):
            with written(self.folder / what / f"{chunk:05}.parquet") as path, path.open("wb") as file:
                file.write(files[what])
                file.flush()
                os.fsync(file.fileno())


@contextmanager
def store(folder: Path, about: Mapping[str, Any], overwrite: bool = False) -> Iterator[Store]:
    """The store, for this process alone; with `overwrite` without the results that are there.

    Raises as `Store` does; ValueError: another process has it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / ".lock").open("a+b") as lock:  # the system lets go of it when the process ends, however it does
        _take(lock, folder)
        for left in folder.glob("*/.*.parquet.*[0-9]"):  # of one that was killed
            left.unlink()
        for path in (*chunk_files(folder, RUNS), *chunk_files(folder, TRAJECTORIES)) if overwrite else ():
            path.unlink()
        yield Store(folder, about)


def _take(lock: IO[bytes], folder: Path) -> None:
    try:
        if sys.platform == "win32":
            lock.seek(0)
            msvcrt.locking(lock.fileno(), msvcrt.LK_NBLCK, 1)
        else:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except (BlockingIOError, PermissionError) as error:
        raise ValueError(f"{folder}: another sweep is at work here: wait for it, or name another folder") from error


# ---- what is there


ANOTHER = "another sweep ("


def chunk_files(folder: Path, what: str) -> list[Path]:
    """The files of the chunks that are there, in their order. Raises ValueError where there are others."""
    found = sorted(path for path in (folder / what).glob("*.parquet") if not path.name.startswith("."))
    for path in found:
        if not NAME.fullmatch(path.stem):
            raise ValueError(f"{path}: is none of a sweep's files: move it elsewhere")
    return found


def _wrong(path: Path, about: Mapping[str, Any]) -> str:
    """Why a file is none of that sweep; '' where it is right."""
    try:
        there, _ = opened(path)
    except FileNotFoundError:
        return "is missing"
    except ValueError as error:
        return str(error)
    return different(there, about) or misplaced(path, there)


def different(there: Mapping[str, Any], about: Mapping[str, Any]) -> str:
    """How what a file says of itself is that of another sweep; '' where it is this one's."""
    names = [name for name in SAME if there.get(name) != about.get(name)]
    return f"{ANOTHER}{', '.join(names)} differ)" if names else ""


def misplaced(path: Path, there: Mapping[str, Any]) -> str:
    """Why a file is not where it belongs; '' where it is."""
    if (there["what"], f"{there['number']:05}") != (path.parent.name, path.stem):
        return f"is chunk {there['number']} of the {there['what']}, under another name"
    return ""


def opened(path: Path) -> tuple[dict[str, Any], bytes]:
    """The metadata and the content of a file that is as it was written. Raises ValueError: it is not."""
    content = path.read_bytes()
    seals = set(SEAL.findall(content))
    if len(seals) != 1:
        raise ValueError("is no file of a sweep, or cut: it has no checksum")
    (seal,) = seals
    if hashlib.sha256(content.replace(seal, BLANK)).hexdigest().encode() != seal:
        raise ValueError("is damaged: its checksum is another one")
    try:  # whoever can work out a checksum may still have written anything
        about = dict(json.loads(pq.read_schema(pa.BufferReader(content)).metadata[KEY]))
        int(about["number"]), str(about["what"])
    except (OSError, KeyError, TypeError, ValueError) as error:
        raise ValueError("is none that a sweep wrote") from error
    return about, content


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
