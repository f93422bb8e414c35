"""A hovercraft as an FMU: build it, run it."""

from ._version import __version__
from .fmu.python_package import build_fmu
from .simulation import Result, SimulationError, simulate

__all__ = ["Result", "SimulationError", "__version__", "build_fmu", "simulate"]
