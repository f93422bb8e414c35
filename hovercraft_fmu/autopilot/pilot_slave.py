"""The autopilot as a PythonFMU slave: it samples its inputs at the start of a communication step."""

from typing import Any

from ..fmu.interface import STATES
from ..fmu.python.life_cycle import Slave, refuse_non_finite
from ..fmu.python.wrapper import Fmi2Status
from ..fmu.variable import Variable
from ..model.dynamics import State
from .guidance import CHOICES, Commands, Orders, Pilot, Sight, Waypoint, beginning, check_order, steer
from .pilot_interface import (
    AUTOPILOT_MODEL,
    ORDERS,
    SHOWN,
    STATUS,
    WAYPOINT_NAMES,
    WAYPOINTS_MAX,
)

BY_NAME = AUTOPILOT_MODEL.by_name
MOTION = tuple(BY_NAME[name].reference for name in STATES)
SHOWN_REFERENCES = tuple(BY_NAME[name].reference for name in SHOWN)
ACTIVE, ARRIVED, STATUS_REFERENCE, MISSED, COUNT = (
    BY_NAME[name].reference for name in ("waypoint", "arrived", "status", "missed", "waypoint_count")
)
WAYPOINTS = tuple(BY_NAME[name].reference for name in WAYPOINT_NAMES)


class AutopilotSlave(Slave):
    """The autopilot behind the FMI functions of pythonfmu's wrapper."""

    model = AUTOPILOT_MODEL

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._pilot = beginning(State())
        # as the last step had them
        self._course: tuple[Waypoint, ...] = ()
        self._orders = Orders()
        # what was sampled last: read until the next step
        self._commands, self._sight = Commands(), Sight()

    def _check_value(self, variable: Variable, value: float) -> None:
        if variable.name in ORDERS:
            check_order(variable.name, value)
        elif variable.reference == COUNT and not 1 <= value <= WAYPOINTS_MAX:
            raise ValueError(f"{variable.name} = {value!r}: must be from 1 to {WAYPOINTS_MAX}")

    def _take_up_start_values(self) -> None:
        self._course, self._orders = self._make_course(), self._make_orders()
        self._pilot = beginning(self._motion())
        self._sample(0.0, self._course, self._orders)
        self._tuned = False
        self._stale = True

    def _make_course(self) -> tuple[Waypoint, ...]:
        given = [self._given[reference] for reference in WAYPOINTS[: 2 * self._integers[COUNT]]]
        return tuple(map(Waypoint, given[::2], given[1::2]))

    def _make_orders(self) -> Orders:
        values: dict[str, Any] = {
            name: (self._integers if name in CHOICES else self._given)[BY_NAME[name].reference] for name in ORDERS
        }
        return Orders(**values)

    def _motion(self) -> State:
        return State(*(self._given[reference] for reference in MOTION))

    def _advance(self, _time: float, step_size: float) -> None:
        course, orders = self._course, self._orders
        if self._tuned:
            course, orders = self._make_course(), self._make_orders()
        before = self._pilot.status
        self._sample(step_size, course, orders)
        self._course, self._orders, self._tuned = course, orders, False
        for bit, text in STATUS.items():
            if self._pilot.status & ~before & bit:
                self.log(f"status {bit}: {text} (said once)", Fmi2Status.warning)

    def _sample(self, duration: float, course: tuple[Waypoint, ...], orders: Orders) -> None:
        pilot, commands, sight = steer(self._pilot, self._motion(), course, orders, duration)
        refuse_non_finite(SHOWN, (*commands, *sight, pilot.turns))
        self._pilot, self._commands, self._sight = pilot, commands, sight

    def _observe(self) -> dict[int, float]:
        passed, count = self._pilot.passed, len(self._course)
        self._integers[ACTIVE] = min(passed + 1, count)
        self._integers[STATUS_REFERENCE], self._integers[MISSED] = self._pilot.status, self._pilot.missed
        self._booleans[ARRIVED] = passed >= count
        return dict(zip(SHOWN_REFERENCES, (*self._commands, *self._sight, self._pilot.turns), strict=True))

    def _observe_discrete(self) -> None:
        if self._stale:
            self._look()

    def _own_state(self) -> dict[str, Any]:
        return {
            "pilot": [list(self._pilot.origin), *self._pilot[1:]],
            "course": [list(point) for point in self._course],
            "orders": [getattr(self._orders, name) for name in ORDERS],
            "commands": list(self._commands),
            "sight": list(self._sight),
        }

    def _set_own_state(self, state: dict[str, Any]) -> None:
        origin, *rest = state["pilot"]
        self._pilot = Pilot(Waypoint(*origin), *rest)
        self._course = tuple(Waypoint(*point) for point in state["course"])
        self._orders = Orders(**dict(zip(ORDERS, state["orders"], strict=True)))
        self._commands, self._sight = Commands(*state["commands"]), Sight(*state["sight"])
