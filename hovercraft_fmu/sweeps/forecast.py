"""What a sweep would come to, before anything is made: runs, chunks, bytes, time."""

import os
from collections import Counter
from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..building import fmu_to_try
from ..fmu.near_names import explains_keywords
from .chunks import Costs, mean_seconds, seconds
from .engines import SETTINGS, settings_of
from .place import place_of
from .quantities import Samples
from .runner import FMU, costs_of, default_folder, job_of, part_of, processors
from .store import packed
from .study import Study, read_study
from .work import Job, release, run, tables

GROWTH = 8
"""So many times more runs are measured at once, until they take so much longer than one alone or are a chunk."""
LONG_ENOUGH = 0.25
"""s"""


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

    Some runs, drawn at random, are made and packed here. What the others take follows from the work that is counted,
    of sub-steps and communication steps: sub-step and method may be swept.

    Raises as `sweep` does before the first run.
    """
    chosen = study if isinstance(study, Study) else read_study(study)
    chunks_of, place = part_of(part), place_of(output or default_folder(chosen.name))
    if workers is not None and workers < 1:
        raise ValueError(f"workers = {workers}: must be at least 1")
    with ExitStack() as stack:
        if fmu is None and engine == FMU:
            fmu = stack.enter_context(fmu_to_try())
        job, costs = job_of(chosen, fmu, engine, place), costs_of(Path(fmu) if fmu else None)
        try:
            chunk, run, measured = _measured(job, costs)
        finally:
            release(job.sweep)
    size, chunks = int(job.about["chunk"]), range(chunks_of.k - 1, job.chunks, chunks_of.n)
    runs = sum(min(size, chosen.runs - chunk * size) for chunk in chunks)
    content = len(chunks) * chunk.content + runs * run.content
    alone = len(chunks) * chunk.seconds + runs * run.seconds
    count = workers or processors()
    rounds = -(-len(chunks) // count)
    return Estimate(runs, len(chunks), round(content), count, alone * rounds / max(1, len(chunks)), alone, measured)


class _Taken(NamedTuple):
    """By some runs."""

    seconds: float
    content: float
    """Bytes"""
    counted: float
    """s, that they should take; see chunks.py"""


def _measured(job: Job, costs: Costs) -> tuple[_Taken, _Taken, int]:
    """What a chunk takes whatever its runs, and each run of the study; and on how many runs that was measured."""
    dice, every, size = np.random.default_rng(0), job.sampling.runs, int(job.about["chunk"])

    def taken(count: int) -> _Taken:
        return _taken(job, costs, dice.integers(every, size=count))

    taken(1)  # it loads what is loaded once
    one, count = taken(1), 1
    many = one
    while count < size and many.seconds - one.seconds < LONG_ENOUGH:
        count = min(size, GROWTH * count)
        many = taken(count)
    factor = _slope(one.counted, one.seconds, many.counted, many.seconds)
    content = _slope(1, one.content, count, many.content)
    chunk = _Taken(many.seconds - factor * many.counted, many.content - content * count, 0.0)
    counted = mean_seconds(job.plan, job.sampling, costs)
    return chunk, _Taken(factor * counted, content, counted), count


def _slope(x: float, y: float, more_x: float, more_y: float) -> float:
    """So that neither it nor what is left at 0 is negative."""
    through_zero = more_y / more_x
    return min(max((more_y - y) / (more_x - x), 0.0), through_zero) if more_x > x else through_zero


def _taken(job: Job, costs: Costs, numbers: NDArray[np.int64]) -> _Taken:
    begun = perf_counter()
    samples = job.sampling.samples(numbers)
    ran = run(job, samples)
    content = sum(len(packed(table, job.about, what, 0)) for what, table in tables(job, numbers, samples, ran))
    return _Taken(perf_counter() - begun, content, _counted(job, costs, samples, len(numbers)))


def _counted(job: Job, costs: Costs, samples: Samples, count: int) -> float:
    values = [np.broadcast_to(samples.get(name, job.plan.run.value(name)), count).tolist() for name in SETTINGS]
    settings = Counter(
        each for each in zip(*values, strict=True) if each[0] > 0.0
    )  # without a sub-step there is no run
    return sum(
        times * seconds(job.plan, settings_of(dict(zip(SETTINGS, each, strict=True))), costs)
        for each, times in settings.items()
    )
