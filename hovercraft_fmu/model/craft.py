"""The craft: its constants, checked once at the door."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from types import MappingProxyType

POSITIVE = ("mass", "inertia", "length", "width", "height")
NOT_NEGATIVE = ("drag_coefficient", "air_density", "steering_force", "skirt_friction", "gravity")
CONSTANT, DIRECTIONAL = 1, 2
DRAG_AREAS = (
    (
        "constant",
        "The mean of the areas seen bow-on and abeam, (length + width)/2 * height, for air from anywhere",
    ),
    ("directional", "The area of the box length x width x height as the air at the drag point sees it"),
)
"""The choices of drag_area, from 1: name, description."""
DERIVED = (
    ("projected_area", "m2", "length, width, height"),
    ("drag_factor", "kg/m", "air_density, projected_area, drag_coefficient"),
    ("drag_factor_ahead", "kg/m", "air_density, width, height, drag_coefficient"),
    ("drag_factor_abeam", "kg/m", "air_density, length, height, drag_coefficient"),
    ("spin_drag_factor", "kg.m2", "air_density, drag_coefficient, height, length, rotational_drag"),
    ("friction_force", "N", "skirt_friction, mass, gravity"),
    ("drag_center", "m", "drag_center_fraction, length"),
    ("thruster_moment", "N.m", "length, steering_force"),
    ("drag_rate", "1/kg", "mass, inertia, drag_center"),
    ("spin_rate", "1", "spin_drag_factor, inertia"),
)
"""The derived numbers, in the order in which they are checked: name, unit, what they are worked out of."""


@dataclass(frozen=True)
class Craft:
    """The constants of one hovercraft.

    Raises:
        ValueError: names the parameter, or the derived value that is not a finite number, the value and the rule.

    Derived values are worked out once; a communication step asks for them every time.
    """

    mass: float = 100.0
    """kg. Teaching example."""
    inertia: float = 500.0
    """kg.m2, about the vertical through the centre of gravity. Teaching example."""
    length: float = 20.0
    """m, bounding box, along the craft. Teaching example."""
    width: float = 10.0
    """m, bounding box, across the craft. Teaching example."""
    height: float = 5.0
    """m, bounding box. Teaching example."""
    drag_coefficient: float = 1.25
    """1, of the projected area. Teaching example."""
    air_density: float = 1.225
    """kg/m3. Sea level, ICAO standard atmosphere (Doc 7488)."""
    drag_center_fraction: float = -0.25
    """1, centre of drag ahead of the centre of gravity, as a fraction of the length. Teaching example."""
    steering_force: float = 3.0
    """N, of one bow thruster, full on. Teaching example."""
    thrust_min: float = 0.0
    """N; a negative value allows reverse thrust."""
    thrust_max: float = 10.0
    """N."""
    drag_area: int = CONSTANT
    """1 constant, 2 directional: the area that the drag coefficient refers to."""
    skirt_friction: float = 0.0
    """1, Coulomb's coefficient between skirt and ground; 0 is off."""
    gravity: float = 9.80665
    """m/s2, for the friction. Standard acceleration of free fall (3rd CGPM, 1901)."""
    rotational_drag: float = 0.0
    """1, the share (0 to 1) of the moment of the air on the rotating box about its own centre; 0 is off."""

    def __post_init__(self) -> None:
        for field in fields(self):
            check_parameter(field.name, getattr(self, field.name))
        if self.thrust_min > self.thrust_max:
            raise ValueError(
                f"thrust_min = {self.thrust_min!r} N: must not be above thrust_max = {self.thrust_max!r} N"
            )
        self._check_derived()

    def _check_derived(self) -> None:
        for name, unit, parts in DERIVED:
            value = getattr(self, name)
            if not math.isfinite(value):
                raise ValueError(f"{name} = {value!r} {unit}: must be a finite number; it is made of {parts}")

    @cached_property
    def projected_area(self) -> float:
        """m2: the mean of the areas seen bow-on and abeam, (L + W)/2 * H."""
        return (self.length + self.width) / 2 * self.height

    @cached_property
    def drag_factor(self) -> float:
        """kg/m: k of the drag force k*q*q at the air speed q, 0.5*rho*A*Cd."""
        return 0.5 * self.air_density * self.projected_area * self.drag_coefficient

    @cached_property
    def drag_factor_ahead(self) -> float:
        """kg/m: the same for the bow's area, W*H."""
        return 0.5 * self.air_density * (self.width * self.height) * self.drag_coefficient

    @cached_property
    def drag_factor_abeam(self) -> float:
        """kg/m: the same for the side's area, L*H."""
        return 0.5 * self.air_density * (self.length * self.height) * self.drag_coefficient

    @cached_property
    def spin_drag_factor(self) -> float:
        """kg.m2: of the moment -factor*r*|r| of the air on the rotating box about its own centre.

        A strip of the side at the distance s from the centre moves through the air at r*s and feels the cross-flow
        drag 0.5*rho*Cd*H*(r*s)*|r*s| a metre; times its lever arm s, integrated over the length (the cross-flow
        principle: Faltinsen, Sea Loads on Ships and Offshore Structures, 1990, chapter 6; Fossen, Handbook of Marine
        Craft Hydrodynamics and Motion Control, 2011, section 6.4): rho*Cd*H*L^4/64 * r*|r|.
        """
        square = self.length * self.length
        whole = self.air_density * self.drag_coefficient * self.height * (square * square) / 64
        return self.rotational_drag * whole

    @cached_property
    def friction_force(self) -> float:
        """N: the most that skirt and ground hold against a push, mu*m*g."""
        return self.skirt_friction * self.mass * self.gravity

    @cached_property
    def plain_drag(self) -> bool:
        """Whether drag is the default's: of constant area, and with no moment of its own."""
        return self.drag_area == CONSTANT and self.rotational_drag == 0.0

    @cached_property
    def rubs(self) -> bool:
        """Whether skirt and ground rub."""
        return self.skirt_friction != 0.0

    @cached_property
    def drag_rate(self) -> float:
        """1/kg: what a drag of k*q [kg/s] at the drag point damps with, at most, 2*(1/m + x_d^2/I) of it."""
        return 2.0 * (1.0 / self.mass + self.drag_center * self.drag_center / self.inertia)

    @cached_property
    def spin_rate(self) -> float:
        """1: what the rotational drag at a yaw rate r damps with, this times |r|."""
        return 2.0 * self.spin_drag_factor / self.inertia

    @cached_property
    def drag_center(self) -> float:
        """m: x of the centre of drag in the body frame; negative is behind the centre of gravity."""
        return self.drag_center_fraction * self.length

    @cached_property
    def thruster_moment(self) -> float:
        """N.m: yaw moment of the port bow thruster, full on; its lever arm is half the length."""
        return 0.5 * self.length * self.steering_force


def check_parameter(name: str, value: float) -> None:
    """Raises ValueError, with the name, the value and the rule, where one parameter alone is impossible."""
    rule = None
    if isinstance(value, bool):
        rule = "must be a number"
    elif not math.isfinite(value):
        rule = "must be a finite number"
    elif name in POSITIVE and not value > 0.0:
        rule = "must be greater than 0"
    elif name in NOT_NEGATIVE and value < 0.0:
        rule = "must not be negative"
    elif name == "drag_center_fraction" and not -0.5 <= value <= 0.5:
        rule = "must be from -0.5 (stern) to 0.5 (bow)"
    elif name == "rotational_drag" and not 0.0 <= value <= 1.0:
        rule = "must be from 0 (off) to 1 (the whole moment)"
    elif name == "drag_area" and value not in (CONSTANT, DIRECTIONAL):
        rule = "must be one of " + ", ".join(f"{i} ({name})" for i, (name, _) in enumerate(DRAG_AREAS, 1))
    if rule:
        shown = value if isinstance(value, int) else float(value)  # not numpy's kind of number
        raise ValueError(f"{name} = {shown!r}: {rule}")


PRESETS: Mapping[str, Craft] = MappingProxyType(
    {
        "textbook": Craft(),
        # The figure that circulates with the example's code as an air density; there it is in slug/ft3.
        "ice": Craft(air_density=0.0023769),
    }
)


def preset(name: str) -> Craft:
    """The named craft. Raises ValueError with the names there are."""
    if name not in PRESETS:
        raise ValueError(f"preset = {name!r}: must be one of {', '.join(PRESETS)}")
    return PRESETS[name]
