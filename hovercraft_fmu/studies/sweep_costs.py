"""What a run costs in a sweep, beside fmpy's own way: each case in a process of its own, all in one go, as ratios."""

import csv
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Sequence
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import fmpy
import psutil
from rich.console import Group
from rich.table import Table

from ..fmu.interface import STATES
from ..fmu.native_package import build_native_fmu
from ..fmu.python_package import build_fmu
from ..hosts import module_command
from ..simulation import plan
from ..sweep.runner import BATCH, FMU, Tell, sweep
from ..sweep.study import read_study
from ..view.tables import markdown
from .trade import machine

FMPY, PYTHON, NATIVE, BARE = "fmpy alone, native FMU", "sweep, Python FMU", "sweep, native FMU", "sweep, batch"
END, EVERY = "end state", "every step"
"""What is kept: the end state, or what needs every communication step: the distance."""


class Case(NamedTuple):
    """One way to make runs."""

    way: str
    keeps: str
    workers: int
    runs: int


CASES = (
    Case(FMPY, END, 1, 100),
    *(Case(PYTHON, END, workers, runs) for workers in (1, 2) for runs in (100, 1000, 10000)),
    *(Case(NATIVE, END, workers, runs) for workers in (1, 2) for runs in (100, 1000, 10000, 100000)),
    *(Case(NATIVE, EVERY, workers, 10000) for workers in (1, 2)),
    *(Case(BARE, END, 1, runs) for runs in (100, 1000, 10000, 100000)),
    Case(BARE, END, 2, 100000),
)
"""A run costs the same in fmpy's own way however many there are: a hundred are enough; of the Python FMU, 10 000."""


class Measured(NamedTuple):
    """What a case cost."""

    way: str
    keeps: str
    workers: int
    runs: int
    seconds: float
    """With the start of the workers, and the writing."""
    milliseconds_a_run: float
    to_fmpy: float
    """1: how many times as many runs in the same time as in the first case, fmpy's own way."""
    peak_memory: float
    """MB, of the process"""
    worker_memory: float
    """MB, of its largest worker; 0: it has none"""


def content(case: Case) -> dict[str, Any]:
    """The study: `turn` with RK4 at 0.1 s, over masses and air densities."""
    return {
        "scene": "turn",
        "communication_step": 0.1,
        "set": {"integrator": "rk4", "step_size": 0.1},
        "sweep": {"mass": {"from": 80.0, "to": 120.0}, "air_density": {"from": 1.0, "to": 1.3}},
        "sampling": {"method": "latin_hypercube", "runs": case.runs, "seed": 1},
        "keep": {"end": list(STATES)} if case.keeps == END else {"distance": True},
    }


def measure(
    cases: Sequence[Case], python: Path, native: Path, tell: Callable[[float], None] = lambda _: None
) -> list[Measured]:
    """The cases, in a fresh process each, on these FMUs; `tell` is called with the part that is done.

    Raises:
        OSError: a case failed; with what it said.
    """
    rows: list[Measured] = []
    for done, case in enumerate(cases, 1):
        with tempfile.TemporaryDirectory(prefix="hovercraft_sweep_") as output:
            fmu = native if case.way in (FMPY, NATIVE) else python
            command = module_command(__name__, json.dumps(case), str(fmu), output)
            made = subprocess.run(command, capture_output=True, text=True, check=False)
        if made.returncode != 0:
            raise OSError(f"measuring {case} failed: {made.stderr.strip()}")
        seconds, memory, worker_memory = json.loads(made.stdout)
        cost = 1e3 * seconds / case.runs
        first = rows[0].milliseconds_a_run if rows else cost
        rows.append(Measured(*case, seconds, cost, first / cost, memory, worker_memory))
        tell(done / len(cases))
    return rows


def run(folder: Path, tell: Callable[[float], None] = lambda _: None) -> Group:
    """Measure, write sweep.csv and a short sweep.md into the folder, and return what is to be printed."""
    with tempfile.TemporaryDirectory(prefix="hovercraft_sweep_") as place:
        python, native = build_fmu(Path(place) / "Python.fmu"), build_native_fmu(Path(place) / "Native.fmu")
        rows = measure(CASES, python, native, tell)
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "sweep.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(Measured._fields)
        writer.writerows(rows)
    (folder / "sweep.md").write_text(markdown(TITLES, map(cells, short(rows))) + "\n", encoding="utf-8")
    table = Table(box=None, pad_edge=False)
    for title in TITLES:
        table.add_column(title)
    for row in rows:
        table.add_row(*cells(row))
    return Group("`turn` for 60 s with RK4 at 0.1 s, a run of a sweep", table, f"\n{machine()}", f"\nwrote {folder}/")


def short(rows: Sequence[Measured]) -> list[Measured]:
    """Of every way in one process the case with the most runs."""
    most = {(row.way, row.keeps): row for row in sorted(rows, key=lambda row: row.runs) if row.workers == 1}
    return [row for row in rows if row in most.values()]


TITLES = ("way", "keeps", "workers", "runs", "ms a run", "to fmpy alone", "peak memory", "of a worker")


def cells(row: Measured) -> tuple[str, ...]:
    """A row of the table, in the order of TITLES."""
    worker = f"{row.worker_memory:.0f} MB" if row.worker_memory else ""
    return (
        row.way, row.keeps, str(row.workers), str(row.runs), f"{row.milliseconds_a_run:.3g}", f"{row.to_fmpy:.3g} x",
        f"{row.peak_memory:.0f} MB", worker,
    )  # fmt: skip


# ---- in the fresh process


def _one(case: Case, fmu: Path, output: Path, tell: Tell) -> float:
    """Seconds of the case."""
    if case.way == FMPY:
        return _fmpy_alone(case, fmu)
    engine, given = (BATCH, None) if case.way == BARE else (FMU, fmu)
    begun = perf_counter()
    outcome = sweep(content(case), given, workers=case.workers, output=output, engine=engine, tell=tell)
    seconds = perf_counter() - begun
    assert (outcome.new, outcome.failed) == (case.runs, 0)
    return seconds


def _fmpy_alone(case: Case, fmu: Path) -> float:
    """What its user writes: simulate_fmu of the file, run for run."""
    import numpy as np

    study = read_study(content(case))
    samples = study.samples(np.arange(case.runs))
    turn = plan("turn")
    begun = perf_counter()
    for i in range(case.runs):
        values = {name: column[i] for name, column in samples.items()}
        fmpy.simulate_fmu(
            fmu, start_values={**study.run.start_values, **values}, input=turn.signals, stop_time=turn.stop_time,
            output_interval=0.1, output=list(STATES),
        )  # fmt: skip
    return perf_counter() - begun


def _peak(process: int) -> float:
    """MB: the most that a process had in memory; 0 where the system does not tell. (getrusage counts the parent's.)"""
    status = Path(f"/proc/{process}/status")
    lines = status.read_text(encoding="ascii").splitlines() if status.exists() else []
    return max((float(line.split()[1]) / 1e3 for line in lines if line.startswith("VmHWM:")), default=0.0)


def main() -> None:
    """The process of one case: prints its seconds and peaks."""
    case = Case(*json.loads(sys.argv[1]))
    workers = 0.0

    def tell(_runs: int) -> None:
        nonlocal workers
        children = psutil.Process().children(recursive=True)
        workers = max([workers, *(_peak(child.pid) for child in children)])

    seconds = _one(case, Path(sys.argv[2]), Path(sys.argv[3]), tell)
    print(json.dumps([seconds, _peak(os.getpid()), workers]))


if __name__ == "__main__":
    main()
