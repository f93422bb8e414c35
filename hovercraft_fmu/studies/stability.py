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
- Splitting, coasting: v' = v/(1 + z*(1 + z/2)) with z = x/(1 + x/2): always slower, at most by 4/5, and never backward.
  Thrust: at v = 1 the slope is 1 - 2*x/(1 + x + x^2/2), from 0.17 to 1: no limit, but long steps bring it there slowly,
  1 - 4/x. From rest at x = 1000 it is at 0.66 of the terminal speed after 400 sub-steps.
- RK4, coasting: v' = v*P(x), P made of four nested squares, never below 0; P = 1 at x = 2.4552.
- RK4, thrust: the slope at v = 1 is 1 - z + z^2/2 - z^3/6 + z^4/24 with z = 2*x, never below 0, 1 at z = 2.7853,
  x = 1.3926. Above, it settles at a false speed. Where that diverges is measured only.
- Spin: the drag point moves with w = r*x_d, and w' = -k*(1/m + x_d^2/I)*w*|w|: coasting, with that factor for kappa.

The stability number of the FMU is sigma = h*2*k*q*(1/m + x_d^2/I): 2*x straight ahead with x_d = 0, and in a spin.

THE EXTREMES. Random craft, far beyond the sensible. N sub-steps of h; the largest of

    sigma = h*2*k*q*(1/m + x_d^2/I)        drag: the stability number (rotational drag d*r*|r| adds h*2*d*|r|/I)
    rho = h*|r|                            rotation in a sub-step
    tau = h^2*(k*q^2*|x_d| + |turn|)/I     what the air, were it abeam, and the moment (turn) of the thrusters and from
                                           outside can add to it
    alpha = h*(gain of speed by thrust, thrusters and loads from outside)/V
    phi   = h*(loss of speed by friction)/V

wherever the loads are worked out (RK4's stages, too) and at the end, and V, the largest speed of the centre of gravity,
or of the drag point about it (|x_d*r|), or of the wind. All of sigma, rho, sqrt(tau), alpha and phi are proportional to
h: rates of the motion times the sub-step. Drag is minus the slope of the convex function k*q^3/3, so at a held heading
two motions never drift apart by it, and local errors add up without growing. Its power is -k*q^3 wherever the drag
point is: ahead of the centre of gravity, too, energy never grows. But the heading is not held:

- A swing theta about the course through still air obeys theta'' = -+ (k*V^2*|x_d|/I)*theta. With the drag point behind
  (of what moves) it returns, as a weathervane's; in front it grows at the rate sqrt(tau)/h, over N sub-steps by
  exp(N*sqrt(tau)) at most, until the craft has turned round. What a method misses of the swing is a share of the
  swing, grows with it, and so needs no factor in a bound in units of V; what is there without a swing does: roundings,
  which are in all bounds as (1e-11 + 1e-13*N)*exp(N*sqrt(tau))*V. Argued, not proven; measured over 10 000 sub-steps
  (without the exponential 3 % of RK4's runs with the drag centre in front were outside).
- The way is the sum of h times the velocities: the error of the position is at most N*h times the velocity's bound and
  what a sub-step's own way misses, N*h*C*(s*sigma + alpha + phi)*V of first order (a rectangle) and with friction,
  N*h*C*eps^p*V of the order p else.

- First order: a sub-step leaves h^2/2*|v''|. Drag and direction change by delta = sigma + rho + tau of themselves, what
  they act on by delta + alpha of V. So the error is at most C*N*delta*(delta + alpha)*V, where C = 1/2 is Taylor's.
- Splitting: with the rates of RK4, below: lambda*eps^2*V a sub-step; where the drag point passes through rest, once,
  sigma*eps^2*V. So the error is at most C*(N*lambda + sigma)*eps^2*V. Rotational drag, which it takes half before and
  half after, costs sigma*eps*V where the yaw rate passes through 0.
- RK4: rates lambda = sigma + rho + sqrt(tau), and eps = lambda + alpha: lambda*eps^4*V a sub-step; and where the drag
  point passes through rest q has a kink, and one sub-step errs by sigma*eps^2*V, of third order. So the error is
  at most C*(N*lambda*eps^4 + sigma*eps^2)*V. (sqrt(tau) is the rate at which the craft swings about its course, as a
  weathervane does, times h.)
- The directional area has a steeper drag than its own size says, by the longer wall over the shorter, s: s*sigma stands
  for sigma. Where the air comes along a wall it has a kink, which costs RK4 s*sigma*eps*V. Near rest, RK4 with friction
  takes steps of Euler's, and friction is an implicit step of splitting's, so with friction the bound of the first order
  is added to their own.
- Adaptive: each of its N steps errs by less than the tolerance, in SI units; a heading that is off by it turns a
  velocity V off by V times as much. So the error is at most C*N*tolerance*max(1, V), C = 10. Its steps are its
  own: h is the first one, and is not in the bound.

The constant is 1 in the first two: of some 10^5 runs the worst needs 0.50 for the first order, 0.05 for RK4; with every
term 0.99 and 0.67, of the position 0.50 for both.
"""

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import polars as pl

from ..drawing.figures import new_figure
from ..drawing.palette import INK, METHODS, QUIET
from ..host.fleet import Crafts
from ..model.dynamics import Controls, State
from ..model.integrators import Integrator
from .extremes import BATCH, FIXED, Array, Batch, Mask, advanced, chosen, made, measure_extremes, shares
from .laboratory import Findings, Shown, Tell, part
from .limits import SAMPLING, measure_limits

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


# ---- the map

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


class Motion(NamedTuple):
    """A motion along one line, of some craft at once, with its step in dimensionless form."""

    name: str
    crafts: Batch
    """One run a craft, from the scale of the speed (where it starts, or the terminal speed); h is the unit of steps."""

    @property
    def goal(self) -> float:
        """1: where the speed should go, in units of its scale."""
        return 1.0 if np.any(self.crafts.controls.thrust) else 0.0

    @property
    def near(self) -> float:
        """1: where a run starts, in units of the scale; by the terminal speed a little below it."""
        return 1.0 - NEAR * self.goal

    def speed(self, state: State, craft: Any) -> Array:
        """m/s: ahead; in a spin, that of the drag point abeam."""
        if not np.any(self.crafts.start.yaw_rate):
            return state.vx
        c, s = np.cos(state.heading), np.sin(state.heading)
        return c * state.vy - s * state.vx + craft.drag_center * state.yaw_rate

    def speeds(self, method: Integrator, x: Array, start: float, parts: Sequence[int]) -> Iterator[Array]:
        """The speed in units of its scale after each part of so many sub-steps, for dimensionless steps (craft, steps).

        The start, too, is in units of the scale.
        """
        lanes = chosen(self.crafts, np.repeat(np.arange(len(x)), x.shape[1]))
        scale = self.speed(lanes.start, lanes.craft)
        lanes = lanes._replace(start=_times(start, lanes.start), h=x.ravel() * lanes.h)
        state = lanes.start
        for n in parts:
            state = advanced(lanes, method, state, n)[0]
            yield (self.speed(state, lanes.craft) / scale).reshape(x.shape)

    def gap(self, speed: Any) -> Any:
        """1: how far a speed is from the goal, in units of the gap at the start."""
        return (speed - self.goal) / (self.near - self.goal)


def _times(factor: float, state: State) -> State:
    return State(*(factor * value for value in state))


def motions() -> tuple[Motion, ...]:
    """The textbook's craft and hard ones: coasting straight, under thrust, in a spin about the centre of gravity."""
    mass: Array = np.array([100.0, 1e-3, 1e-3, 1.0, 1e6, 1e6, 10.0, 1e3])
    density: Array = np.array([1.225, 1.225, 1e3, 1e-6, 1e3, 1.225, 1e3, 0.0023769])
    fraction: Array = np.array([-0.25, -0.5, 0.0, -0.5, -0.5, 0.0, -0.1, -0.25])
    speed: Array = np.array([2.0, 1e6, 1e3, 1e6, 1e-3, 1e6, 1.0, 1e-6])
    thrust: Array = np.array([5.0, 1e9, 1.0, 1e-3, 1e9, 1e6, 1e-6, 1e9])
    craft = Crafts(mass=mass, air_density=density, drag_center_fraction=fraction, thrust_max=thrust)
    k = craft.drag_factor
    terminal = np.sqrt(thrust / k)
    # in the spin the point of drag must stop long before the craft has turned: a light craft in a dense medium
    thin = Crafts(mass=mass, inertia=np.minimum(500.0, 1e-3 * mass), air_density=1e3, drag_center_fraction=-0.5)
    lever = thin.drag_factor * (1.0 / thin.mass + thin.drag_center**2 / thin.inertia)
    spinning = State(yaw_rate=speed / thin.drag_center)
    return (
        Motion("coasting", made(craft, Controls(0.0), State(vx=speed), mass / (k * speed))),
        Motion("thrust", made(craft, Controls(thrust), State(vx=terminal), mass / (k * terminal))),
        Motion("spin", made(thin, Controls(0.0), spinning, 1.0 / (lever * speed))),
    )


def monotone(motion: Motion, method: Integrator, x: Array) -> Mask:
    """Whether the speed comes nearer to where it should go with every sub-step, from one side."""
    right, last = np.ones(x.shape, bool), np.ones(x.shape)
    for speed in motion.speeds(method, x, motion.near, [1] * SHORT):
        gap = motion.gap(speed)
        right &= (gap >= -1e-9) & (gap <= last + 1e-9)  # roundings of 1e-16 over NEAR
        last = gap
    return right


def stable(motion: Motion, method: Integrator, x: Array) -> Mask:
    """Whether the speed, disturbed a little, ends nearer to where it should go."""
    (speed,) = motion.speeds(method, x, motion.near, [LONG])
    return np.abs(motion.gap(speed)) < 0.999  # the slowest, drag_implicit at 10^6, loses 0.4 % in LONG


def bounded(motion: Motion, method: Integrator, x: Array) -> Mask:
    """Whether the speed stays within bounds; under thrust from rest, and from near the terminal speed."""
    starts = (motion.near, 0.0) if motion.goal else (1.0,)
    ends = [speed for start in starts for speed in motion.speeds(method, x, start, [LONG])]
    return np.all(np.abs(ends) < RUNAWAY, axis=0)


QUALITIES: Mapping[str, Callable[[Motion, Integrator, Array], Mask]] = MappingProxyType(
    {"monotone": monotone, "stable": stable, "bounded": bounded}
)


def largest_step(motion: Motion, method: Integrator, quality: str) -> Array:
    """1: the dimensionless step up to which the motion has the quality, shape (craft,); infinite where at all."""
    craft = np.arange(len(motion.crafts.h))
    x = np.tile(SCAN, (len(craft), 1))
    with np.errstate(all="ignore"):
        right = QUALITIES[quality](motion, method, x)
        for _ in range(2):
            failed = np.argmin(right, axis=1)
            low = np.where(failed > 0, x[craft, failed - 1], 0.0)
            never = right.all(axis=1)
            x = np.linspace(low, np.where(never, low, x[craft, failed]), FINE, axis=1)
            right = np.where(never[:, None], True, QUALITIES[quality](motion, method, x))
            right[:, 0], right[:, -1] = True, never
    failed = np.argmin(right, axis=1)
    return np.where(right.all(axis=1), np.inf, 0.5 * (x[craft, failed - 1] + x[craft, failed]))


ANY = (np.inf, np.inf, np.inf)
THEORY: Mapping[tuple[str, str], tuple[float, float, float]] = MappingProxyType({
    **{("semi_implicit_euler", motion): (1.0, 2.0, 2.0) for motion in ("coasting", "spin")},
    **{("drag_implicit", motion): ANY for motion in ("coasting", "spin")},
    **{("rk4", motion): (2.4552, 2.4552, 2.4552) for motion in ("coasting", "spin")},
    **{("splitting", motion): ANY for motion in ("coasting", "thrust", "spin")},
    ("semi_implicit_euler", "thrust"): (0.5, 1.0, 1.4659), ("drag_implicit", "thrust"): (1.0, np.inf, np.inf),
    ("rk4", "thrust"): (1.3926, 1.3926, np.nan),  # half the root of z^3/24 - z^2/6 + z/2 = 1
})  # fmt: skip
"""Monotone, stable, bounded up to these dimensionless steps, as derived above; NaN: no theory."""


def measure_map(all_motions: Sequence[Motion], tell: Tell) -> pl.DataFrame:
    """All limits of all methods: the smallest and the largest dimensionless step over the craft, and the theory's."""
    rows, pairs = [], list(itertools.product(FIXED, all_motions))
    for done, (method, motion) in enumerate(pairs, 1):
        for quality, expected in zip(QUALITIES, THEORY[method.name, motion.name], strict=True):
            x = largest_step(motion, method, quality)
            rows.append((method.name, motion.name, quality, float(x.min()), float(x.max()), expected))
        tell(done / len(pairs))
    return pl.DataFrame(rows, ("method", "case", "quality", "smallest", "largest", "theory"), orient="row")


# ---- the study


def measure(quick: bool, tell: Tell) -> Findings:
    """The limits, the extremes, and the picture of both; quick: two craft, straight ahead, and fewer runs."""
    whole = motions()
    if quick:
        whole = tuple(motion._replace(crafts=chosen(motion.crafts, slice(0, 2))) for motion in whole[:2])
    limits = measure_map(whole, part(tell, 0.0, 0.4))
    runs, size = (1024, 256) if quick else (65536, BATCH)
    extremes = measure_extremes(runs, size=size, tell=part(tell, 0.4, 0.9))
    warnings = measure_limits(1000 if quick else 6000, part(tell, 0.9, 1.0))
    rows = shares(extremes)
    figure = new_figure(figsize=(10.0, 4.6), dpi=75, layout="constrained")
    draw(figure, extremes)
    title = "The largest dimensionless step (h*kappa*v0 coasting, h*kappa*v_t under thrust)"
    tables = [Shown(title, limits), Shown("Random extremes; shares of the runs", rows),
              Shown("When the FMU warns", warnings)]  # fmt: skip
    records = {"stability": limits, "extremes": rows, "warnings": warnings}
    return Findings(records, tables, {"stability": figure}, [SAMPLING])


NOTES = (
    ("all four right", (0.3, 1.06)), ("false cycle", (0.62, 1.3)), ("diverges", (1.57, -0.62)),
    ("false speed", (1.43, 0.72)), ("the others are right", (1.6, 1.06)), ("diverges", (2.09, -0.62)),
)  # fmt: skip
"""What is seen where, in the first panel."""
DRAWN = tuple(method.name for method in FIXED)
"""All that have a step of their own to draw over; adaptive chooses its steps."""
DOTS = 1500
"""A method."""


def draw(figure: "Figure", extremes: pl.DataFrame) -> None:
    """Where the methods settle; and the errors of the extremes under their bound."""
    settled, errors = figure.subplots(1, 2)
    _draw_settled(settled)
    _draw_errors(errors, extremes)
    for axes in (settled, errors):
        axes.spines[["top", "right"]].set_visible(False)


def _draw_settled(axes: "Axes") -> None:
    """The speeds of sub-steps 960 to 1000 from rest under thrust, for each step."""
    textbook = motions()[1]
    textbook = textbook._replace(crafts=chosen(textbook.crafts, slice(0, 1)))
    x = np.linspace(0.01, 2.4, 1600)[None, :]
    for name in DRAWN:
        method, style = next(each for each in FIXED if each.name == name), METHODS[name]
        for speed in itertools.islice(textbook.speeds(method, x, 0.0, [960, *[1] * 40]), 1, None):
            axes.plot(x[0], speed[0], ".", color=style.color, markersize=1.0, markeredgewidth=0.0)
        axes.plot([], [], style.marker, color=style.color, markersize=4, label=name)
    for words, place in NOTES:
        axes.annotate(words, place, fontsize="small", color=QUIET)
    axes.set(xlim=(0.0, 2.4), ylim=(-1.0, 2.4), xlabel="dimensionless step  $h\\,\\kappa\\,v_t$",
             ylabel="speed / terminal speed")  # fmt: skip
    axes.set_title("Where a launch under thrust settles", loc="left")
    axes.legend(loc="upper left", frameon=False)


def _draw_errors(axes: "Axes", extremes: pl.DataFrame) -> None:
    """Every run that did not warn: its error against the bound of the formula."""
    for name in DRAWN:
        runs = _some(extremes.filter((pl.col("method") == name) & pl.col("error").is_not_null()), DOTS)
        style, errors = METHODS[name], np.maximum(runs["error"], 1e-16)
        axes.plot(runs["bound"], errors, ".", markersize=1.6, alpha=0.6, color=style.color)
        axes.plot([], [], style.marker, markersize=4, color=style.color, label=name)
    line = np.array([1e-12, 1e4])
    axes.plot(line, line, color=INK, linewidth=1.0)
    axes.set(xscale="log", yscale="log", xlim=(5e-13, 1e4), ylim=(5e-17, 1e4), xlabel="the formula's bound / V",
             ylabel="error / V at the end of the run")  # fmt: skip
    axes.set_title("Runs that did not warn, and their bound", loc="left")
    axes.legend(loc="upper left", frameon=False, markerscale=1.2)


def _some(runs: pl.DataFrame, most: int) -> pl.DataFrame:
    return runs.sample(min(most, len(runs)), seed=0)
