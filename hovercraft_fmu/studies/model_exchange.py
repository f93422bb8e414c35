"""What somebody else's solver costs: fmpy's CVode on the native FMU in model exchange, beside the FMU's own methods."""

import itertools
import math
from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import polars as pl

from ..fmu.interface import INPUTS, OUTPUTS, STATES
from ..host import Instance, Port, SimulationError
from ..model.dynamics import Controls, State
from ..scenes import SCENES, Row, Scene
from ..simulation import method_in_words, plan
from .laboratory import Findings, Ready, Shown, Tell, interleaved
from .reference_end import reference_end
from .work_precision import STOP_TIME, Reached, Setting, fitted, largest, planned, settings

COMMUNICATION_STEP = 0.5
"""s: how often inputs are set and outputs are read; where the inputs of a scene bend or jump, too."""
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
"""Relative; the absolute ones are these times the nominals of the states, as fmpy has it."""
ACCURACIES = (0.01, 1e-4, 1e-6)
"""m, at the end"""
SMOOTH = tuple(scene for scene in SCENES.values() if not scene.craft.rubs)
MOST_STEPS = 100_000
"""Of CVode's own, from one reading of the outputs to the next."""
CVODE = "CVode"


class ControlRamp(NamedTuple):
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

    def points(self) -> list[float]:
        """s: where the outputs are read."""
        first = math.floor(self.begin / COMMUNICATION_STEP) + 1
        last = math.ceil(self.end / COMMUNICATION_STEP - 1e-9)
        return [*(k * COMMUNICATION_STEP for k in range(first, last)), self.end]


def ramps(scene: Scene) -> Iterator[ControlRamp]:
    """The controls of a scene, up to STOP_TIME."""
    for first, last in itertools.pairwise(scene.rows):
        end = min(last[0], STOP_TIME)
        if end > first[0]:
            yield ControlRamp(first[0], end, Controls(*first[1:]), Controls(*_slopes(first, last)))


def _slopes(first: Row, last: Row) -> Iterator[float]:
    slopes = ((b - a) / (last[0] - first[0]) for a, b in zip(first[1:], last[1:], strict=True))
    return itertools.islice(itertools.chain(slopes, itertools.repeat(0.0)), len(INPUTS))


def _driven(instance: Instance, scene: Scene) -> Port:
    """The inputs that the scene changes."""
    return instance.port(*(INPUTS if any(len(row) > 4 for row in scene.rows) else INPUTS[:3]))


def solved(instance: Instance, scene: Scene, tolerance: float) -> Ready[Reached]:
    """A scene with CVode (BDF, as fmpy has it); of the substeps, the evaluations.

    The inputs are what they are at the time of every evaluation: CVode restarts where they bend or jump. (fmpy's own
    loop sets the inputs of an FMU without event indicators once an output interval.)

    Raises, what is timed:
        SimulationError: the FMU said something; from inside CVode, which is C, no exception comes through.
    """
    from fmpy.sundials import CVodeSolver

    inputs, outputs, states = _driven(instance, scene), instance.port(*OUTPUTS), instance.port(*STATES)
    width, evaluations = len(inputs.names), 0
    current = ControlRamp(0.0, 0.0, Controls(), Controls())

    def set_time(time: float) -> None:
        nonlocal evaluations
        evaluations += 1
        instance.set_time(time)
        if any(current.rates):
            inputs.set(current.at(time)[:width])

    def settle() -> None:
        instance.update_discrete_states()
        instance.enter_continuous_time_mode()

    def ready() -> Callable[[], Reached]:
        nonlocal evaluations
        evaluations = 0
        instance.messages.clear()
        instance.reset()
        instance.start(plan(scene).start_values)
        settle()
        solver = CVodeSolver(
            nx=len(STATES), nz=0, get_x=instance.get_states, set_x=instance.set_states, get_dx=instance.get_derivatives,
            get_z=None, get_nominals=instance.get_nominals, set_time=set_time, input=None, startTime=0.0,
            maxStep=STOP_TIME / 50.0, relativeTolerance=tolerance, maxNumSteps=MOST_STEPS,
        )  # fmt: skip
        return lambda: go(solver.reset, solver.step)

    def go(restart: Callable[[float], None], step: Callable[[float, float], object]) -> Reached:
        nonlocal current
        for current in ramps(scene):
            instance.enter_event_mode()
            inputs.set(current.start[:width])
            settle()
            restart(current.begin)
            time = current.begin
            for point in current.points():
                step(time, point)
                time = point
                instance.set_time(time)
                inputs.set(current.at(time)[:width])
                if instance.complete_step():
                    instance.enter_event_mode()
                    settle()
                outputs.get()
        if instance.messages:
            raise SimulationError("; ".join(instance.messages))
        return Reached(State(*states.get()), evaluations)

    return ready


def stepped(instance: Instance, scene: Scene, setting: Setting) -> Ready[Reached]:
    """A scene with one of the FMU's own methods; of the substeps, the evaluations."""
    inputs, outputs, states = _driven(instance, scene), instance.port(*OUTPUTS), instance.port(*STATES, "substeps")
    width = len(inputs.names)
    run = planned(scene, setting)

    def ready() -> Callable[[], Reached]:
        instance.reset()
        instance.start(run.start_values)
        return go

    def go() -> Reached:
        for ramp in ramps(scene):
            time = ramp.begin
            for point in ramp.points():
                inputs.set(ramp.at(time)[:width])
                if any(ramp.rates):
                    inputs.set_slopes(ramp.rates[:width])
                instance.step(time, point - time)
                time = point
                outputs.get()
        *end, substeps = states.get()
        return Reached(State(*end), int(substeps) * run.settings.integrator.stages)

    return ready


def exchanged(stepping: Instance, solving: Instance, scenes: Sequence[Scene], rounds: int, tell: Tell) -> Findings:
    """Every scene with every setting of every solver, and the cheapest way of both to an accuracy.

    Errors at the end [m, SI units]; us, evaluations of the loads a simulated second (of adaptive, of accepted steps).
    """
    cases: dict[tuple[str, str, float, float], Ready[Reached]] = {}
    for scene in scenes:
        for setting in settings(COMMUNICATION_STEP):
            key = (scene.name, setting.integrator, setting.step_size, setting.tolerance)
            cases[key] = stepped(stepping, scene, setting)
        for tolerance in TOLERANCES:
            cases[scene.name, CVODE, math.nan, tolerance] = solved(solving, scene, tolerance)
    exact = {scene.name: reference_end(scene, STOP_TIME)[0] for scene in scenes}
    timed = interleaved(cases, rounds, tell)
    rows = []
    for key, own in timed.items():
        end, truth = own.found.end, exact[key[0]]
        rows.append({
            **dict(zip(("scene", "solver", "step_size", "tolerance"), key, strict=True)),
            "position_error": math.dist(end[:2], truth[:2]), "error": largest(end, truth),
            "cost": own.least * 1e6 / STOP_TIME, "evaluations": own.found.substeps / STOP_TIME, "spread": own.spread,
        })  # fmt: skip
    found = pl.DataFrame(rows)
    best = choices(found)
    title = "The cheapest way to a position error through fmpy: the FMU's own method, and CVode in model exchange"
    cvode = found.filter(solver=CVODE).partition_by("scene", maintain_order=True)
    slopes = ", ".join(f"{own['scene'][0]} {fitted(own['tolerance'], own['error']):.2f}" for own in cvode)
    return Findings(
        {"exchange_runs": found, "exchange": best},
        [Shown(title, best)],
        notes=[f"The slope of CVode's error at the end over its tolerance: {slopes}"],
    )


def choices(found: pl.DataFrame) -> pl.DataFrame:
    """For each scene and accuracy that both reach the cheapest way: the FMU's own, and CVode's."""
    rows, cheapest = [], found.sort("cost")
    for scene, accuracy in itertools.product(found["scene"].unique(maintain_order=True), ACCURACIES):
        good = cheapest.filter((pl.col("scene") == scene) & (pl.col("position_error") <= accuracy))
        own, other = good.filter(pl.col("solver") != CVODE), good.filter(solver=CVODE)
        if len(own) and len(other):
            a, b = own.row(0, named=True), other.row(0, named=True)
            rows.append({
                "scene": scene, "accuracy_m": accuracy,
                "own": method_in_words(a["solver"], a["step_size"], a["tolerance"]),
                "own_cost": a["cost"], "own_evaluations": a["evaluations"], "tolerance": b["tolerance"],
                "cvode_cost": b["cost"], "cvode_evaluations": b["evaluations"],
                "cvode_over_own": b["cost"] / a["cost"], "evaluations_over_own": b["evaluations"] / a["evaluations"],
            })  # fmt: skip
    return pl.DataFrame(rows)
