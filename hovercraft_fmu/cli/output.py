"""What the commands print: on stdout what was asked for, on stderr how far they are."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Event, Thread
from time import perf_counter

import click
from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, Task, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.table import Table

OUTPUT = Console(soft_wrap=True, highlight=False, markup=False, width=None if sys.stdout.isatty() else 160)
"""All that is printed is meant as it stands: pip install 'hovercraft-fmu[plot]' is no markup."""
LINE_EVERY = 10.0
"""s: of progress, where it is not shown on a terminal."""


def one_line(error: Exception) -> str:
    """What went wrong."""
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
    table = Table(title=title, title_justify="left", show_header=False, box=None, pad_edge=False)
    for name, text in rows.items():
        table.add_row(name, text)
    OUTPUT.print(table)
