"""Makes runs through the FMU, one instance for all of them."""

import signal
import tempfile
import threading
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from fmpy import fmi2
from fmpy.fmi1 import FMICallException
from numpy.typing import NDArray

from ..fmu.interface import BY_NAME, INPUTS
from ..model.dynamics import Controls
from ..model.integrators import integrator
from ..model.subcycling import Settings
from ..simulation import Run, instantiated, read_description
from .quantities import Keep, Record
from .study import Samples
from .timeline import Timeline, merged


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
    """One instance of an FMU, reset and used again from run to run.

    What fmpy's own calls make anew every time, arrays for ctypes, is made once here.
    """

    def __init__(self, plan: Plan, fmu: bytes, swept: tuple[str, ...]) -> None:
        self._plan, self._swept = plan, swept
        self._folder = tempfile.TemporaryDirectory(prefix="hovercraft_sweep_")
        self._path = Path(self._folder.name) / "swept.fmu"
        self._path.write_bytes(fmu)
        self._description = read_description(self._path, validate=False)
        self._references = {v.name: v.valueReference for v in self._description.modelVariables}
        self._stack, self._messages = ExitStack(), list[str]()
        self._busy, self._over = threading.Lock(), False
        self._merged = lru_cache(maxsize=16)(partial(merged, plan.timeline.legs))
        self._make_arrays()
        self._instantiate()

    def close(self) -> None:
        """Free the instance and delete what was extracted; where a run is on its way, after it."""
        self._over = True
        if self._busy.acquire(blocking=False):
            self._stack.close()
            self._folder.cleanup()
            self._busy.release()

    def _instantiate(self) -> None:
        self._stack.close()
        _, self._instance = self._stack.enter_context(instantiated(self._path, self._description, self._messages))
        self._new = True

    def _make_arrays(self) -> None:
        run, names = self._plan.run, tuple(dict.fromkeys((*self._plan.run.start_values, *self._swept)))
        self._shared = {name: run.value(name) for name in (*names, *SETTINGS)}
        self._real_names = [name for name in names if BY_NAME[name].kind == "Real"]
        self._integer_names = [name for name in names if BY_NAME[name].kind != "Real"]
        self._reals = (fmi2.fmi2Real * len(self._real_names))()
        self._integers = (fmi2.fmi2Integer * len(self._integer_names))()
        self._real_references = self._of(self._real_names)
        self._integer_references = self._of(self._integer_names)
        self._input_references, self._inputs = self._of(INPUTS), (fmi2.fmi2Real * len(INPUTS))()
        self._driven = [(i, name) for i, name in enumerate(INPUTS) if name in self._swept]
        self._warned_reference, self._warned = self._of(["warnings"]), (fmi2.fmi2Integer * 1)()
        read, points = self._plan.keep.read, len(self._plan.timeline.times)
        self._read_references = self._of(read)
        self._scratch = np.empty((points, len(read)))
        row = fmi2.fmi2Real * len(read)
        self._rows = [row.from_buffer(self._scratch, i * self._scratch.strides[0]) for i in range(points)]

    def _of(self, names: Any) -> Any:
        return (fmi2.fmi2ValueReference * len(names))(*(self._references[name] for name in names))

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
            self._messages.clear()
            try:
                with _interrupt_afterwards():
                    self._one(values)
            except Exception as error:  # fmpy raises plain exceptions
                ran.errors[i] = "; ".join(self._messages) or str(error)
                if getattr(error, "status", fmi2.fmi2Fatal) != fmi2.fmi2Error:
                    self._instantiate()  # the standard: nothing but freeing it is allowed
                continue
            ran.record[i] = self._scratch
            ran.warnings[i] = self._warned[0]
        return ran

    def _one(self, values: Mapping[str, float | int]) -> None:
        instance, timeline = self._instance, self._plan.timeline
        component, read = instance.component, len(self._plan.keep.read)
        if not self._new:
            instance.fmi2Reset(component)
        self._new = False
        self._start(instance, values)
        rows = iter(self._rows)
        if timeline.start_kept:
            instance.fmi2GetReal(component, self._read_references, read, next(rows))
        # fmpy's methods look the function up and its result over, in Python: here that would cost what the step costs
        do_step, get_real, references = instance.dll.fmi2DoStep, instance.dll.fmi2GetReal, self._read_references
        controls = None
        for time, end, wanted, kept in self._merged(settings_of(values)):
            if wanted is not controls and wanted != controls:
                self._put(wanted, values)
            controls = wanted
            if (status := do_step(component, time, end - time, 1)) > fmi2.fmi2Warning:
                raise FMICallException("fmi2DoStep", status)
            if kept and (status := get_real(component, references, read, next(rows))) > fmi2.fmi2Warning:
                raise FMICallException("fmi2GetReal", status)
        instance.fmi2GetInteger(component, self._warned_reference, 1, self._warned)

    def _start(self, instance: Any, values: Mapping[str, float | int]) -> None:
        run = self._plan.run
        instance.setupExperiment(startTime=run.start_time, stopTime=run.stop_time)
        if self._real_names:
            self._reals[:] = [values[name] for name in self._real_names]
            instance.fmi2SetReal(instance.component, self._real_references, len(self._reals), self._reals)
        if self._integer_names:
            self._integers[:] = [values[name] for name in self._integer_names]
            instance.fmi2SetInteger(instance.component, self._integer_references, len(self._integers), self._integers)
        instance.enterInitializationMode()
        self._put(self._plan.timeline.start, values)
        instance.exitInitializationMode()

    def _put(self, controls: Controls, values: Mapping[str, float | int]) -> None:
        self._inputs[:] = controls
        for i, name in self._driven:
            self._inputs[i] = values[name]
        self._instance.fmi2SetReal(self._instance.component, self._input_references, len(INPUTS), self._inputs)


@contextmanager
def _interrupt_afterwards() -> Iterator[None]:
    """A Ctrl-C waits for the end of a run: inside a Python FMU it would be the FMU's error, or end the process."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    seen = []
    before = signal.signal(signal.SIGINT, lambda *_: seen.append(True))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if seen:
            raise KeyboardInterrupt
