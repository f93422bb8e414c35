"""FMUs with start values of their own: what they run, what they say of themselves, what they refuse."""

import math
import shutil
import struct
import sys
import zipfile
from dataclasses import replace
from pathlib import Path

import fmpy
import numpy as np
import pytest
from click.testing import CliRunner
from fmpy.fmi1 import FMICallException
from hypothesis import given, settings
from hypothesis import strategies as st

from hovercraft_fmu import build, elsewhere
from hovercraft_fmu.cli import commands
from hovercraft_fmu.fmu.block import HEAD, MARK, Block, block, checksum, patched
from hovercraft_fmu.fmu.description import NATIVE, NATIVE3, PYTHON, Flavour
from hovercraft_fmu.fmu.interface import HOVERCRAFT, OUTPUTS
from hovercraft_fmu.fmu.mach_o import signed
from hovercraft_fmu.fmu.machine_code import C_FOLDER, PLATFORMS, block_of, identity, library
from hovercraft_fmu.fmu.native_package import build_native_fmu
from hovercraft_fmu.fmu.python_package import build_fmu
from hovercraft_fmu.fmu.start_values import Value, variant
from hovercraft_fmu.host import Instance, SimulationError, read_description
from hovercraft_fmu.model.craft import PRESETS
from hovercraft_fmu.simulation import simulate
from tests import binaries
from tests.conftest import HERE
from tests.lowlevel import count, everything, get, one, put, reference, start
from tests.masters import loop_in
from tests.native import compile_c

FLAVOURS = {"python": PYTHON, "native": NATIVE, "native3": NATIVE3}
NAME = "HovercraftIce"
OWN: dict[str, Value] = {"integrator": "rk4", "step_size": 0.1}
STARTS = {"air_density": 0.0023769, "step_size": 0.1, "integrator": 3}
"""What the preset `ice` and OWN come to."""
ICE = PRESETS["ice"]
WORDS = "air_density = 0.0023769 kg/m3, step_size = 0.1 s, integrator = rk4"


def built(flavour: Flavour, path: Path) -> Path:
    """For this machine alone."""
    return build_native_fmu(path, flavour, HERE[sys.platform]) if flavour.parts else build_fmu(path, flavour)


@pytest.fixture(scope="module")
def ice(each_fmu: Path, flavour: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The variant of each kind; `each_fmu` is there, so there is machine code."""
    assert each_fmu.exists()
    return built(variant(FLAVOURS[flavour], NAME, OWN, "ice"), tmp_path_factory.mktemp(flavour) / f"{NAME}.fmu")


# ---- what it runs


def test_it_has_the_bits_of_simulate_with_the_same_settings(ice: Path, each_fmu: Path) -> None:
    expected = simulate("turn", each_fmu, preset="ice", start_values=OWN, stop_time=30.0)
    run = expected.run
    found = fmpy.simulate_fmu(
        str(ice),
        stop_time=run.stop_time,
        output_interval=run.communication_step,
        input=run.signals,
        output=list(expected.names[1:]),
        debug_logging=True,
    )
    for name in expected.names:
        assert np.array_equal(found[name], expected[name]), name
    assert abs(found["velocity.yaw_rate"]).max() > 0.01  # it turned


def test_this_package_runs_it_as_it_is(ice: Path, each_fmu: Path) -> None:
    """What is not set is the variant's, in the run, its title and its pictures; what is set comes first."""
    expected = simulate("turn", each_fmu, preset="ice", start_values=OWN, stop_time=20.0)
    found = simulate("turn", ice, stop_time=20.0)
    assert np.array_equal(found.data, expected.data)
    assert (found.run.method, found.run.craft) == (expected.run.method, expected.run.craft) == ("rk4, 0.1 s", ICE)
    others: dict[str, Value] = {"integrator": "semi_implicit_euler", "step_size": 0.01}
    textbook = simulate("turn", ice, preset="textbook", start_values=others, stop_time=20.0)
    usual = simulate("turn", each_fmu, start_values=others, stop_time=20.0)
    assert np.array_equal(textbook.data, usual.data)
    assert textbook.run.craft == usual.run.craft == PRESETS["textbook"]


def test_an_input_that_nothing_is_said_of_holds_its_start_value(tmp_path: Path, each_fmu: Path, flavour: str) -> None:
    windy = built(variant(FLAVOURS[flavour], "Windy", {"wind.y": 0.25}), tmp_path / "Windy.fmu")
    table = np.array([(0.0, 5.0), (5.0, 5.0)], dtype=[("time", float), ("thrust", float)])
    found, expected = simulate(table, windy), simulate(table, each_fmu, start_values={"wind.y": 0.25})
    assert np.array_equal(found.data, expected.data)
    assert found["wind.y"].min() == 0.25


IN_HOSTS = [
    *(("native", host) for host in elsewhere.NATIVE_HOSTS),
    *(("python", host) for host in ("ecospy", "C host")),
    *(("native3", host) for host in ("fmpy", "fmucontainer")),
]
"""All hosts with one of the FMUs, and each of the others with some: what runs in which host is test_hosts.py's."""


@pytest.mark.parametrize(("flavour", "host"), IN_HOSTS, indirect=["flavour"], scope="session")
def test_every_host_runs_its_start_values(host: str, ice: Path, each_fmu: Path) -> None:
    if missing := elsewhere.hosts_of(each_fmu)[host].missing():
        pytest.skip(f"{host}: {missing}")
    with one(each_fmu) as (instance, _):
        put(instance, air_density=0.0023769, step_size=0.1)
        instance.setInteger([reference("integrator")], [3])
        start(instance)
        expected = []
        for k, controls in enumerate(elsewhere.CONTROLS):
            instance.setReal(elsewhere.INPUT_REFERENCES, controls)
            instance.doStep(k * elsewhere.COMMUNICATION_STEP, elsewhere.COMMUNICATION_STEP)
            expected.append(get(instance, *OUTPUTS))
    assert elsewhere.run_in(host, ice) == expected


def test_reset_brings_them_back_and_a_host_may_still_set_others(ice: Path, each_fmu: Path) -> None:
    with one(ice) as (instance, messages), one(each_fmu) as (ordinary, _):
        start(instance)
        first = everything(instance)
        instance.reset()
        assert {name: first[name] for name in STARTS} == STARTS
        put(instance, air_density=1.225, step_size=0.001)
        instance.setInteger([reference("integrator")], [1])
        start(instance)
        start(ordinary)
        for each in (instance, ordinary):
            each.doStep(0.0, 0.5)
        assert everything(instance) == everything(ordinary)
        instance.reset()
        start(instance)
        assert everything(instance) == first
        instance.reset()
        # an Enumeration is set where it has not the start value of this FMU
        instance.setInteger([reference("integrator_number")], [2])
        start(instance)
        instance.doStep(0.0, 0.5)
        assert count(instance) == 5
        instance.reset()
        instance.setInteger([reference("integrator"), reference("integrator_number")], [1, 2])
        with pytest.raises(FMICallException):
            start(instance)
        assert messages == ["integrator = 1 and integrator_number = 2: must be the same where both are set"]


# ---- what it says of itself


def test_its_description_and_pages_are_its_own(ice: Path, each_fmu: Path, flavour: str) -> None:
    ordinary, own = (fmpy.read_model_description(path) for path in (each_fmu, ice))
    assert own.modelName == own.coSimulation.modelIdentifier == NAME
    assert own.guid != ordinary.guid
    assert own.description == f"{ordinary.description}; with start values of its own: {WORDS}"
    before = {v.name: v.start for v in ordinary.modelVariables}
    after = {v.name: v.start for v in own.modelVariables}
    assert {name: start for name, start in after.items() if start != before[name]} == {
        name: repr(value) for name, value in STARTS.items()
    }
    with zipfile.ZipFile(ice) as archive:
        page = archive.read("documentation/index.html").decode()
        files = archive.namelist()
    assert f"This is {NAME}, with start values of its own: {WORDS}." in page
    assert f"is of <code>{FLAVOURS[flavour].identifier}</code>" in page
    assert "<td>0.0023769</td>" in page
    assert all(Path(name).stem == NAME for name in files if name.startswith("binaries/"))
    with zipfile.ZipFile(each_fmu) as archive:
        assert "This is" not in archive.read("documentation/index.html").decode()


def test_two_builds_give_the_same_bytes(ice: Path, flavour: str, tmp_path: Path) -> None:
    again = built(variant(FLAVOURS[flavour], NAME, STARTS), tmp_path / "Again.fmu")
    assert again.read_bytes() == ice.read_bytes()


def test_it_is_valid_and_this_package_knows_it(ice: Path) -> None:
    done = CliRunner().invoke(commands, ["validate", str(ice)])
    assert done.exit_code == 0, done.output
    assert "FAILED" not in done.output
    assert read_description(ice, model=HOVERCRAFT.name).modelName == NAME
    with pytest.raises(ValueError, match=f"is an FMU of the model '{NAME}': must be of 'Autopilot'"):
        read_description(ice, model="Autopilot")


def test_a_state_of_another_variant_is_refused(ice: Path, each_fmu: Path, flavour: str, tmp_path: Path) -> None:
    other = built(variant(FLAVOURS[flavour], "Other", {**STARTS, "mass": 99.0}), tmp_path / "Other.fmu")
    same = built(variant(FLAVOURS[flavour], NAME, STARTS), tmp_path / "Same.fmu")
    with one(ice) as (saved, _):
        start(saved, velocity__x=0.25)
        saved.doStep(0.0, 0.5)
        state = saved.getFMUstate()
        content = saved.serializeFMUstate(state)
        for foreign in (each_fmu, other):
            with one(foreign) as (instance, messages):
                before = everything(instance)
                with pytest.raises(FMICallException):
                    instance.deSerializeFMUstate(content)
                if flavour == "python":  # to C a pointer does not tell whose it is
                    with pytest.raises(FMICallException):
                        instance.setFMUstate(state)
                assert len(messages) == (2 if flavour == "python" else 1)
                assert all("must be a state of this build" in message for message in messages)
                assert everything(instance) == before
        with one(same) as (instance, _):
            instance.setFMUstate(instance.deSerializeFMUstate(content))
            assert everything(instance) == everything(saved)


def test_where_skirt_and_ground_rub_it_offers_no_model_exchange(each_native_fmu: Path, tmp_path: Path) -> None:
    ordinary = fmpy.read_model_description(each_native_fmu)
    flavour = NATIVE if ordinary.fmiVersion == "2.0" else NATIVE3
    fmu = built(variant(flavour, "Rubs", {"skirt_friction": 0.002}), tmp_path / "Rubs.fmu")
    description = fmpy.read_model_description(fmu)
    assert description.modelExchange is None
    with one(fmu) as (instance, _):
        start(instance)
        assert get(instance, "skirt_friction") == [0.002]
    ordinary.modelExchange.modelIdentifier = "Rubs"
    description.modelExchange = ordinary.modelExchange
    folder = fmpy.extract(fmu, unzipdir=str(tmp_path / "extracted"))
    with pytest.raises(SimulationError, match=r"skirt_friction = 0\.002: must be 0 in model exchange"):
        Instance(description, folder, exchange=True)


def test_built_from_its_sources_it_is_the_same(ice: Path, flavour: str, tmp_path: Path) -> None:
    if flavour == "python":
        return
    folder = Path(fmpy.extract(ice, unzipdir=str(tmp_path / "extracted")))
    made = next(folder.glob(f"binaries/*/{NAME}.so"))
    with one(ice) as (instance, _):
        start(instance)
        instance.doStep(0.0, 0.5)
        expected = everything(instance)
    fmi = FLAVOURS[flavour].fmi
    made.unlink()
    compile_c(
        made,
        [folder / "sources" / f"{NAME}.c"],
        *("-O0", "-shared", "-fPIC", "-Wno-error", f"-DFMI{fmi}_OVERRIDE_FUNCTION_PREFIX"),
        *("-I", str(C_FOLDER / f"fmi{fmi}")),
    )
    rebuilt = tmp_path / f"{NAME}.fmu"
    shutil.make_archive(str(tmp_path / "rebuilt"), "zip", folder)
    (tmp_path / "rebuilt.zip").rename(rebuilt)
    with one(rebuilt) as (instance, _):
        start(instance)
        instance.doStep(0.0, 0.5)
        assert everything(instance) == expected


def test_a_loop_with_it_sails_with_its_start_values(native_fmu: Path, autopilot: Path, tmp_path: Path) -> None:
    if missing := elsewhere.HOSTS["libcosimpy"].missing():
        pytest.skip(f"libcosimpy: {missing}")
    coarse = built(variant(NATIVE, "Coarse", OWN), tmp_path / "Coarse.fmu")
    folders = [tmp_path / name for name in ("ssp", "functions", "usual")]
    for folder in folders:
        folder.mkdir()
    found = loop_in("libcosimpy, SSP", coarse, autopilot, folders[0])
    assert found == loop_in("libcosimpy, functions", coarse, autopilot, folders[1])
    assert found != loop_in("libcosimpy, functions", native_fmu, autopilot, folders[2])
    with zipfile.ZipFile(build("python_loop", tmp_path / "X.ssp", name="X", start_values=OWN)) as archive:
        assert {"resources/X.fmu", "resources/Autopilot.fmu"} <= set(archive.namelist())
        structure = archive.read("SystemStructure.ssd")
    assert b'source="resources/X.fmu"' in structure
    assert b' name="XLoop"' in structure


def test_the_purpose_of_a_loop_names_the_fmu_in_it(tmp_path: Path) -> None:
    done = CliRunner().invoke(commands, ["build", "python_loop", "--name", "IceL", "--preset", "ice", "--output",
                                         str(tmp_path)])  # fmt: skip
    assert done.exit_code == 0, done.output
    assert "IceLLoop.ssp: " in done.output
    assert "the closed loop of IceL.fmu and Autopilot.fmu, " in done.output


# ---- the block in a library


def own_block(**starts: float) -> Block:
    """Of a native variant with any start values, possible or not."""
    flavour = NATIVE.variant("Any", starts)
    return block_of(flavour, identity(flavour))


class Patched:
    """Copies of a library, each instantiated once."""

    def __init__(self, fmu: Path, folder: Path) -> None:
        self.description, self.folder, self.count = fmpy.read_model_description(fmu), folder, 0
        self.description.coSimulation.modelIdentifier = "Any"
        with zipfile.ZipFile(fmu) as archive:
            self.library = archive.read("binaries/linux64/HovercraftNative.so")

    def said(self, content: bytes, own: Block) -> str:
        """What an instance of the library says where it refuses to be made; '' where it is made."""
        self.count += 1
        path = self.folder / str(self.count) / "binaries" / "linux64" / "Any.so"
        path.parent.mkdir(parents=True)
        path.write_bytes(content)
        self.description.guid = own.guid
        try:
            with Instance(self.description, str(self.folder / str(self.count)), exchange=False) as made:
                made.start()
                assert made.port("mass", "substeps").get() == [own.starts[reference("mass")], 0]
        except SimulationError as error:
            return str(error)
        return ""


@pytest.fixture(scope="module")
def copies(native_fmu: Path, tmp_path_factory: pytest.TempPathFactory) -> Patched:
    return Patched(native_fmu, tmp_path_factory.mktemp("copies"))


def at(content: bytes) -> int:
    assert content.count(MARK) == 1
    return content.index(MARK)


def resummed(content: bytes, own: Block) -> bytes:
    """The library with a block that was changed, and the checksum that belongs to it."""
    first, last = at(content), at(content) + own.size - 8
    return content[:last] + struct.pack("<Q", checksum(content[first:last])) + content[last + 8 :]


def test_the_block_says_what_the_library_is(copies: Patched) -> None:
    own = own_block(mass=99.0)
    assert copies.said(patched(copies.library, own, "Any.so"), own) == ""


@given(st.data())
@settings(max_examples=100)
def test_a_changed_block_is_refused(copies: Patched, data: st.DataObject) -> None:
    own = own_block(mass=99.0)
    content = bytearray(patched(copies.library, own, "Any.so"))
    first = at(bytes(content))
    for place in data.draw(st.lists(st.integers(first, first + own.size - 1), min_size=1, max_size=3, unique=True)):
        content[place] ^= data.draw(st.integers(1, 255))
    assert copies.said(bytes(content), own) == "start values in the library: must be complete and unchanged"


@pytest.mark.parametrize(
    ("starts", "message"),
    [
        ({"mass": -1.0}, "mass = -1.0: must be greater than 0"),
        ({"mass": math.nan}, "mass = nan: must be a finite number"),
        ({"integrator": 77}, "integrator = 77: must be one of 1 (semi_"),
        ({"integrator": 1e300}, "integrator = 1e+300: must be a whole number"),
        ({"integrator": math.nan}, "integrator = nan: must be a whole number"),
        ({"drag_area_number": 1.5}, "drag_area_number = 1.5: must be a whole number"),
        ({"step_size": 0.0}, "step_size = 0.0 s: must be a finite number greater than 0"),
    ],
)
def test_start_values_that_a_host_could_not_set_are_refused(
    starts: dict[str, float], message: str, copies: Patched
) -> None:
    """Whoever can work out a checksum may write anything; `build` would not."""
    own = own_block(mass=99.0)
    content = bytearray(patched(copies.library, own, "Any.so"))
    for name, value in starts.items():
        struct.pack_into("<d", content, at(bytes(content)) + HEAD.size + 8 * reference(name), value)
    assert copies.said(resummed(bytes(content), own), own).startswith(message)


def test_what_has_no_start_value_takes_none_from_the_block(copies: Patched) -> None:
    own = own_block(mass=99.0)
    content = bytearray(patched(copies.library, own, "Any.so"))
    struct.pack_into("<d", content, at(bytes(content)) + HEAD.size + 8 * reference("substeps"), 7.0)
    assert copies.said(resummed(bytes(content), own), own) == ""


def test_a_block_of_other_code_or_another_length_is_refused(copies: Patched) -> None:
    own = own_block()
    good = patched(copies.library, own, "Any.so")
    foreign = replace(own, code="f" * 32).content()
    place = at(good)
    said = copies.said(good[:place] + foreign + good[place + own.size :], own)
    assert said == f"start values in the library of code {'f' * 32}: must be of its code, {own.code}"
    shorter = bytearray(good)
    struct.pack_into("<Q", shorter, place + 16, own.size - 8)
    assert "must be complete and unchanged" in copies.said(resummed(bytes(shorter), own), own)
    for text in range(place + 24, place + 144, 40):  # the code, the build, the GUID
        unended = bytearray(good)
        unended[text : text + 40] = b"f" * 40
        assert "must be complete and unchanged" in copies.said(resummed(bytes(unended), own), own)


def test_only_a_library_of_this_code_is_written_into(copies: Patched) -> None:
    own, good = own_block(), copies.library
    place = at(good)
    damaged = good[: place + 30] + bytes([good[place + 30] ^ 1]) + good[place + 31 :]
    older = good[:place] + replace(own, code="f" * 32, build="f" * 32).content() + good[place + own.size :]
    for content, message in (
        (b"no library", "Any.so: 0 blocks of start values: must be one"),
        (good + good, "Any.so: 2 blocks of start values: must be one"),
        (damaged, "Any.so: the start values in the library that it is made from must be complete and unchanged"),
        (good[: place + 100], "Any.so: the start values in the library that it is made from must be complete and unch"),
        (older, f"Any.so: the library that it is made from is of code {'f' * 32}: must be of {own.code}"),
    ):
        with pytest.raises(ValueError) as error:  # noqa: PT011 - the message is looked at
            patched(content, own, "Any.so")
        assert str(error.value).startswith(message)


def test_the_ordinary_block_is_what_the_library_was_compiled_with(copies: Patched) -> None:
    """The layout that Python writes is the C compiler's."""
    own = block(HOVERCRAFT, identity(NATIVE), identity(NATIVE))
    assert patched(copies.library, own, "HovercraftNative.so") == copies.library


@pytest.mark.usefixtures("complete_native_fmu")
@pytest.mark.parametrize("platform", PLATFORMS)
@pytest.mark.parametrize("name", ["Ice", "HovercraftIce", "A" * 150])
def test_every_platform(platform: str, name: str, standard: int) -> None:
    """Nothing but the block, and on macOS the name and the signature, is another."""
    flavour = NATIVE if standard == 2 else NATIVE3
    before = library(flavour).path(platform).read_bytes()
    own = block_of(flavour.variant(name, STARTS), "a" * 32)
    file = f"{name}{PLATFORMS[platform].suffix}"
    after = patched(before, own, file)
    place = at(before)
    assert after[place : place + own.size] == own.content()
    if not platform.endswith("darwin"):
        assert after == before[:place] + own.content() + before[place + own.size :]
        return
    old, new = binaries.dylib(before), binaries.dylib(after)
    assert new.name == f"@rpath/{file}"
    assert new._replace(name="", signature=b"") == old._replace(name="", signature=b"")
    assert len(after) == len(before)
    if old.signature:
        assert binaries.is_ad_hoc_signed(new.signature, after)
        assert not binaries.is_ad_hoc_signed(old.signature, after)
    assert bool(old.signature) == (platform == "aarch64-darwin")


@pytest.mark.usefixtures("complete_native_fmu")
def test_a_name_that_a_library_of_macos_has_no_room_for(standard: int) -> None:
    flavour = NATIVE if standard == 2 else NATIVE3
    own = block_of(flavour.variant("A", {}), "a" * 32)
    with pytest.raises(ValueError, match=r"^A+\.dylib: must be a shorter name"):
        patched(library(flavour).path("aarch64-darwin").read_bytes(), own, f"{'A' * 5000}.dylib")


@pytest.mark.usefixtures("complete_native_fmu")
def test_a_signature_of_another_kind_is_not_made_anew(standard: int) -> None:
    """Of the code directory, the byte at its place 37: 2 is SHA-256."""
    content = library(NATIVE if standard == 2 else NATIVE3).path("aarch64-darwin").read_bytes()
    directory = content.index(b"\xfa\xde\x0c\x02")
    other = content[: directory + 37] + b"\x03" + content[directory + 38 :]
    with pytest.raises(ValueError, match="hashes of type 3: must be SHA-256, 2"):
        signed(other)
    foreign = content[:directory] + b"\xfa\xde\x0c\x01" + content[directory + 4 :]
    assert signed(foreign) == foreign  # a signature's other parts stay as they are


# ---- making one


def test_the_command_and_the_function_write_the_same(complete_native_fmu: Path, standard: int, tmp_path: Path) -> None:
    assert complete_native_fmu.exists()
    kind = "native" if standard == 2 else "native3"
    arguments = ["build", *([kind] if standard == 3 else []), "--name", NAME, "--preset", "ice", "--set",
                 "integrator=rk4", "--set", "step_size=0.1", "--output", str(tmp_path / "out")]  # fmt: skip
    done = CliRunner().invoke(commands, arguments)
    assert done.exit_code == 0, done.output
    assert [path.name for path in (tmp_path / "out").iterdir()] == [f"{NAME}.fmu"]
    assert done.output.endswith(f"; {WORDS}\n")
    path = build(kind, tmp_path / "Mine.fmu", name=NAME, preset="ice", start_values=OWN)  # type: ignore[arg-type]
    assert path.read_bytes() == (tmp_path / "out" / f"{NAME}.fmu").read_bytes()


BAD: dict[str, tuple[list[str], str]] = {
    "kind": (["natvie", "--name", "X"], "kind = 'natvie': must be one of native, native3"),
    "autopilot": (["autopilot", "--name", "X"], "kind = 'autopilot': must be one of native, native3, python, native_l"),
    "two kinds": (["native", "python", "--name", "X"], "--name: must be given with one KIND"),
    "no identifier": (["--name", "my ice"], "name = 'my ice': must be a C identifier"),
    "no ASCII": (["--name", "Eis_ö"], "name = 'Eis_ö': must be a C identifier"),
    "a path": (["--name", "../X"], "name = '../X': must be a C identifier"),
    "empty": (["--name", ""], "name = '': must be a C identifier"),
    "a keyword": (["python", "--name", "class"], "name = 'class': must be a C identifier"),
    "an ordinary name": (["--name", "HovercraftNative"], "name = 'HovercraftNative': must be another one"),
    "the autopilot's name": (["--name", "Autopilot"], "name = 'Autopilot': must be another one: Autopilot.fmu has"),
    "its name, small": (["native_loop", "--name", "autopilot"], "name = 'autopilot': must be another one"),
    "a loop's name": (["--name", "HovercraftLoop"], "name = 'HovercraftLoop': must be another one: HovercraftLoop.ssp"),
    "twice": (["--name", "X", "--set", "mass=1", "--set", "mass=2"], "--set mass=2: must be given once, and is mass=1"),
    "no variable's name": (["--name", "X", "--set", "=3"], "--set =3: must be NAME=VALUE"),
    "too large": (["--name", "X", "--set", "mass=1e400"], "mass = 1e400: must be a finite number"),
    "an empty output": (["python", "--output", ""], "Invalid value for '--output': '': must be a path"),
    "an empty preset": (["--name", "X", "--preset", ""], "preset = '': must be one of textbook, ice"),
    "no name": (["--preset", "ice"], "--preset and --set: must be given with --name"),
    "preset": (["--name", "X", "--preset", "snow"], "preset = 'snow': must be one of textbook, ice"),
    "no variable": (["--name", "X", "--set", "masss=1"], "masss = 1: must be a variable that can be set: thrust"),
    "an output": (["--name", "X", "--set", "speed=1"], "speed = 1: must be a variable that can be set: thrust"),
    "no equals": (["--name", "X", "--set", "mass"], "--set mass: must be NAME=VALUE"),
    "no number": (["--name", "X", "--set", "mass=heavy"], "mass = 'heavy': must be a number"),
    "no value": (["--name", "X", "--set", "mass=-1"], "mass = -1.0: must be greater than 0"),
    "not finite": (["--name", "X", "--set", "pose.x=inf"], "pose.x = inf: must be a finite number"),
    "no item": (["--name", "X", "--set", "integrator=magic"], "integrator = 'magic': must be one of semi_implicit"),
    "together": (["--name", "X", "--set", "thrust_min=20"], "thrust_min = 20.0 N: must not be above thrust_max"),
    "derived": (
        ["--name", "X", "--set", "length=1e300", "--set", "height=1e300"],
        "projected_area = inf m2: must be a",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_is_one_line_and_nothing_is_written(case: str, tmp_path: Path) -> None:
    arguments, message = BAD[case]
    done = CliRunner().invoke(commands, ["build", "--output", str(tmp_path / "out"), *arguments])
    assert done.exit_code != 0
    said = done.output.splitlines()[-1].removeprefix("Error: ") if done.output else str(done.exception)
    assert said.startswith(message)
    assert "\n" not in str(done.exception)
    assert not list(tmp_path.iterdir())


def test_an_output_that_is_no_folder(tmp_path: Path) -> None:
    file = tmp_path / "file"
    file.write_text("")
    done = CliRunner().invoke(commands, ["build", "python", "--name", "X", "--output", str(file)])
    assert done.exit_code != 0
    assert "is a file" in done.output


def test_from_python_start_values_need_a_name(tmp_path: Path) -> None:
    for given_values in ({"preset": "ice"}, {"start_values": {"mass": 1.0}}):
        with pytest.raises(ValueError, match="name: must be given"):
            build("python", tmp_path / "X.fmu", **given_values)
    assert not list(tmp_path.iterdir())
