"""Random extremes: what each method makes of them, held against a bound; derived at the top of stability.py."""

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias, cast

import numpy as np
import polars as pl
from numpy.typing import NDArray

from ..host.fleet import Crafts, advance_fleet, observe_fleet
from ..model.craft import CONSTANT, DIRECTIONAL
from ..model.dynamics import Controls, State, friction_radius
from ..model.integrators import INTEGRATORS, Integrator
from ..model.subcycling import Settings
from .laboratory import Tell

Array: TypeAlias = Any
"""One number a run, shape (runs,), float64; the model's functions are annotated for one craft and take these, too."""
Mask: TypeAlias = Any
"""Shape (runs,), bool."""

FIXED = tuple(method for method in INTEGRATORS if method.integrate)
"""The methods with a fixed step."""


class Batch(NamedTuple):
    """Runs to be made: every number is an array of shape (runs,)."""

    craft: Crafts
    controls: Controls
    start: State
    h: Array
    """s, the sub-step"""
    substeps: int
    """of each run"""


def made(craft: Crafts, controls: Controls, start: State, h: Array, substeps: int = 1) -> Batch:
    """A batch in which everything has the shape of h: plain floats serve all runs alike."""

    def each(values: Iterable[Any]) -> Iterator[Any]:
        return (np.broadcast_to(value, h.shape) for value in values)

    return Batch(craft, Controls(*each(controls)), State(*each(start)), h, substeps)


def chosen(batch: Batch, which: Any) -> Batch:
    """Some of the runs: a mask, a slice, or indices."""
    craft, controls, start, h, substeps = batch
    held, at = ([value[which] for value in cast(Any, values)] for values in (controls, start))
    return Batch(craft.some(which), Controls(*held), State(*at), h[which], substeps)


def advanced(batch: Batch, method: Integrator, state: State, n: int, refined: int = 1) -> tuple[State, Array, Array]:
    """Every craft n sub-steps after a state, each cut into so many; stability number, rotation [rad].

    NaN where a motion left the numbers.
    """
    h = batch.h / refined
    fleet = advance_fleet(state, batch.controls, batch.craft, h * (n * refined), Settings(h, method))
    lost = fleet.refused.numbers
    for values in (*fleet.states, fleet.stability, fleet.rotation):
        values[lost] = np.nan
    return State(*fleet.states), fleet.stability, fleet.rotation


def pushes(batch: Batch) -> tuple[Array, Array]:
    """Force [N] and moment [N.m], by size and at most: of thrust and thrusters, which are drawn inside their limits,
    and from outside.
    """
    controls, craft = batch.controls, batch.craft
    command = controls.port - controls.starboard
    outside = np.hypot(controls.external_force_x, controls.external_force_y)
    force = np.hypot(controls.thrust, craft.steering_force * command) + outside
    return force, np.abs(craft.thruster_moment * command) + np.abs(controls.external_moment)


# ---- the numbers of the measurement

FAILED, WARNED, ACCURATE, SILENT = range(4)
"""A number that is not finite; a limit of the method passed; within the formula; none of these, which must not be."""
BATCH = 4096
"""Runs that share N and fit into the processor's cache."""
LOOKS = 64
"""Of a run that is longer the largest speed is taken at so many points: no larger than it is, so the bound is no wider;
the stability number and the rotation are watched at every sub-step."""
RK4 = next(method for method in FIXED if method.name == "rk4")
REFINED, CHECKED = 16, 32
"""The reference is RK4 at this fraction of the sub-step, and checked against the first: 2^3 nearer at worst."""
FINER = 128
"""Times finer where that leaves the numbers: a thruster against rotational drag on a craft that is easy to turn."""
NO_REFERENCE = 8.0
"""1: the sigma above which the formula promises less than any motion inside V keeps, and nothing is left to check."""
ROUNDING, EACH = 1e-11, 1e-13
"""Of V: some ten thousand roundings, of RK4 at h/32; and of each sub-step more, as a heading of some radians to which
the same is added again and again is rounded the same way every time. Both grow where the drag centre leads."""


# ---- what is drawn


def own_time(runs: Batch) -> Array:
    """s: the time in which the craft's motion changes."""
    push, turn = pushes(runs)
    craft, k = runs.craft, runs.craft.drag_factor
    force = push + turn / craft.length
    # drag at the speed of the start and at the terminal speed, rotation now and by the thrusters
    drag = craft.drag_rate * (observe_fleet(runs.start, runs.controls, craft)[5] + np.sqrt(k * force))
    rotation = np.abs(runs.start.yaw_rate) + np.sqrt(turn / craft.inertia)
    return 1.0 / (drag + rotation + 1e-6)


def own_steps(rng: np.random.Generator, runs: Batch) -> Array:
    """s: 1e-5 to 3 times the craft's own time, at most 10 s."""
    return np.minimum(_logarithmic(rng, 1e-5, 3.0, len(runs.h)) * own_time(runs), 10.0)


def any_steps(rng: np.random.Generator, runs: Batch) -> Array:
    """s: 1e-5 to 10 s, whatever the craft."""
    return _logarithmic(rng, 1e-5, 10.0, len(runs.h))


def swing_steps(rng: np.random.Generator, runs: Batch) -> Array:
    """s: such that a swing about the course, which grows where the drag centre leads, may grow by e to e^40; at most
    10^6 s.
    """
    craft, speed = runs.craft, np.hypot(runs.start.vx, runs.start.vy)
    with np.errstate(divide="ignore"):
        period = 1.0 / (speed * np.sqrt(craft.drag_factor * np.abs(craft.drag_center) / craft.inertia))
    return np.minimum(_logarithmic(rng, 1.0, 40.0, len(runs.h)) * period / runs.substeps, 1e6)


class Sampling(NamedTuple):
    """What is drawn."""

    steps: Callable[[np.random.Generator, Batch], Array] = own_steps
    terms: float = 0.0
    """1: the share of the runs with every term that a scene may ask for, and loads from outside."""
    ahead: float = 0.0
    """1: the share whose drag centre is ahead of the centre of gravity."""
    leads: bool = False
    """Coasting with the drag centre in front, ahead or astern; from 1e-12 to 1 rad off the course."""
    substeps: tuple[int, ...] = (1, 4, 16, 64)
    """N, in turn from batch to batch."""
    part: int = 1
    """One in so many of the runs that are asked for: long ones are dear."""


WITH_TERMS, LEADS = "the same, with every term", "coasting, drag centre in front"
SAMPLINGS: Mapping[str, Sampling] = MappingProxyType(
    {
        "steps 1e-5 to 10 s": Sampling(any_steps),
        "steps to the craft's own time": Sampling(),
        WITH_TERMS: Sampling(terms=1.0),
        "drag centre ahead": Sampling(terms=0.5, ahead=1.0),
        "1000 sub-steps": Sampling(terms=0.5, ahead=0.5, substeps=(1000,), part=16),
        "10 000 sub-steps": Sampling(terms=0.5, ahead=0.5, substeps=(10_000,), part=128),
        LEADS: Sampling(swing_steps, ahead=0.5, leads=True, substeps=(64, 1000, 10_000), part=64),
    }
)


def _logarithmic(rng: np.random.Generator, low: float, high: float, count: int) -> Array:
    return 10.0 ** rng.uniform(np.log10(low), np.log10(high), count)


def sample(rng: np.random.Generator, count: int, substeps: int, sampling: str) -> Batch:
    """Random extremes: every quantity evenly over its powers of ten, and now and then exactly zero."""
    kind = SAMPLINGS[sampling]

    def spread(low: float, high: float, zeros: float = 0.05) -> Array:
        return np.where(rng.random(count) < zeros, 0.0, _logarithmic(rng, low, high, count))

    def command(zeros: float) -> Array:
        return np.where(rng.random(count) < zeros, 0.0, rng.random(count))

    limit = spread(1e-3, 1e9)
    parameters: dict[str, Array] = {
        "mass": _logarithmic(rng, 1e-3, 1e6, count), "inertia": _logarithmic(rng, 1e-3, 1e6, count),
        "length": _logarithmic(rng, 0.1, 100.0, count), "air_density": spread(1e-6, 1e3),
        "drag_center_fraction": -0.5 * command(0.05), "steering_force": spread(1e-3, 1e9),
        "thrust_min": -limit, "thrust_max": limit,
    }  # fmt: skip
    controls = Controls(limit * (2.0 * command(0.1) - 1.0), command(0.4), command(0.4))
    speed, course = spread(1e-6, 1e6), np.pi * (2.0 * command(0.0) - 1.0)
    start = State(
        heading=10.0 * (2.0 * command(0.0) - 1.0), vx=speed * np.cos(course), vy=speed * np.sin(course),
        yaw_rate=spread(1e-6, 1e4) * rng.choice([-1.0, 1.0], count),
    )  # fmt: skip
    if kind.ahead:
        parameters["drag_center_fraction"] *= np.where(rng.random(count) < kind.ahead, -1.0, 1.0)
    if kind.leads:
        behind = parameters["drag_center_fraction"] < 0.0
        course = start.heading + _logarithmic(rng, 1e-12, 1.0, count) + np.where(behind, np.pi, 0.0)
        parameters |= {"inertia": parameters["mass"] * _logarithmic(rng, 1e-6, 1.0, count)}  # it turns before it stops
        parameters["air_density"] *= 1e-3
        start = State(heading=start.heading, vx=speed * np.cos(course), vy=speed * np.sin(course))
        controls = Controls(0.0)
    if kind.terms:
        areas, spins, friction = rng.integers(1, 3, count), command(0.4), spread(1e-6, 10.0, 0.4)
        blows, from_where = spread(1e-6, 1e6, 0.4), 2.0 * np.pi * command(0.0)
        pushes_with, where_to, turn = spread(1e-3, 1e9, 0.4), 2.0 * np.pi * command(0.0), spread(1e-3, 1e9, 0.4)
        on = rng.random(count) < kind.terms
        areas, blows, pushes_with, turn = np.where(on, areas, CONSTANT), on * blows, on * pushes_with, on * turn
        parameters |= {"drag_area": areas, "rotational_drag": on * spins, "skirt_friction": on * friction}
        controls = controls._replace(
            wind_x=blows * np.cos(from_where), wind_y=blows * np.sin(from_where),
            external_force_x=pushes_with * np.cos(where_to), external_force_y=pushes_with * np.sin(where_to),
            external_moment=turn * rng.choice([-1.0, 1.0], count),
        )  # fmt: skip
    runs = made(Crafts(**parameters), controls, start, np.ones(count), substeps)
    return runs._replace(h=kind.steps(rng, runs))


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
    """Make all sub-steps, and watch: each of up to LOOKS, stretches of longer runs."""
    state, craft, h = runs.start, runs.craft, runs.h
    sigma = rho = np.zeros_like(h)
    wind = np.hypot(runs.controls.wind_x, runs.controls.wind_y)
    speed = np.fmax(_size(state.vx, state.vy, state.yaw_rate, craft), wind)
    finite, looks = np.ones(h.shape, bool), min(runs.substeps, LOOKS)
    with np.errstate(all="ignore"):
        for i in range(looks):
            stretch = runs.substeps * (i + 1) // looks - runs.substeps * i // looks
            state, stability, rotation = advanced(runs, method, state, stretch)
            sigma, rho = np.fmax(sigma, stability), np.fmax(rho, rotation)
            speed = np.fmax(speed, _size(state.vx, state.vy, state.yaw_rate, craft))
            finite &= np.isfinite(np.sum(state, axis=0))
        alpha, phi = _per(_gain(runs), speed), _per(_grip(runs), speed)
        return Numbers(state, sigma, rho, _swing(runs, sigma / craft.drag_rate), alpha, phi, speed, finite)


def _swing(runs: Batch, drag: Array) -> Array:
    """1: tau, from a bound of h*k*q [kg]; k*q^2 = (k*q)^2/k, and without drag nothing."""
    craft, k = runs.craft, runs.craft.drag_factor
    turn = pushes(runs)[1]
    least = np.where(craft.drag_area == DIRECTIONAL, np.fmin(craft.drag_factor_ahead, craft.drag_factor_abeam), k)
    pressure = np.divide(drag * drag, least, out=np.zeros_like(drag), where=k > 0.0)
    return (np.abs(craft.drag_center) * pressure + runs.h * runs.h * turn) / craft.inertia


def _size(vx: Any, vy: Any, yaw_rate: Any, craft: Crafts) -> Array:
    """m/s: the speed of the centre of gravity, or of the drag point about it, whichever is larger."""
    return np.fmax(np.hypot(vx, vy), np.abs(craft.drag_center * yaw_rate))


def _gain(runs: Batch) -> Array:
    """m/s: what thrust, thrusters and loads from outside add to the speed in a sub-step."""
    force, turn = pushes(runs)
    craft = runs.craft
    return runs.h * _size(force / craft.mass, 0.0, turn / craft.inertia, craft)


def _grip(runs: Batch) -> Array:
    """m/s: what friction takes of the speed in a sub-step, of the centre of gravity or of the drag point about it."""
    craft = runs.craft
    if not np.any(craft.skirt_friction):
        return np.zeros_like(runs.h)
    radius = np.array([friction_radius(craft.one(i)) for i in range(len(runs.h))])
    straight, turning = craft.friction_force / craft.mass, craft.friction_force * radius / craft.inertia
    return runs.h * np.fmax(straight, turning * np.abs(craft.drag_center))


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


def higher_order_bound(order: int, seen: Numbers, runs: Batch) -> Array:
    """1, of V: N*lambda*eps^order + s*sigma*eps^2, lambda = s*sigma + rho + sqrt(tau), eps = lambda + alpha + phi.

    With the directional area, and of second order with rotational drag, s*sigma*eps more; with friction, that of first
    order.
    """
    drag = _aspect(runs) * seen.sigma
    rate = drag + seen.rho + np.sqrt(seen.tau)
    eps = rate + seen.alpha + seen.phi
    smooth = runs.substeps * rate * eps**order + drag * eps**2
    has_kinks = (runs.craft.drag_area == DIRECTIONAL) | ((runs.craft.rotational_drag > 0.0) & (order == 2))
    kinks = np.where(has_kinks, drag * eps, 0.0)
    rest = np.where(runs.craft.skirt_friction > 0.0, first_order_bound(seen, runs), 0.0)
    return smooth + kinks + rest


def _aspect(runs: Batch) -> Array:
    """1: s, how much steeper the directional drag can be than its own size: the longer over the shorter wall."""
    walls = runs.craft.length / runs.craft.width
    return np.where(runs.craft.drag_area == DIRECTIONAL, np.fmax(walls, 1.0 / walls), 1.0)


def way_bound(order: int, seen: Numbers, runs: Batch, bound: Array) -> Array:
    """1, of N*h*V: the bound of the velocity, and what a sub-step's own way misses; see the top of stability.py."""
    change = _aspect(runs) * seen.sigma + seen.alpha + seen.phi
    eps = change + seen.rho + np.sqrt(seen.tau)
    return bound + np.where((order == 1) | (runs.craft.skirt_friction > 0.0), change, eps**order)


BOUNDS: Mapping[str, Callable[[Numbers, Batch], Array]] = MappingProxyType(
    {
        "semi_implicit_euler": first_order_bound,
        "drag_implicit": first_order_bound,
        "rk4": partial(higher_order_bound, 4),
        "splitting": partial(higher_order_bound, 2),
    }
)


# ---- the verdicts


class Judged(NamedTuple):
    """The verdicts on a batch of runs of one method, shape (runs,) each."""

    numbers: Numbers
    error: Array
    """1: of V, the difference in velocity (or in x_d*yaw rate) from the reference at the end; NaN where none is made"""
    bound: Array
    """1: of V, by the formula"""
    way_error: Array
    """1: of N*h*V, the difference in position; NaN where no reference is made"""
    way_bound: Array
    """1: of N*h*V, by the formula"""
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
    near, reference = references(some)
    doubt, rounding = _difference(near, reference, some.craft), ROUNDING + EACH * runs.substeps
    judged = {}
    for method, numbers in seen.items():
        ends = State(*(cast(Array, values)[needed] for values in numbers.end))
        checked = calm[method] & (numbers.sigma <= NO_REFERENCE)
        speed = numbers.speed[needed]
        way = runs.substeps * some.h * speed
        error, unsure, astray = (
            _where(checked, needed, _per(apart, scale))
            for apart, scale in ((_difference(ends, reference, some.craft), speed), (doubt, speed),
                                 (np.hypot(ends.x - reference.x, ends.y - reference.y), way))
        )  # fmt: skip
        with np.errstate(all="ignore"):
            bound = BOUNDS[method.name](numbers, runs) + rounding * np.exp(runs.substeps * np.sqrt(numbers.tau))
            longest = way_bound(method.order, numbers, runs, bound)
            accurate = ((error <= bound) & (astray <= longest)) | (numbers.sigma > NO_REFERENCE)
        verdict = np.select([~numbers.finite, ~calm[method], accurate], [FAILED, WARNED, ACCURATE], SILENT)
        judged[method.name] = Judged(numbers, error, bound, astray, longest, unsure, verdict.astype(np.int8))
    return judged


def references(runs: Batch) -> tuple[State, State]:
    """The ends by RK4 at the two fractions of the sub-step; of those that leave the numbers there, at finer ones."""
    near, reference = (advanced(runs, RK4, runs.start, runs.substeps, fine)[0] for fine in (REFINED, CHECKED))
    lost = np.flatnonzero(~np.isfinite(np.sum(near, axis=0) + np.sum(reference, axis=0)))
    if len(lost):
        few = chosen(runs, lost)
        for ends, fine in ((near, REFINED), (reference, CHECKED)):
            finer = advanced(few, RK4, few.start, few.substeps, FINER * fine)[0]
            for values, better in zip(cast(Any, ends), finer, strict=True):
                values[lost] = better
    return near, reference


def _where(checked: Mask, needed: NDArray[Any], values: Array) -> Array:
    """The values of the needed runs in their places; NaN where nothing is checked."""
    whole = np.full(checked.shape, np.nan)
    whole[needed] = values
    return np.where(checked, whole, np.nan)


def _difference(a: State, b: State, craft: Crafts) -> Array:
    with np.errstate(all="ignore"):
        return _size(a.vx - b.vx, a.vy - b.vy, a.yaw_rate - b.yaw_rate, craft)


METHOD = pl.Enum([method.name for method in FIXED])
SAMPLING = pl.Enum(list(SAMPLINGS))


def measure_extremes(runs: int = 65536, seed: int = 1, size: int = BATCH, tell: Tell = lambda _: None) -> pl.DataFrame:
    """Random runs of each sampling, in batches of a size, of the long ones fewer; a row a run and method."""
    rng, frames = np.random.default_rng(seed), []
    batches = -(-runs // size)
    for i, (sampling, kind) in itertools.product(range(batches), SAMPLINGS.items()):
        substeps, count = kind.substeps[i % len(kind.substeps)], size // kind.part
        for name, judged in judge(sample(rng, count, substeps, sampling)).items():
            columns = {"sigma": judged.numbers.sigma, "rho": judged.numbers.rho, "error": judged.error}
            columns |= {"bound": judged.bound, "doubt": judged.doubt, "verdict": judged.verdict}
            columns |= {"way_error": judged.way_error, "way_bound": judged.way_bound}
            labels = pl.lit(name, METHOD).alias("method"), pl.lit(sampling, SAMPLING).alias("sampling")
            frames.append(pl.DataFrame(columns).with_columns(*labels, pl.lit(substeps).alias("substeps")))
        tell((i + 1) / batches)
    return pl.concat(frames).with_columns(pl.col("error", "doubt", "way_error").fill_nan(None))


def shares(extremes: pl.DataFrame) -> pl.DataFrame:
    """A row a method and sampling: the shares of its runs.

    accurate: within a bound below V; vague: within one above V, which says nothing; wrong: off by more than a tenth of
    V without a warning, up to sigma = NO_REFERENCE; worst, doubt: the largest error, and uncertainty of the reference,
    in units of the bound; worst_way: the largest error of the position in units of its own.
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
            worst_way=(pl.col("way_error") / pl.col("way_bound")).max(),
            doubt=(pl.col("doubt") / bound).max(),
        )
        .sort("method", "sampling")
    )
