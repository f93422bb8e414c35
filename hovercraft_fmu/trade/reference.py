"""Where the craft really is at the end of a scene: a closed form where there is one, else an independent solver."""

import importlib
import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..model.dynamics import Controls, State, derivatives
from ..scenes import Scene

TOLERANCES = (1e-12, 1e-10)
"""Of the solver: the one that counts, and the one that it is checked against."""


def reference_end(scene: Scene, stop_time: float) -> tuple[State, float]:
    """The state at `stop_time` [s], and how far it can be off: the largest difference between two tolerances.

    Without a closed form: DOP853 (Hairer, Norsett, Wanner: Solving Ordinary Differential Equations I), restarted at
    every row of the controls, which are taken as they are between rows: linear, not held.

    Raises:
        ModuleNotFoundError: scipy is not installed; says how to install it.
    """
    if scene.exact:
        return State(*(float(part[0]) for part in scene.exact(np.array([stop_time])))), 0.0
    fine, coarse = (_solved(scene, stop_time, tolerance) for tolerance in TOLERANCES)
    return State(*map(float, fine)), float(np.abs(fine - coarse).max())


def _solved(scene: Scene, stop_time: float, tolerance: float) -> NDArray[np.float64]:
    solve = scipy_module("integrate").solve_ivp
    state = np.array(scene.start)
    for first, last in itertools.pairwise(scene.rows):
        begin, end = first[0], min(last[0], stop_time)
        if end <= begin:
            continue

        def rates(time: float, y: NDArray[np.float64], first: Any = first, last: Any = last) -> Any:
            part = (time - first[0]) / (last[0] - first[0])
            controls = Controls(*(a + part * (b - a) for a, b in zip(first[1:], last[1:], strict=True)))
            return derivatives(State(*y), controls, scene.craft)

        state = solve(rates, (begin, end), state, "DOP853", rtol=tolerance, atol=tolerance).y[:, -1]
    return state


def scipy_module(name: str) -> Any:
    """scipy.NAME, with a clear message where scipy is missing."""
    try:
        return importlib.import_module(f"scipy.{name}")
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            "the trade is measured against scipy, which is not installed: pip install 'hovercraft-fmu[trade]'"
        ) from error
