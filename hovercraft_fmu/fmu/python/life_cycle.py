"""What every slave does: life cycle, variables, state. What comes from the host is not trusted; it is checked once."""

import hashlib
import json
import math
from abc import abstractmethod
from collections.abc import Callable, MutableMapping
from typing import Any, ClassVar, NoReturn, TypeVar

from ...model.subcycling import check_tolerance, rounding
from ..variable import Model, Phase, Variable, may_be_set
from .wrapper import WrappedSlave, called_by_wrapper

DIGEST_SIZE = 64
"""Bytes of the hexadecimal SHA-256 ahead of a serialized state."""
WHOLE_NUMBER = "Integer or Enumeration"
Number = TypeVar("Number", float, int, bool)


class Slave(WrappedSlave):
    """A model behind the FMI functions of pythonfmu's wrapper; what is the model's own is in the methods at the end.

    Variables are not registered with pythonfmu: its way of reading and writing them costs more than a sub-step, and
    knows neither Enumerations nor the state between two communication points.
    """

    build: ClassVar[str] = ""
    """A digest of all that is in the FMU; the entry script of an FMU sets it."""
    model: ClassVar[Model]
    on_demand: ClassVar[frozenset[int]] = frozenset()
    """References of the Reals that are worked out only when they are asked for."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        model = self.model
        self._by_reference, self._inputs, self._kept = model.by_reference, model.inputs, model.kept
        self._phase = Phase.INSTANTIATED
        self._given: dict[int, float] = {}  # Reals as they start, or as the host set them
        self._seen: dict[int, float] = {}  # Reals that are worked out, of the communication point
        self._integers: dict[int, int] = {}
        self._booleans: dict[int, bool] = {}
        for variable in model.variables:
            if variable.kind == "Boolean":
                self._booleans[variable.reference] = bool(variable.start)
            elif variable.kind != "Real":
                self._integers[variable.reference] = int(variable.start or 0)
            elif variable.start is not None:
                self._given[variable.reference] = float(variable.start)
        self._time = 0.0
        self._start_time = 0.0
        self._stop_time = math.inf  # with the experiment; the standard forbids to step past it
        self._hosts_tolerance: float | None = None  # with the experiment; it comes before a parameter of that name
        self._tuned = False  # a parameter was set since the last step: the next one takes it up
        self._stale = True  # what is seen is not yet that of the communication point
        self._all_seen = False  # what is worked out on demand is among it

    # ---- life cycle

    @called_by_wrapper
    def setup_experiment(self, start_time: float, stop_time: float | None, tolerance: float | None) -> None:
        self._require("fmi2SetupExperiment", Phase.INSTANTIATED)
        if not math.isfinite(start_time):
            raise ValueError(f"startTime = {start_time!r} s: must be a finite number")
        if tolerance is not None:
            check_tolerance(tolerance)
        stop_time = math.inf if stop_time is None else stop_time
        if not stop_time >= start_time:
            raise ValueError(f"stopTime = {stop_time!r} s: must not be before startTime = {start_time!r} s")
        self._time = self._start_time = start_time
        self._stop_time, self._hosts_tolerance = stop_time, tolerance

    @called_by_wrapper
    def enter_initialization_mode(self) -> None:
        self._require("fmi2EnterInitializationMode", Phase.INSTANTIATED)
        self._phase = Phase.INITIALIZING

    @called_by_wrapper
    def exit_initialization_mode(self) -> None:
        self._require("fmi2ExitInitializationMode", Phase.INITIALIZING)
        self._take_up_start_values()
        self._phase = Phase.STEPPING

    def do_step(self, current_time: float, step_size: float) -> bool:
        try:
            if self._phase is not Phase.STEPPING:
                self._require("fmi2DoStep", Phase.STEPPING)
            self._check_step(current_time, step_size)
            self._advance(current_time, step_size)
            self._time = current_time + step_size
            self._stale = True
            return True
        except Exception:
            self.outlive_exception()
            raise

    def _check_step(self, point: float, step: float) -> None:
        time, start_time, stop_time, end = self._time, self._start_time, self._stop_time, point + step
        if not 0.0 < step < math.inf:
            raise ValueError(f"communicationStepSize = {step!r} s: must be a finite number greater than 0")
        same = 0.0
        if point != time or end > stop_time:  # rarely; it costs as much as a sub-step
            same = rounding(max(abs(time), abs(end), abs(start_time)), step, (time - start_time) / step)
        if not abs(point - time) <= same:
            raise ValueError(f"currentCommunicationPoint = {point!r} s: must be where the last step ended, {time!r} s")
        spacing = math.ulp(min(abs(point), abs(end)))
        if step < spacing:
            raise ValueError(
                f"communicationStepSize = {step!r} s: must not be less than what a double can tell at {point!r} s, "
                f"{spacing!r} s"
            )
        if end - stop_time > same:
            raise ValueError(
                f"communicationStepSize = {step!r} s from {point!r} s: must not lead past stopTime = {stop_time!r} s"
            )

    @called_by_wrapper
    def terminate(self) -> None:
        self._require("fmi2Terminate", Phase.STEPPING)
        self._phase = Phase.TERMINATED

    def _require(self, call: str, phase: Phase) -> None:
        if self._phase is not phase:
            raise RuntimeError(f"{call} in state '{self._phase.value}': must be called in state '{phase.value}'")

    def _refuse_to_be_read(self, call: str) -> NoReturn:
        now, *others = (phase.value for phase in (self._phase, Phase.INITIALIZING, Phase.STEPPING))
        raise RuntimeError(f"{call} in state '{now}': must be called in state '{others[0]}' or '{others[1]}'")

    def _started(self) -> bool:
        return self._phase in (Phase.STEPPING, Phase.TERMINATED)

    # ---- variables

    def get_real(self, vrs: list[int]) -> list[float]:
        try:
            if self._stale:
                self._look()
            if not self._all_seen and not self.on_demand.isdisjoint(vrs):
                self._seen |= self._observe_on_demand()
                self._all_seen = True
            seen, given = self._seen, self._given
            try:
                return [seen[reference] if reference in seen else given[reference] for reference in vrs]
            except KeyError as error:
                raise _unknown("Real", error.args[0]) from None
        except Exception:
            self.outlive_exception()
            raise

    @called_by_wrapper
    def get_integer(self, vrs: list[int]) -> list[int]:
        return self._get(self._integers, WHOLE_NUMBER, vrs)

    @called_by_wrapper
    def get_boolean(self, vrs: list[int]) -> list[bool]:
        return self._get(self._booleans, "Boolean", vrs)

    @called_by_wrapper
    def get_string(self, vrs: list[int]) -> list[str]:
        raise _unknown("String", vrs[0])

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        try:
            if self._phase is Phase.STEPPING and self._inputs.issuperset(vrs) and math.isfinite(sum(values)):
                given = self._given
                for reference, value in zip(vrs, values):  # noqa: B905 - the wrapper makes both of one length
                    given[reference] = value
                return  # inputs come often and have no other rule
            self._set(self._given, "Real", vrs, values)
        except Exception:
            self.outlive_exception()
            raise

    @called_by_wrapper
    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        self._set(self._integers, WHOLE_NUMBER, vrs, values)

    @called_by_wrapper
    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        self._set(self._booleans, "Boolean", vrs, values)

    @called_by_wrapper
    def set_string(self, vrs: list[int], values: list[str]) -> None:
        raise _unknown("String", vrs[0])

    def _get(self, table: MutableMapping[int, Number], kind: str, vrs: list[int]) -> list[Number]:
        if self._phase is Phase.INSTANTIATED:
            self._refuse_to_be_read(f"fmi2Get{kind.split()[0]}")
        self._observe_discrete()
        try:
            return [table[reference] for reference in vrs]
        except KeyError as error:
            raise _unknown(kind, error.args[0]) from None

    def _set(self, table: MutableMapping[int, Number], kind: str, vrs: list[int], values: list[Number]) -> None:
        # all are checked before one is set: a refused call changes nothing
        for reference, value in zip(vrs, values, strict=True):
            variable = self._by_reference.get(reference)
            if variable is None or variable.kind not in kind.split(" or "):
                raise _unknown(kind, reference)
            self._check_set(variable, value)
        table.update(zip(vrs, values, strict=True))
        self._after_set(vrs)

    def _look(self) -> None:
        """Bring what is seen up to the communication point."""
        if self._phase is Phase.INSTANTIATED:
            self._refuse_to_be_read("fmi2GetReal")
        if not self._started():
            self._take_up_start_values()
        self._seen, self._all_seen, self._stale = self._observe(), False, False

    def _check_set(self, variable: Variable, value: float) -> None:
        if not may_be_set(variable, self._phase):
            raise ValueError(
                f"{variable.name} = {value!r}: must not be set in state '{self._phase.value}' "
                f"({variable.variability} {variable.causality})"
            )
        if not math.isfinite(value):
            raise ValueError(f"{variable.name} = {value!r}: must be a finite number")
        self._check_value(variable, value)

    def _after_set(self, vrs: list[int]) -> None:
        if self._phase is Phase.STEPPING:
            # what is read belongs to the communication point: it changes with the next step, not now
            self._tuned = self._tuned or not self._inputs.issuperset(vrs)
        else:
            self._stale = True

    # ---- FMU state

    @called_by_wrapper
    def _get_fmu_state(self) -> dict[str, Any]:
        return {
            "build": self.build,
            "phase": self._phase.name,
            "time": self._time,
            "start_time": self._start_time,
            "stop_time": self._stop_time,
            "tolerance": self._hosts_tolerance,
            "reals": [self._given[reference] for reference in self._kept],
            "integers": [self._integers[reference] for reference in sorted(self._integers)],
            "booleans": [self._booleans[reference] for reference in sorted(self._booleans)],
            "tuned": self._tuned,
            **self._own_state(),
        }

    @called_by_wrapper
    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        self._check_build(state)
        self._phase = Phase[state["phase"]]
        self._time, self._start_time, self._stop_time = state["time"], state["start_time"], state["stop_time"]
        self._hosts_tolerance = state["tolerance"]
        self._given.update(zip(self._kept, state["reals"], strict=True))
        self._integers.update(zip(sorted(self._integers), state["integers"], strict=True))
        self._booleans.update(zip(sorted(self._booleans), state["booleans"], strict=True))
        self._tuned = state["tuned"]
        self._set_own_state(state)
        self._stale = True

    @staticmethod
    def _fmu_state_to_bytes(state: dict[str, Any]) -> bytes:
        text = json.dumps(state).encode()
        return hashlib.sha256(text).hexdigest().encode() + text

    @classmethod
    def _fmu_state_from_bytes(cls, state: bytes) -> dict[str, Any]:
        digest, text = state[:DIGEST_SIZE], state[DIGEST_SIZE:]
        try:
            if hashlib.sha256(text).hexdigest().encode() != digest:
                raise ValueError(f"serialized FMU state of {len(state)} bytes: must be complete and unchanged")
            restored: dict[str, Any] = json.loads(text)
            cls._check_build(restored)
        except Exception:
            cls.outlive_exception_of_class()
            raise
        return restored

    @classmethod
    def _check_build(cls, state: dict[str, Any]) -> None:
        if state["build"] != cls.build:
            raise ValueError(f"FMU state of build {state['build']}: must be a state of this build, {cls.build}")

    # ---- what is the model's own

    @abstractmethod
    def _check_value(self, variable: Variable, value: float) -> None:
        """Raises ValueError where a value alone is impossible; it is a finite number."""

    @abstractmethod
    def _take_up_start_values(self) -> None:
        """Make the state from the start values. Raises ValueError where they are impossible together."""

    @abstractmethod
    def _advance(self, time: float, step_size: float) -> None:
        """Go on from a time by a communication step [s], or raise and change nothing."""

    @abstractmethod
    def _observe(self) -> dict[int, float]:
        """The Reals of the communication point that are worked out, but for those on demand."""

    def _observe_discrete(self) -> None:
        """Bring Integers and Booleans up to the communication point, where they are not always there."""

    _observe_on_demand: Callable[[], dict[int, float]]
    """The rest of the Reals, which most hosts never ask for: a method of models that have some."""

    @abstractmethod
    def _own_state(self) -> dict[str, Any]:
        """What the FMU state has beside inputs, parameters, Integers and Booleans."""

    @abstractmethod
    def _set_own_state(self, state: dict[str, Any]) -> None:
        """Take it back."""


def refuse_non_finite(names: tuple[str, ...], values: tuple[float, ...]) -> None:
    """Raises ValueError where one of the values that are about to be read is not a finite number."""
    for name, value in zip(names, values, strict=True):
        if not math.isfinite(value):
            raise ValueError(f"{name} = {value!r}: must be a finite number; the motion is out of range")


def _unknown(kind: str, reference: int) -> ValueError:
    return ValueError(f"value reference {reference}: must be that of a variable of type {kind}")
