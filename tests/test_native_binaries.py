"""The native FMU as a file: what is inside, what its libraries need, and that two builds give the same bytes."""

import hashlib
import io
import re
import subprocess
import time
import zipfile
from pathlib import Path

import fmpy
import pytest
from click.testing import CliRunner
from lxml import etree

from hovercraft_fmu import cli
from hovercraft_fmu.fmu import native_package
from hovercraft_fmu.fmu.description import NATIVE
from hovercraft_fmu.fmu.interface import BY_NAME
from tests.binaries import CPU_ARM64, CPU_X86_64, dll, dylib, elf, is_ad_hoc_signed, slices
from tests.conftest import Fresh
from tests.native import c_compiler

pytestmark = pytest.mark.once

NAME = NATIVE.identifier
SCHEMAS = Path(fmpy.__file__).parent / "schema" / "fmi3"
FUNCTIONS = set(
    re.findall(
        r"FMI2_Export fmi2\w+TYPE +(fmi2\w+);",
        (Path(fmpy.__file__).parent / "c-code" / "fmi2Functions.h").read_text(encoding="utf-8"),
    )
)
"""All that the standard's header has."""
OF_THE_LINKER = {"___dso_handle", "__mh_dylib_header"}
OF_LIBC = {"calloc", "free", "memcpy", "memset", "memcmp", "strlen", "strcmp"}


@pytest.fixture(scope="module")
def archive(native_fmu: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(native_fmu) as opened:
        return {name: opened.read(name) for name in opened.namelist()}


def test_what_is_inside(archive: dict[str, bytes]) -> None:
    assert {name for name in archive if name.startswith("binaries/")} == {
        f"binaries/linux64/{NAME}.so",
        f"binaries/win64/{NAME}.dll",
        f"binaries/darwin64/{NAME}.dylib",
        f"binaries/aarch64-linux/{NAME}.so",
        f"binaries/aarch64-darwin/{NAME}.dylib",
    }
    assert not [name for name in archive if name.endswith(".py") or name.startswith("resources/")]
    assert "documentation/externalDependencies.txt" not in archive
    assert archive["documentation/licenses/fdlibm.txt"].startswith(b"====")
    assert b"Sun Microsystems" in archive["documentation/licenses/fdlibm.txt"]
    page = archive["documentation/index.html"].decode()
    assert all(f"<code>{name}</code>" in page for name in BY_NAME)
    assert "LD_PRELOAD" not in page


def test_it_is_small(archive: dict[str, bytes]) -> None:
    small = {name: content for name, content in archive.items() if not name.startswith("documentation/")}
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, content in small.items():
            packed.writestr(name, content)
    assert len(buffer.getvalue()) < 350_000


@pytest.mark.parametrize(
    ("file", "schema"),
    [
        ("sources/buildDescription.xml", "fmi3BuildDescription.xsd"),
        ("terminalsAndIcons/terminalsAndIcons.xml", "fmi3TerminalsAndIcons.xsd"),
    ],
)
def test_what_fmi_3_lends(file: str, schema: str, archive: dict[str, bytes]) -> None:
    tree = etree.fromstring(archive[file])
    etree.XMLSchema(file=str(SCHEMAS / schema)).assertValid(tree)
    for member in tree.iter("TerminalMemberVariable"):
        assert member.get("variableName") in BY_NAME
    for source in tree.iter("SourceFile"):
        assert f"sources/{source.get('name')}" in archive
    assert archive["terminalsAndIcons/icon.png"].startswith(b"\x89PNG")


def test_the_description_names_all_sources(archive: dict[str, bytes]) -> None:
    listed = {node.get("name") for node in etree.fromstring(archive["modelDescription.xml"]).iter("File")}
    assert listed == {name.removeprefix("sources/") for name in archive if name.endswith(".c")}


@pytest.mark.parametrize(("folder", "machine"), [("linux64", 62), ("aarch64-linux", 183)])
def test_libraries_of_linux(folder: str, machine: int, archive: dict[str, bytes]) -> None:
    """glibc of 2012 is enough; no Python, no libm."""
    library = elf(archive[f"binaries/{folder}/{NAME}.so"])
    assert library.machine == machine
    assert library.exports == FUNCTIONS
    assert library.undefined <= OF_LIBC
    assert library.needed <= {"libc.so.6", "ld-linux-x86-64.so.2", "ld-linux-aarch64.so.1"}
    assert (0, 0) < library.glibc <= (2, 17)


def test_the_library_of_windows(archive: dict[str, bytes]) -> None:
    library = dll(archive[f"binaries/win64/{NAME}.dll"])
    assert library.machine == 0x8664
    assert library.exports == FUNCTIONS
    assert library.needed == {"KERNEL32.dll"}


def test_the_libraries_of_macos(archive: dict[str, bytes]) -> None:
    parts = slices(archive[f"binaries/darwin64/{NAME}.dylib"])
    assert [dylib(part).cpu for part in parts] == [CPU_X86_64, CPU_ARM64]
    assert parts[1] == archive[f"binaries/aarch64-darwin/{NAME}.dylib"]
    for part in parts:
        library = dylib(part)
        assert library.exports - OF_THE_LINKER == {f"_{name}" for name in FUNCTIONS}
        assert library.undefined <= {*(f"_{name}" for name in OF_LIBC), "_bzero", "___bzero", "dyld_stub_binder"}
        assert library.needed == {"/usr/lib/libSystem.B.dylib"}
        assert library.name == f"@rpath/{NAME}.dylib"
        assert library.minimum == (11, 0)
        # an arm64 Mac loads nothing that is not signed
        assert library.cpu != CPU_ARM64 or is_ad_hoc_signed(library.signature, part)


def test_plain_cc_compiles_the_sources_without_a_warning(archive: dict[str, bytes], tmp_path: Path) -> None:
    for name, content in archive.items():
        if name.startswith("sources/"):
            (tmp_path / Path(name).name).write_bytes(content)
    command = [c_compiler(), "-std=c11", "-Wall", "-Wextra", "-Werror", "-fPIC", "-shared", "-o", "x.so"]
    for options in ([], ["-O2"], ["-O3", "-Wpedantic"]):
        done = subprocess.run(
            [*command, *options, *NATIVE.sources, "-lm"], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert (done.returncode, done.stderr) == (0, "")


@pytest.mark.parametrize(
    ("options", "prefix"),
    [
        ([], ""),
        ([f"-DFMI2_FUNCTION_PREFIX={NAME}_"], f"{NAME}_"),
        ([f"-DFMI2_FUNCTION_PREFIX={NAME}_", "-DFMI2_OVERRIDE_FUNCTION_PREFIX"], ""),
    ],
)
def test_a_host_that_links_the_sources_chooses_the_prefix_of_the_functions(
    options: list[str], prefix: str, archive: dict[str, bytes], tmp_path: Path
) -> None:
    """As the standard has it for FMUs in C."""
    for name, content in archive.items():
        if name.startswith("sources/"):
            (tmp_path / Path(name).name).write_bytes(content)
    command = [c_compiler(), "-std=c11", "-Wall", "-Wextra", "-Werror", *options, "-c", "fmi2.c"]
    subprocess.run(command, cwd=tmp_path, check=True)
    printed = subprocess.run(["nm", "fmi2.o"], cwd=tmp_path, capture_output=True, text=True, check=True).stdout
    assert set(re.findall(r" T (\w+)", printed)) == {f"{prefix}{name}" for name in FUNCTIONS}


def test_nothing_is_shared_between_instances_or_with_other_libraries(archive: dict[str, bytes], tmp_path: Path) -> None:
    """No symbol of any object file lies in memory that can be written; each that a linker sees has a prefix.

    Compiled without -fvisibility=hidden an `advance` of ours was once replaced by glibc's.
    """
    for name, content in archive.items():
        if name.startswith("sources/"):
            (tmp_path / Path(name).name).write_bytes(content)
    subprocess.run([c_compiler(), "-std=c11", "-O2", "-fno-pic", "-c", *NATIVE.sources], cwd=tmp_path, check=True)
    objects = sorted(tmp_path.glob("*.o"))
    assert len(objects) == len(NATIVE.sources)
    printed = subprocess.run(["nm", *map(str, objects)], capture_output=True, text=True, check=True).stdout
    assert " T fmi2DoStep" in printed
    assert re.findall(r"^[0-9a-f]+ [bBdDcC] .*$", printed, re.MULTILINE) == []
    assert re.findall(r" T (?!fmi2|kernel_|instance_|logarithm_|memory_|text_|trig_)\w+", printed) == []


def test_the_same_bytes_elsewhere_and_soon(native_fmu: Path, fresh: Fresh, tmp_path: Path) -> None:
    """In another folder, with empty caches; cold, all five platforms take less than three minutes."""
    code = "import os; os.umask(0o077); import hovercraft_fmu.fmu.native_package as p; print(p.build_native_fmu())"
    caches = {"ZIG_GLOBAL_CACHE_DIR": str(tmp_path / "global"), "ZIG_LOCAL_CACHE_DIR": str(tmp_path / "local")}
    begun = time.monotonic()
    printed = fresh(code, env={**caches, "TZ": "Pacific/Auckland"})
    assert time.monotonic() - begun < 180.0
    built = tmp_path / "build" / f"{NAME}.fmu"
    assert printed.strip() == f"build/{NAME}.fmu"
    digests = [hashlib.sha256(path.read_bytes()).hexdigest() for path in (built, native_fmu)]
    assert digests[0] == digests[1]
    assert list(built.parent.iterdir()) == [built]


def test_without_the_compiler_one_line_says_what_to_do(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(native_package, "has_compiler", lambda: False)
    with pytest.raises(ModuleNotFoundError, match=re.escape("pip install 'hovercraft-fmu[native]'")):
        native_package.build_native_fmu(tmp_path / "X.fmu")


def test_the_command_builds_both_or_says_why_not(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.chdir(tmp_path)
    python, native = Path("build/Hovercraft.fmu"), Path(f"build/{NAME}.fmu")
    done = CliRunner().invoke(cli.commands, ["build", "--native"])
    assert (done.exit_code, python.exists(), native.exists()) == (0, False, True)
    assert done.stdout.startswith(f"{native}: ")
    native.unlink()
    monkeypatch.setattr(cli, "has_compiler", lambda: False)
    done = CliRunner().invoke(cli.commands, ["build"])
    assert (done.exit_code, python.exists(), native.exists()) == (0, True, False)
    assert "no native FMU: its compiler is not installed: pip install 'hovercraft-fmu[native]'" in done.stdout


def test_a_compiler_that_fails_is_heard(tmp_path: Path) -> None:
    (tmp_path / "fmi2.c").write_text("#error on purpose\n")
    with pytest.raises(OSError, match=r"compiling for x86_64-linux-gnu\.2\.17 failed: .*on purpose"):
        native_package.compiled(tmp_path, native_package.PLATFORMS["x86_64-linux"])
