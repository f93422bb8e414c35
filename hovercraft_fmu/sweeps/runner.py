"""Makes a sweep: chunk by chunk, here or on a cluster of dask's, into the store."""

import hashlib
import os
import platform
import re
import uuid
from collections.abc import Callable, Generator, Iterable, Mapping
from contextlib import closing
from dataclasses import replace
from functools import partial
from importlib import metadata
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from .._version import __version__
from ..building import default_fmu
from ..building.structure import is_python
from ..fmu.interface import HOVERCRAFT
from ..fmu.near_names import explains_keywords, must_be_one_of
from ..host import read_description
from ..model.error_estimate import ON
from ..simulation.fmu_run import own_starts
from .chunks import BATCH_COSTS, NATIVE_COSTS, PYTHON_COSTS, Costs, chunk_size
from .engines import SETTINGS, Plan
from .place import Place, place_of
from .store import RUNS, TRAJECTORIES, WHOLE, Part, Store, store
from .study import Study, read_study
from .timeline import timeline
from .work import Job, Made
from .workers import Todo, made_beside, made_here

Tell: TypeAlias = Callable[[int], None]
"""Called with the number of runs that are done, now and then."""

FMU, BATCH = "fmu", "batch"
ENGINES = (FMU, BATCH)
LEAST_CHUNKS = {FMU: 32, BATCH: 2}
"""So that there is work for some workers."""
FOLDER_NAME = re.compile(r"[A-Za-z0-9_-]+(\.[A-Za-z0-9_-]+)*")


class Outcome(NamedTuple):
    """What a sweep came to."""

    folder: Path | str
    """Or the address."""
    runs: int
    """Of the part that was asked for."""
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
    missing: int
    """Runs of the study that are not there yet: of other parts."""


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
    part: str | None = None,
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
        output: folder of the results, or an address as s3://bucket/folder of a store that fsspec knows; by default
            build/sweep/ and the name of the study. Workers write there themselves.
        part: k/n, as 2/8: make the k-th of n parts alone; each may be made anywhere, at any time, into the same output,
            and all together are the sweep.
        overwrite: delete the results that are there, of this or another sweep, before.
        tell: see `Tell`.

    Raises:
        ValueError: a bad study, FMU or argument; an output with the results of another sweep, or one at work in it.
        OSError: a file that cannot be read or written, a scheduler that cannot be reached, a worker that does not see
            the output.
    """
    chosen = study if isinstance(study, Study) else read_study(study)
    chunks_of = part_of(part)
    place = place_of(output or default_folder(chosen.name))
    job = job_of(chosen, fmu, engine, place)
    if workers is not None and workers < 1:
        raise ValueError(f"workers = {workers}: must be at least 1")
    with store(place, job.about, chunks_of, overwrite) as there:
        return _made(there, job, chunks_of, partial(_chunks, workers=workers, scheduler=scheduler, tls=tls), tell)


def part_of(part: str | None) -> Part:
    """What k/n means; None: the whole. Raises ValueError."""
    if part is None:
        return WHOLE
    match = re.fullmatch(r"(\d{1,9})/(\d{1,9})", part, re.ASCII)
    if not match or not 1 <= int(match[1]) <= int(match[2]):
        raise ValueError(f"part = {part!r}: must be k/n with k from 1 to n, as 2/8")
    return Part(int(match[1]), int(match[2]))


def _made(there: Store, job: Job, part: Part, make: Callable[..., Generator[Made, None, None]], tell: Tell) -> Outcome:
    def count(chunks: Iterable[int]) -> int:
        return sum(map(job.count, chunks))

    mine = range(part.k - 1, job.chunks, part.n)
    runs, had = count(mine), count(chunk for chunk in there.done if chunk in mine)
    new = failed = warned = 0
    first: tuple[int, str] | None = None
    tell(had)
    if had < runs:
        with closing(make(job, (chunk for chunk in mine if chunk not in there.done))) as chunks_made:
            for made in chunks_made:
                new, failed, warned = new + made.runs, failed + made.failed, warned + made.warned
                first = min(filter(None, (first, made.error)), default=None)
                tell(had + new)
    error = "run {}: {}".format(*first) if first else None
    missing = count(there.missing(chunk for chunk in range(job.chunks) if chunk not in part))
    folder = Path(there.place.given) if there.place.folder else there.place.given
    return Outcome(folder, runs, new, failed, warned, error, tuple(there.spoiled), missing)


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
        count = workers or processors()
        return made_here(job, todo) if count == 1 else made_beside(job, todo, count)
    if workers is not None:
        raise ValueError(f"workers = {workers}: must not be given with a scheduler, which has its own")
    from .cluster import Scheduler, made_on

    return made_on(Scheduler(scheduler, *tls), job, todo)


def processors() -> int:
    """That this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def job_of(study: Study, fmu: str | os.PathLike[str] | None, engine: str, place: Place) -> Job:
    """What goes to the workers."""
    if engine not in ENGINES:
        raise ValueError(must_be_one_of("engine", engine, ENGINES))
    content, path = None, None
    if engine == BATCH:
        if fmu is not None:
            raise ValueError(
                f"fmu = {str(fmu)!r}: must not be given with the engine batch, which is the compiled kernel"
            )
        if study.run.value("error_estimate") == ON or any(each.name == "error_estimate" for each in study.factors):
            raise ValueError("error_estimate: must be off with the engine batch, which tells no error; take engine fmu")
    else:
        path = Path(fmu or default_fmu())
        content, own = _content(study, path)
        study = replace(study, run=study.run.on(own))
    plan = Plan(study.run, study.keep, timeline(study.run, study.keep))
    about = {
        "study": study.content,
        "study_sha256": hashlib.sha256(study.content.encode()).hexdigest(),
        "engine": engine,
        "fmu_sha256": hashlib.sha256(content).hexdigest() if content else None,
        "hovercraft_fmu": __version__,
        "runs": study.runs,
        "chunk": chunk_size(plan, study.sampling, costs_of(path), LEAST_CHUNKS[engine]),
        "name": study.name,
        "swept": [factor.name for factor in study.factors],
        "kept": list(study.keep.columns),
        "files": [RUNS, TRAJECTORIES] if study.keep.trajectory else [RUNS],
        "versions": {
            "python": platform.python_version(), "numpy": metadata.version("numpy"),
            "pyarrow": metadata.version("pyarrow"), "dask": metadata.version("dask"),
        },
        "machine": f"{platform.system()} {platform.machine()}",
    }  # fmt: skip
    return Job(uuid.uuid4().hex, __version__, plan, study.sampling, content, about, place)


def costs_of(fmu: Path | None) -> Costs:
    """What its runs cost; None: the batch."""
    if fmu is None:
        return BATCH_COSTS
    return PYTHON_COSTS if is_python(fmu) else NATIVE_COSTS


def _content(study: Study, path: Path) -> tuple[bytes, dict[str, float | int]]:
    """The FMU as it is now, checked, and the start values that are its own."""
    description = read_description(path, model=HOVERCRAFT.name)
    has = {variable.name for variable in description.modelVariables}
    for name in (*study.run.start_values, *(factor.name for factor in study.factors), *study.keep.read, *SETTINGS):
        if name not in has:
            raise ValueError(f"{path}: must have the variable {name}")
    return path.read_bytes(), own_starts(description)
