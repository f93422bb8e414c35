"""A hovercraft as an FMU: build it, run it."""

from ._version import __version__
from .building import build
from .fmu.python_package import build_fmu
from .host import SimulationError
from .host.fleet import Crafts, advance_fleet
from .simulation import Result, simulate

__all__ = ["Crafts", "Result", "SimulationError", "__version__", "advance_fleet", "build", "build_fmu", "simulate"]
