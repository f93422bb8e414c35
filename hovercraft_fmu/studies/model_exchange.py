"""What somebody else's solver costs: fmpy's CVode on the native FMU in model exchange, beside the FMU's own methods."""

import csv
import itertools
import math
import statistics
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from fmpy import fmi2
from rich.console import Group
from rich.table import Table
from rich.text import Text

from ..fmu.description import NATIVE
from ..fmu.interface import BY_NAME, INPUTS, STATES, VARIABLES
from ..fmu.machine_code import library
from ..fmu.native_package import build_native_fmu
from ..host import SimulationError
from ..model.dynamics import Controls, State
from ..scenes import SCENES, Row, Scene
from ..simulation import instantiated, plan, read_description
from .reference_end import reference_end
from .rows import Setting
from .trade import ADVISED_SCENE, REPEATS, STOP_TIME, settings

COMMUNICATION_STEP = 0.5
"""s: how often inputs are set and outputs are read; where the inputs of a scene bend or jump, too."""
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
"""Relative; the absolute ones are these times the nominals of the states, as fmpy has it."""
ACCURACIES = (0.01, 1e-4, 1e-6)
"""m, at the end"""
SMOOTH = tuple(scene for scene in SCENES.values() if not scene.craft.rubs)
EVALUATIONS = {"semi_implicit_euler": 1, "drag_implicit": 1, "rk4": 4, "adaptive": 6}
"""Of the loads, in a sub-step."""
MOST_STEPS = 100_000
"""Of CVode's own, from one reading of the outputs to the next."""
OUTPUTS = tuple(variable.name for variable in VARIABLES if variable.causality == "output")


class Run(NamedTuple):
    """One scene with one setting of one solver."""

    scene: str
    solver: str
    step_size: float
    """s; of CVode none"""
    tolerance: float
    """of CVode and the adaptive method"""
    position_error: float
    """m, at the end"""
    error: float
    """the largest component at the end, SI units"""
    cost: float
    """us a simulated second, through fmpy"""
    evaluations: float
    """of the loads, a simulated second; of the adaptive method those of accepted steps"""

    @property
    def label(self) -> str:
        """The solver and what drives its accuracy."""
        if self.solver == "CVode":
            return f"CVode, tolerance {self.tolerance:g}"
        return Setting(self.solver, self.step_size, COMMUNICATION_STEP, self.tolerance).label


class Stretch(NamedTuple):
    """Controls that change linearly."""

    begin: float
    """s"""
    end: float
    """s"""
    start: Controls
    rates: Controls
    """1/s"""

    def at(self, time: float) -> Controls:
        """The controls at a time [s]."""
        passed = time - self.begin
        return Controls(*(value + passed * rate for value, rate in zip(self.start, self.rates, strict=True)))

    def points(self) -> Iterator[float]:
        """s: where the outputs are read."""
        first = math.floor(self.begin / COMMUNICATION_STEP) + 1
        for k in itertools.count(first):
            time = k * COMMUNICATION_STEP
            if time >= self.end - 1e-9:
                break
            yield time
        yield self.end


def stretches(scene: Scene) -> Iterator[Stretch]:
    """The controls of a scene, up to STOP_TIME."""
    for first, last in itertools.pairwise(scene.rows):
        end = min(last[0], STOP_TIME)
        if end > first[0]:
            yield Stretch(first[0], end, Controls(*first[1:]), Controls(*_slopes(first, last)))


def _slopes(first: Row, last: Row) -> Iterator[float]:
    slopes = ((b - a) / (last[0] - first[0]) for a, b in zip(first[1:], last[1:], strict=True))
    return itertools.islice(itertools.chain(slopes, itertools.repeat(0.0)), len(INPUTS))


class Calls:
    """An instance behind calls whose arrays are made once."""

    def __init__(self, instance: Any, scene: Scene, messages: list[str]) -> None:
        self.instance, self.scene, self.messages = instance, scene, messages
        driven = INPUTS if any(len(row) > 4 for row in scene.rows) else INPUTS[:3]
        self.inputs, self.outputs = _references(driven), _references(OUTPUTS)
        self.values = (fmi2.fmi2Real * len(driven))()
        self.orders = (fmi2.fmi2Integer * len(driven))(*[1] * len(driven))
        self.read = (fmi2.fmi2Real * len(OUTPUTS))()

    def start(self, **values: float | str) -> None:
        """To the end of initialization."""
        self.messages.clear()
        self.instance.reset()
        self.instance.setupExperiment()
        for name, value in plan(self.scene, start_values=values).start_values.items():
            setter = self.instance.setReal if BY_NAME[name].kind == "Real" else self.instance.setInteger
            setter([BY_NAME[name].reference], [value])
        self.instance.enterInitializationMode()
        self.instance.exitInitializationMode()

    def put(self, controls: Controls) -> None:
        """Set the inputs."""
        self.values[:] = controls[: len(self.values)]
        self.instance.fmi2SetReal(self.instance.component, self.inputs, len(self.inputs), self.values)

    def put_rates(self, rates: Controls) -> None:
        """Set their derivatives."""
        self.values[:] = rates[: len(self.values)]
        component, n = self.instance.component, len(self.inputs)
        self.instance.fmi2SetRealInputDerivatives(component, self.inputs, n, self.orders, self.values)

    def get(self) -> None:
        """Read the outputs."""
        self.instance.fmi2GetReal(self.instance.component, self.outputs, len(self.outputs), self.read)

    def end(self) -> State:
        """The state."""
        return State(*self.instance.getReal([BY_NAME[name].reference for name in STATES]))


def _references(names: Sequence[str]) -> Any:
    return (fmi2.fmi2ValueReference * len(names))(*(BY_NAME[name].reference for name in names))


def solved(calls: Calls, tolerance: float) -> tuple[float, State, int]:
    """Seconds, the state at the end, and the evaluations of a scene with CVode (BDF, as fmpy has it).

    The inputs are what they are at the time of every evaluation: CVode restarts where they bend or jump. (fmpy's own
    loop sets the inputs of an FMU without event indicators once an output interval.)

    Raises:
        SimulationError: the FMU refused a call; from inside CVode, which is C, no exception comes through.
    """
    from fmpy.sundials import CVodeSolver

    instance, evaluations, current = calls.instance, 0, Stretch(0.0, 0.0, Controls(), Controls())

    def set_time(time: float) -> None:
        nonlocal evaluations
        evaluations += 1
        instance.fmi2SetTime(instance.component, time)
        if any(current.rates):
            calls.put(current.at(time))

    calls.start()
    instance.newDiscreteStates()
    instance.enterContinuousTimeMode()
    solver = CVodeSolver(
        nx=len(STATES), nz=0, get_x=instance.getContinuousStates, set_x=instance.setContinuousStates,
        get_dx=instance.getDerivatives, get_z=instance.getEventIndicators,
        get_nominals=instance.getNominalsOfContinuousStates, set_time=set_time, input=None, startTime=0.0,
        maxStep=STOP_TIME / 50.0, relativeTolerance=tolerance, maxNumSteps=MOST_STEPS,
    )  # fmt: skip
    begun = perf_counter()
    for current in stretches(calls.scene):
        instance.enterEventMode()
        calls.put(current.start)
        instance.newDiscreteStates()
        instance.enterContinuousTimeMode()
        solver.reset(current.begin)
        time = current.begin
        for point in current.points():
            solver.step(time, point)
            time = point
            instance.setTime(time)
            calls.put(current.at(time))
            if instance.completedIntegratorStep()[0]:
                instance.enterEventMode()
                instance.newDiscreteStates()
                instance.enterContinuousTimeMode()
            calls.get()
    seconds = perf_counter() - begun
    if calls.messages:
        raise SimulationError("; ".join(calls.messages))
    return seconds, calls.end(), evaluations


def stepped(calls: Calls, setting: Setting) -> tuple[float, State, int]:
    """Seconds, the state at the end, and the evaluations of a scene with one of the FMU's own methods."""
    instance = calls.instance
    calls.start(integrator=setting.integrator, step_size=setting.step_size, tolerance=setting.tolerance)
    begun = perf_counter()
    for stretch in stretches(calls.scene):
        time = stretch.begin
        for point in stretch.points():
            calls.put(stretch.at(time))
            if any(stretch.rates):
                calls.put_rates(stretch.rates)
            instance.fmi2DoStep(instance.component, time, point - time, fmi2.fmi2True)
            time = point
            calls.get()
    seconds = perf_counter() - begun
    (substeps,) = instance.getInteger([BY_NAME["substeps"].reference])
    return seconds, calls.end(), substeps * EVALUATIONS[setting.integrator]


def measure(quick: bool) -> list[Run]:
    """Run every smooth scene with every setting of every solver; medians of interleaved runs."""
    scenes = [SCENES[ADVISED_SCENE]] if quick else SMOOTH
    found: dict[tuple[str, str, float, float], list[tuple[float, State, int]]] = {}
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        path = build_native_fmu(Path(folder) / "HovercraftNative.fmu")
        description, messages = read_description(path), list[str]()
        _, exchanging = stack.enter_context(instantiated(path, description, messages, exchange=True))
        _, stepping = stack.enter_context(instantiated(path, description, messages))
        for scene in scenes * (1 if quick else REPEATS):
            for setting in settings(COMMUNICATION_STEP):
                key = (scene.name, setting.integrator, setting.step_size, setting.tolerance)
                found.setdefault(key, []).append(stepped(Calls(stepping, scene, messages), setting))
            for tolerance in TOLERANCES:
                key = (scene.name, "CVode", math.nan, tolerance)
                found.setdefault(key, []).append(solved(Calls(exchanging, scene, messages), tolerance))
    ends = {scene.name: reference_end(scene, STOP_TIME)[0] for scene in scenes}
    return [_row(*key, ends[key[0]], runs) for key, runs in found.items()]


def _row(
    scene: str, solver: str, step_size: float, tolerance: float, exact: State, runs: list[tuple[float, State, int]]
) -> Run:
    _, end, evaluations = runs[0]
    return Run(
        scene, solver, step_size, tolerance,
        position_error=math.hypot(end.x - exact.x, end.y - exact.y),
        error=max(abs(a - b) for a, b in zip(end, exact, strict=True)),
        cost=statistics.median(seconds for seconds, _, _ in runs) * 1e6 / STOP_TIME,
        evaluations=evaluations / STOP_TIME,
    )  # fmt: skip


# ---- what follows from the runs


class Choice(NamedTuple):
    """The cheapest way to an accuracy: the FMU's own, and CVode's."""

    scene: str
    accuracy: float
    """m"""
    own: Run
    other: Run

    @property
    def ratio(self) -> float:
        """1: how many times CVode costs what the FMU's own method costs, through fmpy."""
        return self.other.cost / self.own.cost

    @property
    def evaluations(self) -> float:
        """1: the same, counted in evaluations of the loads: whatever the host."""
        return self.other.evaluations / self.own.evaluations


def choices(runs: Sequence[Run]) -> list[Choice]:
    """For each scene and accuracy that both reach."""
    table = []
    for scene, accuracy in itertools.product(dict.fromkeys(run.scene for run in runs), ACCURACIES):
        good = [run for run in runs if run.scene == scene and run.position_error <= accuracy]
        own, other = ([run for run in good if (run.solver == "CVode") is cvode] for cvode in (False, True))
        if own and other:
            cheapest = (min(each, key=lambda run: run.cost) for each in (own, other))
            table.append(Choice(scene, accuracy, *cheapest))
    return table


def slope(runs: Sequence[Run], scene: str) -> float:
    """Of the largest error at the end over CVode's tolerance, log-log: 1 where it is proportional."""
    own = [run for run in runs if (run.scene, run.solver) == (scene, "CVode")]
    logs = np.log([[run.tolerance, run.error] for run in own])
    return float(np.polyfit(logs[:, 0], logs[:, 1], 1)[0])


# ---- what is printed


TITLES = (
    "scene", "accuracy", "own method", "us/s", "evaluations/s", "CVode", "us/s", "evaluations/s", "CVode costs",
)  # fmt: skip


def run(folder: Path, quick: bool = False) -> Group:
    """Measure, write exchange_runs.csv and exchange.csv into the folder, and return what is to be printed."""
    if reason := library(NATIVE).missing:
        return Group(Text(f"\nModel exchange was not measured: {reason}"))
    runs = measure(quick)
    chosen = choices(runs)
    folder.mkdir(parents=True, exist_ok=True)
    _write(folder / "exchange_runs.csv", Run._fields, runs)
    _write(folder / "exchange.csv", RECORD, [_record(choice) for choice in chosen])
    table = Table(box=None, pad_edge=False)
    for title in TITLES:
        table.add_column(title)
    for choice in chosen:
        own, other = choice.own, choice.other
        table.add_row(
            choice.scene, f"{choice.accuracy:g} m", own.label, f"{own.cost:.3g}", f"{own.evaluations:.3g}",
            f"{other.tolerance:g}", f"{other.cost:.3g}", f"{other.evaluations:.3g}", f"{choice.ratio:.3g} x",
        )  # fmt: skip
    slopes = ", ".join(f"{name} {slope(runs, name):.2f}" for name in dict.fromkeys(run.scene for run in runs))
    return Group(
        "\nThe cheapest way to a position error through fmpy: the FMU's own method, and CVode in model exchange", table,
        f"\nThe slope of CVode's error at the end over its tolerance: {slopes}",
    )  # fmt: skip


RECORD = (
    "scene", "accuracy_m", "own", "own_cost", "own_evaluations", "tolerance", "cvode_cost", "cvode_evaluations",
    "cvode_over_own", "evaluations_over_own",
)  # fmt: skip


def _record(choice: Choice) -> tuple[Any, ...]:
    own, other = choice.own, choice.other
    return (choice.scene, choice.accuracy, own.label, own.cost, own.evaluations,
            other.tolerance, other.cost, other.evaluations, choice.ratio, choice.evaluations)  # fmt: skip


def _write(path: Path, titles: Sequence[str], rows: Sequence[tuple[Any, ...]]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(titles)
        writer.writerows(rows)
