"""What the commands print: on stdout what was asked for, on stderr how far they are and what is wrong."""

import json
import math
import os
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from threading import Event, Thread
from time import perf_counter
from typing import Any

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TaskProgressColumn, TextColumn, TimeRemainingColumn

GAP = "  "
"""Between columns."""
NARROW = 16
"""Characters: a column is not folded to less."""
WIDE = 160
"""Characters of a line where nobody says how wide it may be."""


@contextmanager
def _to_standard_output() -> Iterator[None]:
    """What cannot be written there says where that is."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror, "standard output") from error


def let_go_of_output(error: Exception) -> Exception:
    """Where standard output is full Python would try again as it ends, say so in its way, and end with 120.

    Returns:
        The error, which then names it.
    """
    try:
        sys.stdout.flush()
    except OSError as full:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        if isinstance(error, OSError) and not error.filename:
            return OSError(full.errno, full.strerror, "standard output")
    return error


class StandardOutput(Console):
    """Raises OSError, which names it, where it is full."""

    def print(self, *objects: Any, **options: Any) -> None:
        """As it is there."""
        with _to_standard_output():
            super().print(*objects, **options)


_is_told = sys.stdout.isatty() or "COLUMNS" in os.environ
OUTPUT = StandardOutput(soft_wrap=True, highlight=False, markup=False, width=None if _is_told else WIDE)
"""All that is printed is meant as it stands: pip install 'hovercraft-fmu[plot]' is no markup."""
LINE_EVERY = 10.0
"""s: of progress, where it is not shown on a terminal."""


@dataclass
class Voice:
    """How much is said, of the command that runs."""

    is_verbose: bool = False


VOICE = Voice()


def _be_quiet(_context: click.Context, _option: click.Parameter, wanted: bool) -> bool:
    OUTPUT.quiet = OUTPUT.quiet or wanted
    return wanted


def _be_verbose(_context: click.Context, _option: click.Parameter, wanted: bool) -> None:
    VOICE.is_verbose = wanted


QUIET_OPTION = click.Option(
    ["-q", "--quiet"], is_flag=True, expose_value=False, callback=_be_quiet, help="Print nothing but what is wrong."
)
VERBOSE_OPTION = click.Option(
    ["-v", "--verbose"], is_flag=True, expose_value=False, callback=_be_verbose,
    help="Say how long it took, and of what is wrong where it was found.",
)  # fmt: skip
json_option = click.option(
    "--json", "as_json", is_flag=True, callback=_be_quiet,
    help="Print the result as JSON, and nothing else.",
)  # fmt: skip
"""Of a command with a result."""


def print_json(result: Any) -> None:
    """For programs: SI units, angles in radians; what is no number is null."""
    text = json.dumps(_finite(result), indent=2, default=str, allow_nan=False)
    with _to_standard_output():
        click.echo(text)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _finite(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(each) for each in value]
    return value if not isinstance(value, float) or math.isfinite(value) else None


def one_line(error: Exception) -> str:
    """What went wrong."""
    if isinstance(error, FileNotFoundError) and error.errno and not error.filename:
        return "the folder that this is called in is gone: change to another one"
    if isinstance(error, OSError) and error.filename:
        return f"{error.filename}: {error.strerror}"
    return " ".join(str(error).split())


@contextmanager
def progress_of(total: float, doing: str = "simulating", *more: ProgressColumn) -> Iterator[Callable[[float], None]]:
    """A bar with the time left, on a terminal; it goes away when the run has ended. Else a line every ten seconds."""
    columns = (TextColumn(doing), BarColumn(), TaskProgressColumn(), *more, TimeRemainingColumn())
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        number, ended = progress.add_task("", total=total), Event()
        if not console.is_terminal:
            Thread(target=_tell_lines, args=(doing, progress.tasks[number], ended), daemon=True).start()
        try:
            yield lambda time: progress.update(number, completed=time)
        finally:
            ended.set()


def _tell_lines(doing: str, task: Task, ended: Event) -> None:
    begun = perf_counter()
    while not ended.wait(LINE_EVERY):
        click.echo(f"{doing}: {task.percentage:.0f} %, {perf_counter() - begun:.0f} s", err=True)


def print_rows(title: str, rows: dict[str, str]) -> None:
    """Names and what they are, under a title."""
    OUTPUT.print(title)
    print_table(("", ""), rows.items())


def print_table(titles: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """In columns, the widest folded where it must be; where that does not do, line by line: nothing is cut."""
    cells = [titles, *rows] if any(titles) else list(rows)
    widths = [max(len(row[i]) for row in cells) for i in range(len(titles))]
    widest = widths.index(max(widths))
    widths[widest] = min(widths[widest], OUTPUT.width - sum(widths) + widths[widest] - len(GAP) * (len(widths) - 1))
    for row in cells if widths[widest] >= NARROW else ():
        folded = textwrap.wrap(row[widest], widths[widest]) or [""]
        for number, part in enumerate(folded):
            line = [part if i == widest else "" if number else cell for i, cell in enumerate(row)]
            OUTPUT.print(GAP.join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip())
    for row in cells[any(titles) :] if widths[widest] < NARROW else ():
        _print_folded(": ".join(row) if not any(titles) else row[0])
        for title, cell in zip(titles[1:], row[1:], strict=True):
            if any(titles) and cell:
                _print_folded(f"{title}: {cell}", "    ")


def _print_folded(text: str, indent: str = "") -> None:
    for line in textwrap.wrap(text, OUTPUT.width, initial_indent=indent, subsequent_indent=indent):
        OUTPUT.print(line)
