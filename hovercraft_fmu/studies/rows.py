"""What is measured: a row a run; how costs are written."""

import csv
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from rich.table import Table

from ..simulation import method_in_words
from ..view.tables import markdown


class Setting(NamedTuple):
    """What a user chooses."""

    integrator: str
    step_size: float
    """s; of the adaptive method the first step"""
    communication_step: float
    """s"""
    tolerance: float = 1e-6

    @property
    def label(self) -> str:
        """The method and what drives its accuracy."""
        return method_in_words(self.integrator, self.step_size, self.tolerance)


@dataclass(frozen=True)
class Row:
    """One scene with one setting."""

    scene: str
    integrator: str
    step_size: float
    tolerance: float
    communication_step: float
    position_error: float
    """m, at the end"""
    heading_error: float
    """rad, at the end"""
    reference_uncertainty: float
    """of the largest component, SI units"""
    bare_cost: float
    """us a simulated second"""
    fmu_cost: float
    """us a simulated second, through fmpy"""
    substeps: int

    @property
    def setting(self) -> Setting:
        """The choice of this row."""
        return Setting(self.integrator, self.step_size, self.communication_step, self.tolerance)


class Holding(NamedTuple):
    """What holding the inputs from one communication point to the next costs."""

    communication_step: float
    """s"""
    position_error: float
    """m, at the end"""


def write_costs(
    path: Path, costs: Sequence[Any], cells: Callable[[Any], tuple[str, ...]], titles: Sequence[str]
) -> Table:
    """Write costs (tuples with a `ratio`) to path.csv, and as cells under titles to path.md; return that table."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.with_suffix(".csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow([*costs[0]._fields, "ratio"])
        writer.writerows([*cost, cost.ratio] for cost in costs)
    path.with_suffix(".md").write_text(markdown(titles, map(cells, costs)) + "\n", encoding="utf-8")
    table = Table(box=None, pad_edge=False)
    for title in titles:
        table.add_column(title)
    for cost in costs:
        table.add_row(*cells(cost))
    return table
