"""From the pieces of a run to the rows of its result."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..fmu.interface import INPUTS
from ..model.dynamics import Controls
from .planning import Run
from .points import Piece, ends, schedule
from .result import Result


def recorded(
    run: Run,
    columns: Sequence[tuple[str, Any]],
    go: Callable[[Piece], None],
    see: Callable[[], Sequence[float]],
) -> Result:
    """Make a run and keep what is seen of it.

    Args:
        run: what is run.
        columns: name and type of what is seen; the inputs are among it, and are shown as they were asked for.
        go: makes a piece.
        see: reads the columns.
    """
    rows = _Rows(columns)
    start, end = ends(run)
    seen = see()
    rows.add(run.start_time, start, seen, is_point=True)
    for piece in schedule(run):
        if piece.first != rows.inputs:
            rows.add(piece.time, piece.first, seen, is_point=False)
        go(piece)
        seen = see()
        rows.add(piece.end, piece.last, seen, piece.is_point)
    if end != rows.inputs:
        rows.add(piece.end, end, seen, is_point=False)
    whole = rows.whole()
    return Result(whole[rows.points], run, whole=whole)


CHUNK = 4096
"""Rows: numbers of Python take four times the room of numpy's."""


class _Rows:
    """Rows of a result as they come."""

    def __init__(self, columns: Sequence[tuple[str, Any]]) -> None:
        self._type = np.dtype([("time", np.float64), *columns])
        self._places = [self._type.names.index(name) for name in INPUTS] if self._type.names else []
        self._chunks: list[NDArray[np.void]] = []
        self._rows: list[tuple[float, ...]] = []
        self.inputs = Controls()
        """Of the last row."""
        self.points: list[bool] = []
        """Which rows are communication points."""

    def add(self, time: float, inputs: Controls, seen: Sequence[float], is_point: bool) -> None:
        row = [time, *seen]
        for place, value in zip(self._places, inputs, strict=True):
            row[place] = value
        self._rows.append(tuple(row))
        self.points.append(is_point)
        self.inputs = inputs
        if len(self._rows) == CHUNK:
            self._pack()

    def _pack(self) -> None:
        self._chunks.append(np.array(self._rows, self._type))
        self._rows = []

    def whole(self) -> NDArray[np.void]:
        self._pack()
        return np.concatenate(self._chunks)
