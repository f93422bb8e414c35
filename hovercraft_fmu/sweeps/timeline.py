"""The communication points of a run, and which of them can be left out without changing a bit."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..model.dynamics import Controls
from ..model.subcycling import Settings, meant_step, rounding, substeps
from ..simulation import Run, ends, schedule
from .quantities import Keep


class Leg(NamedTuple):
    """A stretch of time over which the controls are linear; the same controls are at both ends where they hold."""

    time: float
    """s, its start"""
    end: float
    """s"""
    first: Controls
    """At its start."""
    last: Controls
    """At its end."""
    kept: bool
    """Whether what is at its end is kept."""


class Timeline(NamedTuple):
    """What every run of a study goes through."""

    start: Controls
    """At the start, before a jump there."""
    start_kept: bool
    legs: tuple[Leg, ...]
    times: NDArray[np.float64]
    """s, of the points that are kept; the last is the end."""
    sampled: NDArray[np.bool_]
    """Which of them are points of the trajectory."""


def timeline(run: Run, keep: Keep) -> Timeline:
    """The steps that `simulate` takes; the end is always kept."""
    start = run.start_time

    def is_sampled(time: float) -> bool:
        if keep.every is None:
            return False
        wanted = start + round((time - start) / keep.every) * keep.every
        return abs(time - wanted) <= rounding(max(abs(start), abs(time)), run.communication_step)

    legs = [Leg(*piece[:4], kept=piece.is_point and (keep.watches or is_sampled(piece.end))) for piece in schedule(run)]
    legs[-1] = legs[-1]._replace(kept=True)
    start_kept = keep.watches or is_sampled(start)
    times = [start] * start_kept + [leg.end for leg in legs if leg.kept]
    sampled = [is_sampled(time) for time in times[:-1]] + [keep.every is not None]
    return Timeline(ends(run)[0], start_kept, tuple(legs), np.array(times), np.array(sampled))


def merged(legs: Iterable[Leg], start_time: float, settings: Settings) -> list[Leg]:
    """Legs with the same controls, held, as one, where nothing is kept in between and no bit of the end changes.

    That is where each of them, and the whole, is a whole number of sub-steps: then all are `step_size` long, however
    the time is cut. Not with the adaptive method: it ends a step at every communication point.
    """
    if settings.integrator.integrate is None:
        return list(legs)
    whole: list[Leg] = []
    for leg in legs:
        last = whole[-1] if whole else None
        if last and not last.kept and _hold_on(last, leg) and _as_one(last, leg, start_time, settings.step_size):
            whole[-1] = last._replace(end=leg.end, kept=leg.kept)
        else:
            whole.append(leg)
    return whole


def _hold_on(first: Leg, second: Leg) -> bool:
    return first.first == first.last == second.first == second.last


def _as_one(first: Leg, second: Leg, start_time: float, step_size: float) -> bool:
    def cut(time: float, end: float) -> tuple[int, float]:
        return substeps(meant_step(time, end - time, start_time, step_size), step_size)

    try:
        parts = [cut(*each[:2]) for each in (first, second)]
        n, h = cut(first.time, second.end)
    except ValueError:  # an impossible step: who makes it says so
        return False
    return n == sum(part for part, _ in parts) and h == parts[0][1] == parts[1][1] == step_size
