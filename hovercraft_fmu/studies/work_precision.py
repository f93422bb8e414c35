"""What speed costs and what accuracy costs: work-precision, measured over the named scenes."""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np
import polars as pl

from ..drawing.figures import new_figure
from ..drawing.palette import METHODS
from ..fmu.interface import INPUTS, OUTPUTS, STATES
from ..host import Instance
from ..model.dynamics import Controls, State
from ..model.subcycling import advance, meant_step
from ..scenes import SCENES, Scene
from ..simulation import Run, held_steps, holding, method_in_words, metres, plan, schedule
from .laboratory import Findings, Ready, Shown, Tell, interleaved, spread
from .reference_end import reference_end

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STOP_TIME = 60.0
"""s"""
COMMUNICATION_STEPS = (0.01, 0.1, 0.5)
"""s"""
EULER_STEPS = (0.0002, 0.001, 0.005, 0.02, 0.1, 0.5)
RK4_STEPS = (0.01, 0.05, 0.1, 0.25, 0.5)
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
EULER = "semi_implicit_euler"
ACCURACIES = (1.0, 0.01, 0.001, 1e-6)
"""m, at the end"""
ADVISED_SCENE = "turn"
HELD_SCENES = ("slalom", "ice")
"""Their inputs change all the time, so holding them from one communication point to the next costs accuracy."""
HOLDING_STEPS = (0.01, 0.1, 0.5, 1.0)
"""s"""
HELD, MIDDLE = "held from its start on, as fmpy alone does", "the value at its middle"
"""What an FMU is given for a communication step."""
ORDER_STEPS = (0.1, 0.05, 0.025, 0.0125)
"""s: the range in which the observed orders are fitted; rk4 gets five times as long ones."""
ORDER_SCENES = ("launch", "cycloid", "turn", "crosswind", "stop", "drift_to_rest")
ROUNDS = 3

Points: TypeAlias = Sequence[tuple[float, float, Controls]]
"""(start, end) [s] of every communication step, and the controls that hold in it."""


class Setting(NamedTuple):
    """What a user chooses."""

    integrator: str
    step_size: float
    """s; of the adaptive method the first step"""
    communication_step: float
    """s"""
    tolerance: float = 1e-6

    @property
    def label(self) -> str:
        """The method and what drives its accuracy."""
        return method_in_words(self.integrator, self.step_size, self.tolerance)


class Reached(NamedTuple):
    """What a run came to."""

    end: State
    substeps: int


def settings(communication_step: float) -> list[Setting]:
    """All that is measured at a communication step; a sub-step longer than it would be cut to it."""
    steps_of = {EULER: EULER_STEPS, "drag_implicit": EULER_STEPS, "rk4": RK4_STEPS}
    fixed = [
        Setting(name, step, communication_step)
        for name, steps in steps_of.items()
        for step in steps
        if step <= communication_step
    ]
    return fixed + [Setting("adaptive", 0.01, communication_step, tolerance) for tolerance in TOLERANCES]


def planned(scene: Scene, setting: Setting) -> Run:
    """The run of a scene with a setting."""
    values = {name: getattr(setting, name) for name in ("integrator", "step_size", "tolerance")}
    return plan(scene, start_values=values, stop_time=STOP_TIME, communication_step=setting.communication_step)


def bare(run: Run, points: Points) -> Ready[Reached]:
    """The whole run on the bare model.

    It has no communication points: it goes on for as long as the controls hold, but for rounding.
    """
    stretches = []
    craft, chosen = run.craft, run.settings
    for _, group in itertools.groupby(points, key=lambda point: tuple(round(value, 9) for value in point[2])):
        held = list(group)
        step = meant_step(held[0][0], held[-1][1] - held[0][0], run.start_time, chosen.step_size)
        stretches.append((step, held[0][2]))

    def go() -> Reached:
        state, proposed, count = run.start, 0.0, 0
        for duration, controls in stretches:
            state, n, _, _, proposed = advance(state, controls, craft, duration, chosen, proposed=proposed)
            count += n
        return Reached(state, count)

    return lambda: go


def through(instance: Instance, run: Run, points: Points) -> Ready[Reached]:
    """The whole run through fmpy: three inputs (or all), a step, the outputs at every communication point."""
    driven = INPUTS if any(any(controls[3:]) for _, _, controls in points) else INPUTS[:3]
    inputs, outputs, states = instance.port(*driven), instance.port(*OUTPUTS), instance.port(*STATES)
    steps = [(time, end - time, controls[: len(driven)]) for time, end, controls in points]

    def go() -> Reached:
        for time, duration, values in steps:
            inputs.set(values)
            instance.step(time, duration)
            outputs.get()
        return Reached(State(*states.get()), 0)

    def ready() -> Callable[[], Reached]:
        instance.reset()
        instance.start(run.start_values, run.start_time)
        return go

    return ready


def measured(instance: Instance, scenes: Sequence[Scene], rounds: int, tell: Tell) -> Findings:
    """Every scene with every setting, on the bare model and through the FMU.

    Errors at the end [m, rad, SI units]; costs in us a simulated second, their spread as `Timed.spread` has it.
    """
    cases: dict[tuple[str, Setting, str], Ready[Reached]] = {}
    for scene, step in itertools.product(scenes, COMMUNICATION_STEPS):
        points = list(held_steps(planned(scene, settings(step)[0])))
        for setting in settings(step):
            run = planned(scene, setting)
            cases[scene.name, setting, "bare"] = bare(run, points)
            cases[scene.name, setting, "fmu"] = through(instance, run, points)
    exact = {scene.name: reference_end(scene, STOP_TIME) for scene in scenes}
    timed = interleaved(cases, rounds, tell)
    rows = []
    for (scene_name, setting, way), own in timed.items():
        if way == "bare":
            exact_end, uncertainty = exact[scene_name]
            end, other = own.found.end, timed[scene_name, setting, "fmu"]
            rows.append({
                "scene": scene_name, **setting._asdict(), "position_error": math.dist(end[:2], exact_end[:2]),
                "heading_error": abs(end.heading - exact_end.heading), "reference_uncertainty": uncertainty,
                "bare_cost": own.least * 1e6 / STOP_TIME, "fmu_cost": other.least * 1e6 / STOP_TIME,
                "substeps": own.found.substeps, "spread": max(own.spread, other.spread),
            })  # fmt: skip
    found = pl.DataFrame(rows)
    return Findings(
        {"work_precision": found}, [], {"work_precision": draw_work_precision(found)}, [spread(timed.values())]
    )


# ---- what follows from the rows


ADVICE = {
    "accuracy_m": "accuracy [m]", "integrator": "integrator", "communication_step": "communication step [s]",
    "position_error": "error [m]", "fmu_cost": "through fmpy [us/s]", "bare_cost": "bare [us/s]",
    "default_over_this_fmu": "times cheaper than the default: through fmpy", "default_over_this_bare": "bare",
    "euler_step": "coarsest Euler [s]", "euler_over_this_bare": "times cheaper than that, bare",
}  # fmt: skip
"""Column -> title."""


def advice(found: pl.DataFrame) -> Findings:
    """For each accuracy the cheapest triple of integrator, step size and communication step on the scene `turn`.

    Beside the default at the longest communication step, and the coarsest sub-step of its method that meets the
    accuracy: from its finest one, by the law of first order.
    """
    own = found.filter(scene=ADVISED_SCENE).sort("fmu_cost")
    euler_rows = own.filter(integrator=EULER, communication_step=0.5).sort("step_size")
    finest, default = (euler_rows.row(i, named=True) for i in map(EULER_STEPS.index, (0.0002, 0.001)))
    records = []
    for accuracy in ACCURACIES:
        row = own.filter(pl.col("position_error") <= accuracy).row(0, named=True)
        ratios = {f"default_over_this_{way}": default[f"{way}_cost"] / row[f"{way}_cost"] for way in ("bare", "fmu")}
        step = min(0.5, finest["step_size"] * accuracy / finest["position_error"])
        cost = finest["bare_cost"] * finest["step_size"] / step
        euler = {"euler_step": step, "euler_over_this_bare": cost / row["bare_cost"]}
        records.append({"accuracy_m": accuracy, **row, **ratios, **euler})
    found = pl.DataFrame(records)
    labels = [method_in_words(row["integrator"], row["step_size"], row["tolerance"]) for row in records]
    shown = found.with_columns(integrator=pl.Series(labels)).select(**{title: name for name, title in ADVICE.items()})
    title = f"The cheapest way to an accuracy at the end of {STOP_TIME:g} s, scene {ADVISED_SCENE}"
    return Findings({"advice": found}, [Shown(title, shown, "advice")])


def reached(scene: Scene, setting: Setting) -> Reached:
    """Where the bare model ends."""
    run = planned(scene, setting)
    return bare(run, list(held_steps(run)))()()


def largest(end: State, exact: State) -> float:
    """The largest difference of a component, SI units."""
    return max(abs(a - b) for a, b in zip(end, exact, strict=True))


def _exact(scenes: Sequence[str]) -> dict[str, State]:
    return {scene: reference_end(SCENES[scene], STOP_TIME)[0] for scene in scenes}


def observed_orders(scenes: Sequence[str] = ORDER_SCENES) -> pl.DataFrame:
    """The slope of the error at the end over the step, fitted.

    On the smooth scenes (pulses start at whole seconds), through a reversal, and to rest with friction.
    """
    rows, exact = [], _exact(scenes)
    for scene, (name, factor) in itertools.product(scenes, ((EULER, 1.0), ("drag_implicit", 1.0), ("rk4", 5.0))):
        steps = [step * factor for step in ORDER_STEPS]
        errors = [largest(reached(SCENES[scene], Setting(name, step, 0.5)).end, exact[scene]) for step in steps]
        rows.append({"scene": scene, "integrator": name, "slope": fitted(steps, errors)})
    return pl.DataFrame(rows)


def fitted(steps: Sequence[float] | pl.Series, errors: Sequence[float] | pl.Series) -> float:
    """1: the slope of log(error) over log(step)."""
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


def tolerance_errors(scenes: Sequence[str] = ORDER_SCENES) -> pl.DataFrame:
    """On the scenes of the observed orders: the largest component of the error at the end [SI units] of adaptive."""
    rows, exact = [], _exact(scenes)
    for scene, tolerance in itertools.product(scenes, TOLERANCES):
        end, count = reached(SCENES[scene], Setting("adaptive", 0.01, 0.5, tolerance))
        rows.append({"scene": scene, "tolerance": tolerance, "error": largest(end, exact[scene]), "substeps": count})
    return pl.DataFrame(rows)


def holding_costs(scenes: Sequence[str] = HELD_SCENES) -> pl.DataFrame:
    """The position error [m] at the end of whole scenes over the communication step [s].

    With RK4 at 0.02 s, whose own error is far below.
    """
    rows = []
    for scene in (SCENES[name] for name in scenes):
        exact, _ = reference_end(scene, scene.stop_time)
        for step in HOLDING_STEPS:
            run = plan(scene, start_values={"integrator": "rk4", "step_size": 0.02}, communication_step=step)
            for given, points in ((HELD, list(held_steps(holding(run)))), (MIDDLE, list(_middles(run)))):
                error = math.dist(bare(run, points)()().end[:2], exact[:2])
                rows.append({"scene": scene.name, "given": given, "communication_step": step, "position_error": error})
    return pl.DataFrame(rows)


def _middles(run: Run) -> Iterator[tuple[float, float, Controls]]:
    for piece in schedule(run):
        yield piece.time, piece.end, Controls(*(0.5 * (a + b) for a, b in zip(piece.first, piece.last, strict=True)))


def _held_in_short(found: pl.DataFrame) -> pl.DataFrame:
    """A column a communication step."""
    titles = pl.format("off, at {} s", pl.col("communication_step")).alias("communication_step")
    errors = pl.col("position_error").map_elements(metres, pl.String)
    wide = found.with_columns(titles, errors).pivot("communication_step", index=["scene", "given"])
    return wide.rename({"given": "inputs in a communication step"})


def accuracy(quick: bool) -> Findings:
    """What of it is accuracy alone: orders, tolerances, the holding of the inputs; quick: of two scenes."""
    scenes = ORDER_SCENES[:2] if quick else ORDER_SCENES
    orders, tolerances = observed_orders(scenes), tolerance_errors(scenes)
    held = holding_costs(HELD_SCENES[:1] if quick else HELD_SCENES)
    by_scene = tolerances.pivot("scene", index="tolerance", values="error")
    return Findings(
        {"orders": orders, "tolerances": tolerances, "holding": held},
        [
            Shown("Observed orders", orders.pivot("integrator", index="scene", values="slope")),
            Shown("The error of adaptive at the end falls with its tolerance", by_scene),
            Shown("How far the end of a scene is off with what its inputs do", _held_in_short(held), "holding"),
        ],
    )


# ---- pictures


def draw_work_precision(found: pl.DataFrame) -> "Figure":
    """Position error against cost: a panel a scene, at the longest communication step; bare and through fmpy."""
    longest = found.filter(communication_step=found["communication_step"].max())
    scenes = longest.partition_by("scene", maintain_order=True)
    columns = min(3, len(scenes))
    lines = -(-len(scenes) // columns)
    figure = new_figure(figsize=(max(3.6 * columns, 7.2) + 0.6, 3.4 * lines + 0.9), dpi=110, layout="constrained")
    grid = figure.subplots(lines, columns, squeeze=False)
    for axes, scene in zip(grid.flat, scenes, strict=False):
        for (name, (color, marker)), (way, line) in itertools.product(METHODS.items(), (("bare", "-"), ("fmu", ":"))):
            own = scene.filter(integrator=name)
            axes.loglog(
                own[f"{way}_cost"], np.maximum(own["position_error"], 1e-13), color=color, marker=marker, markersize=4,
                linestyle=line, markerfacecolor=color if way == "bare" else "white", label=name,
            )  # fmt: skip
        axes.set_title(scene["scene"][0])
        axes.grid(which="major", alpha=0.3)
    for axes in list(grid.flat)[len(scenes) :]:
        axes.set_axis_off()
    figure.supxlabel("cost [us a simulated second]; solid: bare model, dotted: through fmpy")
    figure.supylabel(f"position error after {STOP_TIME:g} s [m]")
    handles, labels = grid.flat[0].get_legend_handles_labels()
    figure.legend(handles[::2], labels[::2], loc="outside upper center", ncols=len(METHODS), frameon=False)
    return figure
