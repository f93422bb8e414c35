"""The closed loop: it arrives, to the bit as the bare functions do; its error has an order; every master agrees."""

import csv
import functools
import hashlib
import math
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import fmpy.ssp
import numpy as np
import pytest
from click.testing import CliRunner
from lxml import etree
from PIL import Image

from hovercraft_fmu.autopilot.guidance import ARRIVED, Orders
from hovercraft_fmu.autopilot.pilot_interface import AUTOPILOT_MODEL, COMMANDS, STATUS
from hovercraft_fmu.building import build
from hovercraft_fmu.building.ssp import build_ssp
from hovercraft_fmu.cli import commands
from hovercraft_fmu.coupling import (
    COLUMNS,
    GAUSS_SEIDEL,
    JACOBI,
    SCHEMES,
    BareAutopilot,
    BareCraft,
    Part,
    Passage,
    master,
    sail,
    sail_bare,
)
from hovercraft_fmu.elsewhere import HOSTS
from hovercraft_fmu.fmu.interface import HOVERCRAFT, STATES, WIND
from hovercraft_fmu.host import SimulationError
from hovercraft_fmu.model.craft import PRESETS
from hovercraft_fmu.model.integrators import integrator
from hovercraft_fmu.model.subcycling import Settings
from hovercraft_fmu.scenes import VOYAGES, Voyage
from hovercraft_fmu.studies import closed_loop as study
from tests.conftest import FMI_2, ROOT
from tests.masters import LOOPS, STEP, STEPS, VOYAGE, loop_in

RK4 = Settings(0.1, integrator(3))
RESULTS = ROOT / "hovercraft_fmu" / "studies" / "results"
SCHEMAS = Path(fmpy.ssp.__file__).parent / "schema"


# ---- it arrives


def assert_arrived(passage: Passage) -> None:
    """Within the circle of every waypoint, one after the other; then everything is off."""
    assert passage.arrived
    track = np.column_stack((passage["pose.x"], passage["pose.y"]))
    active, begin = passage["waypoint"].astype(int), 0
    assert sorted(set(active)) == list(range(1, 7))
    for point in passage.waypoints:
        nearest = np.hypot(*(track[begin:] - point).T)
        begin += int(np.argmax(nearest <= passage.acceptance_radius))
        assert nearest[0] > passage.acceptance_radius or begin > 0
        assert np.hypot(*(track[begin] - point)) <= passage.acceptance_radius
    assert [passage[name][-1] for name in COMMANDS] == [0.0, 0.0, 0.0]
    assert not np.any(passage["port_thruster"] * passage["starboard_thruster"])
    assert passage.distance > 25.0 * passage.craft.length
    assert (passage.reached, passage.told) == (6, (STATUS[ARRIVED],))


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("name", VOYAGES)
def test_every_voyage_reaches_every_waypoint(name: str, scheme: str) -> None:
    assert_arrived(sail_bare(name, scheme=scheme, settings=RK4))


@pytest.mark.parametrize("wind", [{"wind.x": 0.2}, {"wind.x": -0.2}, {"wind.y": -0.2}])
def test_from_wherever_the_wind_blows(wind: dict[str, float]) -> None:
    assert_arrived(sail_bare(Voyage("any", "", wind), settings=RK4))


def test_heavy_and_light_with_their_inertia_in_the_wind() -> None:
    for share in (0.5, 2.0):
        craft = {"mass": 100.0 * share, "inertia": 500.0 * share, "wind.y": 0.2}
        assert_arrived(sail_bare(Voyage("any", "", craft), settings=RK4))


def test_the_native_hovercraft_arrives(each_native_fmu: Path, autopilot: Path) -> None:
    assert_arrived(sail("crosswind", each_native_fmu, autopilot))


# ---- it is the bare functions'


@functools.cache
def bare_functions(name: str, scheme: str) -> Passage:
    """Past the first waypoint."""
    return sail_bare(name, scheme=scheme, stop_time=340.0)


@pytest.mark.parametrize(("name", "scheme"), [*((name, JACOBI) for name in VOYAGES), ("crosswind", GAUSS_SEIDEL)])
def test_the_fmus_give_the_bits_of_the_bare_functions(
    name: str, scheme: str, each_fmu: Path, fmu: Path, autopilot: Path
) -> None:
    """Past the first waypoint. The native hovercraft has its own sine and cosine, whose last bits may be others."""
    passage = sail(name, each_fmu, autopilot, scheme=scheme, stop_time=340.0)
    bare = bare_functions(name, scheme)
    assert passage["waypoint"][-1] >= 2.0
    if each_fmu == fmu:
        assert (passage.data == bare.data).all()
    else:
        for column in COLUMNS:
            assert passage[column] == pytest.approx(bare[column], rel=1e-9, abs=1e-9)


def test_a_craft_that_starts_elsewhere(fmu: Path, autopilot: Path) -> None:
    """The first leg begins where the craft is, in both."""
    there = Voyage("there", "", {"pose.x": 40.0, "pose.y": -20.0, "pose.heading": 2.0, "velocity.x": -0.1})
    passage, bare = sail(there, fmu, autopilot, stop_time=50.0), sail_bare(there, stop_time=50.0)
    assert (passage.data == bare.data).all()
    assert passage["cross_track_error"][0] == 0.0
    assert passage["distance"][0] == pytest.approx(math.hypot(60.0, 20.0))


def test_an_fmu_with_start_values_of_its_own_is_handed_over_in_initialization_mode(
    autopilot: Path, tmp_path: Path
) -> None:
    """Where it is, and what it is: the first leg begins there, and the gains are those of its mass."""
    there = {"pose.x": 50.0, "pose.y": 50.0, "mass": 300.0, "inertia": 1500.0}
    own = build("python", tmp_path / "There.fmu", name="There", start_values=there)
    passage = sail("calm", own, autopilot, stop_time=20.0)
    assert passage["cross_track_error"][0] == 0.0
    assert (passage.data == sail_bare(Voyage("there", "", there), stop_time=20.0).data).all()


def test_what_cannot_be_is_refused(fmu: Path, autopilot: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="voyage = 'nix': must be one of calm, half_mass, double_mass, crosswind, ice"):
        sail("nix", fmu, autopilot)
    with pytest.raises(ValueError, match="scheme = 'nix': must be one of jacobi, gauss_seidel"):
        sail("calm", fmu, autopilot, scheme="nix")
    for step in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(
            ValueError, match=f"communication_step = {step!r} s: must be a finite number greater than 0"
        ):
            sail("calm", fmu, autopilot, communication_step=step)
    for end in (0.0, math.nan):
        with pytest.raises(ValueError, match=f"stop_time = {end!r} s: must be a finite number greater than 0"):
            sail("calm", fmu, autopilot, stop_time=end)
    with pytest.raises(
        ValueError, match=r"Autopilot\.fmu: is an FMU of the model 'Autopilot': must be of 'Hovercraft'"
    ):
        sail("calm", autopilot, fmu)
    with pytest.raises(ValueError, match=r"step_size = 0\.1: must be one of mass, inertia"):
        sail_bare(Voyage("bad", "", {"step_size": 0.1}))
    with pytest.raises(
        FileNotFoundError, match=r"nix\.fmu: no such FMU; 'hovercraft-fmu build' writes them into build/"
    ):
        sail("calm", fmu, tmp_path / "nix.fmu")
    with pytest.raises(SimulationError, match=r"mass = -1.0: must be greater than 0"):
        sail(Voyage("bad", "", {"mass": -1.0}), fmu, autopilot)
    with pytest.raises(ValueError, match=r"column = 'nix': must be one of time, pose.x"):
        sail_bare("calm", stop_time=1.0)["nix"]


# ---- what the communication step costs


def test_both_schemes_are_of_first_order() -> None:
    """Against the loop without a communication step, which another solver knows to 1e-9 m."""
    exact, uncertainty = study.continuous()
    assert uncertainty < 1e-9
    steps = (0.1, 0.2, 0.5)
    errors = {
        scheme: [float(np.hypot(*(study.sampled(scheme, step) - exact).T).max()) for step in steps]
        for scheme in SCHEMES
    }
    for scheme in SCHEMES:
        assert np.polyfit(np.log(steps), np.log(errors[scheme]), 1)[0] == pytest.approx(1.0, abs=0.05)
    assert all(late > 1.5 * soon for late, soon in zip(errors[JACOBI], errors[GAUSS_SEIDEL], strict=True))


@pytest.mark.once
@pytest.mark.usefixtures("complete_native_fmu")
@FMI_2
def test_the_command_writes_what_is_committed(tmp_path: Path) -> None:
    """The rows that the quick one has."""
    done = CliRunner().invoke(commands, ["measure", "coupling", "--quick", "--output", str(tmp_path)])
    assert done.exit_code == 0, done.output
    assert "order in the communication step: jacobi 1.0" in done.output
    for name, keys in (("coupling", 2), ("coupling_course", 5), ("coupling_limit", 4), ("coupling_voyages", 9)):
        ours, committed = (
            list(csv.reader((folder / f"{name}.csv").read_text(encoding="utf-8").splitlines()))
            for folder in (tmp_path, RESULTS)
        )
        known = {tuple(row[:keys]): row[keys:] for row in committed}
        assert ours[0] == committed[0]
        assert len(ours) > 4
        for row in ours[1:]:
            if "never" not in row:  # a craft that has lost its way may be anywhere
                before = known[tuple(row[:keys])]
                assert list(map(float, row[keys:])) == pytest.approx(list(map(float, before)), rel=0.02), row
    limit = list(csv.DictReader((tmp_path / "coupling_limit.csv").read_text(encoding="utf-8").splitlines()))
    for each in limit:
        assert float(each["measured"]) == pytest.approx(float(each["theory"]), rel=0.05)
    assert (tmp_path / "coupling_limit.png").stat().st_size > 10000
    assert (tmp_path / "coupling.png").stat().st_size > 10000


# ---- other masters


class FirstZeros:
    """A part that shows zeros before its first step, whatever it really shows: what fmpy.ssp makes of a part."""

    def __init__(self, part: Part) -> None:
        self.part, self.first = part, True
        self.write, self.step = part.write, part.step

    def read(self) -> Sequence[float]:
        values, self.first = [0.0] * len(self.part.read()) if self.first else self.part.read(), False
        return values


def rows_of(shown: Sequence[Sequence[float]]) -> list[list[float]]:
    """STATES and COMMANDS after every step."""
    return [[float(value) for value in row[: len(STATES) + len(COMMANDS)]] for row in shown[1:]]


@functools.cache
def expected(fmu: Path, autopilot: Path, scheme: str) -> list[list[float]]:
    """What our own master gives."""
    passage = sail(VOYAGE, fmu, autopilot, scheme=scheme, stop_time=STEPS * STEP)
    assert passage["waypoint"][-1] == 2.0
    return [[float(row[name]) for name in (*STATES, *COMMANDS)] for row in passage.data[1:]]


def scheme_of(name: str) -> str:
    return GAUSS_SEIDEL if name.endswith("sequential") else JACOBI


WAYS = [
    *(("python", name) for name in ("libcosimpy, functions", "ecospy, SSP")),
    *(("native", name) for name in LOOPS),
    *(("native3", name) for name in ("ecospy, SSP", "fmucontainer, JSON", "fmpy.container_fmu")),
]
"""The native FMU with all that the libraries can, the others with some. libcosimpy 0.0.6 dies of an FMU
of FMI 3.0 without a word; fmpy.ssp loads every FMU as one of FMI 2.0."""


@pytest.mark.once
@pytest.mark.parametrize(("flavour", "name"), WAYS, indirect=["flavour"], scope="session")
def test_every_master_gives_the_bits_of_ours(name: str, each_fmu: Path, autopilot: Path, tmp_path: Path) -> None:
    if missing := HOSTS[name.split(",")[0].split(".")[0]].missing():
        pytest.skip(f"{name}: {missing}")
    rows = loop_in(name, each_fmu, autopilot, tmp_path)
    assert len(rows) == STEPS
    if name != "fmpy.ssp":
        assert rows == expected(each_fmu, autopilot, scheme_of(name))
        return
    # fmpy.ssp sets every input to zero in its first step: then it is Jacobi
    craft = BareCraft(VOYAGE, Settings())
    pilot = BareAutopilot(craft.state, Orders())
    shown = [row for _, row in master(FirstZeros(craft), FirstZeros(pilot), JACOBI, STEP, STEPS)]
    assert np.array(rows) == pytest.approx(np.array(rows_of(shown)), rel=1e-9, abs=1e-9)
    assert rows[0] != expected(each_fmu, autopilot, JACOBI)[0]


# ---- SSP


def test_the_ssp_is_valid_whole_and_the_same_every_time(each_fmu: Path, autopilot: Path, tmp_path: Path) -> None:
    path = build_ssp(tmp_path / "Loop.ssp", each_fmu, autopilot)
    again = build_ssp(tmp_path / "again" / "Loop.ssp", each_fmu, autopilot)
    assert hashlib.sha256(path.read_bytes()).digest() == hashlib.sha256(again.read_bytes()).digest()
    with zipfile.ZipFile(path) as archive:
        fmus = [f"resources/{each_fmu.name}", "resources/Autopilot.fmu"]
        sets = [f"resources/{name}.ssv" for name in ("hovercraft", "autopilot", "ice")]
        assert sorted(archive.namelist()) == sorted(["SystemStructure.ssd", "documentation/loop.html", *sets, *fmus])
        assert archive.read(fmus[0]) == each_fmu.read_bytes()
        structure = etree.fromstring(archive.read("SystemStructure.ssd"))
        craft, pilot, ice = (etree.fromstring(archive.read(name)) for name in sets)
    etree.XMLSchema(file=str(SCHEMAS / "SystemStructureDescription.xsd")).assertValid(structure)
    assert_units_are_told(structure)
    for values in (craft, pilot, ice):
        etree.XMLSchema(file=str(SCHEMAS / "SystemStructureParameterValues.xsd")).assertValid(values)
    assert_parameters_have_connectors(structure, {"hovercraft": craft, "autopilot": pilot})
    assert given(ice) == {**given(craft), "air_density": PRESETS["ice"].air_density}
    assert structure.get("version") == "1.0"
    kinds = structure.xpath("//*[local-name() = 'Annotation']/@type")
    assert sorted(kinds) == ["com.opensimulationplatform", "org.openmodelica"]
    assert structure.xpath("//@baseStepSize | //@stepSize") == ["0.5", "0.5"]
    assert len(structure.xpath("//*[local-name() = 'Connection']")) == len(STATES) + len(COMMANDS)
    assert given(craft)["wind.y"] == 0.2
    told = {name: given(craft)[name] for name in ("mass", "inertia", "length", "steering_force")}
    assert told.items() <= given(pilot).items()
    with pytest.raises(ValueError, match=r"must end in \.ssp"):
        build_ssp(tmp_path / "Loop.zip", each_fmu, autopilot)


def given(values: Any) -> dict[str, float]:
    """What a parameter set gives, by name."""
    return {node.get("name"): float(node[0].get("value")) for node in values.iter("{*}Parameter")}


def assert_parameters_have_connectors(structure: Any, sets: dict[str, Any]) -> None:
    """Each component takes its own set, which names connectors of it alone."""
    for component in structure.iter("{*}Component"):
        name = component.get("name")
        assert [node.get("source") for node in component.iter("{*}ParameterBinding")] == [f"resources/{name}.ssv"]
        connectors = {node.get("name") for node in component.iter("{*}Connector") if node.get("kind") != "output"}
        assert given(sets[name]).keys() - {*WIND} <= connectors  # fmpy.ssp would hold the wind at 0


# ---- the commands


def assert_units_are_told(structure: Any) -> None:
    """SSP 1.0, connectors and units: a connector has the unit of its variable, and each unit is defined."""
    defined = {node.get("name") for node in structure.iter("{*}Unit")}
    for component in structure.iter("{*}Component"):
        variables = (AUTOPILOT_MODEL if component.get("name") == "autopilot" else HOVERCRAFT).by_name
        for connector in component.iter("{*}Connector"):
            (kind,) = connector
            assert kind.get("unit") == variables[connector.get("name")].unit
            assert kind.get("unit") in {None, *defined}


@pytest.mark.once
@pytest.mark.usefixtures("complete_native_fmu")
@FMI_2
def test_the_demo_of_the_loop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    done = CliRunner().invoke(commands, ["demo", "--loop"])
    assert done.exit_code == 0, done.output
    assert "waypoints reached  6 of 6" in done.output
    with Image.open("build/demo/loop.png") as picture:
        assert picture.size == (1440, 810)
    assert Path("build/demo/loop.html").stat().st_size < 200_000
    assert Path("build/demo/loop.csv").read_text().startswith('"time","pose.x"')
