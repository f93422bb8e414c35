"""Makes a sweep: chunk by chunk, here or on a cluster of dask's, into the store."""

import hashlib
import itertools
import logging
import os
import platform
import signal
import tempfile
import threading
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import distributed
import numpy as np
import pyarrow as pa
import scipy
from dask.system import CPU_COUNT
from distributed.comm.addressing import get_address_host_port

from .._version import __version__
from ..building import default_fmu
from ..fmu.interface import HOVERCRAFT
from ..host import SimulationError, read_description
from ..simulation.fmu_run import own_starts
from .batch import run_batch
from .engines import SETTINGS, Driver, Plan
from .quantities import quantity_function, row_columns
from .store import Store, runs_table, trajectories_table
from .study import Samples, Study, read_study
from .timeline import timeline

Tell: TypeAlias = Callable[[int], None]
"""Called with the number of runs that are done, now and then."""

FMU, BATCH = "fmu", "batch"
ENGINES = (FMU, BATCH)
MOST_RUNS = {FMU: 500, BATCH: 8000}
"""In a chunk: what a killed sweep makes anew, at most, for each worker."""
LEAST_CHUNKS = {FMU: 32, BATCH: 2}
"""So that there is work for some workers."""
MOST_VALUES = 2**22
"""That a chunk reads (32 MB): so memory stays bounded where whole trajectories are read."""
MOST_SUBSTEPS = 10**6
"""Of a chunk of runs of the FMU: a second of the Python FMU's."""
CONNECT = 10
"""s, to reach a scheduler."""
LOOPBACK = "127.0.0.1:0"
"""Any free port, of this machine alone."""
AHEAD = 2
"""Chunks a worker that are on their way."""


class Outcome(NamedTuple):
    """What a sweep came to."""

    folder: Path
    runs: int
    new: int
    """Runs that were made now; the others were there."""
    failed: int
    """Of the new ones: rows with an error."""
    warned: int
    """Of the new ones: rows whose column `warnings` is not 0."""
    error: str | None
    """The first of the errors, with the number of its run."""


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


class Made(NamedTuple):
    """A chunk, made."""

    chunk: int
    runs: pa.Table
    trajectories: pa.Table | None


def sweep(
    study: str | Path | Mapping[str, Any] | Study,
    fmu: str | os.PathLike[str] | None = None,
    *,
    engine: str = FMU,
    workers: int | None = None,
    scheduler: str | None = None,
    output: str | os.PathLike[str] | None = None,
    tell: Tell = lambda _: None,
) -> Outcome:
    """Make all runs of a study that are not there yet, and write them to Parquet files; see `load`.

    The bits of a row do not depend on the scheduler, the number of workers or the order. With more than one worker
    they are processes of their own: a script that calls this needs its `if __name__ == "__main__":`.

    Args:
        study: see `read_study`.
        fmu: the file; without it the native FMU in build/, which is built if it is not there.
        engine: fmu, or batch: the compiled kernel, all craft at once, with the bits of the native FMU.
        workers: processes on this machine; by default one a processor. 1: this process.
        scheduler: address of a dask.distributed scheduler, as tcp://10.0.0.1:8786, whose workers have this package.
        output: folder of the results; by default build/sweep/ and the name of the study.
        tell: see `Tell`.

    Raises:
        ValueError: a bad study, FMU or argument; a folder with the results of another sweep.
        OSError: a file that cannot be read or written, a scheduler that cannot be reached.
    """
    chosen = study if isinstance(study, Study) else read_study(study)
    job, about = _job(chosen, fmu, engine)
    if workers is not None and workers < 1:
        raise ValueError(f"workers = {workers}: must be at least 1")
    store = Store(Path(output) if output else Path("build") / "sweep" / chosen.name, about)
    size, done = about["chunk"], store.done
    chunks = range(-(-chosen.runs // size))
    there = sum(len(_numbers(number, size, chosen.runs)) for number in done)
    left = ((number, _numbers(number, size, chosen.runs)) for number in chunks if number not in done)
    todo = ((number, numbers, chosen.samples(numbers)) for number, numbers in left)
    new = failed = warned = 0
    first: tuple[int, str] | None = None
    tell(there)
    if there < chosen.runs:
        with _workers(workers, scheduler) as client:
            for made in _here(job, todo) if client is None else _on(client, job, todo):
                store.write(*made)
                new += made.runs.num_rows
                errors = _errors(made.runs)
                failed += len(errors)
                warned += int(np.count_nonzero(made.runs["warnings"].fill_null(0)))
                first = min([*errors[:1], *([first] if first else [])], default=None)
                tell(there + new)
    error = "run {}: {}".format(*first) if first else None
    return Outcome(store.folder, chosen.runs, new, failed, warned, error)


def _errors(runs: pa.Table) -> list[tuple[int, str]]:
    rows = zip(runs["run"].to_pylist(), runs["error"].to_pylist(), strict=True)
    return [(run, error) for run, error in rows if error is not None]


def _numbers(chunk: int, size: int, runs: int) -> Any:
    return np.arange(chunk * size, min((chunk + 1) * size, runs))


def _job(study: Study, fmu: str | os.PathLike[str] | None, engine: str) -> tuple[Job, dict[str, Any]]:
    """What goes to the workers, and the metadata of the results."""
    if engine not in ENGINES:
        raise ValueError(f"engine = {engine!r}: must be one of {', '.join(ENGINES)}")
    content = None
    if engine == BATCH:
        if fmu is not None:
            raise ValueError(
                f"fmu = {str(fmu)!r}: must not be given with the engine batch, which is the compiled kernel"
            )
    else:
        content, own = _content(study, Path(fmu or default_fmu()))
        study = replace(study, run=study.run.on(own))
    swept = tuple(factor.name for factor in study.factors)
    plan = Plan(study.run, study.keep, timeline(study.run, study.keep))
    about = {
        "study": study.content,
        "engine": engine,
        "fmu_sha256": hashlib.sha256(content).hexdigest() if content else None,
        "hovercraft_fmu": __version__,
        "runs": study.runs,
        "chunk": _chunk(plan, study.runs, engine),
        "name": study.name,
        "swept": list(swept),
        "kept": list(study.keep.columns),
        "versions": {
            "python": platform.python_version(), "numpy": np.__version__, "scipy": scipy.__version__,
            "pyarrow": pa.__version__, "dask": metadata.version("dask"),
        },
        "machine": f"{platform.system()} {platform.machine()}",
    }  # fmt: skip
    return Job(uuid.uuid4().hex, __version__, plan, swept, content), about


def _chunk(plan: Plan, runs: int, engine: str) -> int:
    """Runs in a chunk. It follows from the study alone, so that a sweep can go on with other workers."""
    values = len(plan.timeline.times) * max(1, len(plan.keep.read))
    most = min(MOST_RUNS[engine], -(-runs // LEAST_CHUNKS[engine]), MOST_VALUES // values)
    if engine == FMU:
        substeps = (plan.run.stop_time - plan.run.start_time) / float(plan.run.value("step_size"))
        most = min(most, int(MOST_SUBSTEPS / substeps))
    return max(1, most)


def _content(study: Study, path: Path) -> tuple[bytes, dict[str, float | int]]:
    """The FMU as it is now, checked, and the start values that are its own."""
    description = read_description(path, model=HOVERCRAFT.name)
    has = {variable.name for variable in description.modelVariables}
    for name in (*study.run.start_values, *(factor.name for factor in study.factors), *study.keep.read, *SETTINGS):
        if name not in has:
            raise ValueError(f"{path}: must have the variable {name}")
    return path.read_bytes(), own_starts(description)


# ---- on a worker

DRIVERS: dict[tuple[str, int], Driver] = {}
"""(sweep, thread) -> its instance: it is used again from chunk to chunk."""


def make_chunk(job: Job, chunk: int, numbers: Any, samples: Samples) -> Made:
    """Make the runs of a chunk. Raises ValueError on a worker with another version of this package."""
    if job.version != __version__:
        raise ValueError(f"a worker has hovercraft-fmu {__version__}: must be {job.version}, that of the sweep")
    plan = job.plan
    ran = run_batch(plan, samples) if job.fmu is None else _driver(job).run(samples)
    columns = row_columns(plan.keep, ran.record, plan.timeline.times)
    runs = runs_table(numbers, samples, columns, ran.warnings, ran.errors)
    if not plan.keep.trajectory:
        return Made(chunk, runs, None)
    good = np.array([error is None for error in ran.errors])
    values = quantity_function(plan.keep, ran.record)
    points = plan.timeline.sampled
    kept = {name: values(name)[np.ix_(good, points)] for name in plan.keep.trajectory}
    return Made(chunk, runs, trajectories_table(numbers[good], plan.timeline.times[points], kept))


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


# ---- where the workers are

Todo: TypeAlias = Iterable[tuple[int, Any, Samples]]


@contextmanager
def _workers(workers: int | None, scheduler: str | None) -> Iterator[Any]:
    """A client of dask's, or None: this process."""
    if scheduler is None and (workers or CPU_COUNT) == 1:
        yield None
        return
    if scheduler is not None:
        if workers is not None:
            raise ValueError(f"workers = {workers}: must not be given with a scheduler, which has its own")
        with _connected(scheduler) as client:
            if not client.nthreads():
                raise ValueError(f"scheduler = {scheduler!r}: must have a worker")
            yield client
        return
    with (
        # a worker that is ended in the middle of a chunk leaves the FMU's files: they go with this folder
        tempfile.TemporaryDirectory(prefix="hovercraft_sweep_", ignore_cleanup_errors=True) as folder,
        _local_cluster(workers or CPU_COUNT, folder) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        yield client


def _connected(scheduler: str) -> Any:
    try:
        get_address_host_port(scheduler)  # a client that was made with a bad one lingers, and then complains
    except ValueError as error:
        raise ValueError(f"scheduler = {scheduler!r}: must be an address as tcp://10.0.0.1:8786; {error}") from error
    return distributed.Client(scheduler, set_as_default=False, timeout=CONNECT)


def _local_cluster(workers: int, folder: str) -> Any:
    """Processes on this machine, which leave a Ctrl-C to this one: what is ignored when a process starts stays so."""
    here = threading.current_thread() is threading.main_thread()
    before = signal.signal(signal.SIGINT, signal.SIG_IGN) if here else None
    try:
        return distributed.LocalCluster(
            n_workers=workers, threads_per_worker=1, processes=True, host="127.0.0.1", memory_limit=None,
            # dask's pages cannot be switched off, and without an address they are on every network
            worker_dashboard_address=LOOPBACK, scheduler_kwargs={"dashboard": False, "dashboard_address": LOOPBACK},
            silence_logs=logging.CRITICAL, local_directory=folder, env={"TMPDIR": folder},
        )  # fmt: skip
    finally:
        if here:
            signal.signal(signal.SIGINT, before)


def _here(job: Job, todo: Todo) -> Iterator[Made]:
    try:
        for part in todo:
            yield make_chunk(job, *part)
    finally:
        release(job.sweep)


def _on(client: Any, job: Job, todo: Todo) -> Iterator[Made]:
    """Chunks as they are made, a few on their way for each worker: memory here and there stays bounded."""
    everywhere = client.scatter(job, broadcast=True)
    parts = iter(todo)

    def submitted(count: int) -> list[Any]:
        few = itertools.islice(parts, count)
        return [client.submit(make_chunk, everywhere, *part, pure=False) for part in few]

    ahead = AHEAD * max(1, sum(client.nthreads().values()))
    waiting = distributed.as_completed(submitted(ahead), loop=client.loop)
    try:
        for future in waiting:
            yield future.result()
            future.release()
            for new in submitted(1):
                waiting.add(new)
    except (distributed.KilledWorker, distributed.client.FutureCancelledError) as error:
        raise SimulationError(f"the workers are gone: {error}") from error
    finally:
        client.cancel(list(waiting.futures))
        client.run(release, job.sweep)
