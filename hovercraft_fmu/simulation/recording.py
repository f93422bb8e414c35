"""From the pieces of a run to the rows of its result."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

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
    rows: list[tuple[float, ...]] = []
    asked: list[Controls] = []
    points: list[bool] = []

    def keep(time: float, inputs: Controls, seen: Sequence[float], is_point: bool) -> None:
        rows.append((time, *seen))
        asked.append(inputs)
        points.append(is_point)

    start, end = ends(run)
    time, seen = run.start_time, see()
    keep(time, start, seen, is_point=True)
    for piece in schedule(run):
        if piece.first != asked[-1]:
            keep(time, piece.first, seen, is_point=False)
        go(piece)
        time, seen = piece.end, see()
        keep(time, piece.last, seen, piece.is_point)
    if end != asked[-1]:
        keep(time, end, seen, is_point=False)
    whole = np.array(rows, dtype=[("time", np.float64), *columns])
    for name, values in zip(INPUTS, zip(*asked, strict=True), strict=True):
        whole[name] = values
    return Result(whole[points], run, whole=whole)
