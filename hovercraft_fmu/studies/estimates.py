"""What the FMU says of its own error, beside its error: random craft and controls, sampled before anything was fitted.

The exact solution is the adaptive method's at REFERENCE, which shares no steps with what it judges (a test holds it
against scipy's solver); where its own doubt, the difference from a tenth of that, is above a tenth of an error, the run
says nothing of it.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import polars as pl

from ..drawing.figures import new_figure
from ..drawing.palette import INK, METHODS
from ..fmu.native_package import build_native_fmu
from ..host.fleet import Crafts, Fleet, advance_fleet
from ..model.dynamics import Controls, State
from ..model.error_estimate import TIGHTER, Companion, estimated_error, is_lost, watched
from ..model.integrators import ADAPTIVE, INTEGRATORS, Integrator
from ..model.subcycling import Settings
from ..scenes import SCENES
from ..simulation import advise, metres
from ..whole import temporary_folder
from .laboratory import Findings, Shown, Tell

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = Any
"""One number a run, shape (runs,)."""
FITTED, REPORTED = 1, 2
"""Seeds: the constants of model/error_estimate.py were chosen on the one, the tables are of the other."""
RUNS, SEGMENTS = 1000, 24
"""Of a method and a kind; communication steps of a run."""
REFERENCE = 1e-10
"""Tolerance."""
KINDS = ("smooth", "every term, rubbing")
SAMPLING = f"""\
Sampled, evenly over powers of ten: mass 30 to 1000 kg, length 3 to 30 m, thrust 1 to 100 N, density 0.002 to 2 kg/m3,
friction 1e-4 to 0.05, horizons 10 s to 10 min, sub-steps 0.005 to 5 s (adaptive: tolerances 1e-8 to 1e-3);
{SEGMENTS} communication steps, each with thrust and thrusters on or off; seed {REPORTED} (chosen on {FITTED}).
Quiet: the FMU would not warn. Judged: quiet, off by more than 1e-9 m and by less than a tenth of the way. Missed:
quiet, off by more than 1 % of the way and by more than ten times the estimate."""


class Runs(NamedTuple):
    """To be made by one method."""

    crafts: Crafts
    start: State
    duration: Array
    """s, of a communication step"""
    controls: Sequence[Controls]
    """Of each communication step."""
    h: Array
    """s, or the tolerance of the adaptive method"""


def sampled(seed: int, count: int, method: Integrator, kind: str) -> Runs:
    """Random craft, controls and steps."""
    rng = np.random.default_rng([seed, INTEGRATORS.index(method), KINDS.index(kind)])

    def spread(low: float, high: float) -> Array:
        return 10.0 ** rng.uniform(np.log10(low), np.log10(high), count)

    mass, length, thrust = spread(30.0, 1000.0), spread(3.0, 30.0), spread(1.0, 100.0)
    parameters = {
        "mass": mass, "length": length, "width": length * rng.uniform(0.3, 0.9, count),
        "height": length * rng.uniform(0.1, 0.4, count), "inertia": mass * length**2 * rng.uniform(0.01, 0.1, count),
        "drag_coefficient": rng.uniform(0.5, 2.0, count), "air_density": spread(0.002, 2.0),
        "drag_center_fraction": rng.uniform(-0.4, 0.0, count), "thrust_max": thrust,
        "steering_force": thrust * rng.uniform(0.02, 0.2, count),
    }  # fmt: skip
    if kind != KINDS[0]:
        parameters |= {"skirt_friction": spread(1e-4, 0.05), "drag_area": rng.integers(1, 3, count)}
        parameters |= {"rotational_drag": rng.uniform(0.0, 1.0, count)}
    speeds: list[Any] = [rng.uniform(-most, most, count) for most in (3.0, 3.0, 0.3)]
    start = State(0.0, 0.0, 0.0, *speeds)
    horizon, h = spread(10.0, 600.0), spread(0.005, 5.0)
    if method is ADAPTIVE:
        return Runs(Crafts(**parameters), start, horizon / SEGMENTS, list(_pulses(rng, thrust)), spread(1e-8, 1e-3))
    h = np.minimum(h, horizon / SEGMENTS)
    whole = np.round(horizon / SEGMENTS / h)
    return Runs(Crafts(**parameters), start, whole * h, list(_pulses(rng, thrust)), h)


def _pulses(rng: np.random.Generator, thrust: Array) -> Iterator[Controls]:
    for _ in range(SEGMENTS):
        on: list[Any] = [(rng.random(len(thrust)) < share).astype(float) for share in (0.6, 0.25, 0.25)]
        yield Controls(on[0] * thrust, on[1], on[2])


def judged(runs: Runs, method: Integrator) -> pl.DataFrame:
    """A row a run: error, estimate and the reference's doubt at the end, the way [m]; whether the FMU is quiet."""
    fixed = method is not ADAPTIVE
    settings = Settings(runs.h if fixed else 0.1, method, 1e-6 if fixed else runs.h)
    half = settings._replace(step_size=0.5 * runs.h) if fixed else settings._replace(tolerance=runs.h / TIGHTER)
    craft, beside = Lane(runs, settings), Lane(runs, half, 1 if fixed else 2)
    exact, near = (Lane(runs, Settings(0.01, ADAPTIVE, part * REFERENCE)) for part in (0.1, 1.0))
    estimate, quiet = np.zeros(len(runs.h)), np.ones(len(runs.h), bool)
    crafts, companions = [runs.crafts.one(i) for i in range(len(runs.h))], [Companion(State())] * len(runs.h)
    for controls in runs.controls:
        before = craft.states
        for lane in (craft, beside, exact, near):
            lane.go(controls)
        for i, one in enumerate(crafts):
            was, state, other = (State(*each[:, i].tolist()) for each in (before, craft.states, beside.states))
            companion = companions[i] = watched(companions[i]._replace(state=other), was, state, one)
            estimate[i] = told = estimated_error(state, companion, one, method)[0]
            h, count = float(runs.h[i]) if fixed else 0.0, int(craft.substeps[i])
            quiet[i] &= not is_lost(told, state, companion, one, h, count)
        quiet &= (craft.stability <= method.stability_limit) & (craft.rotation <= method.rotation_limit)
    error, doubt = (np.hypot(*(exact.states - each.states)[:2]) for each in (craft, near))
    found = {"error": error, "estimate": estimate, "doubt": doubt, "way": [each.way for each in companions]}
    found |= {"quiet": quiet & np.isfinite(error), "x": exact.states[0], "y": exact.states[1]}
    return pl.DataFrame(found)


class Lane:
    """Craft that go along; one that left the range of numbers is NaN."""

    def __init__(self, runs: Runs, settings: Any, parts: int = 1) -> None:
        self._runs, self._settings, self._parts = runs, settings, parts
        self.states: Array = np.array(np.broadcast_arrays(*runs.start, runs.h)[:6], float)
        self.stability, self.rotation, self.substeps, self._proposed = np.zeros((4, len(runs.h)))

    def go(self, controls: Controls) -> None:
        """A communication step further."""
        runs, step = self._runs, self._runs.duration / self._parts
        for _ in range(self._parts):
            made: Fleet = advance_fleet(
                self.states, controls, runs.crafts, step, self._settings, proposed=self._proposed
            )
            self.states, self._proposed = made.states, made.proposed
            self.states[:, made.refused.numbers] = np.nan
            self.substeps = self.substeps + made.substeps
            self.stability, self.rotation = (
                np.maximum(a, b) for a, b in ((self.stability, made.stability), (self.rotation, made.rotation))
            )


ERROR, WAY, RATIO = pl.col("error"), pl.col("way"), pl.col("estimate") / pl.col("error")
QUIET = pl.col("quiet")
JUDGED = QUIET & (ERROR > 1e-9) & (ERROR < 0.1 * WAY) & (pl.col("doubt") < 0.1 * ERROR)
MISSED = QUIET & (ERROR > 0.01 * WAY) & (RATIO < 0.1)


def shares(found: pl.DataFrame) -> pl.DataFrame:
    """A row a kind and method: how many, and the distribution of estimate / error."""
    own = RATIO.filter(JUDGED)
    return found.group_by("kind", "method", maintain_order=True).agg(
        runs=pl.len(), quiet=QUIET.sum(), judged=JUDGED.sum(), low=own.quantile(0.025), median=own.median(),
        high=own.quantile(0.975), within_factor_2=own.is_between(0.5, 2.0).mean(), missed=MISSED.sum(),
    )  # fmt: skip


def advised(scenes: Sequence[str]) -> pl.DataFrame:
    """What `advise` says of scenes, and how far that is off a reference run [m]."""
    rows = []
    with temporary_folder() as folder:
        fmu = build_native_fmu(Path(folder) / "Native.fmu")
        for scene in scenes:
            advice = advise(scene, fmu)
            best, other = advice.best, advice.runner_up or advice.best
            rows.append((scene, best.words, best.loads, metres(best.told), metres(best.true), other.words, other.loads))
    names = ("scene", "advised", "loads", "off, as told", "off", "runner-up", "its loads")
    return pl.DataFrame(rows, names, orient="row")


def measure(quick: bool, tell: Tell) -> Findings:
    """Every method, smooth and rubbing, and what is advised for every scene; quick: fewer runs, two scenes."""
    frames, pairs = [], [(kind, method) for kind in KINDS for method in INTEGRATORS]
    for done, (kind, method) in enumerate(pairs, 1):
        found = judged(sampled(REPORTED, 60 if quick else RUNS, method, kind), method)
        frames.append(found.with_columns(pl.lit(kind).alias("kind"), pl.lit(method.name).alias("method")))
        tell(0.7 * done / len(pairs))
    found, advice = pl.concat(frames), advised(list(SCENES)[3:5] if quick else list(SCENES))
    table = shares(found)
    tables = [
        Shown("The estimate over the error at the end of random runs", table, "error_estimate"),
        Shown("What is advised for an error of 1 cm", advice, "advised"),
    ]
    records = {"error_estimate": table, "advised": advice}
    return Findings(records, tables, {"error_estimate": draw(found)}, [SAMPLING])


def draw(found: pl.DataFrame) -> "Figure":
    """The estimate against the error, run by run; quiet ones full, the others faint."""
    figure = new_figure(figsize=(10.0, 4.6), dpi=75, layout="constrained")
    ends = np.array([1e-12, 1e4])
    for axes, kind in zip(figure.subplots(1, 2, sharey=True), KINDS, strict=True):
        for (name, quiet), own in found.filter(kind=kind).group_by("method", "quiet", maintain_order=True):
            style = METHODS[str(name)]
            axes.plot(own["error"], np.maximum(own["estimate"], 1e-13), ".", color=style.color, markersize=2.5,
                      alpha=0.7 if quiet else 0.15)  # fmt: skip
        for factor in (0.5, 1.0, 2.0):
            axes.plot(ends, factor * ends, color=INK, linewidth=0.8 if factor == 1.0 else 0.4)
        for name in METHODS:
            axes.plot([], [], ".", color=METHODS[name].color, label=name)
        axes.set(xscale="log", yscale="log", xlim=ends, ylim=ends, xlabel="off at the end [m]", ylabel="estimate [m]")
        axes.set_title(f"{kind}; lines: half, once, twice", loc="left", fontsize="small")
    axes.legend(frameon=False, markerscale=3.0, fontsize="small")
    return figure
