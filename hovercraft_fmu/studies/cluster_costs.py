"""What feeding a cluster costs: CPU that who starts a sweep, and the scheduler of dask, spend on a chunk of it."""

import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from time import perf_counter, process_time
from typing import Any
from unittest.mock import patch

import distributed
import numpy as np
import polars as pl
import psutil
from numpy.typing import NDArray

from ..sweeps import runner
from ..sweeps.chunks import SECONDS
from ..whole import temporary_folder
from .laboratory import Findings, Shown, Tell

WORKERS, QUICK = (2, 4, 8, 16), (2,)
"""Processes, of one thread each."""
FEW, MANY = 50, 450
"""Chunks of two sweeps: what they differ by is what chunks cost, without what a sweep costs once."""
RUNS = 3000
"""Of a chunk: some 50 ms of work, so that a measurement has many; what feeding it costs does not depend on them."""
PATIENCE = 60.0
"""s, for a scheduler and its workers to begin."""


def measure(quick: bool, tell: Tell) -> Findings:
    """CPU of a chunk, with more and more workers; of a second of a worker's work, where a chunk has what it is to have.

    Raises OSError where a cluster does not begin in time.
    """
    rows = []
    counts = QUICK if quick else WORKERS
    for number, workers in enumerate(counts, 1):
        with _cluster(workers) as (address, scheduler):
            _, few, many = (_spent(address, scheduler, chunks) for chunks in (FEW, FEW, MANY))
        starter, of_scheduler, wall = ((many - few) / (MANY - FEW)).tolist()
        rows.append({
            "workers": workers, "chunks_a_second": 1.0 / wall,
            "starter_ms_a_chunk": 1e3 * starter, "scheduler_ms_a_chunk": 1e3 * of_scheduler,
            "starter_ms_a_second": 1e3 * starter / SECONDS, "scheduler_ms_a_second": 1e3 * of_scheduler / SECONDS,
            "workers_fed": int(SECONDS / max(starter, of_scheduler)),
        })  # fmt: skip
        tell(number / len(counts))
    measured = pl.DataFrame(rows)
    title = f"CPU that is spent on a chunk; on a second of a worker's work, a chunk being {SECONDS:g} s of it"
    return Findings({"cluster": measured}, [Shown(title, measured)])


def _spent(address: str, scheduler: psutil.Process, chunks: int) -> NDArray[np.float64]:
    """Of a sweep of so many chunks: CPU seconds of this process, of the scheduler; seconds."""
    study: dict[str, Any] = {
        "scene": "turn",
        "set": {"integrator": "rk4", "step_size": 0.1},
        "sweep": {"mass": {"from": 80.0, "to": 120.0}, "air_density": {"from": 1.0, "to": 1.3}},
        "sampling": {"method": "latin_hypercube", "runs": RUNS * chunks, "seed": 1},
        "keep": {"end": ["speed"]},
    }
    with temporary_folder() as output, patch.dict(runner.LEAST_CHUNKS, {runner.BATCH: chunks}):
        before = _clocks(scheduler)
        made = runner.sweep(study, engine=runner.BATCH, scheduler=address, output=output)
        after = _clocks(scheduler)
    assert (made.new, made.failed) == (RUNS * chunks, 0)
    return after - before


def _clocks(scheduler: psutil.Process) -> NDArray[np.float64]:
    return np.array([process_time(), sum(scheduler.cpu_times()[:2]), perf_counter()])


@contextmanager
def _cluster(workers: int) -> Iterator[tuple[str, psutil.Process]]:
    """The address of a scheduler that has so many workers, and its process."""
    with temporary_folder() as folder, ExitStack() as at_the_end:

        def begin(what: str, *options: str) -> "subprocess.Popen[bytes]":
            command = [sys.executable, "-m", "dask", what, "--host", "127.0.0.1", "--scheduler-file", file, *options]
            process = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, cwd=folder)
            at_the_end.callback(process.wait)
            at_the_end.callback(process.kill)
            return process

        file = str(Path(folder) / "scheduler.json")
        scheduler = begin("scheduler", "--port", "0", "--no-dashboard", "--dashboard-address", "127.0.0.1:0")
        for _ in range(workers):  # they wait for the file
            begin("worker", "--nthreads", "1", "--no-nanny", "--no-dashboard")
        with distributed.Client(scheduler_file=file, set_as_default=False, timeout=PATIENCE) as client:
            client.wait_for_workers(workers, timeout=PATIENCE)
            address = client.scheduler.address
        yield address, psutil.Process(scheduler.pid)
