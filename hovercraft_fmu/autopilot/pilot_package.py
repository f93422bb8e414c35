"""Builds the autopilot's FMU."""

import os
from pathlib import Path

from ..fmu.description import PYTHON
from ..fmu.document import FOLDER, rendered
from ..fmu.python_package import Content, write_python_fmu
from . import guidance
from .guidance import __doc__ as law
from .pilot_interface import AUTOPILOT_MODEL, STATUS

AUTOPILOT = PYTHON.of(AUTOPILOT_MODEL)
HERE = Path(__file__).parent
PICTURE = "loop.png"
"""A voyage, as `hovercraft-fmu demo --loop` draws it."""
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


def _documents() -> dict[str, bytes]:
    values = {
        "model": AUTOPILOT_MODEL, "variables": AUTOPILOT_MODEL.variables, "types": {}, "law": law,
        "status": STATUS, "advice": ADVICE,
    }  # fmt: skip
    pages = {name: page.encode() for name, page in rendered(HERE, values).items()}
    return {REQUIREMENTS: (FOLDER / REQUIREMENTS).read_bytes(), PICTURE: (HERE / PICTURE).read_bytes(), **pages}


CONTENT = Content(
    AUTOPILOT,
    "autopilot.pilot_slave",
    "AutopilotSlave",
    tuple(f"autopilot/{name}.py" for name in ("__init__", "guidance", "pilot_interface", "pilot_slave")),
    _documents,
)
