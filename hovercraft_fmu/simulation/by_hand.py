"""An instance as it was had before `host`: for what does not use that yet."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from ..host import Fmu


@contextmanager
def instantiated(
    path: Path, _description: Any, messages: list[str], exchange: bool = False
) -> Iterator[tuple[str, Any]]:
    """The folder an FMU is extracted to, and fmpy's instance; what it says goes to `messages`."""
    with Fmu(path) as fmu, fmu.instance(exchange) as instance:
        instance._log.messages = messages
        yield fmu.folder, instance.fmpy
