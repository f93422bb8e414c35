"""The same bits on every platform, many instances at once, nothing left behind: through hosts in C."""

import itertools
import os
import random
import shutil
import struct
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from filelock import FileLock

from hovercraft_fmu.autopilot.pilot_interface import AUTOPILOT_MODEL
from hovercraft_fmu.autopilot.pilot_native import AUTOPILOT_NATIVE
from hovercraft_fmu.fmu.description import NATIVE, NATIVE3, Flavour
from hovercraft_fmu.fmu.interface import BY_NAME, HOVERCRAFT, MOTION, STATES
from hovercraft_fmu.fmu.machine_code import C_FOLDER, OPTIONS, PLATFORMS, caches, compiler
from hovercraft_fmu.fmu.native_package import binary
from hovercraft_fmu.fmu.variable import Model
from hovercraft_fmu.simulation import Run, held_steps, plan
from hovercraft_fmu.tether.tether_interface import TETHER_MODEL
from hovercraft_fmu.tether.tether_native import TETHER_NATIVE3
from tests.lowlevel import one
from tests.native import C_INCLUDES, C_TESTS, SCENES_AND_METHODS, STEPS, c_compiler

pytestmark = pytest.mark.once

CRAFT_SEEN = (*STATES, *MOTION, "force.x", "force.y", "moment", "stability_number")
ARM_LIBRARIES = Path("/usr/aarch64-linux-gnu")
WINE = "/usr/lib/wine/wine64"


STARTS: dict[str, dict[str, dict[str, float]]] = {
    AUTOPILOT_MODEL.name: {"as_it_starts": {}, "reverse_thrust": {"thrust_min": -10.0, "cruise_speed": 2.0}},
    TETHER_MODEL.name: {"as_it_starts": {}, "tight": {"stiffness": 50.0, "slack_length": 1.0}},
}
"""Of the runs of models that are in no scene, by their names."""


class Script(NamedTuple):
    """A run of any model, for the host in C."""

    reals: dict[int, float]
    """Start values by reference."""
    choice: tuple[int, int]
    """An Enumeration's reference and item; 0, 0: none."""
    rows: Sequence[tuple[float, ...]]
    """Time and step [s], inputs."""


def inputs_of(model: Model) -> list[int]:
    return [v.reference for v in model.variables if v.causality == "input"]


def seen_of(model: Model) -> list[int]:
    """References of what the host in C reads, in its order."""
    if model is HOVERCRAFT:
        return [BY_NAME[name].reference for name in CRAFT_SEEN]
    return [v.reference for v in model.variables if v.causality == "output" and v.kind == "Real"]


@cache
def scripts(model: Model) -> dict[str, Script]:
    """Of the hovercraft every scene and every method, of other models inputs that wander."""
    if model is not HOVERCRAFT:
        return {
            name: Script({model.by_name[key].reference: each for key, each in starts.items()}, (0, 0), wandering(model))
            for name, starts in STARTS[model.name].items()
        }
    runs = {
        f"{scene}_{method}": plan(scene, start_values={"integrator": method, "step_size": STEPS[method]})
        for scene, method in SCENES_AND_METHODS
    }
    return {name: _script(run) for name, run in runs.items()}


def _script(run: Run) -> Script:
    values = {BY_NAME[key].reference: float(value) for key, value in run.start_values.items() if key != "integrator"}
    rows = [(time, end - time, *held) for time, end, held in held_steps(run)]
    return Script(values, (BY_NAME["integrator"].reference, int(run.value("integrator"))), rows)


def wandering(model: Model) -> list[tuple[float, ...]]:
    """Each input on a random walk, over steps of any size."""
    chance = random.Random(1)
    inputs, time, rows = [0.0] * len(inputs_of(model)), 0.0, []
    for _ in range(300):
        step = chance.choice([0.1, 0.5, 2.0])
        inputs = [value + chance.gauss(0.0, 3.0) for value in inputs]
        rows.append((time, step, *inputs))
        time += step
    return rows


def runs_header(model: Model) -> str:
    """The runs as tables of C."""
    lines = [f"static const unsigned SEEN[] = {_braced(map(str, seen_of(model)))};"]
    lines += ["struct run { const char *name; unsigned references[20]; double values[20]; unsigned starts, choice;"]
    lines += ["             int item; const double (*rows)[2 + INPUT_COUNT]; unsigned steps; };"]
    table = []
    for name, script in scripts(model).items():
        lines += [
            f"static const double {name}[][2 + INPUT_COUNT] = {{",
            *(f"    {_braced(map(repr, row))}," for row in script.rows),
            "};",
        ]
        references, numbers = _braced(map(str, script.reals or [0])), _braced(map(repr, script.reals.values() or [0]))
        choice, item = script.choice
        starts, steps = len(script.reals), len(script.rows)
        table.append(f'    {{"{name}", {references}, {numbers}, {starts}, {choice}, {item}, {name}, {steps}}},')
    return "\n".join([*lines, "static const struct run RUNS[] = {", *table, "};", ""])


def _braced(parts: Iterable[str]) -> str:
    return "{" + ", ".join(parts) + "}"


class Unpacked(NamedTuple):
    """An FMU's folder."""

    fmu: Path
    folder: Path
    flavour: Flavour

    @property
    def options(self) -> tuple[str, ...]:
        """To compile a host for it."""
        fmi = self.flavour.fmi
        folders = ("-I", str(self.folder / "sources"), "-I", str(C_FOLDER / f"fmi{fmi}"), *C_INCLUDES)
        return (f"-DFMI={fmi}", f"-DFMI{fmi}_OVERRIDE_FUNCTION_PREFIX", *folders)


@pytest.fixture(scope="module", params=[NATIVE, NATIVE3, AUTOPILOT_NATIVE, TETHER_NATIVE3], ids=lambda f: f.identifier)
def unpacked(
    request: pytest.FixtureRequest, complete: Callable[[Flavour], Path], tmp_path_factory: pytest.TempPathFactory
) -> Unpacked:
    """The hovercraft of both standards; of the models that share its room one each."""
    flavour: Flavour = request.param
    fmu, folder = complete(flavour), tmp_path_factory.mktemp("unpacked")
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(folder)
    (folder / "sources" / "runs.h").write_text(runs_header(flavour.model))
    return Unpacked(fmu, folder, flavour)


Paths = dict[str, bytes]
"""By run: what is seen at all communication points, as it lies in memory."""


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
    model = unpacked.flavour.model
    sizes = {name: 8 * len(seen_of(model)) * len(script.rows) for name, script in scripts(model).items()}
    ends = list(itertools.accumulate(sizes.values()))
    assert len(done.stdout) == ends[-1]
    return {name: done.stdout[end - sizes[name] : end] for name, end in zip(sizes, ends, strict=True)}


@pytest.fixture(scope="module")
def here(unpacked: Unpacked) -> Paths:
    """Those on this machine."""
    if sys.platform != "linux" or os.uname().machine != "x86_64":
        pytest.skip("not x86-64 Linux")
    return paths_on(unpacked, "x86_64-linux", [c_compiler(), *OPTIONS, "-ldl"])


def test_the_host_in_c_sees_what_fmpy_sees(here: Paths, unpacked: Unpacked) -> None:
    """In one run; and no two runs are the same."""
    model = unpacked.flavour.model
    name = "turn_rk4" if model is HOVERCRAFT else "as_it_starts"
    script = scripts(model)[name]
    found = b""
    with one(unpacked.fmu) as (instance, _):
        _start(instance, script)
        for time, step, *held in script.rows:
            instance.setReal(inputs_of(model), held)
            instance.doStep(time, step)
            found += struct.pack(f"<{len(seen_of(model))}d", *instance.getReal(seen_of(model)))
    assert here[name] == found
    assert len(set(here.values())) == len(here)


def _start(instance: Any, script: Script) -> None:
    instance.setReal(list(script.reals), list(script.reals.values()))
    choice, item = script.choice
    if choice:
        instance.setInteger([choice], [item])
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


def printed_by(program: Path, *arguments: str) -> str:
    done = subprocess.run([str(program), *arguments], capture_output=True, text=True, check=False, timeout=600)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout.strip()


SANITIZERS = {"address": ("-O0", "-g", "-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all"),
              "thread": ("-O0", "-g", "-fsanitize=thread")}  # fmt: skip
"""What they watch is compiled in without optimizing, too, in a third of the time."""


def test_eight_threads_of_a_thousand_instances(unpacked: Unpacked) -> None:
    assert printed_by(host(unpacked, "many", "-DINSTANCES=1000", linked=True)) == "8000"


@pytest.mark.parametrize(
    ("unpacked", "sanitizer"), [(NATIVE, "thread"), (NATIVE3, "address"), (AUTOPILOT_NATIVE, "thread")],
    indirect=["unpacked"], ids=lambda each: getattr(each, "identifier", each),
)  # fmt: skip
def test_eight_threads_of_a_hundred_instances_sanitized(sanitizer: str, unpacked: Unpacked) -> None:
    """Races; and memory, undefined behaviour, leaks. Each with one of the standards: neither has memory that instances
    share, by its symbols (test_native_sources.py), and the fuzzer watches the memory of every model in both.
    """
    assert printed_by(host(unpacked, "many", *SANITIZERS[sanitizer], "-DINSTANCES=100", linked=False)) == "800"


def test_a_hundred_thousand_cycles_leave_nothing_behind(unpacked: Unpacked) -> None:
    """Of the models that share the hovercraft's room 30 000; what is allocated takes 32 bytes at least."""
    cycles, most = (100_000, 1_000_000) if unpacked.flavour.model is HOVERCRAFT else (30_000, 300_000)
    grown = int(printed_by(host(unpacked, "cycles", linked=True), str(cycles)))
    print(f"resident memory grew by {grown} bytes over {cycles * 9 // 10} cycles")
    assert grown < most


@pytest.mark.parametrize("unpacked", [NATIVE, NATIVE3], indirect=True, ids=lambda each: each.identifier)
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
