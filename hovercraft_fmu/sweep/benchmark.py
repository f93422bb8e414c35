"""What a run costs in a sweep, beside fmpy's own way: each case in a process of its own, all in one go, as ratios."""

import csv
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import fmpy
from rich.console import Group
from rich.table import Table

from ..fmu.interface import STATES
from ..fmu.native_package import build_native_fmu
from ..fmu.package import build_fmu
from ..simulation import plan
from ..trade.work_precision import machine
from ..view.tables import markdown
from .runner import BATCH, FMU, sweep
from .study import read_study

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
    Case(PYTHON, EVERY, 1, 100),
    *(Case(NATIVE, END, workers, runs) for workers in (1, 2) for runs in (100, 1000, 10000, 100000)),
    *(Case(NATIVE, EVERY, workers, 10000) for workers in (1, 2)),
    *(Case(BARE, END, 1, runs) for runs in (100, 1000, 10000, 100000)),
    Case(BARE, END, 2, 100000),
)
"""A run costs the same in fmpy's own way however many there are: a hundred are enough; of the Python FMU, 10 000."""
QUICK = tuple(case for case in CASES if case.runs == 100 and case.workers == 1)


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
    """1: how many times as many runs in the same time as in fmpy's own way."""
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


def measure(tell: Callable[[float], None], quick: bool = False) -> Iterator[Measured]:
    """Every case, in a fresh process each; `tell` is called with the part that is done."""
    cases = QUICK if quick else CASES
    with tempfile.TemporaryDirectory(prefix="hovercraft_sweep_") as place:
        folder, base = Path(place), 0.0
        build_fmu(folder / "Python.fmu")
        build_native_fmu(folder / "Native.fmu")
        for i, case in enumerate(cases):
            command = [sys.executable, "-m", __name__, json.dumps(case), str(folder), str(folder / f"case_{i}")]
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            if done.returncode != 0:
                raise OSError(f"measuring {case} failed: {done.stderr.strip()}")
            seconds, memory, worker_memory = json.loads(done.stdout)
            cost = 1e3 * seconds / case.runs
            base = base or cost  # fmpy's is the first
            tell((i + 1) / len(cases))
            yield Measured(*case, seconds, cost, base / cost, memory, worker_memory)


def run(folder: Path, tell: Callable[[float], None] = lambda _: None, quick: bool = False) -> Group:
    """Measure, write sweep.csv and sweep.md into the folder, and return what is to be printed."""
    rows = list(measure(tell, quick))
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "sweep.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(Measured._fields)
        writer.writerows(rows)
    (folder / "sweep.md").write_text(markdown(TITLES, map(_cells, rows)) + "\n", encoding="utf-8")
    table = Table(box=None, pad_edge=False)
    for title in TITLES:
        table.add_column(title)
    for row in rows:
        table.add_row(*_cells(row))
    return Group("`turn` for 60 s with RK4 at 0.1 s, a run of a sweep", table, f"\n{machine()}", f"\nwrote {folder}/")


TITLES = ("way", "keeps", "workers", "runs", "ms a run", "to fmpy alone", "peak memory", "of a worker")


def _cells(row: Measured) -> tuple[str, ...]:
    worker = f"{row.worker_memory:.0f} MB" if row.worker_memory else ""
    return (
        row.way, row.keeps, str(row.workers), str(row.runs), f"{row.milliseconds_a_run:.3g}", f"{row.to_fmpy:.3g} x",
        f"{row.peak_memory:.0f} MB", worker,
    )  # fmt: skip


# ---- in the fresh process


def _one(case: Case, folder: Path, output: Path) -> float:
    """Seconds of the case."""
    if case.way == FMPY:
        return _fmpy_alone(case, folder / "Native.fmu")
    engine = BATCH if case.way == BARE else FMU
    fmu = {PYTHON: folder / "Python.fmu", NATIVE: folder / "Native.fmu"}.get(case.way)
    begun = perf_counter()
    outcome = sweep(content(case), fmu, workers=case.workers, output=output, engine=engine)
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


def _peaks() -> tuple[float, float]:
    """MB: the most that this process had in memory, and the most of any of its workers; 0 where nobody tells."""
    try:
        import resource
    except ModuleNotFoundError:  # Windows
        return 0.0, 0.0
    size = 1e6 if sys.platform == "darwin" else 1e3
    own, others = (resource.getrusage(who).ru_maxrss / size for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return own, others


def main() -> None:
    """The process of one case: prints its seconds and peaks."""
    case = Case(*json.loads(sys.argv[1]))
    seconds = _one(case, Path(sys.argv[2]), Path(sys.argv[3]))
    own, workers = _peaks()
    print(json.dumps([seconds, own, workers if case.workers > 1 else 0.0]))


if __name__ == "__main__":
    main()
