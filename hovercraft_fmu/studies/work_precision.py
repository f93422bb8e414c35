"""What accuracy costs: every method with every setting over whole scenes, through the kernel that the native FMU has.

Costs are counted (`simulation/cost.py`), errors are those of the bits: two measurements give the same table.
"""

import itertools
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import polars as pl

from ..drawing.figures import new_figure
from ..drawing.palette import METHODS, QUIET
from ..host.fleet import Crafts, advance_fleet
from ..host.ramps import slopes
from ..model.dynamics import State
from ..model.integrators import ADAPTIVE, INTEGRATORS, Integrator
from ..model.subcycling import Settings, meant_step
from ..scenes import SCENES, Scene, signals
from ..simulation import Run, counted, holding, metres, plan, schedule
from .laboratory import Findings, Shown, Tell
from .reference_end import reference_path

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = Any
"""One number a setting, or a piece of the run."""
COMMUNICATION_STEPS = (0.1, 1.0, 5.0)
"""s"""
STEPS = tuple(part * 10.0**-n for n in range(3, -1, -1) for part in (1.0, 2.0, 5.0))
"""s: sub-steps."""
TOLERANCES = tuple(10.0**-n for n in range(2, 11))
"""SI units, of the adaptive method."""
FIRST_STEP = 0.01
"""s, of the adaptive method."""
EXACT = 1e-11
"""The tolerance of adaptive where its own error is to be out of sight."""
HELD_SCENES = ("slalom", "ice")
"""Their inputs change all the time, so holding them from one communication point to the next costs accuracy."""
HOLDING_STEPS = (0.01, 0.1, 0.5, 1.0)
"""s"""
HELD, MIDDLE = "held from its start on, as fmpy alone does", "the value at its middle"
"""What an FMU is given for a communication step."""
ORDER_STEPS = (0.1, 0.05, 0.025, 0.0125)
"""s: the range in which the observed orders are fitted; rk4 gets five times as long ones."""
ORDER_SCENES = ("launch", "cycloid", "turn", "crosswind", "stop", "drift_to_rest")


class Went(NamedTuple):
    """What came of a run with every setting; NaN where it was refused: the motion left the range of numbers."""

    ends: Array
    """Shape (6, settings)."""
    largest: Array
    """m, shape (settings,): how far the position was off at the end of a piece of the run; 0 without a truth."""
    substeps: Array
    quiet: Array
    """Whether the FMU would not warn."""
    way: Array
    """m: the length of the path, from end to end of the pieces."""


def go(run: Run, method: Integrator, accuracy: Sequence[float], truth: Array | None = None) -> Went:
    """All settings of a method side by side, with the inputs as they go and the steps that the native FMU makes.

    Args:
        run: its own method and sub-step do not count.
        method: of all.
        accuracy: the sub-steps [s], or the tolerances.
        truth: the states at the end of every piece of the schedule, shape (6, pieces).
    """
    given, fixed, crafts = np.array(accuracy), method.integrate is not None, Crafts.of(run.craft)
    settings = Settings(*((given, method, EXACT) if fixed else (FIRST_STEP, method, given)))
    states = np.tile(np.array(run.start)[:, None], len(given))
    largest, substeps, stability, rotation, way, proposed = np.zeros((6, len(given)))
    for n, piece in enumerate(schedule(run)):
        duration = piece.end - piece.time
        steps = [meant_step(piece.time, duration, run.start_time, h) for h in accuracy] if fixed else duration
        rates = None if piece.last is piece.first else slopes(duration, piece.first, piece.last)
        fleet = advance_fleet(states, piece.first, crafts, steps, settings, rates, proposed=proposed)
        way = way + np.hypot(*(fleet.states - states)[:2])
        states, proposed, substeps = fleet.states, fleet.proposed, substeps + fleet.substeps
        states[:, fleet.refused.numbers] = np.nan
        stability, rotation = np.maximum(stability, fleet.stability), np.maximum(rotation, fleet.rotation)
        if truth is not None:
            largest = np.maximum(largest, np.hypot(*(states[:2] - truth[:2, n, None])))
    quiet = (stability <= method.stability_limit) & (rotation <= method.rotation_limit)
    return Went(states, largest, substeps, quiet, way)


def measured(scenes: Sequence[Scene], tell: Tell) -> pl.DataFrame:
    """Every scene, method, setting and communication step: errors [m], loads a simulated second.

    No sub-step is longer than the communication step: it would be cut to it.
    """
    rows, cases = [], list(itertools.product(scenes, COMMUNICATION_STEPS))
    for done, (scene, step) in enumerate(cases, 1):
        run = plan(scene, communication_step=step)
        truth = reference_path(scene, [piece.end for piece in schedule(run)])
        for method in INTEGRATORS:
            settings = [h for h in STEPS if h <= step] if method.integrate else TOLERANCES
            went = go(run, method, settings, truth)
            end = np.hypot(*(went.ends[:2] - truth[:2, -1:]))
            for i, setting in enumerate(settings):
                rows.append({
                    "scene": scene.name, "method": method.name, "setting": setting, "communication_step": step,
                    "loads": counted(method, went.substeps[i]) / scene.stop_time, "end_error": end[i],
                    "largest_error": went.largest[i], "said": _said(end[i], went.quiet[i]),
                })  # fmt: skip
        tell(done / len(cases))
    return pl.DataFrame(rows)


def _said(error: float, quiet: bool) -> str:
    """What the FMU says of such a run."""
    return "refused" if np.isnan(error) else "nothing" if quiet else "warned"


# ---- accuracy alone: orders, tolerances, the holding of the inputs


def fitted(steps: Sequence[float] | pl.Series, errors: Sequence[float] | pl.Series) -> float:
    """1: the slope of log(error) over log(step)."""
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


def largest(end: Sequence[float] | State, exact: Sequence[float] | State) -> float:
    """The largest difference of a component, SI units."""
    return max(abs(a - b) for a, b in zip(end, exact, strict=True))


def off_at_the_end(scene: Scene, method: Integrator, accuracy: Sequence[float]) -> tuple[list[float], list[int]]:
    """For each setting the largest component of the error at the end [SI units], and the sub-steps."""
    exact = reference_path(scene, [scene.stop_time])[:, 0].tolist()
    went = go(plan(scene, communication_step=0.5), method, accuracy)
    return [largest(end, exact) for end in went.ends.T.tolist()], went.substeps.astype(int).tolist()


def observed_orders(scenes: Sequence[str] = ORDER_SCENES) -> pl.DataFrame:
    """The slope of the error at the end over the step, fitted.

    On the smooth scenes (pulses start at whole seconds), through a reversal, and to rest with friction.
    """
    rows = []
    for scene, method in itertools.product(scenes, INTEGRATORS):
        if method.integrate:
            steps = [step * (5.0 if method.order == 4 else 1.0) for step in ORDER_STEPS]
            errors, _ = off_at_the_end(SCENES[scene], method, steps)
            rows.append({"scene": scene, "method": method.name, "slope": fitted(steps, errors)})
    return pl.DataFrame(rows)


def tolerance_errors(scenes: Sequence[str] = ORDER_SCENES) -> pl.DataFrame:
    """On the scenes of the observed orders: the error of the adaptive method, and its steps."""
    rows = []
    for scene in scenes:
        found = zip(TOLERANCES, *off_at_the_end(SCENES[scene], ADAPTIVE, TOLERANCES), strict=True)
        rows += [{"scene": scene, "tolerance": a, "error": b, "substeps": c} for a, b, c in found]
    return pl.DataFrame(rows)


def holding_costs(scenes: Iterable[str] = HELD_SCENES, steps: Sequence[float] = HOLDING_STEPS) -> pl.DataFrame:
    """The position error [m] at the end of whole scenes over the communication step [s], whatever the method.

    With the adaptive one at EXACT, whose own error is far below.
    """
    rows = []
    for scene in (SCENES[name] for name in scenes):
        exact = reference_path(scene, [scene.stop_time])
        for step in steps:
            run = plan(scene, communication_step=step)
            for given, asked in ((HELD, holding(run)), (MIDDLE, _with_middles(run))):
                off = np.hypot(*(go(asked, ADAPTIVE, [EXACT]).ends - exact)[:2]).item()
                rows.append({"scene": scene.name, "given": given, "communication_step": step, "position_error": off})
    return pl.DataFrame(rows)


def _with_middles(run: Run) -> Run:
    rows = []
    for piece in schedule(run):
        middle = [0.5 * (a + b) for a, b in zip(piece.first, piece.last, strict=True)]
        rows += [(piece.time, *middle), (piece.end, *middle)]
    return replace(run, signals=signals(rows))


def _held_in_short(found: pl.DataFrame) -> pl.DataFrame:
    """A column a communication step."""
    titles = pl.format("off, at {} s", pl.col("communication_step")).alias("communication_step")
    errors = pl.col("position_error").map_elements(metres, pl.String)
    wide = found.with_columns(titles, errors).pivot("communication_step", index=["scene", "given"])
    return wide.rename({"given": "inputs in a communication step"})


def accuracy(quick: bool) -> Findings:
    """What of it is accuracy alone; quick: of two scenes."""
    scenes = ORDER_SCENES[:2] if quick else ORDER_SCENES
    orders, tolerances = observed_orders(scenes), tolerance_errors(scenes)
    held = holding_costs(HELD_SCENES[:1], HOLDING_STEPS[1:]) if quick else holding_costs()
    by_scene = tolerances.pivot("scene", index="tolerance", values="error")
    return Findings(
        {"orders": orders, "tolerances": tolerances, "holding": held},
        [
            Shown("Observed orders", orders.pivot("method", index="scene", values="slope")),
            Shown("The error of adaptive at the end falls with its tolerance", by_scene),
            Shown("How far the end of a scene is off with what its inputs do", _held_in_short(held), "holding"),
        ],
    )


# ---- the picture


FINEST, COARSEST = 1e-9, 100.0
"""m: what is drawn; below, the doubt of the reference is not far."""


def draw_work_precision(found: pl.DataFrame, held: pl.DataFrame) -> "Figure":
    """The largest error on the way against the loads: a panel a scene, at the longest communication step.

    Of settings that the FMU does not warn of; and what holding the inputs over 0.1 s costs, whatever the method.
    """
    longest = found.filter(said="nothing", communication_step=found["communication_step"].max())
    scenes = longest.partition_by("scene", maintain_order=True)
    columns = min(3, len(scenes))
    lines = -(-len(scenes) // columns)
    size = (9.6, 2.9 * lines + 0.8) if columns > 1 else (7.2, 5.4)
    figure = new_figure(figsize=size, dpi=100, layout="constrained")
    grid = figure.subplots(lines, columns, squeeze=False, sharex=True, sharey=True)
    for axes, scene in zip(grid.flat, scenes, strict=False):
        for name, (color, marker) in METHODS.items():
            own = scene.filter(pl.col("largest_error").is_between(FINEST, COARSEST), method=name)
            axes.plot(own["loads"], own["largest_error"], color=color, marker=marker, markersize=4, label=name)
        for off in held.filter(scene=scene["scene"][0], given=HELD, communication_step=0.1)["position_error"]:
            axes.axhline(off, color=QUIET, linestyle="--", linewidth=1.0)
            axes.annotate(
                "inputs held over 0.1 s", (0.97, off), (0, -3), ("axes fraction", "data"), "offset points", color=QUIET,
                ha="right", va="top", fontsize="small",
            )  # fmt: skip
        axes.set(xscale="log", yscale="log", ylim=(FINEST, COARSEST))
        axes.minorticks_off()
        axes.set_title(scene["scene"][0], loc="left")
        axes.grid(alpha=0.3)
    for axes in list(grid.flat)[len(scenes) :]:
        axes.set_axis_off()
    figure.supxlabel("loads a simulated second")
    figure.supylabel("largest position error on the way [m]")
    handles, labels = grid.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(METHODS), frameon=False)
    return figure
