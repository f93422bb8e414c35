"""Reads what a sweep left: its rows, between what they lie, which runs never reached an event."""

import io
import json
import os
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from .quantities import display
from .store import KEY, OF_ONE_FILE, RUNS, TRAJECTORIES, chunk_files, different, misplaced, opened


def load(folder: str | os.PathLike[str], what: str = RUNS) -> pa.Table:
    """The results of a finished sweep: a row a run, in their order; or the trajectories, a row a point of time.

    The metadata is what all files share: the study, versions, the FMU's SHA-256, as JSON. A file alone, or what is
    there of a sweep that was ended, is plain Parquet: pandas.read_parquet(folder / "runs").

    Args:
        folder: of the sweep.
        what: runs or trajectories.

    Raises:
        FileNotFoundError: there is no sweep.
        ValueError: it is not finished; a file is damaged or of another sweep; it kept no trajectories.
    """
    if what not in (RUNS, TRAJECTORIES):
        raise ValueError(f"what = {what!r}: must be one of {RUNS}, {TRAJECTORIES}")
    folder = Path(folder)
    files = chunk_files(folder, RUNS)
    if not files:
        raise FileNotFoundError(f"{folder}: no sweep is there")
    about = _checked(files[0], {})[0]
    chunks = -(-about["runs"] // about["chunk"])
    if len(files) != chunks:
        raise ValueError(f"{folder}: {len(files)} of {chunks} chunks are there: finish it with the same command")
    if what not in about["files"]:
        raise ValueError(f"{folder}: the sweep kept no trajectories")
    tables = []
    for path in files:
        there, content = _checked(folder / what / path.name, about)
        tables.append(_table(path, content))
        assert tables[-1].num_rows == there["rows"]
    shared = {name: value for name, value in about.items() if name not in OF_ONE_FILE}
    return pa.concat_tables(tables).replace_schema_metadata({KEY: json.dumps(shared)})


def _table(path: Path, content: bytes) -> pa.Table:
    try:
        return pq.read_table(io.BytesIO(content)).replace_schema_metadata(None)
    except (OSError, ValueError) as error:
        raise ValueError(f"{path}: is none that a sweep wrote: remove it; the same command makes it anew") from error


def _checked(path: Path, about: Mapping[str, Any]) -> tuple[dict[str, Any], bytes]:
    """The metadata and the content. Raises ValueError where it is damaged, elsewhere, or of another sweep."""
    with suppress(FileNotFoundError):
        try:
            there, content = opened(path)
            why = (different(there, about) if about else "") or misplaced(path, there)
        except ValueError as error:
            why = str(error)
        if not why:
            return there, content
        raise ValueError(f"{path}: {why}; the same command makes it anew")
    raise ValueError(f"{path}: is missing; the same command makes it anew")


class Extreme(NamedTuple):
    """The least and the greatest of a column, in its display unit, and the runs that they are of."""

    column: str
    unit: str
    least: float
    least_run: dict[str, Any]
    """Swept parameter, with its display unit -> value"""
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
            (float(values[i]) * factor, dict(_shown(each, runs[each][i].as_py()) for each in about["swept"]))
            for i in places
        )
        found.append(Extreme(name, shown, low, low_run, high, high_run))
    return found


def _shown(name: str, value: Any) -> tuple[str, Any]:
    """A swept parameter as people read it: degrees, where it is an angle."""
    unit, factor = display(name)
    return (f"{name} [{unit}]", value * factor) if factor != 1.0 else (name, value)


def unreached(folder: str | os.PathLike[str]) -> dict[str, list[int]]:
    """Event -> the numbers of the runs that never reached it, of the runs that were not refused. Raises as `load`."""
    runs = load(folder)
    about = json.loads(runs.schema.metadata[KEY])
    made = np.array([each is None for each in runs["error"].to_pylist()])
    events = json.loads(about["study"])["keep"].get("events", {})
    missed = {name: np.isnan(runs[f"{name}.time"].to_numpy()) & made for name in events}
    return {name: runs["run"].to_numpy()[where].tolist() for name, where in missed.items() if where.any()}
