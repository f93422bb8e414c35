"""The hovercraft as a PythonFMU slave."""

import math
from operator import itemgetter
from typing import Any, NoReturn

from ...model.craft import Craft, check_parameter
from ...model.dynamics import Controls, State, saturate
from ...model.error_estimate import ON, Companion, accompany, check_error_estimate, estimated_error, is_lost, watched
from ...model.integrators import Integrator, StepTooSmallError, integrator
from ...model.observation import observe_action, observe_motion
from ...model.subcycling import (
    NonFiniteError,
    Settings,
    advance,
    check_step_size,
    check_tolerance,
    meant_step,
    too_strong,
)
from ..interface import (
    ACTION,
    BY_NAME,
    COUNTER_STOPPED,
    CRAFT_PARAMETERS,
    ERROR_LOST,
    ERRORS,
    HELD,
    HOVERCRAFT,
    INPUT_HELD,
    INPUTS,
    MOTION,
    STATES,
    STEP_TURNS,
    STEP_UNSTABLE,
    SUBSTEPS_MAX,
    WARNINGS,
    WATCHED,
)
from ..variable import Variable
from .life_cycle import Slave, refuse_non_finite
from .wrapper import Fmi2Status

inputs_of = itemgetter(*(BY_NAME[name].reference for name in INPUTS))
STATE_REFERENCES = tuple(BY_NAME[name].reference for name in STATES)
MOTION_REFERENCES = tuple(BY_NAME[name].reference for name in (*STATES, *MOTION))
ERROR_REFERENCES = tuple(BY_NAME[name].reference for name in ERRORS)
NO_ERROR = dict.fromkeys(ERROR_REFERENCES, 0.0)
ON_DEMAND = (*ACTION, *WATCHED, "projected_area")
ON_DEMAND_REFERENCES = tuple(BY_NAME[name].reference for name in ON_DEMAND)
CRAFT_VARIABLES = tuple(BY_NAME[name] for name in CRAFT_PARAMETERS)
STEP_SIZE = BY_NAME["step_size"].reference
INTEGRATOR = BY_NAME["integrator"].reference
ERROR_ESTIMATE = BY_NAME["error_estimate"].reference
SUBSTEPS = BY_NAME["substeps"].reference
WARNED = BY_NAME["warnings"].reference
TOLERANCE = BY_NAME["tolerance"].reference


class HovercraftSlave(Slave):
    """The hovercraft behind the FMI functions of pythonfmu's wrapper."""

    model = HOVERCRAFT
    on_demand = frozenset(ON_DEMAND_REFERENCES)

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._state = State()
        # with these the last step was made, and from these the outputs are calculated
        self._controls = Controls()
        self._craft = Craft()
        self._settings = Settings()
        self._proposed = 0.0  # the next step of the adaptive method
        self._stability = self._rotation = 0.0  # the largest of a sub-step so far
        self._companion: Companion | None = None  # where the error is estimated

    # ---- a step

    def _advance(self, time: float, step_size: float) -> None:
        controls = self._make_controls()
        craft = self._make_craft() if self._tuned else self._craft
        step_size = meant_step(time, step_size, self._start_time, self._settings.step_size)
        try:
            stretch = advance(self._state, controls, craft, step_size, self._settings, proposed=self._proposed)
        except (NonFiniteError, StepTooSmallError) as error:
            self._refuse_input(controls, craft)
            if isinstance(error, StepTooSmallError):
                raise
            self._refuse_motion(error)
        state, n, stability, rotation, proposed = stretch
        if not (stability < math.inf and rotation < math.inf):
            self._refuse_input(controls, craft)
            self._refuse_watched(stability, rotation)
        if self._companion:
            beside = accompany(self._companion, controls, craft, step_size, self._settings)
            self._companion = watched(beside, self._state, state, craft)
        self._state, self._proposed = state, proposed
        self._controls, self._craft, self._tuned = controls, craft, False
        self._integers[SUBSTEPS] += n
        if self._integers[SUBSTEPS] > SUBSTEPS_MAX:
            self._stop_counter()
        if stability > self._stability:
            self._stability = stability
        if rotation > self._rotation:
            self._rotation = rotation
        method = self._settings.integrator
        if stability > method.stability_limit:
            self._warn_of_stability(stability, method)
        if rotation > method.rotation_limit:
            self._warn_of_rotation(rotation, method)
        if self._companion:
            self._warn_of_error(self._companion, min(step_size, self._settings.step_size))
        thrust, port, starboard = controls[:3]
        if not (craft.thrust_min <= thrust <= craft.thrust_max and 0.0 <= port <= 1.0 and 0.0 <= starboard <= 1.0):
            self._warn_of_held_inputs()

    def _warn_of_stability(self, number: float, method: Integrator) -> None:
        step = self._settings.step_size * method.stability_limit / number
        self._warn(
            STEP_UNSTABLE,
            f"stability_number = {number:.4g}: must not pass {method.stability_limit} with {method.name}; set a "
            f"step_size below {step:.3g} s, or another integrator",
        )

    def _warn_of_rotation(self, rotation: float, method: Integrator) -> None:
        step = self._settings.step_size * method.rotation_limit / rotation
        self._warn(
            STEP_TURNS,
            f"rotation_per_substep = {rotation:.4g} rad: must not pass {method.rotation_limit} rad; set a "
            f"step_size below {step:.3g} s, or the integrator adaptive",
        )

    def _error(self, beside: Companion) -> tuple[float, float]:
        """m, rad: by its companion, at the communication point."""
        return estimated_error(self._state, beside, self._craft, self._settings.integrator)

    def _warn_of_error(self, beside: Companion, substep: float) -> None:
        position = self._error(beside)[0]
        setting = "step_size" if self._settings.integrator.integrate else "tolerance"
        h = substep if setting == "step_size" else 0.0
        if is_lost(position, self._state, beside, self._craft, h, self._integers[SUBSTEPS]):
            self._warn(
                ERROR_LOST,
                f"error.position = {position:.4g} m after a way of {beside.way:.4g} m: cannot be trusted; set a "
                f"smaller {setting}",
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

    def _refuse_input(self, controls: Controls, craft: Craft) -> None:
        """Where no step helps, as an input drives the craft too fast."""
        if field := too_strong(controls, craft):
            name = INPUTS[Controls._fields.index(field)]
            raise ValueError(
                f"{name} = {getattr(controls, field)!r}: must not drive the craft so fast that even sub-steps of "
                f"1e-12 s are too long; the step was refused and the state of {self._time!r} s stands"
            )

    def _refuse_motion(self, error: NonFiniteError) -> NoReturn:
        name = STATES[State._fields.index(error.component)]
        raise ValueError(
            f"{name} = {error.value!r} after {self._time!r} s: must stay a finite number; the step was refused and "
            f"the state of {self._time!r} s stands; the motion is too fast for sub-steps of {error.substep!r} s: "
            "set a smaller step_size"
        ) from error

    def _refuse_watched(self, stability: float, rotation: float) -> NoReturn:
        """What is watched over a step may overflow where the motion just does not."""
        watched = zip(WATCHED, (stability, rotation), strict=True)
        name, value = next((name, value) for name, value in reversed(list(watched)) if not math.isfinite(value))
        raise ValueError(
            f"{name} = {value!r} after {self._time!r} s: must stay a finite number; the step was refused and the state "
            f"of {self._time!r} s stands; the motion is too fast for sub-steps of {self._settings.step_size!r} s: "
            "set a smaller step_size"
        )

    # ---- variables

    def _check_value(self, variable: Variable, value: float) -> None:
        if variable.name in CRAFT_PARAMETERS:
            check_parameter(variable.name, value)
        elif variable.reference == STEP_SIZE:
            check_step_size(value)
        elif variable.reference == INTEGRATOR:
            integrator(int(value))
        elif variable.reference == TOLERANCE:
            check_tolerance(value)
        elif variable.reference == ERROR_ESTIMATE:
            check_error_estimate(int(value))
        elif variable.chooses:
            self.model.check_choice(variable.chooses, int(value))

    def _chosen(self, enumeration: str) -> int:
        model = self.model
        item, number = (self._integers[v.reference] for v in (model.by_name[enumeration], model.choices[enumeration]))
        return model.chosen(enumeration, item, number)

    def _make_craft(self) -> Craft:
        values: dict[str, Any] = {
            name: self._chosen(name) if variable.enumeration else self._given[variable.reference]
            for name, variable in zip(CRAFT_PARAMETERS, CRAFT_VARIABLES, strict=True)
        }
        return Craft(**values)

    def _make_controls(self) -> Controls:
        return Controls(*inputs_of(self._given))

    def _take_up_settings(self) -> None:
        tolerance = self._given[TOLERANCE] if self._hosts_tolerance is None else self._hosts_tolerance
        self._settings = Settings(self._given[STEP_SIZE], integrator(self._chosen("integrator")), tolerance)

    def _take_up_start_values(self) -> None:
        self._craft = self._make_craft()
        self._take_up_settings()
        self._controls = self._make_controls()
        self._state = State(*(self._given[reference] for reference in STATE_REFERENCES))
        self._companion = Companion(self._state) if self._chosen("error_estimate") == ON else None
        self._tuned = False
        self._stale = True

    def _observe(self) -> dict[int, float]:
        motion = observe_motion(self._state)
        if not math.isfinite(motion[-1]):  # the speed overflows first
            refuse_non_finite(MOTION, motion)
        seen = dict(zip(MOTION_REFERENCES, self._state + motion))  # noqa: B905 - of one length
        beside = self._companion
        return seen | (dict(zip(ERROR_REFERENCES, self._error(beside), strict=True)) if beside else NO_ERROR)

    def _observe_on_demand(self) -> dict[int, float]:
        action = observe_action(self._state, self._controls, self._craft)
        refuse_non_finite(ACTION, action)
        more = (self._stability, self._rotation, self._craft.projected_area)
        return dict(zip(ON_DEMAND_REFERENCES, (*action, *more), strict=True))

    # ---- FMU state

    def _own_state(self) -> dict[str, Any]:
        return {
            "state": list(self._state if self._started() else (self._given[r] for r in STATE_REFERENCES)),
            "controls": list(self._controls),
            "craft": [getattr(self._craft, name) for name in CRAFT_PARAMETERS],
            "stability": self._stability,
            "rotation": self._rotation,
            "proposed": self._proposed,
            "companion": self._companion and [*self._companion.state, *self._companion[1:]],
        }

    def _set_own_state(self, state: dict[str, Any]) -> None:
        self._state = State(*state["state"])
        self._given.update(zip(STATE_REFERENCES, self._state, strict=True))
        self._controls = Controls(*state["controls"])
        self._craft = Craft(**dict(zip(CRAFT_PARAMETERS, state["craft"], strict=True)))
        if self._started():  # else the start values are taken up, and refused, later
            self._take_up_settings()
        self._stability, self._rotation, self._proposed = state["stability"], state["rotation"], state["proposed"]
        beside = state["companion"]
        self._companion = Companion(State(*beside[: len(STATES)]), *beside[len(STATES) :]) if beside else None
