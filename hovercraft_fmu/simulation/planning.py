"""What a run needs, checked and completed: inputs, start values, times."""

import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from math import ceil, isfinite, ulp
from pathlib import Path
from typing import Any, Protocol, TypeAlias

import numpy as np
import psutil

from ..fmu.interface import BY_NAME, CRAFT_PARAMETERS, HOVERCRAFT, INPUTS, STATES
from ..fmu.near_names import explains_keywords
from ..fmu.start_values import Value
from ..fmu.start_values import start_values as numbers
from ..model.craft import PRESETS, Craft, preset
from ..model.dynamics import State
from ..model.integrators import integrator
from ..model.subcycling import Settings
from ..scenes import Scene, Signals, scene, signals
from .control_log import SHOWN, ControlLog, checked_signals, columns_as_signals, read_control_log


class Columns(Protocol):
    """Names and columns, `time` [s] among them: a dict, a DataFrame (whose index may be the time), or a `Result`."""

    def __getitem__(self, name: str, /) -> Any: ...


Function: TypeAlias = Callable[[float], Mapping[str, float]]
"""Of the time [s]: inputs by name. Taken at every communication point, linear in between."""
Inputs: TypeAlias = str | os.PathLike[str] | Scene | Signals | Columns | Function
"""A scene or its name; a CSV file (a name that ends in .csv); a structured array with `time` and input names; columns;
a function of time. Columns of outputs, which a result has, are passed over."""
Progress: TypeAlias = Callable[[float], None]
"""Called with the time [s] reached, after every communication step."""

PRESET_PARAMETERS = tuple(
    name for name in CRAFT_PARAMETERS if len({getattr(craft, name) for craft in PRESETS.values()}) > 1
)
"""In which presets differ."""
MAX_STEPS = 10**8
"""Communication steps of a run: a year at 0.3 s, or a slip of the decimal point."""


NUMBER = 24
"""Bytes of one at the end of a run: 8 as it was recorded, 8 in all rows, 8 in those of communication points."""


class MistakesError(ValueError):
    """Several things are wrong: one a line."""

    def __init__(self, mistakes: Iterable[str]) -> None:
        self.mistakes = tuple(mistakes)
        super().__init__("\n".join(self.mistakes))


def method_in_words(integrator: str, step_size: float, tolerance: float) -> str:
    """'rk4, 0.1 s'; of the adaptive method it is the tolerance that drives the accuracy."""
    return f"{integrator}, " + (f"tolerance {tolerance:g}" if integrator == "adaptive" else f"{step_size:g} s")


@dataclass(frozen=True)
class Run:
    """All that one run needs, checked."""

    title: str
    signals: Signals
    start_values: Mapping[str, float | int]
    start_time: float
    """s"""
    stop_time: float
    """s"""
    communication_step: float
    """s"""
    own: Mapping[str, float | int] = field(default_factory=dict)
    """Start values that the FMU has of its own."""
    held: tuple[str, ...] = ()
    """Inputs that hold their start value: nothing was said of them."""
    cut: bool = False
    """Whether the inputs are the record of a drive whose end is missing."""
    unused: tuple[str, ...] = ()
    """Columns of the inputs' file that are passed over."""
    begins: tuple[tuple[str, float], ...] = ()
    """The states in its first row, where it has them."""

    def on(self, own: Mapping[str, float | int]) -> "Run":
        """The same on an FMU with start values of its own: they hold where the run sets nothing else."""
        table = self.signals.copy()
        for name in self.held:
            table[name] = own.get(name, table[name])
        return replace(self, own=own, signals=table)

    @property
    def craft(self) -> Craft:
        """The craft at the start. Raises ValueError where a parameter is impossible."""
        values: dict[str, Any] = {name: self.value(name) for name in CRAFT_PARAMETERS}
        return Craft(**values)

    @property
    def settings(self) -> Settings:
        """Sub-step and method."""
        method = integrator(int(self.value("integrator")))
        return Settings(float(self.value("step_size")), method, float(self.value("tolerance")))

    @property
    def method(self) -> str:
        """The method and what drives its accuracy, in words."""
        settings = self.settings
        return method_in_words(settings.integrator.name, settings.step_size, settings.tolerance)

    @property
    def start(self) -> State:
        """The state at the start."""
        return State(*(float(self.value(name)) for name in STATES))

    def value(self, name: str) -> float | int:
        """The start value of a variable."""
        default = self.own.get(name, BY_NAME[name].start)
        return self.start_values.get(name, 0.0 if default is None else default)


@explains_keywords
def plan(
    scene_or_inputs: Inputs = "launch",
    *,
    preset: str | None = None,
    start_values: Mapping[str, Value] | None = None,
    start_time: float | None = None,
    stop_time: float | None = None,
    communication_step: float | None = None,
) -> Run:
    """Check and complete what a run needs.

    Args:
        scene_or_inputs: see `Inputs`.
        preset: name of a craft; a scene has its own.
        start_values: of parameters, inputs and states, by their names in the FMU; they come after the preset's. Not of
            inputs that have a column: they would have no effect.
        start_time, stop_time: s; by default the first and the last time of the inputs.
        communication_step: s; by default the scene's, else 0.01 s.

    Raises:
        ValueError: names the argument, the value and the rule.
    """
    chosen = _scene(scene_or_inputs)
    if callable(scene_or_inputs):
        scene_or_inputs = sampled(scene_or_inputs, start_time, stop_time, communication_step)
    log = _log(chosen, scene_or_inputs)
    table = log.table
    given = numbers(start_values or {})
    title = _title(chosen, scene_or_inputs)
    check_effect(given, table.dtype.names or (), title)
    values = _scene_values(chosen, preset) | given
    first, last = float(table["time"][0]), float(table["time"][-1])
    if len(table) == 1:
        last = first + HOVERCRAFT.stop_time
    default_step = chosen.communication_step if chosen else HOVERCRAFT.communication_step
    run = Run(
        title=title,
        signals=_completed(table, values),
        start_values=values,
        start_time=first if start_time is None else start_time,
        stop_time=last if stop_time is None else stop_time,
        communication_step=default_step if communication_step is None else communication_step,
        held=tuple(name for name in INPUTS if name not in (table.dtype.names or ()) and name not in values),
        cut=log.cut,
        unused=log.unused,
        begins=log.begins if start_time in (None, first) else (),
    )
    _check_times(run)
    return run


def _scene(scene_or_inputs: Inputs) -> Scene | None:
    if isinstance(scene_or_inputs, Scene):
        return scene_or_inputs
    if isinstance(scene_or_inputs, str) and not scene_or_inputs.endswith(".csv"):
        return scene(scene_or_inputs)
    return None


def _title(chosen: Scene | None, scene_or_inputs: Inputs) -> str:
    if chosen:
        return chosen.name
    return Path(scene_or_inputs).name if isinstance(scene_or_inputs, str | os.PathLike) else "inputs"


def _log(chosen: Scene | None, source: Any) -> ControlLog:
    if chosen:
        return ControlLog(chosen.signals, False)
    if isinstance(source, str | os.PathLike):
        return read_control_log(source)
    if isinstance(source, np.ndarray) and source.dtype.names:
        return ControlLog(checked_signals(source, "inputs"), False)
    if hasattr(source, "keys") or hasattr(source, "columns"):
        return ControlLog(columns_as_signals(source), False)
    raise ValueError(
        f"inputs = {type(source).__name__}: must be a scene, a CSV file, a structured array, columns (a dict, a "
        "DataFrame, a Result) or a function of time"
    )


def sampled(function: Function, start: float | None, stop: float | None, step: float | None) -> Signals:
    """The inputs that a function of time gives at every communication point [s]; by default as an FMU alone is run.

    Raises ValueError as `plan` does, and for what is no mapping of inputs.
    """
    start, stop = 0.0 if start is None else start, HOVERCRAFT.stop_time if stop is None else stop
    step = HOVERCRAFT.communication_step if step is None else step
    if mistakes := list(_mistakes(start, stop, step)):
        raise MistakesError(mistakes)
    check_steps(start, stop, step, 1 + len(INPUTS))
    times = np.append(start + step * np.arange(ceil((stop - start) / step)), stop)
    values = [function(float(time)) for time in times]
    if wrong := [each for each in values if not isinstance(each, Mapping) or each.keys() != values[0].keys()]:
        raise ValueError(f"inputs: a function must give the same inputs by name at every time, and gave {wrong[0]!r}")
    return columns_as_signals({"time": times, **{name: [each[name] for each in values] for name in values[0]}})


def _completed(table: Signals, values: Mapping[str, float | int]) -> Signals:
    """All inputs have a column, so that none is left to chance: what is not given holds its start value."""
    columns = []
    for name in INPUTS:
        given = name in (table.dtype.names or ())
        columns.append(table[name] if given else np.full(len(table), values.get(name, BY_NAME[name].start)))
    return signals(zip(table["time"], *columns, strict=True))


def _scene_values(chosen: Scene | None, preset_name: str | None) -> dict[str, float | int]:
    """What a scene and a preset set, by FMU names; only what differs from the usual start values. Of a preset that was
    asked for also what is usual but not in every preset: the FMU may have been made of another one.
    """
    craft = preset(preset_name or (chosen.preset if chosen else "textbook"))
    values: dict[str, float | int] = {name: getattr(craft, name) for name in CRAFT_PARAMETERS}
    if chosen:
        values |= chosen.parameters
        values |= dict(zip(STATES, chosen.start, strict=True))
    asked = {name for name in values if preset_name and name in PRESET_PARAMETERS}
    return {name: value for name, value in values.items() if name in asked or value != BY_NAME[name].start}


def check_effect(values: Mapping[str, object], driven: Iterable[str], title: str, where: str = "") -> None:
    """Raises ValueError where a start value is that of an input which the scene, or the log, drives; all of them."""
    idle = [
        f"{where}{name} = {value!r}: must be an input that {title} leaves alone: its start value has no effect"
        for name, value in values.items()
        if name in driven
    ]
    if idle:
        raise MistakesError(idle)


def _check_times(run: Run) -> None:
    mistakes = list(_mistakes(run.start_time, run.stop_time, run.communication_step))
    if mistakes:
        raise MistakesError(mistakes)
    check_steps(run.start_time, run.stop_time, run.communication_step, 1 + len(SHOWN))


def _mistakes(start: float, stop: float, step: float) -> Iterator[str]:
    for name, value in (("start_time", start), ("stop_time", stop), ("communication_step", step)):
        if isinstance(value, bool) or not isfinite(value):
            yield f"{name} = {value!r} s: must be a finite number"
    if isfinite(step) and not step > 0.0:
        yield f"communication_step = {step!r} s: must be greater than 0"
    if isfinite(start) and isfinite(stop) and not stop > start:
        yield f"stop_time = {stop!r} s: must be after start_time = {start!r} s"


def check_steps(start: float, stop: float, step: float, columns: int) -> None:
    """Raises ValueError where communication steps cannot be meant, or their result does not fit into the memory.

    Args:
        start, stop, step: s
        columns: of the result.
    """
    steps = (stop - start) / step
    if steps > MAX_STEPS:
        raise ValueError(
            f"communication_step = {step!r} s: must not make more than 10^8 steps from {start!r} s to {stop!r} s; "
            f"it makes {steps:.3g}"
        )
    late = max(start, stop, key=abs)
    if step < ulp(late):
        raise ValueError(
            f"communication_step = {step!r} s: must not be less than what a double can tell at {late!r} s, "
            f"{ulp(late)!r} s"
        )
    size, available = (ceil(steps) + 1) * columns * NUMBER, psutil.virtual_memory().available
    if size > available:
        raise ValueError(
            f"communication_step = {step!r} s: the result of {ceil(steps)} steps, {columns} numbers of {NUMBER} bytes "
            f"each, must fit into the memory that is free; it takes {size / 1e9:.3g} GB of {available / 1e9:.3g} GB"
        )
