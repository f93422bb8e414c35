"""Reads a control log as people and their tools write it: CSV where there is one meaning, else a refusal that names it.

The standard library's `csv` splits the lines. What separates the columns is told by the header, whose names are known:
no guess from the content is needed.
"""

import codecs
import csv
import math
import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np

from ..fmu.interface import BY_NAME, INPUTS, STATES, VARIABLES
from ..fmu.near_names import beside, did_you_mean
from ..scenes import Signals

TIME = "time"
SHOWN = tuple(each.name for each in VARIABLES if each.causality in ("input", "output", "local"))
"""Columns of a result, but for the time."""
SEPARATORS = (";", "\t", ",")
"""In the order in which they are looked for: with the first two a comma may be the decimal one."""
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
COMMA = re.compile(r"[+-]?(\d+,\d*|,\d+)([eE][+-]?\d+)?")
NAME = re.compile(r"(?P<name>[^\[(]*?)\s*(?:[\[(]\s*(?P<unit>[^\])]*?)\s*[\])])?")
"""Of a column: `thrust`, `time [s]`, `wind.x (m/s)`."""
RECORDED = "# recorded by hovercraft-fmu drive; the last line says how it ended"
ENDED = "# ended "


class ControlLog(NamedTuple):
    """What a file has in it."""

    table: Signals
    cut: bool
    """Whether it is the record of a drive whose end is missing."""
    unused: tuple[str, ...] = ()
    """Columns of outputs and local variables, which are passed over."""
    begins: tuple[tuple[str, float], ...] = ()
    """Of these the states, as they are in the first row."""


class Line(NamedTuple):
    """A line of the file that has something in it."""

    number: int
    """As an editor counts them, from 1."""
    cells: list[str]


def read_inputs(path: str | os.PathLike[str]) -> Signals:
    """Read a control log: columns `time` [s] and names of inputs; linear between rows, two rows at one time are a jump.

    Taken where there is one meaning: a byte order mark, blank lines, comment lines with #, spaces, quotes, a comma
    at the end of lines, semicolon or tab between columns, and with these a decimal comma; capitals and units in names
    (`Time [s]`). Columns of outputs and local variables, which a result has, are passed over.

    Returns:
        A structured array with the field `time` and those inputs that there are, in the order of the file, shape (n,).

    Raises:
        FileNotFoundError: no such file.
        ValueError: names the file, and the line, column, value and rule.
    """
    return read_control_log(path).table


def read_control_log(path: str | os.PathLike[str]) -> ControlLog:
    """The same, with what is to be told of it. Raises as `read_inputs` does."""
    source = Path(path)
    text = _text(source)
    cut = RECORDED in text and f"\n{ENDED}" not in text
    if cut:  # its last line may be cut, too
        text = text[: text.rfind("\n") + 1]
    header, *rows = list(_lines(source, text)) or [Line(1, [])]
    if not rows:
        raise ValueError(f"{source}: must have a header and at least one row of numbers")
    while not header.cells[-1]:  # a separator at the end of the line
        header.cells.pop()
    places = _places(source, header)
    names = {name: place for name, place in places.items() if name == TIME or name in INPUTS}
    _check_lengths(source, len(header.cells), rows)
    columns = {name: _numbers(source, name, i, rows) for name, i in names.items()}
    _check_order(source, columns[TIME], rows)
    order = (TIME, *(name for name in columns if name != TIME))
    table = np.empty(len(rows), dtype=[(name, np.float64) for name in order])
    for name in order:
        table[name] = columns[name]
    first = [(name, rows[0].cells[places[name]]) for name in STATES if name in places]
    begins = tuple((name, float(cell)) for name, cell in first if NUMBER.fullmatch(cell))
    return ControlLog(table, cut, tuple(name for name in places if name not in names), begins)


def _text(source: Path) -> str:
    try:
        content = source.read_bytes()
    except FileNotFoundError as error:
        raise FileNotFoundError(error.errno, f"{error.strerror}{beside(source)}", str(source)) from error
    encoding = "utf-16" if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) else "utf-8-sig"
    try:
        text = content.decode(encoding)
    except UnicodeDecodeError as error:
        raise ValueError(f"{source}: must be text in UTF-8; byte {error.start} is not") from error
    if "\0" in text:
        raise ValueError(f"{source}: must be text; it has bytes of 0 in it")
    return text


def _lines(source: Path, text: str) -> Iterator[Line]:
    """The header and the rows, without blank lines and comments."""
    separator = ""
    for number, line in enumerate(text.splitlines(), 1):
        if not line.strip() or line.lstrip().startswith("#"):
            continue
        if line.count('"') % 2:
            _refuse(source, number, "a quote that is opened must be closed on its line")
        separator = separator or next((each for each in SEPARATORS if each in line), ",")
        cells = [cell.strip() for cell in next(csv.reader([line], delimiter=separator, skipinitialspace=True))]
        if separator != ",":  # then a comma is the decimal one
            cells = [cell.replace(",", ".") if COMMA.fullmatch(cell) else cell for cell in cells]
        if any(cells):
            yield Line(number, cells)


def _places(source: Path, header: Line) -> dict[str, int]:
    """Name -> place of the columns."""
    places: dict[str, int] = {}
    known = {each.lower(): each for each in (TIME, *SHOWN)}
    for i, cell in enumerate(header.cells):
        found = NAME.fullmatch(cell)
        name = known.get(found["name"].lower()) if found else None
        if name is None:
            rule = f"must be 'time' or an input: {', '.join(INPUTS)}{did_you_mean(cell, (TIME, *INPUTS))}"
            _refuse(source, header.number, f"column {cell!r}: {rule}")
        unit = "s" if name == TIME else BY_NAME[name].unit or ""
        if found and found["unit"] not in (None, unit) and (name == TIME or name in INPUTS):
            _refuse(source, header.number, f"column {cell!r}: must be in {unit!r}")
        if name in places:
            _refuse(source, header.number, f"column {cell!r}: must stand there once")
        places[name] = i
    if TIME not in places:
        _refuse(source, header.number, "there must be a column 'time'")
    return places


def _check_lengths(source: Path, width: int, rows: Sequence[Line]) -> None:
    for line in rows:
        if len(line.cells) < width or any(line.cells[width:]):
            _refuse(source, line.number, f"must have {width} values, as the header has names; it has {len(line.cells)}")


def _numbers(source: Path, name: str, place: int, rows: Sequence[Line]) -> list[float]:
    return [_number(source, line, name, line.cells[place] if place < len(line.cells) else "") for line in rows]


def _number(source: Path, line: Line, name: str, cell: str) -> float:
    value = float(cell) if NUMBER.fullmatch(cell) else math.nan
    if not math.isfinite(value):
        _refuse(source, line.number, f"{name} = {cell!r}: must be a finite number")
    return value


def _check_order(source: Path, times: Sequence[float], rows: Sequence[Line]) -> None:
    for i in range(1, len(times)):
        if times[i] < times[i - 1]:
            _refuse(source, rows[i].number, f"time = {times[i]!r}: must not go back; before it is {times[i - 1]!r}")


def _refuse(source: Path, line: int, what: str) -> NoReturn:
    raise ValueError(f"{source}, line {line}: {what}")


def columns_as_signals(columns: Any) -> Signals:
    """A table of inputs from names and columns: a mapping, a DataFrame of pandas or polars, a `Result`.

    An index named `time` is a column, too; columns of outputs and local variables are passed over.

    Raises:
        ValueError: as `checked_signals` does; columns of different lengths, or what are no numbers.
    """
    if getattr(columns, "whole", None) is not None:  # of a result: with both rows of every jump
        columns = {name: columns.whole[name] for name in columns}
    names = [str(name) for name in (columns.keys() if hasattr(columns, "keys") else columns.columns)]
    found = {name: columns[name] for name in names if name in (TIME, *INPUTS) or name not in SHOWN}
    index = getattr(columns, "index", None)
    if TIME not in found and getattr(index, "name", None) == TIME:
        found[TIME] = index
    if TIME not in found:
        raise ValueError(f"inputs: there must be a column 'time'; the columns are {', '.join(names)}")
    order = (TIME, *(name for name in found if name != TIME))
    try:
        arrays = [np.asarray(found[name], np.float64) for name in order]
    except (TypeError, ValueError) as error:
        raise ValueError(f"inputs: every column must be numbers; {error}") from error
    if len({each.shape for each in arrays}) > 1 or arrays[0].ndim != 1:
        lengths = ", ".join(f"{name} {each.shape}" for name, each in zip(order, arrays, strict=True))
        raise ValueError(f"inputs: every column must have one value a row; the shapes are {lengths}")
    table = np.empty(len(arrays[0]), dtype=[(name, np.float64) for name in order])
    for name, column in zip(order, arrays, strict=True):
        table[name] = column
    return checked_signals(table, "inputs")


def checked_signals(table: Signals, source: str) -> Signals:
    """The table, if it can be inputs; `source` is what the message calls it. Raises ValueError as `read_inputs`."""
    names = table.dtype.names or ()
    if not names or names[0] != "time" or len(table) == 0:
        raise ValueError(f"{source}: the first column must be 'time', with at least one row; the columns are {names}")
    for name in names[1:]:
        if name not in INPUTS:
            raise ValueError(
                f"{source}: column {name!r} must be an input: {', '.join(INPUTS)}{did_you_mean(name, INPUTS)}"
            )
    for name in names:
        for row, value in enumerate(table[name], 1):
            if not math.isfinite(value):
                raise ValueError(f"{source}: {name} = {value} in row {row}: must be a finite number")
    back = np.flatnonzero(np.diff(table["time"]) < 0.0)
    if back.size:
        row = int(back[0]) + 2
        raise ValueError(f"{source}: time = {table['time'][row - 1]} in row {row}: must not go back")
    return table
