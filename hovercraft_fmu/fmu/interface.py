"""THE table of variables. The XML, the slaves, the documentation and the checks of names are made from it."""

from collections.abc import Mapping
from types import MappingProxyType

from ..model.craft import DRAG_AREAS, Craft
from ..model.error_estimate import ERROR_ESTIMATES, LARGEST, OFF
from ..model.integrators import INTEGRATORS
from .variable import Enumeration, Model, Variable

SUBSTEPS_MAX = 2147483647
"""The largest FMI Integer: the counter of sub-steps stops there."""
HELD = 1e-9
"""Relative to the limit (at least 1): an input beyond it by less is a rounding of the host's interpolation."""

INPUT_HELD, COUNTER_STOPPED, STEP_UNSTABLE, STEP_TURNS, ERROR_LOST = 1, 2, 4, 8, 16
WARNINGS: Mapping[int, str] = MappingProxyType(
    {
        INPUT_HELD: "an input was outside its limits and was held at the limit",
        COUNTER_STOPPED: "the counter of sub-steps reached its end and stopped",
        STEP_UNSTABLE: "the sub-step is too long for the drag: answers are bounded but wrong, or diverge",
        STEP_TURNS: "the craft turns too far in a sub-step: answers are wrong however stable",
        ERROR_LOST: "the error estimate cannot be trusted: the sub-step is too long to tell",
    }
)
"""The bits of the variable `warnings`; each is logged when it is first set."""


INTEGRATOR = Enumeration(
    "Integrator",
    "Numerical method of a sub-step",
    tuple((method.name, method.description) for method in INTEGRATORS),
)
DRAG_AREA = Enumeration("DragArea", "The area that the drag coefficient refers to", DRAG_AREAS)
ERROR_ESTIMATE = Enumeration("ErrorEstimate", "Whether the FMU estimates its own error", ERROR_ESTIMATES)
ENUMERATIONS = (INTEGRATOR, DRAG_AREA, ERROR_ESTIMATE)


_CRAFT = Craft()


def _number_of(reference: int, name: str, enumeration: Enumeration) -> Variable:
    """The Integer beside an Enumeration."""
    return Variable(
        reference, f"{name}_number", "parameter", "fixed", None, 0,
        f"For a host that sets no Enumerations: 0 (as {name} says), {enumeration.listed}; it comes before {name}, "
        "which must be left as it is or be the same",
        kind="Integer", minimum=0, maximum=len(enumeration.items), chooses=name,
    )  # fmt: skip


VARIABLES: tuple[Variable, ...] = (
    # -- inputs
    Variable(0, "thrust", "input", "continuous", "N", 5.0,
             "Thrust of the propeller, forward; held inside thrust_min ... thrust_max"),
    Variable(1, "port_thruster", "input", "continuous", "1", 0.0,
             "Port bow thruster, 0 (off) to 1 (full), held inside; pushes the bow to starboard",
             minimum=0.0, maximum=1.0),
    Variable(2, "starboard_thruster", "input", "continuous", "1", 0.0,
             "Starboard bow thruster, 0 (off) to 1 (full), held inside; pushes the bow to port",
             minimum=0.0, maximum=1.0),
    # -- the state
    Variable(3, "pose.x", "output", "continuous", "m", 0.0,
             "Position of the centre of gravity, to the right", nominal=10.0),
    Variable(4, "pose.y", "output", "continuous", "m", 0.0,
             "Position of the centre of gravity, down the screen", nominal=10.0),
    Variable(5, "pose.heading", "output", "continuous", "rad", 0.0,
             "Heading: 0 along +x, grows toward +y (a turn to starboard); counts whole turns", nominal=1.0),
    Variable(6, "velocity.x", "output", "continuous", "m/s", 0.0,
             "Velocity of the centre of gravity, world frame", nominal=0.1, derivative_of="pose.x"),
    Variable(7, "velocity.y", "output", "continuous", "m/s", 0.0,
             "Velocity of the centre of gravity, world frame", nominal=0.1, derivative_of="pose.y"),
    Variable(8, "velocity.yaw_rate", "output", "continuous", "rad/s", 0.0,
             "Yaw rate, positive to starboard", nominal=0.1, derivative_of="pose.heading"),
    # -- calculated from the state, the inputs of the step that led to it, and the parameters
    Variable(9, "body.surge", "output", "continuous", "m/s", None,
             "Velocity of the centre of gravity, forward", nominal=0.1,
             depends_on=("pose.heading", "velocity.x", "velocity.y")),
    Variable(10, "body.sway", "output", "continuous", "m/s", None,
             "Velocity of the centre of gravity, to starboard", nominal=0.1,
             depends_on=("pose.heading", "velocity.x", "velocity.y")),
    Variable(11, "speed", "output", "continuous", "m/s", None,
             "Speed over ground of the centre of gravity", minimum=0.0, nominal=0.1,
             depends_on=("velocity.x", "velocity.y")),
    Variable(12, "force.x", "local", "continuous", "N", None, "Total force on the craft, world frame"),
    Variable(13, "force.y", "local", "continuous", "N", None, "Total force on the craft, world frame"),
    Variable(14, "moment", "local", "continuous", "N.m", None,
             "Total moment about the centre of gravity, positive to starboard"),
    Variable(15, "acceleration.x", "local", "continuous", "m/s2", None,
             "Acceleration of the centre of gravity, world frame", derivative_of="velocity.x"),
    Variable(16, "acceleration.y", "local", "continuous", "m/s2", None,
             "Acceleration of the centre of gravity, world frame", derivative_of="velocity.y"),
    Variable(17, "acceleration.yaw", "local", "continuous", "rad/s2", None,
             "Yaw acceleration", derivative_of="velocity.yaw_rate"),
    Variable(18, "applied.thrust", "local", "continuous", "N", None, "Thrust after saturation"),
    Variable(19, "applied.steering", "local", "continuous", "N", None,
             "Side force of both bow thrusters after saturation, to starboard"),
    Variable(20, "substeps", "local", "discrete", None, None,
             f"Sub-steps since initialization, of adaptive those refused, too; stops at {SUBSTEPS_MAX}",
             kind="Integer", minimum=0, maximum=SUBSTEPS_MAX),
    # -- parameters
    Variable(21, "mass", "parameter", "fixed", "kg", _CRAFT.mass, "Mass, greater than 0"),
    Variable(22, "inertia", "parameter", "fixed", "kg.m2", _CRAFT.inertia,
             "Moment of inertia about the vertical through the centre of gravity, greater than 0"),
    Variable(23, "length", "parameter", "fixed", "m", _CRAFT.length,
             "Length of the bounding box, greater than 0"),
    Variable(24, "width", "parameter", "fixed", "m", _CRAFT.width,
             "Width of the bounding box, greater than 0"),
    Variable(25, "height", "parameter", "fixed", "m", _CRAFT.height,
             "Height of the bounding box, greater than 0"),
    Variable(26, "drag_coefficient", "parameter", "tunable", "1", _CRAFT.drag_coefficient,
             "Air drag coefficient of the projected area", minimum=0.0),
    Variable(27, "air_density", "parameter", "tunable", "kg/m3", _CRAFT.air_density,
             "Density of the air; the start is the sea-level value of the ICAO standard atmosphere", minimum=0.0),
    Variable(28, "drag_center_fraction", "parameter", "fixed", "1", _CRAFT.drag_center_fraction,
             "Centre of drag ahead of the centre of gravity, as a fraction of the length; negative: behind it",
             minimum=-0.5, maximum=0.5),
    Variable(29, "projected_area", "calculatedParameter", "fixed", "m2", None,
             "Area that the drag coefficient refers to where drag_area is constant: (length + width) / 2 * height",
             depends_on=("length", "width", "height")),
    Variable(30, "steering_force", "parameter", "tunable", "N", _CRAFT.steering_force,
             "Side force of one bow thruster, full on", minimum=0.0),
    Variable(31, "thrust_min", "parameter", "tunable", "N", _CRAFT.thrust_min,
             "Lower limit of the thrust; negative allows reverse thrust"),
    Variable(32, "thrust_max", "parameter", "tunable", "N", _CRAFT.thrust_max,
             "Upper limit of the thrust, not below thrust_min"),
    Variable(33, "step_size", "parameter", "fixed", "s", 0.001,
             "The sub-step: a communication step is cut into steps of this size, greater than 0", nominal=0.001),
    Variable(34, "integrator", "parameter", "fixed", None, 1,
             "The method that carries the state over a sub-step", kind="Enumeration",
             minimum=1, maximum=len(INTEGRATOR.items), enumeration=INTEGRATOR),
    # -- added later: value references only grow
    Variable(35, "warnings", "local", "discrete", None, None,
             "Sum of the warnings since initialization: " + "; ".join(f"{b}: {t}" for b, t in WARNINGS.items()),
             kind="Integer", minimum=0, maximum=sum(WARNINGS)),
    Variable(36, "tolerance", "parameter", "fixed", "1", 1e-6,
             "For the adaptive integrator: largest error of a step, of any component of the state, in SI units, "
             "greater than 0; a tolerance that the host gives with the experiment wins", nominal=1e-6),
    Variable(37, "stability_number", "local", "continuous", "1", None,
             "Largest so far, over every sub-step, of sub-step * 2*k*q*(1/mass + x_d^2/inertia), the fastest "
             "linearized drag rate (rotational drag adds its own); the classical limits are 2 for Euler, 2.785 for RK4",
             minimum=0.0),
    Variable(38, "rotation_per_substep", "local", "continuous", "rad", None,
             "Largest turn in a sub-step so far, over every sub-step: |yaw rate| * sub-step", minimum=0.0),
    # -- what a scene may ask for: each off by default
    Variable(39, "wind.x", "input", "continuous", "m/s", 0.0,
             "Velocity of the air over ground, world frame; drag acts on the velocity through the air", nominal=0.1),
    Variable(40, "wind.y", "input", "continuous", "m/s", 0.0,
             "Velocity of the air over ground, world frame, down the screen", nominal=0.1),
    Variable(41, "drag_area", "parameter", "fixed", None, _CRAFT.drag_area, DRAG_AREA.description,
             kind="Enumeration", minimum=1, maximum=len(DRAG_AREA.items), enumeration=DRAG_AREA),
    Variable(42, "skirt_friction", "parameter", "tunable", "1", _CRAFT.skirt_friction,
             "Coulomb's coefficient of the friction between skirt and ground; 0 is off", minimum=0.0),
    Variable(43, "gravity", "parameter", "fixed", "m/s2", _CRAFT.gravity,
             "Acceleration of free fall, for the friction", minimum=0.0),
    Variable(44, "rotational_drag", "parameter", "tunable", "1", _CRAFT.rotational_drag,
             "Share of the moment of the air on the rotating box about its own centre; 0 is off",
             minimum=0.0, maximum=1.0),
    _number_of(45, "integrator", INTEGRATOR),
    _number_of(46, "drag_area", DRAG_AREA),
    Variable(47, "error_estimate", "parameter", "fixed", None, OFF, ERROR_ESTIMATE.description + ", in co-simulation",
             kind="Enumeration", minimum=1, maximum=len(ERROR_ESTIMATE.items), enumeration=ERROR_ESTIMATE),
    _number_of(48, "error_estimate", ERROR_ESTIMATE),
    Variable(49, "error.position", "output", "discrete", "m", None,
             "Estimated distance of the position from the exact solution for the inputs that were given; 0 where "
             f"error_estimate is off, {LARGEST:.0e} where there is none", minimum=0.0, maximum=LARGEST),
    Variable(50, "error.heading", "output", "discrete", "rad", None,
             "Estimated distance of the heading from it, in the same way", minimum=0.0, maximum=LARGEST),
    # -- what else a scene has, from outside
    Variable(51, "external.force.x", "input", "continuous", "N", 0.0,
             "Force from outside (a slope, a wall, a line), world frame, through the centre of gravity"),
    Variable(52, "external.force.y", "input", "continuous", "N", 0.0,
             "Force from outside, world frame, down the screen, through the centre of gravity"),
    Variable(53, "external.moment", "input", "continuous", "N.m", 0.0,
             "Moment from outside about the centre of gravity, positive to starboard"),
)  # fmt: skip

TIME = Variable(1000, "time", "independent", "continuous", "s", None, "Simulation time")
"""FMI 3.0 wants it among the variables. Its value reference is none of the table's, which grow by one."""

BY_NAME: Mapping[str, Variable] = MappingProxyType({variable.name: variable for variable in VARIABLES})

ACTUATORS = ("thrust", "port_thruster", "starboard_thruster")
"""They have limits."""
WIND = ("wind.x", "wind.y")
EXTERNAL = ("external.force.x", "external.force.y", "external.moment")
INPUTS = (*ACTUATORS, *WIND, *EXTERNAL)
"""In the order of Controls."""
STATES = ("pose.x", "pose.y", "pose.heading", "velocity.x", "velocity.y", "velocity.yaw_rate")
"""In the order of State."""
OUTPUTS = tuple(v.name for v in VARIABLES if v.causality == "output")
DERIVATIVES = tuple(v.name for state in STATES for v in VARIABLES if v.derivative_of == state)
"""Of the states, in their order."""
CRAFT_PARAMETERS = tuple(v.name for v in VARIABLES if v.name in Craft.__dataclass_fields__)
WATCHED = ("stability_number", "rotation_per_substep")
"""What decides whether to trust the answers; kept by who steps, since initialization."""
ERRORS = ("error.position", "error.heading")
"""In the order of `estimated_error`."""
MOTION = ("body.surge", "body.sway", "speed")
"""In the order of `observe_motion`."""
ACTION = (
    "force.x", "force.y", "moment", "acceleration.x", "acceleration.y", "acceleration.yaw",
    "applied.thrust", "applied.steering",
)  # fmt: skip
"""In the order of `observe_action`."""
HOVERCRAFT = Model(
    "Hovercraft",
    "Hovercraft that moves in the plane: a rigid body with one propeller, two bow thrusters, and air drag that acts "
    "behind the centre of gravity",
    VARIABLES,
    stop_time=60.0,
    communication_step=0.01,
)
