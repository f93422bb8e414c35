"""Makes runs through the FMU, one instance for all of them."""

import threading
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..fmu.interface import INPUTS
from ..host import Fmu, SimulationError
from ..host.ramps import Ramps
from ..model.dynamics import Controls
from ..model.integrators import integrator
from ..model.subcycling import Settings
from ..simulation import Run, is_ramped
from ..whole import temporary_folder
from .quantities import Keep, Record, Samples
from .timeline import Leg, Timeline, merged


@dataclass(frozen=True)
class Plan:
    """What a worker needs to make any run of a study."""

    run: Run
    """All that the runs share."""
    keep: Keep
    timeline: Timeline


class Ran(NamedTuple):
    """What a number of runs gave; NaN in the record of a run that failed."""

    record: Record
    warnings: NDArray[np.int32]
    """Shape (runs,): the FMU's variable; see interface.WARNINGS."""
    errors: list[str | None]


def empty(plan: Plan, count: int) -> Ran:
    """Room for so many runs."""
    record = np.full((count, len(plan.timeline.times), len(plan.keep.read)), np.nan)
    return Ran(record, np.zeros(count, np.int32), [None] * count)


def settings_of(values: Mapping[str, float | int]) -> Settings:
    """Sub-step and method of a run. Raises ValueError where there is no such method."""
    return Settings(float(values["step_size"]), integrator(int(values["integrator"])), float(values["tolerance"]))


SETTINGS = ("step_size", "integrator", "tolerance")


# ---- through the FMU


class Driver:
    """One instance of an FMU, reset and used again from run to run."""

    def __init__(self, plan: Plan, fmu: bytes, swept: tuple[str, ...]) -> None:
        self._plan = plan
        self._stack = ExitStack()
        folder = self._stack.enter_context(temporary_folder())
        path = Path(folder) / "swept.fmu"
        path.write_bytes(fmu)
        opened = self._stack.enter_context(Fmu(path))
        self._ramps = self._stack.enter_context(Ramps.on(opened, INPUTS, is_ramped(plan.run)))
        self._craft = self._ramps.craft
        self._busy, self._over = threading.Lock(), False
        self._merged = lru_cache(maxsize=16)(partial(merged, plan.timeline.legs, plan.run.start_time))
        names = tuple(dict.fromkeys((*plan.run.start_values, *swept)))
        self._shared = {name: plan.run.value(name) for name in (*names, *SETTINGS)}
        self._start_values = self._craft.port(*names)
        self._driven = [(i, name) for i, name in enumerate(INPUTS) if name in swept]
        self._warnings, self._read = self._craft.port("warnings"), self._craft.port(*plan.keep.read)
        self._record = np.empty((len(plan.timeline.times), len(plan.keep.read)))
        self._rows = [self._read.over(row) for row in self._record]

    def close(self) -> None:
        """Free the instance and delete what was extracted; where a run is on its way, after it."""
        self._over = True
        if self._busy.acquire(blocking=False):
            self._stack.close()
            self._busy.release()

    def run(self, samples: Samples) -> Ran:
        """Make runs, one after the other. A run that the FMU refuses leaves its message, and the next one goes on."""
        try:
            with self._busy:
                return self._run(samples)
        finally:
            if self._over:
                self.close()

    def _run(self, samples: Samples) -> Ran:
        count = len(next(iter(samples.values())))
        ran = empty(self._plan, count)
        columns = {name: column.tolist() for name, column in samples.items()}
        for i in range(count):
            values = self._shared | {name: column[i] for name, column in columns.items()}
            try:
                self._one(values)
                ran.record[i] = self._record
                (ran.warnings[i],) = self._warnings.get()
            except (SimulationError, ValueError) as error:
                ran.errors[i] = str(error)
            self._craft.messages.clear()
            self._craft.reset()
        return ran

    def _one(self, values: Mapping[str, float | int]) -> None:
        craft, run, timeline = self._craft, self._plan.run, self._plan.timeline
        self._start_values.set([values[name] for name in self._start_values.names])
        craft.enter_initialization(run.start_time, run.stop_time)
        self._ramps.inputs.set(self._driven_by(timeline.start, values))
        craft.exit_initialization()
        rows = iter(self._rows)
        if timeline.start_kept:
            self._read.get_into(next(rows))
        legs: Sequence[Leg] = self._merged(settings_of(values))
        if self._driven:
            ends = ((self._driven_by(leg.first, values), self._driven_by(leg.last, values)) for leg in legs)
            legs = [leg._replace(first=first, last=last) for leg, (first, last) in zip(legs, ends, strict=True)]
        self._ramps.follow(legs, self._read, rows)

    def _driven_by(self, controls: Controls, values: Mapping[str, float | int]) -> Controls:
        """With the inputs that are swept."""
        given = list(controls)
        for i, name in self._driven:
            given[i] = values[name]
        return Controls(*given)
