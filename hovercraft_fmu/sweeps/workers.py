"""Where chunks are made: in this process, or in others of this machine."""

import signal
import tempfile
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager
from itertools import islice
from multiprocessing import get_context, resource_tracker
from multiprocessing.connection import Connection, wait
from typing import TypeAlias

from ..host import SimulationError
from ..stopping import held
from ..whole import temporary_folder
from .place import Place
from .work import Job, Made, make_chunk, release

Todo: TypeAlias = Iterable[int]
"""Numbers of chunks."""


def made_here(job: Job, todo: Todo) -> Generator[Made, None, None]:
    """In this process."""
    try:
        for chunk in todo:
            yield make_chunk(job, chunk)
    finally:
        release(job.sweep)


def made_beside(job: Job, todo: Todo, workers: int) -> Generator[Made, None, None]:
    """In processes of their own, as they are made; each has one chunk.

    Raises SimulationError where a process ended.
    """
    chunks = iter(todo)
    first = list(islice(chunks, workers))
    with _processes(len(first), job.place) as ends:
        try:
            for end, chunk in zip(ends, first, strict=True):
                end.send(job)
                end.send(chunk)
            yield from _received(list(ends), chunks)
        except (EOFError, ConnectionError) as error:
            raise SimulationError("a worker is gone: its process ended") from error


def _received(busy: list[Connection], chunks: Iterator[int]) -> Iterator[Made]:
    """What the workers send, who have a chunk each, and then the next one."""
    while busy:
        ready = wait(busy)
        for end in [each for each in busy if each in ready]:
            made = end.recv()
            following = next(chunks, None)
            if following is None:
                busy.remove(end)
            else:
                end.send(following)
            if isinstance(made, Exception):
                raise made
            yield made


@contextmanager
def _processes(count: int, place: Place) -> Iterator[list[Connection]]:
    """Workers, each at the other end of one of these; they end with the context, or with this process."""
    context = get_context("spawn")
    # a worker that is ended in the middle of a chunk leaves the FMU's files: they go with this folder
    with temporary_folder() as folder:
        pairs = [context.Pipe() for _ in range(count)]
        processes = [context.Process(target=_work, args=(there, folder), daemon=True) for _, there in pairs]
        ends = [here for here, _ in pairs]
        try:
            with held(), _deaf():
                for process in processes:
                    process.start()
            for _, there in pairs:
                there.close()
            yield ends
        except BaseException:
            for process in processes:
                if process.pid:
                    process.kill()
                    process.join()
                    place.clear_up(process.pid)
            raise
        finally:
            for end in ends:
                end.close()
            for process in processes:
                if process.pid:
                    process.join()


@contextmanager
def _deaf() -> Iterator[None]:
    """Processes that are started here take no Ctrl-C: it is for this one, which ends them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # which would undo it
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _work(end: Connection, folder: str) -> None:
    """A worker: it is sent a job and then chunk after chunk, until the other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    tempfile.tempdir = folder
    try:
        job = end.recv()
        try:
            while True:
                end.send(_made(job, end.recv()))
        finally:
            release(job.sweep)
    except (EOFError, OSError):
        pass


def _made(job: Job, chunk: int) -> Made | Exception:
    try:
        return make_chunk(job, chunk)
    except Exception as error:
        return error
