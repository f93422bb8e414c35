"""So many runs that a picture shows cells of them: how many are in each, or the mean of a column there.

In two goes over the rows, of which some are in memory at a time.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
import pyarrow.dataset as ds
from numpy.typing import NDArray

from .quantities import display
from .reading import batches, numbers_of

ACROSS, UP = 160, 120
"""Cells of a panel, at most: each is some of its pixels."""
Numbers: TypeAlias = NDArray[np.float64]


class Plane(NamedTuple):
    """Two columns that runs are drawn over."""

    x: str
    y: str
    mean: str | None
    """Of this column; None: how many runs."""


class Cells(NamedTuple):
    """What is drawn, in display units."""

    x: Numbers
    """The edges of the cells across, ascending, one more than there are."""
    y: Numbers
    values: Numbers
    """Shape (up, across); NaN where there is no run."""


def cells_of(runs: ds.Dataset, planes: Sequence[Plane], listed: Sequence[str]) -> list[Cells]:
    """The cells of each plane, without the runs that have no finite number there.

    Args:
        runs: see `load`.
        planes: at least one.
        listed: columns of few values, as those of a grid: a cell has one or some neighbours of them, as many as each
            other cell. The range of others is cut evenly.
    """
    most = {plane.y: UP for plane in planes} | {plane.x: ACROSS for plane in planes}
    edges = _edges(runs, most, listed)
    sums = [np.zeros((2, len(edges[plane.y]) - 1, len(edges[plane.x]) - 1)) for plane in planes]
    for values in _columns(runs, {*most, *(plane.mean for plane in planes if plane.mean)}):
        places = {name: np.searchsorted(edges[name][1:-1], values[name], side="right") for name in most}
        for plane, added in zip(planes, sums, strict=True):
            _add(plane, values, places, added)
    return [
        Cells(edges[plane.x], edges[plane.y], _drawn(plane, *each)) for plane, each in zip(planes, sums, strict=True)
    ]


def _add(plane: Plane, values: Mapping[str, Numbers], places: Mapping[str, NDArray[np.intp]], sums: Numbers) -> None:
    """To how many runs are in a cell, and to the sum of the column there."""
    weights = values[plane.mean or plane.y]
    kept = np.isfinite(values[plane.x]) & np.isfinite(values[plane.y]) & np.isfinite(weights)
    shape = sums.shape[1:]
    cells = np.ravel_multi_index((places[plane.y][kept], places[plane.x][kept]), shape)
    sums[0] += np.bincount(cells, minlength=sums[0].size).reshape(shape)
    sums[1] += np.bincount(cells, weights[kept], sums[1].size).reshape(shape)


def _drawn(plane: Plane, count: Numbers, total: Numbers) -> Numbers:
    there = np.where(count > 0, count, np.nan)
    return total / there if plane.mean else there


def _columns(runs: ds.Dataset, names: set[str]) -> Iterator[dict[str, Numbers]]:
    columns = sorted(names)
    for rows in batches(runs, columns):
        yield {name: numbers_of(rows, name).astype(np.float64) * display(name)[1] for name in columns}


def _edges(runs: ds.Dataset, most: Mapping[str, int], listed: Sequence[str]) -> dict[str, Numbers]:
    """Of so many cells at most."""
    seen = {name: np.empty(0) for name in most}
    for values in _columns(runs, set(most)):
        for name, column in values.items():
            finite = np.unique(np.concatenate([seen[name], column[np.isfinite(column)]]))
            seen[name] = finite if name in listed else finite[[0, -1]] if finite.size else finite
    return {name: (_between if name in listed else _even)(seen[name], most[name]) for name in most}


def _even(ends: Numbers, most: int) -> Numbers:
    low, high = (ends[0], ends[-1]) if ends.size else (0.0, 0.0)
    return np.linspace(low, high, most + 1) if low < high else np.array([low - 0.5, low + 0.5])


def _between(values: Numbers, most: int) -> Numbers:
    """Half way between neighbours; as many of them in a cell as are needed."""
    if values.size < 2:
        return _even(values, most)
    middle = (values[:-1] + values[1:]) / 2
    size = -(-values.size // most)
    return np.array([2 * values[0] - middle[0], *middle[size - 1 :: size], 2 * values[-1] - middle[-1]])
