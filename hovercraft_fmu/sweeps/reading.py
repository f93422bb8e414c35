"""Reads what a sweep left: its rows, between what they lie, which runs never reached an event."""

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from operator import itemgetter
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset as ds
import pyarrow.parquet as pq
from numpy.typing import NDArray
from pyarrow.fs import FSSpecHandler, PyFileSystem

from .place import Place, place_of
from .quantities import display
from .store import KEY, OF_ONE_FILE, RUNS, TRAJECTORIES, chunk_file, chunk_numbers, different, misplaced, opened

AT_ONCE = 2**16
"""Rows that are worked on at a time."""
LISTED = 10
"""Numbers of runs, or of chunks, that are told."""


def load(folder: str | os.PathLike[str], what: str = RUNS, check: bool = True) -> ds.Dataset:
    """The results of a finished sweep: a row a run, in their order; or the trajectories, a row a point of time.

    A pyarrow dataset: nothing is read but the first file until rows are asked for, by `to_table` or, where they are
    too many for memory, `to_batches`, each with `columns` and `filter`; `to_table().to_pandas()` wants pandas. Only
    the files that may have what a filter of `run` asks for are opened.

    The metadata of its schema is what all files share: the study, versions, the FMU's SHA-256, as JSON. A file alone,
    or what is there of a sweep that was ended, is plain Parquet: pandas.read_parquet(folder / "runs").

    Args:
        folder: of the sweep, or its address.
        what: runs or trajectories.
        check: wherever rows of a file are asked for read all of it, and compare its checksum, its study and its
            number: ValueError where they are others. Without, only the parts that are asked for are read.

    Raises:
        FileNotFoundError: there is no sweep.
        ValueError: it is not finished; its first file is damaged; it kept no trajectories.
    """
    if what not in (RUNS, TRAJECTORIES):
        raise ValueError(f"what = {what!r}: must be one of {RUNS}, {TRAJECTORIES}")
    place = place_of(folder)
    numbers = set(chunk_numbers(place, RUNS))
    if not numbers:
        raise FileNotFoundError(f"{folder}: no sweep is there")
    about, _ = _checked(place, chunk_file(RUNS, min(numbers)), {})
    chunks = range(-(-about["runs"] // about["chunk"]))
    if missing := [number for number in chunks if number not in numbers]:
        raise ValueError(
            f"{folder}: {len(numbers)} of {len(chunks)} chunks are there, not {_listed(missing)}: "
            "finish it with the same command"
        )
    if what not in about["files"]:
        raise ValueError(f"{folder}: the sweep kept no trajectories")
    _, content = _checked(place, chunk_file(what, 0), about)
    shared = {name: value for name, value in about.items() if name not in OF_ONE_FILE}
    schema = pq.read_schema(pa.BufferReader(content)).with_metadata({KEY: json.dumps(shared)})
    files = PyFileSystem(_Checked(place, shared) if check else FSSpecHandler(place.store[0]))
    form = ds.ParquetFileFormat()
    parts = [
        form.make_fragment(place.path(chunk_file(what, number)), files, _runs_of(number, about["chunk"]))
        for number in chunks
    ]
    return ds.FileSystemDataset(parts, schema, form, files)


class _Checked(FSSpecHandler):  # type: ignore[misc]
    """Gives a file to whoever reads it when all of it is as it was written, and is of that sweep."""

    def __init__(self, place: Place, about: Mapping[str, Any]) -> None:
        super().__init__(place.store[0])
        self.place, self.about = place, about

    def open_input_file(self, path: str) -> pa.BufferReader:
        return pa.BufferReader(_checked(self.place, path.removeprefix(self.place.path("")), self.about)[1])


def _runs_of(chunk: int, size: int) -> pc.Expression:
    """What is known of the rows of a chunk, so that a filter of runs need not open it."""
    run = pc.field("run")
    return (run >= chunk * size) & (run < (chunk + 1) * size)


def _listed(numbers: Sequence[int]) -> str:
    return ", ".join(map(str, numbers[:LISTED])) + (", ..." if len(numbers) > LISTED else "")


def _checked(place: Place, name: str, about: Mapping[str, Any]) -> tuple[dict[str, Any], bytes]:
    """The metadata and the content. Raises ValueError where it is damaged, elsewhere, or of another sweep."""
    with suppress(FileNotFoundError):
        try:
            there, content = opened(place, name)
            why = (different(there, about) if about else "") or misplaced(name, there)
        except ValueError as error:
            why = str(error)
        if not why:
            return there, content
        raise ValueError(f"{place}/{name}: {why}: remove it; the same command makes it anew")
    raise ValueError(f"{place}/{name}: is missing; the same command makes it anew")


# ---- what they come to


def about_of(runs: ds.Dataset) -> dict[str, Any]:
    """The metadata that all files of a sweep share; see `load`."""
    about: dict[str, Any] = json.loads(runs.schema.metadata[KEY])
    return about


def batches(runs: ds.Dataset, columns: Sequence[str]) -> Iterator[pa.RecordBatch]:
    """Some rows at a time, file by file: the dataset's own `to_batches` has several of them in memory."""
    for path in runs.files:
        with pq.ParquetFile(runs.filesystem.open_input_file(path)) as file:
            yield from file.iter_batches(AT_ONCE, columns=list(columns), use_threads=False)


def numbers_of(rows: pa.RecordBatch | pa.Table, column: str) -> NDArray[Any]:
    """A column as numpy has it: NaN where there is nothing."""
    values: NDArray[Any] = rows[column].to_numpy(zero_copy_only=False)
    return values


class Extreme(NamedTuple):
    """The least and the greatest of a column, in its display unit, and the runs that they are of."""

    column: str
    unit: str
    least: float
    least_run: dict[str, Any]
    """Swept parameter, with its display unit -> value"""
    greatest: float
    greatest_run: dict[str, Any]


class Unreached(NamedTuple):
    """An event that did not happen in some of the runs that were not refused."""

    event: str
    runs: int
    """How many."""
    first: list[int]
    """The numbers of the first ten of them."""


class Overview(NamedTuple):
    """What the rows of a sweep come to."""

    extremes: list[Extreme]
    """Of the columns that have a value at all."""
    unreached: list[Unreached]
    """Of the events that some run did not reach."""


def overview(folder: str | os.PathLike[str]) -> Overview:
    """Between what the columns of a finished sweep lie, and what never happened: in one go over its rows, of which
    some are in memory at a time. Raises as `load` and what it gives do.
    """
    runs = load(folder)
    about = about_of(runs)
    swept, kept = about["swept"], about["kept"]
    least: dict[str, _Value] = {}
    greatest: dict[str, _Value] = {}
    missed = {name: Unreached(name, 0, []) for name in json.loads(about["study"])["keep"].get("events", {})}
    for rows in batches(runs, ["run", *swept, *kept, "error"]):
        for name in kept:
            values = numbers_of(rows, name)
            there = np.flatnonzero(~np.isnan(values))  # nanargmin takes a NaN where all others are infinite
            if there.size:
                ends = there[values[there].argmin()], there[values[there].argmax()]
                low, high = (_value(rows, int(i), name, swept) for i in ends)
                least[name] = min(least.get(name, low), low, key=_VALUE)  # of equal ones the first
                greatest[name] = max(greatest.get(name, high), high, key=_VALUE)
        for name, sofar in missed.items():
            missed[name] = _missed(rows, sofar)
    extremes = [Extreme(name, display(name)[0], *least[name], *greatest[name]) for name in kept if name in least]
    return Overview(extremes, [each for each in missed.values() if each.runs])


_Value: TypeAlias = tuple[float, dict[str, Any]]
"""In its display unit, and the swept parameters of its run."""
_VALUE = itemgetter(0)


def _value(rows: pa.RecordBatch, i: int, name: str, swept: Sequence[str]) -> _Value:
    return rows[name][i].as_py() * display(name)[1], dict(_shown(each, rows[each][i].as_py()) for each in swept)


def _shown(name: str, value: Any) -> tuple[str, Any]:
    """A swept parameter as people read it: degrees, where it is an angle."""
    unit, factor = display(name)
    return (f"{name} [{unit}]", value * factor) if factor != 1.0 else (name, value)


def _missed(rows: pa.RecordBatch, sofar: Unreached) -> Unreached:
    """With those of these rows, too."""
    nothing = rows[f"{sofar.event}.time"].is_null()
    found = rows["run"].filter(pc.and_(nothing, rows["error"].is_null()))
    first = found[: LISTED - len(sofar.first)].to_pylist()
    return Unreached(sofar.event, sofar.runs + len(found), sofar.first + first)
