"""What the native FMU costs: a sub-step in C, and the calls of a host, beside the Python FMU; ratios in one run."""

import os
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import fmpy
from rich.console import Group

from ..fmu.description import NATIVE
from ..fmu.interface import BY_NAME, INPUTS, VARIABLES
from ..fmu.machine_code import library, sources
from ..fmu.native_package import build_native_fmu
from ..fmu.python_package import build_fmu
from ..hosts import compiler, python_library
from ..model.integrators import INTEGRATORS
from ..simulation import instantiated, read_description
from .rows import write_costs

COMMUNICATION_STEPS = (0.01, 0.1, 1.0)
"""s"""
CALLS = {0.01: 100, 0.1: 20, 1.0: 4}
"""Communication steps of one sample."""
SAMPLES = 21
OUTPUTS = [variable.reference for variable in VARIABLES if variable.causality == "output"]
SOURCE = Path(__file__).parent / "step_costs.c"


class Cost(NamedTuple):
    """A cost of the native FMU, and what it is compared with."""

    what: str
    unit: str
    native: float
    compared_with: str
    other: float

    @property
    def ratio(self) -> float:
        """1: above 1 the native FMU is cheaper."""
        return self.other / self.native


def missing() -> str:
    """Why it cannot be measured here; '' where it can."""
    if sys.platform != "linux" or not compiler():
        return "no C compiler (cc, gcc, clang) on Linux"
    if reason := library(NATIVE).missing:
        return reason
    return "" if python_library() else "no shared library of Python (Debian: apt-get install libpython3-dev)"


def measure() -> list[Cost]:
    """Time all cases, native beside Python FMU."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        native, python = build_native_fmu(folder / "Native.fmu"), build_fmu(folder / "Python.fmu")
        calls = _through_fmpy(native, python)
        in_c = _in_c(folder / "native", native, "substeps"), _in_c(folder / "python", python)
    return [
        *_substeps(in_c[0]),
        _evaluation(in_c[0]),
        *_calls("fmpy", *calls),
        *_calls("C host", *in_c),
        *_instances(*in_c),
    ]


def _substeps(found: Mapping[str, float]) -> list[Cost]:
    """Each method beside the same C with libm; the first and the last beside plain loops, too."""
    others = {"plain": "plain C loop with libm, -O3", "libm": "the same with libm, -O3"}
    return [
        Cost(f"{method.name}: a sub-step", "ns", found[f"substep_{method.name}"], text, found[f"{other}_{method.name}"])
        for method in INTEGRATORS
        for other, text in others.items()
        if f"{other}_{method.name}" in found
    ]


def _evaluation(found: Mapping[str, float]) -> Cost:
    """The loads and the interface of model exchange, beside the loads and the method in co-simulation."""
    what = "C host: set time and states, get derivatives"
    return Cost(what, "ns", found["evaluation"], "a quarter of a sub-step of rk4", found["substep_rk4"] / 4.0)


def _calls(host: str, native: Mapping[str, float], python: Mapping[str, float]) -> list[Cost]:
    return [
        Cost(f"{host}: set, doStep of {step:g} s, get", "us", native[f"calls_{step:g}"], "Python FMU",
             python[f"calls_{step:g}"])
        for step in COMMUNICATION_STEPS
    ]  # fmt: skip


def _instances(native: Mapping[str, float], python: Mapping[str, float]) -> list[Cost]:
    rows = (
        ("load, first instance", "load", "us"),
        ("instantiate, free", "instantiate", "us"),
        ("memory of an instance", "memory", "bytes"),
    )
    return [Cost(what, unit, native[key], "Python FMU", python[key]) for what, key, unit in rows]


# ---- in C


def _in_c(folder: Path, fmu: Path, *options: str) -> dict[str, float]:
    """What the program in C measures of an FMU."""
    folder.mkdir()
    description = fmpy.read_model_description(fmu)
    fmpy.extract(fmu, unzipdir=str(folder))
    library = folder / "binaries" / "linux64" / f"{description.coSimulation.modelIdentifier}.so"
    resources = (folder / "resources").as_uri()
    env = {"PATH": os.defpath, "LD_PRELOAD": "" if options else python_library() or ""}
    command = [str(_program(folder)), str(library), description.guid, resources, *options]
    done = subprocess.run(command, env=env, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise OSError(f"measuring in C failed: {done.stderr.strip()}")
    return {name: float(value) for name, value in (line.split() for line in done.stdout.splitlines())}


def _program(folder: Path) -> Path:
    """The program, with the kernel in it that it compares with."""
    place = folder / "program"
    place.mkdir()
    for name, content in sources("0" * 32).items():
        (place / name).write_bytes(content)
    command = [compiler() or "cc", "-std=gnu11", "-O3", "-ffp-contract=off", "-fno-math-errno", "-DHOVERCRAFT_LIBM",
               "-I", str(place), str(SOURCE), str(place / "kernel.c"), "-lm", "-ldl", "-o",
               str(place / "costs")]  # fmt: skip
    subprocess.run(command, check=True)
    return place / "costs"


# ---- through fmpy


def _through_fmpy(native: Path, python: Path) -> tuple[dict[str, float], dict[str, float]]:
    """us a communication step, interleaved: a slow moment of the machine hits both alike."""
    samples: dict[tuple[int, float], list[float]] = {}
    with (
        instantiated(native, read_description(native), []) as (_, one),
        instantiated(python, read_description(python), []) as (_, other),
    ):
        cases = [_started(one), _started(other)]
        for _ in range(SAMPLES):
            for step in COMMUNICATION_STEPS:
                for i, case in enumerate(cases):
                    samples.setdefault((i, step), []).append(case(step))
    medians = [
        {f"calls_{step:g}": statistics.median(samples[i, step]) * 1e6 for step in COMMUNICATION_STEPS} for i in (0, 1)
    ]
    return medians[0], medians[1]


def _started(instance: Any) -> Callable[[float], float]:
    """Seconds of a communication step of a size; arrays are made once, as in fmpy's own loop."""
    instance.setupExperiment()
    instance.enterInitializationMode()
    instance.exitInitializationMode()
    inputs = (fmpy.fmi2.fmi2ValueReference * len(INPUTS))(*(BY_NAME[name].reference for name in INPUTS))
    outputs = (fmpy.fmi2.fmi2ValueReference * len(OUTPUTS))(*OUTPUTS)
    controls = (fmpy.fmi2.fmi2Real * len(INPUTS))(5.0, 0.5, 0.2)
    values = (fmpy.fmi2.fmi2Real * len(OUTPUTS))()
    time = 0.0

    def sample(step: float) -> float:
        nonlocal time
        begun = perf_counter()
        for _ in range(CALLS[step]):
            instance.fmi2SetReal(instance.component, inputs, len(INPUTS), controls)
            instance.fmi2DoStep(instance.component, time, step, fmpy.fmi2.fmi2True)
            instance.fmi2GetReal(instance.component, outputs, len(OUTPUTS), values)
            time += step
        return (perf_counter() - begun) / CALLS[step]

    return sample


# ---- what is printed


def run(folder: Path) -> Group:
    """Measure, write native.csv and native.md into the folder, and return what is to be printed."""
    if why := missing():
        return Group(f"\nThe native FMU was not measured: {why}")
    table = write_costs(folder / "native", measure(), _cells, TITLES)
    return Group(f"\nWhat {NATIVE.identifier} costs", table)


TITLES = ("what", "native", "compared with", "that", "ratio")


def _cells(cost: Cost) -> tuple[str, ...]:
    native, other = (f"{value:.3g} {cost.unit}" for value in (cost.native, cost.other))
    return cost.what, native, cost.compared_with, other, f"{cost.ratio:.3g} x"
