"""The one way in which this package drives an FMU, of its own or of anyone else: see `Fmu` and `Instance`."""

from .fmu_file import Fmu, is_of, is_ssp, read_description
from .instance import Instance, Intermediate, Port, SimulationError

__all__ = ["Fmu", "Instance", "Intermediate", "Port", "SimulationError", "is_of", "is_ssp", "read_description"]
