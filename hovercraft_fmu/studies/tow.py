"""How long a communication step may be for a stiff line, and what energy held forces add: theory, and measured beside.

Two masses on a line that stays taut: the stretch about its mean oscillates with w = sqrt(k/mu), 1/mu = 1/m1 + 1/m2, at
the damping ratio zeta = c/(2*sqrt(k*mu)). The craft hold the force over the communication step H. With a = H*w, the
stretch x and its rate v in units of w, and f = -x - 2*zeta*v, a step is x + a*v + a^2/2*f, v + a*f. So for a force of

- the communication point itself (Gauss-Seidel, the tether first): lambda^2 - (2 - a^2/2 - 2*zeta*a)*lambda
  + (1 - 2*zeta*a + a^2/2) = 0. Stable (Jury's criterion) where a < 4*zeta and a < 1/zeta. Without damping
  |lambda|^2 = 1 + a^2/2: never; the amplitude grows by H*w^2/4 a second.
- the point before (Jacobi, all side by side): lambda*(lambda - 1)^2 + (lambda - 1)*(a^2/2 + 2*zeta*a) + a^2 = 0.
  Without damping it grows three times as fast: the force is 3/2 of a step old in the mean, and not 1/2.
- the middle of the step, which a master can work out that knows derivatives (of the accelerations with respect to the
  forces, of the force with respect to stretch and rate): f*(1 + a^2/8 + zeta*a) = -(x + a/2*v) - 2*zeta*v. Without
  damping the determinant is 1: |lambda| = 1 exactly, no energy is added, up to a = 2*sqrt(2).

Neither stiffness nor masses are left in it: one curve for all. The energy grows by twice the rate of the amplitude.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
import polars as pl
from numpy.typing import NDArray

from ..coupling import GAUSS_SEIDEL, JACOBI
from ..drawing.figures import new_figure
from ..drawing.palette import INK, OTHER, SEA
from ..fmu.interface import BY_NAME
from ..fmu.native_package import build_native_fmu
from ..host import Fmu, Instance
from ..host.fleet import Crafts, advance_fleet
from ..model.dynamics import State
from ..model.integrators import integrator
from ..model.subcycling import Settings
from ..tether.line import Line, pull
from ..tether.tether_interface import CRAFT, PARAMETERS
from ..tether.tether_package import build_native_tether
from ..whole import temporary_folder
from .laboratory import Findings, Shown, Tell

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = NDArray[np.float64]
WITH_DERIVATIVES = "derivatives"
SCHEMES = (GAUSS_SEIDEL, JACOBI, WITH_DERIVATIVES)
DAMPING = (0.02, 0.05, 0.1, 0.2, 0.35, 0.5, 0.7, 1.0)
"""1: damping ratios."""
LINES = ((2.0, 1.0), (2.0, 100.0), (2000.0, 1.0), (2000.0, 100.0))
"""Stiffness [N/m], and how many times as heavy as the second craft the first one is."""
STEPS = (0.02, 0.05, 0.1, 0.2, 0.4)
"""1: H*w."""
PULL = 1000.0
"""N, mean: so that the line stays taut."""
SMALL = 1e-9
"""m: what the oscillation begins with, beside a mean stretch of at least half a metre."""
SMALL_OF_FREE = 1e-5
"""m: the same of the line without damping, whose mean stretch is 500 m."""
LARGE = 1e6
"""Times that: up to there growth is fitted."""
COUNT = 300
"""Communication steps."""
HALVINGS = 12
FOLLOWS = [BY_NAME["acceleration.x"].reference], [BY_NAME["external.force.x"].reference], [1.0]
"""The directional derivative that is asked for: 1/kg."""


class Cases(NamedTuple):
    """Tows that are made side by side; arrays of shape (cases,)."""

    stiffness: Array
    """N/m"""
    first: Array
    """kg"""
    second: Array
    """kg"""
    damping: Array
    """1: the ratio"""
    scheme: NDArray[np.str_]

    @property
    def reduced(self) -> Array:
        """kg: mu."""
        return self.first * self.second / (self.first + self.second)

    @property
    def omega(self) -> Array:
        """rad/s: w."""
        return np.sqrt(self.stiffness / self.reduced)


def cases(dampings: Sequence[float], lines: Sequence[tuple[float, float]], schemes: Sequence[str]) -> Cases:
    """All of these with one another; the second craft has 100 kg."""
    rows = [(k, 100.0 * m, 100.0, zeta, s) for k, m in lines for zeta in dampings for s in schemes]
    k, first, second, zeta = np.array([row[:4] for row in rows]).T
    return Cases(k, first, second, zeta, np.array([row[4] for row in rows]))


def amplitudes(chosen: Cases, a: Array, count: int = COUNT) -> Array:
    """m, shape (count, cases): of the oscillation, sqrt(x^2 + v^2), at every communication point; `a` is H*w.

    By the batch, which makes both craft, and the tether's law; RK4 is exact where a force is held.
    """
    n, h = len(a), a / chosen.omega
    damping = 2.0 * chosen.damping * np.sqrt(chosen.stiffness * chosen.reduced)
    lines = [
        Line(k, c, 10.0, 0.0, 0.0, 0.0, 0.0) for k, c in zip(chosen.stiffness.tolist(), damping.tolist(), strict=True)
    ]
    mean = PULL / chosen.stiffness
    states = np.zeros((6, 2 * n))
    states[0, :n] = 10.0 + mean + SMALL
    crafts = Crafts(mass=np.concatenate([chosen.first, chosen.second]), drag_coefficient=0.0)
    late = chosen.scheme == JACOBI
    settings, steps, before = Settings(cast(Any, np.tile(h, 2)), integrator(3)), np.tile(h, 2), np.zeros(n)
    found = np.empty((count, n))
    for k in range(count):
        stretch, speed = states[0, :n] - states[0, n:] - 10.0 - mean, states[3, :n] - states[3, n:]
        found[k] = np.hypot(stretch, speed / chosen.omega)
        told = np.array([
            pull(State(*first), State(*second), line).tension
            for first, second, line in zip(states[:, :n].T.tolist(), states[:, n:].T.tolist(), lines, strict=True)
        ])  # fmt: skip
        tension = np.where(late & (k > 0), before, told)
        before = told
        controls = np.zeros((8, 2 * n))
        controls[5] = np.concatenate([PULL - tension, tension - PULL])  # each is pulled outward as much
        states = advance_fleet(states, controls, crafts, steps, settings).states
    return found


def limits(chosen: Cases, tell: Tell = lambda _: None) -> Array:
    """1: the largest stable H*w, by halving: stable is what is smaller in the last third than in the first."""
    low, high = np.full(len(chosen.omega), 0.01), np.full(len(chosen.omega), 3.0)
    for k in range(HALVINGS):
        a = 0.5 * (low + high)
        with np.errstate(all="ignore"):
            size = amplitudes(chosen, a)
        third = COUNT // 3
        stable = size[-third:].max(axis=0) < size[:third].max(axis=0)
        low, high = np.where(stable, a, low), np.where(stable, high, a)
        tell((k + 1) / HALVINGS)
    found: Array = 0.5 * (low + high)
    return found


def roots(scheme: str, a: float, zeta: float) -> Any:
    """The lambdas of the theory."""
    p = a * a / 2.0 + 2.0 * zeta * a
    if scheme == JACOBI:
        return np.roots([1.0, -2.0, 1.0 + p, a * a - p])
    if scheme == GAUSS_SEIDEL:
        return np.roots([1.0, -(2.0 - p), 1.0 - 2.0 * zeta * a + a * a / 2.0])
    d = 1.0 + a * a / 8.0 + zeta * a
    x, v = -1.0 / d, -(a / 2.0 + 2.0 * zeta) / d  # the force, of stretch and of rate
    return np.linalg.eigvals(np.array([[1.0 + a * a / 2.0 * x, a + a * a / 2.0 * v], [a * x, 1.0 + a * v]]))


def limit_of_theory(scheme: str, zeta: float) -> float:
    """1: the H*w at which the largest lambda leaves the unit circle; by halving, as it does so once."""
    low, high = 1e-3, 4.0
    for _ in range(40):
        a = 0.5 * (low + high)
        low, high = (a, high) if np.abs(roots(scheme, a, zeta)).max() < 1.0 else (low, a)
    return low


class Grown(NamedTuple):
    """A line without damping, by three FMUs."""

    rate: float
    """1: of the amplitude, in units of w a second, fitted over the run"""
    calls: float
    """Of functions of the three, in a communication step"""


def grown(craft: Path, tether: Path, scheme: str, a: float, count: int = 2 * COUNT) -> Grown:
    """`count` steps of the native FMUs; the line is the first of LINES, `a` is H*w.

    A master that knows derivatives asks the craft how the accelerations follow the forces, and the tether once for its
    own two: stiffness and damping.
    """
    with (
        Fmu(craft) as craft_fmu, Fmu(tether) as tether_fmu, craft_fmu.instance() as first,
        craft_fmu.instance() as second, tether_fmu.instance() as line,
    ):  # fmt: skip
        free = _FreeLine(first, second, line, a)
        found = np.array([free.step(i, scheme) for i in range(count)])
    taut = found < LARGE * SMALL_OF_FREE  # then the line is, too
    rate = float(np.polyfit(a * np.flatnonzero(taut), np.log(found[taut]), 1)[0])
    return Grown(rate, free.calls / count)


class _FreeLine:
    """Two craft of a mass, pulled outward, and a line without damping; `calls` counts what steps ask of the FMUs."""

    def __init__(self, first: Instance, second: Instance, line: Instance, a: float) -> None:
        stiffness, mass = LINES[0][0], 100.0
        self.omega = float(np.sqrt(2.0 * stiffness / mass))
        self.calls, self._h, self._length = 0, a / self.omega, 10.0 + PULL / stiffness
        self._both, self._line = (first, second), line
        craft = {"mass": mass, "drag_coefficient": 0.0, "integrator_number": 3, "step_size": self._h}
        x = self._length + SMALL_OF_FREE
        first.start({**craft, "pose.x": x})
        second.start(craft)
        given = {name: 0.0 for name in PARAMETERS if "attachment" in name or name == "damping"}
        line.start({**given, "stiffness": stiffness, "slack_length": 10.0, "first.pose.x": x})
        self._motions = [each.port("pose.x", "velocity.x") for each in self._both]
        self._forces = [each.port("external.force.x") for each in self._both]
        self._ends = line.port(*(f"{each}.{name}" for each in CRAFT for name in ("pose.x", "velocity.x")))
        self._tension = line.port("tension")
        self._slopes = line.port("stiffness", "damping").get()

    def _call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        self.calls += 1
        return function(*arguments)

    def step(self, i: int, scheme: str) -> float:
        """m: the amplitude before it."""
        (x, vx), (other_x, other_vx) = (self._call(each.get) for each in self._motions)
        before = self._call(self._tension.get)[0] if scheme == JACOBI else 0.0
        self._call(self._ends.set, (x, vx, other_x, other_vx))
        self._call(self._line.step, i * self._h, self._h)
        tension = before if scheme == JACOBI else self._call(self._tension.get)[0]
        if scheme == WITH_DERIVATIVES:
            tension = self._middle(tension, vx - other_vx)
        for each, force, sign in zip(self._both, self._forces, (1.0, -1.0), strict=True):
            self._call(force.set, [sign * (PULL - tension)])
            self._call(each.step, i * self._h, self._h)
        return float(np.hypot(x - other_x - self._length, (vx - other_vx) / self.omega))

    def _middle(self, tension: float, speed: float) -> float:
        """N: in the middle of the step: the force goes on with the stretch, and with what it does itself."""
        h, (k, c) = self._h, self._slopes
        light = sum(self._call(each.fmpy.getDirectionalDerivative, *FOLLOWS)[0] for each in self._both)  # 1/kg
        ahead = tension + 0.5 * h * k * speed
        return float(PULL + (ahead - PULL) / (1.0 + (h * h * k / 8.0 + 0.5 * h * c) * light))


def measure(quick: bool, tell: Tell) -> Findings:
    """Limits over damping, stiffness and mass ratio; growth without damping; quick: one line, fewer ratios."""
    chosen = cases(DAMPING[1::2] if quick else DAMPING, LINES[1:2] if quick else LINES, SCHEMES[:2])
    limit = limits(chosen, tell)
    theory = [limit_of_theory(s, z) for s, z in zip(chosen.scheme.tolist(), chosen.damping.tolist(), strict=True)]
    ratio = chosen.first / chosen.second
    found = pl.DataFrame({"scheme": chosen.scheme.tolist(), "damping_ratio": chosen.damping, "limit": limit,
                          "stiffness": chosen.stiffness, "mass_ratio": ratio, "theory": theory})  # fmt: skip
    free = _growth()
    off = float((found["limit"] / found["theory"] - 1.0).abs().max())  # type: ignore[arg-type]
    wide = found.group_by("scheme", "damping_ratio").agg(
        pl.col("limit").min().alias("least"), pl.col("limit").max().alias("largest"), pl.col("theory").first()
    )
    return Findings(
        {"tow_limits": found, "tow_growth": free},
        [
            Shown(
                "A tow: the largest stable H*w, over all stiffnesses and mass ratios",
                wide.sort("scheme", "damping_ratio"),
            ),
            Shown("A line without damping, by FMUs: growth of amplitude and energy, and calls of FMUs, in 1/w", free),
        ],
        {"tow": draw(found, free)},
        [f"limits of a tow: {off:.1%} from the theory at most, whatever stiffness and masses are", _cost(free)],
    )


def _growth() -> pl.DataFrame:
    """Of a line without damping, for every scheme and step; energy and calls are those of the time 1/w."""
    rows = []
    with temporary_folder() as place:
        files = build_native_fmu(Path(place) / "Craft.fmu"), build_native_tether(Path(place) / "Tether.fmu")
        for scheme in SCHEMES:
            for a in STEPS:
                rate, calls = grown(*files, scheme, a)
                theory = float(np.log(np.abs(roots(scheme, a, 0.0)).max()) / a)
                rows.append((scheme, a, rate, theory, 2.0 * rate, calls / a))
    return pl.DataFrame(rows, schema=["scheme", "step", "growth", "theory", "energy", "calls"], orient="row")


def _cost(free: pl.DataFrame) -> str:
    """What a small step costs and gains, and what derivatives do."""
    by = {(scheme, step): (energy, calls) for scheme, step, _, _, energy, calls in free.iter_rows()}
    (small, many), (large, few) = by[GAUSS_SEIDEL, STEPS[0]], by[GAUSS_SEIDEL, STEPS[-1]]
    energy, calls = by[WITH_DERIVATIVES, STEPS[-1]]
    return (
        f"a line without damping: {STEPS[-1] / STEPS[0]:.0f} times the calls of FMUs ({few:.1f}, {many:.0f} in 1/w) "
        f"bring the energy that is added from {large:.1%} to {small:.1%}; derivatives cost "
        f"{calls / few - 1.0:.0%} more calls ({calls:.1f}) and add {abs(energy):.0e}"
    )


RATIOS, TICKS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0), (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
"""Figures on the axes."""
STYLES = {GAUSS_SEIDEL: (OTHER, "v"), JACOBI: (INK, "P"), WITH_DERIVATIVES: (SEA, "o")}


def draw(found: pl.DataFrame, grown: pl.DataFrame) -> "Figure":
    """Limits over the damping ratio, growth over the step: measured, and the theory as lines."""
    figure = new_figure(figsize=(9.6, 4.4), dpi=110, layout="constrained")
    chart, rates = figure.subplots(1, 2)
    ratios, steps = np.geomspace(0.02, 1.0, 40), np.geomspace(0.02, 0.4, 20)
    curves: dict[str, Callable[[float], float]] = {s: lambda z, s=s: limit_of_theory(s, z) for s in SCHEMES[:2]}  # type: ignore[misc]
    for scheme, curve in curves.items():
        color, marker = STYLES[scheme]
        own = found.filter(scheme=scheme)
        chart.loglog(own["damping_ratio"], own["limit"], color=color, marker=marker, linestyle="none", label=scheme)
        chart.loglog(ratios, [curve(z) for z in ratios.tolist()], color=color, linewidth=1.0)
    for axis, ticks in ((chart.xaxis, RATIOS), (chart.yaxis, TICKS)):
        axis.set_ticks(ticks, [f"{tick:g}" for tick in ticks])
        axis.set_ticks([], minor=True)
    chart.set_xlabel("damping ratio of the line")
    chart.set_ylabel("largest stable H*w")
    chart.set_title("Stable below; lines: theory", loc="left")
    for scheme in SCHEMES[:2]:
        color, marker = STYLES[scheme]
        own = grown.filter(scheme=scheme)
        rates.loglog(own["step"], own["growth"], color=color, marker=marker, linestyle="none", label=scheme)
        rates.loglog(steps, [np.log(np.abs(roots(scheme, a, 0.0)).max()) / a for a in steps.tolist()], color=color,
                     linewidth=1.0)  # fmt: skip
    rates.set_xticks(STEPS, list(map(str, STEPS)))
    rates.minorticks_off()
    rates.set_xlabel("H*w")
    rates.set_ylabel("growth of the amplitude / w")
    rates.set_title("Without damping; by derivatives: none", loc="left")
    for axes in (chart, rates):
        axes.grid(which="major", alpha=0.3)
        axes.legend(frameon=False, fontsize="small")
    return figure
