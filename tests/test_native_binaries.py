"""The native FMU as a file: what is inside, what its libraries need, and that two builds give the same bytes."""

import io
import re
import zipfile
from pathlib import Path

import fmpy
import pytest
from lxml import etree

from hovercraft_fmu.fmu.description import NATIVE, NATIVE3, Flavour
from hovercraft_fmu.fmu.interface import BY_NAME
from hovercraft_fmu.fmu.native_package import binary
from tests.binaries import CPU_ARM64, CPU_X86_64, dll, dylib, elf, is_ad_hoc_signed, slices

pytestmark = pytest.mark.once

SCHEMAS = Path(fmpy.__file__).parent / "schema" / "fmi3"


def functions(flavour: Flavour) -> set[str]:
    """All that the standard's header has."""
    header = Path(fmpy.__file__).parent / "c-code" / f"fmi{flavour.fmi}Functions.h"
    text = header.read_text(encoding="utf-8")
    return set(re.findall(rf"FMI{flavour.fmi}_Export fmi\w+TYPE +(fmi\w+);", text))


OF_THE_LINKER = {"___dso_handle", "__mh_dylib_header"}
OF_LIBC = {"calloc", "free", "memcpy", "memset", "memcmp", "strlen", "strcmp"}


@pytest.fixture(scope="module")
def archive(complete_native_fmu: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(complete_native_fmu) as opened:
        return {name: opened.read(name) for name in opened.namelist()}


@pytest.fixture(scope="module")
def flavour(standard: int) -> Flavour:
    """Of the archive."""
    return NATIVE if standard == 2 else NATIVE3


def test_what_is_inside(archive: dict[str, bytes], flavour: Flavour) -> None:
    folders = {
        2: {"linux64": ".so", "win64": ".dll", "darwin64": ".dylib"},
        3: {"x86_64-linux": ".so", "x86_64-windows": ".dll", "x86_64-darwin": ".dylib"},
    }[flavour.fmi] | {"aarch64-linux": ".so", "aarch64-darwin": ".dylib", "aarch64-windows": ".dll"}
    expected = {f"binaries/{folder}/{flavour.identifier}{suffix}" for folder, suffix in folders.items()}
    assert {name for name in archive if name.startswith("binaries/")} == expected
    assert not [name for name in archive if name.endswith(".py") or name.startswith("resources/")]
    assert ("model.png" in archive) == (flavour.fmi == 2)  # FMI 3.0 has the icon with the terminals
    assert "documentation/externalDependencies.txt" not in archive
    assert archive["documentation/licenses/fdlibm.txt"].startswith(b"====")
    assert b"Sun Microsystems" in archive["documentation/licenses/fdlibm.txt"]
    page = archive["documentation/index.html"].decode()
    assert all(f"<code>{name}</code>" in page for name in BY_NAME)
    assert "LD_PRELOAD" not in page
    assert set(re.findall(r"\bfmi([23])[A-Z]", page)) == {str(flavour.fmi)}


def test_it_is_small(archive: dict[str, bytes]) -> None:
    small = {name: content for name, content in archive.items() if not name.startswith("documentation/")}
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as packed:
        for name, content in small.items():
            packed.writestr(name, content)
    assert len(buffer.getvalue()) < 480_000


@pytest.mark.parametrize(
    ("file", "schema"),
    [
        ("sources/buildDescription.xml", "fmi3BuildDescription.xsd"),
        ("terminalsAndIcons/terminalsAndIcons.xml", "fmi3TerminalsAndIcons.xsd"),
    ],
)
def test_what_fmi_3_brings(file: str, schema: str, archive: dict[str, bytes], flavour: Flavour) -> None:
    if flavour.fmi == 2 and file not in archive:
        assert file.startswith("terminalsAndIcons")  # tests/test_letter.py says why
        return
    tree = etree.fromstring(archive[file])
    etree.XMLSchema(file=str(SCHEMAS / schema)).assertValid(tree)
    for source in tree.iter("SourceFile"):
        assert f"sources/{source.get('name')}" in archive


@pytest.mark.parametrize(("platform", "machine"), [("x86_64-linux", 62), ("aarch64-linux", 183)])
def test_libraries_of_linux(platform: str, machine: int, archive: dict[str, bytes], flavour: Flavour) -> None:
    """glibc of 2012 is enough; no Python, no libm."""
    found = elf(archive[f"binaries/{binary(platform, flavour)}"])
    assert found.machine == machine
    assert found.exports == functions(flavour)
    assert found.undefined <= OF_LIBC
    assert found.needed <= {"libc.so.6", "ld-linux-x86-64.so.2", "ld-linux-aarch64.so.1"}
    assert (0, 0) < found.glibc <= (2, 17)


@pytest.mark.parametrize(("platform", "machine"), [("x86_64-windows", 0x8664), ("aarch64-windows", 0xAA64)])
def test_the_libraries_of_windows(platform: str, machine: int, archive: dict[str, bytes], flavour: Flavour) -> None:
    """That of arm64 is checked as a file alone."""
    found = dll(archive[f"binaries/{binary(platform, flavour)}"])
    assert found.machine == machine
    assert found.exports == functions(flavour)
    assert found.needed == {"KERNEL32.dll"}


def test_the_libraries_of_macos(archive: dict[str, bytes], flavour: Flavour) -> None:
    """FMI 2.0 has both in one file."""
    arm = archive[f"binaries/{binary('aarch64-darwin', flavour)}"]
    intel = archive[f"binaries/{binary('x86_64-darwin', flavour)}"]
    parts = slices(intel) if flavour.fmi == 2 else [intel, arm]
    assert [dylib(part).cpu for part in parts] == [CPU_X86_64, CPU_ARM64]
    assert parts[1] == arm
    for part in parts:
        found = dylib(part)
        assert found.exports - OF_THE_LINKER == {f"_{name}" for name in functions(flavour)}
        assert found.undefined <= {*(f"_{name}" for name in OF_LIBC), "_bzero", "___bzero", "dyld_stub_binder"}
        assert found.needed == {"/usr/lib/libSystem.B.dylib"}
        assert found.name == f"@rpath/{flavour.identifier}.dylib"
        assert found.minimum == (11, 0)
        # an arm64 Mac loads nothing that is not signed
        assert found.cpu != CPU_ARM64 or is_ad_hoc_signed(found.signature, part)
