"""The promises of the interface: names, units and starts exactly so, and a complete description."""

import re
import zipfile
from collections import Counter
from pathlib import Path
from typing import Any

import fmpy
import pytest
from lxml import etree

from hovercraft_fmu.fmu.interface import ACTION, ERRORS, HOVERCRAFT, INPUTS, MOTION, STATES, VARIABLES, WATCHED
from hovercraft_fmu.fmu.variable import UNITS
from hovercraft_fmu.model.integrators import INTEGRATORS

# name: (causality, variability, initial, unit, start)
TABLE = {
    "thrust": ("input", "continuous", None, "N", "5.0"),
    "port_thruster": ("input", "continuous", None, "1", "0.0"),
    "starboard_thruster": ("input", "continuous", None, "1", "0.0"),
    "pose.x": ("output", "continuous", "exact", "m", "0.0"),
    "pose.y": ("output", "continuous", "exact", "m", "0.0"),
    "pose.heading": ("output", "continuous", "exact", "rad", "0.0"),
    "velocity.x": ("output", "continuous", "exact", "m/s", "0.0"),
    "velocity.y": ("output", "continuous", "exact", "m/s", "0.0"),
    "velocity.yaw_rate": ("output", "continuous", "exact", "rad/s", "0.0"),
    "body.surge": ("output", "continuous", "calculated", "m/s", None),
    "body.sway": ("output", "continuous", "calculated", "m/s", None),
    "speed": ("output", "continuous", "calculated", "m/s", None),
    "force.x": ("local", "continuous", "calculated", "N", None),
    "force.y": ("local", "continuous", "calculated", "N", None),
    "moment": ("local", "continuous", "calculated", "N.m", None),
    "acceleration.x": ("local", "continuous", "calculated", "m/s2", None),
    "acceleration.y": ("local", "continuous", "calculated", "m/s2", None),
    "acceleration.yaw": ("local", "continuous", "calculated", "rad/s2", None),
    "applied.thrust": ("local", "continuous", "calculated", "N", None),
    "applied.steering": ("local", "continuous", "calculated", "N", None),
    "substeps": ("local", "discrete", "calculated", None, None),
    "mass": ("parameter", "fixed", "exact", "kg", "100.0"),
    "inertia": ("parameter", "fixed", "exact", "kg.m2", "500.0"),
    "length": ("parameter", "fixed", "exact", "m", "20.0"),
    "width": ("parameter", "fixed", "exact", "m", "10.0"),
    "height": ("parameter", "fixed", "exact", "m", "5.0"),
    "drag_coefficient": ("parameter", "tunable", "exact", "1", "1.25"),
    "air_density": ("parameter", "tunable", "exact", "kg/m3", "1.225"),
    "drag_center_fraction": ("parameter", "fixed", "exact", "1", "-0.25"),
    "projected_area": ("calculatedParameter", "fixed", "calculated", "m2", None),
    "steering_force": ("parameter", "tunable", "exact", "N", "3.0"),
    "thrust_min": ("parameter", "tunable", "exact", "N", "0.0"),
    "thrust_max": ("parameter", "tunable", "exact", "N", "10.0"),
    "step_size": ("parameter", "fixed", "exact", "s", "0.001"),
    "integrator": ("parameter", "fixed", "exact", None, "1"),
    "warnings": ("local", "discrete", "calculated", None, None),
    "tolerance": ("parameter", "fixed", "exact", "1", "1e-06"),
    "stability_number": ("local", "continuous", "calculated", "1", None),
    "rotation_per_substep": ("local", "continuous", "calculated", "rad", None),
    "wind.x": ("input", "continuous", None, "m/s", "0.0"),
    "wind.y": ("input", "continuous", None, "m/s", "0.0"),
    "drag_area": ("parameter", "fixed", "exact", None, "1"),
    "skirt_friction": ("parameter", "tunable", "exact", "1", "0.0"),
    "gravity": ("parameter", "fixed", "exact", "m/s2", "9.80665"),
    "rotational_drag": ("parameter", "tunable", "exact", "1", "0.0"),
    "integrator_number": ("parameter", "fixed", "exact", None, "0"),
    "drag_area_number": ("parameter", "fixed", "exact", None, "0"),
    "error_estimate": ("parameter", "fixed", "exact", None, "1"),
    "error_estimate_number": ("parameter", "fixed", "exact", None, "0"),
    "error.position": ("output", "discrete", "calculated", "m", None),
    "error.heading": ("output", "discrete", "calculated", "rad", None),
    "external.force.x": ("input", "continuous", None, "N", "0.0"),
    "external.force.y": ("input", "continuous", None, "N", "0.0"),
    "external.moment": ("input", "continuous", None, "N.m", "0.0"),
}


@pytest.fixture(scope="module")
def description(fmu: Path) -> Any:
    return fmpy.read_model_description(fmu)


@pytest.fixture(scope="module")
def xml(fmu: Path) -> Any:
    with zipfile.ZipFile(fmu) as archive:
        return etree.fromstring(archive.read("modelDescription.xml"))


def test_the_table(description: Any) -> None:
    found = {
        v.name: (v.causality, v.variability, v.initial if v.causality != "input" else None, v.unit, v.start)
        for v in description.modelVariables
    }
    assert found == TABLE
    assert [v.name for v in description.modelVariables] == [v.name for v in VARIABLES]


def test_value_references_are_stable(description: Any) -> None:
    """They may only be added to within a major version."""
    assert {v.name: v.valueReference for v in description.modelVariables} == {n: i for i, n in enumerate(TABLE)}


def test_derivatives_limits_and_descriptions(description: Any) -> None:
    by_name = {v.name: v for v in description.modelVariables}
    assert not [v.name for v in description.modelVariables if v.derivative]  # it has no list of derivatives
    assert all(v.description for v in description.modelVariables)
    assert (by_name["thrust"].min, by_name["thrust"].max) == (None, None)
    for name in ("port_thruster", "starboard_thruster"):
        assert (float(by_name[name].min), float(by_name[name].max)) == (0.0, 1.0)
    fraction = by_name["drag_center_fraction"]
    assert (float(fraction.min), float(fraction.max)) == (-0.5, 0.5)


def exponents(name: str) -> dict[str, int]:
    """What a unit's name says of SI's base units: `N.s/m` is kg/s."""
    found: Counter[str] = Counter()
    for sign, part in zip((1, -1), name.split("/"), strict=False):
        for symbol, power in re.findall(r"([A-Za-z]+)(\d*)", part):
            for base, each in {"N": {"kg": 1, "m": 1, "s": -2}}.get(symbol, {symbol: 1}).items():
                found[base] += sign * each * int(power or 1)
    return {base: power for base, power in found.items() if power}


def test_a_unit_is_what_its_name_says() -> None:
    assert len(UNITS) > 15
    assert {name: dict(unit.base) for name, unit in UNITS.items()} == {name: exponents(name) for name in UNITS}


def test_nominals_are_sizes(description: Any) -> None:
    """What a solver scales by."""
    nominals = [float(v.nominal) for v in description.modelVariables if v.nominal is not None]
    assert len(nominals) > 10
    assert min(nominals) > 0.0


def test_an_enumeration_has_the_limits_of_its_items() -> None:
    chosen = [v for v in VARIABLES if v.enumeration]
    assert len(chosen) > 2
    assert all((v.minimum, v.maximum) == (1, len(v.enumeration.items)) for v in chosen if v.enumeration)


def test_a_type_says_its_quantity(xml: Any) -> None:
    types = [node for each in xml.iter("SimpleType") for node in each]
    assert {node.tag for node in types} == {"Real", "Enumeration"}
    assert all(node.get("quantity") for node in types)


def test_units(description: Any, xml: Any) -> None:
    assert {u.name: u.baseUnit is not None for u in description.unitDefinitions} == dict.fromkeys(
        HOVERCRAFT.units, True
    )
    assert xml.xpath("//Unit[@name='N']/BaseUnit/@*") == ["1", "1", "-2"]
    for name, degrees in (("rad", "deg"), ("rad/s", "deg/s")):
        (display,) = xml.xpath(f"//Unit[@name='{name}']/DisplayUnit")
        assert display.get("name") == degrees
        assert float(display.get("factor")) == 180.0 / 3.141592653589793
    assert xml.xpath("//ScalarVariable[@name='pose.heading']/Real/@displayUnit") == ["deg"]
    assert xml.xpath("//ScalarVariable[@name='velocity.yaw_rate']/Real/@displayUnit") == ["deg/s"]
    assert all(node.get("declaredType") for node in xml.xpath("//ScalarVariable/Real"))


@pytest.mark.parametrize(
    ("variable", "type_name", "names"),
    [
        ("integrator", "Integrator", [method.name for method in INTEGRATORS]),
        ("drag_area", "DragArea", ["constant", "directional"]),
        ("error_estimate", "ErrorEstimate", ["off", "on"]),
    ],
)
def test_enumerations_have_described_items(variable: str, type_name: str, names: list[str], xml: Any) -> None:
    assert xml.xpath(f"//ScalarVariable[@name='{variable}']/Enumeration/@declaredType") == [type_name]
    items = xml.xpath(f"//SimpleType[@name='{type_name}']/Enumeration/Item")
    found = [(item.get("name"), item.get("value")) for item in items]
    assert found == [(name, str(number)) for number, name in enumerate(names, 1)]
    assert all(item.get("description") for item in items)


def test_model_structure(description: Any) -> None:
    outputs = {u.variable.name: u.dependencies for u in description.outputs}
    assert outputs == {name: [] for name in (*STATES, *MOTION, *ERRORS)}
    unknowns = {u.variable.name: {v.name for v in u.dependencies} for u in description.initialUnknowns}
    assert unknowns == {
        "body.surge": {"pose.heading", "velocity.x", "velocity.y"},
        "body.sway": {"pose.heading", "velocity.x", "velocity.y"},
        "speed": {"velocity.x", "velocity.y"},
        "projected_area": {"length", "width", "height"},
        "error.position": set(),
        "error.heading": set(),
    }


def test_the_head_of_the_description(description: Any, xml: Any) -> None:
    assert re.fullmatch(r"\{[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}\}", description.guid)
    assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ", description.generationDateAndTime)
    assert all(xml.get(name) for name in ("author", "license", "version", "copyright", "description"))
    assert xml.get("variableNamingConvention") == "structured"
    experiment = xml.find("DefaultExperiment")
    assert dict(experiment.attrib) == {"startTime": "0.0", "stopTime": "60.0", "stepSize": "0.01"}
    assert xml.xpath("count(//LogCategories/Category)") >= 4
    capabilities = dict(xml.find("CoSimulation").attrib)
    truths = {name for name, value in capabilities.items() if value == "true"}
    assert truths == {
        "canHandleVariableCommunicationStepSize",
        "canNotUseMemoryManagementFunctions",
        "canGetAndSetFMUstate",
        "canSerializeFMUstate",
    }


def test_the_groups_of_the_table_cover_it() -> None:
    names = [v.name for v in VARIABLES if v.variability == "continuous"]
    assert names == [*INPUTS[:3], *STATES, *MOTION, *ACTION, *WATCHED, *INPUTS[3:]]
