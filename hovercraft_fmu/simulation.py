"""Runs a scene on an FMU, through fmpy, or on the bare model; one kind of result."""

import ast
import itertools
import os
import re
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from math import isclose, isfinite
from pathlib import Path
from typing import Any, TypeAlias, cast

import fmpy
import fmpy.simulation
import fmpy.util
import numpy as np
from fmpy import fmi2, fmi3
from numpy.typing import NDArray

from .fmu.interface import ACTION, BY_NAME, CRAFT_PARAMETERS, HOVERCRAFT, INPUTS, MOTION, STATES, SUBSTEPS_MAX, WATCHED
from .fmu.python_package import build_fmu
from .fmu.variable import Enumeration
from .host import SimulationError
from .model.craft import Craft, preset
from .model.dynamics import Controls, State
from .model.integrators import integrator
from .model.observation import observe_action, observe_motion
from .model.subcycling import Settings, advance, stability_number
from .scenes import Scene, Signals, scene, signals

Value: TypeAlias = float | int | str
"""Of a variable; an item of an enumeration may be given by its name."""
Inputs: TypeAlias = str | os.PathLike[str] | Scene | Signals
"""A scene or its name; a CSV file (a name that ends in .csv); a structured array with `time` and input names."""
Progress: TypeAlias = Callable[[float], None]
"""Called with the time [s] reached, after every communication step."""

VERSIONS = ("2.0", "3.0")
"""Of FMI, that are run here."""
DEFAULT_FMU = Path("build") / f"{HOVERCRAFT.name}.fmu"


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
        default = BY_NAME[name].start
        return self.start_values.get(name, 0.0 if default is None else default)


@dataclass(frozen=True)
class Result:
    """What a run gave: `result["time"]`, `result["pose.x"]`, ..., one value a communication point, shape (n,)."""

    data: NDArray[np.void]
    run: Run
    warnings: tuple[str, ...] = ()
    """What the FMU said that did not end the run."""

    def __getitem__(self, name: str) -> NDArray[Any]:
        if name not in self.names:
            raise ValueError(f"column = {name!r}: must be one of {', '.join(self.names)}")
        return self.data[name]

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the columns; the first is `time` [s], the others are variables of the FMU."""
        return self.data.dtype.names or ()

    @property
    def distance(self) -> float:
        """m: length of the path from communication point to communication point."""
        return path_length(self["pose.x"], self["pose.y"])

    def write_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write all columns as CSV, with all digits. Raises OSError where that cannot be done."""
        return write_csv(self.data, path)


def path_length(x: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """m: of a polyline."""
    return float(np.hypot(np.diff(x), np.diff(y)).sum())


def write_csv(data: NDArray[np.void], path: str | os.PathLike[str]) -> Path:
    """Write a structured array as CSV, with all digits; its folder is made."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    fmpy.util.write_csv(path, data)
    return path


def simulate(
    scene_or_inputs: Inputs = "launch",
    fmu: str | os.PathLike[str] | None = None,
    *,
    progress: Progress | None = None,
    **options: Any,
) -> Result:
    """Run a scene, or inputs of your own, on the FMU.

    Args:
        scene_or_inputs: see `Inputs`.
        fmu: the file; without it build/Hovercraft.fmu under the current folder, which is built if it is not there.
        progress: see `Progress`.
        options: see `plan`: preset, start_values, start_time, stop_time, communication_step.

    Raises:
        ValueError: an input, a name or a value that cannot be; FileNotFoundError: no such file.
        SimulationError: the FMU refused a value or a step, with its message; or the run ended early.
    """
    run = plan(scene_or_inputs, **options)
    return run_fmu(run, default_fmu() if fmu is None else fmu, progress)


def default_fmu() -> Path:
    """build/Hovercraft.fmu under the current folder, which is built if it is not there."""
    return DEFAULT_FMU if DEFAULT_FMU.exists() else build_fmu(DEFAULT_FMU)


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
        start_values: of parameters, inputs and states, by their names in the FMU; they come after the preset's.
        start_time, stop_time: s; by default the first and the last time of the inputs.
        communication_step: s; by default the scene's, else 0.01 s.

    Raises:
        ValueError: names the argument, the value and the rule.
    """
    chosen = _scene(scene_or_inputs)
    table = chosen.signals if chosen else _signals(cast("str | os.PathLike[str] | Signals", scene_or_inputs))
    values = _scene_values(chosen, preset) | _start_values(start_values or {})
    first, last = float(table["time"][0]), float(table["time"][-1])
    if len(table) == 1:
        last = first + HOVERCRAFT.stop_time
    default_step = chosen.communication_step if chosen else HOVERCRAFT.communication_step
    run = Run(
        title=_title(chosen, scene_or_inputs),
        signals=_completed(table, values),
        start_values=values,
        start_time=first if start_time is None else start_time,
        stop_time=last if stop_time is None else stop_time,
        communication_step=default_step if communication_step is None else communication_step,
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
    return "inputs" if isinstance(scene_or_inputs, np.ndarray) else Path(cast(str, scene_or_inputs)).name


def _signals(source: str | os.PathLike[str] | Signals) -> Signals:
    if isinstance(source, np.ndarray):
        return _checked(source, "inputs")
    return read_inputs(source)


def read_inputs(path: str | os.PathLike[str]) -> Signals:
    """Read a control log: a CSV file in fmpy's format, with the columns `time` and names of inputs.

    Raises:
        FileNotFoundError: no such file.
        ValueError: names the file and what is wrong in it.
    """
    try:
        table = fmpy.util.read_csv(path)
    except (ValueError, IndexError) as error:
        raise ValueError(f"{path}: must be a CSV file with a header and rows of as many numbers; {error}") from error
    return _checked(table, str(path))


def _checked(table: Signals, source: str) -> Signals:
    names = table.dtype.names or ()
    if not names or names[0] != "time" or len(table) == 0:
        raise ValueError(f"{source}: the first column must be 'time', with at least one row; the columns are {names}")
    for name in names[1:]:
        if name not in INPUTS:
            raise ValueError(f"{source}: column {name!r} must be an input: {', '.join(INPUTS)}")
    for name in names:
        for row, value in enumerate(table[name], 1):
            if not isfinite(value):
                raise ValueError(f"{source}: {name} = {value} in row {row}: must be a finite number")
    back = np.flatnonzero(np.diff(table["time"]) < 0.0)
    if back.size:
        row = int(back[0]) + 2
        raise ValueError(f"{source}: time = {table['time'][row - 1]} in row {row}: must not go back")
    return table


def _completed(table: Signals, values: Mapping[str, float | int]) -> Signals:
    """All inputs have a column, so that none is left to chance: what is not given holds its start value."""
    columns = []
    for name in INPUTS:
        given = name in (table.dtype.names or ())
        columns.append(table[name] if given else np.full(len(table), values.get(name, BY_NAME[name].start)))
    return signals(zip(table["time"], *columns, strict=True))


def _scene_values(chosen: Scene | None, preset_name: str | None) -> dict[str, float | int]:
    """What a scene and a preset set, by FMU names; only what differs from the FMU's own start values."""
    craft = preset(preset_name or (chosen.preset if chosen else "textbook"))
    values: dict[str, float | int] = {name: getattr(craft, name) for name in CRAFT_PARAMETERS}
    if chosen:
        values |= chosen.parameters
        values |= dict(zip(STATES, chosen.start, strict=True))
    return {name: value for name, value in values.items() if value != BY_NAME[name].start}


def _start_values(given: Mapping[str, Value]) -> dict[str, float | int]:
    values = {name: start_value(name, value) for name, value in given.items()}
    for name, beside in HOVERCRAFT.choices.items():  # from here on the Enumeration alone says it
        if beside.name in values:
            number = int(values.pop(beside.name))
            HOVERCRAFT.check_choice(name, number)
            values[name] = HOVERCRAFT.chosen(name, int(values.get(name, BY_NAME[name].start or 0)), number)
    return values


def start_value(name: str, value: Value) -> float | int:
    """The value as a number of the variable's type; an item of an enumeration may be given by name.

    Raises:
        ValueError: no such variable, one that cannot be set, or not a number.
    """
    variable = BY_NAME.get(name)
    if variable is None or variable.start is None:
        settable = ", ".join(each.name for each in BY_NAME.values() if each.start is not None)
        raise ValueError(f"{name} = {value}: must be a variable that can be set: {settable}")
    try:
        if variable.kind == "Real":
            return float(value)
        if variable.enumeration and isinstance(value, str) and not value.isdigit():
            return _item(name, value, variable.enumeration)
        return int(value)
    except (TypeError, ValueError) as error:
        if variable.enumeration and isinstance(value, str):
            raise
        raise ValueError(f"{name} = {value!r}: must be a number") from error


def _item(name: str, value: str, enumeration: Enumeration) -> int:
    number = enumeration.number(value)
    if number is None:
        raise ValueError(f"{name} = {value!r}: must be one of {', '.join(item for item, _ in enumeration.items)}")
    return number


def _check_times(run: Run) -> None:
    for name in ("start_time", "stop_time", "communication_step"):
        value = getattr(run, name)
        if not isfinite(value):
            raise ValueError(f"{name} = {value!r} s: must be a finite number")
    if not run.communication_step > 0.0:
        raise ValueError(f"communication_step = {run.communication_step!r} s: must be greater than 0")
    if not run.stop_time > run.start_time:
        raise ValueError(f"stop_time = {run.stop_time!r} s: must be after start_time = {run.start_time!r} s")


# ---- on the FMU


def run_fmu(run: Run, fmu: str | os.PathLike[str], progress: Progress | None = None) -> Result:
    """Run on an FMU, through fmpy, with its logging on. Raises as `simulate` does."""
    messages: list[str] = []

    def step_finished(time: float, _recorder: object) -> bool:
        if progress:
            progress(time)
        return True

    with loaded(fmu, messages) as (folder, instance, description), _refusals(messages):
        data = fmpy.simulate_fmu(
            folder,
            model_description=description,
            fmu_instance=instance,
            start_time=run.start_time,
            stop_time=run.stop_time,
            output_interval=run.communication_step,
            start_values=dict(run.start_values),
            input=run.signals,
            output=[v.name for v in description.modelVariables if v.causality in ("input", "output", "local")],
            step_finished=step_finished,
        )
    if not isclose(data["time"][-1], run.stop_time):
        raise SimulationError(f"the run ended at {data['time'][-1]!r} s: must reach stop_time = {run.stop_time!r} s")
    return Result(np.asarray(data), run, tuple(messages))


class Stepper:
    """An FMU that is taken from one communication point to the next by hand, with the calls of fmpy's master.

    So `run_fmu` over the same controls, a row a communication point, comes to the same bits.
    """

    def __init__(self, instance: Any, description: Any, run: Run, messages: list[str]) -> None:
        self.messages = messages
        """What the FMU has said since it was started."""
        self._instance, self._description, self._run = instance, description, run
        self._steps = 0

    @property
    def time(self) -> float:
        """s: the communication point reached."""
        return self._point(self._steps)

    def _point(self, n: int) -> float:
        return self._run.start_time + n * self._run.communication_step

    def start(self, controls: Controls) -> None:
        """Initialize it, at the start time. Raises SimulationError: the FMU refused a start value."""
        with _refusals(self.messages):
            left = dict(self._run.start_values)
            left = self._apply(left, fmpy.simulation.settable_in_instantiated)
            enter_initialization(self._instance, self._run.start_time)
            self._apply(left, fmpy.simulation.settable_in_initialization_mode)
            self._set(controls)
            self._instance.exitInitializationMode()

    def restart(self, controls: Controls) -> None:
        """Back to the start. Raises as `start` does."""
        self._instance.reset()
        self._steps = 0
        self.messages.clear()
        self.start(controls)

    def step(self, controls: Controls) -> None:
        """One communication step, with the controls held. Raises SimulationError: the FMU refused it."""
        time = self.time
        with _refusals(self.messages):
            self._set(controls)
            self._instance.doStep(time, self._point(self._steps + 1) - time)
        self._steps += 1

    def read(self, *names: str) -> list[float]:
        """The values of variables of the kind Real. Raises SimulationError: one is no finite number."""
        with _refusals(self.messages):
            return get_reals(self._instance, [BY_NAME[name].reference for name in names])

    def _apply(self, values: dict[str, float | int], settable: Callable[[Any], bool]) -> dict[str, float | int]:
        """Set those that can be set now; return the others."""
        left: dict[str, float | int] = fmpy.simulation.apply_start_values(
            self._instance, self._description, values, settable=settable
        )
        return left

    def _set(self, controls: Controls) -> None:
        set_reals(self._instance, [BY_NAME[name].reference for name in INPUTS], controls)


def is_fmi_3(instance: Any) -> bool:
    """Whether an instance of fmpy's is of FMI 3.0; else it is of FMI 2.0."""
    return isinstance(instance, (fmi3.FMU3Slave, fmi3.FMU3Model))


def enter_initialization(instance: Any, start_time: float = 0.0) -> None:
    """With the start time [s], which FMI 2.0 has a call of its own for."""
    if is_fmi_3(instance):
        instance.enterInitializationMode(startTime=start_time)
    else:
        instance.setupExperiment(startTime=start_time)
        instance.enterInitializationMode()


def set_reals(instance: Any, references: Sequence[int], values: Sequence[float]) -> None:
    """Set variables of the kind Real."""
    (instance.setFloat64 if is_fmi_3(instance) else instance.setReal)(references, values)


def get_reals(instance: Any, references: Sequence[int]) -> list[float]:
    """The values of variables of the kind Real."""
    return list((instance.getFloat64 if is_fmi_3(instance) else instance.getReal)(references))


@contextmanager
def stepping(run: Run, fmu: str | os.PathLike[str]) -> Iterator[Stepper]:
    """An FMU to step by hand, not yet started. Raises as `simulate` does."""
    messages: list[str] = []
    with loaded(fmu, messages) as (_, instance, description):
        yield Stepper(instance, description, run, messages)


@contextmanager
def loaded(
    fmu: str | os.PathLike[str], messages: list[str], model: str = HOVERCRAFT.name, versions: Sequence[str] = VERSIONS
) -> Iterator[tuple[str, Any, Any]]:
    """The folder an FMU is extracted to, an instance in it, its description.

    Raises:
        FileNotFoundError: no such file; ValueError, SimulationError: see `read_description`, `instantiated`.
    """
    path = Path(fmu)
    if not path.is_file():
        raise FileNotFoundError(f"{path}: no such FMU; 'hovercraft-fmu build' writes build/{model}.fmu")
    description = read_description(path, model=model, versions=versions)
    with instantiated(path, description, messages) as (folder, instance):
        yield folder, instance, description


@contextmanager
def _refusals(messages: list[str]) -> Iterator[None]:
    """What the FMU said meanwhile is the message of the error."""
    said = len(messages)
    try:
        yield
    except Exception as error:
        raise SimulationError("; ".join(messages[said:]) or str(error)) from error


def read_description(
    path: Path, validate: bool = True, model: str | None = None, versions: Sequence[str] = VERSIONS
) -> Any:
    """fmpy's model description.

    Raises:
        ValueError: the file is no FMU, its description is not valid, or it is of another model than the given one, or
            of another version of FMI than these.
    """
    try:
        description = fmpy.read_model_description(path, validate=validate)
    except Exception as error:  # a bad archive, bad XML, a bad description: fmpy raises many kinds
        raise ValueError(f"{path}: must be an FMU with a valid model description; {error}") from error
    if description.fmiVersion not in versions or description.coSimulation is None:
        raise ValueError(f"{path}: must be an FMU for co-simulation, FMI {' or '.join(versions)}")
    if model and description.modelName != model:
        raise ValueError(f"{path}: is an FMU of the model {description.modelName!r}: must be of {model!r}")
    return description


MESSAGES: dict[bytes, list[str]] = {}
"""Instance name -> where its messages go."""
INSTANCES = itertools.count(1)


def _log(_environment: object, name: bytes, status: int, _category: bytes, message: bytes) -> None:
    if status and name in MESSAGES:
        MESSAGES[name].append(plain(message.decode(errors="replace")))


def _log_3(name: bytes, environment: object, status: int, category: bytes, message: bytes) -> None:
    _log(environment, name, status, category, message)


def _callbacks() -> Any:
    callbacks = fmi2.fmi2CallbackFunctions()
    callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(_log)
    callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
    callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
    return callbacks


CALLBACKS = _callbacks()
"""Of all instances. fmpy's own way to a logger keeps one for the whole process, and calls it when it is long gone."""


@contextmanager
def instantiated(
    path: Path, description: Any, messages: list[str], exchange: bool = False
) -> Iterator[tuple[str, Any]]:
    """The folder an FMU is extracted to and an instance in it; both are gone afterwards.

    For co-simulation, or for model exchange. Logging is on, into `messages`: without it pythonfmu's wrapper keeps its
    messages, even of errors, to itself.

    Raises:
        SimulationError: the FMU cannot be loaded or instantiated.
    """
    interface = description.modelExchange if exchange else description.coSimulation
    if interface is None:
        raise SimulationError(f"{path}: must be an FMU for {'model exchange' if exchange else 'co-simulation'}")
    name = f"{interface.modelIdentifier} {next(INSTANCES)}"
    MESSAGES[name.encode()] = messages
    try:
        with tempfile.TemporaryDirectory(prefix="hovercraft_fmu_") as folder:
            fmpy.extract(path, unzipdir=folder)
            try:
                instance = _instance(folder, description, name, exchange)
            except Exception as error:  # fmpy raises plain exceptions here
                raise SimulationError("; ".join(messages) or f"{path}: {error}") from error
            try:
                yield folder, instance
            finally:
                instance.freeInstance()
    finally:
        del MESSAGES[name.encode()]


def _instance(folder: str, description: Any, name: str, exchange: bool) -> Any:
    """fmpy's, of either standard; what it says goes to MESSAGES."""
    interface = description.modelExchange if exchange else description.coSimulation
    arguments = {
        "guid": description.guid,
        "unzipDirectory": folder,
        "modelIdentifier": interface.modelIdentifier,
        "instanceName": name,
    }
    if description.fmiVersion == "2.0":
        instance = (fmi2.FMU2Model if exchange else fmi2.FMU2Slave)(**arguments)
        instance.instantiate(callbacks=CALLBACKS, loggingOn=True)
    else:  # fmpy hands no environment on: the callback knows the name itself
        instance = (fmi3.FMU3Model if exchange else fmi3.FMU3Slave)(**arguments)
        instance.instantiate(logMessage=partial(_log_3, name.encode()), loggingOn=True)
    return instance


def plain(message: str) -> str:
    """What a message of pythonfmu's wrapper says, without the call and the kind of exception around it."""
    last = message.strip().splitlines()[-1] if message.strip() else message
    match = re.fullmatch(r"\w+\((?P<text>['\"].*['\"]),?\)", last)
    return str(ast.literal_eval(match["text"])) if match else message.strip()


# ---- on the bare model


def run_model(run: Run) -> Result:
    """Run on the bare model, with the communication points and the inputs that fmpy would give the FMU.

    Raises:
        ValueError, NonFiniteError: as the model does.
    """
    craft, settings, state = run.craft, run.settings, run.start
    controls = controls_at(run, run.start_time, after_event=False)
    count, stability, rotation, proposed = 0, 0.0, 0.0, 0.0

    def row(time: float) -> tuple[float, ...]:
        seen = (*observe_motion(state), *observe_action(state, controls, craft))
        return time, *controls, *state, *seen, stability, rotation, count

    rows = [row(run.start_time)]
    for time, end, controls in schedule(run):
        stretch = advance(state, controls, craft, end - time, settings, proposed=proposed)
        state, proposed = stretch.state, stretch.proposed
        stability = max(stability, stability_number(stretch.drag_mass, stretch.rotation, craft))
        rotation = max(rotation, stretch.rotation)
        count = min(count + stretch.substeps, SUBSTEPS_MAX)
        rows.append(row(end))
    names = ("time", *INPUTS, *STATES, *MOTION, *ACTION, *WATCHED)
    return Result(np.array(rows, dtype=[*((name, np.float64) for name in names), ("substeps", np.int32)]), run)


def controls_at(run: Run, time: float, after_event: bool) -> Controls:
    """The inputs at a time [s], as fmpy's master interpolates them; at a jump, those before it or after it."""
    times = run.signals["time"]
    table = np.stack([run.signals[name] for name in INPUTS])
    values, _ = fmpy.simulation.Input.interpolate(time, times, table, after_event=after_event)
    return Controls(*(float(value) for value in np.ravel(values)))


def schedule(run: Run) -> Iterator[tuple[float, float, Controls]]:
    """(start, end) [s] of every communication step, and the controls that hold in it, as fmpy's master sets them."""
    for time, end in communication_points(run):
        yield time, end, controls_at(run, time, after_event=True)


def communication_points(run: Run) -> Iterator[tuple[float, float]]:
    """(start, end) [s] of every communication step, as fmpy's master takes them: a jump in the inputs is one, too."""
    times = run.signals["time"]
    jumps = times[np.flatnonzero(np.diff(times) == 0.0)]
    time, regular = run.start_time, 0
    while not (time > run.stop_time or isclose(time, run.stop_time)):
        next_regular = run.start_time + (regular + 1) * run.communication_step
        ahead = [float(jump) for jump in jumps if jump > time and not isclose(jump, time)]
        end = next_regular
        if ahead and end > ahead[0] and not isclose(end, ahead[0]):
            end = ahead[0]
        if end > run.stop_time and not isclose(end, run.stop_time):
            end = run.stop_time
        yield time, end
        time = end
        regular += isclose(time, next_regular)
