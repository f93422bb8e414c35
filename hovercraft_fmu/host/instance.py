"""The class that drives an instance of an FMU, of FMI 2.0 or 3.0, for co-simulation or model exchange."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from ctypes import byref, c_bool, c_double, c_int
from functools import cached_property
from types import TracebackType
from typing import Any, NamedTuple

from fmpy import fmi2, fmi3
from numpy.typing import NDArray

from ..stopping import called_back
from .messages import CALLBACKS_2, WARNING, Log

FATAL = 4
STATUS = ("OK", "Warning", "Discard", "Error", "Fatal", "Pending")


class SimulationError(RuntimeError):
    """What the FMU or the master refused or ended; the message is the FMU's own."""


class Events(NamedTuple):
    """What came of event mode."""

    again: bool
    """Whether the discrete states must be updated once more."""
    ends: bool
    """Whether the FMU asks to end."""
    nominals_changed: bool
    states_changed: bool
    timed: bool
    """Whether the next event has a time."""
    time: float
    """s, of the next event, where it is timed"""


class Intermediate(NamedTuple):
    """Inputs that change inside a step: an FMU of FMI 3.0 asks for them wherever it works out its loads.

    A solver that tries steps again may ask for a time that is earlier than the last one.
    """

    names: Sequence[str]
    values: Callable[[float], Sequence[float] | None]
    """Time [s] -> a value for each of the names; None leaves them. What it raises the step raises, when it is done."""


class Instance:
    """An instance of an FMU: start values by name, initialization, steps, groups of variables, states.

        with Fmu("build/HovercraftNative.fmu") as fmu, fmu.instance() as craft:
            controls, pose = craft.port("thrust", "port_thruster"), craft.port("pose.x", "pose.y", "substeps")
            craft.start({"mass": 200.0, "integrator": "rk4"})   # and `craft.reset()` before the next start
            for k in range(100):
                controls.set([10.0, 0.5])
                craft.step(0.1 * k, 0.1)
                print(pose.get(), craft.messages)

    Names, types and enumerations are the FMU's own description's, so any model can be driven. References and arrays
    are made once, with a `Port`; what costs here beside the FMU's own code is one Python call. In initialization,
    between the two halves of `start`, ports can be set and read, too:

        craft.set({"mass": 200.0})
        craft.enter_initialization(start_time=10.0)
        controls.set([10.0, 0.5])
        craft.exit_initialization()

    For model exchange (`fmu.instance(exchange=True)`) `start` ends in event mode; then

        solved.update_discrete_states()
        solved.enter_continuous_time_mode()
        x = solved.state_array()
        solved.set_time(0.1)
        solved.set_states(x, len(x)); solved.get_derivatives(x, len(x))   # arrays, or a solver's pointers

    An FMU of FMI 3.0 takes inputs inside a step, too:

        fmu.instance(intermediate=Intermediate(["thrust"], lambda t: [5.0 + 4.0 * sin(t)]))

    Raises, all methods:
        SimulationError: the FMU refused the call, with its message. After an error `reset` leads back, after a fatal
            one, too: then the instance is made anew.
    """

    def __init__(self, description: Any, folder: str, exchange: bool, intermediate: Intermediate | None = None) -> None:
        use = description.modelExchange if exchange else description.coSimulation
        if use is None:
            wanted = "model exchange" if exchange else "co-simulation"
            raise SimulationError(f"{description.modelName}: must be an FMU for {wanted}")
        self.description = description
        """fmpy's."""
        self.is_fmi_3: bool = description.fmiVersion == "3.0"
        self._variables = {variable.name: variable for variable in description.modelVariables}
        self._log = Log(use.modelIdentifier)
        self.messages = self._log.messages
        """What the FMU has said, warnings and refusals; whoever reads it may clear it."""
        self._fatal = False
        self._intermediate = intermediate
        self._raised: BaseException | None = None  # inside a step
        if intermediate and (exchange or not getattr(use, "providesIntermediateUpdate", False)):
            raise ValueError(
                f"{description.modelName}: must be an FMU of FMI 3.0 for co-simulation that takes inputs inside a step"
            )
        kinds = (fmi3.FMU3Slave, fmi3.FMU3Model) if self.is_fmi_3 else (fmi2.FMU2Slave, fmi2.FMU2Model)
        arguments = {"guid": description.guid, "unzipDirectory": folder, "modelIdentifier": use.modelIdentifier}
        self.component: Any = None
        """The pointer that every function of the standard takes."""
        self.fmpy: Any = None
        """fmpy's instance, for its masters."""
        try:
            self.fmpy = kinds[exchange](instanceName=self._log.name, **arguments)
        except Exception as error:  # fmpy raises plain exceptions here
            raise SimulationError(f"{description.modelName}: {error}") from error
        self._instantiate()
        self._prepare(exchange)

    @called_back
    def _update(self, _environment: object, time: float, *_others: object) -> None:
        """Called by the FMU; ctypes would drop what is raised."""
        assert self._intermediate
        try:
            values = self._intermediate.values(time)
            if values is not None:
                self._asked.set(values)
        except BaseException as error:  # whatever it is: the step raises it
            self._raised = self._raised or error

    def _inside(self) -> dict[str, Any]:
        """What fmpy is to be told of inputs inside a step."""
        if self._intermediate is None:
            return {}
        references = [self._variable(name).valueReference for name in self._intermediate.names]
        return {"intermediateUpdate": self._update, "requiredIntermediateVariables": references}

    def _instantiate(self) -> None:
        """With its logging on: without it pythonfmu's wrapper keeps its messages, even of errors, to itself."""
        self.component = None
        try:
            if self.is_fmi_3:
                self.fmpy.instantiate(logMessage=self._log.callback_3(), loggingOn=True, **self._inside())
            else:
                self.fmpy.instantiate(callbacks=CALLBACKS_2, loggingOn=True)
        except Exception as error:  # and here
            raise SimulationError(self._log.refusal() or f"{self.description.modelName}: {error}") from error
        self.component = self.fmpy.component
        if self._intermediate:
            self._asked = self.port(*self._intermediate.names)

    def _prepare(self, exchange: bool) -> None:
        """What is called again and again.

        fmpy's methods look the function up and its result over, in Python: here that would cost what a step costs.
        """
        self._ending, self._time = c_bool(), c_double()
        unused = byref(c_bool())
        self._ends = unused, byref(self._ending), unused, byref(self._time)
        if exchange:
            self._set_time, self._set_states = self.function("SetTime"), self.function("SetContinuousStates")
            self._get_states = self.function("GetContinuousStates")
            self._get_derivatives = self.function(
                "GetContinuousStateDerivatives" if self.is_fmi_3 else "GetDerivatives"
            )
        else:
            self._do_step = self.function("DoStep")

    def close(self) -> None:
        """Free the instance, and unload its library."""
        if self.component is not None:
            self.component = None
            self.fmpy.freeInstance()

    def __enter__(self) -> "Instance":
        return self

    def __exit__(
        self, _type: type[BaseException] | None, _error: BaseException | None, _at: TracebackType | None
    ) -> None:
        self.close()

    # ---- calls, and what becomes of a refused one

    def function(self, name: str) -> Any:
        """The C function of the standard, as 'DoStep': ctypes', with its types. It returns the status."""
        return getattr(self.fmpy.dll, f"fmi{3 if self.is_fmi_3 else 2}{name}")

    def check(self, status: int) -> None:
        """Raise where a call of a `function` was refused."""
        if status > WARNING:
            self._fatal = self._fatal or status == FATAL
            raise SimulationError(self._log.refusal() or f"the FMU returned {STATUS[status]}, without a message")

    def _call(self, function: Callable[..., Any], *arguments: Any) -> Any:
        """One of fmpy's."""
        try:
            return function(*arguments)
        except Exception as error:
            self.check(getattr(error, "status", 0))
            raise  # it is not the FMU's

    @contextmanager
    def driven_by_fmpy(self) -> Iterator[None]:
        """Around one of fmpy's masters, which is given `fmpy`: what it raises becomes a SimulationError."""
        try:
            yield
        except Exception as error:  # fmpy raises plain exceptions
            raise SimulationError(self._log.refusal() or str(error)) from error

    # ---- start and step

    def port(self, *names: str) -> "Port":
        """A group of variables. Raises ValueError where there is no such variable."""
        return Port(self, [self._variable(name) for name in names])

    def _variable(self, name: str) -> Any:
        if name not in self._variables:
            raise ValueError(f"{name}: must be a variable of {self.description.modelName}")
        return self._variables[name]

    def set(self, values: Mapping[str, float | str]) -> None:
        """Set variables by name; the item of an enumeration may be given by its name.

        Raises:
            ValueError: no such variable, or no such item.
        """
        self.port(*values).set([self._number(name, value) for name, value in values.items()])

    def _number(self, name: str, value: float | str) -> float:
        if not isinstance(value, str):
            return value
        items = {item.name: int(item.value) for item in getattr(self._variable(name).declaredType, "items", None) or ()}
        if value not in items:
            raise ValueError(f"{name} = {value!r}: must be {'one of ' + ', '.join(items) if items else 'a number'}")
        return items[value]

    def start(self, values: Mapping[str, float | str] | None = None, start_time: float = 0.0) -> None:
        """Set start values and initialize, at the start time [s]."""
        self.set(values or {})
        self.enter_initialization(start_time)
        self.exit_initialization()

    def enter_initialization(
        self, start_time: float = 0.0, stop_time: float | None = None, tolerance: float | None = None
    ) -> None:
        """With the experiment: times in s; a tolerance is for what has one."""
        if self.is_fmi_3:
            self._call(self.fmpy.enterInitializationMode, tolerance, start_time, stop_time)
        else:
            self._call(self.fmpy.setupExperiment, tolerance, start_time, stop_time)
            self._call(self.fmpy.enterInitializationMode)

    def exit_initialization(self) -> None:
        """Then an instance for co-simulation can step, and one for model exchange is in event mode."""
        self._call(self.fmpy.exitInitializationMode)

    def step(self, time: float, duration: float) -> None:
        """From a communication point [s], for a duration [s]."""
        if self.is_fmi_3:
            status = self._do_step(self.component, time, duration, True, *self._ends)
            if self._raised:
                raised, self._raised = self._raised, None
                raise raised
            if status <= WARNING and self._ending.value:
                raise SimulationError(f"the FMU asks to end at {self._time.value!r} s")
        else:
            status = self._do_step(self.component, time, duration, 1)
        if status > WARNING:
            self.check(status)

    def reset(self) -> None:
        """Back to what it was when it was made. After a fatal error the standards allow no call: it is made anew."""
        if self._fatal:
            self.function("FreeInstance")(self.component)
            self._instantiate()
            self._fatal = False
        else:
            self._call(self.fmpy.reset)

    # ---- the whole state

    def save(self) -> Any:
        """The whole state of the instance, to be given to `restore`, `bytes_of` and, in the end, `forget`."""
        return self._call(self.fmpy.getFMUState)

    def restore(self, state: Any) -> None:
        """Go back to a state."""
        self._call(self.fmpy.setFMUState, state)

    def forget(self, state: Any) -> None:
        """Give its memory back."""
        self._call(self.fmpy.freeFMUState, state)

    def bytes_of(self, state: Any) -> bytes:
        """A state, serialized."""
        content: bytes = self._call(self.fmpy.serializeFMUState, state)
        return content

    def state_of(self, content: bytes) -> Any:
        """A state, from what it was serialized to."""
        return self._call(self.fmpy.deserializeFMUState, content)

    # ---- model exchange

    def state_array(self) -> Any:
        """ctypes' array of so many doubles as there are continuous states."""
        return (c_double * int(self.description.numberOfContinuousStates))()

    def get_states(self, states: Any, count: int) -> None:
        """Into an array, or where a pointer points to."""
        self.check(self._get_states(self.component, states, count))

    def set_states(self, states: Any, count: int) -> None:
        """From an array, or from where a pointer points to."""
        self.check(self._set_states(self.component, states, count))

    def get_derivatives(self, derivatives: Any, count: int) -> None:
        """Into an array, or where a pointer points to: 1/s."""
        self.check(self._get_derivatives(self.component, derivatives, count))

    def get_nominals(self, nominals: Any, count: int) -> None:
        """Into an array, or where a pointer points to."""
        self._call(self.fmpy.getNominalsOfContinuousStates, nominals, count)

    def set_time(self, time: float) -> None:
        """s."""
        self.check(self._set_time(self.component, time))

    def enter_event_mode(self) -> None:
        """From continuous time."""
        self._call(self.fmpy.enterEventMode)

    def update_discrete_states(self) -> Events:
        """In event mode."""
        return Events(*self._call(self.fmpy.updateDiscreteStates if self.is_fmi_3 else self.fmpy.newDiscreteStates))

    def enter_continuous_time_mode(self) -> None:
        """From event mode."""
        self._call(self.fmpy.enterContinuousTimeMode)

    def complete_step(self) -> bool:
        """Tell that the solver has made a step; whether event mode is needed."""
        needed, ends = self._call(self.fmpy.completedIntegratorStep)
        if ends:
            raise SimulationError("the FMU asks to end")
        return bool(needed)


class Port:
    """A group of variables of an instance, of any types, that are set or read together; see `Instance.port`.

    What is of one type goes with one call of the FMU. A refused one raises SimulationError.
    """

    def __init__(self, instance: Instance, variables: Sequence[Any]) -> None:
        self.names = tuple(variable.name for variable in variables)
        self._instance, self._variables = instance, variables
        by_type: dict[str, list[int]] = {}
        for place, variable in enumerate(variables):
            by_type.setdefault(_type(variable, instance.is_fmi_3), []).append(place)
        self._groups = [_Group(instance, name, places, variables) for name, places in by_type.items()]

    def set(self, values: Sequence[float]) -> None:
        """Set all, in the order of `names`."""
        for group in self._groups:
            group.values[:] = values if group.is_all else [values[place] for place in group.places]
            group.set(group.values)

    def get(self) -> list[float]:
        """Read all, in the order of `names`."""
        found = [0.0] * len(self.names)
        for group in self._groups:
            group.get(group.values)
            if group.is_all:
                return group.values[:]  # type: ignore[no-any-return]
            for place, value in zip(group.places, group.values, strict=True):
                found[place] = value
        return found

    def over(self, row: NDArray[Any]) -> Any:
        """Memory of numpy's to read into, with `get_into`: one value for each of the variables, all of one type.

        Raises:
            ValueError: not of that type, or not as many.
        """
        wanted = self._one_type().type
        if row.shape != (len(self.names),) or row.dtype != wanted:
            raise ValueError(f"row: must have {len(self.names)} values of the type of {', '.join(self.names)}")
        return (wanted * len(self.names)).from_buffer(row)

    def get_into(self, row: Any) -> None:
        """Read all, into what `over` made."""
        self._one_type().get(row)

    @property
    def call(self) -> tuple[Any, Any, int]:
        """Of variables of one type: the function that reads them, and its arguments before the row."""
        group = self._one_type()
        return group.get_function, group.references, group.count

    def _one_type(self) -> "_Group":
        if len(self._groups) != 1:
            raise ValueError(f"{', '.join(self.names)}: must be of one type")
        return self._groups[0]

    def set_slopes(self, slopes: Sequence[float]) -> None:
        """1/s: how the inputs change over the next step. FMI 2.0."""
        self._one_type().set_slopes(slopes)


class _Group:
    """Variables of one type, and the arrays for their calls."""

    def __init__(self, instance: Instance, name: str, places: list[int], variables: Sequence[Any]) -> None:
        self._instance, self._is_fmi_3 = instance, instance.is_fmi_3
        self.places, self.count = places, len(places)
        self.is_all = self.count == len(variables)
        self.type = getattr(fmi3, f"fmi3{name}") if self._is_fmi_3 else getattr(fmi2, f"fmi2{name}")
        self.references = (fmi2.fmi2ValueReference * self.count)(*(variables[i].valueReference for i in places))
        self.values = (self.type * self.count)()
        self._set, self.get_function = instance.function(f"Set{name}"), instance.function(f"Get{name}")

    def set(self, values: Any) -> None:
        instance = self._instance
        if self._is_fmi_3:
            status = self._set(instance.component, self.references, self.count, values, self.count)
        else:
            status = self._set(instance.component, self.references, self.count, values)
        if status > WARNING:
            instance.check(status)

    def set_slopes(self, slopes: Sequence[float]) -> None:
        self.values[:] = slopes
        instance, (function, orders) = self._instance, self._slopes
        instance.check(function(instance.component, self.references, self.count, orders, self.values))

    @cached_property
    def _slopes(self) -> tuple[Any, Any]:
        if self._is_fmi_3:
            raise ValueError("slopes: must be of inputs of FMI 2.0; FMI 3.0 has no function for them")
        return self._instance.function("SetRealInputDerivatives"), (c_int * self.count)(*[1] * self.count)

    def get(self, values: Any) -> None:
        instance = self._instance
        if self._is_fmi_3:
            status = self.get_function(instance.component, self.references, self.count, values, self.count)
        else:
            status = self.get_function(instance.component, self.references, self.count, values)
        if status > WARNING:
            instance.check(status)


def _type(variable: Any, is_fmi_3: bool) -> str:
    """Of a variable, as the functions of the standard name it."""
    if variable.type == "Enumeration":
        return "Int64" if is_fmi_3 else "Integer"
    if variable.type in ("String", "Binary", "Clock"):
        raise ValueError(f"{variable.name}: must be a number; it is of the type {variable.type}")
    return str(variable.type)
