"""The native autopilot: the bits of the Python one, its words, and the room's habits with a model of another kind."""

import math
import random
import re
import subprocess
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import fmpy
import pytest
from fmpy.fmi1 import FMICallException

from hovercraft_fmu.autopilot.pilot_interface import AUTOPILOT_MODEL, DEMO_COURSE, STATUS
from hovercraft_fmu.autopilot.pilot_native import AUTOPILOT_NATIVE, AUTOPILOT_NATIVE3
from hovercraft_fmu.building.ssp import build_ssp
from hovercraft_fmu.coupling import sail
from hovercraft_fmu.fmu.description import NATIVE, NATIVE3
from hovercraft_fmu.fmu.interface import STATES
from hovercraft_fmu.fmu.machine_code import C_FOLDER
from hovercraft_fmu.fmu.native_package import binary
from hovercraft_fmu.host import Fmu, Instance, SimulationError
from hovercraft_fmu.scenes import VOYAGES
from tests.lowlevel import one, start
from tests.native import C_INCLUDES, C_TESTS, compile_c, compiled_with_libm

OUTPUTS = tuple(v.name for v in AUTOPILOT_MODEL.variables if v.causality == "output")
ON_ICE = {"mass": 100.0, "cruise_speed": 2.0, "thrust_min": -10.0}
MINDS: dict[str, dict[str, float]] = {
    "as it starts": {},
    "given gains": {"lookahead": 20.0, "velocity_gain": 20.0, "integral_time": 30.0, "heading_gain": 1.5,
                    "yaw_rate_gain": 10.0, "turn_rate": 0.1},
    "the same waypoint twice": {"waypoint[2].x": DEMO_COURSE[0][0], "waypoint[2].y": DEMO_COURSE[0][1]},
    "reverse thrust, turns back": {**ON_ICE, "turn_back": 1},
    "keeps its station": {"keep_station": 1, "waypoint_count": 2, "acceptance_radius": 30.0},
    "nothing to steer with": {"steering_force": 0.0},
}  # fmt: skip


@pytest.fixture(scope="module")
def with_libm(each_native_autopilot: Path, standard: int, tmp_path_factory: pytest.TempPathFactory) -> Path:
    flavour = AUTOPILOT_NATIVE if standard == 2 else AUTOPILOT_NATIVE3
    return compiled_with_libm(each_native_autopilot, flavour, tmp_path_factory.mktemp("libm"))


def voyage(fmu: Path, mind: dict[str, float], seed: int) -> Iterator[list[float]]:
    """Outputs along a way that wanders about the course, at steps of any size; halfway the course is another one."""
    chance = random.Random(seed)
    with Fmu(fmu, AUTOPILOT_MODEL.name) as opened, opened.instance() as pilot:
        motion, outputs = pilot.port(*STATES), pilot.port(*OUTPUTS)
        x, y, heading, time = 0.0, 0.0, 0.0, 0.0
        pilot.start(mind)
        yield list(outputs.get())
        for k in range(150):
            to_x, to_y = DEMO_COURSE[min(k // 25, 5)]
            vx, vy, yaw_rate = (
                chance.gauss(to_x - x, 60.0) / 40.0,
                chance.gauss(to_y - y, 60.0) / 40.0,
                chance.gauss(0, 0.2),
            )
            step = chance.choice([0.1, 0.5, 2.0, 30.0])
            x, y, heading = x + vx * step, y + vy * step, heading + yaw_rate * step
            if k == 140:  # where it would keep its station
                x, y = DEMO_COURSE[1]
            motion.set([x, y, heading, vx, vy, yaw_rate])
            if k == 75:
                pilot.set({"waypoint[5].x": 70.0, "waypoint[6].y": -20.0, "cruise_speed": 0.5})
            pilot.step(time, step)
            time += step
            yield list(outputs.get())


@pytest.mark.parametrize("mind", MINDS)
def test_with_libm_it_has_the_bits_of_the_python_one(mind: str, with_libm: Path, autopilot: Path) -> None:
    seen = set()
    for seed in range(3):
        ours, theirs = (list(voyage(fmu, MINDS[mind], seed)) for fmu in (with_libm, autopilot))
        assert ours == theirs
        seen |= {row[OUTPUTS.index("status")] for row in theirs}
    assert len(seen) > 1  # it went through more than one state of mind


def test_a_leg_so_long_that_the_way_left_is_lost_in_rounding(with_libm: Path, autopilot: Path) -> None:
    """14 m before the waypoint, on the line, 10^17 m from where it begins: straight on, whatever its digits say."""

    def commands(fmu: Path) -> list[float]:
        with Fmu(fmu, AUTOPILOT_MODEL.name) as opened, opened.instance() as pilot:
            pilot.start({"pose.x": -1e17, "waypoint[1].x": 7.0, "waypoint[1].y": 0.0, "turn_back": 1,
                         "acceptance_radius": 2.0})  # fmt: skip
            pilot.set({"pose.x": -7.0})
            pilot.step(0.0, 0.1)
            return list(pilot.port(*OUTPUTS).get())

    found = commands(with_libm)
    assert found == commands(autopilot)
    assert found[OUTPUTS.index("distance")] == 14.0
    assert found[OUTPUTS.index("thrust")] > 0.0
    assert found[OUTPUTS.index("port_thruster")] == found[OUTPUTS.index("starboard_thruster")] == 0.0


@pytest.mark.parametrize("mind", MINDS)
def test_with_its_own_arctangent_it_is_the_same_but_for_roundings(
    mind: str, each_native_autopilot: Path, autopilot: Path
) -> None:
    ours, theirs = (list(voyage(fmu, MINDS[mind], 1)) for fmu in (each_native_autopilot, autopilot))
    for mine, other in zip(ours, theirs, strict=True):
        assert mine == pytest.approx(other, rel=1e-9, abs=1e-9)


def test_the_loop_of_native_fmus_runs_where_there_is_no_python(
    each_native_fmu: Path, each_native_autopilot: Path, standard: int, tmp_path: Path
) -> None:
    """A host in C with nothing but the two FMUs of the SSP in its process; the bits are those of our own master."""
    ssp = build_ssp(tmp_path / "Loop.ssp", each_native_fmu, each_native_autopilot, VOYAGES["calm"])
    craft, pilot = (NATIVE, AUTOPILOT_NATIVE) if standard == 2 else (NATIVE3, AUTOPILOT_NATIVE3)
    arguments: list[str] = []
    with zipfile.ZipFile(ssp) as archive:
        for fmu, flavour in ((each_native_fmu, craft), (each_native_autopilot, pilot)):
            archive.extract(f"resources/{fmu.name}", tmp_path)
            path = tmp_path / "resources" / fmu.name
            folder = fmpy.extract(str(path), unzipdir=str(tmp_path / flavour.identifier))
            guid = fmpy.read_model_description(str(path)).guid
            arguments += [str(Path(folder) / "binaries" / binary("x86_64-linux", flavour)), str(guid)]
    includes = (*C_INCLUDES, "-I", str(C_FOLDER / f"fmi{standard}"))
    host = compile_c(tmp_path / "loop", [C_TESTS / "loop.c"], f"-DFMI={standard}", *includes, "-ldl")
    done = subprocess.run([host, *arguments, "0.5", "600"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    passage = sail("calm", each_native_fmu, each_native_autopilot, stop_time=300.0)
    assert [float(each) for each in done.stdout.split()] == [passage[name][-1] for name in STATES]


def test_all_that_it_tells_is_said_once_in_the_same_words(each_autopilot: Path) -> None:
    """A voyage on which everything goes wrong, one thing after the other, and goes on going wrong."""
    aside, no_gains = {"pose.x": 100.0, "pose.y": 20.0}, {"steering_force": 0.0}
    voyage: list[tuple[int, dict[str, float], float]] = [
        (64, {"turn_back": 1}, 2.0),
        (4, {"pose.x": -400.0}, 0.1),
        (32, {"velocity_gain": 100.0, "integral_time": 10.0}, 100.0),
        (16, {"heading_gain": 2.0, "pose.heading": 2.0}, 100.0),
        (0, {"pose.x": 80.0, "pose.y": 0.0}, 0.1),
        (0, aside, 0.1),
        (0, {"pose.x": 120.0, "pose.y": 0.0}, 0.1),
        (0, {"pose.x": 100.0, "pose.y": -20.0}, 0.1),
        (8, {"pose.x": 79.0, "pose.y": 1.0}, 0.1),
        (2, {**aside, "turn_back": 0}, 0.1),
        (128, no_gains, 0.1),
        (1, {"acceptance_radius": 1000.0}, 0.1),
    ]
    with Fmu(each_autopilot, AUTOPILOT_MODEL.name) as opened, opened.instance() as pilot:
        status = pilot.port("status")
        pilot.start()
        time, told, expected = 0.0, 0, []
        for bit, values, duration in voyage:
            pilot.set(values)
            told |= bit
            expected += [f"status {bit}: {STATUS[bit]} (said once)"] if bit else []
            for _ in range(3):  # what it says it says with one of them
                pilot.step(time, duration)
                time += duration
            assert status.get() == [told]
            assert pilot.messages == expected
    assert told == 255


# ---- faults: the words of the Python one, and nothing is lost


def stepped(pilot: Instance, values: dict[str, float]) -> None:
    pilot.set(values)
    pilot.step(1.0, 1.0)


FAULTS: dict[str, tuple[Callable[[Instance], object], str]] = {
    "input nan": (lambda i: i.set({"pose.x": math.nan}), "pose.x = nan: must be a finite number"),
    "order negative": (
        lambda i: i.set({"cruise_speed": -1.0}),
        "cruise_speed = -1.0 m/s: must be a finite number greater than 0",
    ),
    "thrust_min above 0": (lambda i: i.set({"thrust_min": 1.0}), "thrust_min = 1.0 N: must be"),
    "a choice of none": (lambda i: i.set({"keep_station": 2}), "keep_station = 2: must be 0 or 1"),
    "no waypoints": (lambda i: i.set({"waypoint_count": 0}), "waypoint_count = 0: must be from 1 to 32"),
    "an output": (lambda i: i.set({"thrust": 1.0}), "thrust = 1.0: must not be set in state"),
    "arrived": (lambda i: i.set({"arrived": 1}), "arrived = True: must not be set in state"),
    "not arrived": (lambda i: i.set({"arrived": 0}), "arrived = False: must not be set in state"),
    "a counter": (lambda i: i.set({"waypoint": 1}), "waypoint = 1: must not be set in state"),
    "step back": (lambda i: i.step(0.0, 1.0), "currentCommunicationPoint = 0.0 s: must be where the last step ended"),
    "step nan": (lambda i: i.step(1.0, math.nan), "communicationStepSize = nan s: must be"),
    "orders out of range": (
        lambda i: stepped(i, {"steering_force": 1e308, "inertia": 1e-300}),
        "frequency = inf rad/s of the heading's loop: must be a finite number; it is made of",
    ),
    "a pose out of range": (
        lambda i: stepped(i, {"pose.x": 1.7e308, "waypoint[1].x": -1.7e308}),
        "must be a finite number; the motion is out of range",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_loud_in_the_same_words_and_loses_nothing(name: str, each_autopilot: Path) -> None:
    fault, words = FAULTS[name]
    with Fmu(each_autopilot, AUTOPILOT_MODEL.name) as opened, opened.instance() as pilot:
        outputs = pilot.port(*OUTPUTS)
        pilot.start()
        pilot.step(0.0, 1.0)
        before = list(outputs.get())
        with pytest.raises(SimulationError, match=re.escape(words)):
            fault(pilot)
        assert list(outputs.get()) == before


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"steering_force": 1e308, "inertia": 1e-300}, "frequency = inf rad/s of the heading's loop: must be"),
        ({"pose.x": 1.7e308, "waypoint[1].x": -1.7e308}, "must be a finite number; the motion is out of range"),
    ],
)
def test_what_is_out_of_range_from_the_beginning_does_not_start(
    values: dict[str, float], words: str, each_native_autopilot: Path
) -> None:
    """Nor can be read what would follow from it."""
    with one(each_native_autopilot) as (pilot, messages):
        references = {v.name: v.reference for v in AUTOPILOT_MODEL.variables}
        pilot.setReal([references[name] for name in values], list(values.values()))
        pilot.setupExperiment()
        pilot.enterInitializationMode()
        calls: tuple[Callable[[], object], ...] = (
            lambda: pilot.getInteger([references["waypoint"]]),
            lambda: pilot.getBoolean([references["arrived"]]),
            pilot.exitInitializationMode,
        )
        for call in calls:
            with pytest.raises(FMICallException):
                call()
            assert words in messages.pop()


def test_once_arrived_it_asks_for_nothing(each_autopilot: Path) -> None:
    with Fmu(each_autopilot, AUTOPILOT_MODEL.name) as opened, opened.instance() as pilot:
        pilot.start({"waypoint_count": 1, "acceptance_radius": 1e3})
        pilot.set({"velocity.x": 2.0, "pose.heading": 0.5})
        pilot.step(0.0, 1.0)
        assert pilot.port("arrived", "thrust", "port_thruster", "starboard_thruster").get() == [1, 0.0, 0.0, 0.0]


def test_a_state_goes_back_and_that_of_another_model_is_refused(
    each_native_autopilot: Path, each_native_fmu: Path
) -> None:
    with one(each_native_autopilot) as (pilot, _), one(each_native_fmu) as (craft, messages):
        start(pilot)
        start(craft)
        pilot.doStep(0.0, 1.0)
        saved = bytes(pilot.serializeFMUstate(pilot.getFMUstate()))
        then = read(pilot)
        for k in range(1, 200):
            pilot.doStep(float(k), 1.0)
        assert read(pilot) != then
        pilot.setFMUstate(pilot.deSerializeFMUstate(saved))
        assert read(pilot) == then
        with pytest.raises(FMICallException):
            craft.deSerializeFMUstate(saved)
        assert "must be a state of this build" in messages[-1]


def read(pilot: Any) -> list[float]:
    return [
        float(value) for value in pilot.getReal([v.reference for v in AUTOPILOT_MODEL.variables if v.kind == "Real"])
    ]


def test_what_it_has_not_got_is_refused(native_autopilot: Path) -> None:
    with one(native_autopilot) as (pilot, messages):
        start(pilot)
        calls: tuple[Callable[[], object], ...] = (
            lambda: pilot.getDirectionalDerivative([6], [0], [1.0]),
            lambda: pilot.setRealInputDerivatives([0], [1], [1.0]),
            lambda: pilot.getRealOutputDerivatives([6], [1]),
        )
        for call in calls:
            with pytest.raises(FMICallException):
                call()
            assert "must not be called: the model has no " in messages[-1]
