"""What FMI 3.0 has of its own: types, lists of values, adjoint derivatives, what a step hands back; FMI 2.0's bits.

What it shares with FMI 2.0 is in test_lifecycle.py, test_native.py, test_exchange.py and test_native_platforms.py."""

import math
import zipfile
from collections.abc import Callable, Iterator
from ctypes import CDLL, byref, c_bool, c_char_p, c_double, c_float, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy import fmi3
from fmpy.fmi1 import FMICallException
from lxml import etree
from numpy.typing import NDArray

from hovercraft_fmu.fmu.description import NATIVE3
from hovercraft_fmu.fmu.interface import DERIVATIVES, ERRORS, INPUTS, MOTION, STATES, TIME, VARIABLES
from hovercraft_fmu.host import read_description
from hovercraft_fmu.scenes import SCENES
from hovercraft_fmu.simulation import holding, plan, run_fmu
from tests.lowlevel import everything, one, put, reference, start, status_of_refusal
from tests.native import IN_TURN, STEPS
from tests.test_native import METHODS, one_missing

OK, WARNING, ERROR = 0, 1, 3
TERMS: dict[str, dict[str, float | str]] = {
    "none": {},
    "wind": {"wind.x": -0.2, "wind.y": 0.3},
    "load": {"external.force.x": 1.5, "external.force.y": -2.0, "external.moment": 30.0},
    "directional": {"drag_area": "directional"},
    "friction": {"skirt_friction": 0.002},
    "rotational": {"rotational_drag": 1.0},
    "no drag": {"drag_coefficient": 0.0},
}
KNOWNS = [reference(name) for name in (*STATES, *INPUTS)]
ACCELERATIONS = DERIVATIVES[3:]
UNKNOWNS = [reference(name) for name in (*STATES, *MOTION, *ACCELERATIONS)]
INITIAL_KNOWNS = [*KNOWNS, *(v.reference for v in VARIABLES if v.kind == "Real" and v.causality == "parameter")]
INITIAL_UNKNOWNS = [reference(name) for name in (*MOTION, *ACCELERATIONS, "projected_area")]


@pytest.fixture(scope="module")
def shared(native3_fmu: Path) -> Iterator[tuple[Any, list[str]]]:
    with one(native3_fmu) as made:
        yield made


# ---- the bits of FMI 2.0


@pytest.mark.parametrize(("scene", "method"), IN_TURN.items())
def test_the_bits_of_fmi_2_in_every_scene(scene: str, method: str, native_fmu: Path, native3_fmu: Path) -> None:
    """With one of the methods; all four with every term follow."""
    run = holding(plan(scene, start_values={"integrator": method, "step_size": STEPS[method]}))
    found, expected = run_fmu(run, native3_fmu), run_fmu(run, native_fmu)
    assert found.names == expected.names
    assert np.array_equal(found.data, expected.data)


@pytest.mark.parametrize("term", TERMS)
def test_the_bits_of_fmi_2_with_every_term(term: str, native_fmu: Path, native3_fmu: Path) -> None:
    for method in METHODS:
        values = {"integrator": method, "step_size": STEPS[method], **TERMS[term]}
        run = plan("turn", start_values=values, stop_time=20.0)
        assert np.array_equal(run_fmu(run, native3_fmu).data, run_fmu(run, native_fmu).data), method


@pytest.mark.parametrize("scene", SCENES)
def test_the_bits_of_fmi_2_in_model_exchange(scene: str, native_fmu: Path, native3_fmu: Path) -> None:
    """With fmpy's own solver, CVode. Friction is refused there, by both."""
    run = plan(scene)
    if run.value("skirt_friction") != 0.0:
        for each in (native3_fmu, native_fmu):
            with pytest.raises(FMICallException):
                _exchanged(run, each)
        return
    found = _exchanged(run, native3_fmu)
    assert len(found) > 100
    assert np.array_equal(found, _exchanged(run, native_fmu))


def _exchanged(run: Any, fmu: Path) -> NDArray[np.void]:
    names = [v.name for v in VARIABLES if v.causality in ("input", "output", "local") and v.kind == "Real"]
    found = fmpy.simulate_fmu(
        str(fmu),
        fmi_type="ModelExchange",
        start_time=run.start_time,
        stop_time=min(run.stop_time, 40.0),
        output_interval=run.communication_step,
        start_values=dict(run.start_values),
        input=run.signals,
        output=names,  # and no logger: fmpy would call it for other instances when it is long gone
    )
    return np.asarray(found)


# ---- values


def test_the_time_is_a_variable_that_is_read(instance: Any, messages: list[str]) -> None:
    start(instance, 2.0)
    instance.doStep(2.0, 0.5)
    assert instance.getFloat64([TIME.reference, reference("thrust"), TIME.reference]) == [2.5, 5.0, 2.5]
    with pytest.raises(FMICallException):
        instance.setFloat64([reference("thrust"), TIME.reference], [1.0, 3.0])
    assert messages == ["fmi3SetFloat64: time must not be set as a variable"]
    assert instance.getFloat64([TIME.reference, reference("thrust")]) == [2.5, 5.0]


def test_a_step_tells_where_it_ended_and_that_there_was_no_event(instance: Any) -> None:
    start(instance)
    assert instance.doStep(0.0, 0.25) == (False, False, False, 0.25)
    outputs = c_bool(True), c_bool(True), c_bool(True), c_double(7.0)
    arguments = c_void_p(instance.component), c_double(9.0), c_double(0.1), c_bool(True)
    step = _function(instance, "fmi3DoStep")
    refused = step(*arguments, *(byref(each) for each in outputs))
    assert (refused, [each.value for each in outputs]) == (ERROR, [False, False, False, 0.25])


BAD_LISTS: dict[str, tuple[Callable[[Any], object], str]] = {
    "too few values": (
        lambda i: i.fmi3SetFloat64(i.component, (c_uint * 2)(0, 1), 2, (c_double * 1)(), 1),
        "fmi3SetFloat64: nValues = 1: must be 2, a value for each of the scalars",
    ),
    "too many values": (
        lambda i: i.getFloat64([3], nValues=2),
        "fmi3GetFloat64: nValues = 2: must be 1, a value for each of the scalars",
    ),
    "two values for one of no type": (
        lambda i: i.fmi3GetFloat32(i.component, (c_uint * 1)(0), 1, (c_float * 2)(), 2),
        "fmi3GetFloat32: nValues = 2: must be 1, a value for each of the scalars",
    ),
    "an enumeration as Int32": (
        lambda i: i.getInt32([reference("integrator")]),
        f"value reference {reference('integrator')}: must be that of a variable of type Int32",
    ),
    "an Int32 as enumeration": (
        lambda i: i.getInt64([reference("substeps")]),
        f"value reference {reference('substeps')}: must be that of a variable of type Enumeration",
    ),
    "the time as Int32": (
        lambda i: i.getInt32([TIME.reference]),
        "value reference 1000: must be that of a variable of type Int32",
    ),
    "an item of 64 bits": (
        lambda i: i.setInt64([reference("integrator")], [2**32 + 1]),
        "integrator = 4294967297: must be one of 1 (semi_implicit_euler), 2 (drag_implicit), 3 (rk4), 4 (adaptive), "
        "5 (splitting)",
    ),
    "the least of 64 bits": (
        lambda i: i.setInt64([reference("drag_area")], [-(2**63)]),
        "drag_area = -9223372036854775808: must be one of 1 (constant), 2 (directional)",
    ),
    "one bad of two": (
        lambda i: i.setInt64([reference("integrator"), reference("drag_area")], [2, 9]),
        "drag_area = 9: must be one of",
    ),
    "order": (
        lambda i: i.getOutputDerivatives([3], [0]),
        "order = 0 of the derivative of pose.x: must be 1",
    ),
    "no output": (
        lambda i: i.getOutputDerivatives([0], [1]),
        "value reference 0: must be that of a continuous output to have a derivative",
    ),
    "seeds": (
        lambda i: i.getDirectionalDerivative([3], [0, 1], [1.0]),
        "fmi3GetDirectionalDerivative: nSeed = 1, nSensitivity = 1: must be 2 and 1",
    ),
    "a seed of two": (
        lambda i: i.getDirectionalDerivative([3, 4], [0, 1], [1.0]),
        "fmi3GetDirectionalDerivative: nSeed = 1, nSensitivity = 2: must be 2 and 2",
    ),
    "sensitivities": (
        lambda i: i.getAdjointDerivative([3], [0, 1], [1.0]),
        "fmi3GetAdjointDerivative: nSeed = 1, nSensitivity = 1: must be 1 and 2",
    ),
    "no unknown": (
        lambda i: i.getAdjointDerivative([0], [0], [1.0]),
        "fmi3GetAdjointDerivative: ",
    ),
    "seed nan": (
        lambda i: i.getAdjointDerivative([reference("acceleration.x")], [0], [math.nan]),
        "adjoint derivative of thrust = nan: must be a finite number",
    ),
}


@pytest.mark.parametrize("name", BAD_LISTS)
def test_a_bad_list_is_refused_and_changes_nothing(name: str, instance: Any, messages: list[str]) -> None:
    fault, message = BAD_LISTS[name]
    instance.enterInitializationMode()
    before = everything(instance)
    with pytest.raises(FMICallException) as caught:
        fault(instance)
    assert caught.value.status == status_of_refusal(instance, caught.value, messages[-1])
    assert messages[-1].startswith(message)
    assert everything(instance) == before


@pytest.mark.parametrize("kind", ["Float64", "Int32", "Int64"])
def test_a_list_is_set_as_one_value_after_the_other(kind: str, instance: Any) -> None:
    """All of a kind that can be set, in either order; and it reads so, in either order."""
    kinds = {"Float64": "Real", "Int32": "Integer", "Int64": "Enumeration"}
    these = [v for v in VARIABLES if v.kind == kinds[kind] and v.start is not None]
    references = [v.reference for v in these]
    values = [(v.start or 0.0) + i / 64.0 if kind == "Float64" else 2 for i, v in enumerate(these)]
    setter, getter = getattr(instance, f"set{kind}"), getattr(instance, f"get{kind}")
    for way in (1, -1):
        instance.reset()
        setter(references[::way], values[::way])
        instance.enterInitializationMode()
        assert list(getter(references)) == values
        assert list(getter(references[::-1])) == values[::-1]


# ---- partial derivatives


def assert_transposed(instance: Any, unknowns: list[int], knowns: list[int], nonzero: int) -> None:
    """Bit by bit; the entries themselves are checked with the directional derivatives."""
    columns = [instance.getDirectionalDerivative(unknowns, knowns, list(unit)) for unit in np.eye(len(knowns))]
    rows = [
        instance.getAdjointDerivative(unknowns, knowns, list(unit), nSensitivity=len(knowns))
        for unit in np.eye(len(unknowns))
    ]
    assert np.array_equal(np.array(columns).T, np.array(rows))
    assert np.count_nonzero(rows) == nonzero
    seeds = np.linspace(-1.0, 1.0, len(unknowns))
    found = instance.getAdjointDerivative(unknowns, knowns, list(seeds), nSensitivity=len(knowns))
    assert found == pytest.approx(list(seeds @ np.array(rows)), rel=1e-12, abs=1e-15)


MOVING = {"pose__heading": 0.3, "velocity__x": 2.0, "velocity__y": 0.5, "velocity__yaw_rate": 0.1, "wind__y": 0.3}


def test_adjoint_derivatives_are_the_transposed_jacobian(instance: Any) -> None:
    start(instance, **MOVING)
    assert_transposed(
        instance, UNKNOWNS, KNOWNS, 6 + 8 + 26 + 3
    )  # states; surge, sway, speed; accelerations, of them by loads from outside


def test_adjoint_derivatives_in_initialization_mode(instance: Any) -> None:
    """Of parameters, too: 3 act on the area; 9 on each acceleration, and rotational drag on that of yaw."""
    put(instance, **MOVING, port_thruster=0.5)
    instance.setupExperiment()
    instance.enterInitializationMode()
    assert_transposed(instance, INITIAL_UNKNOWNS, INITIAL_KNOWNS, 8 + 26 + 3 + 3 + 3 * 9 + 1)


# ---- FMU state


def test_a_deserialized_state_is_a_copy_of_its_own(instance: Any) -> None:
    """Of getting a state the standard says what the pointer may be on entry, of deserializing not: it is not read."""
    start(instance)
    held = instance.getFMUState()
    instance.doStep(0.0, 0.1)
    after = everything(instance)
    content = instance.serializeFMUState(instance.getFMUState())
    made = instance.deserializeFMUState(content, fmi3.fmi3FMUState(held.value))
    assert made.value != held.value
    instance.setFMUState(held)
    assert instance.getFloat64([TIME.reference]) == [0.0]
    instance.setFMUState(made)
    assert everything(instance) == after


# ---- every function


WITHOUT_AN_INSTANCE = {"fmi3GetVersion", "fmi3FreeInstance"} | {
    f"fmi3Instantiate{kind}" for kind in ("CoSimulation", "ModelExchange", "ScheduledExecution")
}
FUNCTIONS = [name for name in dir(fmi3.FMU3Slave) if name.startswith("fmi3") and name not in WITHOUT_AN_INSTANCE]
"""fmpy loads all of the standard's for either use."""


def _function(instance: Any, name: str) -> Any:
    found = getattr(CDLL(instance.dll._name), name)
    found.restype = c_int
    return found


def _arguments(instance: Any, name: str) -> list[Any]:
    """All but the instance: lengths of 1, NULL for what is a pointer."""
    call = getattr(instance.dll, name)
    rest: list[Any] = []
    for kind in call.argtypes[1:]:
        if kind is c_size_t:
            rest.append(c_size_t(1))
        elif kind in (c_bool, c_int, c_uint, c_double):
            rest.append(kind(0))
        else:
            rest.append(c_void_p(None))
    return rest


@pytest.fixture(scope="module")
def exchanged(native3_fmu: Path) -> Iterator[tuple[Any, list[str]]]:
    """One for model exchange."""
    with one(native3_fmu, exchange=True) as made:
        yield made


@pytest.mark.parametrize("name", FUNCTIONS)
def test_null_is_refused(name: str, exchanged: tuple[Any, list[str]]) -> None:
    """A NULL instance by every function; NULL for any other pointer by those that have one."""
    instance, messages = exchanged
    instance.reset()
    messages.clear()
    rest = _arguments(instance, name)
    assert _function(instance, name)(c_void_p(None), *rest) == ERROR
    if name == "fmi3FreeFMUState" or not any(isinstance(each, c_void_p) for each in rest):
        return
    for arguments in (rest, *one_missing(rest)):
        assert _function(instance, name)(c_void_p(instance.component), *arguments) == ERROR
        assert len(messages) == 1
        assert messages.pop().startswith((f"{name}: ", "value reference "))


EMPTY = ["Float32", "Float64", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64", "Boolean",
         "String", "Clock"]  # fmt: skip


@pytest.mark.parametrize("kind", EMPTY)
def test_empty_lists_are_fine(kind: str, instance: Any, messages: list[str]) -> None:
    start(instance)
    for verb in ("Get", "Set"):
        call = _function(instance, f"fmi3{verb}{kind}")
        assert call(c_void_p(instance.component), None, c_size_t(0), None, c_size_t(0)) == OK
    assert messages == []


WITHOUT = {
    "fmi3EnterConfigurationMode": "there are no structural parameters",
    "fmi3ExitConfigurationMode": "there are no structural parameters",
    "fmi3EnterStepMode": "hasEventMode is false",
    "fmi3EvaluateDiscreteStates": "providesEvaluateDiscreteStates is false",
}


@pytest.mark.parametrize("name", WITHOUT)
def test_what_the_flags_deny_is_refused(name: str, instance: Any, messages: list[str]) -> None:
    start(instance)
    assert _function(instance, name)(c_void_p(instance.component)) == ERROR
    assert messages == [f"{name}: {WITHOUT[name]}"]


@pytest.mark.parametrize("call", ["enterEventMode", "updateDiscreteStates", "enterStepMode"])
def test_there_is_no_event_mode_in_co_simulation(call: str, instance: Any) -> None:
    start(instance)
    with pytest.raises(FMICallException):
        getattr(instance, call)()
    instance.doStep(0.0, 0.1)


# ---- instances


class Logger:
    """What an instance says, as (status, category, message)."""

    def __init__(self) -> None:
        self.said: list[tuple[int, str, str]] = []

    def __call__(self, _environment: Any, status: int, category: bytes, message: bytes) -> None:
        self.said.append((status, category.decode(), message.decode()))


@pytest.fixture
def slave(native3_fmu: Path, tmp_path: Path) -> fmi3.FMU3Slave:
    """Loaded, not instantiated."""
    fmpy.extract(native3_fmu, unzipdir=tmp_path)
    token = read_description(native3_fmu).guid
    return fmi3.FMU3Slave(
        guid=token, unzipDirectory=str(tmp_path), modelIdentifier=NATIVE3.identifier, instanceName="craft"
    )


INSTANTIATE = "fmi3InstantiateCoSimulation"


@pytest.mark.parametrize(
    ("token", "options", "message"),
    [
        ("{%s%n\xff}", {}, "instantiationToken = '{{?s?n??}}': must be '{token}', as in modelDescription.xml"),
        (
            None,
            {"eventModeUsed": True, "requiredIntermediateVariables": [0]},
            f"{INSTANTIATE}: eventModeUsed must be false: hasEventMode is false",
        ),
        (
            None,
            {"requiredIntermediateVariables": [0, reference("speed")]},
            f"{INSTANTIATE}: requiredIntermediateVariables must be inputs: no other has intermediateUpdate",
        ),
    ],
)
def test_an_instance_that_cannot_be_is_refused_with_a_word(
    token: str | None, options: dict[str, Any], message: str, slave: fmi3.FMU3Slave
) -> None:
    right, logger = slave.guid, Logger()
    slave.guid = token or right
    with pytest.raises(Exception, match="Failed to instantiate"):
        slave.instantiate(logMessage=logger, **options)
    assert logger.said == [(ERROR, "logStatusError", message.format(token=right))]


def test_no_scheduled_execution_and_no_null_token(slave: fmi3.FMU3Slave) -> None:
    logger = Logger()
    callback = fmi3.fmi3LogMessageCallback(logger)
    library = CDLL(slave.dll._name)
    library.fmi3InstantiateScheduledExecution.restype = library.fmi3InstantiateModelExchange.restype = c_void_p
    common = (c_char_p(b"a"), c_char_p(slave.guid.encode()), None, c_bool(False), c_bool(False), None, callback)
    assert library.fmi3InstantiateScheduledExecution(*common, None, None, None) is None
    library.fmi3InstantiateCoSimulation.restype = c_void_p
    asked = (c_bool(False), c_bool(False), None, c_size_t(1), None, callback, None)  # for one of a list of none
    assert library.fmi3InstantiateCoSimulation(*common[:5], *asked) is None
    assert library.fmi3InstantiateModelExchange(common[0], None, *common[2:]) is None
    assert [message.partition(":")[0] for _, _, message in logger.said] == [
        "fmi3InstantiateScheduledExecution",
        INSTANTIATE,
        "instantiationToken = 'NULL'",
    ]
    made = library.fmi3InstantiateModelExchange(None, *common[1:6], None)  # neither name nor logger
    assert (
        library.fmi3DoStep(c_void_p(made), c_double(0.0), c_double(0.1), c_bool(True), None, None, None, None) == ERROR
    )
    library.fmi3FreeInstance(c_void_p(made))


def test_what_is_logged(slave: fmi3.FMU3Slave) -> None:
    """Errors always, until the host says otherwise; warnings where logging is on; by category where it asks."""
    logger = Logger()
    slave.instantiate(logMessage=logger, loggingOn=False)

    def told() -> list[int]:
        """After a reset: a step that warns, and one that is refused."""
        logger.said.clear()
        slave.reset()
        slave.setFloat64([0], [99.0])
        slave.enterInitializationMode()
        slave.exitInitializationMode()
        slave.doStep(0.0, 0.1)
        with pytest.raises(FMICallException):
            slave.doStep(5.0, 0.1)
        return [status for status, _, _ in logger.said]

    try:
        assert told() == [ERROR]
        slave.setDebugLogging(True, [])
        assert told() == [WARNING, ERROR]
        slave.setDebugLogging(False, [])
        assert told() == []
        slave.setDebugLogging(True, ["logStatusError"])  # 2.3.1: the second call adds to what is on
        assert told() == [ERROR]
        slave.setDebugLogging(True, ["logStatusWarning"])
        assert told() == [WARNING, ERROR]
        slave.setDebugLogging(False, ["logStatusWarning"])
        assert told() == [ERROR]
        slave.setDebugLogging(False, [])
        assert told() == []
        slave.setDebugLogging(True, ["logAll"])
        assert told() == [WARNING, ERROR]
        assert [category for _, category, _ in logger.said] == ["logStatusWarning", "logStatusError"]
        with pytest.raises(FMICallException):
            slave.setDebugLogging(True, ["log%s"])
        assert logger.said[-1][2].startswith("log category 'log?s': must be one of logStatusWarning, ")
        assert slave.getVersion() == "3.0"
    finally:
        slave.freeInstance()


# ---- the description


def test_the_flags_say_what_there_is(native3_fmu: Path) -> None:
    """No early return, no event mode, no clocks: nothing here could check them."""
    both = {
        "modelIdentifier": NATIVE3.identifier,
        "needsExecutionTool": "false",
        "canBeInstantiatedOnlyOncePerProcess": "false",
        "canGetAndSetFMUState": "true",
        "canSerializeFMUState": "true",
        "providesDirectionalDerivatives": "true",
        "providesAdjointDerivatives": "true",
        "providesPerElementDependencies": "false",
        "providesEvaluateDiscreteStates": "false",
    }
    steps = {
        "canHandleVariableCommunicationStepSize": "true",
        "maxOutputDerivativeOrder": "1",
        "providesIntermediateUpdate": "true",
        "mightReturnEarlyFromDoStep": "false",
        "canReturnEarlyAfterIntermediateUpdate": "false",
        "hasEventMode": "false",
    }
    with zipfile.ZipFile(native3_fmu) as archive:
        root = etree.fromstring(archive.read("modelDescription.xml"))
    assert dict(root.find("CoSimulation").attrib) == both | steps
    assert dict(root.find("ModelExchange").attrib) == both | {"needsCompletedIntegratorStep": "true"}
    assert root.find("ScheduledExecution") is None
    assert root.get("fmiVersion") == "3.0"


def test_the_structure_has_kinds_and_states(native3_fmu: Path) -> None:
    description = read_description(native3_fmu)
    assert [unknown.variable.derivative.name for unknown in description.derivatives] == list(STATES)
    by_name = {v.name: v for v in description.modelVariables}
    assert by_name["time"].causality == "independent"
    assert by_name["substeps"].type == "Int32"
    assert by_name["integrator"].type == "Enumeration"
    assert {v.type for v in description.modelVariables} == {"Float64", "Int32", "Enumeration"}
    for unknown in description.outputs:
        if unknown.variable.name in ERRORS:
            assert unknown.dependencies == unknown.dependenciesKind == []
            continue
        own = unknown.variable.name in STATES
        assert [each.name for each in unknown.dependencies] == (
            [unknown.variable.name] if own else [name for name in STATES if name in _followed(unknown.variable.name)]
        )
        assert set(unknown.dependenciesKind) == {"constant" if own else "dependent"}


def _followed(output: str) -> set[str]:
    return {"velocity.x", "velocity.y"} | ({"pose.heading"} if output.startswith("body.") else set())
