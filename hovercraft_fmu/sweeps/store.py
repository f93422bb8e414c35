"""Where a sweep's results are: a folder of Parquet files, one a chunk of runs, each written whole or not at all."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from .quantities import display

RUNS, TRAJECTORIES = "runs", "trajectories"
KEY = b"hovercraft_fmu"
"""Of the metadata: JSON; see `packed`."""
SAME = ("study", "engine", "fmu_sha256", "hovercraft_fmu", "runs", "chunk")
"""What must be the same where a sweep goes on; the rest of the metadata may differ."""


class Store:
    """The folder of one sweep: runs/00000.parquet, ..., and trajectories/ where they are kept.

    Raises:
        ValueError: the folder holds another sweep's results.
    """

    def __init__(self, folder: Path, metadata: Mapping[str, Any]) -> None:
        self.folder = folder
        for path in self._files():
            _check_same(folder, metadata_of(path), metadata)

    @property
    def done(self) -> set[int]:
        """The numbers of the chunks that are there."""
        return {int(path.stem) for path in self._files()}

    def _files(self) -> list[Path]:
        return sorted((self.folder / RUNS).glob("*.parquet"))

    def write(self, chunk: int, files: Mapping[str, bytes]) -> None:
        """Write the files of a chunk; see `packed`. Its runs come last: where they are, all of it is."""
        for what in sorted(files, key=lambda what: what == RUNS):
            self._write(what, chunk, files[what])

    def _write(self, what: str, chunk: int, content: bytes) -> None:
        path = self.folder / what / f"{chunk:05}.parquet"
        path.parent.mkdir(parents=True, exist_ok=True)
        unfinished = path.with_name(f".{path.name}.{os.getpid()}")
        try:
            with unfinished.open("wb") as file:
                file.write(content)
                file.flush()
                os.fsync(file.fileno())
            unfinished.replace(path)
        finally:
            unfinished.unlink(missing_ok=True)


def metadata_of(path: Path) -> dict[str, Any]:
    """The metadata of one file. Raises ValueError where it is not one of a sweep."""
    try:
        return dict(json.loads(pq.read_schema(path).metadata[KEY]))
    except (pa.ArrowInvalid, TypeError, KeyError) as error:
        raise ValueError(f"{path}: must be a Parquet file of a sweep; {error!r}") from error


def _check_same(folder: Path, there: Mapping[str, Any], here: Mapping[str, Any]) -> None:
    different = [name for name in SAME if there.get(name) != here.get(name)]
    if different:
        raise ValueError(
            f"{folder}: holds the results of another sweep ({', '.join(different)} differ): name another folder as "
            "output, or delete it"
        )


def load(folder: str | os.PathLike[str], what: str = RUNS) -> pa.Table:
    """The results of a finished sweep: a row a run, in their order; or the trajectories, a row a point of time.

    The metadata is that of the first file: the study, versions, the FMU's SHA-256, as JSON. A file alone, or what is
    there of a sweep that was ended, is plain Parquet: pandas.read_parquet(folder / "runs").

    Args:
        folder: of the sweep.
        what: runs or trajectories.

    Raises:
        FileNotFoundError: there is no sweep.
        ValueError: it is not finished; or it kept no trajectories.
    """
    if what not in (RUNS, TRAJECTORIES):
        raise ValueError(f"what = {what!r}: must be one of {RUNS}, {TRAJECTORIES}")
    folder = Path(folder)
    files = sorted((folder / RUNS).glob("*.parquet"))
    if not files:
        raise FileNotFoundError(f"{folder}: no sweep is there")
    metadata = metadata_of(files[0])
    chunks = -(-metadata["runs"] // metadata["chunk"])
    if len(files) != chunks:
        raise ValueError(f"{folder}: {len(files)} of {chunks} chunks are there: finish it with the same command")
    if what == TRAJECTORIES:
        files = sorted((folder / TRAJECTORIES).glob("*.parquet"))
        if not files:
            raise ValueError(f"{folder}: the sweep kept no trajectories")
    tables = [pq.read_table(path).replace_schema_metadata(None) for path in files]
    return pa.concat_tables(tables).replace_schema_metadata({KEY: json.dumps(metadata)})


class Extreme(NamedTuple):
    """The least and the greatest of a column, in its display unit, and the runs that they are of."""

    column: str
    unit: str
    least: float
    least_run: dict[str, Any]
    """Swept parameter -> value"""
    greatest: float
    greatest_run: dict[str, Any]


def extremes(folder: str | os.PathLike[str]) -> list[Extreme]:
    """Between what the columns of a finished sweep lie; of those that have a value at all. Raises as `load` does."""
    runs = load(folder)
    about = json.loads(runs.schema.metadata[KEY])
    found = []
    for name in about["kept"]:
        values = runs[name].to_numpy()
        if np.isnan(values).all():
            continue
        shown, factor = display(name)
        places = int(np.nanargmin(values)), int(np.nanargmax(values))
        (low, low_run), (high, high_run) = (
            (float(values[i]) * factor, {each: runs[each][i].as_py() for each in about["swept"]}) for i in places
        )
        found.append(Extreme(name, shown, low, low_run, high, high_run))
    return found


# ---- tables


def packed(table: pa.Table, metadata: Mapping[str, Any]) -> bytes:
    """The content of a Parquet file that says where its rows come from."""
    into = pa.BufferOutputStream()
    # a dictionary of numbers that are all different takes time and room
    pq.write_table(table.replace_schema_metadata({KEY: json.dumps(metadata)}), into, use_dictionary=False)
    content: bytes = into.getvalue().to_pybytes()
    return content


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
