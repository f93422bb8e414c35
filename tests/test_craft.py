import math
import re
from dataclasses import FrozenInstanceError, fields
from functools import cached_property

import pytest

from hovercraft_fmu.model.craft import DERIVED, PRESETS, Craft, preset


def test_defaults_are_the_textbook_craft() -> None:
    craft = Craft()
    assert (craft.mass, craft.inertia) == (100.0, 500.0)
    assert (craft.length, craft.width, craft.height) == (20.0, 10.0, 5.0)
    assert (craft.drag_coefficient, craft.air_density, craft.drag_center_fraction) == (1.25, 1.225, -0.25)
    assert (craft.steering_force, craft.thrust_min, craft.thrust_max) == (3.0, 0.0, 10.0)
    assert PRESETS["textbook"] == craft
    assert PRESETS["ice"] == Craft(air_density=0.0023769)


def test_derived_values() -> None:
    craft = Craft()
    assert craft.projected_area == 75.0
    assert craft.drag_center == -5.0
    assert craft.thruster_moment == 30.0
    assert craft.drag_factor / craft.mass == pytest.approx(0.574218750, rel=1e-15)  # kappa of the model's page
    assert not {"projected_area", "drag_center", "thruster_moment", "drag_factor"} & {f.name for f in fields(Craft)}


@pytest.mark.parametrize(
    ("name", "value", "rule"),
    [
        *((name, value, "greater than 0") for name in ("mass", "inertia", "length", "width", "height")
          for value in (0.0, -1.0)),
        *((name, -1e-9, "not be negative") for name in ("drag_coefficient", "air_density", "steering_force")),
        *((field.name, value, "finite") for field in fields(Craft) for value in (math.nan, math.inf, -math.inf)),
        ("drag_center_fraction", 0.51, "-0.5"),
        ("drag_center_fraction", -0.51, "-0.5"),
        ("thrust_min", 10.5, "thrust_max"),
        ("thrust_max", -0.5, "thrust_max"),
        *((name, -1e-9, "not be negative") for name in ("skirt_friction", "gravity")),
        *((name, True, f"{name} = True: must be a number") for name in ("mass", "drag_area")),
        *(("rotational_drag", value, "from 0 .off. to 1") for value in (-0.01, 1.01)),
        *(("drag_area", value, "must be one of 1 .constant., 2 .directional.") for value in (0, 3)),
    ],
)  # fmt: skip
def test_impossible_values_are_named(name: str, value: float, rule: str) -> None:
    with pytest.raises(ValueError, match=rule) as caught:
        Craft(**{name: value})  # type: ignore[arg-type]
    assert name in str(caught.value)
    assert repr(value) in str(caught.value)


THICK_AIR = {"height": 1.0, "air_density": 1e308, "drag_coefficient": 5.0}
OUT_OF_RANGE: dict[str, dict[str, float]] = {
    "projected_area = inf m2": {"length": 1e200, "width": 1e200, "height": 1e200},
    "drag_factor = inf kg/m": {"air_density": 1e300, "drag_coefficient": 1e300},
    "drag_factor = nan kg/m": {"air_density": 1e308, "drag_coefficient": 0.0},
    "drag_factor_ahead = inf kg/m": {**THICK_AIR, "length": 1e-300, "width": 1.0},
    "drag_factor_abeam = inf kg/m": {**THICK_AIR, "length": 1.0, "width": 1e-300},
    "spin_drag_factor = inf kg.m2": {"length": 1e77, "rotational_drag": 1.0},
    "spin_drag_factor = nan kg.m2": {"length": 1e80},
    "friction_force = inf N": {"skirt_friction": 1e200, "mass": 1e200},
    "thruster_moment = inf N.m": {"steering_force": 1e308},
    "drag_rate = inf 1/kg": {"mass": 1e-320},
    "spin_rate = inf 1": {"inertia": 1e-200, "drag_center_fraction": 0.0, "air_density": 1e120, "rotational_drag": 1.0},
}  # fmt: skip
"""What a craft's derived value comes to, and a craft that has it; each of its parameters is possible alone."""


@pytest.mark.parametrize("what", OUT_OF_RANGE)
def test_a_derived_value_out_of_range_is_named(what: str) -> None:
    name = what.split()[0]
    parts = {name: parts for name, _, parts in DERIVED}[name]
    with pytest.raises(ValueError, match=rf"^{re.escape(what)}: must be a finite number; it is made of {parts}$"):
        Craft(**OUT_OF_RANGE[what])  # type: ignore[arg-type]


def test_every_derived_number_is_checked() -> None:
    numbers = {name for name, value in vars(Craft).items() if isinstance(value, cached_property)}
    assert numbers - {"plain_drag", "rubs"} == {name for name, _, _ in DERIVED}
    # a finite length times at most a half is finite
    assert {what.split()[0] for what in OUT_OF_RANGE} == {name for name, _, _ in DERIVED} - {"drag_center"}


def test_frozen() -> None:
    with pytest.raises(FrozenInstanceError):
        Craft().mass = 1.0  # type: ignore[misc]


def test_unknown_preset_names_the_known_ones() -> None:
    with pytest.raises(ValueError, match="'moon': must be one of textbook, ice"):
        preset("moon")
