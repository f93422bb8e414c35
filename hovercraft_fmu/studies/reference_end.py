"""Where the craft really is at the end of a scene: a closed form where there is one, else an independent solver."""

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from ..model.craft import Craft
from ..model.dynamics import Controls, State, derivatives, friction_radius, slip_speed
from ..scenes import Row, Scene

TOLERANCES = (1e-12, 1e-10)
"""Of the solver: the one that counts, and the one that it is checked against."""


def reference_end(scene: Scene, stop_time: float) -> tuple[State, float]:
    """The state at `stop_time` [s], and how far it can be off: the largest difference between two tolerances.

    Without a closed form: DOP853 (Hairer, Norsett, Wanner: Solving Ordinary Differential Equations I), restarted at
    every row of the controls, which are taken as they are between rows: linear, not held; and where friction brings
    the craft to rest.
    """
    if scene.exact:
        return State(*(float(part[0]) for part in scene.exact(np.array([stop_time])))), 0.0
    fine, coarse = (_solved(scene, stop_time, tolerance) for tolerance in TOLERANCES)
    return State(*map(float, fine)), float(np.abs(fine - coarse).max())


def _solved(scene: Scene, stop_time: float, tolerance: float) -> NDArray[np.float64]:
    state = np.array(scene.start)
    for first, last in itertools.pairwise(scene.rows):
        begin, end = first[0], min(last[0], stop_time)
        if end > begin:
            state = _stretch(scene.craft, first, last, (begin, end), state, tolerance)
    return state


REST = 100.0
"""Tolerances: sliding slower than this, in m/s, the solver would only jump to and fro about the point of rest."""


def _stretch(
    craft: Craft, first: Row, last: Row, span: tuple[float, float], state: NDArray[np.float64], tolerance: float
) -> NDArray[np.float64]:
    """From row to row; with friction from rest to rest: it stands until a push lets it go."""
    begin, end = span

    def rates(time: float, y: NDArray[np.float64]) -> Any:
        part = (time - first[0]) / (last[0] - first[0])
        controls = Controls(*(a + part * (b - a) for a, b in zip(first[1:], last[1:], strict=True)))
        return derivatives(State(*y), controls, craft)

    def slip(_time: float, y: NDArray[np.float64]) -> float:
        return slip_speed(y[3], y[4], friction_radius(craft) * y[5]) - REST * tolerance

    slip.terminal, slip.direction = True, -1.0  # type: ignore[attr-defined]
    events = slip if craft.rubs else None
    while begin < end:
        if craft.rubs and not any(rates(begin, state)):
            return state  # held until the next row: where friction counts, the controls of the scenes hold
        solved = solve_ivp(rates, (begin, end), state, "DOP853", rtol=tolerance, atol=tolerance, events=events)
        state, begin = solved.y[:, -1], float(solved.t[-1])
        if begin < end:
            state[3:] = 0.0
    return state
