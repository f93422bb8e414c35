"""The sources in the native FMU: FMI 2.0, 2.1.1 and 2.3; FMI 3.0, 2.4.10 and 2.5.1."""

import math
import re
import shutil
import struct
import subprocess
import sys
import zipfile
from ctypes import CDLL, c_double
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import pytest
from fmpy.build import build_platform_binary
from hypothesis import given
from hypothesis import strategies as st
from lxml import etree

from hovercraft_fmu.fmu import craft_native, machine_code
from hovercraft_fmu.fmu.block import Block
from hovercraft_fmu.fmu.description import NATIVE, NATIVE3, Flavour
from hovercraft_fmu.fmu.interface import BY_NAME, HOVERCRAFT, VARIABLES
from hovercraft_fmu.fmu.machine_code import C_FOLDER
from hovercraft_fmu.fmu.native_package import binary
from hovercraft_fmu.fmu.variable import Variable
from tests.lowlevel import get, one, start
from tests.native import C_FOLDERS, C_INCLUDES, C_TESTS, c_compiler, written_sources
from tests.test_native_binaries import functions

pytestmark = pytest.mark.once

COMPILERS = ("gcc", "clang")
OPTIMIZED = {2: "-O2", 3: "-O3"}
"""By standard: most of both is the same C, and to optimize it takes ten times as long as to compile it. By gcc alone:
some of its warnings come of that; clang's do not, and what it makes without libm are the package's own libraries.
"""


@pytest.fixture(scope="module")
def flavour(standard: int) -> Flavour:
    return NATIVE if standard == 2 else NATIVE3


@pytest.fixture
def folder(each_native_fmu: Path, tmp_path: Path) -> Path:
    """sources/, alone."""
    with zipfile.ZipFile(each_native_fmu) as opened:
        for name in opened.namelist():
            if name.startswith("sources/"):
                (tmp_path / Path(name).name).write_bytes(opened.read(name))
    return tmp_path


def headers(fmi: int) -> tuple[str, str]:
    """The standard's."""
    return "-I", str(C_FOLDER / f"fmi{fmi}")


def run(command: list[str], folder: Path) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


def compiler_named(name: str) -> str:
    found = shutil.which(name)
    if not found:
        pytest.skip(f"no {name}: apt-get install {name}")
    return found


def test_one_file_named_after_the_model_identifier_is_compiled(folder: Path, flavour: Flavour) -> None:
    """2.0, 2.1.1; 3.0, 2.4.10. The standard's headers are not among the files (2.0, 2.3; 3.0, 2.5.1)."""
    listed = [node.get("name") for node in etree.parse(folder / "buildDescription.xml").iter("SourceFile")]
    assert listed == [flavour.unit] * 2
    included = set(re.findall(r'#include "(\w+\.c)"', (folder / flavour.unit).read_text(encoding="utf-8")))
    assert included == {path.name for path in folder.glob("*.c")} - {flavour.unit}
    assert not list(folder.glob("fmi*.h"))


def test_options_come_with_the_compiler_that_takes_them(folder: Path) -> None:
    """3.0, 2.5.1.1: one configuration that any compiler can take; options only where the compiler is named."""
    sets = list(etree.parse(folder / "buildDescription.xml").iter("SourceFileSet"))
    assert [node.get("compiler") for node in sets] == [None, "gcc"]
    assert [node.get("compilerOptions") is not None for node in sets] == [False, True]


@pytest.mark.parametrize(("name", "optimized"), [("gcc", False), ("gcc", True), ("clang", False)])
def test_it_compiles_without_a_warning_or_an_option_and_needs_no_libm(
    name: str, optimized: bool, folder: Path, flavour: Flavour
) -> None:
    """A tool's own build knows neither our options nor -lm; the library must load all the same."""
    level = OPTIMIZED[flavour.fmi] if optimized else "-O0"
    command = [compiler_named(name), level, *headers(flavour.fmi), "-shared", "-fPIC", "-Wl,-z,defs"]
    command += ["-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    command += [f"-DFMI{flavour.fmi}_OVERRIDE_FUNCTION_PREFIX", flavour.unit, "-o", "x.so"]
    run(command, folder)
    assert hasattr(CDLL(str(folder / "x.so")), f"fmi{flavour.fmi}DoStep")


@pytest.mark.parametrize("name", COMPILERS)
@pytest.mark.parametrize("option", ["-Ofast", "-ffast-math", "-ffinite-math-only"])
def test_arithmetic_without_nan_is_refused_at_compile_time(
    option: str, name: str, folder: Path, flavour: Flavour
) -> None:
    command = [compiler_named(name), option, *headers(flavour.fmi), "-c", flavour.unit]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "Compile with IEEE arithmetic" in done.stderr


@pytest.mark.parametrize(
    ("options", "prefix"),
    [
        ((), "{name}_"),
        (("-DFMI{fmi}_FUNCTION_PREFIX=Mine_",), "Mine_"),
        (("-DFMI{fmi}_OVERRIDE_FUNCTION_PREFIX",), ""),
    ],
)
def test_a_linker_sees_the_fmi_functions_alone(
    options: tuple[str, ...], prefix: str, folder: Path, flavour: Flavour
) -> None:
    """2.0, 2.1.1; 3.0, 2.4.10: with a prefix in a program, without one in a library. And no symbol lies in memory that
    can be written: nothing is shared between instances.
    """
    fmi, name = flavour.fmi, flavour.identifier
    run([c_compiler(), "-fno-pic", *(each.format(fmi=fmi) for each in options), *headers(fmi), "-c", flavour.unit,
         "-o", "x.o"], folder)  # fmt: skip
    symbols = run(["nm", "x.o"], folder)
    expected = {prefix.format(name=name) + each for each in functions(flavour)}
    assert set(re.findall(r" [A-TV-Z] (\w+)", symbols)) == expected
    assert re.findall(r" [bBdDcC] (\w+)", symbols) == []


MASSES = (100.0, 200.0)
BUILDS = [(flavour, mass) for flavour in (NATIVE, NATIVE3) for mass in MASSES]


def build_with_mass(folder: Path, flavour: Flavour, mass: float) -> Path:
    """Another build of the FMU: its craft weighs something else at the start."""
    variant = flavour.variant(flavour.identifier, {"mass": mass})
    return written_sources(folder / f"{flavour.identifier}_{mass:.0f}", variant)


def test_two_builds_of_each_fmu_linked_into_one_program_answer_for_themselves(tmp_path: Path) -> None:
    """2.0, 2.1.1; 3.0, 2.4.10."""
    objects: list[str] = []
    calls: list[str] = []
    for i, (flavour, mass) in enumerate(BUILDS):
        place = build_with_mass(tmp_path, flavour, mass)
        command = [c_compiler(), f"-DFMI{flavour.fmi}_FUNCTION_PREFIX=B{i}_", f"-DFMI={flavour.fmi}"]
        command += [f"-DNAME=mass_of_{i}", "-I.", *C_INCLUDES, "-c"]
        for source in (flavour.unit, str(C_TESTS / "mass_of.c")):
            objects.append(str(place / f"{len(objects)}.o"))
            run([*command, source, "-o", objects[-1]], place)
        calls.append(f"mass_of_{i}")
    declared = "".join(f"double {call}(void);" for call in calls)
    printed = "".join(f'printf("%g\\n", {call}());' for call in calls)
    (tmp_path / "main.c").write_text(f"#include <stdio.h>\n{declared}\nint main(void) {{ {printed} return 0; }}\n")
    run([c_compiler(), "main.c", *objects, "-o", "together"], tmp_path)
    assert list(map(float, run(["./together"], tmp_path).split())) == [mass for _, mass in BUILDS]


LOADED = """
import os, sys
from ctypes import *
for path, fmi in zip(sys.argv[2::2], sys.argv[3::2]):
    opened = CDLL(path, mode=os.RTLD_GLOBAL | os.RTLD_NOW)
    token = ("{00000000-0000-0000-0000-" + "0" * 12 + "}").encode()
    n = c_size_t(1)
    make = opened.fmi2Instantiate if fmi == "2" else opened.fmi3InstantiateModelExchange
    make.restype = c_void_p
    instance = make(b"", 1, token, b"", None, 0, 0) if fmi == "2" else make(b"", token, b"", False, False, None, None)
    instance, value = c_void_p(instance), c_double()
    if fmi == "2":
        opened.fmi2EnterInitializationMode(instance)
        opened.fmi2GetReal(instance, byref(c_uint(int(sys.argv[1]))), n, byref(value))
    else:
        opened.fmi3EnterInitializationMode(instance, False, c_double(), c_double(), False, c_double())
        opened.fmi3GetFloat64(instance, byref(c_uint(int(sys.argv[1]))), n, byref(value), n)
    print(value.value)
"""


def test_two_builds_of_each_fmu_loaded_globally_answer_for_themselves(tmp_path: Path) -> None:
    """A host may load with RTLD_GLOBAL, and the sources be compiled without -fvisibility=hidden."""
    arguments = []
    for flavour, mass in BUILDS:
        place = build_with_mass(tmp_path, flavour, mass)
        override = f"-DFMI{flavour.fmi}_OVERRIDE_FUNCTION_PREFIX"
        run([c_compiler(), "-shared", "-fPIC", override, "-I.", flavour.unit, "-o", "x.so"], place)
        arguments += [str(place / "x.so"), str(flavour.fmi)]
    printed = run([sys.executable, "-c", LOADED, str(BY_NAME["mass"].reference), *arguments], tmp_path)
    assert list(map(float, printed.split())) == [mass for _, mass in BUILDS]


def test_fmpy_compiles_it(each_native_fmu: Path, flavour: Flavour, tmp_path: Path) -> None:
    """With CMake, as `fmpy compile` does; what it made answers."""
    if not shutil.which("cmake"):
        pytest.skip("no cmake")
    with zipfile.ZipFile(each_native_fmu) as opened:
        opened.extractall(tmp_path / "fmu")
    library = tmp_path / "fmu" / "binaries" / binary("x86_64-linux", flavour)
    shipped = library.read_bytes()
    build = tmp_path / "build"
    build.mkdir()
    build_platform_binary(tmp_path / "fmu", build, configuration="Debug")  # optimizing is tried above
    assert library.read_bytes() != shipped
    again = tmp_path / "Again.fmu"
    with zipfile.ZipFile(again, "w") as packed:
        for path in (tmp_path / "fmu").rglob("*"):
            packed.write(path, path.relative_to(tmp_path / "fmu"))
    found = []
    for fmu in (each_native_fmu, again):
        with one(fmu) as (instance, _):
            start(instance)
            instance.doStep(0.0, 1.0)
            found.append(get(instance, "pose.x", "velocity.x"))
    assert found[0] == found[1]


# ---- what must agree


def test_a_real_added_to_the_table_alone_does_not_compile(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its partial derivatives would be wrong."""
    extra = Variable(len(VARIABLES), "ballast", "parameter", "fixed", "kg", 1.0, "planted")
    starts = machine_code.block_of(NATIVE, "0" * 32).starts
    monkeypatch.setattr(craft_native, "VARIABLES", (*VARIABLES, extra))
    monkeypatch.setattr(machine_code, "block_of", lambda _, build: Block("0" * 32, build, (*starts, 1.0)))
    written_sources(tmp_path, replace(NATIVE, model=replace(HOVERCRAFT, variables=(*VARIABLES, extra))))
    command = [c_compiler(), "-I.", "-c", NATIVE.unit]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "a parameter is a number of the craft, or of the steps" in done.stderr


@pytest.fixture(scope="module")
def roots(tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    """square_root as the machine has it, and the one in C."""
    folder = tmp_path_factory.mktemp("root")
    made: list[Any] = []
    for option in ("", "-DHOVERCRAFT_ROOT_IN_C"):
        command = [c_compiler(), "-O1", *filter(None, [option]), *C_FOLDERS, str(C_TESTS / "root_of.c")]
        run([*command, "-shared", "-fPIC", "-o", f"root{len(made)}.so"], folder)
        function = CDLL(str(folder / f"root{len(made)}.so")).root_of
        function.restype, function.argtypes = c_double, (c_double,)
        made.append(function)
    return made


@given(st.floats(min_value=5e-324, allow_infinity=False))
def test_the_square_root_is_rounded_correctly(roots: list[Any], x: float) -> None:
    """The machine's and the one in C: no other double is nearer, by exact fractions: y is the nearest where the middles
    between it and its neighbours lie on either side of the root.
    """
    y, again = (root(x) for root in roots)
    assert y == again
    below, above = (Fraction(y) + Fraction(math.nextafter(y, end)) for end in (0.0, math.inf))
    assert below * below < 4 * Fraction(x) < above * above


def test_the_square_root_of_what_is_no_number_or_negative(roots: list[Any]) -> None:
    for root in roots:
        assert all(math.isnan(root(x)) for x in (math.nan, -1.0, -math.inf, -5e-324))
        assert struct.pack("<d", root(-0.0)) == struct.pack("<d", -0.0)
