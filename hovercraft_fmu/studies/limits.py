"""When the FMU warns: the limits of each method, by a measured rule.

Random sensible craft run for a minute, with sub-steps from right to wrong. The limits are fitted on one seed: of all
pairs (drag: stability_number; rotation: rotation_per_substep) that warn of at least CAUGHT of the runs that end off by
more than OFF of their way, the one whose warnings are least often of runs that are RIGHT. What the table of methods has
is near that, rounded, and what it comes to is reported on another seed.
"""

import itertools
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import polars as pl

from ..model.dynamics import Controls, State
from ..model.integrators import ADAPTIVE, Integrator
from ..model.subcycling import Settings
from .estimates import KINDS, Array, Lane, Runs, sampled
from .extremes import FIXED
from .laboratory import Tell

FITTED, REPORTED = 1, 2
"""Seeds."""
OFF, RIGHT, CAUGHT = 0.1, 0.01, 0.96
"""1: of the way; of the way; of the runs that are off."""
HORIZON, SEGMENTS = 60.0, 6
"""s; communication steps, each with thrust and thrusters on or off."""
STEPS: Mapping[str, tuple[float, float]] = MappingProxyType(
    {
        "semi_implicit_euler": (0.01, 3.0),
        "drag_implicit": (0.02, 4.0),
        "rk4": (1.0, 60.0),
        "splitting": (0.1, 20.0),
    }
)
"""Sub-steps, in units of the craft's own time: so that half of the runs are right, and one in seven or more is off."""
SAMPLING = f"""\
Warnings, sampled evenly over powers of ten: mass 30 to 1000 kg, length 3 to 30 m, thrust 1 to 100 N, density 0.002 to
2 kg/m3, speeds of 0.1 to 10 m/s any way, up to 1 rad/s; {HORIZON:.0f} s in {SEGMENTS} communication steps, each with
thrust and thrusters on or off; sub-steps up to 10 s, in units of 1/(the fastest drag rate + rotation of the start):
{", ".join(f"{name} {low:g} to {high:g}" for name, (low, high) in STEPS.items())}.
Fitted on seed {FITTED}, reported on seed {REPORTED}. Off: by more than {OFF:.0%} of the way; right: to {RIGHT:.0%}."""
DRAG_LIMITS = np.geomspace(0.05, 8.0, 34)
ROTATION_LIMITS = np.geomspace(0.05, 6.0, 40)
REFERENCE = Settings(0.01, ADAPTIVE, 1e-8)


class Outcome(NamedTuple):
    """Of the runs that stayed finite."""

    error: Array
    """1, of the way"""
    stability: Array
    rotation: Array
    finite: float
    """1: their share"""

    def warned(self, stability: float, rotation: float) -> tuple[float, float]:
        """With such limits: what share of the runs that are off is warned of, and what share of the warned is right."""
        warned = (self.stability > stability) | (self.rotation > rotation)
        caught = warned[self.error > OFF]
        return float(caught.mean()), float((self.error[warned] < RIGHT).mean()) if warned.any() else 1.0


def drawn(seed: int, count: int, method: Integrator) -> Runs:
    """Craft as the study of the error estimate draws them, from any motion; steps in units of their own time."""
    runs = sampled(seed, count, method, KINDS[0])
    rng = np.random.default_rng([seed, FIXED.index(method), count])

    def spread(low: float, high: float) -> Array:
        return 10.0 ** rng.uniform(np.log10(low), np.log10(high), count)

    craft = runs.crafts
    thrust, speed, course = craft.columns["thrust_max"], spread(0.1, 10.0), rng.uniform(-np.pi, np.pi, count)
    yaw_rate: Any = rng.uniform(-1.0, 1.0, count)
    k, turn = craft.drag_factor, craft.thruster_moment / craft.columns["inertia"]
    # drag at the terminal speed and at half the speed of the start; rotation now, and by a thruster
    own = craft.drag_rate * (np.sqrt(k * thrust) + 0.5 * k * speed) + np.abs(yaw_rate) + np.sqrt(turn)
    piece = HORIZON / SEGMENTS
    h = piece / np.ceil(piece / np.minimum(spread(*STEPS[method.name]) / own, piece) - 1e-9)
    start = State(0.0, 0.0, 0.0, speed * np.cos(course), speed * np.sin(course), yaw_rate)
    on: list[list[Any]] = [
        [(rng.random(count) < share).astype(float) for share in (0.6, 0.25, 0.25)] for _ in range(SEGMENTS)
    ]
    controls = [Controls(ahead * thrust, port, starboard) for ahead, port, starboard in on]
    return Runs(craft, start, np.full(count, piece), controls, h)


def outcome(runs: Runs, method: Integrator) -> Outcome:
    """Make them, and hold them against the adaptive method."""
    craft, exact, way = Lane(runs, Settings(runs.h, method)), Lane(runs, REFERENCE), np.zeros(len(runs.h))
    for controls in runs.controls:
        before = exact.states.copy()
        craft.go(controls)
        exact.go(controls)
        way += np.hypot(*(exact.states - before)[:2])
    error = np.hypot(*(exact.states - craft.states)[:2]) / way
    finite = np.isfinite(error) & np.isfinite(craft.stability)
    return Outcome(error[finite], craft.stability[finite], craft.rotation[finite], float(finite.mean()))


def fitted(found: Outcome) -> tuple[float, float]:
    """The limits of the rule above."""
    pairs = [(drag, turn, *found.warned(drag, turn)) for drag, turn in itertools.product(DRAG_LIMITS, ROTATION_LIMITS)]
    best = min((pair for pair in pairs if pair[2] >= CAUGHT), key=lambda pair: pair[3])
    return best[0], best[1]


def measure_limits(count: int, tell: Tell) -> pl.DataFrame:
    """A row a method: the limits as fitted and as they are, and what these do to other runs."""
    rows = []
    for done, method in enumerate(FIXED, 1):
        drag, rotation = fitted(outcome(drawn(FITTED, count, method), method))
        found = outcome(drawn(REPORTED, count, method), method)
        caught, right = found.warned(method.stability_limit, method.rotation_limit)
        off, fine = (found.error > OFF).mean(), (found.error < RIGHT).mean()
        rows.append((method.name, count, found.finite, off, fine, drag, rotation, method.stability_limit,
                     method.rotation_limit, caught, right))  # fmt: skip
        tell(done / len(FIXED))
    names = ("method", "runs", "finite", "off", "right", "fitted drag", "fitted rotation", "stability_limit",
             "rotation_limit", "off and warned", "warned and right")  # fmt: skip
    return pl.DataFrame(rows, names, orient="row")
