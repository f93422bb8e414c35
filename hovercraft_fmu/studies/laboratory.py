"""The laboratory: a table of cases, timed in turn; what a measurement found, shown and written.

Tables are polars': one wheel that needs no other, with types of its own, and what it prints for a terminal is Markdown,
so a page takes it as it is. (pandas would want two packages more for that.)
"""

import platform
import statistics
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeAlias, TypeVar

import polars as pl

from .._version import __version__
from ..drawing.figures import save
from ..whole import write_whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MACHINE = "machine.txt"
Key = TypeVar("Key")
Found = TypeVar("Found")
Tell: TypeAlias = Callable[[float], None]
"""Called with the part of the work that is done, 0 to 1."""
Ready: TypeAlias = Callable[[], Callable[[], Found]]
"""A case: makes everything ready, and returns what is then timed."""


@dataclass(frozen=True)
class Timed(Generic[Found]):
    """A case that was run once a round."""

    seconds: tuple[float, ...]
    found: Found
    """What the last run returned."""

    @property
    def least(self) -> float:
        """s: what the machine adds is never negative, so the least is nearest to the case's own."""
        return min(self.seconds)

    @property
    def spread(self) -> float:
        """1: how far the median is above the least."""
        return statistics.median(self.seconds) / self.least - 1.0


def interleaved(cases: Mapping[Key, Ready[Found]], rounds: int, tell: Tell) -> dict[Key, Timed[Found]]:
    """Run every case once a round: a slow moment of the machine hits all alike."""
    seconds: dict[Key, list[float]] = {key: [] for key in cases}
    found: dict[Key, Found] = {}
    for done in range(rounds):
        for number, (key, ready) in enumerate(cases.items(), 1):
            go = ready()
            begun = perf_counter()
            found[key] = go()
            seconds[key].append(perf_counter() - begun)
            tell((done + number / len(cases)) / rounds)
    return {key: Timed(tuple(seconds[key]), found[key]) for key in cases}


def spread(timed: Iterable[Timed[Any]]) -> str:
    """How the times of some cases were found, in words."""
    many = list(timed)
    if len(many[0].seconds) == 1:
        return "costs are of one run each"
    spreads = sorted(each.spread for each in many)
    return (
        f"costs are the least of {len(many[0].seconds)} interleaved rounds; the medians are "
        f"{spreads[len(many) // 2]:.0%} above them, the worst {spreads[-1]:.0%}"
    )


def part(tell: Tell, begin: float, end: float) -> Tell:
    """The `tell` of a part of the work."""
    return lambda done: tell(begin + done * (end - begin))


def machine() -> str:
    """What it was measured on, in one line."""
    versions = ", ".join(f"{name} {metadata.version(name)}" for name in ("numpy", "fmpy"))
    return (
        f"hovercraft-fmu {__version__}, Python {platform.python_version()}, {versions}, "
        f"{platform.system()} {platform.machine()}"
    )


# ---- what a measurement found


class Shown(NamedTuple):
    """A table to be read."""

    title: str
    frame: pl.DataFrame
    name: str = ""
    """Of a page's own copy, NAME.md."""


@dataclass
class Findings:
    """All that a measurement found."""

    records: dict[str, pl.DataFrame] = field(default_factory=dict)
    """NAME.csv -> its table."""
    tables: list[Shown] = field(default_factory=list)
    pictures: dict[str, "Figure"] = field(default_factory=dict)
    """NAME.png -> the picture."""
    notes: list[str] = field(default_factory=list)

    def add(self, other: "Findings") -> None:
        """What another part of the measurement found."""
        self.records |= other.records
        self.tables += other.tables
        self.pictures |= other.pictures
        self.notes += other.notes

    def write(self, folder: Path) -> None:
        """Everything into a folder, which is made. Raises OSError where that cannot be done."""
        for name, frame in self.records.items():
            write_whole(folder / f"{name}.csv", frame.write_csv().encode())
        for shown in self.tables:
            if shown.name:
                write_whole(folder / f"{shown.name}.md", f"{text(shown.frame)}\n".encode())
        for name, figure in self.pictures.items():
            save(figure, folder / f"{name}.png")
        write_whole(folder / MACHINE, f"{machine()}\n".encode())

    def report(self) -> str:
        """What is printed: the tables, the notes, the machine."""
        parts = [f"{shown.title}\n\n{text(shown.frame)}" for shown in self.tables]
        return "\n\n".join([*parts, *self.notes, machine()])


def text(frame: pl.DataFrame) -> str:
    """A table in Markdown; numbers with three digits."""
    cells = {name: [_cell(value) for value in frame[name]] for name in frame.columns}
    with pl.Config(tbl_formatting="ASCII_MARKDOWN", tbl_hide_column_data_types=True, tbl_hide_dataframe_shape=True,
                   tbl_rows=-1, tbl_cols=-1, tbl_width_chars=10_000, fmt_str_lengths=1000):  # fmt: skip
        return str(pl.DataFrame(cells)).strip()


def _cell(value: Any) -> str:
    if value is None or value != value:  # NaN
        return ""
    return three_digits(value) if isinstance(value, float) else str(value)


def three_digits(value: float) -> str:
    """'0.218', '2.34e-07', '27700': an exponent where the figure would be long only."""
    rounded = float(f"{value:.3g}")
    return f"{rounded:.0f}" if 1e3 <= abs(rounded) < 1e7 else f"{value:.3g}"
