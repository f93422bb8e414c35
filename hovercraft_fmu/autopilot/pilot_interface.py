"""The autopilot's table of variables. Inputs and outputs have the names that they have in the hovercraft."""

from dataclasses import fields

from ..fmu.interface import BY_NAME, STATES
from ..fmu.variable import Model, Variable
from .guidance import UNITS_OF_GAINS, Gains

WAYPOINTS_MAX = 8
DEMO_COURSE = ((100.0, 0.0), (160.0, 60.0), (100.0, 120.0), (200.0, 180.0), (40.0, 180.0), (0.0, 90.0))
"""m: the waypoints of the start values, thirty lengths of the textbook craft in all."""
COMMANDS = ("thrust", "port_thruster", "starboard_thruster")
"""In the order of `guidance.Commands`."""
GAINS = tuple(field.name for field in fields(Gains))
_MEANING = {
    "acceptance_radius": "A waypoint this near is reached",
    "cruise_speed": "Speed over ground that is held on a leg",
    "lookahead": "The point of the leg that the craft goes to lies so far ahead of it",
    "velocity_gain": "Force that is asked for per error of the velocity",
    "integral_time": "Time in which the lasting part of that force is learned",
    "heading_gain": "Bow thruster per error of the heading",
    "yaw_rate_gain": "Bow thruster per yaw rate",
    "thrust_max": "The largest thrust that is asked for",
}


def waypoint_names(number: int) -> tuple[str, str]:
    """Of its x and y; counted from 1."""
    return f"waypoint[{number}].x", f"waypoint[{number}].y"


_WAYPOINT_NAMES = tuple(name for i in range(1, WAYPOINTS_MAX + 1) for name in waypoint_names(i))
_COORDINATES = [part for point in DEMO_COURSE for part in point] + [0.0] * 2 * (WAYPOINTS_MAX - len(DEMO_COURSE))
_GUIDED_BY = (*STATES, "waypoint_count", *_WAYPOINT_NAMES, *GAINS)


def _output(
    reference: int, name: str, unit: str, text: str, minimum: float | None = None, maximum: float | None = None
) -> Variable:
    return Variable(
        reference, name, "output", "discrete", unit, None, text,
        minimum=minimum, maximum=maximum, depends_on=_GUIDED_BY,
    )  # fmt: skip


VARIABLES: tuple[Variable, ...] = (
    *(
        Variable(reference, name, "input", "continuous", BY_NAME[name].unit, 0.0, BY_NAME[name].description,
                 nominal=BY_NAME[name].nominal)
        for reference, name in enumerate(STATES)
    ),
    _output(6, "thrust", "N", "Thrust of the propeller, forward", minimum=0.0),
    _output(7, "port_thruster", "1", "Port bow thruster; never together with the other one", minimum=0.0, maximum=1.0),
    _output(8, "starboard_thruster", "1", "Starboard bow thruster; never together with the other one",
            minimum=0.0, maximum=1.0),
    Variable(9, "waypoint", "output", "discrete", None, None,
             "Number of the active waypoint, from 1; the last one's when all are reached",
             kind="Integer", minimum=1, maximum=WAYPOINTS_MAX, depends_on=_GUIDED_BY),
    _output(10, "cross_track_error", "m", "Distance off the leg to the active waypoint, positive to starboard of it"),
    _output(11, "distance", "m", "Distance to the active waypoint", minimum=0.0),
    Variable(12, "arrived", "output", "discrete", None, None,
             "All waypoints are reached; thrust and thrusters stay off", kind="Boolean", depends_on=_GUIDED_BY),
    Variable(13, "waypoint_count", "parameter", "fixed", None, len(DEMO_COURSE),
             "How many of the waypoints are to be reached", kind="Integer", minimum=1, maximum=WAYPOINTS_MAX),
    *(
        Variable(14 + i, name, "parameter", "fixed", "m", start,
                 f"Waypoint {i // 2 + 1}, world frame, {('to the right', 'down the screen')[i % 2]}", nominal=10.0)
        for i, (name, start) in enumerate(zip(_WAYPOINT_NAMES, _COORDINATES, strict=True))
    ),
    *(
        Variable(14 + 2 * WAYPOINTS_MAX + i, name, "parameter", "tunable", UNITS_OF_GAINS[name],
                 getattr(Gains(), name), f"{_MEANING[name]}, greater than 0")
        for i, name in enumerate(GAINS)
    ),
)  # fmt: skip
AUTOPILOT_MODEL = Model(
    "Autopilot",
    "Autopilot of the hovercraft: from waypoint to waypoint along lines of sight, in any wind that it can stem",
    VARIABLES,
    stop_time=2400.0,
    communication_step=0.5,
)
