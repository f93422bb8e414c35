"""Help as narrow as the terminal is, with lists of its own."""

import shutil
from collections.abc import Iterable, Sequence

import click

NARROWEST = 52
"""Characters: for less click writes over the edge."""


class Help(click.HelpFormatter):
    """As click's; in narrow terminals, too."""

    def __init__(self, indent_increment: int = 2, width: int | None = None, max_width: int | None = None) -> None:
        columns = shutil.get_terminal_size().columns
        super().__init__(indent_increment, columns if width is None and columns < NARROWEST else width, max_width)

    def write_dl(self, rows: Iterable[tuple[str, str]], col_max: int = 30, col_spacing: int = 2) -> None:
        """As click's: names take no more than what leaves their text half of the line."""
        super().write_dl(rows, min(col_max, self.width // 2 - 2 * col_spacing), col_spacing)


class HelpContext(click.Context):
    """Of every command."""

    formatter_class = Help


def write_rows(formatter: click.HelpFormatter, title: str, rows: Sequence[tuple[str, str]]) -> None:
    """A list under a title, folded where it must be."""
    with formatter.section(title):
        formatter.write_dl(rows)
