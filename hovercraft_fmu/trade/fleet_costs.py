"""Would a fleet as arrays, which only FMI 3.0 allows, be cheaper than as many instances? Side by side in one run."""

import platform
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from rich.console import Group

from .. import hosts
from ..fmu.description import NATIVE3
from ..fmu.native_package import PLATFORMS, compiler, has_compiler, sources
from .rows import write_costs

SOURCE = Path(__file__).parent / "fleet_costs.c"
CRAFT = 1000
STEPS = {0.1: 100, 0.01: 10, 0.001: 1}
"""Communication step [s] -> sub-steps."""
MACHINES = {"any x86-64": (), "x86-64 with AVX2": ("-mcpu=x86_64_v3",)}
"""The first is what the FMU is compiled for."""


class Cost(NamedTuple):
    """ns a craft and sub-step."""

    step: float
    machine: str
    instances: float
    fleet: float

    @property
    def ratio(self) -> float:
        """1: above 1 the fleet is cheaper."""
        return self.instances / self.fleet


def missing() -> str:
    """Why it cannot be measured here; '' where it can."""
    if sys.platform != "linux" or platform.machine() != "x86_64":
        return "not x86-64 Linux"
    return "" if has_compiler() else "no compiler of the native FMU: pip install 'hovercraft-fmu[native]'"


def measure() -> list[Cost]:
    """Time 1000 instances of the FMU's sources, and the fleet, for each machine and communication step."""
    found = {machine: _measured(options) for machine, options in MACHINES.items()}
    return [
        Cost(step, machine, times[f"instances_{n}"], times[f"fleet_{n}"])
        for machine, times in found.items()
        for step, n in STEPS.items()
    ]


def _measured(options: tuple[str, ...]) -> dict[str, float]:
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for name, content in sources("0" * 32, NATIVE3).items():
            (folder / name).write_bytes(content)
        headers = ("-I", str(Path(hosts.__file__).parent))
        command = [*compiler(PLATFORMS["x86_64-linux"]), *options, "-D_GNU_SOURCE", "-DFMI=3", "-fno-slp-vectorize",
                   *headers, *NATIVE3.sources, str(SOURCE), "-o", "fleet"]  # fmt: skip
        subprocess.run(command, cwd=folder, check=True)
        done = subprocess.run(["./fleet"], cwd=folder, capture_output=True, text=True, check=True)
    return {name: float(value) for name, value in map(str.split, done.stdout.splitlines())}


def run(folder: Path) -> Group:
    """Measure, write fleet.csv and fleet.md into `folder`, and return what to print."""
    if reason := missing():
        return Group(f"\nno costs of a fleet: {reason}")
    table = write_costs(folder / "fleet", measure(), _cells, TITLES)
    return Group(f"\nWhat a fleet of {CRAFT} craft in one instance could save", table)


TITLES = ("communication step", "compiled for", f"{CRAFT} instances", "a fleet as arrays", "ratio")


def _cells(cost: Cost) -> tuple[str, ...]:
    return (
        f"{cost.step:g} s",
        cost.machine,
        f"{cost.instances:.3g} ns",
        f"{cost.fleet:.3g} ns",
        f"{cost.ratio:.3g} x",
    )
