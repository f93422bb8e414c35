"""Chunks are made on a cluster of dask's."""

import logging
import ssl
from collections.abc import Generator
from itertools import islice
from pathlib import Path
from time import sleep
from typing import Any, NamedTuple

import distributed
from distributed.comm.addressing import get_address_host_port
from distributed.security import Security
from distributed.utils import silence_logging_cmgr

from ..host import SimulationError
from .seen import check_seen
from .work import Job, Made, make_chunk, release
from .workers import Todo

CONNECT = 10
"""s, to reach a scheduler, and for its first worker to be there."""
AHEAD = 2
"""Chunks a worker that are on their way: memory here and there stays bounded."""
PAUSE = 0.1
"""s, in which chunks gather: the more are handled at once, the less each takes. Workers have the next one meanwhile."""


class Scheduler(NamedTuple):
    """Where it is, and what it takes to be let in; without the files whoever reaches it can run code there."""

    address: str
    ca: Path | None = None
    """PEM: who has signed the scheduler's certificate"""
    cert: Path | None = None
    """PEM: one's own certificate"""
    key: Path | None = None
    """PEM: its key"""


def made_on(scheduler: Scheduler, job: Job, todo: Todo) -> Generator[Made, None, None]:
    """As they are made.

    Raises:
        ValueError: what is no address; files for TLS that do not fit; a scheduler without a worker.
        OSError: a scheduler that cannot be reached, a worker that does not see the place.
        SimulationError: the workers are gone, or the scheduler is.
    """
    with silence_logging_cmgr(logging.CRITICAL), _connected(scheduler) as client:
        try:
            client.wait_for_workers(1, timeout=CONNECT)
        except distributed.TimeoutError as error:
            raise ValueError(f"scheduler = {scheduler.address!r}: must have a worker") from error
        check_seen(client, job.place)
        yield from _on(client, job, todo)


def _connected(scheduler: Scheduler) -> Any:
    address = scheduler.address
    try:
        get_address_host_port(address)  # a client that was made with a bad one lingers, and then complains
    except ValueError as error:
        raise ValueError(f"scheduler = {address!r}: must be an address as tcp://10.0.0.1:8786; {error}") from error
    security = _security(scheduler)
    try:
        return distributed.Client(address, set_as_default=False, timeout=CONNECT, security=security)
    except OSError as error:
        let_in = ", and let in who has this certificate" if security else ""
        raise OSError(f"scheduler = {address!r}: must be there{let_in}; {error}") from error


def _security(scheduler: Scheduler) -> Security | None:
    files = {"tls_ca_file": scheduler.ca, "tls_client_cert": scheduler.cert, "tls_client_key": scheduler.key}
    given = [path for path in files.values() if path]
    encrypted = scheduler.address.startswith("tls://")
    if not given and not encrypted:
        return None
    if len(given) < len(files):
        raise ValueError("tls_ca, tls_cert, tls_key: must be given all three for tls://, or none")
    if not encrypted:
        raise ValueError(f"scheduler = {scheduler.address!r}: must be as tls://10.0.0.1:8786 to be encrypted")
    for path in given:
        path.read_bytes()  # it says which one cannot be read
    security = Security(require_encryption=True, **{name: str(path) for name, path in files.items()})
    try:
        security.get_connection_args("client")
    except ssl.SSLError as error:
        raise ValueError(f"{', '.join(map(str, given))}: must be PEM files of one identity; {error}") from error
    return security


def _on(client: Any, job: Job, todo: Todo) -> Generator[Made, None, None]:
    # as a task, not scattered: a worker passes it on, and where all that have it are killed it is sent again
    everywhere = client.submit(_sent, job, pure=False)
    chunks = iter(todo)

    def submitted(count: int) -> list[Any]:
        made: list[Any] = client.map(_made, list(islice(chunks, count)), job=everywhere, pure=False)
        return made

    waiting = distributed.as_completed(submitted(AHEAD * sum(client.nthreads().values())), loop=client.loop)
    try:
        for finished in waiting.batches():
            waiting.update(submitted(len(finished)))
            yield from client.gather(finished)
            sleep(PAUSE)
    except distributed.KilledWorker as error:
        raise SimulationError(f"the workers are gone: {error}") from error
    except distributed.client.FutureCancelledError as error:
        raise SimulationError(
            "the scheduler is gone, or was restarted: what was made is there; the same command goes on"
        ) from error
    finally:
        if client.status == "running":
            client.cancel(list(waiting.futures))
            client.run(release, job.sweep, on_error="ignore")


def _sent(job: Job) -> Job:
    return job


def _made(chunk: int, job: Job) -> Made:
    return make_chunk(job, chunk)
