"""What speed costs, what accuracy costs, where the methods break: the studies, and the laboratory that makes them."""

import importlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import NamedTuple

NEEDED = ("matplotlib", "polars", "scipy")


class Study(NamedTuple):
    """One of the studies; its module has a function `study(quick, tell)`."""

    module: str
    what: str
    takes: str
    """How long, usually; with --quick below half a minute."""


STUDIES: Mapping[str, Study] = {
    "trade": Study("trade", "methods, steps and communication steps over the scenes; a host's solver", "10 minutes"),
    "stability": Study("stability", "where each method breaks: limits of the step; random extremes", "2 minutes"),
    "scene-terms": Study("scene_terms", "what each opt-in term costs, and what leaving it out does", "3 minutes"),
    "coupling": Study("closed_loop", "what the communication step of the closed loop costs", "1 minute"),
    "step-costs": Study("step_costs", "a sub-step and a host's calls: native FMU, Python FMU, bare model", "1 minute"),
    "sweeps": Study("sweep_costs", "a run of a sweep, beside fmpy's own way", "10 minutes"),
}


def carry_out(name: str, quick: bool, folder: Path, tell: Callable[[float], None] = lambda _: None) -> str:
    """Make a study, write its tables and pictures into the folder, and return what is to be printed.

    Args:
        name: one of STUDIES.
        quick: fewer cases, below half a minute.
        folder: is made where it is not there.
        tell: called with the part of the work that is done, 0 to 1.

    Raises:
        ValueError: no such study.
        ModuleNotFoundError: what it needs is not installed; says how to install it.
        OSError: a file cannot be written; a program that is measured failed.
    """
    if name not in STUDIES:
        raise ValueError(f"study = {name!r}: must be one of {', '.join(STUDIES)}")
    try:
        for package in NEEDED:  # what draws is imported late: it is to be missed before the work
            importlib.import_module(package)
        module = importlib.import_module(f".{STUDIES[name].module}", __name__)
    except ModuleNotFoundError as error:
        if not (error.name or "").startswith(NEEDED):
            raise
        raise ModuleNotFoundError(
            f"studies need {error.name}, which is not installed: pip install 'hovercraft-fmu[studies]'"
        ) from error
    findings = module.study(quick, tell)
    findings.write(folder)
    report: str = findings.report()
    return report
