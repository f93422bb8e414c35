"""What a worker does: it makes a chunk of runs, and writes it."""

import platform
import threading
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from .._version import __version__
from .batch import run_batch
from .engines import Driver, Plan, Ran
from .place import Place
from .quantities import Samples, quantity_function, row_columns
from .sampling import Sampling
from .store import (
    RUNS,
    TRAJECTORIES,
    chunk_file,
    different,
    packed,
    runs_table,
    statement,
    trajectories_table,
)


@dataclass(frozen=True)
class Job:
    """What a worker is sent once."""

    sweep: str
    """A name of its own for every call of `sweep`."""
    version: str
    plan: Plan
    sampling: Sampling
    fmu: bytes | None
    """The content of the FMU; None: the batch."""
    about: Mapping[str, Any]
    """The metadata of the results."""
    place: Place
    """Where it writes."""

    @property
    def chunks(self) -> int:
        """How many there are."""
        return -(-self.sampling.runs // int(self.about["chunk"]))

    def numbers(self, chunk: int) -> NDArray[np.int64]:
        """Of the runs of a chunk."""
        first = chunk * int(self.about["chunk"])
        return np.arange(first, first + self.count(chunk))

    def count(self, chunk: int) -> int:
        """How many runs it has."""
        size = int(self.about["chunk"])
        return min(size, self.sampling.runs - chunk * size)


class Made(NamedTuple):
    """A chunk, made and written."""

    chunk: int
    runs: int
    failed: int
    """Rows with an error."""
    warned: int
    """Rows whose column `warnings` is not 0."""
    error: tuple[int, str] | None
    """The first of the errors, and the number of its run."""


DRIVERS: dict[tuple[str, int], Driver] = {}
"""(sweep, thread) -> its instance: it is used again from chunk to chunk."""


def make_chunk(job: Job, chunk: int) -> Made:
    """Make the runs of a chunk, and write them; its runs come last: where they are, all of it is.

    Raises:
        ValueError: on a worker with another version of this package.
        OSError: the worker does not see the place, or cannot write there.
    """
    if job.version != __version__:
        raise ValueError(f"a worker has hovercraft-fmu {__version__}: must be {job.version}, that of the sweep")
    _check_sees(job)
    numbers = job.numbers(chunk)
    samples = job.sampling.samples(numbers)
    ran = run(job, samples)
    for what, table in tables(job, numbers, samples, ran):
        job.place.write(chunk_file(what, chunk), packed(table, job.about, what, chunk))
    errors = [(int(number), error) for number, error in zip(numbers, ran.errors, strict=True) if error is not None]
    warned = int(np.count_nonzero(ran.warnings))
    return Made(chunk, len(numbers), len(errors), warned, min(errors, default=None))


def _check_sees(job: Job) -> None:
    stated = statement(job.place)
    if stated is None or different(stated, job.about):
        raise OSError(
            f"output = {job.place.given!r}: must be a place that every worker sees: {platform.node()} does not; "
            "name a shared folder, or an address as s3://bucket/folder"
        )


def run(job: Job, samples: Samples) -> Ran:
    """Make the runs with these parameters."""
    return run_batch(job.plan, samples) if job.fmu is None else _driver(job).run(samples)


def tables(job: Job, numbers: NDArray[np.int64], samples: Samples, ran: Ran) -> Iterator[tuple[str, pa.Table]]:
    """What is kept of runs, file by file."""
    keep, timeline = job.plan.keep, job.plan.timeline
    if keep.trajectory:
        good = np.array([error is None for error in ran.errors])
        values = quantity_function(keep, ran.record)
        points = timeline.sampled
        kept = {name: values(name)[np.ix_(good, points)] for name in keep.trajectory}
        yield TRAJECTORIES, trajectories_table(numbers[good], timeline.times[points], kept)
    columns = row_columns(keep, ran.record, timeline.times)
    yield RUNS, runs_table(numbers, samples, columns, ran.warnings, ran.errors)


def _driver(job: Job) -> Driver:
    key = job.sweep, threading.get_ident()
    if key not in DRIVERS:
        assert job.fmu is not None
        DRIVERS[key] = Driver(job.plan, job.fmu, tuple(factor.name for factor in job.sampling.factors))
    return DRIVERS[key]


def release(sweep_name: str) -> None:
    """Free the instances of a sweep that is over."""
    for key in [key for key in DRIVERS if key[0] == sweep_name]:
        DRIVERS.pop(key).close()
