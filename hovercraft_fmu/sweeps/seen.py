"""Whether workers on other machines see the place that is seen here: tried before the first run, in both directions."""

import os
import platform
import uuid
from contextlib import suppress
from typing import Any

from .place import Place

SHOWN = 3
"""Workers that are named."""


def check_seen(client: Any, place: Place) -> None:
    """Every worker of dask's client reads a file that is written here, and one of its own is read here.

    Raises OSError: which worker does not see it, and why.
    """
    mark = f".seen-{uuid.uuid4().hex}"
    place.write(mark, mark.encode())
    answers: dict[str, str | Exception] = {}
    try:
        answers = client.run(_answer, place, mark, on_error="return")
        blind = {worker: why for worker, answer in answers.items() if (why := _wrong(place, mark, answer))}
    finally:
        with suppress(OSError):
            place.remove([mark, *(answer for answer in answers.values() if isinstance(answer, str))])
    if blind:
        names = ", ".join(list(blind)[:SHOWN]) + (", ..." if len(blind) > SHOWN else "")
        raise OSError(
            f"output = {place.given!r}: must be a place that every worker sees: {len(blind)} of {len(answers)} do not: "
            f"{names} ({next(iter(blind.values()))}); name a shared folder, or an address as s3://bucket/folder"
        )


def _answer(place: Place, mark: str) -> str:
    """On a worker: the name of the file that it writes, where it reads the one that is there."""
    name = f"{mark}-{platform.node()}-{os.getpid()}"
    place.write(name, place.read(mark))
    return name


def _wrong(place: Place, mark: str, answer: str | Exception) -> str:
    if isinstance(answer, FileNotFoundError):
        return "what is written here is not there"
    if isinstance(answer, Exception):
        return str(answer)
    try:
        return "" if place.read(answer) == mark.encode() else "what it writes is another file here"
    except FileNotFoundError:
        return "what it writes is not here"
