"""Builds the tether's FMU."""

import os
from pathlib import Path

from ..fmu.description import PYTHON
from ..fmu.document import FOLDER, rendered
from ..fmu.python_package import Content, write_python_fmu
from .line import __doc__ as law
from .tether_interface import TETHER_MODEL

TETHER = PYTHON.of(TETHER_MODEL)
HERE = Path(__file__).parent
PICTURE = "tow.png"
"""As `hovercraft-fmu demo --tow` draws it."""
REQUIREMENTS = "externalDependencies.txt"
"""Of the hovercraft's documentation: it holds for this FMU, too."""


def build_tether(path: str | os.PathLike[str] = f"build/{TETHER.identifier}.fmu") -> Path:
    """Write the tether's FMU to `path` (its folder is made) and return the path. Raises as `build_fmu` does."""
    return write_python_fmu(path, CONTENT)


def _documents() -> dict[str, bytes]:
    values = {"model": TETHER_MODEL, "variables": TETHER_MODEL.variables, "types": {}, "law": law}
    pages = {name: page.encode() for name, page in rendered(HERE, values).items()}
    return {REQUIREMENTS: (FOLDER / REQUIREMENTS).read_bytes(), PICTURE: (HERE / PICTURE).read_bytes(), **pages}


CONTENT = Content(
    TETHER,
    "tether.tether_slave",
    "TetherSlave",
    tuple(f"tether/{name}.py" for name in ("__init__", "line", "tether_interface", "tether_slave")),
    _documents,
)
