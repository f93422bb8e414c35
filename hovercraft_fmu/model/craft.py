"""The craft: its constants, checked once at the door."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cached_property
from types import MappingProxyType
from typing import cast

POSITIVE = ("mass", "inertia", "length", "width", "height")
NOT_NEGATIVE = ("drag_coefficient", "air_density", "steering_force")


@dataclass(frozen=True)
class Craft:
    """The constants of one hovercraft; a batch of craft has numpy arrays in the fields that differ.

    Raises:
        ValueError: names the parameter, the value and the rule.

    Derived values are worked out when they are first asked for; a communication step asks for them every time.
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

    def __post_init__(self) -> None:
        for field in fields(self):
            for value in _items(getattr(self, field.name)):
                check_parameter(field.name, value)
        # minus, not <=: arrays of craft pass through here too
        for room in _items(self.thrust_max - self.thrust_min):
            if room < 0.0:
                raise ValueError(
                    f"thrust_min = {self.thrust_min!r} N: must not be above thrust_max = {self.thrust_max!r} N"
                )

    @cached_property
    def projected_area(self) -> float:
        """m2: the mean of the areas seen bow-on and abeam, (L + W)/2 * H."""
        return (self.length + self.width) / 2 * self.height

    @cached_property
    def drag_factor(self) -> float:
        """kg/m: k of the drag force k*q*q at the air speed q, 0.5*rho*A*Cd."""
        return 0.5 * self.air_density * self.projected_area * self.drag_coefficient

    @cached_property
    def drag_center(self) -> float:
        """m: x of the centre of drag in the body frame; negative is behind the centre of gravity."""
        return self.drag_center_fraction * self.length

    @cached_property
    def thruster_moment(self) -> float:
        """N.m: yaw moment of the port bow thruster, full on; its lever arm is half the length."""
        return 0.5 * self.length * self.steering_force


def _items(value: float) -> Iterable[float]:
    """One number, or all of an array of numbers (no numpy here: the FMU's host may not have it)."""
    return cast(Iterable[float], getattr(value, "flat", (value,)))


def check_parameter(name: str, value: float) -> None:
    """Raises ValueError, with the name, the value and the rule, where one parameter alone is impossible."""
    rule = None
    if not math.isfinite(value):
        rule = "must be a finite number"
    elif name in POSITIVE and not value > 0.0:
        rule = "must be greater than 0"
    elif name in NOT_NEGATIVE and value < 0.0:
        rule = "must not be negative"
    elif name == "drag_center_fraction" and not -0.5 <= value <= 0.5:
        rule = "must be from -0.5 (stern) to 0.5 (bow)"
    if rule:
        raise ValueError(f"{name} = {float(value)!r}: {rule}")


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


def with_parameters(craft: Craft, parameters: Mapping[str, float]) -> Craft:
    """The craft with some parameters changed. Raises ValueError as Craft does."""
    return replace(craft, **parameters)
