"""A run on an FMU: through fmpy's master, or step by step."""

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from math import isclose
from typing import Any

import fmpy
import numpy as np

from ..building import default_fmu
from ..fmu.interface import BY_NAME, HOVERCRAFT, INPUTS
from ..fmu.start_values import Value, start_value
from ..host import Fmu, Instance, SimulationError
from ..model.dynamics import Controls
from .planning import Inputs, Progress, Run, plan
from .result import Result


def simulate(
    scene_or_inputs: Inputs = "launch",
    fmu: str | os.PathLike[str] | None = None,
    *,
    preset: str | None = None,
    start_values: Mapping[str, Value] | None = None,
    start_time: float | None = None,
    stop_time: float | None = None,
    communication_step: float | None = None,
    progress: Progress | None = None,
) -> Result:
    """Run a scene, or inputs of your own, on the FMU.

    Args:
        scene_or_inputs: see `Inputs`.
        fmu: the file; without it the native FMU in build/ under the current folder, which is built if it is not there.
        preset, start_values, start_time, stop_time, communication_step: see `plan`.
        progress: see `Progress`.

    Raises:
        ValueError: an input, a name or a value that cannot be; FileNotFoundError: no such file.
        SimulationError: the FMU refused a value or a step, with its message; or the run ended early.
    """
    run = plan(
        scene_or_inputs, preset=preset, start_values=start_values, start_time=start_time, stop_time=stop_time,
        communication_step=communication_step,
    )  # fmt: skip
    return run_fmu(run, default_fmu() if fmu is None else fmu, progress)


def run_fmu(run: Run, fmu: str | os.PathLike[str], progress: Progress | None = None) -> Result:
    """Run on an FMU, through fmpy, with its logging on. Raises as `simulate` does."""

    def step_finished(time: float, _recorder: object) -> bool:
        if progress:
            progress(time)
        return True

    with Fmu(fmu, HOVERCRAFT.name) as opened, opened.instance() as craft, craft.driven_by_fmpy():
        run = run.on(own_starts(opened.description))
        shown = [v.name for v in opened.description.modelVariables if v.causality in ("input", "output", "local")]
        data = fmpy.simulate_fmu(
            opened.folder,
            model_description=opened.description,
            fmu_instance=craft.fmpy,
            start_time=run.start_time,
            stop_time=run.stop_time,
            output_interval=run.communication_step,
            start_values=dict(run.start_values),
            input=run.signals,
            output=shown,
            step_finished=step_finished,
        )
    if not isclose(data["time"][-1], run.stop_time):
        raise SimulationError(f"the run ended at {data['time'][-1]!r} s: must reach stop_time = {run.stop_time!r} s")
    return Result(np.asarray(data), run, tuple(craft.messages))


class Stepper:
    """An FMU that is taken from one communication point to the next by hand, with the calls of fmpy's master.

    So `run_fmu` over the same controls, a row a communication point, comes to the same bits. It raises
    SimulationError where the FMU refuses a call.
    """

    def __init__(self, craft: Instance, run: Run) -> None:
        self.messages = craft.messages
        """What the FMU has said since it was started."""
        self.port = craft.port
        """Of the FMU, to read from: see `Instance.port`."""
        self._craft, self._run, self._inputs = craft, run, craft.port(*INPUTS)
        self._steps = 0

    @property
    def time(self) -> float:
        """s: the communication point reached."""
        return self._point(self._steps)

    def _point(self, n: int) -> float:
        return self._run.start_time + n * self._run.communication_step

    def start(self, controls: Controls) -> None:
        """Initialize it, at the start time."""
        self._craft.set(self._run.start_values)
        self._craft.enter_initialization(self._run.start_time)
        self._inputs.set(controls)
        self._craft.exit_initialization()

    def restart(self, controls: Controls) -> None:
        """Back to the start."""
        self._craft.reset()
        self._steps = 0
        self.messages.clear()
        self.start(controls)

    def step(self, controls: Controls) -> None:
        """One communication step, with the controls held."""
        time = self.time
        self._inputs.set(controls)
        self._craft.step(time, self._point(self._steps + 1) - time)
        self._steps += 1


@contextmanager
def stepping(run: Run, fmu: str | os.PathLike[str]) -> Iterator[Stepper]:
    """An FMU to step by hand, not yet started. Raises as `simulate` does."""
    with Fmu(fmu, HOVERCRAFT.name) as opened, opened.instance() as craft:
        yield Stepper(craft, run.on(own_starts(opened.description)))


def own_starts(description: Any) -> dict[str, float | int]:
    """The start values of an FMU of the hovercraft that are its own, from fmpy's description."""
    given = {v.name: v.start for v in description.modelVariables if v.start is not None and v.name in BY_NAME}
    starts = {name: start_value(name, start) for name, start in given.items() if BY_NAME[name].start is not None}
    return {name: start for name, start in starts.items() if start != BY_NAME[name].start}
