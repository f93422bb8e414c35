"""Chunks are made on a cluster of dask's."""

from collections.abc import Generator
from itertools import islice
from typing import Any

import distributed
from distributed.comm.addressing import get_address_host_port

from ..host import SimulationError
from .work import Job, Made, make_chunk, release
from .workers import Todo

CONNECT = 10
"""s, to reach a scheduler."""
AHEAD = 2
"""Chunks a worker that are on their way: memory here and there stays bounded."""


def made_on(scheduler: str, job: Job, todo: Todo) -> Generator[Made, None, None]:
    """As they are made.

    Raises:
        ValueError: what is no address; a scheduler without a worker.
        OSError: a scheduler that cannot be reached.
        SimulationError: the workers are gone.
    """
    with _connected(scheduler) as client:
        if not client.nthreads():
            raise ValueError(f"scheduler = {scheduler!r}: must have a worker")
        yield from _on(client, job, todo)


def _connected(scheduler: str) -> Any:
    try:
        get_address_host_port(scheduler)  # a client that was made with a bad one lingers, and then complains
    except ValueError as error:
        raise ValueError(f"scheduler = {scheduler!r}: must be an address as tcp://10.0.0.1:8786; {error}") from error
    return distributed.Client(scheduler, set_as_default=False, timeout=CONNECT)


def _on(client: Any, job: Job, todo: Todo) -> Generator[Made, None, None]:
    everywhere = client.scatter(job, broadcast=True)
    parts = iter(todo)

    def submitted(count: int) -> list[Any]:
        return [client.submit(make_chunk, everywhere, *part, pure=False) for part in islice(parts, count)]

    waiting = distributed.as_completed(submitted(AHEAD * sum(client.nthreads().values())), loop=client.loop)
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
