"""A run beside a result that was stored: how far each column is off."""

import csv
import math
import os
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .control_log import SHOWN
from .result import Result, check_output


class Difference(NamedTuple):
    """The largest difference of a column."""

    column: str
    largest: float
    """|run - stored| / max(1, |stored|): in the column's unit, relative where the value is above 1 of it."""
    time: float
    """s: when that is."""


def read_columns(path: str | os.PathLike[str]) -> dict[str, NDArray[np.float64]]:
    """A stored result, of this package or of another host: CSV or Parquet, the columns `time` and names of variables.

    Raises:
        ValueError: the name ends in neither; no column `time`, or none of a result; a column twice; time that goes
            back; what is no number.
        ModuleNotFoundError, OSError: it cannot be read.
    """
    path = check_output(path, "reference")
    if path.suffix == ".parquet":
        table = import_module("pyarrow.parquet").read_table(path)
        names = list(table.column_names)
        arrays = [column.to_numpy().astype(np.float64) for column in table.columns]
    else:
        with path.open(newline="", encoding="utf-8-sig") as file:
            names, *rows = list(csv.reader(file)) or [[]]
        try:
            values = np.array(rows, np.float64).reshape(len(rows), len(names))
        except ValueError as error:
            raise ValueError(
                f"{path}: every row must have a number for each of {len(names)} columns; {error}"
            ) from error
        names, arrays = [name.strip() for name in names], list(values.T)
    columns = dict(zip(names, arrays, strict=True))
    if twice := [name for name in columns if names.count(name) > 1]:
        raise ValueError(f"{path}: column {twice[0]!r}: must stand there once")
    if "time" not in columns or not len(columns["time"]):
        raise ValueError(f"{path}: must have a column 'time', with at least one row; it has {', '.join(columns)}")
    if not set(SHOWN) & set(columns):
        raise ValueError(f"{path}: must have a column of a result beside the time; it has {', '.join(columns)}")
    _check_times(path, columns["time"])
    return columns


def _check_times(path: Path, times: NDArray[np.float64]) -> None:
    for i, time in enumerate(times.tolist()):
        if not math.isfinite(time):
            raise ValueError(f"{path}: time = {time!r} in row {i + 1}: must be a finite number")
        if i and time < times[i - 1]:
            raise ValueError(f"{path}: time = {time!r} in row {i + 1}: must not go back; before it is {times[i - 1]}")


def differences(result: Result, stored: Mapping[str, NDArray[np.float64]]) -> list[Difference]:
    """Of every column but the time that both have, the largest first. NaN differs from all but NaN.

    Raises:
        ValueError: a time that is none of the run's, or no column in both.
    """
    rows = result.all_rows
    places = _places(rows["time"], stored["time"])
    names = [name for name in stored if name in result.names and name != "time"]
    if not names:
        raise ValueError(f"reference: must have columns of the run; it has {', '.join(stored)}")
    found = []
    for name in names:
        run, other = rows[name][places].astype(np.float64), stored[name]
        off = np.where(run == other, 0.0, np.abs(run - other) / np.maximum(1.0, np.abs(other)))
        off = np.where(np.isnan(off), np.where(np.isnan(run) & np.isnan(other), 0.0, np.inf), off)
        worst = int(off.argmax())
        found.append(Difference(name, float(off[worst]), float(stored["time"][worst])))
    return sorted(found, key=lambda each: -each.largest)


def _places(times: NDArray[np.float64], stored: NDArray[np.float64]) -> Any:
    """The rows of the run at the times that are stored: the same rows where both have the same; at a jump the last."""
    if np.array_equal(times, stored):
        return slice(None)
    after = np.clip(np.searchsorted(times, stored, side="right"), 1, len(times) - 1)
    nearest = np.where(np.abs(times[after] - stored) < np.abs(times[after - 1] - stored), after, after - 1)
    span = float(times[-1] - times[0])
    for time, place in zip(stored, nearest, strict=True):
        if not abs(time - times[place]) <= 1e-9 * span:
            raise ValueError(f"reference: time = {float(time)!r} s: must be a communication point of the run")
    return nearest
