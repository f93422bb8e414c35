"""Makes a sweep: chunk by chunk, here or on a cluster of dask's, into the store."""

import hashlib
import os
import platform
import re
import uuid
from collections.abc import Callable, Generator, Mapping
from contextlib import closing
from dataclasses import replace
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from .._version import __version__
from ..building import default_fmu
from ..fmu.interface import HOVERCRAFT
from ..fmu.near_names import explains_keywords, must_be_one_of
from ..host import read_description
from ..model.error_estimate import ON
from ..simulation.fmu_run import own_starts
from .engines import SETTINGS, Plan
from .store import RUNS, TRAJECTORIES, Store, store
from .study import Study, read_study
from .timeline import timeline
from .work import Job, Made
from .workers import Todo, made_beside, made_here

Tell: TypeAlias = Callable[[int], None]
"""Called with the number of runs that are done, now and then."""

FMU, BATCH = "fmu", "batch"
ENGINES = (FMU, BATCH)
MOST_RUNS = {FMU: 500, BATCH: 8000}
"""In a chunk: what a killed sweep makes anew, at most, for each worker."""
LEAST_CHUNKS = {FMU: 32, BATCH: 2}
"""So that there is work for some workers."""
FOLDER_NAME = re.compile(r"[A-Za-z0-9_-]+(\.[A-Za-z0-9_-]+)*")
MOST_VALUES = 2**22
"""That a chunk reads (32 MB): so memory stays bounded where whole trajectories are read."""
MOST_SUBSTEPS = 10**6
"""Of a chunk of runs of the FMU: a second of the Python FMU's."""


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
    spoiled: tuple[str, ...]
    """Files that were damaged, misplaced or of another sweep, and why: set aside and made anew."""


@explains_keywords
def sweep(
    study: str | Path | Mapping[str, Any] | Study,
    fmu: str | os.PathLike[str] | None = None,
    *,
    engine: str = FMU,
    workers: int | None = None,
    scheduler: str | None = None,
    tls: tuple[Path | None, Path | None, Path | None] = (None, None, None),
    output: str | os.PathLike[str] | None = None,
    overwrite: bool = False,
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
        tls: PEM files to reach a scheduler by tls://: the authority's certificate, one's own, its key.
        output: folder of the results; by default build/sweep/ and the name of the study.
        overwrite: delete the results that are there, of this or another sweep, before.
        tell: see `Tell`.

    Raises:
        ValueError: a bad study, FMU or argument; a folder with the results of another sweep, or one at work in it.
        OSError: a file that cannot be read or written, a scheduler that cannot be reached.
    """
    chosen = study if isinstance(study, Study) else read_study(study)
    job, about = _job(chosen, fmu, engine)
    if workers is not None and workers < 1:
        raise ValueError(f"workers = {workers}: must be at least 1")
    with store(Path(output) if output else default_folder(chosen.name), about, overwrite) as there:
        return _made(chosen, there, job, partial(_chunks, workers=workers, scheduler=scheduler, tls=tls), tell)


def _made(
    study: Study, there: Store, job: Job, make: Callable[..., Generator[Made, None, None]], tell: Tell
) -> Outcome:
    size, done = job.about["chunk"], there.done
    chunks = range(-(-study.runs // size))
    had = sum(len(_numbers(number, size, study.runs)) for number in done)
    left = ((number, _numbers(number, size, study.runs)) for number in chunks if number not in done)
    todo = ((number, numbers, study.samples(numbers)) for number, numbers in left)
    new = failed = warned = 0
    first: tuple[int, str] | None = None
    tell(had)
    if had < study.runs:
        with closing(make(job, todo)) as chunks_made:
            for made in chunks_made:
                there.write(made.chunk, made.files)
                new, failed, warned = new + made.runs, failed + made.failed, warned + made.warned
                first = min(filter(None, (first, made.error)), default=None)
                tell(had + new)
    error = "run {}: {}".format(*first) if first else None
    return Outcome(there.folder, study.runs, new, failed, warned, error, tuple(there.spoiled))


def default_folder(name: str) -> Path:
    """Of a study's results. Raises ValueError where its name is none of a folder that every system has."""
    if not FOLDER_NAME.fullmatch(name):
        raise ValueError(
            f"study = {name!r}: must be letters, digits, _, - and dots between them to name the folder of the results; "
            "or name one as output"
        )
    return Path("build") / "sweep" / name


def _chunks(
    job: Job, todo: Todo, workers: int | None, scheduler: str | None, tls: tuple[Path | None, ...]
) -> Generator[Made, None, None]:
    """Made where they are to be made."""
    if scheduler is None:
        if any(tls):
            raise ValueError("tls_ca, tls_cert, tls_key: must be given with a scheduler: workers here need no port")
        count = workers or _processors()
        return made_here(job, todo) if count == 1 else made_beside(job, todo, count)
    if workers is not None:
        raise ValueError(f"workers = {workers}: must not be given with a scheduler, which has its own")
    from .cluster import Scheduler, made_on

    return made_on(Scheduler(scheduler, *tls), job, todo)


def _processors() -> int:
    """That this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _numbers(chunk: int, size: int, runs: int) -> Any:
    return np.arange(chunk * size, min((chunk + 1) * size, runs))


def _job(study: Study, fmu: str | os.PathLike[str] | None, engine: str) -> tuple[Job, dict[str, Any]]:
    """What goes to the workers, and the metadata of the results."""
    if engine not in ENGINES:
        raise ValueError(must_be_one_of("engine", engine, ENGINES))
    content = None
    if engine == BATCH:
        if fmu is not None:
            raise ValueError(
                f"fmu = {str(fmu)!r}: must not be given with the engine batch, which is the compiled kernel"
            )
        if study.run.value("error_estimate") == ON or any(each.name == "error_estimate" for each in study.factors):
            raise ValueError("error_estimate: must be off with the engine batch, which tells no error; take engine fmu")
    else:
        content, own = _content(study, Path(fmu or default_fmu()))
        study = replace(study, run=study.run.on(own))
    swept = tuple(factor.name for factor in study.factors)
    plan = Plan(study.run, study.keep, timeline(study.run, study.keep))
    about = {
        "study": study.content,
        "study_sha256": hashlib.sha256(study.content.encode()).hexdigest(),
        "engine": engine,
        "fmu_sha256": hashlib.sha256(content).hexdigest() if content else None,
        "hovercraft_fmu": __version__,
        "runs": study.runs,
        "chunk": _chunk(plan, study.runs, engine),
        "name": study.name,
        "swept": list(swept),
        "kept": list(study.keep.columns),
        "files": [RUNS, TRAJECTORIES] if study.keep.trajectory else [RUNS],
        "versions": {
            "python": platform.python_version(), "numpy": metadata.version("numpy"), "scipy": metadata.version("scipy"),
            "pyarrow": metadata.version("pyarrow"), "dask": metadata.version("dask"),
        },
        "machine": f"{platform.system()} {platform.machine()}",
    }  # fmt: skip
    return Job(uuid.uuid4().hex, __version__, plan, swept, content, about), about


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
