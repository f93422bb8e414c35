"""Control logs: the inputs of a run over time, read and checked."""

import os
from math import isfinite

import fmpy
import fmpy.simulation
import fmpy.util
import numpy as np

from ..fmu.interface import INPUTS
from ..scenes import Signals


def read_inputs(path: str | os.PathLike[str]) -> Signals:
    """Read a control log: a CSV file in fmpy's format, with the columns `time` and names of inputs.

    Raises:
        FileNotFoundError: no such file.
        ValueError: names the file and what is wrong in it.
    """
    try:
        table = fmpy.util.read_csv(path)
    except (ValueError, IndexError) as error:
        raise ValueError(f"{path}: must be a CSV file with a header and rows of as many numbers; {error}") from error
    return checked_signals(table, str(path))


def checked_signals(table: Signals, source: str) -> Signals:
    """The table, if it can be inputs; `source` is what the message calls it. Raises ValueError as `read_inputs`."""
    names = table.dtype.names or ()
    if not names or names[0] != "time" or len(table) == 0:
        raise ValueError(f"{source}: the first column must be 'time', with at least one row; the columns are {names}")
    for name in names[1:]:
        if name not in INPUTS:
            raise ValueError(f"{source}: column {name!r} must be an input: {', '.join(INPUTS)}")
    for name in names:
        for row, value in enumerate(table[name], 1):
            if not isfinite(value):
                raise ValueError(f"{source}: {name} = {value} in row {row}: must be a finite number")
    back = np.flatnonzero(np.diff(table["time"]) < 0.0)
    if back.size:
        row = int(back[0]) + 2
        raise ValueError(f"{source}: time = {table['time'][row - 1]} in row {row}: must not go back")
    return table
