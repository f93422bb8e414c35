"""The PythonFMU slave: life cycle, variables, state. It trusts nothing that comes from the host, and checks it once."""

import hashlib
import json
import math
from enum import Enum
from typing import Any, ClassVar, NoReturn
from xml.etree.ElementTree import Element

from ..model.craft import Craft, check_parameter
from ..model.dynamics import Controls, State, saturate
from ..model.integrators import integrator
from ..model.subcycling import (
    NonFiniteError,
    Settings,
    advance,
    check_step_size,
    check_tolerance,
    stability_number,
)
from .description import model_description
from .interface import (
    ACTION,
    BY_NAME,
    COUNTER_STOPPED,
    CRAFT_PARAMETERS,
    INPUT_HELD,
    INPUTS,
    MOTION,
    STATES,
    STEP_TURNS,
    STEP_UNSTABLE,
    SUBSTEPS_MAX,
    VARIABLES,
    WARNINGS,
    WATCHED,
    Variable,
    observe_action,
    observe_motion,
)
from .wrapper import Fmi2Status, WrappedSlave, called_by_wrapper

HELD = 1e-9
"""Relative to the limit (at least 1): an input beyond it by less is a rounding of the host's interpolation."""
SAME_TIME = 1e-9
"""Relative to the time (at least 1 s): how far a communication point may lie from the end of the last step, or past
the stop time."""

BY_REFERENCE = {variable.reference: variable for variable in VARIABLES}
REALS = frozenset(v.reference for v in VARIABLES if v.kind == "Real")
INTEGERS = frozenset(v.reference for v in VARIABLES if v.kind != "Real")
THRUST, PORT, STARBOARD, WIND_X, WIND_Y = (BY_NAME[name].reference for name in INPUTS)
STATE_REFERENCES = tuple(BY_NAME[name].reference for name in STATES)
MOTION_REFERENCES = STATE_REFERENCES + tuple(BY_NAME[name].reference for name in MOTION)
ACTION_REFERENCES = tuple(BY_NAME[name].reference for name in ACTION + WATCHED)
INPUT_REFERENCES = frozenset((THRUST, PORT, STARBOARD, WIND_X, WIND_Y))
CRAFT_REFERENCES = tuple(BY_NAME[name].reference for name in CRAFT_PARAMETERS)
ACTION_SET = frozenset(ACTION_REFERENCES)
STEP_SIZE = BY_NAME["step_size"].reference
INTEGRATOR = BY_NAME["integrator"].reference
SUBSTEPS = BY_NAME["substeps"].reference
WARNED = BY_NAME["warnings"].reference
TOLERANCE = BY_NAME["tolerance"].reference
PROJECTED_AREA = BY_NAME["projected_area"].reference
KEPT_REALS = tuple(v.reference for v in VARIABLES if v.kind == "Real" and v.start is not None and v.name not in STATES)
"""What is kept as the host set it: inputs and parameters."""
DIGEST_SIZE = 64
"""Bytes of the hexadecimal SHA-256 ahead of a serialized state."""


class Phase(Enum):
    """Where the instance is in FMI's life cycle, in the words of the standard."""

    INSTANTIATED = "instantiated"
    INITIALIZING = "initialization mode"
    STEPPING = "step mode"
    TERMINATED = "terminated"


SETTABLE = {
    Phase.INSTANTIATED: frozenset(v.reference for v in VARIABLES if v.start is not None),
    Phase.INITIALIZING: frozenset(v.reference for v in VARIABLES if v.start is not None),
    Phase.STEPPING: frozenset(v.reference for v in VARIABLES if v.causality == "input" or v.variability == "tunable"),
    Phase.TERMINATED: frozenset[int](),
}


class HovercraftSlave(WrappedSlave):
    """The hovercraft behind the FMI functions of pythonfmu's wrapper.

    Variables are not registered with pythonfmu: its way of reading and writing them costs more than a sub-step, and
    knows neither Enumerations nor the state between two communication points.
    """

    build: ClassVar[str] = ""
    """A digest of all that is in the FMU; the entry script of an FMU sets it."""

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._phase = Phase.INSTANTIATED
        self._reals = {reference: float(BY_REFERENCE[reference].start or 0.0) for reference in REALS - ACTION_SET}
        self._integers = {reference: int(BY_REFERENCE[reference].start or 0) for reference in INTEGERS}
        self._time = 0.0
        self._stop_time = math.inf  # with the experiment; the standard forbids to step past it
        self._state = State()
        # with these the last step was made, and from these the outputs are calculated
        self._controls = Controls()
        self._craft = Craft()
        self._settings = Settings()
        self._hosts_tolerance: float | None = None  # with the experiment; it comes before the parameter
        self._proposed = 0.0  # the next step of the adaptive method
        self._stability = self._rotation = 0.0  # the largest of a sub-step so far
        self._tuned = False  # a parameter was set since then: the next step takes it up
        self._stale = True  # the motion that is read is not yet that of the communication point
        self._acting = False  # what acts on the craft is among the values that are read

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
        self._time, self._stop_time, self._hosts_tolerance = start_time, stop_time, tolerance

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
            if not 0.0 < step_size < math.inf:
                raise ValueError(f"communicationStepSize = {step_size!r} s: must be a finite number greater than 0")
            time = self._time
            if current_time != time and not abs(current_time - time) <= SAME_TIME * max(1.0, abs(time)):
                raise ValueError(
                    f"currentCommunicationPoint = {current_time!r} s: must be where the last step ended, {time!r} s"
                )
            stop_time = self._stop_time
            if current_time + step_size - stop_time > SAME_TIME * max(1.0, abs(stop_time)):
                raise ValueError(
                    f"communicationStepSize = {step_size!r} s from {current_time!r} s: must not lead past "
                    f"stopTime = {stop_time!r} s"
                )
            reals = self._reals
            controls = Controls(reals[THRUST], reals[PORT], reals[STARBOARD], reals[WIND_X], reals[WIND_Y])
            craft = self._make_craft() if self._tuned else self._craft
            try:
                stretch = advance(self._state, controls, craft, step_size, self._settings, proposed=self._proposed)
            except NonFiniteError as error:
                self._refuse_motion(error)
            stability, rotation = stability_number(stretch.drag, stretch.rotation, craft), stretch.rotation
            if not stability < math.inf:
                self._refuse_watched(stability, rotation)
            self._state, n, _, _, self._proposed = stretch
            self._controls, self._craft, self._tuned = controls, craft, False
            self._time = current_time + step_size
            self._integers[SUBSTEPS] += n
            self._stale = True
            if self._integers[SUBSTEPS] > SUBSTEPS_MAX:
                self._stop_counter()
            if stability > self._stability:
                self._stability = stability
            if rotation > self._rotation:
                self._rotation = rotation
            method = self._settings.integrator
            if stability > method.stability_limit or rotation > method.rotation_limit:
                self._warn_of_the_step()
            thrust, port, starboard, _, _ = controls
            if not (craft.thrust_min <= thrust <= craft.thrust_max and 0.0 <= port <= 1.0 and 0.0 <= starboard <= 1.0):
                self._warn_of_held_inputs()
            return True
        except Exception:
            self.outlive_exception()
            raise

    @called_by_wrapper
    def terminate(self) -> None:
        self._require("fmi2Terminate", Phase.STEPPING)
        self._phase = Phase.TERMINATED

    def _warn_of_the_step(self) -> None:
        method, step = self._settings.integrator, self._settings.step_size
        number, rotation = self._stability, self._rotation
        if number > method.stability_limit:
            self._warn(
                STEP_UNSTABLE,
                f"stability_number = {number:.4g}: must not pass {method.stability_limit} with {method.name}; set a "
                f"step_size below {step * method.stability_limit / number:.3g} s, or another integrator",
            )
        if rotation > method.rotation_limit:
            self._warn(
                STEP_TURNS,
                f"rotation_per_substep = {rotation:.4g} rad: must not pass {method.rotation_limit} rad; set a "
                f"step_size below {step * method.rotation_limit / rotation:.3g} s, or the integrator adaptive",
            )

    def _stop_counter(self) -> None:
        self._integers[SUBSTEPS] = SUBSTEPS_MAX
        self._warn(COUNTER_STOPPED, f"substeps = {SUBSTEPS_MAX}: {WARNINGS[COUNTER_STOPPED]}")

    def _warn_of_held_inputs(self) -> None:
        held = saturate(self._controls, self._craft)
        for name, value, limit in zip(INPUTS, self._controls, held, strict=True):
            if abs(value - limit) > HELD * max(1.0, abs(limit)):
                self._warn(INPUT_HELD, f"{name} = {value!r}: is outside its limits and is held at {limit!r}")

    def _warn(self, bit: int, message: str) -> None:
        """Set the bit and log the message, unless the bit is set already. Only where no exception can follow."""
        if not self._integers[WARNED] & bit:
            self._integers[WARNED] |= bit
            self.log(f"{message} (said once)", Fmi2Status.warning)

    def _require(self, call: str, phase: Phase) -> None:
        if self._phase is not phase:
            raise RuntimeError(f"{call} in state '{self._phase.value}': must be called in state '{phase.value}'")

    def _refuse_motion(self, error: NonFiniteError) -> NoReturn:
        name = STATES[State._fields.index(error.component)]
        raise ValueError(
            f"{name} = {error.value!r} after {self._time!r} s: must stay a finite number; the step was refused and "
            f"the state of {self._time!r} s stands; the motion is too fast for sub-steps of {error.substep!r} s: "
            "set a smaller step_size"
        ) from error

    def _refuse_watched(self, stability: float, rotation: float) -> NoReturn:
        """What is watched over a step may overflow where the motion just does not; an infinite rotation leaves no
        finite stability number.
        """
        watched = zip(WATCHED, (stability, rotation), strict=True)
        name, value = next((name, value) for name, value in reversed(list(watched)) if not math.isfinite(value))
        raise ValueError(
            f"{name} = {value!r} after {self._time!r} s: must stay a finite number; the step was refused and the state "
            f"of {self._time!r} s stands; the motion is too fast for sub-steps of {self._settings.step_size!r} s: "
            "set a smaller step_size"
        )

    # ---- variables

    def get_real(self, vrs: list[int]) -> list[float]:
        try:
            if self._stale:
                self._observe_motion()
            try:
                return list(map(self._reals.__getitem__, vrs))
            except KeyError:  # what acts on the craft is worked out when it is asked for
                self._observe_action()
            try:
                return list(map(self._reals.__getitem__, vrs))
            except KeyError as error:
                raise _unknown("Real", error.args[0]) from None
        except Exception:
            self.outlive_exception()
            raise

    @called_by_wrapper
    def get_integer(self, vrs: list[int]) -> list[int]:
        integers = self._integers
        try:
            return [integers[reference] for reference in vrs]
        except KeyError as error:
            raise _unknown("Integer or Enumeration", error.args[0]) from None

    @called_by_wrapper
    def get_boolean(self, vrs: list[int]) -> list[bool]:
        raise _unknown("Boolean", vrs[0])

    @called_by_wrapper
    def get_string(self, vrs: list[int]) -> list[str]:
        raise _unknown("String", vrs[0])

    def set_real(self, vrs: list[int], values: list[float]) -> None:
        try:
            if self._phase is Phase.STEPPING and INPUT_REFERENCES.issuperset(vrs) and math.isfinite(sum(values)):
                reals = self._reals
                for reference, value in zip(vrs, values):  # noqa: B905 - the wrapper makes both of one length
                    reals[reference] = value
                return  # inputs come often and have no other rule
            # all are checked before one is set: a refused call changes nothing
            for reference, value in zip(vrs, values, strict=True):
                if reference not in REALS:
                    raise _unknown("Real", reference)
                self._check_set(BY_REFERENCE[reference], value)
            self._reals.update(zip(vrs, values, strict=True))
            self._after_set(vrs)
        except Exception:
            self.outlive_exception()
            raise

    @called_by_wrapper
    def set_integer(self, vrs: list[int], values: list[int]) -> None:
        for reference, value in zip(vrs, values, strict=True):
            if reference not in INTEGERS:
                raise _unknown("Integer or Enumeration", reference)
            self._check_set(BY_REFERENCE[reference], value)
        self._integers.update(zip(vrs, values, strict=True))
        self._after_set(vrs)

    @called_by_wrapper
    def set_boolean(self, vrs: list[int], values: list[bool]) -> None:
        raise _unknown("Boolean", vrs[0])

    @called_by_wrapper
    def set_string(self, vrs: list[int], values: list[str]) -> None:
        raise _unknown("String", vrs[0])

    def _check_set(self, variable: Variable, value: float) -> None:
        if variable.reference not in SETTABLE[self._phase]:
            raise ValueError(
                f"{variable.name} = {value!r}: must not be set in state '{self._phase.value}' "
                f"({variable.variability} {variable.causality})"
            )
        if not math.isfinite(value):
            raise ValueError(f"{variable.name} = {value!r}: must be a finite number")
        if variable.name in CRAFT_PARAMETERS:
            check_parameter(variable.name, value)
        elif variable.reference == STEP_SIZE:
            check_step_size(value)
        elif variable.reference == INTEGRATOR:
            integrator(int(value))
        elif variable.reference == TOLERANCE:
            check_tolerance(value)

    def _after_set(self, vrs: list[int]) -> None:
        if self._phase is Phase.STEPPING:
            # what is read belongs to the communication point: it changes with the next step, not now
            self._tuned = self._tuned or not INPUT_REFERENCES.issuperset(vrs)
        else:
            self._stale = True

    def _make_craft(self) -> Craft:
        values: dict[str, Any] = {
            name: self._reals[reference] if reference in REALS else self._integers[reference]
            for name, reference in zip(CRAFT_PARAMETERS, CRAFT_REFERENCES, strict=True)
        }
        return Craft(**values)

    def _take_up_settings(self) -> None:
        tolerance = self._reals[TOLERANCE] if self._hosts_tolerance is None else self._hosts_tolerance
        self._settings = Settings(self._reals[STEP_SIZE], integrator(self._integers[INTEGRATOR]), tolerance)

    def _take_up_start_values(self) -> None:
        reals = self._reals
        self._craft = self._make_craft()
        self._take_up_settings()
        self._controls = Controls(reals[THRUST], reals[PORT], reals[STARBOARD], reals[WIND_X], reals[WIND_Y])
        self._state = State(*(reals[BY_NAME[name].reference] for name in STATES))
        reals[PROJECTED_AREA] = self._craft.projected_area
        self._tuned = False
        self._stale = True

    def _observe_motion(self) -> None:
        """Bring the values that are read up to the communication point."""
        if not self._started():
            self._take_up_start_values()
        state, reals = self._state, self._reals
        motion = observe_motion(state)
        if not math.isfinite(motion[-1]):  # the speed overflows first
            _refuse_non_finite(MOTION, motion)
        reals.update(zip(MOTION_REFERENCES, state + motion))  # noqa: B905
        if self._acting:
            for reference in ACTION_REFERENCES:
                del reals[reference]
            self._acting = False
        self._stale = False

    def _observe_action(self) -> None:
        """The rest of them, which most hosts never ask for."""
        if not self._acting:
            action = observe_action(self._state, self._controls, self._craft)
            _refuse_non_finite(ACTION, action)
            self._reals.update(zip(ACTION_REFERENCES, (*action, self._stability, self._rotation), strict=True))
            self._acting = True

    # ---- FMU state

    @called_by_wrapper
    def _get_fmu_state(self) -> dict[str, Any]:
        return {
            "build": self.build,
            "phase": self._phase.name,
            "time": self._time,
            "stop_time": self._stop_time,
            "reals": [self._reals[reference] for reference in KEPT_REALS],
            "integers": [self._integers[reference] for reference in sorted(INTEGERS)],
            "state": list(self._state if self._started() else (self._reals[r] for r in STATE_REFERENCES)),
            "controls": list(self._controls),
            "craft": [getattr(self._craft, name) for name in CRAFT_PARAMETERS],
            "tuned": self._tuned,
            "tolerance": self._hosts_tolerance,
            "stability": self._stability,
            "rotation": self._rotation,
            "proposed": self._proposed,
        }

    @called_by_wrapper
    def _set_fmu_state(self, state: dict[str, Any]) -> None:
        self._check_build(state)
        self._phase = Phase[state["phase"]]
        self._time, self._stop_time = state["time"], state["stop_time"]
        self._reals.update(zip(KEPT_REALS, state["reals"], strict=True))
        self._integers.update(zip(sorted(INTEGERS), state["integers"], strict=True))
        self._state = State(*state["state"])
        self._reals.update(zip(STATE_REFERENCES, self._state, strict=True))
        self._controls = Controls(*state["controls"])
        self._craft = Craft(**dict(zip(CRAFT_PARAMETERS, state["craft"], strict=True)))
        self._reals[PROJECTED_AREA] = self._craft.projected_area
        self._hosts_tolerance = state["tolerance"]
        self._take_up_settings()
        self._stability, self._rotation, self._proposed = state["stability"], state["rotation"], state["proposed"]
        self._tuned = state["tuned"]
        self._stale = True

    def _started(self) -> bool:
        return self._phase in (Phase.STEPPING, Phase.TERMINATED)

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

    # ---- description

    def to_xml(self, model_options: dict[str, str] | None = None) -> Element:
        """The model description, made from the table of variables."""
        return model_description(self.build)


def _refuse_non_finite(names: tuple[str, ...], values: tuple[float, ...]) -> None:
    for name, value in zip(names, values, strict=True):
        if not math.isfinite(value):
            raise ValueError(f"{name} = {value!r}: must be a finite number; the motion is out of range")


def _unknown(kind: str, reference: int) -> ValueError:
    return ValueError(f"value reference {reference}: must be that of a variable of type {kind}")
