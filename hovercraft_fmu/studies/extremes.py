"""Random extremes: what each method makes of them, held against a bound; derived at the top of stability.py."""

import itertools
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, NamedTuple, cast

import numpy as np
import polars as pl
from numpy.typing import NDArray

from ..model.craft import DIRECTIONAL, Craft
from ..model.dynamics import Controls, State, actuation, drag_per_speed, friction_gains, friction_radius
from ..model.integrators import Integrator, StepTooSmallError
from ..model.subcycling import NonFiniteError, Settings, advance, stability_number
from .batches import ADAPTIVE, FIXED, Array, Batch, Mask, advanced, chosen, made, single
from .laboratory import Tell

FAILED, WARNED, ACCURATE, SILENT = range(4)
VERDICTS = ("failed", "warned", "accurate", "silent")
"""A number that is not finite; a limit of the method passed; within the formula; none of these, which must not be."""
SUBSTEPS = (1, 4, 16, 64)
"""N, in turn from batch to batch."""
BATCH = 4096
"""Runs that share N and fit into the processor's cache."""
RK4 = next(method for method in FIXED if method.name == "rk4")
REFINED, CHECKED = 16, 32
"""The reference is RK4 at this fraction of the sub-step, and checked against the first: 2^3 nearer at worst."""
NO_REFERENCE = 8.0
"""1: the sigma above which the formula promises less than any motion inside V keeps, and nothing is left to check."""
ROUNDING = 1e-11
"""Of V: some ten thousand roundings, of RK4 at h/32."""


# ---- what is drawn


def absolute_steps(rng: np.random.Generator, runs: Batch) -> Array:
    """s: from 1e-5 to 10, whatever the craft."""
    return _logarithmic(rng, 1e-5, 10.0, len(runs.h))


def own_steps(rng: np.random.Generator, runs: Batch) -> Array:
    """s: 1e-5 to 3 times the time in which the craft's motion changes, at most 10 s."""
    thrust, side, turn = actuation(runs.controls, runs.craft, np)
    craft, k = runs.craft, runs.craft.drag_factor
    force = np.abs(thrust) + np.abs(side) + np.abs(turn / craft.length)
    # drag at the speed of the start and at the terminal speed, rotation now and by the thrusters
    drag = craft.drag_rate * (drag_per_speed(runs.start, runs.controls, craft, np) + np.sqrt(k * force))
    rotation = np.abs(runs.start.yaw_rate) + np.sqrt(np.abs(turn) / craft.inertia)
    return np.minimum(_logarithmic(rng, 1e-5, 3.0, len(runs.h)) / (drag + rotation + 1e-6), 10.0)


WITH_TERMS = "the same, with every term"
SAMPLINGS: Mapping[str, Callable[[np.random.Generator, Batch], Array]] = MappingProxyType(
    {"steps 1e-5 to 10 s": absolute_steps, "steps to the craft's own time": own_steps, WITH_TERMS: own_steps}
)


def _logarithmic(rng: np.random.Generator, low: float, high: float, count: int) -> Array:
    return 10.0 ** rng.uniform(np.log10(low), np.log10(high), count)


def sample(rng: np.random.Generator, count: int, substeps: int, sampling: str) -> Batch:
    """Random extremes: every quantity evenly over its powers of ten, and now and then exactly zero."""

    def spread(low: float, high: float, zeros: float = 0.05) -> Array:
        return np.where(rng.random(count) < zeros, 0.0, _logarithmic(rng, low, high, count))

    def command(zeros: float) -> Array:
        return np.where(rng.random(count) < zeros, 0.0, rng.random(count))

    limit = spread(1e-3, 1e9)
    craft = Craft(
        mass=_logarithmic(rng, 1e-3, 1e6, count), inertia=_logarithmic(rng, 1e-3, 1e6, count),
        length=_logarithmic(rng, 0.1, 100.0, count), air_density=spread(1e-6, 1e3),
        drag_center_fraction=-0.5 * command(0.05), steering_force=spread(1e-3, 1e9),
        thrust_min=-limit, thrust_max=limit,
    )  # fmt: skip
    controls = Controls(limit * (2.0 * command(0.1) - 1.0), command(0.4), command(0.4))
    speed, course = spread(1e-6, 1e6), np.pi * (2.0 * command(0.0) - 1.0)
    start = State(
        heading=10.0 * (2.0 * command(0.0) - 1.0), vx=speed * np.cos(course), vy=speed * np.sin(course),
        yaw_rate=spread(1e-6, 1e4) * rng.choice([-1.0, 1.0], count),
    )  # fmt: skip
    if sampling == WITH_TERMS:
        areas, spins, friction = rng.integers(1, 3, count), command(0.4), spread(1e-6, 10.0, 0.4)
        craft = replace(craft, drag_area=cast(Any, areas), rotational_drag=spins, skirt_friction=friction)
        blows, from_where = spread(1e-6, 1e6, 0.4), 2.0 * np.pi * command(0.0)
        controls = controls._replace(wind_x=blows * np.cos(from_where), wind_y=blows * np.sin(from_where))
    runs = made(craft, controls, start, np.ones(count), substeps)
    return runs._replace(h=SAMPLINGS[sampling](rng, runs))


# ---- what came of it, and the bound


class Numbers(NamedTuple):
    """What the bound is made of; the largest are over the starts of the sub-steps and the end, shape (runs,) each."""

    end: State
    sigma: Array
    rho: Array
    tau: Array
    alpha: Array
    phi: Array
    speed: Array
    """m/s: V"""
    finite: Mask


def watched(runs: Batch, method: Integrator) -> Numbers:
    """Make all sub-steps, and watch."""
    state, craft, h = runs.start, runs.craft, runs.h
    sigma = drag = rho = np.zeros_like(h)
    wind = np.hypot(runs.controls.wind_x, runs.controls.wind_y)
    speed = np.fmax(_size(state.vx, state.vy, state.yaw_rate, craft), wind)
    finite = np.ones(h.shape, bool)
    with np.errstate(all="ignore"):
        for _ in range(runs.substeps):
            stretch = advanced(runs, method, state, 1)
            state = stretch.state
            sigma = np.fmax(sigma, stability_number(stretch.drag_mass, stretch.rotation, craft))
            drag, rho = np.fmax(drag, stretch.drag_mass), np.fmax(rho, stretch.rotation)
            speed = np.fmax(speed, _size(state.vx, state.vy, state.yaw_rate, craft))
            finite &= np.isfinite(np.sum(state, axis=0))
        alpha, phi = _per(_gain(runs), speed), _per(_grip(runs), speed)
        return Numbers(state, sigma, rho, _swing(runs, drag), alpha, phi, speed, finite)


def _swing(runs: Batch, drag: Array) -> Array:
    """1: tau, from the largest h*k*q [kg]; k*q^2 = (k*q)^2/k, and without drag nothing."""
    craft, k = runs.craft, runs.craft.drag_factor
    turn = np.abs(actuation(runs.controls, craft, np)[2])
    least = np.where(craft.drag_area == DIRECTIONAL, np.fmin(craft.drag_factor_ahead, craft.drag_factor_abeam), k)
    pressure = np.divide(drag * drag, least, out=np.zeros_like(drag), where=k > 0.0)
    return (np.abs(craft.drag_center) * pressure + runs.h * runs.h * turn) / craft.inertia


def _size(vx: Any, vy: Any, yaw_rate: Any, craft: Craft) -> Array:
    """m/s: the speed of the centre of gravity, or of the drag point about it, whichever is larger."""
    return np.fmax(np.hypot(vx, vy), np.abs(craft.drag_center * yaw_rate))


def _gain(runs: Batch) -> Array:
    """m/s: what thrust and thrusters add to the speed in a sub-step."""
    thrust, side, turn = actuation(runs.controls, runs.craft, np)
    craft = runs.craft
    return runs.h * _size(thrust / craft.mass, side / craft.mass, turn / craft.inertia, craft)


def _grip(runs: Batch) -> Array:
    """m/s: what friction takes of the speed in a sub-step, of the centre of gravity or of the drag point about it."""
    craft = runs.craft
    if not craft.rubs:
        return np.zeros_like(runs.h)
    straight, turning = friction_gains(craft, runs.h, np)
    return np.fmax(straight, turning * np.abs(craft.drag_center) / friction_radius(craft, np))


def _per(value: Array, speed: Array) -> Array:
    with np.errstate(all="ignore"):
        return np.divide(value, speed, out=np.zeros_like(value), where=speed > 0.0)


def first_order_bound(seen: Numbers, runs: Batch) -> Array:
    """1, of V: N*delta*(delta + alpha + phi), delta = s*sigma + rho + tau; see the top of stability.py.

    With friction 2*phi + 8*rho more.
    """
    delta = _aspect(runs) * seen.sigma + seen.rho + seen.tau
    rest = np.where(runs.craft.skirt_friction > 0.0, 2.0 * seen.phi + 8.0 * seen.rho, 0.0)
    return runs.substeps * delta * (delta + seen.alpha + seen.phi) + rest


def rk4_bound(seen: Numbers, runs: Batch) -> Array:
    """1, of V: N*lambda*eps^4 + s*sigma*eps^2, lambda = s*sigma + rho + sqrt(tau), eps = lambda + alpha + phi.

    With the directional area, s*sigma*eps more; with friction, the bound of first order.
    """
    drag = _aspect(runs) * seen.sigma
    rate = drag + seen.rho + np.sqrt(seen.tau)
    eps = rate + seen.alpha + seen.phi
    smooth = runs.substeps * rate * eps**4 + drag * eps**2
    kinks = np.where(runs.craft.drag_area == DIRECTIONAL, drag * eps, 0.0)
    rest = np.where(runs.craft.skirt_friction > 0.0, first_order_bound(seen, runs), 0.0)
    return smooth + kinks + rest


def _aspect(runs: Batch) -> Array:
    """1: s, how much steeper the directional drag can be than its own size: the longer over the shorter wall."""
    walls = runs.craft.length / runs.craft.width
    return np.where(runs.craft.drag_area == DIRECTIONAL, np.fmax(walls, 1.0 / walls), 1.0)


BOUNDS: Mapping[str, Callable[[Numbers, Batch], Array]] = MappingProxyType(
    {"semi_implicit_euler": first_order_bound, "drag_implicit": first_order_bound, "rk4": rk4_bound}
)


# ---- the verdicts


class Judged(NamedTuple):
    """The verdicts on a batch of runs of one method, shape (runs,) each."""

    numbers: Numbers
    error: Array
    """1: of V, the difference in velocity (or in x_d*yaw rate) from the reference at the end; NaN where none is made"""
    bound: Array
    """1: of V, by the formula"""
    doubt: Array
    """1: of V, by how much the reference itself may be wrong"""
    verdict: NDArray[np.int8]


def judge(runs: Batch, methods: Iterable[Integrator] = FIXED) -> dict[str, Judged]:
    """Carry out the runs with each method and hold them against one reference."""
    seen = {method: watched(runs, method) for method in methods}
    # calm: the FMU would not warn
    calm = {m: n.finite & (n.sigma <= m.stability_limit) & (n.rho <= m.rotation_limit) for m, n in seen.items()}
    needed = np.flatnonzero(np.any([calm[m] & (seen[m].sigma <= NO_REFERENCE) for m in calm], axis=0))
    some = chosen(runs, needed)
    near, reference = (advanced(some, RK4, some.start, some.substeps, fine).state for fine in (REFINED, CHECKED))
    doubt = _difference(near, reference, some.craft)
    judged = {}
    for method, numbers in seen.items():
        ends = State(*(cast(Array, values)[needed] for values in numbers.end))
        checked = calm[method] & (numbers.sigma <= NO_REFERENCE)
        error, unsure = (
            _where(checked, needed, _per(apart, numbers.speed[needed]))
            for apart in (_difference(ends, reference, some.craft), doubt)
        )
        with np.errstate(all="ignore"):
            bound = BOUNDS[method.name](numbers, runs) + ROUNDING
            accurate = (error <= bound) | (numbers.sigma > NO_REFERENCE)
        verdict = np.select([~numbers.finite, ~calm[method], accurate], [FAILED, WARNED, ACCURATE], SILENT)
        judged[method.name] = Judged(numbers, error, bound, unsure, verdict.astype(np.int8))
    return judged


def _where(checked: Mask, needed: NDArray[Any], values: Array) -> Array:
    """The values of the needed runs in their places; NaN where nothing is checked."""
    whole = np.full(checked.shape, np.nan)
    whole[needed] = values
    return np.where(checked, whole, np.nan)


def _difference(a: State, b: State, craft: Craft) -> Array:
    with np.errstate(all="ignore"):
        return _size(a.vx - b.vx, a.vy - b.vy, a.yaw_rate - b.yaw_rate, craft)


METHOD = pl.Enum([*(method.name for method in FIXED), ADAPTIVE.name])
SAMPLING = pl.Enum(list(SAMPLINGS))


def measure_extremes(runs: int = 65536, seed: int = 1, size: int = BATCH, tell: Tell = lambda _: None) -> pl.DataFrame:
    """Random runs, of each sampling as many, in batches of a size; a row a run and method."""
    rng, frames = np.random.default_rng(seed), []
    batches = -(-runs // size)
    for i, sampling in itertools.product(range(batches), SAMPLINGS):
        substeps = SUBSTEPS[i % len(SUBSTEPS)]
        for name, judged in judge(sample(rng, size, substeps, sampling)).items():
            columns = {"sigma": judged.numbers.sigma, "rho": judged.numbers.rho, "error": judged.error}
            columns |= {"bound": judged.bound, "doubt": judged.doubt, "verdict": judged.verdict}
            frames.append(_labelled(columns, name, sampling, np.full(size, substeps)))
        tell((i + 1) / batches)
    return pl.concat(frames)


def _labelled(columns: Mapping[str, Array], method: str, sampling: str, substeps: Array) -> pl.DataFrame:
    labels = pl.lit(method, METHOD).alias("method"), pl.lit(sampling, SAMPLING).alias("sampling")
    rows = pl.DataFrame({**columns, "substeps": substeps})
    return rows.with_columns(*labels, pl.col("error", "doubt").fill_nan(None))


TOLERANCE = 1e-5
OWN_TIMES = 4
"""Times the sampled step: how long a run of the adaptive method lasts."""


def measure_adaptive(runs: int = 1000, seed: int = 5) -> pl.DataFrame:
    """Random extremes with the adaptive method, against itself at a tolerance a thousand times as sharp.

    Without terms: friction on a craft that is hard to move and easy to turn asks for steps of nanoseconds.
    """
    sampling = list(SAMPLINGS)[1]
    drawn = sample(np.random.default_rng(seed), runs, OWN_TIMES, sampling)
    error, bound, doubt, verdict, substeps = zip(*(_adaptive_run(drawn, i) for i in range(runs)), strict=True)
    nothing = np.full(runs, np.nan)
    columns = {"sigma": nothing, "rho": nothing, "error": error, "bound": bound, "doubt": doubt}
    return _labelled({**columns, "verdict": np.array(verdict, np.int8)}, ADAPTIVE.name, sampling, np.array(substeps))


def _adaptive_run(runs: Batch, i: int) -> tuple[float, float, float, int, int]:
    """Error and bound [1, of V], the sharper run's bound in units of this, the verdict, steps."""
    craft, controls, start, first, _ = single(runs, i)
    try:
        coarse, fine = (
            advance(start, controls, craft, OWN_TIMES * first, Settings(first, ADAPTIVE, tolerance))
            for tolerance in (TOLERANCE, 1e-3 * TOLERANCE)
        )
    except (StepTooSmallError, NonFiniteError):
        return np.nan, np.nan, np.nan, FAILED, 0
    speed = max(float(_size(each.vx, each.vy, each.yaw_rate, craft)) for each in (start, fine.state))
    scale = speed if speed > 0.0 else 1.0
    error = float(_difference(coarse.state, fine.state, craft)) / scale
    bound = 10.0 * coarse.substeps * TOLERANCE * max(1.0, speed) / scale
    doubt = 1e-3 * fine.substeps / coarse.substeps * bound
    return error, bound, doubt, ACCURATE if error <= bound else SILENT, coarse.substeps


def shares(extremes: pl.DataFrame) -> pl.DataFrame:
    """A row a method and sampling: the shares of its runs.

    accurate: within a bound below V; vague: within one above V, which says nothing; wrong: off by more than a tenth of
    V without a warning, up to sigma = NO_REFERENCE; worst, doubt: the largest error, and uncertainty of the reference,
    in units of the bound.
    """
    verdict, error, bound = pl.col("verdict"), pl.col("error"), pl.col("bound")
    right, tight = verdict == ACCURATE, bound < 1.0
    return (
        extremes.group_by("method", "sampling")
        .agg(
            runs=pl.len(),
            substeps=pl.col("substeps").sum(),
            failed=(verdict == FAILED).mean(),
            warned=(verdict == WARNED).mean(),
            accurate=(right & tight).mean(),
            silent=(verdict == SILENT).mean(),
            vague=(right & ~tight).mean(),
            wrong=(right & (error > 0.1)).fill_null(value=False).mean(),
            worst=(error / bound).max(),
            doubt=(pl.col("doubt") / bound).max(),
        )
        .sort("method", "sampling")
    )
