"""The FMU in hosts that others wrote: each drives it over the same steps, and must give the bits that fmpy gives."""

import ctypes
import json
import os
import re
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Callable, Mapping
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

import fmpy

from ..fmu.interface import BY_NAME, INPUTS, OUTPUTS
from ..host import Fmu
from ..whole import temporary_folder

COMMUNICATION_STEP = 0.1
"""s"""
CONTROLS = [
    *[(10.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)] * 5,
    *[(10.0, 1.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0)] * 10,
    *[(2.5, 0.0, 0.25, -0.2, 0.0, 1.5, -2.5, 12.5)] * 10,
]
"""One row a communication step, in the order of INPUTS."""
INPUT_REFERENCES = [BY_NAME[name].reference for name in INPUTS]
OUTPUT_REFERENCES = [BY_NAME[name].reference for name in OUTPUTS]
COMPILERS = ("cc", "gcc", "clang")
TIME_LIMIT = 300.0
"""s, of a host: most take a few."""
PYTHON_MODULE = "resources/slavemodule.txt"
"""What tells an FMU that pythonfmu made: the name of its module."""


class HostError(RuntimeError):
    """A host that could not run the FMU; the message is the host's own."""


class Host(NamedTuple):
    """A host: how it is asked for its version, and what keeps it from running here ('' where nothing does)."""

    name: str
    version: Callable[[], str]
    missing: Callable[[], str]


def _package(name: str, *modules: str) -> Host:
    """A host that is a package, and the modules that it runs with."""

    def missing() -> str:
        absent = [each.replace("_", "-") for each in (name, *modules) if not _installed(each)]
        return f"not installed: pip install {' '.join(absent)}" if absent else ""

    return Host(name, lambda: metadata.version(name), missing)


def _installed(name: str) -> bool:
    try:
        metadata.version(name)
    except metadata.PackageNotFoundError:
        return False
    return True


def compiler() -> str | None:
    """The C compiler of this machine."""
    return next((name for name in COMPILERS if shutil.which(name)), None)


def python_library() -> str | None:
    """The name of a Python library that the loader finds, 'libpython3.11.so.1.0', for LD_PRELOAD."""
    if not shutil.which("ldconfig"):
        return None
    printed = subprocess.run(["ldconfig", "-p"], capture_output=True, text=True, check=False).stdout
    found = re.findall(r"^\s*(libpython3\.(\d+)\.so\.1\.0) .*x86-64", printed, re.MULTILINE)
    usable = [(int(minor), name) for name, minor in found if int(minor) >= 10]
    return max(usable)[1] if usable else None


def _missing_to_compile() -> str:
    return "" if compiler() else f"no C compiler ({', '.join(COMPILERS)})"


def _missing_for_c() -> str:
    library = "" if python_library() else "no shared library of Python (Debian: apt-get install libpython3-dev)"
    return _missing_to_compile() or library


HOSTS: Mapping[str, Host] = {
    "fmpy": _package("fmpy"),
    "libcosimpy": _package("libcosimpy"),
    "ecospy": _package("ecospy", "tbb"),
    "fmucontainer": Host("fmucontainer", lambda: metadata.version("fmu_manipulation_toolbox"),
                         _package("fmu_manipulation_toolbox").missing),
    "C host": Host("C host", lambda: f"LD_PRELOAD={python_library()}", _missing_for_c),
}  # fmt: skip
NATIVE_HOSTS: Mapping[str, Host] = {**HOSTS, "C host": Host("C host", lambda: "no Python", _missing_to_compile)}
"""The same for a native FMU, which needs no Python beside it."""
FMI_3_HOSTS: Mapping[str, Host] = {name: host for name, host in NATIVE_HOSTS.items() if name != "libcosimpy"}
"""Those that know FMI 3.0: libcosimpy 0.0.6 dies of it without a word."""


def hosts_of(fmu: Path) -> Mapping[str, Host]:
    """The hosts for the flavour of an FMU."""
    if fmpy.read_model_description(fmu, validate=False).fmiVersion == "3.0":
        return FMI_3_HOSTS
    with zipfile.ZipFile(fmu) as archive:
        return HOSTS if PYTHON_MODULE in archive.namelist() else NATIVE_HOSTS


def run_in(host: str, fmu: Path) -> list[list[float]]:
    """Drive the FMU over CONTROLS in a process of its own; a row of OUTPUTS a communication step.

    Raises:
        HostError: the host failed; the last of what it printed.
    """
    return rows_of_module("hovercraft_fmu.elsewhere", host, str(fmu.absolute()))


def rows_of_module(module: str, *arguments: str, cwd: Path | None = None) -> list[list[float]]:
    """What `python -m module` prints last with these arguments, as JSON. Raises HostError where that fails."""
    command = module_command(module, *arguments)
    try:
        done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False, timeout=TIME_LIMIT)
    except subprocess.TimeoutExpired as error:
        raise HostError(f"it did not end within {TIME_LIMIT:g} s") from error
    if done.returncode != 0:
        said = done.stderr.strip().splitlines()[-1:]  # of a traceback the error
        raise HostError(": ".join((f"exit status {done.returncode}", *said)))
    # Ecos, in C, leaves a line of its own behind it now and then
    rows: list[list[float]] = json.loads(next(x for x in reversed(done.stdout.splitlines()) if x.startswith("[[")))
    return rows


def module_command(module: str, *arguments: str) -> list[str]:
    """As `python -m module`, with the modules of this process alone, not with an fmpy.py of the current folder."""
    home = str(Path(__file__).parents[2])
    places = [place for place in sys.path if place == home or place not in ("", ".", os.getcwd())]
    code = f"import sys; sys.path[:] = {places!r}; import runpy; "
    code += f"runpy.run_module({module!r}, run_name='__main__', alter_sys=True)"
    return [sys.executable, "-I", "-c", code, *arguments]


# ---- what runs in the process of its own


def run_fmpy(fmu: Path) -> list[list[float]]:
    """Through fmpy, as this package drives an FMU."""
    with Fmu(fmu) as opened, opened.instance() as craft:
        inputs, outputs = craft.port(*INPUTS), craft.port(*OUTPUTS)
        craft.start()
        rows = []
        for k, controls in enumerate(CONTROLS):
            inputs.set(controls)
            craft.step(k * COMMUNICATION_STEP, COMMUNICATION_STEP)
            rows.append(outputs.get())
        return rows


def run_libcosimpy(fmu: Path) -> list[list[float]]:
    """libcosim, the co-simulation library of the Open Simulation Platform."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    log_output_level(CosimLogLevel.ERROR)
    execution = CosimExecution.from_step_size(round(COMMUNICATION_STEP * 1e9))  # ns
    craft = execution.add_local_slave(CosimLocalSlave(fmu_path=str(fmu), instance_name="craft"))
    manipulator, observer = CosimManipulator.create_override(), CosimObserver.create_last_value()
    if not (execution.add_manipulator(manipulator) and execution.add_observer(observer)):
        raise HostError("libcosimpy: no manipulator or observer")
    rows = []
    for controls in CONTROLS:
        manipulator.slave_real_values(craft, INPUT_REFERENCES, list(controls))
        execution.step()  # what it returns means nothing in version 0.0.4
        rows.append(list(observer.last_real_values(craft, OUTPUT_REFERENCES)))
    return rows


def load_tbb() -> None:
    """Ecos's library needs the one in the package tbb, which must be loaded first."""
    tbb = next(file for file in metadata.files("tbb") or [] if file.name == "libtbb.so.12")
    ctypes.CDLL(str(tbb.locate()), ctypes.RTLD_GLOBAL)


def run_ecospy(fmu: Path) -> list[list[float]]:
    """Ecos."""
    load_tbb()
    from ecospy import EcosSimulation, EcosSimulationStructure

    structure = EcosSimulationStructure()
    structure.add_model("craft", str(fmu))
    rows = []
    with EcosSimulation(structure=structure, step_size=COMMUNICATION_STEP) as simulation:
        simulation.init()
        for controls in CONTROLS:
            for name, value in zip(INPUTS, controls, strict=True):
                simulation.set_real(f"craft::{name}", value)
            simulation.step()
            rows.append([simulation.get_real(f"craft::{name}") for name in OUTPUTS])
    return rows


def run_fmucontainer(fmu: Path) -> list[list[float]]:
    """The FMU inside a container FMU, which fmpy drives."""
    with temporary_folder() as folder:
        work = Path(folder)
        shutil.copy(fmu, work / "Hovercraft.fmu")
        content = {"name": "Container.fmu", "fmu": ["Hovercraft.fmu"], "step_size": COMMUNICATION_STEP}
        make_container(work, content, int(fmpy.read_model_description(fmu).fmiVersion[0]))
        return run_fmpy(work / "Container.fmu")


def make_container(folder: Path, content: Mapping[str, object], fmi: int = 2) -> None:
    """Have fmucontainer make the FMU that `content` describes, for that FMI, from the FMUs in the folder, there."""
    (folder / "container.json").write_text(json.dumps(content))
    code = "from fmu_manipulation_toolbox.cli.fmucontainer import fmucontainer; fmucontainer()"
    command = [sys.executable, "-c", code, "-container", "container.json", "-fmu-directory", ".", "-fmi", str(fmi)]
    subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)


def run_c(fmu: Path) -> list[list[float]]:
    """A host in C, compiled here; for a Python FMU Python's library is preloaded, as a tool that is not Python must."""
    description = fmpy.read_model_description(fmu)
    fmi = int(description.fmiVersion[0])
    with temporary_folder() as folder:
        fmpy.extract(fmu, unzipdir=folder)
        platform = "linux64" if fmi == 2 else "x86_64-linux"
        library = Path(folder, "binaries", platform, f"{description.coSimulation.modelIdentifier}.so")
        host = compile_host(Path(folder) / "host", fmi)
        command = [str(host), str(library), description.guid, Path(folder, "resources").as_uri(),
                   repr(COMMUNICATION_STEP), ",".join(map(str, INPUT_REFERENCES)),
                   ",".join(map(str, OUTPUT_REFERENCES))]  # fmt: skip
        lines = "".join(" ".join(map(repr, controls)) + "\n" for controls in CONTROLS)
        env = {"PATH": os.defpath}
        if Path(folder, PYTHON_MODULE).exists():
            env["LD_PRELOAD"] = python_library() or ""
        done = subprocess.run(command, input=lines, env=env, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise HostError(f"exit status {done.returncode}: {done.stderr.strip()}")
    return [[float(text) for text in line.split()] for line in done.stdout.splitlines()]


def compile_host(program: Path, fmi: int) -> Path:
    """Compile host.c for a version of FMI with the machine's compiler, warnings as errors."""
    headers, source = Path(fmpy.__file__).parent / "c-code", Path(__file__).parent / "host.c"
    command = [compiler() or "cc", "-std=gnu11", "-Wall", "-Wextra", "-Werror", f"-DFMI={fmi}", "-isystem",
               str(headers), str(source), "-o", str(program), "-ldl"]  # fmt: skip
    subprocess.run(command, check=True)
    return program


RUN: Mapping[str, Callable[[Path], list[list[float]]]] = {
    "fmpy": run_fmpy,
    "libcosimpy": run_libcosimpy,
    "ecospy": run_ecospy,
    "fmucontainer": run_fmucontainer,
    "C host": run_c,
}
