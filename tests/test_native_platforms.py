"""The same bits on every platform, many instances at once, nothing left behind: through hosts in C."""

import itertools
import os
import shutil
import struct
import subprocess
import sys
import zipfile
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from filelock import FileLock

from hovercraft_fmu.fmu.description import NATIVE, NATIVE3, Flavour
from hovercraft_fmu.fmu.interface import BY_NAME, INPUTS, MOTION, STATES
from hovercraft_fmu.fmu.machine_code import C_FOLDER, OPTIONS, PLATFORMS, caches, compiler
from hovercraft_fmu.fmu.native_header import constant
from hovercraft_fmu.fmu.native_package import binary
from hovercraft_fmu.simulation import Run, held_steps, plan
from tests.lowlevel import one
from tests.native import C_INCLUDES, C_TESTS, SCENES_AND_METHODS, STEPS, c_compiler

pytestmark = pytest.mark.once

SEEN = (*STATES, *MOTION, "force.x", "force.y", "moment", "stability_number")
"""What the host in C reads, in its order."""
ARM_LIBRARIES = Path("/usr/aarch64-linux-gnu")
WINE = "/usr/lib/wine/wine64"


def runs() -> dict[str, Run]:
    """Every scene, every method."""
    return {
        f"{scene}_{method}": plan(scene, start_values={"integrator": method, "step_size": STEPS[method]})
        for scene, method in SCENES_AND_METHODS
    }


def runs_header() -> str:
    """The runs as tables of C."""
    lines = ["struct run { const char *name; unsigned references[20]; double values[20]; unsigned starts; int method;"]
    lines += ["             const double (*rows)[2 + INPUT_COUNT]; unsigned steps; };"]
    table = []
    for name, run in runs().items():
        rows = [(time, end - time, *held) for time, end, held in held_steps(run)]
        lines += [
            f"static const double {name}[][2 + INPUT_COUNT] = {{",
            *(f"    {_braced(map(repr, row))}," for row in rows),
            "};",
        ]
        values = {key: value for key, value in run.start_values.items() if key != "integrator"}
        references = _braced(constant(key) for key in values)
        numbers = _braced(repr(float(value)) for value in values.values())
        method = run.value("integrator")
        table.append(f'    {{"{name}", {references}, {numbers}, {len(values)}, {method}, {name}, {len(rows)}}},')
    return "\n".join([*lines, "static const struct run RUNS[] = {", *table, "};", ""])


def _braced(parts: Iterable[str]) -> str:
    return "{" + ", ".join(parts) + "}"


class Unpacked(NamedTuple):
    """An FMU's folder."""

    folder: Path
    flavour: Flavour

    @property
    def options(self) -> tuple[str, ...]:
        """To compile a host for it."""
        fmi = self.flavour.fmi
        folders = ("-I", str(self.folder / "sources"), "-I", str(C_FOLDER / f"fmi{fmi}"), *C_INCLUDES)
        return (f"-DFMI={fmi}", f"-DFMI{fmi}_OVERRIDE_FUNCTION_PREFIX", *folders)


@pytest.fixture(scope="module")
def unpacked(complete_native_fmu: Path, standard: int, tmp_path_factory: pytest.TempPathFactory) -> Unpacked:
    folder = tmp_path_factory.mktemp("unpacked")
    with zipfile.ZipFile(complete_native_fmu) as archive:
        archive.extractall(folder)
    (folder / "sources" / "runs.h").write_text(runs_header())
    return Unpacked(folder, NATIVE if standard == 2 else NATIVE3)


Paths = dict[str, bytes]
"""By run: all SEEN at all communication points, as they lie in memory."""


def paths_on(unpacked: Unpacked, platform: str, command: list[str], *runner: str, **env: str) -> Paths:
    """What the host in C, made with that command, finds on a platform."""
    path = unpacked.folder / "binaries" / binary(platform, unpacked.flavour)
    program = f"./trajectory{'.exe' if path.suffix == '.dll' else ''}"
    host = [f'-DLIBRARY="./{path.name}"', *unpacked.options, "-o", program, str(C_TESTS / "trajectory.c")]
    environment = {**os.environ, **caches(unpacked.folder / "cache"), **env}
    libraries = [option for option in command if option.startswith("-l")]
    done = subprocess.run([*command, *host, *libraries], cwd=path.parent, env=environment, check=True)
    done = subprocess.run([*runner, program], cwd=path.parent, env=environment, capture_output=True, timeout=600)
    assert done.returncode == 0, done.stderr
    sizes = {name: 8 * len(SEEN) * len(list(held_steps(run))) for name, run in runs().items()}
    ends = list(itertools.accumulate(sizes.values()))
    assert len(done.stdout) == ends[-1]
    return {name: done.stdout[end - sizes[name] : end] for name, end in zip(sizes, ends, strict=True)}


@pytest.fixture(scope="module")
def here(unpacked: Unpacked) -> Paths:
    """Those on this machine."""
    if sys.platform != "linux" or os.uname().machine != "x86_64":
        pytest.skip("not x86-64 Linux")
    return paths_on(unpacked, "x86_64-linux", [c_compiler(), *OPTIONS, "-ldl"])


def test_the_host_in_c_sees_what_fmpy_sees(here: Paths, each_native_fmu: Path) -> None:
    """In one run; and no two runs are the same."""
    run = runs()["turn_rk4"]
    references = [BY_NAME[name].reference for name in SEEN]
    found = b""
    with one(each_native_fmu) as (instance, _):
        _start(instance, run)
        for time, end, held in held_steps(run):
            instance.setReal([BY_NAME[name].reference for name in INPUTS], list(held))
            instance.doStep(time, end - time)
            found += struct.pack(f"<{len(SEEN)}d", *instance.getReal(references))
    assert here["turn_rk4"] == found
    assert len(set(here.values())) == len(here)


def _start(instance: Any, run: Run) -> None:
    for name, value in run.start_values.items():
        put = instance.setReal if BY_NAME[name].kind == "Real" else instance.setInteger
        put([BY_NAME[name].reference], [value])
    instance.setupExperiment()
    instance.enterInitializationMode()
    instance.exitInitializationMode()


BARE = ("-DBARE", "-nostdlib", "-Wl,--entry=start")
"""Without the compiler's runtime, which it would build for a minute."""


def test_the_same_bits_on_arm64(unpacked: Unpacked, here: Paths) -> None:
    qemu = shutil.which("qemu-aarch64")
    if not qemu or not ARM_LIBRARIES.exists():
        pytest.skip("no qemu-aarch64, or no libraries for it: apt-get install qemu-user libc6-arm64-cross")
    command = [*compiler(PLATFORMS["aarch64-linux"]), *BARE, "-lc", "-ldl"]
    assert paths_on(unpacked, "aarch64-linux", command, qemu, "-L", str(ARM_LIBRARIES)) == here


def test_the_same_bits_on_windows(unpacked: Unpacked, here: Paths, shared_folder: Path) -> None:
    wine = shutil.which("wine64") or shutil.which(WINE)
    if not wine:
        pytest.skip("no wine64: apt-get install wine64")
    command = [*compiler(PLATFORMS["x86_64-windows"]), *BARE, "-lkernel32"]
    prefix = shared_folder / "wine"  # one for all FMUs: to make it takes longer than the runs
    quiet = {"WINEPREFIX": str(prefix), "WINEDEBUG": "-all", "DISPLAY": ""}
    with FileLock(f"{prefix}.lock"):
        assert paths_on(unpacked, "x86_64-windows", command, wine, **quiet) == here


# ---- many at once, again and again


def host(unpacked: Unpacked, name: str, *options: str, linked: bool) -> Path:
    """A host of tests/c: with the FMU's library, or compiled together with its sources."""
    if sys.platform != "linux":
        pytest.skip("not Linux")
    program = unpacked.folder / f"{name}{''.join(options)}"
    path = unpacked.folder / "binaries" / binary("x86_64-linux", unpacked.flavour)
    parts = (
        [str(path), f"-Wl,-rpath,{path.parent}"]
        if linked
        else [str(unpacked.folder / "sources" / unpacked.flavour.unit)]
    )
    command = [c_compiler(), *OPTIONS, "-Wall", "-Wextra", "-Werror", *unpacked.options, *options]
    done = subprocess.run(
        [*command, str(C_TESTS / f"{name}.c"), *parts, "-pthread", "-o", str(program)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return program


def printed_by(program: Path) -> str:
    done = subprocess.run([str(program)], capture_output=True, text=True, check=False, timeout=600)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.strip()


SANITIZERS = {"address": ("-O0", "-g", "-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all"),
              "thread": ("-O0", "-g", "-fsanitize=thread")}  # fmt: skip
"""What they watch is compiled in without optimizing, too, in a third of the time."""


def test_eight_threads_of_a_thousand_instances(unpacked: Unpacked) -> None:
    assert printed_by(host(unpacked, "many", linked=True)) == "8000"


@pytest.mark.parametrize(("standard", "sanitizer"), [(2, "thread"), (3, "address")], indirect=["standard"])
def test_eight_threads_of_a_thousand_instances_sanitized(sanitizer: str, unpacked: Unpacked) -> None:
    """Races; and memory, undefined behaviour, leaks. Each with one of the standards: neither has memory that instances
    share, by its symbols (test_native_sources.py), and the fuzzer watches the memory of both.
    """
    assert printed_by(host(unpacked, "many", *SANITIZERS[sanitizer], linked=False)) == "8000"


def test_a_hundred_thousand_cycles_leave_nothing_behind(unpacked: Unpacked) -> None:
    grown = int(printed_by(host(unpacked, "cycles", linked=True)))
    print(f"resident memory grew by {grown} bytes over 90 000 cycles")
    assert grown < 1_000_000


@pytest.mark.parametrize("linked", [True, False])
def test_the_hosts_floating_point_environment_changes_no_bit_and_is_left_as_it_was(
    linked: bool, unpacked: Unpacked
) -> None:
    """Traps, each direction of rounding, flushing to zero, flags: every method, term and use, derivatives, refused
    values, a motion that leaves the range of numbers, saving and restoring.
    """
    if os.uname().machine != "x86_64":
        pytest.skip("not x86-64: its environments are those of the test")
    environments, calls = map(int, printed_by(host(unpacked, "environment", linked=linked)).split())
    assert environments == 10
    assert calls > 2000
