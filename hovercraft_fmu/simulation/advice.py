"""What to set: the cheapest method and sub-step that keep a scene within a wanted error, by the FMU's own estimate."""

import math
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from ..building import default_fmu
from ..fmu.interface import ERROR_LOST, STEP_TURNS, STEP_UNSTABLE
from ..fmu.near_names import explains_keywords
from ..fmu.start_values import Value
from ..fmu.start_values import start_values as numbers
from ..host import SimulationError
from ..model.integrators import ADAPTIVE, INTEGRATORS, Integrator
from .cost import counted
from .fmu_run import run_fmu, stepping
from .planning import Inputs, Run, method_in_words, plan
from .points import ends, holding, schedule
from .result import Result

TRIED = ("integrator", "step_size", "tolerance", "error_estimate")
WITHIN = 0.01
"""m"""
CUTS = tuple(part * 10**n for n in range(5) for part in (1, 2, 5))
"""Sub-steps of a communication step."""
TOLERANCES = tuple(10.0**-n for n in range(2, 11))
"""Of the adaptive method."""
REFERENCE = 1e-11
"""The tolerance of the run that the advice is checked with."""
MOST = 5e6
"""Loads of a run: nothing that costs more is tried."""
DEARER = 100
"""Times the cost of the cheapest: nothing is looked for there."""
FAR = 5.0
"""Times the step that an estimate says is enough: longer ones are not tried."""
ROUNDS = 3
"""Runs that are timed; the least counts."""


@dataclass(frozen=True)
class Tried:
    """A setting and what came of it."""

    start_values: Mapping[str, Value]
    """That give it: the integrator, and its step_size [s] or tolerance."""
    substeps: int
    loads: int
    """What that costs: how many times they are worked out, all in all; see `counted`."""
    told: float
    """m: the largest estimate of a communication point; infinite where it cannot be trusted, or the run was refused."""
    seconds: float = math.nan
    """The run without the estimate, in this host, least of ROUNDS."""
    true: float = math.nan
    """m: the largest distance from the reference run."""

    @property
    def words(self) -> str:
        """'rk4, 0.1 s'."""
        step, tolerance = (float(self.start_values.get(name, 0.0)) for name in ("step_size", "tolerance"))
        return method_in_words(str(self.start_values["integrator"]), step, tolerance)


@dataclass(frozen=True)
class Advice:
    """What was found for a run."""

    run: Run
    within: float
    """m"""
    best: Tried
    """The cheapest that stays within that; where none does, the most accurate."""
    runner_up: Tried | None
    """The cheapest of another method."""
    held: float
    """m: how far a host is off that holds the inputs over each communication step, whatever the method."""

    @property
    def is_met(self) -> bool:
        """Whether the best stays within the wanted error, by the reference run."""
        return self.best.true <= self.within


@explains_keywords
def advise(
    scene_or_inputs: Inputs = "launch",
    fmu: str | os.PathLike[str] | None = None,
    *,
    within: float = WITHIN,
    preset: str | None = None,
    start_values: Mapping[str, Value] | None = None,
    communication_step: float | None = None,
    tell: Callable[[float], None] = lambda _: None,
) -> Advice:
    """Try methods and sub-steps on a scene, or on inputs of your own, and say which is the cheapest.

    Costs are counted, as in `measure trade`: how many times the loads are worked out. A setting that the FMU warns of
    is none.

    Args:
        scene_or_inputs, fmu, preset, start_values, communication_step: see `simulate`.
        within: m, of the position, at every communication point.
        tell: called with the part of the work that is done, 0 to 1.

    Raises:
        ValueError: `within` is not a finite number greater than 0; a start value that is looked for; and as `simulate`
            does, which the runs are made by.
    """
    if not 0.0 < within < math.inf:
        raise ValueError(f"within = {within!r} m: must be a finite number greater than 0")
    if given := [name for name in TRIED if name in numbers(start_values or {})]:
        raise ValueError(f"{given[0]}: must not be given: it is what is looked for")
    run = plan(scene_or_inputs, preset=preset, start_values=start_values, communication_step=communication_step)
    bench = _Bench(run, default_fmu() if fmu is None else fmu, within)
    found: list[Tried] = []
    for done, method in enumerate(sorted(INTEGRATORS, key=lambda each: -each.order)):
        tell(done / (len(INTEGRATORS) + 1))
        most = min([DEARER * each.loads for each in found if each.told <= within], default=MOST)
        found += bench.cheapest(method, min(most, MOST))
    if not found:
        raise SimulationError(f"{run.title}: every setting was refused: the motion leaves the range of numbers")
    checked = sorted(map(bench.checked, found), key=bench.rank)
    good = [each for each in checked if bench.rank(each)[0] == 0]
    return Advice(run, within, checked[0], good[1] if len(good) > 1 else None, bench.held())


class _Bench:
    """Where settings are tried."""

    def __init__(self, run: Run, fmu: str | os.PathLike[str], within: float) -> None:
        self._run, self._fmu, self._within = run, fmu, within
        self._exact = _settings(ADAPTIVE, REFERENCE)
        self._reference = self._made(self._exact)

    def _made(self, settings: Mapping[str, Value], **more: Value) -> Result:
        return run_fmu(_with(self._run, {**settings, **more}), self._fmu)

    def held(self) -> float:
        """m: what holding the inputs costs."""
        return _apart(run_fmu(_with(holding(self._run), self._exact), self._fmu), self._reference)

    def rank(self, tried: Tried) -> tuple[int, float]:
        """Those that stay within come first, the cheapest of them ahead; of the others the most accurate."""
        return (0, tried.loads) if max(tried.told, tried.true) <= self._within else (1, tried.true)

    def cheapest(self, method: Integrator, most: float) -> list[Tried]:
        """The coarsest setting of a method that stays within; else the most accurate; none where all were refused.

        What an estimate says is FAR from enough is left out.
        """
        best: list[Tried] = []
        left = [self._run.communication_step / cut for cut in CUTS] if method.integrate else list(TOLERANCES)
        while left:
            accuracy = left.pop(0)
            settings = _settings(method, accuracy)
            try:
                tried = _tried(settings, method, self._made(settings, error_estimate="on"))
            except SimulationError:
                continue
            if not best or tried.told < best[0].told:
                best = [tried]
            if tried.told <= self._within:
                break
            affordable = [each for each in left if tried.loads * accuracy / each <= most or not method.integrate]
            order = method.order if method.integrate else 1
            wanted = FAR * accuracy * (self._within / tried.told) ** (1 / order) if tried.told < math.inf else accuracy
            left = [each for each in affordable if each <= wanted] or affordable[-1:]
        return best

    def checked(self, tried: Tried) -> Tried:
        """With its distance from the reference, and its time."""
        result = self._made(tried.start_values)
        return replace(tried, true=_apart(result, self._reference), seconds=self._seconds(tried.start_values))

    def _seconds(self, settings: Mapping[str, Value]) -> float:
        run, times = _with(self._run, settings), []
        with stepping(run, self._fmu) as stepper:
            pieces = list(schedule(stepper.run))
            for n in range(ROUNDS):
                (stepper.restart if n else stepper.start)(ends(stepper.run)[0])
                begun = perf_counter()
                for piece in pieces:
                    stepper.make(piece)
                times.append(perf_counter() - begun)
        return min(times)


def _settings(method: Integrator, accuracy: float) -> dict[str, Value]:
    return {"integrator": method.name, "step_size" if method.integrate else "tolerance": accuracy}


def _with(run: Run, settings: Mapping[str, Value]) -> Run:
    return replace(run, start_values={**run.start_values, **numbers({"error_estimate": "off", **settings})})


def _tried(settings: Mapping[str, Value], method: Integrator, result: Result) -> Tried:
    substeps = int(result["substeps"][-1])
    trusted = not result["warnings"][-1] & (STEP_UNSTABLE | STEP_TURNS | ERROR_LOST)
    told = float(result["error.position"].max()) if trusted else math.inf
    return Tried(settings, substeps, round(counted(method, substeps)), told)


def _apart(result: Result, reference: Result) -> float:
    dx, dy = (result[name] - reference[name] for name in ("pose.x", "pose.y"))
    return float(np.hypot(dx, dy).max())
