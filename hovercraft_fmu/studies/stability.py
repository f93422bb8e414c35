"""Where each method breaks: its limits in dimensionless steps, and a random study of the extremes.

THE MAP. Straight ahead the model is m*v' = T - k*v*|v|. With kappa = k/m and, coasting, x = h*kappa*v0 for the step,
speeds in units of v0; under thrust x = h*kappa*v_t, speeds in units of the terminal speed v_t = sqrt(T/k). Then neither
mass nor air nor thrust is left in a step, so the limits are the same numbers for every craft:

- Euler, coasting: v' = v*(1 - x). No sign change up to x = 1; |v'| < |v| up to 2; above, |v| grows, x with it.
- Euler, thrust: v' = v + x*(1 - v*|v|), at v = 1 with the slope 1 - 2*x. Overshoots above x = 1/2; above 1 leaves the
  terminal speed for a false cycle whose period doubles and doubles. The largest speed there is x + 1/(4*x); where
  that is thrown on the unstable cycle that runs through both signs, at x = 1.4659, bounds end; at 3/2 in four
  sub-steps: 5/3 -> -1 -> 2 -> -5/2. (Above, narrow windows of x have a cycle again.)
- Drag implicit, coasting: v' = v/(1 + x), exact for every x. Thrust: v' = (v + x)/(1 + x*|v|), at v = 1 with the slope
  (1 - x)/(1 + x): overshoots above x = 1, is never below -1: no limit of stability.
- RK4, coasting: v' = v*P(x), P made of four nested squares, never below 0; P = 1 at x = 2.4552.
- RK4, thrust: the slope at v = 1 is 1 - z + z^2/2 - z^3/6 + z^4/24 with z = 2*x, never below 0, 1 at z = 2.7853,
  x = 1.3926. Above, it settles at a false speed. Where that diverges is measured only.
- Spin: the drag point moves with w = r*x_d, and w' = -k*(1/m + x_d^2/I)*w*|w|: coasting, with that factor for kappa.

The stability number of the FMU is sigma = h*2*k*q*(1/m + x_d^2/I): 2*x straight ahead with x_d = 0, and in a spin.

THE EXTREMES. Random craft, far beyond the sensible. N sub-steps of h; the largest of

    sigma = h*2*k*q*(1/m + x_d^2/I)        drag: the stability number (rotational drag d*r*|r| adds h*2*d*|r|/I)
    rho = h*|r|                            rotation in a sub-step
    tau = h^2*(k*q^2*|x_d| + |turn|)/I     what the air, were it abeam, and the thrusters' moment (turn) can add to it
    alpha = h*(gain of speed by thrust and thrusters)/V
    phi   = h*(loss of speed by friction)/V

wherever the loads are worked out (RK4's stages, too) and at the end, and V, the largest speed of the centre of gravity,
or of the drag point about it (|x_d*r|), or of the wind. All of sigma, rho, sqrt(tau), alpha and phi are proportional to
h: rates of the motion times the sub-step. Drag is minus the slope of the convex function k*q^3/3, so at a held heading
two motions never drift apart by it, and local errors add up without growing.

- First order: a sub-step leaves h^2/2*|v''|. Drag and direction change by delta = sigma + rho + tau of themselves, what
  they act on by delta + alpha of V. So the error is at most C*N*delta*(delta + alpha)*V, where C = 1/2 is Taylor's.
- RK4: rates lambda = sigma + rho + sqrt(tau), and eps = lambda + alpha: lambda*eps^4*V a sub-step; and where the drag
  point passes through rest q has a kink, and one sub-step errs by sigma*eps^2*V, of third order. So the error is
  at most C*(N*lambda*eps^4 + sigma*eps^2)*V. (sqrt(tau) is the rate at which the craft swings about its course, as a
  weathervane does, times h.)
- The directional area has a steeper drag than its own size says, by the longer wall over the shorter, s: s*sigma stands
  for sigma. Where the air comes along a wall it has a kink, which costs RK4 s*sigma*eps*V. Near rest, RK4 with friction
  takes steps of Euler's, so with friction the bound of the first order is added to its own.
- Adaptive: each of its N steps errs by less than the tolerance, in SI units; a heading that is off by it turns a
  velocity V off by V times as much. So the error is at most C*N*tolerance*max(1, V), C = 10. Its steps are its
  own: h is the first one, and is not in the bound.

The constant is 1 in the first two: of some 10^5 runs the worst needs 0.50 for the first order, 0.07 for RK4; with every
term 0.76 and 0.57.
"""

import csv
import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias, cast

import numpy as np
from numpy.typing import NDArray
from rich.console import Group
from rich.table import Table

from ..model.craft import DIRECTIONAL, Craft
from ..model.dynamics import Controls, State, actuation, drag_per_speed, friction_gains, friction_radius
from ..model.integrators import (
    INTEGRATORS,
    MIN_STEP,
    Integrate,
    Integrator,
    StepTooSmallError,
    integrator,
    integrator_number,
    rk4,
)
from ..model.subcycling import NonFiniteError, Settings, advance, stability_number
from ..view.plots import new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array: TypeAlias = Any
"""One number a run, shape (runs,), float64; the model's functions are annotated for one craft and take these, too."""
Mask: TypeAlias = Any
"""Shape (runs,), bool."""
Progress: TypeAlias = Callable[[float], None]
"""Called with the share of the work that is done, 0 to 1."""

FIXED = tuple(method for method in INTEGRATORS if method.integrate)
"""The methods with a fixed step."""


def steps_of(method: Integrator) -> Integrate:
    """The function of a fixed-step method."""
    return cast(Integrate, method.integrate)


# ---- batches


class Runs(NamedTuple):
    """A batch of runs: every number is an array of shape (runs,)."""

    craft: Craft
    controls: Controls
    start: State
    h: Array
    """s, the sub-step"""
    substeps: int
    """of each run"""


def make_runs(craft: Craft, controls: Controls, start: State, h: Array, substeps: int = 1) -> Runs:
    """A batch in which everything has the shape of the broadcast whole: plain floats serve all runs alike."""
    values = [*(getattr(craft, each.name) for each in fields(Craft)), *controls, *start, h]
    arrays: Iterator[Array] = iter(np.broadcast_arrays(*values))
    parameters = {each.name: next(arrays) for each in fields(Craft)}
    controls, start = Controls(*(next(arrays) for _ in controls)), State(*(next(arrays) for _ in start))
    return Runs(Craft(**parameters), controls, start, next(arrays), substeps)


def chosen(runs: Runs, which: Any) -> Runs:
    """Some of the runs: a mask, or indices."""
    craft = Craft(**{each.name: getattr(runs.craft, each.name)[which] for each in fields(Craft)})
    controls, start = cast(tuple[Array, ...], runs.controls), cast(tuple[Array, ...], runs.start)
    return Runs(
        craft, Controls(*(v[which] for v in controls)), State(*(v[which] for v in start)), runs.h[which], runs.substeps
    )


# ---- the map


class Case(NamedTuple):
    """A motion along one line, of some craft at once, with its step in dimensionless form."""

    name: str
    craft: Craft
    thrust: Array
    """N, shape (craft,)"""
    scale: Array
    """m/s: the speed at the start, or the terminal speed, shape (craft,)"""
    unit: Array
    """s: the sub-step at x = 1, shape (craft,)"""
    spin: bool = False


NEAR = 1e-4
"""Relative: how far from the terminal speed a disturbed craft starts; the next term is of its square."""
SHORT, LONG = 20, 2000
"""Sub-steps: monotone or not shows at once; a slow return, or the end of a chaotic transient, takes long."""
RUNAWAY = 1e6
"""Times the scale of the speed."""
SCAN = np.concatenate([np.linspace(0.02, 4.0, 200), np.geomspace(4.1, 1e6, 60)])
"""Dimensionless steps, coarse."""
FINE = 64
"""Points between the last one that is right and the first that is not; twice."""


def cases() -> tuple[Case, ...]:
    """The textbook's craft and hard ones: coasting straight, under thrust, in a spin about the centre of gravity."""
    mass: Array = np.array([100.0, 1e-3, 1e-3, 1.0, 1e6, 1e6, 10.0, 1e3])
    density: Array = np.array([1.225, 1.225, 1e3, 1e-6, 1e3, 1.225, 1e3, 0.0023769])
    fraction: Array = np.array([-0.25, -0.5, 0.0, -0.5, -0.5, 0.0, -0.1, -0.25])
    speed: Array = np.array([2.0, 1e6, 1e3, 1e6, 1e-3, 1e6, 1.0, 1e-6])
    thrust: Array = np.array([5.0, 1e9, 1.0, 1e-3, 1e9, 1e6, 1e-6, 1e9])
    craft = Craft(mass=mass, air_density=density, drag_center_fraction=fraction, thrust_max=thrust)
    k = craft.drag_factor
    terminal = np.sqrt(thrust / k)
    # in the spin the point of drag must stop long before the craft has turned: a light craft in a dense medium
    thin = Craft(mass=mass, inertia=np.minimum(500.0, 1e-3 * mass), air_density=1e3, drag_center_fraction=-0.5)
    lever = thin.drag_factor * (1.0 / thin.mass + thin.drag_center**2 / thin.inertia)
    return (
        Case("coasting", craft, 0.0 * mass, speed, mass / (k * speed)),
        Case("thrust", craft, thrust, terminal, mass / (k * terminal)),
        Case("spin", thin, 0.0 * mass, speed, 1.0 / (lever * speed), spin=True),
    )


def lanes(case: Case, x: Array, start: float) -> Runs:
    """One run for each craft and step; x has the shape (craft, steps), the start speed is in units of the scale."""
    which = np.repeat(np.arange(len(case.scale)), x.shape[1])
    parameters: dict[str, Array] = {each.name: np.broadcast_to(getattr(case.craft, each.name), case.scale.shape)[which]
                  for each in fields(Craft)}  # fmt: skip
    craft, speed = Craft(**parameters), start * case.scale[which]
    state = State(yaw_rate=speed / craft.drag_center) if case.spin else State(vx=speed)
    return make_runs(craft, Controls(case.thrust[which], 0.0, 0.0), state, x.ravel() * case.unit[which])


def speed_of(case: Case, state: State, runs: Runs, shape: tuple[int, ...]) -> Array:
    """The speed of the motion in units of the scale, shape (craft, steps); in a spin, of the drag point abeam."""
    scale = np.repeat(case.scale, shape[1])
    if case.spin:
        c, s = np.cos(state.heading), np.sin(state.heading)
        abeam = c * state.vy - s * state.vx + runs.craft.drag_center * state.yaw_rate
        return (abeam / scale).reshape(shape)
    return (state.vx / scale).reshape(shape)


def _first(case: Case) -> float:
    return 1.0 if not np.any(case.thrust) else 1.0 - NEAR


def _goal(case: Case) -> float:
    return 1.0 if np.any(case.thrust) else 0.0


def monotone(case: Case, method: Integrator, x: Array) -> Mask:
    """Whether the speed comes nearer to where it should go with every sub-step, from one side."""
    runs = lanes(case, x, _first(case))
    state, right, gap = runs.start, np.ones(x.shape, bool), np.ones(x.shape)
    for _ in range(SHORT):
        state = steps_of(method)(state, runs.controls, runs.craft, runs.h, 1, np).state
        new = (speed_of(case, state, runs, x.shape) - _goal(case)) / (_first(case) - _goal(case))
        right &= (new >= -1e-9) & (new <= gap + 1e-9)  # roundings of 1e-16 over NEAR
        gap = new
    return right


def stable(case: Case, method: Integrator, x: Array) -> Mask:
    """Whether the speed, disturbed a little, ends nearer to where it should go."""
    runs = lanes(case, x, _first(case))
    end = steps_of(method)(runs.start, runs.controls, runs.craft, runs.h, LONG, np).state
    gap = (speed_of(case, end, runs, x.shape) - _goal(case)) / (_first(case) - _goal(case))
    return np.abs(gap) < 0.999  # the slowest, drag_implicit at 10^6, loses 0.4 % in LONG


def bounded(case: Case, method: Integrator, x: Array) -> Mask:
    """Whether the speed stays within bounds; under thrust from rest, and from near the terminal speed."""
    right = np.ones(x.shape, bool)
    for start in (_first(case), 0.0) if np.any(case.thrust) else (1.0,):
        runs = lanes(case, x, start)
        end = steps_of(method)(runs.start, runs.controls, runs.craft, runs.h, LONG, np).state
        right &= np.abs(speed_of(case, end, runs, x.shape)) < RUNAWAY
    return right


QUALITIES: Mapping[str, Callable[[Case, Integrator, Array], Mask]] = MappingProxyType(
    {"monotone": monotone, "stable": stable, "bounded": bounded}
)


def largest_step(case: Case, method: Integrator, quality: str) -> Array:
    """1: the dimensionless step up to which the motion has the quality, shape (craft,); infinite where at all."""
    craft = np.arange(len(case.scale))
    x = np.tile(SCAN, (len(craft), 1))
    with np.errstate(all="ignore"):
        right = QUALITIES[quality](case, method, x)
        for _ in range(2):
            failed = np.argmin(right, axis=1)
            low = np.where(failed > 0, x[craft, failed - 1], 0.0)
            never = right.all(axis=1)
            x = np.linspace(low, np.where(never, low, x[craft, failed]), FINE, axis=1)
            right = np.where(never[:, None], True, QUALITIES[quality](case, method, x))
            right[:, 0], right[:, -1] = True, never
    failed = np.argmin(right, axis=1)
    return np.where(right.all(axis=1), np.inf, 0.5 * (x[craft, failed - 1] + x[craft, failed]))


FIRST_STEPS = (0.02, 0.5, 1.5, 3.0, 30.0, 1e3, 1e6)
"""Dimensionless first steps of the adaptive method."""
UNITS = 30
"""Of the case's own time, that it runs on; a communication point after each."""
ADAPTIVE = integrator(integrator_number("adaptive"))


def largest_first_step(case: Case) -> dict[str, list[float]]:
    """For each quality and craft: the largest of FIRST_STEPS up to which the adaptive method has it; infinite for all.

    Left out are craft whose whole time is so short that the smallest step, 1e-12 s, is no small part of it: there the
    method refuses loudly.
    """
    table: dict[str, list[float]] = {quality: [] for quality in QUALITIES}
    for i in np.flatnonzero(case.unit > 1e4 * MIN_STEP):
        right = [adaptive_qualities(case, int(i), x) for x in FIRST_STEPS]
        for quality, column in zip(QUALITIES, zip(*right, strict=True), strict=True):
            good = [x for x, right in zip(FIRST_STEPS, column, strict=True) if right]
            table[quality].append(math.inf if len(good) == len(FIRST_STEPS) else max(good, default=0.0))
    return table


def adaptive_qualities(case: Case, i: int, x: float) -> tuple[bool, bool, bool]:
    """Monotone, stable, bounded: one craft of the case with a first step, at a tolerance of 1e-9 of the scale."""
    runs = lanes(case._replace(unit=x * case.unit), np.ones((len(case.scale), 1)), _first(case))
    craft, controls, state = single(runs, i)
    settings = Settings(x * float(case.unit[i]), ADAPTIVE, 1e-9 * float(case.scale[i]))
    proposed, gaps = 0.0, [1.0]
    one = case._replace(scale=case.scale[i : i + 1])
    for _ in range(UNITS):
        stretch = advance(state, controls, craft, float(case.unit[i]), settings, proposed=proposed)
        state, proposed = stretch.state, stretch.proposed
        arrays = State(*cast(Iterator[Array], map(np.atleast_1d, state)))
        speed = float(speed_of(one, arrays, chosen(runs, [i]), (1, 1))[0, 0])
        gaps.append((speed - _goal(case)) / (_first(case) - _goal(case)))
    slack = 1e-8 * UNITS / abs(_first(case) - _goal(case))  # some steps' errors, in units of the gap
    steps = list(itertools.pairwise(gaps))
    monotone = all(new <= old + slack and new >= -slack for old, new in steps)
    return monotone, abs(gaps[-1]) < 0.999, max(map(abs, gaps)) < RUNAWAY


def single(runs: Runs, i: int) -> tuple[Craft, Controls, State]:
    """One of the runs, in plain floats."""
    one = chosen(runs, [i])
    values: dict[str, Any] = {each.name: getattr(one.craft, each.name)[0].item() for each in fields(Craft)}
    craft = Craft(**values)
    controls, start = ([float(np.asarray(value)[0]) for value in values] for values in (one.controls, one.start))
    return craft, Controls(*controls), State(*start)


THEORY: Mapping[tuple[str, str], tuple[float, float, float]] = MappingProxyType(
    {
        ("semi_implicit_euler", "coasting"): (1.0, 2.0, 2.0),
        ("semi_implicit_euler", "thrust"): (0.5, 1.0, 1.4659),
        ("drag_implicit", "coasting"): (np.inf, np.inf, np.inf),
        ("drag_implicit", "thrust"): (1.0, np.inf, np.inf),
        ("rk4", "coasting"): (2.4552, 2.4552, 2.4552),
        # half the root of z^3/24 - z^2/6 + z/2 = 1
        ("rk4", "thrust"): (1.3926, 1.3926, np.nan),
    }
)
"""Monotone, stable, bounded up to these dimensionless steps; a spin as coasting; NaN: no theory."""


def theory(method: Integrator, case: str) -> tuple[float, float, float]:
    """The limits that the docstring of the module derives."""
    return THEORY[method.name, "coasting" if case == "spin" else case]


class Limit(NamedTuple):
    """One row of the map."""

    method: str
    case: str
    quality: str
    smallest: float
    """1, over the craft"""
    largest: float
    """1, over the craft"""
    theory: float


def measure_map(progress: Progress | None = None) -> list[Limit]:
    """All limits of all methods."""
    rows, all_cases = [], cases()
    for i, method in enumerate(FIXED):
        for j, case in enumerate(all_cases):
            for quality, expected in zip(QUALITIES, theory(method, case.name), strict=True):
                x = largest_step(case, method, quality)
                rows.append(Limit(method.name, case.name, quality, float(x.min()), float(x.max()), expected))
            if progress:
                progress((i * len(all_cases) + j + 1) / (len(FIXED) * len(all_cases)))
    for case in all_cases:
        for quality, limits in largest_first_step(case).items():
            rows.append(Limit(ADAPTIVE.name, case.name, quality, min(limits), max(limits), math.inf))
    return rows


# ---- the extremes

FAILED, WARNED, ACCURATE, SILENT = range(4)
VERDICTS = ("failed", "warned", "accurate", "silent")
"""A number that is not finite; a limit of the method passed; within the formula; none of these, which must not be."""
SUBSTEPS = (1, 4, 16, 64)
"""N, in turn from batch to batch."""
BATCH = 4096
"""Runs that share N and fit into the processor's cache."""
REFINED, CHECKED = 16, 32
"""The reference is RK4 at this fraction of the sub-step, and checked against the first: 2^3 nearer at worst."""
NO_REFERENCE = 8.0
"""1: the sigma above which the formula promises less than any motion inside V keeps, and nothing is left to check."""
ROUNDING = 1e-11
"""Of V: some ten thousand roundings, of RK4 at h/32."""


def absolute_steps(rng: np.random.Generator, runs: Runs) -> Array:
    """s: from 1e-5 to 10, whatever the craft."""
    return _logarithmic(rng, 1e-5, 10.0, len(runs.h))


def own_steps(rng: np.random.Generator, runs: Runs) -> Array:
    """s: 1e-5 to 3 times the time in which the craft's motion changes, at most 10 s."""
    thrust, side, turn = actuation(runs.controls, runs.craft, np)
    craft, k = runs.craft, runs.craft.drag_factor
    force = np.abs(thrust) + np.abs(side) + np.abs(turn / craft.length)
    # drag at the speed of the start and at the terminal speed, rotation now and by the thrusters
    drag = craft.drag_rate * (drag_per_speed(runs.start, runs.controls, craft, np) + np.sqrt(k * force))
    rotation = np.abs(runs.start.yaw_rate) + np.sqrt(np.abs(turn) / craft.inertia)
    return np.minimum(_logarithmic(rng, 1e-5, 3.0, len(runs.h)) / (drag + rotation + 1e-6), 10.0)


WITH_TERMS = "the same, with every term"
SAMPLINGS: Mapping[str, Callable[[np.random.Generator, Runs], Array]] = MappingProxyType(
    {"steps 1e-5 to 10 s": absolute_steps, "steps to the craft's own time": own_steps, WITH_TERMS: own_steps}
)


def _logarithmic(rng: np.random.Generator, low: float, high: float, count: int) -> Array:
    return 10.0 ** rng.uniform(np.log10(low), np.log10(high), count)


def sample(rng: np.random.Generator, count: int, substeps: int, sampling: str) -> Runs:
    """Random extremes: every quantity evenly over its powers of ten, and now and then exactly zero."""

    def spread(low: float, high: float, zeros: float = 0.05) -> Array:
        return np.where(rng.random(count) < zeros, 0.0, _logarithmic(rng, low, high, count))

    def command(zeros: float) -> Array:
        return np.where(rng.random(count) < zeros, 0.0, rng.random(count))

    limit = spread(1e-3, 1e9)
    craft = Craft(
        mass=_logarithmic(rng, 1e-3, 1e6, count),
        inertia=_logarithmic(rng, 1e-3, 1e6, count),
        length=_logarithmic(rng, 0.1, 100.0, count),
        air_density=spread(1e-6, 1e3),
        drag_center_fraction=-0.5 * command(0.05),
        steering_force=spread(1e-3, 1e9),
        thrust_min=-limit,
        thrust_max=limit,
    )
    controls = Controls(limit * (2.0 * command(0.1) - 1.0), command(0.4), command(0.4))
    speed, course = spread(1e-6, 1e6), np.pi * (2.0 * command(0.0) - 1.0)
    start = State(
        heading=10.0 * (2.0 * command(0.0) - 1.0),
        vx=speed * np.cos(course),
        vy=speed * np.sin(course),
        yaw_rate=spread(1e-6, 1e4) * rng.choice([-1.0, 1.0], count),
    )
    if sampling == WITH_TERMS:
        craft = replace(
            craft,
            drag_area=cast(Any, rng.integers(1, 3, count)),
            rotational_drag=command(0.4),
            skirt_friction=spread(1e-6, 10.0, 0.4),
        )
        blows, from_where = spread(1e-6, 1e6, 0.4), 2.0 * np.pi * command(0.0)
        controls = controls._replace(wind_x=blows * np.cos(from_where), wind_y=blows * np.sin(from_where))
    runs = make_runs(craft, controls, start, np.ones(count), substeps)
    return runs._replace(h=SAMPLINGS[sampling](rng, runs))


class Outcome(NamedTuple):
    """What a run came to; the largest are over the starts of the sub-steps and the end, shape (runs,) each."""

    end: State
    sigma: Array
    rho: Array
    tau: Array
    alpha: Array
    phi: Array
    speed: Array
    """m/s: V"""
    finite: Mask


def carry_out(runs: Runs, method: Integrator) -> Outcome:
    """Make all sub-steps, and watch."""
    state, craft, h, step = runs.start, runs.craft, runs.h, steps_of(method)
    sigma = drag = rho = np.zeros_like(h)
    wind = np.hypot(runs.controls.wind_x, runs.controls.wind_y)
    speed = np.fmax(_size(state.vx, state.vy, state.yaw_rate, craft), wind)
    finite = np.ones(h.shape, bool)
    with np.errstate(all="ignore"):
        for _ in range(runs.substeps):
            stretch = step(state, runs.controls, craft, h, 1, np)
            state = stretch.state
            sigma = np.fmax(sigma, stability_number(stretch.drag_mass, stretch.rotation, craft))
            drag, rho = np.fmax(drag, stretch.drag_mass), np.fmax(rho, stretch.rotation)
            speed = np.fmax(speed, _size(state.vx, state.vy, state.yaw_rate, craft))
            finite &= np.isfinite(np.sum(state, axis=0))
        alpha, phi = _per(_gain(runs), speed), _per(_grip(runs), speed)
        return Outcome(state, sigma, rho, _swing(runs, drag), alpha, phi, speed, finite)


def _swing(runs: Runs, drag: Array) -> Array:
    """1: tau, from the largest h*k*q [kg]; k*q^2 = (k*q)^2/k, and without drag nothing."""
    craft, k = runs.craft, runs.craft.drag_factor
    turn = np.abs(actuation(runs.controls, craft, np)[2])
    least = np.where(craft.drag_area == DIRECTIONAL, np.fmin(craft.drag_factor_ahead, craft.drag_factor_abeam), k)
    pressure = np.divide(drag * drag, least, out=np.zeros_like(drag), where=k > 0.0)
    return (np.abs(craft.drag_center) * pressure + runs.h * runs.h * turn) / craft.inertia


def _size(vx: Any, vy: Any, yaw_rate: Any, craft: Craft) -> Array:
    """m/s: the speed of the centre of gravity, or of the drag point about it, whichever is larger."""
    return np.fmax(np.hypot(vx, vy), np.abs(craft.drag_center * yaw_rate))


def _gain(runs: Runs) -> Array:
    """m/s: what thrust and thrusters add to the speed in a sub-step."""
    thrust, side, turn = actuation(runs.controls, runs.craft, np)
    craft = runs.craft
    return runs.h * _size(thrust / craft.mass, side / craft.mass, turn / craft.inertia, craft)


def _grip(runs: Runs) -> Array:
    """m/s: what friction takes of the speed in a sub-step, of the centre of gravity or of the drag point about it."""
    craft = runs.craft
    if not craft.rubs:
        return np.zeros_like(runs.h)
    straight, turning = friction_gains(craft, runs.h, np)
    return np.fmax(straight, turning * np.abs(craft.drag_center) / friction_radius(craft, np))


def _per(value: Array, speed: Array) -> Array:
    with np.errstate(all="ignore"):
        return np.divide(value, speed, out=np.zeros_like(value), where=speed > 0.0)


def first_order_bound(outcome: Outcome, runs: Runs) -> Array:
    """1, of V: N*delta*(delta + alpha + phi), delta = s*sigma + rho + tau; see the top of the module.

    With friction 2*phi + 8*rho more.
    """
    delta = _aspect(runs) * outcome.sigma + outcome.rho + outcome.tau
    rest = np.where(runs.craft.skirt_friction > 0.0, 2.0 * outcome.phi + 8.0 * outcome.rho, 0.0)
    return runs.substeps * delta * (delta + outcome.alpha + outcome.phi) + rest


def rk4_bound(outcome: Outcome, runs: Runs) -> Array:
    """1, of V: N*lambda*eps^4 + s*sigma*eps^2, lambda = s*sigma + rho + sqrt(tau), eps = lambda + alpha + phi.

    With the directional area, s*sigma*eps more; with friction, the bound of first order.
    """
    drag = _aspect(runs) * outcome.sigma
    rate = drag + outcome.rho + np.sqrt(outcome.tau)
    eps = rate + outcome.alpha + outcome.phi
    smooth = runs.substeps * rate * eps**4 + drag * eps**2
    kinks = np.where(runs.craft.drag_area == DIRECTIONAL, drag * eps, 0.0)
    rest = np.where(runs.craft.skirt_friction > 0.0, first_order_bound(outcome, runs), 0.0)
    return smooth + kinks + rest


def _aspect(runs: Runs) -> Array:
    """1: s, how much steeper the directional drag can be than its own size: the longer over the shorter wall."""
    walls = runs.craft.length / runs.craft.width
    return np.where(runs.craft.drag_area == DIRECTIONAL, np.fmax(walls, 1.0 / walls), 1.0)


class Formula(NamedTuple):
    """The bound of the error at the end of a run."""

    text: str
    bound: Callable[[Outcome, Runs], Array]
    """-> of V, with the constant 1"""
    constant: float = 1.0


FIRST_ORDER = Formula(
    "N*delta*(delta + alpha + phi)*V, delta = s*sigma + rho + tau; with friction (2*phi + 8*rho)*V more",
    first_order_bound,
)
FORMULAS: Mapping[str, Formula] = MappingProxyType(
    {
        "semi_implicit_euler": FIRST_ORDER,
        "drag_implicit": FIRST_ORDER,
        "rk4": Formula(
            "(N*lambda*eps^4 + s*sigma*eps^2)*V, lambda = s*sigma + rho + sqrt(tau), eps = lambda + alpha + phi; "
            "directional: s*sigma*eps*V more; with friction the first order's more",
            rk4_bound,
        ),
    }
)


def passes_limits(outcome: Outcome, method: Integrator) -> Mask:
    """Whether the FMU would warn."""
    return (outcome.sigma > method.stability_limit) | (outcome.rho > method.rotation_limit)


class Judged(NamedTuple):
    """The verdicts on a batch of runs of one method, shape (runs,) each."""

    outcome: Outcome
    error: Array
    """1: of V, the difference in velocity (or in x_d*yaw rate) from the reference at the end; NaN where none is made"""
    bound: Array
    """1: of V, by the formula"""
    doubt: Array
    """1: of V, by how much the reference itself may be wrong"""
    verdict: NDArray[np.int8]


def judge(runs: Runs, methods: Iterable[Integrator] = FIXED) -> dict[str, Judged]:
    """Carry out the runs with each method and hold them against one reference."""
    outcomes = {method: carry_out(runs, method) for method in methods}
    calm = {method: o.finite & ~passes_limits(o, method) for method, o in outcomes.items()}
    needed = np.flatnonzero(np.any([calm[m] & (outcomes[m].sigma <= NO_REFERENCE) for m in calm], axis=0))
    part = chosen(runs, needed)
    near, reference = _reference(part, REFINED), _reference(part, CHECKED)
    doubt = _difference(near, reference, part.craft)
    return {method.name: _judged(o, calm[method], runs, FORMULAS[method.name], needed, reference, doubt)
            for method, o in outcomes.items()}  # fmt: skip


def _reference(runs: Runs, refined: int) -> State:
    with np.errstate(all="ignore"):
        return rk4(runs.start, runs.controls, runs.craft, runs.h / refined, runs.substeps * refined, np).state


def _difference(a: State, b: State, craft: Craft) -> Array:
    with np.errstate(all="ignore"):
        return _size(a.vx - b.vx, a.vy - b.vy, a.yaw_rate - b.yaw_rate, craft)


def _judged(
    outcome: Outcome, calm: Mask, runs: Runs, formula: Formula, needed: NDArray[Any], reference: State, doubt: Array
) -> Judged:
    error, unsure = np.full(runs.h.shape, np.nan), np.full(runs.h.shape, np.nan)
    ends = State(*(np.asarray(values)[needed] for values in outcome.end))
    error[needed] = _per(_difference(ends, reference, chosen(runs, needed).craft), outcome.speed[needed])
    unsure[needed] = _per(doubt, outcome.speed[needed])
    beyond = outcome.sigma > NO_REFERENCE
    error[~calm | beyond] = np.nan
    unsure[~calm | beyond] = np.nan
    with np.errstate(all="ignore"):
        bound = formula.constant * formula.bound(outcome, runs) + ROUNDING
        accurate = calm & ((error <= bound) | beyond)
    verdict = np.select([~outcome.finite, ~calm, accurate], [FAILED, WARNED, ACCURATE], SILENT)
    return Judged(outcome, error, bound, unsure, verdict.astype(np.int8))


class Share(NamedTuple):
    """A row of the table of the extremes."""

    method: str
    sampling: str
    runs: int
    substeps: int
    failed: float
    warned: float
    accurate: float
    """share of the runs within their bound, and that below V"""
    silent: float
    vague: float
    """share of the runs whose bound is above V: the formula holds, and says nothing"""
    wrong: float
    """share of the runs that are wrong by more than a tenth of V and did not warn, up to sigma = NO_REFERENCE"""
    worst: float
    """the largest error in units of its bound"""
    doubt: float
    """the largest uncertainty of the reference in units of the bound"""


Extremes: TypeAlias = dict[tuple[str, str], list[tuple[int, Judged]]]
"""(method, sampling) -> batches of N sub-steps."""


def measure_extremes(runs: int = 65536, seed: int = 1, progress: Progress | None = None) -> Extremes:
    """Batches of random runs, of each sampling as many."""
    rng, result = np.random.default_rng(seed), cast(Extremes, {})
    batches = -(-runs // BATCH)
    for i in range(batches):
        for sampling in SAMPLINGS:
            substeps = SUBSTEPS[i % len(SUBSTEPS)]
            for name, judged in judge(sample(rng, BATCH, substeps, sampling)).items():
                result.setdefault((name, sampling), []).append((substeps, judged))
        if progress:
            progress((i + 1) / batches)
    return result


TOLERANCE = 1e-5
ADAPTIVE_RUNS = 1000
OWN_TIMES = 4
"""Times the sampled step: how long a run of the adaptive method lasts."""


def measure_adaptive(runs: int = ADAPTIVE_RUNS, seed: int = 5) -> Share:
    """Random extremes with the adaptive method, against itself at a tolerance a thousand times as sharp.

    Without terms: friction on a craft that is hard to move and easy to turn asks for steps of nanoseconds.
    """
    sampling = list(SAMPLINGS)[1]
    drawn = sample(np.random.default_rng(seed), runs, OWN_TIMES, sampling)
    rows = [_adaptive_run(drawn, i) for i in range(runs)]
    made = np.array([row for row in rows if row is not None])
    error, bound, substeps, doubt = made.T
    right = error <= bound
    return Share(
        ADAPTIVE.name,
        sampling,
        runs,
        int(substeps.sum()),
        failed=1.0 - len(made) / runs,
        warned=0.0,
        accurate=float(np.sum(right & (bound < 1.0))) / runs,
        silent=float(np.sum(~right)) / runs,
        vague=float(np.sum(right & (bound >= 1.0))) / runs,
        wrong=float(np.sum(error > 0.1)) / runs,
        worst=float(np.max(error / bound)),
        doubt=float(np.max(doubt)),
    )


def _adaptive_run(runs: Runs, i: int) -> tuple[float, float, int, float] | None:
    """Error and bound [1, of V], steps, and the sharper run's bound in units of this; None: it was refused."""
    craft, controls, start = single(runs, i)
    first = float(runs.h[i])
    try:
        coarse, fine = (
            advance(start, controls, craft, OWN_TIMES * first, Settings(first, ADAPTIVE, tolerance))
            for tolerance in (TOLERANCE, 1e-3 * TOLERANCE)
        )
    except (StepTooSmallError, NonFiniteError):
        return None
    speed = max(float(_size(each.vx, each.vy, each.yaw_rate, craft)) for each in (start, fine.state))
    error = float(_difference(coarse.state, fine.state, craft))
    scale = speed if speed > 0.0 else 1.0
    bound = 10.0 * coarse.substeps * TOLERANCE * max(1.0, speed) / scale
    return error / scale, bound, coarse.substeps, 1e-3 * fine.substeps / coarse.substeps


def shares(extremes: Extremes) -> list[Share]:
    """The table."""
    return [_share(*key, batches) for key, batches in sorted(extremes.items(), key=lambda item: _place(item[0]))]


def _place(key: tuple[str, str]) -> tuple[int, int]:
    return [method.name for method in FIXED].index(key[0]), list(SAMPLINGS).index(key[1])


def _share(method: str, sampling: str, batches: list[tuple[int, Judged]]) -> Share:
    verdict = np.concatenate([judged.verdict for _, judged in batches])
    error, bound, doubt = (
        np.concatenate([getattr(judged, name) for _, judged in batches]) for name in ("error", "bound", "doubt")
    )
    accurate, tight, count = verdict == ACCURATE, bound < 1.0, len(verdict)
    return Share(
        method,
        sampling,
        count,
        sum(substeps * BATCH for substeps, _ in batches),
        float(np.mean(verdict == FAILED)),
        float(np.mean(verdict == WARNED)),
        float(np.mean(accurate & tight)),
        float(np.mean(verdict == SILENT)),
        float(np.mean(accurate & ~tight)),
        float(np.mean(accurate & (error > 0.1))),
        float(np.nanmax(error / bound)),
        float(np.nanmax(doubt / bound)),
    )


# ---- what is written and printed


def run(folder: Path, progress: Progress | None = None) -> Group:
    """The whole study: stability.csv, extremes.csv and stability.png into the folder, and the tables to print.

    Raises:
        ModuleNotFoundError: matplotlib is not installed; OSError: a file cannot be written.
    """
    figure = new_figure(figsize=(15.0, 5.2), dpi=110, layout="constrained")  # what is missing is missing at once
    folder.mkdir(parents=True, exist_ok=True)
    report = progress or _nothing
    limits = measure_map(lambda done: report(0.5 * done))
    extremes = measure_extremes(progress=lambda done: report(0.5 + 0.45 * done))
    rows = [*shares(extremes), measure_adaptive()]
    _write(folder / "stability.csv", limits)
    _write(folder / "extremes.csv", rows)
    draw(figure, extremes)
    figure.savefig(folder / "stability.png", format="png", metadata={"Software": None})
    report(1.0)
    return Group(
        "The largest dimensionless step (h*kappa*v0 coasting, h*kappa*v_t under thrust), over eight craft:",
        map_table(limits),
        "Random extremes; share of the runs:",
        extremes_table(rows),
        *(f"bound of {name}: {each.constant:g}*{each.text}" for name, each in FORMULAS.items()),
        f"bound of {ADAPTIVE.name}: 10*N*tolerance*max(1, V) of its N steps; tolerance = {TOLERANCE:g}",
    )


def _nothing(_done: float) -> None:
    pass


def _write(path: Path, rows: Iterable[Any]) -> None:
    rows = list(rows)
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(rows[0]._fields)
        writer.writerows(rows)


def map_table(limits: list[Limit]) -> Table:
    """One row a method and motion: measured, and the theory beside it."""
    table = Table(box=None, pad_edge=False)
    for title in ("method", "motion", *(f"{quality} up to" for quality in QUALITIES), "as stability_number", "theory"):
        table.add_column(title)
    for method in INTEGRATORS:
        for case in dict.fromkeys(limit.case for limit in limits):
            three = [limit for limit in limits if (limit.method, limit.case) == (method.name, case)]
            table.add_row(
                method.name,
                case,
                *(_range(limit) for limit in three),
                ", ".join(_number(2.0 * limit.largest) for limit in three),
                ", ".join(_number(limit.theory) for limit in three),
            )
    return table


def _number(value: float) -> str:
    return "any step" if value == np.inf else "-" if np.isnan(value) else f"{value:.4g}"


def _range(limit: Limit) -> str:
    low, high = _number(limit.smallest), _number(limit.largest)
    return low if low == high else f"{low} ... {high}"


def extremes_table(rows: list[Share]) -> Table:
    """One row a method and sampling."""
    table = Table(box=None, pad_edge=False)
    for title in ("method", "sampling", "runs", "sub-steps", "failed", "warned", "accurate", "bound > V", "silent",
                  "error > V/10, no warning", "worst error/bound"):  # fmt: skip
        table.add_column(title)
    for row in rows:
        parts = (row.failed, row.warned, row.accurate, row.vague, row.silent, row.wrong)
        table.add_row(row.method, row.sampling, str(row.runs), f"{row.substeps / 1e6:.1f} M",
                      *(f"{100.0 * part:.2f} %" for part in parts), f"{row.worst:.2f}")  # fmt: skip
    return table


COLORS: Mapping[str, str] = MappingProxyType(
    {"semi_implicit_euler": "#c8102e", "drag_implicit": "#2a9d4b", "rk4": "#0b4f6c"}
)
SIGMA, RHO = "stability number  $\\sigma$", "rotation in a sub-step  $\\rho$  [rad]"
NOTES: Mapping[tuple[float, float], str] = MappingProxyType(
    {
        (0.3, 1.06): "all three right",
        (0.62, 1.3): "false cycle",
        (1.57, -0.62): "diverges",
        (1.43, 0.72): "false speed",
        (1.62, 1.06): "the right answer",
        (2.09, -0.62): "diverges",
    }
)
"""What is seen where, in the first panel."""
SHOWN = 4000
"""Dots a method."""


def draw(figure: "Figure", extremes: Extremes) -> None:
    """Three panels: where the methods settle, the map of the extremes, the errors under their bound."""
    settled, plane, errors = figure.subplots(1, 3)
    _draw_settled(settled)
    colored = _draw_plane(plane, extremes)
    figure.colorbar(colored, ax=plane, label="log10(error / V)", pad=0.02)
    _draw_errors(errors, extremes)
    for axes in (settled, plane, errors):
        axes.spines[["top", "right"]].set_visible(False)


def _draw_settled(axes: "Axes") -> None:
    """The speeds of sub-steps 960 to 1000 from rest under thrust, for each step."""
    case = cases()[1]
    one = case._replace(craft=Craft(thrust_max=5.0), thrust=case.thrust[:1], scale=case.scale[:1], unit=case.unit[:1])
    x = np.linspace(0.01, 2.4, 1600)[None, :]
    for name in ("semi_implicit_euler", "rk4", "drag_implicit"):
        method = next(each for each in FIXED if each.name == name)
        runs = lanes(one, x, 0.0)
        with np.errstate(all="ignore"):
            state = steps_of(method)(runs.start, runs.controls, runs.craft, runs.h, 960, np).state
            for _ in range(40):
                state = steps_of(method)(state, runs.controls, runs.craft, runs.h, 1, np).state
                speed = speed_of(one, state, runs, x.shape)[0]
                axes.plot(x[0], speed, ".", color=COLORS[name], markersize=1.0, markeredgewidth=0.0)
        axes.plot([], [], "o", color=COLORS[name], markersize=4, label=name)
    for place, text in NOTES.items():
        axes.annotate(text, place, fontsize="small", color="#444444")
    axes.set(
        xlim=(0.0, 2.4),
        ylim=(-1.0, 2.4),
        xlabel="dimensionless step  $h\\,\\kappa\\,v_t$",
        ylabel="speed / terminal speed",
    )
    axes.set_title("Where a launch under thrust settles", loc="left")
    axes.legend(loc="upper left", frameon=False)


def _draw_plane(axes: "Axes", extremes: Extremes) -> Any:
    """Semi-implicit Euler: sigma and rho of each run, the error as colour; grey: warned, so nothing is promised."""
    batches = [judged for (name, _), some in extremes.items() if name == FIXED[0].name for _, judged in some]
    sigma, rho, error, verdict = (
        np.concatenate([pick(judged) for judged in batches])
        for pick in (_sigma, _rho, lambda judged: judged.error, lambda judged: judged.verdict)
    )
    some = np.random.default_rng(0).permutation(len(sigma))[: 3 * SHOWN]
    sigma, rho, error, verdict = sigma[some], rho[some], error[some], verdict[some]
    low, high = 1e-6, 1e4
    inside = (sigma > low) & (sigma < high) & (rho > low) & (rho < high)
    sigma, rho, error, verdict = sigma[inside], rho[inside], error[inside], verdict[inside]
    grey = verdict <= WARNED
    axes.scatter(sigma[grey], rho[grey], s=3, color="#cccccc", linewidths=0)
    right = verdict >= ACCURATE
    colors = np.log10(np.clip(error[right], 1e-9, 1.0))
    dots = axes.scatter(sigma[right], rho[right], s=4, c=colors, cmap="viridis_r", vmin=-9.0, vmax=0.0, linewidths=0)
    limits = FIXED[0].stability_limit, FIXED[0].rotation_limit
    axes.axvline(limits[0], color=COLORS[FIXED[0].name], linewidth=1.2)
    axes.axhline(limits[1], color=COLORS[FIXED[0].name], linewidth=1.2)
    axes.text(0.03, 0.97, "grey: warned or failed", transform=axes.transAxes, va="top", backgroundcolor="white")
    axes.set(xscale="log", yscale="log", xlim=(low, high), ylim=(low, high), xlabel=SIGMA,
             ylabel=RHO)  # fmt: skip
    axes.set_title("Random extremes, semi_implicit_euler", loc="left")
    return dots


def _sigma(judged: Judged) -> Array:
    return judged.outcome.sigma


def _rho(judged: Judged) -> Array:
    return judged.outcome.rho


def _draw_errors(axes: "Axes", extremes: Extremes) -> None:
    """Every run that did not warn: its error against the bound of the formula."""
    for name in ("semi_implicit_euler", "drag_implicit", "rk4"):
        batches = [judged for (each, _), some in extremes.items() if each == name for _, judged in some]
        bound = np.concatenate([judged.bound for judged in batches])
        error = np.concatenate([judged.error for judged in batches])
        shown = np.flatnonzero(np.isfinite(error))
        shown = np.random.default_rng(0).permutation(shown)[:SHOWN]
        axes.plot(bound[shown], np.maximum(error[shown], 1e-16), ".", markersize=1.6, alpha=0.6, color=COLORS[name])
        axes.plot([], [], "o", markersize=4, color=COLORS[name], label=name)
    line = np.array([1e-12, 1e4])
    axes.plot(line, line, color="black", linewidth=1.0)
    axes.set(xscale="log", yscale="log", xlim=(5e-13, 1e4), ylim=(5e-17, 1e4), xlabel="the formula's bound / V",
             ylabel="error / V at the end of the run")  # fmt: skip
    axes.set_title("Runs that did not warn, and their bound", loc="left")
    axes.legend(loc="upper left", frameon=False, markerscale=1.2)
