"""What somebody else's solver costs: fmpy's CVode on the native FMU in model exchange, beside the FMU's own methods.

Counted, in evaluations of the loads: through fmpy each is a call into Python, whose time says little of a solver.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import polars as pl

from ..fmu.interface import INPUTS, OUTPUTS, STATES
from ..host import Instance, Port, SimulationError
from ..model.dynamics import Controls, State
from ..scenes import SCENES, Row, Scene
from ..simulation import method_in_words, plan
from .laboratory import Findings, Shown, Tell
from .reference_end import reference_end
from .work_precision import fitted, largest

COMMUNICATION_STEP = 0.5
"""s: how often inputs are set and outputs are read; where the inputs of a scene bend or jump, too."""
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
"""Relative; the absolute ones are these times the nominals of the states, as fmpy has it."""
ACCURACIES = (0.01, 1e-4, 1e-6)
"""m, at the end"""
SMOOTH = tuple(scene for scene in SCENES.values() if not scene.craft.rubs)
MOST_STEPS = 100_000
"""Of CVode's own, from one reading of the outputs to the next."""
LONGEST_STEP = 1.2
"""s: a fiftieth of a minute, as fmpy has it."""


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
    """The controls of a scene."""
    for first, last in itertools.pairwise(scene.rows):
        if last[0] > first[0]:
            yield ControlRamp(first[0], last[0], Controls(*first[1:]), Controls(*_slopes(first, last)))


def _slopes(first: Row, last: Row) -> Iterator[float]:
    slopes = ((b - a) / (last[0] - first[0]) for a, b in zip(first[1:], last[1:], strict=True))
    return itertools.islice(itertools.chain(slopes, itertools.repeat(0.0)), len(INPUTS))


def _driven(instance: Instance, scene: Scene) -> Port:
    """The inputs that the scene changes."""
    return instance.port(*(INPUTS if any(len(row) > 4 for row in scene.rows) else INPUTS[:3]))


def solved(instance: Instance, scene: Scene, tolerance: float) -> tuple[State, int]:
    """Where a scene ends with CVode (BDF, as fmpy has it), and the evaluations of the loads.

    The inputs are what they are at the time of every evaluation: CVode restarts where they bend or jump. (fmpy's own
    loop sets the inputs of an FMU without event indicators once an output interval.)

    Raises:
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

    instance.messages.clear()
    instance.reset()
    instance.start(plan(scene).start_values)
    settle()
    solver = CVodeSolver(
        nx=len(STATES), nz=0, get_x=instance.get_states, set_x=instance.set_states, get_dx=instance.get_derivatives,
        get_z=None, get_nominals=instance.get_nominals, set_time=set_time, input=None, startTime=0.0,
        maxStep=LONGEST_STEP, relativeTolerance=tolerance, maxNumSteps=MOST_STEPS,
    )  # fmt: skip
    for current in ramps(scene):
        instance.enter_event_mode()
        inputs.set(current.start[:width])
        settle()
        solver.reset(current.begin)
        time = current.begin
        for point in current.points():
            solver.step(time, point)
            time = point
            instance.set_time(time)
            inputs.set(current.at(time)[:width])
            if instance.complete_step():
                instance.enter_event_mode()
                settle()
            outputs.get()
    if instance.messages:
        raise SimulationError("; ".join(instance.messages))
    return State(*states.get()), evaluations


def exchanged(solving: Instance, scenes: Sequence[Scene], runs: pl.DataFrame, tell: Tell) -> Findings:
    """Every scene with every tolerance of CVode, and the fewest evaluations of both that reach an accuracy at the end.

    Args:
        solving: of the native FMU, in model exchange.
        scenes: those that are solved.
        runs: what `work_precision.measured` found of the FMU's own methods.
        tell: see `Tell`.
    """
    rows, cases = [], list(itertools.product(scenes, TOLERANCES))
    for done, (scene, tolerance) in enumerate(cases, 1):
        exact = reference_end(scene, scene.stop_time)[0]
        end, evaluations = solved(solving, scene, tolerance)
        rows.append({
            "scene": scene.name, "tolerance": tolerance, "position_error": math.dist(end[:2], exact[:2]),
            "error": largest(end, exact), "evaluations": evaluations / scene.stop_time,
        })  # fmt: skip
        tell(done / len(cases))
    found = pl.DataFrame(rows)
    best = choices(found, runs)
    slopes = ", ".join(
        f"{own['scene'][0]} {fitted(own['tolerance'], own['error']):.2f}"
        for own in found.partition_by("scene", maintain_order=True)
    )
    return Findings(
        {"exchange_runs": found, "exchange": best},
        [
            Shown(
                "Loads a simulated second for a position error: the FMU's own method, and CVode in model exchange", best
            )
        ],
        notes=[f"The slope of CVode's error at the end over its tolerance: {slopes}"],
    )


def choices(found: pl.DataFrame, runs: pl.DataFrame) -> pl.DataFrame:
    """For each scene and accuracy that both reach the fewest evaluations: the FMU's own way, and CVode's."""
    rows = []
    for scene, accuracy in itertools.product(found["scene"].unique(maintain_order=True), ACCURACIES):
        own = runs.filter(pl.col("end_error") <= accuracy, scene=scene, said="nothing").sort("loads")
        other = found.filter(pl.col("position_error") <= accuracy, scene=scene).sort("evaluations")
        if len(own) and len(other):
            a, b = own.row(0, named=True), other.row(0, named=True)
            rows.append({
                "scene": scene, "accuracy_m": accuracy, "own": method_in_words(a["method"], a["setting"], a["setting"]),
                "own_loads": a["loads"], "tolerance": b["tolerance"], "cvode_loads": b["evaluations"],
                "cvode_over_own": b["evaluations"] / a["loads"],
            })  # fmt: skip
    return pl.DataFrame(rows)
