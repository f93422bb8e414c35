"""What the standards ask of the files of an FMU, rule by rule; in brackets the sections of FMI 2.0.5 and FMI 3.0.2."""

import re
import zipfile
from ctypes import byref, c_int
from pathlib import Path
from typing import Any

import fmpy
import pytest
from fmpy import fmi2
from fmpy.fmi1 import FMICallException
from lxml import etree

from hovercraft_fmu.autopilot.pilot_interface import AUTOPILOT_MODEL
from hovercraft_fmu.autopilot.pilot_native import AUTOPILOT, AUTOPILOT_NATIVE, AUTOPILOT_NATIVE3
from hovercraft_fmu.fmu.description import NATIVE, NATIVE3, PYTHON, Flavour, model_description, xml
from hovercraft_fmu.fmu.extras import RESULT, terminals
from hovercraft_fmu.fmu.interface import BY_NAME, EXTERNAL, HOVERCRAFT, INPUTS, STATES
from hovercraft_fmu.studies.pages import default_result
from tests.exchange import get_vector, go, put_states
from tests.lowlevel import DISCARD, ERROR, everything, one, put, start

FLAVOURS = [PYTHON, NATIVE, NATIVE3, AUTOPILOT, AUTOPILOT_NATIVE, AUTOPILOT_NATIVE3]


@pytest.fixture(params=FLAVOURS, ids=lambda flavour: flavour.identifier)
def kind(request: pytest.FixtureRequest) -> Flavour:
    made: Flavour = request.param
    return made


@pytest.fixture
def description(kind: Flavour) -> Any:
    return etree.fromstring(xml(model_description("0" * 32, kind)))


def variables(description: Any) -> list[Any]:
    """Of FMI 2.0 the inner elements, which have the bounds."""
    return [node[0] if node.tag == "ScalarVariable" else node for node in description.find("ModelVariables")]


def unknowns(description: Any, kind: Flavour, role: str) -> list[Any]:
    structure = description.find("ModelStructure")
    return list(structure.iterfind(f"{role}s/Unknown" if kind.fmi == 2 else role))


def places(nodes: list[Any], kind: Flavour) -> list[int]:
    """Where the variables of some unknowns are in ModelVariables."""
    key = "index" if kind.fmi == 2 else "valueReference"
    return [_place(node.get(key), kind) for node in nodes]


def _place(text: str, kind: Flavour) -> int:
    if kind.fmi == 2:
        return int(text)
    model = kind.model
    return model.index[model.by_reference[int(text)].name]


@pytest.mark.parametrize("role", ["Output", "InitialUnknown"])
def test_unknowns_are_in_the_order_of_their_variables(role: str, description: Any, kind: Flavour) -> None:
    """[2.0: 2.2.8] InitialUnknowns by index; outputs as declared, which both standards call best."""
    found = places(unknowns(description, kind, role), kind)
    assert found
    assert found == sorted(set(found))


def test_dependencies_are_in_ascending_order(description: Any, kind: Flavour) -> None:
    """[2.0: 2.2.8] by magnitude, the smallest index first."""
    for node in description.find("ModelStructure").iter("*"):
        found = [_place(each, kind) for each in (node.get("dependencies") or "").split()]
        assert found == sorted(set(found))


def test_derivatives_are_in_the_order_of_the_states(description: Any, kind: Flavour) -> None:
    """[2.0: 2.2.8; 3.0: 2.4.8] the order of the derivatives is that of the vector of states."""
    role = "Derivative" if kind.fmi == 2 else "ContinuousStateDerivative"
    found = places(unknowns(description, kind, role), kind)
    states = [kind.model.variables[place - 1].derivative_of for place in found]
    assert states == (list(STATES) if kind.exchange else [])


def test_derivative_is_told_where_there_are_derivatives(description: Any, kind: Flavour) -> None:
    """[2.0: 2.2.7] `derivative` is of a continuous-time state: no list of derivatives, no such thing."""
    told = [node for node in variables(description) if node.get("derivative")]
    assert len(told) == (len(STATES) if kind.exchange else 0)


def test_bounds_are_taken(each_fmu: Path) -> None:
    """[2.0: 2.2.7; 3.0: 2.4.7.4] `min` and `max` are the smallest and largest value, not the first that is refused."""
    with one(each_fmu) as (instance, _):
        for variable in HOVERCRAFT.variables:
            if variable.start is None or variable.kind != "Real":
                continue
            for bound in (variable.minimum, variable.maximum):
                if bound is not None:
                    instance.setReal([variable.reference], [bound])


def test_what_must_be_greater_than_0_has_no_bound_of_0(description: Any) -> None:
    for node in variables(description):
        text = node.get("description") or node.getparent().get("description")
        if "greater than 0" in text:
            assert node.get("min") is None


def test_inputs_alone_are_set_inside_a_step(description: Any, kind: Flavour) -> None:
    """[3.0: 2.4.7.4, 4.4] parameters must not be; the attribute is there where the FMU asks for them."""
    inside = {node.get("name") for node in variables(description) if node.get("intermediateUpdate")}
    assert inside == (set(INPUTS) if kind is NATIVE3 else set())


def test_the_hosts_memory_management_is_not_asked(description: Any, kind: Flavour) -> None:
    """[2.0: 2.1.5, 3.3.1, 4.3.1] the flag says that the FMU brings its own."""
    if kind.fmi == 2:
        for node in (*description.iterfind("CoSimulation"), *description.iterfind("ModelExchange")):
            assert node.get("canNotUseMemoryManagementFunctions") == "true"


def test_the_categories_that_are_logged_are_declared(fmu: Path, tmp_path: Path) -> None:
    """[2.0: 2.2.4] those of the model's messages, and those that pythonfmu's wrapper makes of its own.

    And what the page says of that wrapper: to fmi2GetStatus it answers fmi2Error, where the standard has fmi2Discard.
    """
    said: list[tuple[int, bytes | None]] = []
    logger = fmi2.fmi2CallbackLoggerTYPE(lambda _, __, status, category, ___: said.append((status, category)))
    callbacks = fmi2.fmi2CallbackFunctions(logger=logger)
    description = fmpy.read_model_description(fmu)
    made = fmi2.FMU2Slave(
        guid=description.guid, unzipDirectory=fmpy.extract(str(fmu), tmp_path), modelIdentifier="Hovercraft",
        instanceName="logged",
    )  # fmt: skip
    made.instantiate(callbacks=callbacks, loggingOn=True)
    made.setupExperiment()
    made.enterInitializationMode()
    made.exitInitializationMode()
    made.setReal([BY_NAME["thrust"].reference], [20.0])
    made.doStep(0.0, 0.1)  # warns
    with pytest.raises(FMICallException):
        made.getDirectionalDerivative([3], [0], [1.0])
    assert made.dll.fmi2GetStatus(made.component, 0, byref(c_int())) == fmi2.fmi2Error
    with pytest.raises(FMICallException):
        made.setReal([BY_NAME["mass"].reference], [5.0])
    made.freeInstance()
    assert {status for status, _ in said} == {fmi2.fmi2Warning, fmi2.fmi2Error, fmi2.fmi2Fatal}
    names = {category.decode() for _, category in said if category}
    assert "cppfmu" in names
    assert names <= {
        node.get("name") for node in etree.fromstring(xml(model_description("0", PYTHON))).iter("Category")
    }


# ---- what becomes of a refused call


RUNS_AWAY = {"velocity__yaw_rate": 1e200}


def test_a_discarded_step_can_be_tried_otherwise(each_native_fmu: Path, standard: int) -> None:
    """[2.0: 2.1.3, 4.2.2; 3.0: 2.2.4] It is discarded, not an error: the instance is where it was, and goes on."""
    with one(each_native_fmu) as (instance, messages):
        start(instance)
        instance.doStep(0.0, 0.5)
        before = everything(instance)
        with pytest.raises(FMICallException) as caught:
            instance.doStep(0.5, 1e9)  # of 1e12 sub-steps
        assert caught.value.status == DISCARD
        assert everything(instance) == before
        if standard == 2:
            assert instance.getRealStatus(fmi2.fmi2LastSuccessfulTime) == 0.5
            assert not instance.getBooleanStatus(fmi2.fmi2Terminated)
        instance.doStep(0.5, 0.5)
        assert len(messages) == 1
        instance.terminate()


def test_derivatives_that_are_no_numbers_are_discarded(each_native_fmu: Path) -> None:
    """[2.0: 2.1.3; 3.0: 2.2.4, 3.2.1] A solver comes back with a shorter step."""
    with one(each_native_fmu, exchange=True) as (instance, _):
        go(instance)
        for call in (instance.getDerivatives, instance.getContinuousStates):
            put_states(instance, [0.0, 0.0, 0.0, 1e200, 1e200, 1e200])
            with pytest.raises(FMICallException) as caught:
                get_vector(call)
            assert caught.value.status == DISCARD
            put_states(instance, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
            assert get_vector(instance.getDerivatives)[0] == 1.0


def test_a_discarded_step_that_is_tried_again_as_it_was_is_an_error(each_native_fmu: Path) -> None:
    """It would be discarded for ever, and fmpy's master tries for ever: so it stops, with the message."""
    with one(each_native_fmu) as (instance, messages):
        start(instance, **RUNS_AWAY)
        for status in (DISCARD, ERROR):
            instance.setReal([BY_NAME["thrust"].reference], [5.0])
            with pytest.raises(FMICallException) as caught:
                instance.doStep(0.0, 0.1)
            assert caught.value.status == status
        assert messages[-1].startswith("communication step of 0.1 s from 0.0 s: was discarded; it must be tried with")
        put(instance, thrust=6.0)
        with pytest.raises(FMICallException) as caught:
            instance.doStep(0.0, 0.1)
        assert caught.value.status == DISCARD
    with pytest.raises(FMICallException):
        fmpy.simulate_fmu(str(each_native_fmu), start_values={"velocity.yaw_rate": 1e200}, stop_time=1.0)


def test_nothing_is_read_before_initialization(each_fmu: Path) -> None:
    """[2.0: 3.2.3, 4.2.4] 'instantiated' has no getters; the Python FMU's wrapper makes a fatal error of it."""
    with one(each_fmu) as (instance, messages):
        if instance.host.is_fmi_3:
            assert instance.getFloat64([BY_NAME["mass"].reference]) == [100.0]
            return
        for name, get in (("Real", instance.getReal), ("Integer", instance.getInteger)):
            with pytest.raises(FMICallException):
                get([BY_NAME["mass" if name == "Real" else "substeps"].reference])
            assert messages[-1].startswith(f"fmi2Get{name} in state 'instantiated': must be called in state 'init")
        start(instance)
        assert instance.getReal([BY_NAME["mass"].reference]) == [100.0]


def test_an_instance_with_an_error_is_not_terminated(each_native_fmu: Path) -> None:
    """[2.0: 4.2.4, the column 'error'; 3.0: 2.3.1] It is reset or freed, or given a state."""
    with one(each_native_fmu) as (instance, messages):
        start(instance)
        state = instance.getFMUstate()
        with pytest.raises(FMICallException):
            instance.doStep(9.0, 0.1)
        with pytest.raises(FMICallException):
            instance.terminate()
        assert "Terminate after an error: the instance must be reset or freed, or given a state" in messages[-1]
        instance.setFMUstate(state)
        instance.terminate()
        instance.freeFMUstate(state)


# ---- terminals and icon


def terminal_file(fmu: Path) -> Any:
    with zipfile.ZipFile(fmu) as archive:
        return etree.fromstring(archive.read("terminalsAndIcons/terminalsAndIcons.xml"))


def test_the_icon_lies_in_its_coordinate_system(native3_fmu: Path) -> None:
    """[3.0: 2.4.9.1] lower left before upper right; without the element the extent would be another one."""
    graphics = terminal_file(native3_fmu).find("GraphicalRepresentation")
    assert [node.tag for node in graphics] == ["CoordinateSystem", "Icon"]
    system, icon = ({key: float(value) for key, value in node.attrib.items()} for node in graphics)
    assert system["x1"] < system["x2"]
    assert system["y1"] < system["y2"]
    assert system["suggestedScalingFactorTo_mm"] > 0.0
    assert icon == {key: system[key] for key in ("x1", "y1", "x2", "y2")}


def test_a_variable_is_named_terminal_and_member(native3_fmu: Path) -> None:
    """[3.0: 2.4.9.2] the suggested scheme; and matching that lets the other side have some members alone."""
    found = {}
    for node in terminal_file(native3_fmu).iter("Terminal"):
        assert node.get("matchingRule") == "bus"
        found[node.get("name")] = {each.get("memberName"): each.get("variableName") for each in node}
    assert found == terminals(HOVERCRAFT)
    assert set(found.pop("actuators")) == {"thrust", "port_thruster", "starboard_thruster"}
    assert found["wind"] == {"x": "wind.x", "y": "wind.y"}
    members = {name.removeprefix("external."): name for name in EXTERNAL}
    assert found.pop("load") == members
    for terminal, members in found.items():
        assert all(name == f"{terminal}.{member}" and name in BY_NAME for member, name in members.items())


def test_the_terminals_of_the_autopilot_pair_with_those_of_the_craft() -> None:
    craft = terminals(HOVERCRAFT)
    assert set(terminals(AUTOPILOT_MODEL)) == {"actuators", "pose", "velocity"}
    for terminal, members in terminals(AUTOPILOT_MODEL).items():
        assert members.keys() == craft[terminal].keys()
        for member, name in members.items():
            ends = {AUTOPILOT_MODEL.by_name[name].causality, BY_NAME[craft[terminal][member]].causality}
            assert ends == {"input", "output"}


@pytest.mark.parametrize("name", ["fmu", "native_fmu", "autopilot"])
def test_an_fmu_of_fmi_2_has_no_terminals(name: str, request: pytest.FixtureRequest) -> None:
    """[2.0: 2.3] it may have some, of version 3.0; FMI Library takes that for a fatal error, so there are none."""
    with zipfile.ZipFile(request.getfixturevalue(name)) as archive:
        assert not [name for name in archive.namelist() if name.startswith("terminalsAndIcons/")]


# ---- what else is in the archive


def test_the_license_names_those_of_others(each_fmu: Path) -> None:
    """[2.0: 2.3; 3.0: 2.5.1] documentation/licenses/license.txt is where to begin."""
    with zipfile.ZipFile(each_fmu) as archive:
        folder = "documentation/licenses/"
        others = {name.removeprefix(folder) for name in archive.namelist() if name.startswith(folder)} - {"license.txt"}
        named = set(re.findall(r"see (\S+\.txt)", archive.read(f"{folder}license.txt").decode()))
    assert named == others != set()


def test_there_is_a_diagram(each_fmu: Path) -> None:
    """[2.0: 2.3; 3.0: 2.5.1] documentation/diagram.png, and the page shows it."""
    with zipfile.ZipFile(each_fmu) as archive:
        assert archive.read("documentation/diagram.png").startswith(b"\x89PNG")
        assert 'src="diagram.png"' in archive.read("documentation/index.html").decode()


def test_the_reference_result_is_that_of_the_default_experiment(each_fmu: Path) -> None:
    """[3.0: 2.6; FMI-LS-REF 1.0.0-alpha.1] Where this fails: python -m hovercraft_fmu.studies.pages."""
    identifier = each_fmu.stem
    folder = "extra/org.fmi-standard.fmi-ls-ref/"
    with zipfile.ZipFile(each_fmu) as archive:
        manifest = etree.fromstring(archive.read(f"{folder}fmi-ls-manifest.xml"))
        (related,) = manifest
        result = archive.read(folder + related.get("source"))
    spaced = "{http://fmi-standard.org/fmi-ls-manifest}"
    assert manifest.get(f"{spaced}fmi-ls-name") == "org.fmi-standard.fmi-ls-ref"
    assert all(manifest.get(f"{spaced}fmi-ls-{each}") for each in ("version", "description"))
    assert (related.get("role"), related.get("type")) == ("result", "text/csv")
    assert related.get("source") == f"{identifier}_out.csv"
    assert result == RESULT.read_bytes() == default_result(each_fmu)
