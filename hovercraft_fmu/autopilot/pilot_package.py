"""Builds the autopilot's FMUs."""

import os
from collections.abc import Iterable
from pathlib import Path

from ..fmu.description import FMI_3_TYPES, Flavour
from ..fmu.document import FOLDER, rendered, table_rows
from ..fmu.machine_code import PLATFORMS
from ..fmu.native_package import Papers, write_native_fmu
from ..fmu.python_package import Content, write_python_fmu
from . import guidance
from .guidance import __doc__ as law
from .pilot_interface import AUTOPILOT_MODEL, STATUS
from .pilot_native import AUTOPILOT, AUTOPILOT_NATIVE

HERE = Path(__file__).parent
PICTURE = "loop.png"
"""A voyage, as `hovercraft-fmu demo --loop` draws it."""
CHART = "step_limit.svg"
"""Of the longest communication step, as `hovercraft-fmu measure coupling` draws it."""
VOYAGES = HERE / "voyages.md"
"""What that measured of sixty voyages."""
REQUIREMENTS = "externalDependencies.txt"
"""Of the hovercraft's documentation: it holds for this FMU, too."""

ADVICE = {
    guidance.ARRIVED: "nothing",
    guidance.MISSED: "a larger acceptance_radius, a lower cruise_speed, a shorter communication step; or turn_back",
    guidance.AWAY: "see what the other bits say",
    guidance.CIRCLING: "a larger acceptance_radius; or turn_back 0",
    guidance.SATURATED: "a shorter communication step; lower gains; mass and inertia as they are in the craft",
    guidance.WIND: "a larger thrust_max, here and in the craft; or another day",
    guidance.LONG_STEP: "a shorter communication step, or a lower yaw_rate_gain",
    guidance.NOTHING_TO_STEER: "steering_force as it is in the craft",
}
"""On the page, for each bit of the status."""


def build_autopilot(path: str | os.PathLike[str] = f"build/{AUTOPILOT.identifier}.fmu") -> Path:
    """Write the autopilot's FMU to `path` (its folder is made) and return the path. Raises as `build_fmu` does."""
    return write_python_fmu(path, CONTENT)


def build_native_autopilot(
    path: str | os.PathLike[str], flavour: Flavour = AUTOPILOT_NATIVE, platforms: Iterable[str] = tuple(PLATFORMS)
) -> Path:
    """Write the native autopilot of a standard to `path` and return the path. Raises as `build_native_fmu` does."""
    papers = Papers(lambda: _documents(flavour), "Sine, cosine and arctangent are")
    return write_native_fmu(path, flavour, papers, platforms)


def _documents(flavour: Flavour) -> dict[str, bytes]:
    values = {
        "model": AUTOPILOT_MODEL,
        "flavour": flavour,
        "variables": AUTOPILOT_MODEL.variables,
        "types": FMI_3_TYPES if flavour.fmi == 3 else {},
        "law": law,
        "status": STATUS,
        "advice": ADVICE,
        "voyages": table_rows(VOYAGES)[1:],
    }
    pages = {name: page.encode() for name, page in rendered(HERE, values).items()}
    needs = {} if flavour.native else {REQUIREMENTS: (FOLDER / REQUIREMENTS).read_bytes()}
    return {**needs, **{name: (HERE / name).read_bytes() for name in (PICTURE, CHART)}, **pages}


CONTENT = Content(
    AUTOPILOT,
    "autopilot.pilot_slave",
    "AutopilotSlave",
    tuple(f"autopilot/{name}.py" for name in ("__init__", "guidance", "pilot_interface", "pilot_slave")),
    lambda: _documents(AUTOPILOT),
)
