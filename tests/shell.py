"""The command, typed in an empty folder."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import pytest

from hovercraft_fmu.cli import main

PROGRESS = re.compile(r"^.*: +\d+ %, \d+ s\n", re.MULTILINE)
"""What a busy machine is told meanwhile."""


class Typed(NamedTuple):
    """What came of a command: its status, and what it wrote."""

    status: int
    out: str
    err: str


class Shell:
    """An empty folder to type in. The command runs in this process: a new one takes a second to begin."""

    def __init__(self, folder: Path, written: Callable[[], tuple[str, str]]) -> None:
        self.folder, self._written = folder, written

    def run(self, *arguments: str) -> Typed:
        with pytest.raises(SystemExit) as left:
            main(list(arguments))
        status = left.value.code
        out, written = self._written()
        err = PROGRESS.sub("", written)
        return Typed(1, out, f"{err}{status}\n") if isinstance(status, str) else Typed(status or 0, out, err)

    def ok(self, *arguments: str) -> str:
        """What it printed."""
        done = self.run(*arguments)
        assert (done.status, done.err) == (0, "")
        return done.out

    def refused(self, *arguments: str, status: int = 1) -> str:
        """The one line that says why; status 2 where it is in how the command was used."""
        done = self.run(*arguments)
        assert done.status == status
        assert len(done.err.splitlines()) == 1
        assert done.err.startswith("hovercraft-fmu: ")
        return done.err
