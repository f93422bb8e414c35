"""Where the craft really is in a scene: a closed form where there is one, else an independent solver."""

import itertools
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from ..model.craft import Craft
from ..model.dynamics import Controls, State, derivatives, friction_radius, slip_speed
from ..scenes import Row, Scene

Array: TypeAlias = NDArray[np.float64]
TOLERANCES = (1e-12, 1e-10)
"""Of the solver: the one that counts, and the one that it is checked against."""


def reference_end(scene: Scene, stop_time: float) -> tuple[State, float]:
    """The state at `stop_time` [s], and how far it can be off: the largest difference between two tolerances."""
    if scene.exact:
        return State(*reference_path(scene, [stop_time])[:, 0].tolist()), 0.0
    fine, coarse = (reference_path(scene, [stop_time], tolerance)[:, 0] for tolerance in TOLERANCES)
    return State(*fine.tolist()), float(np.abs(fine - coarse).max())


def reference_path(scene: Scene, times: Sequence[float] | Array, tolerance: float = TOLERANCES[0]) -> Array:
    """The states at some times [s], ascending and after the start, shape (6, times).

    Without a closed form: DOP853 (Hairer, Norsett, Wanner: Solving Ordinary Differential Equations I), restarted at
    every row of the controls, which are taken as they are between rows: linear, not held; and where friction brings
    the craft to rest.
    """
    asked = np.asarray(times, float)
    if scene.exact:
        return np.array(scene.exact(asked))
    found, state = np.empty((len(State._fields), len(asked))), np.array(scene.start)
    for first, last in itertools.pairwise(scene.rows):
        span = first[0], min(last[0], float(asked[-1]))
        if span[1] > span[0]:
            for begin, end, path in _stretches(scene.craft, first, last, span, state, tolerance):
                here = (asked > begin) & (asked <= end)
                reached = path(np.append(asked[here], end))
                found[:, here], state = reached[:, :-1], reached[:, -1]
    return found


REST = 100.0
"""Tolerances: sliding slower than this, in m/s, the solver would only jump to and fro about the point of rest."""
Stretch: TypeAlias = tuple[float, float, Callable[[Array], Any]]
"""Begin and end [s], and the states at times between them."""


def _stretches(
    craft: Craft, first: Row, last: Row, span: tuple[float, float], state: Array, tolerance: float
) -> Iterator[Stretch]:
    """From row to row; with friction from rest to rest: it stands until a push lets it go."""
    begin, end = span

    def rates(time: float, y: Array) -> Any:
        part = (time - first[0]) / (last[0] - first[0])
        controls = Controls(*(a + part * (b - a) for a, b in zip(first[1:], last[1:], strict=True)))
        return derivatives(State(*y), controls, craft)

    def slip(_time: float, y: Array) -> float:
        return slip_speed(y[3], y[4], friction_radius(craft) * y[5]) - REST * tolerance

    slip.terminal, slip.direction = True, -1.0  # type: ignore[attr-defined]
    while begin < end:
        if craft.rubs and not any(rates(begin, state)):
            # held until the next row: where friction counts, the controls of the scenes hold
            yield begin, end, _standing(state)
            return
        solved = solve_ivp(
            rates, (begin, end), state, "DOP853", rtol=tolerance, atol=tolerance, events=slip if craft.rubs else None,
            dense_output=True,
        )  # fmt: skip
        reached = float(solved.t[-1])
        yield begin, reached, solved.sol
        state, begin = solved.y[:, -1], reached
        if begin < end:
            state[3:] = 0.0
            yield begin, begin, _standing(state)


def _standing(state: Array) -> Callable[[Array], Any]:
    return lambda times: np.repeat(state[:, None], len(times), axis=1)
