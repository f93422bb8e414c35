"""What a run costs in a sweep, beside fmpy's own way: each case in a process of its own, all in one go, as ratios."""

import json
import os
import subprocess
import sys
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import fmpy
import numpy as np
import polars as pl
import psutil

from ..elsewhere import module_command
from ..fmu.interface import STATES
from ..fmu.native_package import build_native_fmu
from ..fmu.python_package import build_fmu
from ..simulation import plan
from ..sweeps.runner import BATCH, FMU, sweep
from ..sweeps.study import read_study
from ..whole import temporary_folder
from .laboratory import Findings, Shown, Tell, interleaved

FMPY, PYTHON, NATIVE, BARE = "fmpy alone, native FMU", "sweep, Python FMU", "sweep, native FMU", "sweep, batch"
END, EVERY = "end state", "every step"
"""What is kept: the end state, or what needs every communication step: the distance."""


class Way(NamedTuple):
    """One way to make runs."""

    way: str
    keeps: str
    workers: int
    runs: int


WAYS = (
    Way(FMPY, END, 1, 100),
    *(Way(PYTHON, END, workers, runs) for workers in (1, 2) for runs in (100, 1000, 10000)),
    *(Way(NATIVE, END, workers, runs) for workers in (1, 2) for runs in (100, 1000, 10000, 100000)),
    *(Way(NATIVE, EVERY, workers, 10000) for workers in (1, 2)),
    *(Way(BARE, END, 1, runs) for runs in (100, 1000, 10000, 100000)),
    *(Way(BARE, END, 2, runs) for runs in (1000, 100000, 1000000, 10000000)),
)
"""The batch with two workers tells that memory does not depend on the runs.

A run costs the same in fmpy's own way however many there are: a hundred are enough; of the Python FMU, 10 000."""
QUICK = tuple(Way(way, END, 1, 100) for way in (FMPY, PYTHON, NATIVE, BARE))


def content(way: Way) -> dict[str, Any]:
    """The study: `turn` with RK4 at 0.1 s, over masses and air densities."""
    return {
        "scene": "turn",
        "communication_step": 0.1,
        "set": {"integrator": "rk4", "step_size": 0.1},
        "sweep": {"mass": {"from": 80.0, "to": 120.0}, "air_density": {"from": 1.0, "to": 1.3}},
        "sampling": {"method": "latin_hypercube", "runs": way.runs, "seed": 1},
        "keep": {"end": list(STATES)} if way.keeps == END else {"distance": True},
    }


def measure(quick: bool, tell: Tell) -> Findings:
    """All ways; quick: each with a hundred runs. Peaks [MB] of the process and of a worker; to_fmpy: times faster.

    Raises OSError where a process failed, with what it said.
    """
    with temporary_folder() as place:
        python, native = build_fmu(Path(place) / "Python.fmu"), build_native_fmu(Path(place) / "Native.fmu")
        cases = {
            way: partial(partial, in_process, way, native if way.way in (FMPY, NATIVE) else python)
            for way in (QUICK if quick else WAYS)
        }
        found = {way: timed.found for way, timed in interleaved(cases, 1, tell).items()}
    rows: list[dict[str, Any]] = []
    for way, (seconds, peak, worker) in found.items():
        cost = 1e3 * seconds / way.runs
        first = rows[0]["milliseconds_a_run"] if rows else cost
        costs = {"seconds": seconds, "milliseconds_a_run": cost, "to_fmpy": first / cost}
        rows.append({**way._asdict(), **costs, "peak_memory": peak, "worker_memory": worker})
    measured = pl.DataFrame(rows)
    # of every way in one process the one with the most runs
    short = measured.filter(workers=1).sort("runs").unique(["way", "keeps"], keep="last", maintain_order=True)
    short = short.sort(pl.col("way").cast(pl.Enum([FMPY, PYTHON, NATIVE, BARE])), "keeps")
    title = "`turn` for 60 s with RK4 at 0.1 s, a run of a sweep"
    return Findings({"sweep": measured}, [Shown(title, measured), Shown("In short", short.drop("seconds"), "sweep")])


def in_process(way: Way, fmu: Path) -> list[float]:
    """Seconds with the start of the workers and the writing; the peak [MB] of a process of its own, of a worker."""
    with temporary_folder() as output:
        command = module_command(__name__, json.dumps(way), str(fmu), output)
        made = subprocess.run(command, capture_output=True, text=True, check=False)
    if made.returncode != 0:
        raise OSError(f"measuring {way} failed: {made.stderr.strip()}")
    found: list[float] = json.loads(made.stdout)
    return found


# ---- in the process of its own


def _fmpy_alone(way: Way, fmu: Path) -> None:
    """What its user writes: simulate_fmu of the file, run for run."""
    chosen, turn = read_study(content(way)), plan("turn")
    samples = chosen.samples(np.arange(way.runs))
    for i in range(way.runs):
        values = {name: column[i] for name, column in samples.items()}
        fmpy.simulate_fmu(
            fmu, start_values={**chosen.run.start_values, **values}, input=turn.signals, stop_time=turn.stop_time,
            output_interval=0.1, output=list(STATES),
        )  # fmt: skip


def _peak(process: int) -> float:
    """MB: the most that a process had in memory; 0 where the system does not tell. (getrusage counts the parent's.)"""
    status = Path(f"/proc/{process}/status")
    lines = status.read_text(encoding="ascii").splitlines() if status.exists() else []
    return max((float(line.split()[1]) / 1e3 for line in lines if line.startswith("VmHWM:")), default=0.0)


def main() -> None:
    """Prints the seconds and the peaks of a way."""
    way, fmu, workers = Way(*json.loads(sys.argv[1])), Path(sys.argv[2]), [0.0]

    def tell(_runs: int) -> None:
        workers.extend(_peak(child.pid) for child in psutil.Process().children(recursive=True))

    begun = perf_counter()
    if way.way == FMPY:
        _fmpy_alone(way, fmu)
    else:
        engine, given = (BATCH, None) if way.way == BARE else (FMU, fmu)
        made = sweep(content(way), given, workers=way.workers, output=sys.argv[3], engine=engine, tell=tell)
        assert (made.new, made.failed) == (way.runs, 0)
    print(json.dumps([perf_counter() - begun, _peak(os.getpid()), max(workers)]))


if __name__ == "__main__":
    main()
