"""The communication points of a run, and what the inputs do between them."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import NamedTuple

import fmpy
import fmpy.simulation
import numpy as np

from ..fmu.interface import INPUTS
from ..host.ramps import parts
from ..model.dynamics import Controls
from ..model.subcycling import rounding
from ..scenes import signals
from .planning import Run


class Piece(NamedTuple):
    """A communication step, or a part of one: wherever the inputs jump or bend a new one begins."""

    time: float
    """s: its start"""
    end: float
    """s"""
    first: Controls
    """At its start, after a jump there; linear from here"""
    last: Controls
    """to here, at its end, before a jump there."""
    is_point: bool
    """Whether a communication point is at its end: a regular one, a jump, or the end of the run."""


class _Knot(NamedTuple):
    """Rows of the inputs at one time."""

    time: float
    """s"""
    before: Controls
    after: Controls


class _Inputs:
    """The inputs of a run over time. They are asked for in the order of time: it goes from row to row."""

    def __init__(self, run: Run) -> None:
        self._start, self._step = abs(run.start_time), run.communication_step
        self._knots = self._without_idle(self._merged(run))
        self._next = 0

    def is_same(self, a: float, b: float) -> bool:
        """Whether two times [s] differ by rounding alone."""
        return abs(a - b) <= rounding(max(self._start, abs(a), abs(b)), self._step)

    def _merged(self, run: Run) -> list[_Knot]:
        """Rows at one time are one."""
        knots: list[_Knot] = []
        columns = (run.signals[name].tolist() for name in INPUTS)
        for time, *values in zip(run.signals["time"].tolist(), *columns, strict=True):
            controls = Controls(*values)
            if knots and self.is_same(knots[-1].time, time):
                knots[-1] = knots[-1]._replace(after=controls)
            else:
                knots.append(_Knot(time, controls, controls))
        return knots

    @staticmethod
    def _without_idle(knots: list[_Knot]) -> list[_Knot]:
        """Without those where nothing changes; one is left."""
        ahead = [knot.before for knot in knots[1:]] + [knots[-1].after]
        behind = [knots[0].before] + [knot.after for knot in knots[:-1]]
        busy = [
            knot
            for left, knot, right in zip(behind, knots, ahead, strict=True)
            if not left == knot.before == knot.after == right
        ]
        return busy or knots[:1]

    @property
    def are_ramped(self) -> bool:
        """Whether they ever change but in jumps."""
        return any(left.after != right.before for left, right in pairwise(self._knots))

    def next_knot(self, time: float) -> _Knot | None:
        """The next one after a time [s]."""
        knots = self._knots
        while self._next < len(knots) and (
            knots[self._next].time <= time or self.is_same(knots[self._next].time, time)
        ):
            self._next += 1
        return knots[self._next] if self._next < len(knots) else None

    def leaving(self, time: float) -> Controls:
        """The limit from the right, at a time [s]."""
        after = self.next_knot(time)
        before = self._knots[self._next - 1] if self._next else None
        if before is None or after is None:
            return self._knots[-1].after if before else self._knots[0].before
        return before.after if self.is_same(before.time, time) else _between(before, after, time)

    def jump(self, time: float) -> tuple[Controls, Controls]:
        """The limits from the left and from the right, at a time [s]."""
        right = self.leaving(time)
        knot = self._knots[self._next - 1] if self._next else None
        return (knot.before if knot and self.is_same(knot.time, time) else right), right

    def reaching(self, time: float) -> Controls:
        """The limit from the left, at a time [s] up to the next knot after the last time that was asked for."""
        if self._next == len(self._knots):
            return self._knots[-1].after
        after = self._knots[self._next]
        if self._next == 0 or self.is_same(after.time, time):
            return after.before
        return _between(self._knots[self._next - 1], after, time)


def _between(left: _Knot, right: _Knot, time: float) -> Controls:
    if left.after == right.before:
        return right.before
    share = (time - left.time) / (right.time - left.time)
    return Controls(*(a + share * (b - a) for a, b in zip(left.after, right.before, strict=True)))


def schedule(run: Run) -> Iterator[Piece]:
    """The whole run, piece by piece. Communication points are counted from the start: no rounding adds up."""
    inputs = _Inputs(run)
    time, stop, steps = run.start_time, run.stop_time, 0
    while time < stop and not inputs.is_same(time, stop):
        regular = run.start_time + (steps + 1) * run.communication_step
        end, is_point = regular, True
        if end > stop and not inputs.is_same(end, stop):
            end = stop
        first, knot = inputs.leaving(time), inputs.next_knot(time)
        if knot and knot.time < end and not inputs.is_same(knot.time, end):
            end, is_point = knot.time, knot.before != knot.after
        last = inputs.reaching(end)
        yield Piece(time, end, first, first if last == first else last, is_point)
        time = end
        steps += end == regular


def is_ramped(run: Run) -> bool:
    """Whether inputs change but in jumps."""
    return _Inputs(run).are_ramped


def held_steps(run: Run) -> Iterator[tuple[float, float, Controls]]:
    """(start, end) [s] of every step for what takes inputs that hold alone, as the Python FMU and the bare model: and
    they, the values at the middle of the step where they change.
    """
    for piece in schedule(run):
        for time, end, middle in parts(*piece[:4]):
            yield time, end, Controls(*middle)


def ends(run: Run) -> tuple[Controls, Controls]:
    """The inputs at the start of a run, before a jump there, and at its end, after a jump there."""
    inputs = _Inputs(run)
    return inputs.jump(run.start_time)[0], inputs.jump(run.stop_time)[1]


def holding(run: Run) -> Run:
    """The same run with inputs that hold from one communication point to the next, as fmpy's master alone has them."""
    rows = [(run.start_time, *_held_by_fmpy(run, run.start_time, after_event=False))]
    time = run.start_time
    for piece in schedule(run):
        if piece.is_point:
            values = _held_by_fmpy(run, time, after_event=True)
            rows += [(time, *values), (piece.end, *values)]
            time = piece.end
    return replace(run, signals=signals(rows))


def _held_by_fmpy(run: Run, time: float, after_event: bool) -> Controls:
    """The inputs at a time [s], as fmpy's master interpolates them; at a jump, those before it or after it."""
    times = run.signals["time"]
    table = np.stack([run.signals[name] for name in INPUTS])
    values, _ = fmpy.simulation.Input.interpolate(time, times, table, after_event=after_event)
    return Controls(*(float(value) for value in np.ravel(values)))
