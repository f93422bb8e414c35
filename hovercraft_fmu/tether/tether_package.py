"""Builds the tether's FMUs."""

import os
from collections.abc import Iterable
from pathlib import Path

from ..fmu.description import FMI_3_TYPES, Flavour
from ..fmu.document import FOLDER, rendered
from ..fmu.machine_code import PLATFORMS
from ..fmu.native_package import Papers, write_native_fmu
from ..fmu.python_package import Content, write_python_fmu
from .line import __doc__ as law
from .tether_interface import TETHER_MODEL
from .tether_native import TETHER, TETHER_NATIVE

HERE = Path(__file__).parent
PICTURE = "tow.png"
"""As `hovercraft-fmu demo --tow` draws it."""
CHART = "step_limit.svg"
"""Of the longest communication step, as `hovercraft-fmu measure coupling` draws it."""
REQUIREMENTS = "externalDependencies.txt"
"""Of the hovercraft's documentation: it holds for this FMU, too."""


def build_tether(path: str | os.PathLike[str] = f"build/{TETHER.identifier}.fmu") -> Path:
    """Write the tether's FMU to `path` (its folder is made) and return the path. Raises as `build_fmu` does."""
    return write_python_fmu(path, CONTENT)


def build_native_tether(
    path: str | os.PathLike[str], flavour: Flavour = TETHER_NATIVE, platforms: Iterable[str] = tuple(PLATFORMS)
) -> Path:
    """Write the native tether of a standard to `path` and return the path. Raises as `build_native_fmu` does."""
    return write_native_fmu(path, flavour, Papers(lambda: _documents(flavour), "Sine and cosine are"), platforms)


def _documents(flavour: Flavour) -> dict[str, bytes]:
    types = FMI_3_TYPES if flavour.fmi == 3 else {}
    values = {
        "model": TETHER_MODEL,
        "flavour": flavour,
        "variables": TETHER_MODEL.variables,
        "types": types,
        "law": law,
    }
    pages = {name: page.encode() for name, page in rendered(HERE, values).items()}
    needs = {} if flavour.native else {REQUIREMENTS: (FOLDER / REQUIREMENTS).read_bytes()}
    return {**needs, **{name: (HERE / name).read_bytes() for name in (PICTURE, CHART)}, **pages}


CONTENT = Content(
    TETHER,
    "tether.tether_slave",
    "TetherSlave",
    tuple(f"tether/{name}.py" for name in ("__init__", "line", "tether_interface", "tether_slave")),
    lambda: _documents(TETHER),
)
