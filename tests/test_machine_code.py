"""Machine code: compiled once, carried by the wheel, never run where the C has changed since."""

import runpy
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner

from hovercraft_fmu import cli, libraries
from hovercraft_fmu.building import PRODUCTS, build
from hovercraft_fmu.fmu import machine_code
from hovercraft_fmu.fmu.description import NATIVE, NATIVE3, Flavour
from hovercraft_fmu.fmu.machine_code import PLATFORMS, Library, NotCompiledError, c_file, compile_all, library
from hovercraft_fmu.libraries import compile_libraries
from tests.binaries import dylib


@pytest.fixture
def nothing_compiled(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder in the place of compiled/."""
    folder = tmp_path / "compiled"
    monkeypatch.setattr(machine_code, "COMPILED", folder)
    return folder


@pytest.fixture
def one_platform(monkeypatch: pytest.MonkeyPatch) -> None:
    """And one library, instead of all, which take long."""
    monkeypatch.setattr(machine_code, "PLATFORMS", {"x86_64-linux": PLATFORMS["x86_64-linux"]})
    monkeypatch.setattr(libraries, "libraries", lambda: [library(NATIVE)])


def files_of(folder: Path) -> set[str]:
    return {path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.usefixtures("one_platform", "nothing_compiled")
def test_changed_c_is_never_run_as_old_machine_code(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    changed = tmp_path / "native"
    shutil.copytree(machine_code.C_FOLDER, changed)
    monkeypatch.setattr(machine_code, "C_FOLDER", changed)
    if reason := compile_libraries():
        pytest.skip(reason)
    old = library(NATIVE).path("x86_64-linux")
    assert old.exists()
    with (changed / "hovercraft" / "kernel.c").open("a") as file:
        file.write("/* changed */\n")
    with pytest.raises(NotCompiledError, match=r"the C was changed since.*pip install -e"):
        library(NATIVE).path("x86_64-linux")
    assert compile_libraries() == ""
    last = library(NATIVE).path("x86_64-linux")
    assert last.exists()
    assert not old.exists()
    (changed / "hovercraft" / "kernel.c").write_text("#error on purpose\n")
    assert "on purpose" in compile_libraries()
    with pytest.raises(NotCompiledError, match=r"compiling .* for x86_64-linux-gnu\.2\.17 failed: .*on purpose"):
        library(NATIVE).path("x86_64-linux")
    assert last.exists()  # the last good state: taking the change back is enough


TINY = """
#ifdef _WIN32
#include <windows.h>
BOOL WINAPI DllMain(HINSTANCE instance, DWORD why, LPVOID unused) { return instance && !why && !unused; }
#endif
static int count;
__attribute__((visibility("default"))) int tiny(int more) { return count += more; }
"""


@pytest.mark.usefixtures("nothing_compiled")
def test_each_system_gets_what_it_asks_of_a_library() -> None:
    """Windows its headers, though there is no C library; macOS the library's own name."""
    platforms = ("x86_64-windows", "aarch64-darwin")
    tiny = Library("Tiny", ("tiny.c",), {"tiny.c": TINY.encode()}, platforms)
    if (reason := compile_all([tiny])).startswith("the compiler"):
        pytest.skip(reason)
    assert reason == tiny.missing == ""
    assert tiny.path("x86_64-windows").read_bytes()[:2] == b"MZ"
    assert dylib(tiny.path("aarch64-darwin").read_bytes()).name == "@rpath/Tiny.dylib"


def test_a_file_of_c_that_is_not_there() -> None:
    with pytest.raises(FileNotFoundError, match=r"native: no nix\.c in it"):
        c_file("nix.c")


def test_both_flavours_share_a_unit_that_is_compiled_once() -> None:
    """The compiler's cache goes by the content of all that it reads."""
    units = {name: library(flavour).files for name, flavour in (("2", NATIVE), ("3", NATIVE3))}
    shared = {
        name: {path: f for path, f in files.items() if path.startswith("shared_hovercraft/")}
        for name, files in units.items()
    }
    assert library(NATIVE).sources[0] == library(NATIVE3).sources[0] == "shared_hovercraft/shared.c"
    assert {f"shared_hovercraft/{name}" for name in ("shared.c", "kernel.c", "variables.h")} <= shared["2"].keys()
    assert shared["2"] == shared["3"]


@pytest.mark.parametrize(("reason", "status"), [("", 0), ("it failed", "it failed")])
def test_the_command_ends_well_where_it_compiled(
    monkeypatch: pytest.MonkeyPatch, reason: str, status: int | str
) -> None:
    monkeypatch.setattr(machine_code, "compile_all", lambda *_: reason)
    monkeypatch.delitem(sys.modules, "hovercraft_fmu.libraries")  # it is run anew
    with pytest.raises(SystemExit) as ended:
        runpy.run_module("hovercraft_fmu.libraries", run_name="__main__")
    assert ended.value.code == status


@pytest.mark.parametrize(
    ("variable", "compiler", "says"),
    [
        (
            *("1", machine_code.COMPILER),
            "HOVERCRAFT_FMU_NO_COMPILER was set when the package was installed; install it again without that variable",
        ),
        ("", ("ziglang", "0.0.1"), "must be 0.0.1, which makes the bytes; compile it: pip install -e ."),
        ("", ("zigzag", "1.0"), "the compiler, zigzag 1.0, was not installed; compile it: pip install -e ."),
    ],
)
def test_a_compiler_that_is_left_out_or_another(
    variable: str,
    compiler: tuple[str, str],
    says: str,
    nothing_compiled: Path,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    """The Python FMU is written all the same, and what is missing is said in one line."""
    monkeypatch.setenv(machine_code.LEAVE_OUT, variable)
    monkeypatch.setattr(machine_code, "COMPILER", compiler)
    stale = nothing_compiled / "HovercraftNative-0" / "x86_64-linux" / "HovercraftNative.so"
    stale.parent.mkdir(parents=True)
    stale.write_bytes(b"of other C")
    assert says.partition(";")[0] in compile_libraries()
    done = CliRunner().invoke(cli.commands, ["build", "native", "python", "--output", str(tmp_path / "out")])
    assert done.exit_code == 1
    assert [path.name for path in (tmp_path / "out").iterdir()] == ["Hovercraft.fmu"]
    last = done.output.splitlines()[-1]
    assert last.startswith("Error: not written: HovercraftNative.fmu; no machine code: ")
    assert says in last
    assert "pip install" in last
    assert last.endswith("; the Python FMU needs none: --fmu python, or build python")
    assert files_of(nothing_compiled) == {"why_not.txt", stale.relative_to(nothing_compiled).as_posix()}


@pytest.mark.once
def test_the_command_writes_everything(tmp_path: Path, complete: Callable[[Flavour], Path], fmu: Path) -> None:
    done = CliRunner().invoke(cli.commands, ["build", "--output", str(tmp_path)])
    assert done.exit_code == 0, done.output
    assert {path.name for path in tmp_path.iterdir()} == {each.name for each in PRODUCTS.values()}
    for line, each in zip(done.output.splitlines(), PRODUCTS.values(), strict=True):
        assert line.startswith(f"{tmp_path / each.name}: ")
        assert line.endswith(each.purpose)
    assert (tmp_path / PRODUCTS["native"].name).read_bytes() == complete(NATIVE).read_bytes()
    assert (tmp_path / PRODUCTS["native3"].name).read_bytes() == complete(NATIVE3).read_bytes()
    assert (tmp_path / fmu.name).read_bytes() == fmu.read_bytes()


def test_what_cannot_be_built(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="kind = 'natvie': must be one of native, native3"):
        build("natvie")  # type: ignore[arg-type]
    done = CliRunner().invoke(cli.commands, ["build", "python", "x", "--output", str(tmp_path / "new")])
    assert str(done.exception).startswith("kind = 'x': must be one of native, ")
    assert not list(tmp_path.iterdir())
    file = tmp_path / "file"
    file.write_text("")
    refused = CliRunner().invoke(cli.commands, ["build", "python", "--output", str(file)])
    assert refused.exit_code != 0
    assert "is a file" in refused.output


def test_all_targets_are_checked_before_one_is_written(tmp_path: Path) -> None:
    folder = tmp_path / "Autopilot.fmu"
    folder.mkdir()
    done = CliRunner().invoke(cli.commands, ["build", "python", "autopilot", "--output", str(tmp_path)])
    assert isinstance(done.exception, OSError)
    assert (done.exception.filename, done.exception.strerror) == (str(folder), "must be a file, and is a folder")
    assert list(tmp_path.iterdir()) == [folder]
    (tmp_path / "file").write_text("")
    done = CliRunner().invoke(cli.commands, ["build", "python", "--output", str(tmp_path / "file" / "sub")])
    assert isinstance(done.exception, OSError)
    assert done.exception.filename == str(tmp_path / "file" / "sub" / "Hovercraft.fmu")
    assert done.exception.strerror == f"must be in a folder, and {tmp_path / 'file'} is a file"


def test_a_kind_that_is_named_twice_is_written_once(tmp_path: Path) -> None:
    done = CliRunner().invoke(cli.commands, ["build", "python", "python", "--output", str(tmp_path)])
    assert done.exit_code == 0, done.output
    assert len(done.output.splitlines()) == 1


def test_each_purpose_stands_by_itself() -> None:
    for each in PRODUCTS.values():
        assert "same" not in each.purpose
        if each.name.endswith("Tow.ssp"):
            craft = each.name.removesuffix("Tow.ssp")
            assert f" of {craft}.fmu, twice, and {craft.replace('Hovercraft', 'Tether')}.fmu" in each.purpose
        elif each.name.endswith(".ssp"):
            craft = each.name.removesuffix("Loop.ssp")
            assert f" of {craft}.fmu and {craft.replace('Hovercraft', 'Autopilot')}.fmu" in each.purpose
