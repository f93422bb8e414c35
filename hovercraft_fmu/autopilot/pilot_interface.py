"""The autopilot's table of variables. Inputs and outputs have the names that they have in the hovercraft."""

from dataclasses import fields

from ..fmu.interface import BY_NAME, STATES
from ..fmu.variable import Model, Variable
from .guidance import (
    ARRIVED,
    AWAY,
    CHOICES,
    CIRCLING,
    LONG_STEP,
    MISSED,
    NOTHING_TO_STEER,
    POSITIVE,
    SATURATED,
    UNITS_OF_ORDERS,
    WIND,
    Orders,
)

WAYPOINTS_FIRST, WAYPOINTS_MAX = 8, 32
"""So many of them have the value references that they had when there were no more; and how many there are."""
DEMO_COURSE = ((100.0, 0.0), (160.0, 60.0), (100.0, 120.0), (200.0, 180.0), (40.0, 180.0), (0.0, 90.0))
"""m: the waypoints of the start values, thirty lengths of the textbook craft in all."""
COMMANDS = ("thrust", "port_thruster", "starboard_thruster")
"""In the order of `guidance.Commands`."""
SHOWN = (*COMMANDS, "cross_track_error", "distance", "turns")
"""The Reals that are worked out."""
ORDERS = tuple(field.name for field in fields(Orders))
STATUS = {
    ARRIVED: "the course is at its end: every waypoint was reached or missed",
    MISSED: "a waypoint was missed",
    AWAY: "far away from the leg: further from its waypoint than the leg is long, and two lookaheads more",
    CIRCLING: "it circles: a whole turn round the active waypoint",
    SATURATED: "a bow thruster was at its limit for half of the last minute",
    WIND: "the wind is stronger than it stems: the largest thrust made no way for half of the last minute",
    LONG_STEP: "the communication step is too long for the loop of the heading",
    NOTHING_TO_STEER: "there is nothing to steer with: steering_force is 0",
}
"""The bits of the variable `status`; each is logged when it is first set."""
_STATUS = "; ".join(f"{bit}: {text}" for bit, text in STATUS.items())
_MEANING = {
    "acceptance_radius": "A waypoint this near is reached",
    "cruise_speed": "Speed over ground that is held on a leg",
    "lookahead": "The point of the leg that the craft goes to lies so far ahead of it",
    "velocity_gain": "Force that is asked for per error of the velocity",
    "integral_time": "Time in which the lasting part of that force is learned",
    "heading_gain": "Bow thruster per error of the heading",
    "yaw_rate_gain": "Bow thruster per yaw rate",
    "thrust_max": "The largest thrust that is asked for",
    "thrust_min": "The smallest thrust that is asked for; below 0 it brakes with reverse thrust, else it turns round",
    "turn_rate": "The heading that is asked for changes at most so fast",
    "mass": "Of the craft, for the gains that follow from it",
    "inertia": "Of the craft about the vertical, for the gains that follow from it",
    "length": "Of the craft: the bow thrusters push half of it ahead of the centre of gravity",
    "steering_force": "Of one bow thruster of the craft, full on; 0: there is nothing to steer with",
    "turn_back": "A waypoint that was missed: 0 leave it and begin the next leg, 1 turn back to it",
    "keep_station": "At the end of the course: 0 thrust and thrusters off, 1 keep the place in the wind",
}


def waypoint_names(number: int) -> tuple[str, str]:
    """Of its x and y; counted from 1."""
    return f"waypoint[{number}].x", f"waypoint[{number}].y"


WAYPOINT_NAMES = tuple(name for i in range(1, WAYPOINTS_MAX + 1) for name in waypoint_names(i))
_COORDINATES = [part for point in DEMO_COURSE for part in point] + [0.0] * 2 * (WAYPOINTS_MAX - len(DEMO_COURSE))
_GUIDED_BY = (*STATES, "waypoint_count", *WAYPOINT_NAMES, *ORDERS)


def _output(
    reference: int, name: str, unit: str, text: str, minimum: float | None = None, maximum: float | None = None
) -> Variable:
    return Variable(
        reference, name, "output", "discrete", unit, None, text,
        minimum=minimum, maximum=maximum, depends_on=_GUIDED_BY,
    )  # fmt: skip


def _number(reference: int, name: str, text: str, minimum: int, maximum: int) -> Variable:
    return Variable(
        reference, name, "output", "discrete", None, None, text,
        kind="Integer", minimum=minimum, maximum=maximum, depends_on=_GUIDED_BY,
    )  # fmt: skip


def _waypoints(reference: int, first: int, last: int) -> list[Variable]:
    return [
        Variable(reference + i, WAYPOINT_NAMES[i], "parameter", "tunable", "m", _COORDINATES[i],
                 f"Waypoint {i // 2 + 1}, world frame, {('to the right', 'down the screen')[i % 2]}", nominal=10.0)
        for i in range(2 * first - 2, 2 * last)
    ]  # fmt: skip


def _order(reference: int, name: str) -> Variable:
    start = getattr(Orders(), name)
    if name in CHOICES:
        return Variable(reference, name, "parameter", "tunable", None, start, _MEANING[name], kind="Integer",
                        minimum=0, maximum=1)  # fmt: skip
    rule = "; greater than 0" if name in POSITIVE else "" if start else "; 0: it follows from the craft"
    if name == "thrust_min":
        return Variable(reference, name, "parameter", "tunable", "N", start, _MEANING[name], maximum=0.0)
    return Variable(reference, name, "parameter", "tunable", UNITS_OF_ORDERS[name], start, _MEANING[name] + rule,
                    minimum=None if name in POSITIVE else 0.0)  # fmt: skip


_ORDERS_FIRST = ORDERS.index("thrust_max") + 1
VARIABLES: tuple[Variable, ...] = (
    *(
        Variable(reference, name, "input", "continuous", BY_NAME[name].unit, 0.0, BY_NAME[name].description,
                 nominal=BY_NAME[name].nominal)
        for reference, name in enumerate(STATES)
    ),
    _output(6, "thrust", "N", "Thrust of the propeller, forward; below 0 only where thrust_min is"),
    _output(7, "port_thruster", "1", "Port bow thruster; never together with the other one", minimum=0.0, maximum=1.0),
    _output(8, "starboard_thruster", "1", "Starboard bow thruster; never together with the other one",
            minimum=0.0, maximum=1.0),
    _number(9, "waypoint", "Number of the active waypoint, from 1; the last one's at the end of the course",
            1, WAYPOINTS_MAX),
    _output(10, "cross_track_error", "m", "Distance off the leg to the active waypoint, positive to starboard of it"),
    _output(11, "distance", "m", "Distance to the active waypoint", minimum=0.0),
    Variable(12, "arrived", "output", "discrete", None, None,
             "The course is at its end: every waypoint was reached or missed", kind="Boolean", depends_on=_GUIDED_BY),
    Variable(13, "waypoint_count", "parameter", "tunable", None, len(DEMO_COURSE),
             "How many of the waypoints are to be reached", kind="Integer", minimum=1, maximum=WAYPOINTS_MAX),
    *_waypoints(14, 1, WAYPOINTS_FIRST),
    *(_order(30 + i, name) for i, name in enumerate(ORDERS[:_ORDERS_FIRST])),
    _number(38, "status", "Sum of what happened since initialization: " + _STATUS, 0, 255),
    _number(39, "missed", "Number of the waypoints that were missed", 0, WAYPOINTS_MAX),
    _output(40, "turns", "1", "Turns round the active waypoint, clockwise on the screen"),
    *(_order(41 + i, name) for i, name in enumerate(ORDERS[_ORDERS_FIRST:])),
    *_waypoints(49 - 2 * WAYPOINTS_FIRST, WAYPOINTS_FIRST + 1, WAYPOINTS_MAX),
)  # fmt: skip
AUTOPILOT_MODEL = Model(
    "Autopilot",
    "Autopilot of the hovercraft: from waypoint to waypoint along lines of sight, in any wind that it can stem",
    VARIABLES,
    stop_time=2400.0,
    communication_step=0.5,
)
