"""The autopilot as a PythonFMU slave: it samples its inputs at the start of a communication step."""

from typing import Any

from ..fmu.interface import STATES
from ..fmu.python.life_cycle import Slave, refuse_non_finite
from ..fmu.variable import Variable
from ..model.dynamics import State
from .guidance import Commands, Gains, Pilot, Sight, Waypoint, check_gain, steer
from .pilot_interface import AUTOPILOT_MODEL, COMMANDS, GAINS, WAYPOINTS_MAX, waypoint_names

BY_NAME = AUTOPILOT_MODEL.by_name
MOTION = tuple(BY_NAME[name].reference for name in STATES)
SHOWN = (*COMMANDS, "cross_track_error", "distance")
SHOWN_REFERENCES = tuple(BY_NAME[name].reference for name in SHOWN)
GAIN_REFERENCES = tuple(BY_NAME[name].reference for name in GAINS)
ACTIVE, ARRIVED = BY_NAME["waypoint"].reference, BY_NAME["arrived"].reference
COUNT = BY_NAME["waypoint_count"].reference
WAYPOINTS = tuple(
    tuple(BY_NAME[name].reference for name in waypoint_names(number)) for number in range(1, WAYPOINTS_MAX + 1)
)


class AutopilotSlave(Slave):
    """The autopilot behind the FMI functions of pythonfmu's wrapper."""

    model = AUTOPILOT_MODEL

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._pilot = Pilot(Waypoint(0.0, 0.0))
        self._course: tuple[Waypoint, ...] = ()
        self._gains = Gains()
        # what was sampled last: read until the next step
        self._commands, self._sight = Commands(), Sight()

    def _check_value(self, variable: Variable, value: float) -> None:
        if variable.name in GAINS:
            check_gain(variable.name, value)
        elif variable.reference == COUNT and not 1 <= value <= WAYPOINTS_MAX:
            raise ValueError(f"{variable.name} = {value!r}: must be from 1 to {WAYPOINTS_MAX}")

    def _take_up_start_values(self) -> None:
        given = self._given
        self._take_up_parameters()
        self._pilot = Pilot(Waypoint(given[MOTION[0]], given[MOTION[1]]))
        self._sample(0.0, self._gains)
        self._tuned = False
        self._stale = True

    def _take_up_parameters(self) -> None:
        given = self._given
        self._course = tuple(Waypoint(given[x], given[y]) for x, y in WAYPOINTS[: self._integers[COUNT]])
        self._gains = self._make_gains()

    def _make_gains(self) -> Gains:
        return Gains(*(self._given[reference] for reference in GAIN_REFERENCES))

    def _advance(self, _time: float, step_size: float) -> None:
        gains = self._make_gains() if self._tuned else self._gains
        self._sample(step_size, gains)
        self._gains, self._tuned = gains, False

    def _sample(self, duration: float, gains: Gains) -> None:
        motion = State(*(self._given[reference] for reference in MOTION))
        pilot, commands, sight = steer(self._pilot, motion, self._course, gains, duration)
        refuse_non_finite(SHOWN, (*commands, *sight))
        self._pilot, self._commands, self._sight = pilot, commands, sight

    def _observe(self) -> dict[int, float]:
        reached, count = self._pilot.reached, len(self._course)
        self._integers[ACTIVE] = min(reached + 1, count)
        self._booleans[ARRIVED] = reached == count
        return dict(zip(SHOWN_REFERENCES, (*self._commands, *self._sight), strict=True))

    def _observe_discrete(self) -> None:
        if self._stale:
            self._look()

    def _own_state(self) -> dict[str, Any]:
        return {
            "origin": list(self._pilot.origin),
            "reached": self._pilot.reached,
            "push": [self._pilot.push_x, self._pilot.push_y],
            "gains": [getattr(self._gains, name) for name in GAINS],
            "commands": list(self._commands),
            "sight": list(self._sight),
        }

    def _set_own_state(self, state: dict[str, Any]) -> None:
        self._take_up_parameters()
        self._gains = Gains(*state["gains"])
        self._pilot = Pilot(Waypoint(*state["origin"]), state["reached"], *state["push"])
        self._commands, self._sight = Commands(*state["commands"]), Sight(*state["sight"])
