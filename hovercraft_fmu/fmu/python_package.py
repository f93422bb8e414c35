"""Builds the Python FMU: the model and its slave behind pythonfmu's wrapper; two builds give the same bytes."""

import os
from collections.abc import Callable
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

import pythonfmu

from .archive import digest, write_archive, zipped
from .description import PYTHON, Flavour, model_description, xml
from .document import documents, licenses
from .extras import ICON, reference_result

PACKAGE = Path(__file__).parent.parent
SHARED = (
    "model/*.py",
    "fmu/__init__.py",
    "fmu/interface.py",
    "fmu/variable.py",
    "fmu/python/__init__.py",
    "fmu/python/life_cycle.py",
    "fmu/python/wrapper.py",
)
"""What of this package goes into every Python FMU, as patterns."""
WRAPPERS = {"linux64": ".so", "win64": ".dll"}
"""Folders of pythonfmu's binaries, and what their names end in."""
ENTRY_SCRIPT = '''\
"""The entry of the FMU. Its name carries a digest of the content, so no other module can be taken for it."""

from typing import Any

from {package}.{module} import {slave}


class {model}({slave}):
    """The slave of this very build."""

    build = "{build}"{own}

    # pythonfmu's wrapper needs a class with a method of its own
    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
'''


@dataclass(frozen=True)
class Content:
    """What one Python FMU is made of."""

    flavour: Flavour
    module: str
    """Of its slave, inside this package."""
    slave: str
    """Its class there."""
    travels: tuple[str, ...]
    """What of this package goes into it, beside SHARED."""
    documents: Callable[[], dict[str, bytes]]
    """Files of documentation/, by path."""
    extra: Callable[[], dict[str, bytes]] = dict
    """Files of extra/, by path in the FMU."""


def hovercraft_content(flavour: Flavour) -> Content:
    """Of PYTHON, or of a variant of it."""
    return Content(
        flavour,
        "fmu.python.slave",
        "HovercraftSlave",
        ("fmu/python/slave.py",),
        lambda: documents(flavour),
        lambda: reference_result(flavour),
    )


def build_fmu(path: str | os.PathLike[str] | None = None, flavour: Flavour = PYTHON) -> Path:
    """Write the FMU to `path` (its folder is made) and return the path.

    Args:
        path: the file; without it build/Hovercraft.fmu, or that name of a variant.
        flavour: PYTHON, or a variant of it.

    Raises:
        ValueError: the name does not end in .fmu.
        OSError: the file cannot be written; one that stood there before still does.
    """
    return write_python_fmu(path or f"build/{flavour.identifier}.fmu", hovercraft_content(flavour))


def write_python_fmu(path: str | os.PathLike[str], content: Content) -> Path:
    """Write the Python FMU of that content to `path`. Raises as `build_fmu` does."""
    return write_archive(path, lambda: _archive(content))


def _archive(content: Content) -> bytes:
    flavour, code, wrappers = content.flavour, _code(content), _wrappers(content.flavour.identifier)
    build = python_identity(content)
    # each module gets a name of its own, pythonfmu's, too: a host may have imported other ones of these names
    package = f"{flavour.identifier.lower()}_{build[:16]}"
    names = {"package": package, "module": content.module, "slave": content.slave, "model": flavour.identifier}
    entry = ENTRY_SCRIPT.format(**names, build=build, own=_own(content))
    parts = f"The binaries and the modules in resources/{package}/pythonfmu are PythonFMU's"
    documentation = {**content.documents(), **licenses(parts, "pythonfmu.txt", _pythonfmu_license())}
    return zipped(
        {
            "modelDescription.xml": xml(model_description(build, flavour)),
            "model.png": ICON.read_bytes(),
            "resources/slavemodule.txt": f"{package}_fmu".encode(),
            f"resources/{package}_fmu.py": entry.encode(),
            f"resources/{package}/__init__.py": b'"""The model of one FMU."""\n',
            **{f"resources/{package}/{name}": text for name, text in code.items()},
            **wrappers,
            **content.extra(),
            **{f"documentation/{name}": text for name, text in documentation.items()},
        }
    )


def _own(content: Content) -> str:
    """The line of a variant that says what it has of its own."""
    flavour = content.flavour
    if flavour.variant_of is None:
        return ""
    return f"\n    model = {content.slave}.model.variant({flavour.model.name!r}, {flavour.own_starts!r})"


def python_identity(content: Content) -> str:
    """What the FMU is: a digest of its code and its table, but of nothing that is written about it."""
    table = xml(model_description("0" * 32, content.flavour))
    wrappers = _wrappers(content.flavour.identifier)
    return digest({**_code(content), **wrappers, "entry": ENTRY_SCRIPT.encode(), "table": table})


def _code(content: Content) -> dict[str, bytes]:
    """Of this package and of pythonfmu's, by path."""
    ours = [path for pattern in (*SHARED, *content.travels) for path in PACKAGE.glob(pattern)]
    return {
        **{path.relative_to(PACKAGE).as_posix(): path.read_bytes() for path in ours},
        **{f"pythonfmu/{path.name}": path.read_bytes() for path in Path(pythonfmu.__file__).parent.glob("*.py")},
    }


def _wrappers(identifier: str) -> dict[str, bytes]:
    home = Path(pythonfmu.__file__).parent / "resources" / "binaries"
    return {
        f"binaries/{folder}/{identifier}{suffix}": path.read_bytes()
        for folder, suffix in WRAPPERS.items()
        for path in (home / folder).glob(f"*{suffix}")
    }


def _pythonfmu_license() -> bytes:
    files = metadata.files("pythonfmu") or []
    return next(file for file in files if file.name.upper().startswith("LICENSE")).read_binary()
