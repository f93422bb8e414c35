"""What a run gave: one kind of result, on an FMU or on the bare model."""

import json
import os
from collections.abc import Iterator
from dataclasses import dataclass
from html import escape
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import fmpy
import fmpy.simulation
import fmpy.util
import numpy as np
from numpy.typing import NDArray

from ..drawing.run_picture import draw_run, path_svg
from ..fmu.interface import BY_NAME, ERROR_LOST
from ..fmu.near_names import must_be_one_of
from ..model.error_estimate import ON
from ..whole import written
from .planning import Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame


@dataclass(frozen=True, repr=False)
class Result:
    """What a run gave: `result["time"]`, `result["pose.x"]`, ..., one value a communication point, shape (n,).

    As in a table of pandas: `len` is the number of rows, `in` and `for` go over the names of columns.
    """

    data: NDArray[np.void]
    run: Run
    warnings: tuple[str, ...] = ()
    """What the FMU said that did not end the run."""
    whole: NDArray[np.void] | None = None
    """The rows of `data`, and between them one more on the other side of every jump of the inputs, and one where they
    bend: all that tells how they went."""

    def __getitem__(self, name: str) -> NDArray[Any]:
        if name not in self.names:
            raise ValueError(must_be_one_of("column", name, self.names))
        return self.data[name]

    def __len__(self) -> int:
        return len(self.data)

    def __contains__(self, name: object) -> bool:
        return name in self.names

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def __repr__(self) -> str:
        rows = (f"  {name:14} {text}" for name, text in self.in_words.items())
        warned = (f"  warning        {warning}" for warning in self.warnings)
        return "\n".join([f"Result of {self.run.title}: {self.run.method}", *rows, *warned])

    def _repr_html_(self) -> str:
        """In a notebook: the path, and what the text says."""
        rows = "".join(f"<tr><th>{name}</th><td>{text}</td></tr>" for name, text in self.in_words.items())
        said = "".join(f"<p>warning: {escape(warning)}</p>" for warning in self.warnings)
        title = escape(f"{self.run.title}: {self.run.method}")
        return f"<p><b>{title}</b></p>{path_svg(self['pose.x'], self['pose.y'])}<table>{rows}</table>{said}"

    def keys(self) -> tuple[str, ...]:
        """The names of the columns; so `dict(result)` is one of arrays."""
        return self.names

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

    @property
    def in_words(self) -> dict[str, str]:
        """What came of the run, in a few lines."""
        craft, headings = self.run.craft, np.degrees(self["pose.heading"])
        words = {
            "duration": f"{self['time'][-1] - self.run.start_time:g} s, {len(self) - 1} communication steps",
            "sub-steps": f"{self['substeps'][-1]}",
            "distance": f"{self.distance:.2f} m, {self.distance / craft.length:.1f} craft lengths",
            "largest speed": f"{self['speed'].max():.3f} m/s",
            "headings": f"{headings.min():.1f} ... {headings.max():.1f} deg",
            "end position": f"({self['pose.x'][-1]:.3f}, {self['pose.y'][-1]:.3f}) m",
            "end heading": f"{headings[-1]:.2f} deg",
            "end speed": f"{self['speed'][-1]:.4f} m/s",
        }
        return {**words, "error, as told": self.error_in_words} if self.is_estimated else words

    @property
    def title(self) -> str:
        """Of a picture."""
        told = f"; {self.error_in_words}" if self.is_estimated else ""
        return f"{self.run.title}: {self.distance:.0f} m in {self['time'][-1] - self['time'][0]:g} s{told}"

    def plot(self) -> "Figure":
        """The path with the craft along it, controls, speed and heading over time: a Figure of matplotlib's.

        Raises ModuleNotFoundError: matplotlib is not installed; says how to install it.
        """
        return draw_run(self, self.run.craft, self.title, self.is_estimated)

    def to_pandas(self) -> "DataFrame":
        """A DataFrame: a row a communication point, `time` [s] the index, the units of the columns in `attrs["units"]`.

        Raises ModuleNotFoundError: pandas is not installed; says how to install it.
        """
        try:
            pandas = import_module("pandas")
        except ModuleNotFoundError as error:
            raise ModuleNotFoundError("to_pandas needs pandas, which is not installed: pip install pandas") from error
        frame: DataFrame = pandas.DataFrame({name: self[name] for name in self}).set_index("time")
        frame.attrs["units"] = {name: BY_NAME[name].unit or "1" for name in frame if name in BY_NAME}
        return frame

    def write_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write all columns as CSV, with all digits; as inputs of a run with the same preset, start values and
        communication step the file gives the same motion again.

        So it has the rows of `whole`. Raises OSError where it cannot be written.
        """
        return write_csv(self.all_rows, path)

    def write(self, path: str | os.PathLike[str]) -> Path:
        """Write all columns as the ending says, CSV (see `write_csv`) or Parquet, with the same rows.

        Raises:
            ValueError, ModuleNotFoundError: see `check_output`.
            OSError: it cannot be written.
        """
        path = check_output(path)
        if path.suffix == ".csv":
            return self.write_csv(path)
        arrow, parquet = (import_module(name) for name in ("pyarrow", "pyarrow.parquet"))
        table = arrow.table({name: np.ascontiguousarray(self.all_rows[name]) for name in self})
        units = {name: BY_NAME[name].unit or "1" for name in self if name in BY_NAME}
        table = table.replace_schema_metadata({"units": json.dumps({"time": "s", **units})})
        with written(path) as unfinished:
            parquet.write_table(table, unfinished)
        return path

    @property
    def all_rows(self) -> NDArray[np.void]:
        """`whole`, where there is more than `data`."""
        return self.data if self.whole is None else self.whole

    @property
    def summary(self) -> dict[str, Any]:
        """For programs: what was run, and what came of it; SI units, angles in radians."""
        run, off = self.run, self["error.position"] if self.is_estimated else None
        return {
            "scene": run.title,
            "method": run.method,
            "start_time": run.start_time,
            "stop_time": float(self["time"][-1]),
            "communication_step": run.communication_step,
            "communication_steps": len(self) - 1,
            "substeps": int(self["substeps"][-1]),
            "distance": self.distance,
            "largest_speed": float(self["speed"].max()),
            "end": {name: self[name][-1].item() for name in self if name != "time"},
            "estimated_error": None if off is None else {"end": float(off[-1]), "largest": float(off.max())},
            "warnings": list(self.warnings),
        }


OUTPUTS = (".csv", ".parquet")
"""What a file of a result may end in."""


def check_output(path: str | os.PathLike[str], what: str = "output") -> Path:
    """The path; so that a run need not be made to learn that it cannot be written.

    Raises:
        ValueError: the name ends in none of OUTPUTS.
        ModuleNotFoundError: pyarrow (for Parquet) is not installed; says how to install it.
    """
    path = Path(path)
    if path.suffix not in OUTPUTS:
        raise ValueError(f"{what} = {str(path)!r}: must end in {' or '.join(OUTPUTS)}")
    if path.suffix == ".parquet":
        try:
            import_module("pyarrow.parquet")
        except ModuleNotFoundError as error:
            raise ModuleNotFoundError(
                "Parquet needs pyarrow, which is not installed: "
                "pip install 'hovercraft-fmu[sweep]', in a checkout '.[sweep]'"
            ) from error
    return path


def path_length(x: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """m: of a polyline."""
    return float(np.hypot(np.diff(x), np.diff(y)).sum())


def metres(distance: float) -> str:
    """In words: '0.12 m', '3.4 mm', '2e-06 m'."""
    if 1e-3 <= distance < 0.1:
        return f"{distance * 1e3:.3g} mm"
    return f"{distance:.3g} m" if distance >= 0.1 else f"{distance:.2g} m"


def write_csv(data: NDArray[np.void], path: str | os.PathLike[str]) -> Path:
    """Write a structured array as CSV, with all digits, at once or not at all; its folder is made."""
    path = Path(path)
    with written(path) as unfinished:
        fmpy.util.write_csv(unfinished, data)
    return path
