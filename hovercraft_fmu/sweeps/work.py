"""What a worker does: it makes a chunk of runs, and packs it as the store keeps it."""

import threading
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._version import __version__
from .batch import run_batch
from .engines import Driver, Plan, Ran
from .quantities import Samples, quantity_function, row_columns
from .store import RUNS, TRAJECTORIES, packed, runs_table, trajectories_table


@dataclass(frozen=True)
class Job:
    """What a worker is sent once."""

    sweep: str
    """A name of its own for every call of `sweep`."""
    version: str
    plan: Plan
    swept: tuple[str, ...]
    fmu: bytes | None
    """The content of the FMU; None: the batch."""
    about: Mapping[str, Any]
    """The metadata of the results."""


class Made(NamedTuple):
    """A chunk, made."""

    chunk: int
    files: Mapping[str, bytes]
    """RUNS, and TRAJECTORIES where they are kept -> a Parquet file."""
    runs: int
    failed: int
    """Rows with an error."""
    warned: int
    """Rows whose column `warnings` is not 0."""
    error: tuple[int, str] | None
    """The first of the errors, and the number of its run."""


DRIVERS: dict[tuple[str, int], Driver] = {}
"""(sweep, thread) -> its instance: it is used again from chunk to chunk."""


def make_chunk(job: Job, chunk: int, numbers: NDArray[np.int64], samples: Samples) -> Made:
    """Make the runs of a chunk. Raises ValueError on a worker with another version of this package."""
    if job.version != __version__:
        raise ValueError(f"a worker has hovercraft-fmu {__version__}: must be {job.version}, that of the sweep")
    ran = run_batch(job.plan, samples) if job.fmu is None else _driver(job).run(samples)
    errors = [(int(number), error) for number, error in zip(numbers, ran.errors, strict=True) if error is not None]
    warned = int(np.count_nonzero(ran.warnings))
    return Made(
        chunk, _files(job, chunk, numbers, samples, ran), len(numbers), len(errors), warned, min(errors, default=None)
    )


def _files(job: Job, chunk: int, numbers: NDArray[np.int64], samples: Samples, ran: Ran) -> dict[str, bytes]:
    keep, timeline = job.plan.keep, job.plan.timeline
    columns = row_columns(keep, ran.record, timeline.times)
    runs = packed(runs_table(numbers, samples, columns, ran.warnings, ran.errors), job.about, RUNS, chunk)
    if not keep.trajectory:
        return {RUNS: runs}
    good = np.array([error is None for error in ran.errors])
    values = quantity_function(keep, ran.record)
    points = timeline.sampled
    kept = {name: values(name)[np.ix_(good, points)] for name in keep.trajectory}
    paths = trajectories_table(numbers[good], timeline.times[points], kept)
    return {RUNS: runs, TRAJECTORIES: packed(paths, job.about, TRAJECTORIES, chunk)}


def _driver(job: Job) -> Driver:
    key = job.sweep, threading.get_ident()
    if key not in DRIVERS:
        assert job.fmu is not None
        DRIVERS[key] = Driver(job.plan, job.fmu, job.swept)
    return DRIVERS[key]


def release(sweep_name: str) -> None:
    """Free the instances of a sweep that is over."""
    for key in [key for key in DRIVERS if key[0] == sweep_name]:
        DRIVERS.pop(key).close()
