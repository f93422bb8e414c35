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
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
import polars as pl
from numpy.typing import NDArray

from ..coupling import GAUSS_SEIDEL, JACOBI
from ..drawing.figures import new_figure
from ..drawing.palette import INK, OTHER, SEA
from ..host.fleet import Crafts, advance_fleet
from ..model.dynamics import State
from ..model.integrators import integrator
from ..model.subcycling import Settings
from ..tether.line import Line, pull
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
LARGE = 1e6
"""Times that: up to there growth is fitted."""
COUNT = 300
"""Communication steps."""
HALVINGS = 12


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
    late, middle = chosen.scheme == JACOBI, chosen.scheme == WITH_DERIVATIVES
    settings, steps, before = Settings(cast(Any, np.tile(h, 2)), integrator(3)), np.tile(h, 2), np.zeros(n)
    found = np.empty((count, n))
    for k in range(count):
        stretch, speed = states[0, :n] - states[0, n:] - 10.0 - mean, states[3, :n] - states[3, n:]
        found[k] = np.hypot(stretch, speed / chosen.omega)
        told = np.array([
            pull(State(*first), State(*second), line).tension
            for first, second, line in zip(states[:, :n].T.tolist(), states[:, n:].T.tolist(), lines, strict=True)
        ])  # fmt: skip
        # what the derivatives tell of the middle: the force goes on with the stretch, and with what it does itself
        ahead = told + 0.5 * h * chosen.stiffness * speed
        change = 1.0 + (h * h * chosen.stiffness / 8.0 + 0.5 * h * damping) / chosen.reduced
        tension = np.where(middle, PULL + (ahead - PULL) / change, np.where(late & (k > 0), before, told))
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


def growth(chosen: Cases, a: Array) -> Array:
    """1: of the amplitude, in units of w a second, fitted over the run."""
    rates = []
    for step, size in zip(a.tolist(), amplitudes(chosen, a, 2 * COUNT).T, strict=True):
        taut = size < LARGE * SMALL  # then the line is, too
        rates.append(np.polyfit(step * np.flatnonzero(taut), np.log(size[taut]), 1)[0])
    return np.array(rates)


def measure(quick: bool, tell: Tell) -> Findings:
    """Limits over damping, stiffness and mass ratio; growth without damping; quick: one line, fewer ratios."""
    chosen = cases(DAMPING[1::2] if quick else DAMPING, LINES[1:2] if quick else LINES, SCHEMES[:2])
    limit = limits(chosen, tell)
    theory = [limit_of_theory(s, z) for s, z in zip(chosen.scheme.tolist(), chosen.damping.tolist(), strict=True)]
    ratio = chosen.first / chosen.second
    found = pl.DataFrame({"scheme": chosen.scheme.tolist(), "damping_ratio": chosen.damping, "limit": limit,
                          "stiffness": chosen.stiffness, "mass_ratio": ratio, "theory": theory})  # fmt: skip
    steps = [(s, a) for s in SCHEMES for a in STEPS]
    free = cases((0.0,), LINES[:1], [s for s, _ in steps])
    a = np.array([step for _, step in steps])
    rates = growth(free, a)
    expected = [float(np.log(np.abs(roots(s, step, 0.0)).max()) / step) for s, step in steps]
    grown = pl.DataFrame({"scheme": [s for s, _ in steps], "step": a, "growth": rates, "theory": expected,
                          "energy": 2.0 * rates})  # fmt: skip
    off = float((found["limit"] / found["theory"] - 1.0).abs().max())  # type: ignore[arg-type]
    wide = found.group_by("scheme", "damping_ratio").agg(
        pl.col("limit").min().alias("least"), pl.col("limit").max().alias("largest"), pl.col("theory").first()
    )
    return Findings(
        {"tow_limits": found, "tow_growth": grown},
        [
            Shown(
                "A tow: the largest stable H*w, over all stiffnesses and mass ratios",
                wide.sort("scheme", "damping_ratio"),
            ),
            Shown("A line without damping: growth of the amplitude, and of the energy, in w a second", grown),
        ],
        {"tow": draw(found, grown)},
        [f"limits of a tow: {off:.1%} from the theory at most, whatever stiffness and masses are"],
    )


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
