"""What a run gave: one kind of result, on an FMU or on the bare model."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import fmpy
import fmpy.simulation
import fmpy.util
import numpy as np
from numpy.typing import NDArray

from .planning import Run


@dataclass(frozen=True)
class Result:
    """What a run gave: `result["time"]`, `result["pose.x"]`, ..., one value a communication point, shape (n,)."""

    data: NDArray[np.void]
    run: Run
    warnings: tuple[str, ...] = ()
    """What the FMU said that did not end the run."""

    def __getitem__(self, name: str) -> NDArray[Any]:
        if name not in self.names:
            raise ValueError(f"column = {name!r}: must be one of {', '.join(self.names)}")
        return self.data[name]

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the columns; the first is `time` [s], the others are variables of the FMU."""
        return self.data.dtype.names or ()

    @property
    def distance(self) -> float:
        """m: length of the path from communication point to communication point."""
        return path_length(self["pose.x"], self["pose.y"])

    def write_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write all columns as CSV, with all digits. Raises OSError where that cannot be done."""
        return write_csv(self.data, path)


def path_length(x: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """m: of a polyline."""
    return float(np.hypot(np.diff(x), np.diff(y)).sum())


def write_csv(data: NDArray[np.void], path: str | os.PathLike[str]) -> Path:
    """Write a structured array as CSV, with all digits; its folder is made."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    fmpy.util.write_csv(path, data)
    return path
