"""What speed costs, what accuracy costs, where the methods break: the laboratory and its measurements."""

import importlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from ..fmu.near_names import must_be_one_of
from ..whole import check_writable

NEEDED = ("matplotlib", "polars", "scipy")


class Measurement(NamedTuple):
    """Its module has a function `measure(quick, tell)`."""

    module: str
    what: str
    takes: str
    """How long, usually; with --quick below half a minute."""


MEASUREMENTS: Mapping[str, Measurement] = {
    "trade": Measurement("trade", "methods, steps, communication steps over the scenes; a host's solver", "3 minutes"),
    "stability": Measurement("stability", "where each method breaks: limits of the step; random extremes", "2 minutes"),
    "scene-terms": Measurement("scene_terms", "what each opt-in term costs, and what leaving it out does", "1 minute"),
    "coupling": Measurement("closed_loop", "what the communication step of the closed loop costs", "3 minutes"),
    "error-estimate": Measurement(
        "estimates", "what the FMU says of its error, beside it; what is advised for every scene", "2 minutes"
    ),
    "step-costs": Measurement("step_costs", "a sub-step, a host's calls: native, Python FMU, bare model", "1 minute"),
    "cluster": Measurement("cluster_costs", "what a chunk costs who starts a sweep, and dask's scheduler", "2 minutes"),
    "sweeps": Measurement("sweep_costs", "a run of a sweep, beside fmpy's own way", "12 minutes"),
}


def carry_out(name: str, quick: bool, folder: Path, tell: Callable[[float], None] = lambda _: None) -> str:
    """Make a measurement, write its tables and pictures into the folder, and return what is to be printed.

    Args:
        name: one of MEASUREMENTS.
        quick: fewer cases, below half a minute.
        folder: is made where it is not there.
        tell: called with the part of the work that is done, 0 to 1.

    Raises:
        ValueError: no such measurement.
        ModuleNotFoundError: what it needs is not installed; says how to install it.
        OSError: a file cannot be written; a program that is measured failed.
    """
    module = ready(name)
    check_writable(folder / "machine.txt")
    findings = module.measure(quick, tell)
    findings.write(folder)
    report: str = findings.report()
    return report


def ready(name: str) -> Any:
    """The module that makes a measurement. Raises as `carry_out` does, before the work."""
    if name not in MEASUREMENTS:
        raise ValueError(must_be_one_of("measurement", name, MEASUREMENTS))
    try:
        for package in NEEDED:  # what draws is imported late: it is to be missed before the work
            importlib.import_module(package)
        return importlib.import_module(f".{MEASUREMENTS[name].module}", __name__)
    except ModuleNotFoundError as error:
        if not (error.name or "").startswith(NEEDED):
            raise
        raise ModuleNotFoundError(
            f"measurements need {error.name}, which is not installed: "
            "pip install 'hovercraft-fmu[studies]', in a checkout '.[studies]'"
        ) from error
