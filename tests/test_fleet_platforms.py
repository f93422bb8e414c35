"""The fleet's bits on every platform, and any bytes at its entry, sanitized."""

import os
import platform
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from filelock import FileLock

from hovercraft_fmu.fmu.machine_code import C_FOLDER, LIBRARY_OPTIONS, OPTIONS, PLATFORMS, c_file, caches, compiler
from tests import fuzz
from tests.native import C_FOLDERS, C_TESTS, c_compiler
from tests.test_native_platforms import ARM_LIBRARIES, WINE

pytestmark = pytest.mark.once
FOLDERS = (*C_FOLDERS, "-I", str(C_FOLDER / "fleet"), "-Wno-psabi")
LINUX = ("-DBARE", "-nostdlib", "-Wl,--entry=start", "-lc")
WINDOWS = ("-nostdlib", "-Wl,--entry=start", "-DHOVERCRAFT_NO_LIBC", "-lkernel32", str(c_file("memory.c")))
VECTORS = [option for option in LIBRARY_OPTIONS if "vectorize" in option]


def hashes(program: Path, command: list[str], *options: str, runner: tuple[str, ...] = (), **env: str) -> list[str]:
    """What the program, compiled so, prints: a line for each term, method, and with and without slopes."""
    whole = [*command, *options, *FOLDERS, str(C_TESTS / "fleet_hash.c"), "-o", str(program)]
    around = {**os.environ, **caches(program.parent / "cache"), **env}
    done = subprocess.run(whole, env=around, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    done = subprocess.run([*runner, program], env=around, capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert len(lines) == 60
    return lines


@pytest.fixture(scope="module")
def here(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """As the library is compiled, with what this processor has."""
    if sys.platform != "linux" or platform.machine() != "x86_64":
        pytest.skip("not x86-64 Linux")
    found = hashes(tmp_path_factory.mktemp("here") / "wide", compiler(PLATFORMS["x86_64-linux"]), *VECTORS, *LINUX)
    assert len({line.split()[1] for line in found}) == len(found)
    return found


def test_the_same_bits_without_avx2(here: list[str], tmp_path: Path) -> None:
    assert (
        hashes(tmp_path / "narrow", compiler(PLATFORMS["x86_64-linux"]), *VECTORS, *LINUX, "-DFLEET_BASELINE") == here
    )


def test_the_same_bits_by_another_compiler(here: list[str], tmp_path: Path) -> None:
    assert hashes(tmp_path / "other", [c_compiler(), *OPTIONS]) == here


def test_the_same_bits_on_arm64(here: list[str], tmp_path: Path) -> None:
    qemu = shutil.which("qemu-aarch64")
    if not qemu or not ARM_LIBRARIES.exists():
        pytest.skip("no qemu-aarch64, or no libraries for it: apt-get install qemu-user libc6-arm64-cross")
    runner = (qemu, "-L", str(ARM_LIBRARIES))
    assert hashes(tmp_path / "arm", compiler(PLATFORMS["aarch64-linux"]), *VECTORS, *LINUX, runner=runner) == here


def test_the_same_bits_on_windows(here: list[str], tmp_path: Path, shared_folder: Path) -> None:
    wine = shutil.which("wine64") or shutil.which(WINE)
    if not wine:
        pytest.skip("no wine64: apt-get install wine64")
    prefix = shared_folder / "wine"  # that of test_native_platforms.py: to make it takes longer than the run
    env = {"WINEPREFIX": str(prefix), "WINEDEBUG": "-all", "DISPLAY": ""}
    command = compiler(PLATFORMS["x86_64-windows"])
    with FileLock(f"{prefix}.lock"):
        assert hashes(tmp_path / "hash.exe", command, *VECTORS, *WINDOWS, runner=(wine,), **env) == here


def test_any_bytes_at_the_entry(tmp_path: Path) -> None:
    """No craft at all, one, missing arrays, no numbers, denormals, huge ones: each craft alone has the same bits. By
    the code for processors without AVX2, which the other tests do not take here."""
    if missing := fuzz.missing():
        pytest.skip(missing)
    program = tmp_path / "fuzz"
    command = ["clang", "-std=c11", "-Wall", "-Wextra", "-ffp-contract=off", "-DFLEET_BASELINE", *fuzz.SHORT, *FOLDERS,
               str(C_TESTS / "fuzz_fleet.c"), "-lm", "-o", str(program)]  # fmt: skip
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (built.returncode, built.stderr) == (0, "")
    run = [str(program), "-runs=5000", "-max_len=600", "-timeout=30", "-seed=1", "-print_final_stats=1"]
    done = subprocess.run(run, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-5000:]
    assert "number_of_executed_units: 5000" in done.stderr
