"""What speed costs and what accuracy costs: work-precision, measured over the named scenes."""

import csv
import itertools
import math
import platform
import statistics
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import fmpy
import numpy as np
from fmpy import fmi2
from rich.console import Group
from rich.table import Table

from .._version import __version__
from ..fmu.interface import BY_NAME, INPUTS, VARIABLES
from ..fmu.python_package import build_fmu
from ..model.dynamics import Controls, State, windy
from ..model.subcycling import advance
from ..scenes import SCENES, Scene
from ..simulation import Run, Value, instantiated, plan, read_description, schedule
from ..view.tables import markdown
from .pictures import draw_holding, draw_work_precision
from .reference_end import reference_end
from .rows import Holding, Row, Setting

STOP_TIME = 60.0
"""s"""
COMMUNICATION_STEPS = (0.01, 0.1, 0.5)
"""s"""
EULER_STEPS = (0.0002, 0.001, 0.005, 0.02, 0.1, 0.5)
RK4_STEPS = (0.01, 0.05, 0.1, 0.25, 0.5)
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)
DEFAULT = ("semi_implicit_euler", 0.001)
ACCURACIES = (1.0, 0.01, 0.001, 1e-6)
"""m, at the end"""
ADVISED_SCENE = "turn"
HELD_SCENE = "slalom"
"""Its inputs change all the time, so holding them from one communication point to the next costs accuracy."""
HOLDING_STEPS = (0.01, 0.02, 0.05, 0.1, 0.25, 0.5, 1.0, 2.5)
"""s"""
ORDER_STEPS = (0.1, 0.05, 0.025, 0.0125)
"""s: the range in which the observed orders are fitted; rk4 gets five times as long ones."""
ORDER_SCENES = ("launch", "cycloid", "turn", "crosswind", "stop", "drift_to_rest")
REPEATS = 3

Tell = Callable[[float], None]
"""Called with the part of the work that is done, 0 to 1."""


def settings(communication_step: float) -> list[Setting]:
    """All that is measured at a communication step; a sub-step longer than it would be cut to it."""
    fixed = [
        Setting(name, step, communication_step)
        for name, steps in (
            ("semi_implicit_euler", EULER_STEPS),
            ("drag_implicit", EULER_STEPS),
            ("rk4", RK4_STEPS),
        )
        for step in steps
        if step <= communication_step
    ]
    return fixed + [Setting("adaptive", 0.01, communication_step, tolerance) for tolerance in TOLERANCES]


def measure(quick: bool, tell: Tell) -> list[Row]:
    """Run every scene with every setting, on the bare model and through the FMU, interleaved; medians."""
    scenes = [SCENES[ADVISED_SCENE]] if quick else list(SCENES.values())
    cases = [(scene, setting) for scene in scenes for h in COMMUNICATION_STEPS for setting in settings(h)]
    repeats = 1 if quick else REPEATS
    costs: dict[tuple[str, Setting], list[tuple[float, float]]] = {}
    ends: dict[tuple[str, Setting], tuple[State, int]] = {}
    references = {scene.name: reference_end(scene, STOP_TIME) for scene in scenes}
    with tempfile.TemporaryDirectory() as folder:
        path = build_fmu(Path(folder) / "Hovercraft.fmu")
        with instantiated(path, read_description(path), []) as (_, instance):
            for done, (scene, setting) in enumerate(cases * repeats, 1):
                run = planned(scene, setting)
                steps = list(schedule(run))
                bare, end, count = timed_bare(run, steps)
                costs.setdefault((scene.name, setting), []).append((bare, timed_fmu(instance, run, steps)))
                ends[scene.name, setting] = (end, count)
                tell(done / (len(cases) * repeats))
    return [
        _row(scene.name, setting, *ends[scene.name, setting], references[scene.name], costs[scene.name, setting])
        for scene, setting in cases
    ]


def _row(
    scene: str,
    setting: Setting,
    end: State,
    count: int,
    reference: tuple[State, float],
    costs: list[tuple[float, float]],
) -> Row:
    exact, uncertainty = reference
    bare, fmu = (statistics.median(values) * 1e6 / STOP_TIME for values in zip(*costs, strict=True))
    return Row(
        scene=scene,
        integrator=setting.integrator,
        step_size=setting.step_size,
        tolerance=setting.tolerance,
        communication_step=setting.communication_step,
        position_error=math.hypot(end.x - exact.x, end.y - exact.y),
        heading_error=abs(end.heading - exact.heading),
        reference_uncertainty=uncertainty,
        bare_cost=bare,
        fmu_cost=fmu,
        substeps=count,
    )


def planned(scene: Scene, setting: Setting) -> Run:
    """The run of a scene with a setting."""
    values: dict[str, Value] = {
        "integrator": setting.integrator,
        "step_size": setting.step_size,
        "tolerance": setting.tolerance,
    }
    return plan(
        scene,
        start_values=values,
        stop_time=STOP_TIME,
        communication_step=setting.communication_step,
    )


def timed_bare(run: Run, steps: Sequence[tuple[float, float, Controls]]) -> tuple[float, State, int]:
    """Seconds for the whole run on the bare model, the state at the end, and the sub-steps.

    The bare model has no communication points: it goes on for as long as the controls hold.
    """
    craft, chosen, state, proposed, count = run.craft, run.settings, run.start, 0.0, 0
    stretches = list(_while_held(steps))
    start = perf_counter()
    for duration, controls in stretches:
        state, n, _, _, proposed = advance(state, controls, craft, duration, chosen, proposed=proposed)
        count += n
    return perf_counter() - start, state, count


def _while_held(steps: Sequence[tuple[float, float, Controls]]) -> Iterator[tuple[float, Controls]]:
    """(duration [s], controls) of the communication steps in a row with the same controls, but for rounding."""
    for _, group in itertools.groupby(steps, key=lambda step: tuple(round(value, 9) for value in step[2])):
        held = list(group)
        yield held[-1][1] - held[0][0], held[0][2]


def timed_fmu(instance: Any, run: Run, steps: Sequence[tuple[float, float, Controls]]) -> float:
    """Seconds for the whole run through fmpy: three inputs, a step, nine outputs at every communication point.

    In wind, five inputs.
    """
    driven = INPUTS if any(windy(controls) for _, _, controls in steps) else INPUTS[:3]
    inputs, outputs = _references(driven), _references(v.name for v in VARIABLES if v.causality == "output")
    values = [(fmi2.fmi2Real * len(driven))(*controls[: len(driven)]) for _, _, controls in steps]
    read = (fmi2.fmi2Real * len(outputs))()
    instance.reset()
    instance.setupExperiment(startTime=run.start_time)
    for name, value in run.start_values.items():
        setter = instance.setReal if BY_NAME[name].kind == "Real" else instance.setInteger
        setter([BY_NAME[name].reference], [value])
    instance.enterInitializationMode()
    instance.exitInitializationMode()
    component = instance.component
    start = perf_counter()
    for (time, end, _), given in zip(steps, values, strict=True):
        instance.fmi2SetReal(component, inputs, len(inputs), given)
        instance.fmi2DoStep(component, time, end - time, fmi2.fmi2True)
        instance.fmi2GetReal(component, outputs, len(outputs), read)
    return perf_counter() - start


def _references(names: Iterable[str]) -> Any:
    numbers = [BY_NAME[name].reference for name in names]
    return (fmi2.fmi2ValueReference * len(numbers))(*numbers)


# ---- what follows from the rows


class Advice(NamedTuple):
    """The cheapest way to an accuracy, and what else it would cost."""

    accuracy: float
    """m"""
    row: Row
    default: Row
    euler_step: float
    """s: the coarsest sub-step of the default method that meets the accuracy, found and run"""
    euler_cost: float
    """us a simulated second, bare"""


def advise(rows: list[Row], quick: bool) -> list[Advice]:
    """For each accuracy the cheapest triple of integrator, step size and communication step on the scene `turn`."""
    own = [row for row in rows if row.scene == ADVISED_SCENE]
    default = next(r for r in own if (r.integrator, r.step_size) == DEFAULT and r.communication_step == 0.5)
    advice = []
    for accuracy in ACCURACIES:
        good = [row for row in own if row.position_error <= accuracy]
        step, cost = (math.nan, math.nan) if quick and accuracy < 1e-4 else coarsest_euler(own, accuracy)
        advice.append(Advice(accuracy, min(good, key=lambda row: row.fmu_cost), default, step, cost))
    return advice


def coarsest_euler(rows: list[Row], accuracy: float) -> tuple[float, float]:
    """Sub-step [s] and bare cost [us a simulated second]: from the first-order law, then run to see that it is met."""
    euler = [row for row in rows if row.integrator == DEFAULT[0] and row.communication_step == 0.5]
    finest = min(euler, key=lambda row: row.step_size)
    step = min(0.5, finest.step_size * accuracy / finest.position_error)
    exact, _ = reference_end(SCENES[ADVISED_SCENE], STOP_TIME)
    while True:
        step = 0.5 / math.ceil(0.5 / step)  # a whole number of them fits the communication step
        run = planned(SCENES[ADVISED_SCENE], Setting(DEFAULT[0], step, 0.5))
        seconds, end, _ = timed_bare(run, list(schedule(run)))
        if math.hypot(end.x - exact.x, end.y - exact.y) <= accuracy:
            return step, seconds * 1e6 / STOP_TIME
        step *= 0.9


DECADES = tuple(10.0**-k for k in range(10))
"""m"""


def winners(rows: list[Row]) -> list[dict[str, str]]:
    """For each scene and accuracy the method that is the cheapest on the bare model; '' where none gets there."""
    table = []
    for scene in dict.fromkeys(row.scene for row in rows):
        record = {"scene": scene}
        for accuracy in DECADES:
            good = [row for row in rows if row.scene == scene and row.position_error <= accuracy]
            best = min(good, key=lambda row: row.bare_cost).integrator if good else ""
            record[f"{accuracy:g} m"] = best
        table.append(record)
    return table


def winner_table(records: list[dict[str, str]]) -> Table:
    """As a rich table."""
    table = _table(*records[0])
    for record in records:
        table.add_row(*record.values())
    return table


class Order(NamedTuple):
    """How the error at the end falls with the step, as a fitted slope."""

    scene: str
    integrator: str
    slope: float
    errors: tuple[float, ...]


def observed_orders() -> list[Order]:
    """On the smooth scenes (pulses start at whole seconds), through a reversal, and to rest with friction."""
    orders = []
    for scene in ORDER_SCENES:
        exact, _ = reference_end(SCENES[scene], STOP_TIME)
        for name, factor in (("semi_implicit_euler", 1.0), ("drag_implicit", 1.0), ("rk4", 5.0)):
            steps = [step * factor for step in ORDER_STEPS]
            errors = [end_error(SCENES[scene], Setting(name, step, 0.5), exact) for step in steps]
            slope = float(np.polyfit(np.log(steps), np.log(errors), 1)[0])
            orders.append(Order(scene, name, slope, tuple(errors)))
    return orders


class Tolerated(NamedTuple):
    """What the adaptive method makes of a tolerance."""

    scene: str
    tolerance: float
    error: float
    """the largest component at the end, SI units"""
    substeps: int


def tolerance_errors() -> list[Tolerated]:
    """On the scenes of the observed orders: the error falls with the tolerance."""
    rows = []
    for name in ORDER_SCENES:
        exact, _ = reference_end(SCENES[name], STOP_TIME)
        for tolerance in TOLERANCES:
            run = planned(SCENES[name], Setting("adaptive", 0.01, 0.5, tolerance))
            _, end, count = timed_bare(run, list(schedule(run)))
            rows.append(Tolerated(name, tolerance, _largest(end, exact), count))
    return rows


def _largest(end: State, exact: State) -> float:
    return max(abs(a - b) for a, b in zip(end, exact, strict=True))


def end_error(scene: Scene, setting: Setting, exact: State) -> float:
    """The largest component error at the end, SI units."""
    run = planned(scene, setting)
    _, end, _ = timed_bare(run, list(schedule(run)))
    return _largest(end, exact)


def holding_costs() -> list[Holding]:
    """On the scene whose inputs change all the time, with RK4 at 0.01 s, whose own error is far below."""
    scene = SCENES[HELD_SCENE]
    exact, _ = reference_end(scene, STOP_TIME)
    costs = []
    for step in HOLDING_STEPS:
        run = planned(scene, Setting("rk4", 0.01, step))
        _, end, _ = timed_bare(run, list(schedule(run)))
        costs.append(Holding(step, math.hypot(end.x - exact.x, end.y - exact.y)))
    return costs


# ---- the study


def run(folder: Path, quick: bool = False, tell: Tell = lambda _: None) -> Group:
    """Measure, write CSV and pictures into the folder, and return what is to be printed."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = measure(quick, tell)
    advice, orders, holding = advise(rows, quick), observed_orders(), holding_costs()
    tolerances = tolerance_errors()
    _write_csv(folder / "work_precision.csv", [asdict(row) for row in rows])
    _write_csv(folder / "advice.csv", [_advice_record(each) for each in advice])
    _write_csv(folder / "winners.csv", winners(rows))
    _write_csv(folder / "orders.csv", [each._asdict() for each in orders])
    _write_csv(folder / "tolerances.csv", [each._asdict() for each in tolerances])
    _write_csv(folder / "holding.csv", [each._asdict() for each in holding])
    (folder / "advice.md").write_text(_advice_markdown(advice) + "\n", encoding="utf-8")
    (folder / "machine.txt").write_text(machine() + "\n", encoding="utf-8")
    draw_work_precision(rows, folder / "work_precision.png")
    draw_holding(holding, folder / "holding.png")
    return Group(
        f"The cheapest way to an accuracy at the end of {STOP_TIME:g} s, scene {ADVISED_SCENE}", advice_table(advice),
        "\nThe cheapest method (bare) for a position error after 60 s", winner_table(winners(rows)),
        "\nObserved orders: the slope of the error at the end over the step", order_table(orders),
        "\nThe error of adaptive at the end falls with its tolerance", tolerance_table(tolerances),
        f"\nHolding the inputs of {HELD_SCENE} from one communication point to the next", holding_table(holding),
        f"\n{machine()}", f"\nwrote {folder}/",
    )  # fmt: skip


def machine() -> str:
    """What it was measured on."""
    return (
        f"hovercraft-fmu {__version__}, Python {platform.python_version()}, numpy {np.__version__}, "
        f"fmpy {fmpy.__version__}, {platform.system()} {platform.machine()}"
    )


def _write_csv(path: Path, records: list[dict[str, Any]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, records[0])
        writer.writeheader()
        writer.writerows(records)


def _advice_record(each: Advice) -> dict[str, Any]:
    return {
        "accuracy_m": each.accuracy,
        **asdict(each.row),
        "default_over_this_bare": each.default.bare_cost / each.row.bare_cost,
        "default_over_this_fmu": each.default.fmu_cost / each.row.fmu_cost,
        "euler_step": each.euler_step,
        "euler_over_this_bare": each.euler_cost / each.row.bare_cost,
    }


ADVICE_TITLES = (
    "accuracy", "integrator", "communication step", "error", "through fmpy [us/s]", "bare [us/s]",
    "cheaper than the default: through fmpy", "bare", "coarsest Euler", "cheaper than that, bare",
)  # fmt: skip


def _advice_cells(each: Advice) -> tuple[str, ...]:
    row, default = each.row, each.default
    known = not math.isnan(each.euler_step)
    return (
        f"{each.accuracy:g} m",
        row.setting.label,
        f"{row.communication_step:g} s",
        f"{row.position_error:.1e} m",
        f"{row.fmu_cost:.0f}",
        f"{row.bare_cost:.1f}",
        f"{default.fmu_cost / row.fmu_cost:.0f} x",
        f"{default.bare_cost / row.bare_cost:.0f} x",
        f"{each.euler_step:.2g} s" if known else "not run",
        f"{each.euler_cost / row.bare_cost:.2g} x" if known else "not run",
    )


def _advice_markdown(advice: list[Advice]) -> str:
    return markdown(ADVICE_TITLES, [_advice_cells(each) for each in advice])


def advice_table(advice: list[Advice]) -> Table:
    """As a rich table."""
    table = _table(*ADVICE_TITLES)
    for each in advice:
        table.add_row(*_advice_cells(each))
    return table


def order_table(orders: list[Order]) -> Table:
    """A row a scene, a column a method."""
    names = list(dict.fromkeys(each.integrator for each in orders))
    table = _table("scene", *names)
    for scene, group in itertools.groupby(orders, key=lambda each: each.scene):
        table.add_row(scene, *(f"{each.slope:.2f}" for each in group))
    return table


def tolerance_table(rows: list[Tolerated]) -> Table:
    """One row a tolerance, one column a scene."""
    table = _table("tolerance", *ORDER_SCENES)
    for tolerance in TOLERANCES:
        errors = {row.scene: row.error for row in rows if row.tolerance == tolerance}
        table.add_row(f"{tolerance:g}", *(f"{errors[name]:.1e}" for name in ORDER_SCENES))
    return table


def holding_table(holding: list[Holding]) -> Table:
    """A row a communication step."""
    table = _table("communication step", "position error")
    for each in holding:
        table.add_row(f"{each.communication_step:g} s", f"{each.position_error:.1e} m")
    return table


def _table(*titles: str) -> Table:
    table = Table(box=None, pad_edge=False)
    for title in titles:
        table.add_column(title)
    return table
