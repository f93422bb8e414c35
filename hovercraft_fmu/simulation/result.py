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

from ..fmu.interface import ERROR_LOST
from ..model.error_estimate import ON
from .planning import Run


@dataclass(frozen=True)
class Result:
    """What a run gave: `result["time"]`, `result["pose.x"]`, ..., one value a communication point, shape (n,)."""

    data: NDArray[np.void]
    run: Run
    warnings: tuple[str, ...] = ()
    """What the FMU said that did not end the run."""
    whole: NDArray[np.void] | None = None
    """The rows of `data`, and between them one more on the other side of every jump of the inputs, and one where they
    bend: all that tells how they went."""

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

    @property
    def is_estimated(self) -> bool:
        """Whether the FMU has told how far it is off: columns `error.position` [m] and `error.heading` [rad]."""
        return self.run.value("error_estimate") == ON and "error.position" in self.names

    @property
    def is_lost(self) -> bool:
        """Whether that cannot be trusted in the end."""
        return self.is_estimated and bool(self["warnings"][-1] & ERROR_LOST)

    @property
    def error_in_words(self) -> str:
        """'at the end 0.12 m off (0.02 % of the path), at most 0.31 m', of a run that is estimated."""
        off = self["error.position"]
        share = 100.0 * off[-1] / self.distance if self.distance > 0.0 else 0.0
        if self.is_lost:
            return "cannot be told: see the warning"
        return f"at the end {metres(off[-1])} off ({share:.2g} % of the path), at most {metres(off.max())}"

    def write_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write all columns as CSV, with all digits; as inputs of a run the file gives the same motion again.

        So it has the rows of `whole`. Raises OSError where it cannot be written.
        """
        return write_csv(self.data if self.whole is None else self.whole, path)


def path_length(x: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """m: of a polyline."""
    return float(np.hypot(np.diff(x), np.diff(y)).sum())


def metres(distance: float) -> str:
    """In words: '0.12 m', '3.4 mm', '2e-06 m'."""
    if 1e-3 <= distance < 0.1:
        return f"{distance * 1e3:.3g} mm"
    return f"{distance:.3g} m" if distance >= 0.1 else f"{distance:.2g} m"


def write_csv(data: NDArray[np.void], path: str | os.PathLike[str]) -> Path:
    """Write a structured array as CSV, with all digits; its folder is made."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    fmpy.util.write_csv(path, data)
    return path
