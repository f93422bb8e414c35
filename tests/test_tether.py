"""The tether: its law, its FMU, and a tow by three FMUs and a master."""

import math
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from lxml import etree

from hovercraft_fmu.building.ssp import build_tow_ssp
from hovercraft_fmu.coupling import GAUSS_SEIDEL, JACOBI
from hovercraft_fmu.elsewhere import HOSTS, rows_of_module
from hovercraft_fmu.host import Fmu, SimulationError
from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.dynamics import State
from hovercraft_fmu.model.integrators import INTEGRATORS
from hovercraft_fmu.model.subcycling import Settings
from hovercraft_fmu.studies.tow import WITH_DERIVATIVES, cases, grown, limits
from hovercraft_fmu.tether.line import Line, pull
from hovercraft_fmu.tether.tether_native import TETHER_NATIVE, TETHER_NATIVE3
from hovercraft_fmu.tether.tether_package import build_tether
from hovercraft_fmu.towing import BEND, COLUMNS, Tow, haul, haul_bare
from hovercraft_fmu.validation import validate_ssp
from tests.conftest import FMI_2, Built
from tests.native import compiled_with_libm
from tests.strategies import states
from tests.tow_masters import CONNECTIONS, MASTERS, SHOWN, STARTS, STRAIGHT

LOOSE_ENDS = "members, connectors, connections"
BOTH = pytest.mark.parametrize("scheme", [JACOBI, GAUSS_SEIDEL])


@pytest.fixture(scope="module")
def tether(built: Built) -> Path:
    return built("Tether.fmu", build_tether)


# ---- the law


@given(states, states)
def test_force_and_moment_are_kept(first: State, second: State) -> None:
    """What one craft gets the other one loses: to the bit, and of the moment about the origin to rounding."""
    made = pull(first, second, Line(slack_length=1.0))
    assert (made.first.x, made.first.y) == (-made.second.x, -made.second.y)
    about = [on.moment + at.x * on.y - at.y * on.x for on, at in ((made.first, first), (made.second, second))]
    assert sum(about) == pytest.approx(0.0, abs=1e-12 * (1.0 + made.tension * 4e3))  # positions to 1e3 m each way


@given(states, states)
def test_the_power_of_the_forces_is_that_of_the_line(first: State, second: State) -> None:
    """-tension times the speed at which its ends part, by a difference of the distance over a microsecond."""
    made = pull(first, second, Line(slack_length=0.0))
    power = sum(
        on.x * at.vx + on.y * at.vy + on.moment * at.yaw_rate for on, at in ((made.first, first), (made.second, second))
    )

    def later(at: State, h: float) -> State:
        return State(at.x + h * at.vx, at.y + h * at.vy, at.heading + h * at.yaw_rate, *at[3:])

    h = 1e-6
    ends = [pull(later(first, each), later(second, each), Line()).distance for each in (-h, h)]
    speed = (ends[1] - ends[0]) / (2 * h)
    assert power == pytest.approx(-made.tension * speed, rel=1e-4, abs=1e-4 * (1.0 + made.tension))


def test_it_pulls_and_never_pushes() -> None:
    line = Line(stiffness=4.0, damping=3.0, slack_length=10.0, first_x=0.0, second_x=0.0)
    for distance, speed, expected in ((12.0, 0.0, 8.0), (12.0, 1.0, 11.0), (12.0, -1.0, 5.0), (12.0, -4.0, 0.0),
                                      (10.0, 5.0, 0.0), (3.0, -9.0, 0.0)):  # fmt: skip
        made = pull(State(), State(x=distance, vx=speed), line)
        assert (made.first, made.second) == ((expected, 0.0, 0.0), (-expected, 0.0, 0.0))
        assert (made.tension, made.distance) == (expected, distance)


def test_where_the_ends_meet_there_is_no_force() -> None:
    line = Line(slack_length=0.0, first_x=0.0, second_x=0.0)
    made = pull(State(vx=-1.0), State(vx=1.0), line)
    assert (*made.first, *made.second, made.tension, made.distance) == (0.0,) * 8


def test_the_moment_is_that_of_the_end_of_the_line() -> None:
    """Abeam of a craft that heads along x, at its bow: the arm is all of it."""
    made = pull(State(), State(x=5.0, y=20.0), Line(10.0, 0.0, 10.0, 5.0, 0.0, 0.0, 0.0))
    assert made.first == (0.0, 100.0, 500.0)
    assert made.second == (0.0, -100.0, 0.0)


# ---- the FMU


@BOTH
def test_three_fmus_have_the_bits_of_the_bare_functions(scheme: str, fmu: Path, tether: Path) -> None:
    found = haul(BEND, fmu, tether, scheme=scheme, stop_time=20.0)
    expected = haul_bare(BEND, scheme=scheme, stop_time=20.0)
    for name in COLUMNS:
        assert found[name].tolist() == expected[name].tolist(), name
    assert found["tension"].max() > 5.0


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"stiffness": -1.0}, "stiffness = -1.0: must not be negative"),
        ({"damping": -0.5}, "damping = -0.5: must not be negative"),
        ({"slack_length": -2.0}, "slack_length = -2.0: must not be negative"),
        ({"first.attachment.x": math.nan}, "first.attachment.x = nan: must be a finite number"),
        ({"second.pose.x": math.inf}, "second.pose.x = inf: must be a finite number"),
    ],
)
def test_a_line_that_cannot_be_is_refused_by_name(values: dict[str, float], said: str, tether: Path) -> None:
    with Fmu(tether) as opened, opened.instance() as line, pytest.raises(SimulationError, match=said):
        line.start(values)


def test_a_force_without_end_is_refused_and_the_last_one_stands(tether: Path) -> None:
    with Fmu(tether) as opened, opened.instance() as line:
        line.start({"second.pose.x": 50.0})
        before = line.port("tension").get()
        line.port("stiffness").set([1e308])
        with pytest.raises(SimulationError, match=r"first.external.force.x = .*: must be a finite number"):
            line.step(0.0, 0.1)
        assert line.port("tension").get() == before


# ---- machine code


@pytest.fixture(scope="module")
def with_libm(each_native_tether: Path, standard: int, tmp_path_factory: pytest.TempPathFactory) -> Path:
    flavour = TETHER_NATIVE if standard == 2 else TETHER_NATIVE3
    return compiled_with_libm(each_native_tether, flavour, tmp_path_factory.mktemp("libm"))


@BOTH
def test_with_libm_the_native_one_has_the_bits_of_the_python_one(scheme: str, fmu: Path, with_libm: Path) -> None:
    found = haul(BEND, fmu, with_libm, scheme=scheme, stop_time=60.0)
    expected = haul_bare(BEND, scheme=scheme, stop_time=60.0)
    for name in COLUMNS:
        assert found[name].tolist() == expected[name].tolist(), name


def test_with_its_own_sine_it_is_the_same_but_for_roundings(fmu: Path, each_native_tether: Path) -> None:
    found, expected = haul(BEND, fmu, each_native_tether, stop_time=60.0), haul_bare(BEND, stop_time=60.0)
    for name in COLUMNS:
        assert np.abs(found[name] - expected[name]).max() < 1e-10, name  # a unit in the last place, for a minute


@pytest.mark.parametrize("name", ["stiffness", "damping", "slack_length"])
def test_the_native_one_refuses_in_the_same_words(name: str, each_native_tether: Path) -> None:
    said = f"{name} = -1.0: must not be negative"
    with Fmu(each_native_tether) as opened, opened.instance() as line, pytest.raises(SimulationError, match=said):
        line.start({name: -1.0})


# ---- the tow


RK4 = next(each for each in INTEGRATORS if each.name == "rk4")  # exact where a force is held


@pytest.mark.parametrize(("scheme", "share"), [(GAUSS_SEIDEL, 1.0), (JACOBI, 3.0)])
def test_a_line_without_damping_gains_energy_as_the_theory_says(scheme: str, share: float) -> None:
    """Forces that are held over H feed the oscillation about the mean pull, T/2: its amplitude grows by H*w^2/4 a
    second, by three times that where the force comes a step late; and momentum grows by T*t, no more.
    """
    craft, stiffness, h = Craft(drag_coefficient=0.0), 8.0, 0.1
    omega = math.sqrt(stiffness * 2.0 / craft.mass)
    line = Line(stiffness, 0.0, 20.0, 0.0, 0.0, 0.0, 0.0)
    start = State(x=20.0 + 5.0 / stiffness + 0.01)
    tow = Tow(start, State(), craft, line, ((0.0, 10.0, 0.0, 0.0),), h, 4 * 2.0 * math.pi / omega)
    towed = haul_bare(tow, scheme=scheme, settings=Settings(h, RK4))
    stretch = towed["first.pose.x"] - towed["second.pose.x"] - 20.0 - 5.0 / stiffness
    first, second = towed["first.velocity.x"], towed["second.velocity.x"]
    assert craft.mass * (first + second) == pytest.approx(10.0 * towed["time"])
    rate = np.polyfit(towed["time"], np.log(np.hypot(stretch, (first - second) / omega)), 1)[0]
    assert rate == pytest.approx(share * h * omega**2 / 4, rel=0.03)  # of first order in H*w = 0.04


def test_how_long_a_step_may_be() -> None:
    """Against the limits of Jury's criterion by hand, 4*zeta and 1/zeta, and of the late force, a quarter or so."""
    dampings, lines, schemes = (0.05, 0.5, 1.0), ((2.0, 100.0), (2000.0, 1.0)), (GAUSS_SEIDEL, JACOBI)
    found = limits(cases(dampings, lines, schemes)).reshape(2, 3, 2)
    for of_line in found:  # whatever its stiffness and the masses
        assert of_line[:, 0] == pytest.approx([0.2, 2.0, 1.0], rel=0.02)
        assert of_line[:, 1] == pytest.approx([0.067, 0.482, 0.427], rel=0.02)


@FMI_2
def test_what_held_forces_add_and_derivatives_save(native_fmu: Path, each_native_tether: Path) -> None:
    """By FMUs: a line without damping grows by H*w/4 and three times that, to first order; not by derivatives."""
    found = [grown(native_fmu, each_native_tether, each, 0.05) for each in (GAUSS_SEIDEL, JACOBI, WITH_DERIVATIVES)]
    assert [each.rate for each in found[:2]] == pytest.approx([0.05 / 4, 3 * 0.05 / 4], rel=0.01)  # the next term
    assert abs(found[2].rate) < 1e-6  # roundings
    assert [each.calls for each in found] == [9.0, 9.0, 11.0]  # set, step and get of three; and two derivatives


@FMI_2
@pytest.mark.parametrize("master", [each for each in MASTERS if each.startswith("libcosimpy")])
def test_libcosim_gives_the_bits_of_ours(master: str, native_fmu: Path, each_native_tether: Path) -> None:
    """In FMI 2.0: libcosimpy 0.0.6 dies on an FMU of FMI 3.0."""
    assert_bits_of_ours(master, native_fmu, each_native_tether)


@pytest.mark.parametrize("master", [each for each in MASTERS if not each.startswith("libcosimpy")])
def test_another_master_gives_the_bits_of_ours(master: str, each_native_fmu: Path, each_native_tether: Path) -> None:
    assert_bits_of_ours(master, each_native_fmu, each_native_tether)


def assert_bits_of_ours(master: str, craft: Path, tether: Path) -> None:
    """A straight tow by two craft and a tether, all three machine code, side by side."""
    library = master.split(",")[0]
    if missing := HOSTS[library].missing():
        pytest.skip(missing)
    if library == "ecospy" and not Path(sys.prefix, "lib", "libtbb.so.12").exists():
        pytest.skip("the package tbb is not in this environment's own folder")
    found = rows_of_module("tests.tow_masters", master, str(craft), str(tether))
    ours = haul(STRAIGHT, craft, tether)
    names = [name if part == "tether" else f"{part}.{name}" for part, name in SHOWN]
    assert found == np.array([ours[name] for name in names]).T[1:].tolist()
    assert max(row[-1] for row in found) > 5.0


def test_the_ssp_of_the_tow_is_valid_whole_and_the_same_every_time(
    each_native_fmu: Path, each_native_tether: Path, tmp_path: Path
) -> None:
    """By the schemas, and what it names is there; it gives the tow that is run above."""
    path, again = (
        build_tow_ssp(tmp_path / folder / "Tow.ssp", each_native_fmu, each_native_tether) for folder in ("a", "b")
    )
    assert path.read_bytes() == again.read_bytes()
    checks = [check for check in validate_ssp(path) if check.what in ("XML schemas of SSP", LOOSE_ENDS)]
    assert [check.problems for check in checks] == [[], []]
    with zipfile.ZipFile(path) as archive:
        assert len([name for name in archive.namelist() if name.endswith(".fmu")]) == 2
        sets = {part: etree.fromstring(archive.read(f"resources/{part}.ssv")) for part in STARTS}
        structure = etree.fromstring(archive.read("SystemStructure.ssd"))
        page = archive.read("documentation/tow.html").decode()
    for part, expected in STARTS.items():
        values = {node.get("name"): float(node[0].get("value")) for node in sets[part].iter("{*}Parameter")}
        assert expected.items() <= values.items()
        assert sets[part].get("name") == "tow"
    ends = ("startElement", "startConnector", "endElement", "endConnector")
    assert [tuple(node.get(end) for end in ends) for node in structure.iter("{*}Connection")] == [*CONNECTIONS]
    connectors = {
        (part.get("name"), each.get("name")): each[0].get("unit")
        for part in structure.iter("{*}Component")
        for each in part.iter("{*}Connector")
    }
    for start, output, end, taken in CONNECTIONS:
        assert connectors[start, output] == connectors[end, taken] is not None
    assert ("first", "thrust") not in connectors  # fmpy.ssp would hold it at 0
    assert "connector for <code>thrust</code>:" in page
