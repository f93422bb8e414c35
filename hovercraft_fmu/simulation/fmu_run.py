"""A run on an FMU, as it was planned or step by step."""

import os
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

import numpy as np

from ..building import default_fmu
from ..fmu.interface import BY_NAME, HOVERCRAFT, INPUTS
from ..fmu.near_names import explains_keywords
from ..fmu.start_values import Value, start_value
from ..host import Fmu
from ..host.ramps import Ramps
from ..model.dynamics import Controls
from .planning import Inputs, Progress, Run, plan
from .points import Piece, ends, is_ramped
from .recording import recorded
from .result import Result


@explains_keywords
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

    Between communication points, too, inputs go as they were asked for: linear, with jumps and bends where these are.

    Args:
        scene_or_inputs: see `Inputs`.
        fmu: the file; without it the native FMU in build/ under the current folder, which is built if it is not there.
        preset, start_values, start_time, stop_time, communication_step: see `plan`.
        progress: see `Progress`.

    Raises:
        ValueError: an input, a name or a value that cannot be; FileNotFoundError: no such file.
        SimulationError: the FMU refused a value or a step, with its message.
    """
    run = plan(
        scene_or_inputs, preset=preset, start_values=start_values, start_time=start_time, stop_time=stop_time,
        communication_step=communication_step,
    )  # fmt: skip
    return run_fmu(run, default_fmu() if fmu is None else fmu, progress)


def run_fmu(run: Run, fmu: str | os.PathLike[str], progress: Progress | None = None) -> Result:
    """Run on an FMU, with its logging on. Raises as `simulate` does."""
    with stepping(run, fmu) as stepper:
        columns = list(_shown(stepper.description))
        seen = stepper.port(*(name for name, _ in columns))

        def go(piece: Piece) -> None:
            stepper.make(piece)
            if progress and piece.is_point:
                progress(piece.end)

        stepper.start(ends(stepper.run)[0], run.stop_time)
        result = recorded(stepper.run, columns, go, seen.get)
        return replace(result, warnings=tuple(stepper.messages))


TYPES = {"Float64": np.float64, "Real": np.float64, "Boolean": np.bool_}
"""Of the standards' types; the others are whole numbers."""


def _shown(description: Any) -> Iterator[tuple[str, Any]]:
    """Name and type of an FMU's inputs, outputs and local variables; the Reals first."""
    variables = [v for v in description.modelVariables if v.causality in ("input", "output", "local")]
    for variable in sorted(variables, key=lambda v: TYPES.get(v.type) is not np.float64):
        yield variable.name, TYPES.get(variable.type, np.int32)


class Stepper:
    """An FMU on its way through a run: piece by piece, or by hand from one communication point to the next.

    By hand and by `run_fmu` over the same controls, held, it comes to the same bits. It raises SimulationError where
    the FMU refuses a call.
    """

    def __init__(self, ramps: Ramps, run: Run) -> None:
        craft = ramps.craft
        self.messages = craft.messages
        """What the FMU has said since it was started."""
        self.port = craft.port
        """Of the FMU, to read from: see `Instance.port`."""
        self.description = craft.description
        """fmpy's."""
        self.run = run
        """With the start values that are the FMU's own."""
        self._craft, self._ramps = craft, ramps
        self._steps = 0

    @property
    def time(self) -> float:
        """s: the communication point reached by hand."""
        return self._point(self._steps)

    def _point(self, n: int) -> float:
        return self.run.start_time + n * self.run.communication_step

    def start(self, controls: Controls, stop_time: float | None = None) -> None:
        """Initialize it, at the start time."""
        self._craft.set(self.run.start_values)
        self._craft.enter_initialization(self.run.start_time, stop_time)
        self._ramps.inputs.set(controls)
        self._craft.exit_initialization()

    def restart(self, controls: Controls) -> None:
        """Back to the start."""
        self._craft.reset()
        self._steps = 0
        self.messages.clear()
        self.start(controls)

    def make(self, piece: Piece) -> None:
        """One piece of the run."""
        self._ramps.step(piece.time, piece.end, piece.first, piece.last)

    def step(self, controls: Controls) -> None:
        """One communication step, with the controls held."""
        self._ramps.step(self.time, self._point(self._steps + 1), controls, controls)
        self._steps += 1


@contextmanager
def stepping(run: Run, fmu: str | os.PathLike[str]) -> Iterator[Stepper]:
    """An FMU, not yet started. Raises as `simulate` does."""
    with Fmu(fmu, HOVERCRAFT.name) as opened, Ramps.on(opened, INPUTS, is_ramped(run)) as ramps:
        yield Stepper(ramps, run.on(own_starts(opened.description)))


def own_starts(description: Any) -> dict[str, float | int]:
    """The start values of an FMU of the hovercraft that are its own, from fmpy's description."""
    given = {v.name: v.start for v in description.modelVariables if v.start is not None and v.name in BY_NAME}
    starts = {name: start_value(name, start) for name, start in given.items() if BY_NAME[name].start is not None}
    return {name: start for name, start in starts.items() if start != BY_NAME[name].start}
