"""What is measured: a row a run."""

from dataclasses import dataclass
from typing import NamedTuple

from ..simulation import method_in_words


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
