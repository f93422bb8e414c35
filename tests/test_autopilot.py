"""The autopilot's FMU in anybody's hands: description, life cycle, faults, state."""

import hashlib
import math
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu
from hypothesis import given, settings
from hypothesis import strategies as st
from lxml import etree

from hovercraft_fmu.autopilot.guidance import Orders, Waypoint, beginning, steer
from hovercraft_fmu.autopilot.pilot_interface import (
    AUTOPILOT_MODEL,
    COMMANDS,
    DEMO_COURSE,
    ORDERS,
    STATUS,
    VARIABLES,
    WAYPOINT_NAMES,
)
from hovercraft_fmu.fmu.interface import BY_NAME, INPUTS, STATES
from hovercraft_fmu.host import read_description
from hovercraft_fmu.model.dynamics import State
from hovercraft_fmu.simulation import plan, run_fmu
from hovercraft_fmu.validation import FMPY, validate, validate_elsewhere
from tests.blobs import with_build
from tests.conftest import Fresh
from tests.lowlevel import one
from tests.strategies import numbers

OUTPUTS = (*COMMANDS, "cross_track_error", "distance", "turns")
REALS = [v.name for v in VARIABLES if v.kind == "Real"]
INTEGERS = [v.name for v in VARIABLES if v.kind == "Integer"]
COURSE = [Waypoint(*point) for point in DEMO_COURSE]
SOMEWHERE = State(12.0, 3.0, 0.4, 0.2, -0.1, 0.05)


@pytest.fixture(scope="module")
def shared(autopilot: Path) -> Iterator[tuple[Any, list[str]]]:
    with one(autopilot) as made:
        yield made


def reference(name: str) -> int:
    return AUTOPILOT_MODEL.by_name[name].reference


def put(instance: Any, **values: float) -> None:
    instance.setReal([reference(name.replace("__", ".")) for name in values], list(values.values()))


def see(instance: Any, motion: State) -> None:
    instance.setReal([reference(name) for name in STATES], list(motion))


def get(instance: Any, *names: str) -> list[float]:
    return list(instance.getReal([reference(name) for name in names]))


def everything(instance: Any) -> list[float]:
    numbers = instance.getInteger([reference(name) for name in INTEGERS])
    return [*get(instance, *REALS), *numbers, *instance.getBoolean([reference("arrived")])]


def sampled(first: State, then: State, duration: float) -> list[float]:
    """OUTPUTS, by the bare law."""
    pilot, _, _ = steer(beginning(first), first, COURSE, Orders(), 0.0)
    pilot, commands, sight = steer(pilot, then, COURSE, Orders(), duration)
    return [*commands, *sight, pilot.turns]


def told(instance: Any) -> tuple[int, ...]:
    return tuple(instance.getInteger([reference("status"), reference("missed")]))


def start(instance: Any, time: float = 0.0) -> None:
    instance.setupExperiment(startTime=time)
    instance.enterInitializationMode()
    instance.exitInitializationMode()


# ---- description


def test_checkers_find_nothing(autopilot: Path) -> None:
    assert [problem for check in validate(autopilot) for problem in check.problems] == []
    assert validate_fmu(str(autopilot)) == []
    command = [sys.executable, "-m", "fmu_manipulation_toolbox", "-input", str(autopilot), "-check"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    printed = done.stdout + done.stderr
    assert "No semantic error" in printed
    assert not [line for line in printed.splitlines() if line.startswith(("ERROR", "WARNING", "CRITICAL"))]


def test_names_units_and_structure(autopilot: Path) -> None:
    description = read_description(autopilot)
    variables = {variable.name: variable for variable in description.modelVariables}
    for name in (*STATES, *COMMANDS):  # what is connected by name fits
        assert variables[name].unit == BY_NAME[name].unit
        assert {variables[name].causality, BY_NAME[name].causality} == {"input", "output"}
    assert set(COMMANDS) < set(INPUTS)
    assert [v.name for v in description.modelVariables if v.causality == "input"] == list(STATES)
    outputs = [*COMMANDS, "waypoint", "cross_track_error", "distance", "arrived", "status", "missed", "turns"]
    assert [unknown.variable.name for unknown in description.outputs] == outputs
    assert all(unknown.dependencies == [] for unknown in description.outputs)
    for unknown in description.initialUnknowns:
        assert {each.name for each in unknown.dependencies} >= {*STATES, *ORDERS, "waypoint_count", "waypoint[32].y"}
    tunable = {v.name for v in description.modelVariables if v.variability == "tunable"}
    assert tunable == {*ORDERS, "waypoint_count", *WAYPOINT_NAMES}
    assert len({v.valueReference for v in description.modelVariables}) == len(VARIABLES)
    with zipfile.ZipFile(autopilot) as archive:
        xml = etree.fromstring(archive.read("modelDescription.xml"))
        page = archive.read("documentation/index.html").decode()
    etree.XMLSchema(file=str(FMPY / "schema" / "fmi2" / "fmi2ModelDescription.xsd")).assertValid(xml)
    assert xml.get("variableNamingConvention") == "structured"
    assert all(f"<code>{variable.name}</code>" in page for variable in VARIABLES)
    assert "h*M*Q/I" in page


def test_the_same_bytes_elsewhere(autopilot: Path, fresh: Fresh, tmp_path: Path) -> None:
    code = "from hovercraft_fmu.autopilot.pilot_package import build_autopilot; build_autopilot()"
    fresh(code, env={"TZ": "Pacific/Auckland"})
    again = tmp_path / "build" / "Autopilot.fmu"
    assert hashlib.sha256(again.read_bytes()).digest() == hashlib.sha256(autopilot.read_bytes()).digest()


def test_it_needs_the_standard_library_alone(autopilot: Path, fresh: Fresh, tmp_path: Path) -> None:
    with zipfile.ZipFile(autopilot) as archive:
        archive.extractall(tmp_path)
    code = """
import sys
sys.path.insert(0, sys.argv[1])
module = __import__(open(sys.argv[1] + "/slavemodule.txt").read())
slave = module.Autopilot(instance_name="alone", resources=sys.argv[1])
slave.setup_experiment(0.0, None, None)
slave.enter_initialization_mode()
slave.exit_initialization_mode()
print(slave.get_real([6, 7, 8]))
assert "numpy" not in sys.modules
"""
    assert fresh(code, tmp_path / "resources", flags=("-I", "-S")).strip() == "[7.199999999999999, 0.0, 0.0]"


def test_what_runs_the_hovercraft_says_that_it_is_none(autopilot: Path) -> None:
    with pytest.raises(ValueError, match=r"is an FMU of the model 'Autopilot': must be of 'Hovercraft'"):
        run_fmu(plan("launch"), autopilot)


def test_it_is_checked_elsewhere_but_in_no_host_of_the_hovercraft(autopilot: Path) -> None:
    (check,) = validate_elsewhere(autopilot)
    assert (check.checker, check.problems) == ("fmu-manipulation-toolbox", [])


# ---- values belong to the communication point


def test_outputs_follow_the_start_values_before_the_first_step(instance: Any) -> None:
    see(instance, SOMEWHERE)
    expected = sampled(SOMEWHERE, SOMEWHERE, 0.0)
    instance.setupExperiment()
    instance.enterInitializationMode()
    assert get(instance, *OUTPUTS) == expected
    instance.exitInitializationMode()
    assert get(instance, *OUTPUTS) == expected
    assert instance.getInteger([reference("waypoint")]) == [1]
    assert instance.getBoolean([reference("arrived")]) == [False]


def test_an_output_changes_with_the_step_not_with_the_input(instance: Any) -> None:
    start(instance)
    before = get(instance, *OUTPUTS)
    see(instance, SOMEWHERE)
    assert get(instance, *STATES) == list(SOMEWHERE)
    assert get(instance, *OUTPUTS) == before
    instance.doStep(0.0, 0.7)
    expected = sampled(State(), SOMEWHERE, 0.7)
    assert get(instance, *OUTPUTS) == expected


def test_a_gain_that_is_tuned_acts_with_the_next_step(instance: Any) -> None:
    start(instance)
    put(instance, cruise_speed=0.1)
    assert get(instance, "thrust") == pytest.approx([7.2])
    instance.doStep(0.0, 0.5)
    assert get(instance, "thrust") == pytest.approx([2.4])


def test_a_course_of_its_own(instance: Any, messages: list[str]) -> None:
    instance.setInteger([reference("waypoint_count")], [2])
    instance.setReal([reference(f"waypoint[{i}].{axis}") for i in (1, 2) for axis in "xy"], [30.0, 0.0, 30.0, 40.0])
    start(instance)
    time, seen = 0.0, []
    for x, y in ((10.0, 0.0), (21.0, 0.0), (25.0, 20.0), (30.0, 31.0), (300.0, 0.0)):
        see(instance, State(x, y))
        instance.doStep(time, 0.5)
        time += 0.5
        seen.append((*instance.getInteger([reference("waypoint")]), *instance.getBoolean([reference("arrived")])))
    assert seen == [(1, False), (2, False), (2, False), (2, True), (2, True)]
    assert get(instance, *COMMANDS) == [0.0, 0.0, 0.0]
    assert get(instance, "distance") == pytest.approx([math.hypot(270.0, 40.0)])
    assert told(instance) == (1, 0)
    assert messages == [f"status 1: {STATUS[1]} (said once)"]


def test_waypoints_change_while_it_runs(instance: Any, messages: list[str]) -> None:
    """The one that it goes to, and how many there are: more than eight; it goes on from the end of a course."""
    start(instance)
    instance.setReal([reference("waypoint[1].x"), reference("waypoint[1].y")], [30.0, 40.0])
    assert get(instance, "distance") == [100.0]
    instance.doStep(0.0, 0.5)
    assert get(instance, "distance") == pytest.approx([50.0])
    instance.setInteger([reference("waypoint_count")], [1])
    see(instance, State(30.0, 35.0))
    instance.doStep(0.5, 0.5)
    assert instance.getBoolean([reference("arrived")]) == [True]
    instance.setInteger([reference("waypoint_count")], [32])
    instance.doStep(1.0, 0.5)
    assert instance.getBoolean([reference("arrived")]) == [False]
    assert instance.getInteger([reference("waypoint")]) == [2]
    assert get(instance, "distance") == pytest.approx([math.hypot(130.0, 25.0)])
    assert len(messages) == 1


def test_what_it_tells_it_says_once(instance: Any, messages: list[str]) -> None:
    instance.setReal([reference("yaw_rate_gain")], [100.0])
    start(instance)
    instance.doStep(0.0, 0.5)
    see(instance, State(101.0, 20.0))
    instance.doStep(0.5, 0.5)
    instance.doStep(1.0, 0.5)
    assert told(instance) == (2 + 64, 1)
    assert messages == [f"status {bit}: {STATUS[bit]} (said once)" for bit in (64, 2)]


# ---- faults


FAULTS: dict[str, tuple[Callable[[Any], object], str]] = {
    "input nan": (lambda i: put(i, pose__x=math.nan), "pose.x = nan: must be a finite number"),
    "input inf": (lambda i: put(i, velocity__y=-math.inf), "velocity.y = -inf: must be a finite number"),
    "radius zero": (
        lambda i: put(i, acceptance_radius=0.0),
        "acceptance_radius = 0.0 m: must be a finite number greater than 0",
    ),
    "gain below": (lambda i: put(i, lookahead=-1.0), "lookahead = -1.0 m: must be a finite number, 0 or greater"),
    "thrust_min": (lambda i: put(i, thrust_min=1.0), "thrust_min = 1.0 N: must be a finite number, 0 or less"),
    "choice": (lambda i: i.setInteger([reference("turn_back")], [2]), "turn_back = 2: must be 0 or 1"),
    "no waypoints": (
        lambda i: i.setInteger([reference("waypoint_count")], [0]),
        "waypoint_count = 0: must be from 1 to",
    ),
    "waypoint nan": (
        lambda i: i.setReal([reference("waypoint[9].x")], [math.nan]),
        "waypoint[9].x = nan: must be a finite number",
    ),
    "gain nan": (lambda i: put(i, heading_gain=math.nan), "heading_gain = nan: must be a finite number"),
    "output": (lambda i: put(i, thrust=1.0), "thrust = 1.0: must not be set in state 'step mode' (discrete output)"),
    "boolean output": (lambda i: i.setBoolean([reference("arrived")], [True]), "arrived = True: must not be set"),
    "no such real": (lambda i: i.getReal([99]), "value reference 99: must be that of a variable of type Real"),
    "no such boolean": (lambda i: i.getBoolean([0]), "value reference 0: must be that of a variable of type Boolean"),
    "step zero": (lambda i: i.doStep(0.1, 0.0), "communicationStepSize = 0.0 s: must be a finite number greater"),
    "point ahead": (lambda i: i.doStep(0.2, 0.1), "currentCommunicationPoint = 0.2 s: must be where the last step"),
    "set up twice": (lambda i: i.setupExperiment(), "fmi2SetupExperiment in state 'step mode'"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_loud_and_loses_nothing(name: str, instance: Any, messages: list[str]) -> None:
    fault, message = FAULTS[name]
    start(instance)
    see(instance, SOMEWHERE)
    instance.doStep(0.0, 0.1)
    before = everything(instance)
    with pytest.raises(FMICallException):
        fault(instance)
    assert message in messages[-1]
    assert everything(instance) == before
    instance.doStep(0.1, 0.1)


def test_an_impossible_course_is_refused(instance: Any, messages: list[str]) -> None:
    for count in (0, 33):
        with pytest.raises(FMICallException):
            instance.setInteger([reference("waypoint_count")], [count])
        assert messages[-1] == f"waypoint_count = {count}: must be from 1 to 32"


FINITE = st.floats(allow_nan=False, allow_infinity=False)


@settings(max_examples=150)
@given(motion=st.builds(State, *[FINITE] * 6), step=numbers(1e-9, 1e9), gain=numbers(1e-300, 1e300))
def test_no_silent_nan(motion: State, step: float, gain: float, shared: tuple[Any, list[str]]) -> None:
    """Any finite pose, velocity, gain and step: finite outputs, or a message and the last good ones."""
    instance, messages = shared
    instance.reset()
    messages.clear()
    start(instance)
    before = get(instance, *OUTPUTS)
    see(instance, motion)
    put(instance, velocity_gain=gain)
    try:
        instance.doStep(0.0, step)
    except FMICallException:
        assert "must be a finite" in messages[-1]
        assert get(instance, *OUTPUTS) == before
        return
    thrust, port, starboard, *sight = get(instance, *OUTPUTS)
    assert 0.0 <= thrust <= 10.0
    assert 0.0 <= max(port, starboard) <= 1.0
    assert min(port, starboard) == 0.0
    assert all(map(math.isfinite, sight))


# ---- state


def test_a_run_that_is_rolled_back_repeats_to_the_bit(instance: Any, messages: list[str]) -> None:
    start(instance)
    seen = []
    for k in range(20):
        if k == 10:
            saved = bytes(instance.serializeFMUstate(instance.getFMUstate()))
        see(instance, State(9.0 * k, math.sin(k), 0.1 * k, 0.2, 0.1, 0.0))
        if k == 15:
            put(instance, lookahead=15.0)
        instance.doStep(0.5 * k, 0.5)
        seen.append(everything(instance))
    assert seen[5] != seen[15]
    for prepare in (lambda: None, instance.reset):
        prepare()
        instance.setFMUstate(instance.deSerializeFMUstate(saved))
        assert everything(instance) == seen[9]
        for k in range(10, 20):
            see(instance, State(9.0 * k, math.sin(k), 0.1 * k, 0.2, 0.1, 0.0))
            if k == 15:
                put(instance, lookahead=15.0)
            instance.doStep(0.5 * k, 0.5)
            assert everything(instance) == seen[k]
    assert messages == []


def test_a_state_that_is_damaged_or_of_another_build_is_refused(instance: Any, messages: list[str]) -> None:
    start(instance)
    saved = bytes(instance.serializeFMUstate(instance.getFMUstate()))
    for bad, message in ((saved[:-1], "must be complete"), (with_build(saved, "0" * 32), "must be a state of this")):
        with pytest.raises(FMICallException):
            instance.deSerializeFMUstate(bad)
        assert message in messages[-1]


def test_a_state_from_before_the_start(instance: Any) -> None:
    put(instance, pose__x=7.0, lookahead=12.0)
    before = instance.getFMUstate()
    content = bytes(instance.serializeFMUstate(before))
    start(instance)
    instance.doStep(0.0, 1.0)
    instance.setFMUstate(before)
    assert bytes(instance.serializeFMUstate(instance.getFMUstate())) == content
    put(instance, pose__x=8.0)
    start(instance)
    assert get(instance, "distance", "lookahead") == [92.0, 12.0]
