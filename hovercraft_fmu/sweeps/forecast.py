"""What a sweep would come to, before anything is made: runs, chunks, bytes, time."""

import os
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from statistics import fmean
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..building import fmu_to_try
from ..fmu.near_names import explains_keywords
from ..simulation.cost import counted
from .engines import SETTINGS, settings_of
from .place import place_of
from .runner import FMU, default_folder, job_of, part_of, processors
from .store import packed
from .study import Study, read_study
from .work import Job, release, run, tables

GROWTH = 8
"""So many times more runs are measured at once, until they take so much longer than one alone or are a chunk."""
LONG_ENOUGH = 0.25
"""s"""
LOOKED_AT = 4096
"""Runs whose work is counted, of all of them."""


class Estimate(NamedTuple):
    """What a sweep would come to."""

    runs: int
    """Of the part that was asked for."""
    chunks: int
    bytes: int
    """Of the files."""
    workers: int
    seconds: float
    """Until all is made by so many workers, once they have started: each as fast as one process here, now."""
    seconds_of_one: float
    """The same of one worker."""
    measured: int
    """Runs that were made at once to learn that, and thrown away."""


@explains_keywords
def estimate(
    study: str | Path | Mapping[str, Any] | Study,
    fmu: str | os.PathLike[str] | None = None,
    *,
    engine: str = FMU,
    workers: int | None = None,
    output: str | os.PathLike[str] | None = None,
    part: str | None = None,
) -> Estimate:
    """What `sweep` would come to with the same arguments, as if nothing were there yet. Nothing is written.

    Some runs, drawn at random, are made and packed here. Where sub-step or method is swept, the work of others is
    known by the evaluations of the loads, which are counted (of the adaptive method it is not).

    Raises as `sweep` does before the first run.
    """
    chosen = study if isinstance(study, Study) else read_study(study)
    chunks_of, place = part_of(part), place_of(output or default_folder(chosen.name))
    if workers is not None and workers < 1:
        raise ValueError(f"workers = {workers}: must be at least 1")
    with ExitStack() as stack:
        if fmu is None and engine == FMU:
            fmu = stack.enter_context(fmu_to_try())
        job = job_of(chosen, fmu, engine, place)
        size, chunks = int(job.about["chunk"]), range(chunks_of.k - 1, job.chunks, chunks_of.n)
        runs = sum(min(size, chosen.runs - chunk * size) for chunk in chunks)
        try:
            chunk, each, measured = _measured(job, size)
        finally:
            release(job.sweep)
    seconds, content = (len(chunks) * alone + runs * more for alone, more in zip(chunk, each, strict=True))
    count = workers or processors()
    of_all = -(-len(chunks) // count) * seconds / max(1, len(chunks))
    return Estimate(runs, len(chunks), round(content), count, of_all, seconds, measured)


def _measured(job: Job, size: int) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
    """Of a chunk, whatever its runs, and of each run: the seconds, the bytes; and how many runs tell it."""
    dice, every = np.random.default_rng(0), job.sampling.runs
    _made(job, dice.integers(every, size=1))  # it loads what is loaded once
    numbers = dice.integers(every, size=1)
    one = many = _made(job, numbers)
    while len(numbers) < size and many[0] - one[0] < LONG_ENOUGH:
        numbers = dice.integers(every, size=min(size, GROWTH * len(numbers)))
        many = _made(job, numbers)
    count = len(numbers)
    each = np.clip((many - one) / max(1, count - 1), 0.0, many / count)
    alone = many - count * each
    each[0] *= _work(job, dice.integers(every, size=LOOKED_AT)) / _work(job, numbers)
    return alone, each, count


def _made(job: Job, numbers: NDArray[np.int64]) -> NDArray[np.float64]:
    """The seconds and the bytes of a chunk of these runs."""
    begun = perf_counter()
    samples = job.sampling.samples(numbers)
    ran = run(job, samples)
    content = sum(len(packed(table, job.about, what, 0)) for what, table in tables(job, numbers, samples, ran))
    return np.array([perf_counter() - begun, content])


def _work(job: Job, numbers: NDArray[np.int64]) -> float:
    """Evaluations of the loads in a run, the mean of these; 1 where all runs have the same."""
    samples, common = job.sampling.samples(numbers), job.plan.run
    if not {"step_size", "integrator"} & samples.keys():
        return 1.0
    values = [np.broadcast_to(samples.get(name, common.value(name)), len(numbers)).tolist() for name in SETTINGS]
    settings = [settings_of(dict(zip(SETTINGS, each, strict=True))) for each in zip(*values, strict=True)]
    duration = common.stop_time - common.start_time
    return fmean(counted(each.integrator, duration / each.step_size) for each in settings if each.step_size > 0.0)
