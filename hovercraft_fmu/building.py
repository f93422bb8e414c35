"""What this package makes: a table of files, and one function that writes any of them."""

import os
import platform
import sys
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Literal, NamedTuple, TypeAlias, get_args
from xml.etree.ElementTree import ParseError, fromstring

from ._version import __version__
from .autopilot.pilot_package import CONTENT as AUTOPILOT_CONTENT
from .autopilot.pilot_package import build_autopilot
from .fmu.description import NATIVE, NATIVE3, guid
from .fmu.machine_code import identity
from .fmu.native_package import build_native_fmu
from .fmu.python_package import HOVERCRAFT_CONTENT, build_fmu, python_identity
from .ssp import build_ssp

Kind: TypeAlias = Literal["native", "native3", "python", "autopilot", "native_loop", "native3_loop", "python_loop"]
FOLDER = Path("build")


class Product(NamedTuple):
    """A file."""

    name: str
    purpose: str
    """What it is for."""
    write: Callable[[Path], Path]
    identity: Callable[[], str] | None = None
    """Of an FMU: what it is, in 32 hexadecimal digits."""


def _write_loop(kind: Kind) -> Callable[[Path], Path]:
    def write(path: Path) -> Path:
        with TemporaryDirectory(prefix="hovercraft_fmu_") as folder:
            craft, autopilot = (build(each, Path(folder) / PRODUCTS[each].name) for each in (kind, "autopilot"))
            return build_ssp(path, craft, autopilot)

    return write


PRODUCTS: Mapping[Kind, Product] = MappingProxyType(
    {
        "native": Product(
            "HovercraftNative.fmu",
            "FMI 2.0, machine code: for every tool; needs nothing",
            lambda path: build_native_fmu(path, NATIVE),
            lambda: identity(NATIVE),
        ),
        "native3": Product(
            "HovercraftNative3.fmu",
            "FMI 3.0, machine code: for tools that want FMI 3.0, and for arm64 Linux in fmpy",
            lambda path: build_native_fmu(path, NATIVE3),
            lambda: identity(NATIVE3),
        ),
        "python": Product(
            "Hovercraft.fmu",
            "FMI 2.0, Python: to read or change the model; needs Python 3.10 or newer where it runs",
            build_fmu,
            lambda: python_identity(HOVERCRAFT_CONTENT),
        ),
        "autopilot": Product(
            "Autopilot.fmu",
            "FMI 2.0, Python: takes the craft from waypoint to waypoint",
            build_autopilot,
            lambda: python_identity(AUTOPILOT_CONTENT),
        ),
        "native_loop": Product(
            "HovercraftNativeLoop.ssp",
            "SSP 1.0: the closed loop of HovercraftNative.fmu and Autopilot.fmu, for co-simulation masters",
            _write_loop("native"),
        ),
        "native3_loop": Product(
            "HovercraftNative3Loop.ssp",
            "SSP 1.0: the same loop with HovercraftNative3.fmu",
            _write_loop("native3"),
        ),
        "python_loop": Product(
            "HovercraftLoop.ssp",
            "SSP 1.0: the same loop with Hovercraft.fmu",
            _write_loop("python"),
        ),
    }
)
assert tuple(PRODUCTS) == get_args(Kind)


def build(kind: Kind = "native", path: str | os.PathLike[str] | None = None) -> Path:
    """Write a file of that kind to `path` (its folder is made) and return the path; two builds give the same bytes.

    Args:
        kind: what: the key of a row of PRODUCTS.
        path: the file; without it that of PRODUCTS, in build/.

    Raises:
        ValueError: no such kind, or the name does not end in .fmu (.ssp for a loop).
        NotCompiledError: there is no machine code for a native one; the message says how to get it.
        OSError: the file cannot be written; one that stood there before still does.
    """
    chosen = product(kind)
    return chosen.write(Path(path or FOLDER / chosen.name))


def product(kind: str) -> Product:
    """The row of PRODUCTS. Raises ValueError: no such kind."""
    for known, row in PRODUCTS.items():
        if kind == known:
            return row
    raise ValueError(f"kind = {kind!r}: must be one of {', '.join(PRODUCTS)}")


def default_kind() -> Kind:
    """The FMU that is run where none is named: machine code, FMI 2.0; on arm64 Linux FMI 3.0, as fmpy takes linux64 for
    the folder of FMI 2.0 there, too.
    """
    return "native3" if sys.platform == "linux" and platform.machine() == "aarch64" else "native"


def default_fmu(kind: Kind | None = None) -> Path:
    """The FMU of that kind in build/ under the current folder, which is built if it is not there.

    Raises:
        ValueError: the one that is there is of another version of this package, or of other code.
        NotCompiledError, OSError: it cannot be built.
    """
    kind = kind or default_kind()
    path = FOLDER / product(kind).name
    if not path.exists():
        return build(kind, path)
    if found := _foreign(path, product(kind)):
        raise ValueError(
            f"{path}: {found}; 'hovercraft-fmu build {kind}' writes it again (or name it, to run it as it is)"
        )
    return path


def _foreign(path: Path, expected: Product) -> str:
    """What a file that was built before is, where it is not what this package builds; '' where it is that."""
    try:
        with zipfile.ZipFile(path) as archive:
            root = fromstring(archive.read("modelDescription.xml"))  # noqa: S314 - entities are bounded
    except (zipfile.BadZipFile, KeyError, ParseError) as error:
        return f"must be an FMU with a model description ({error})"
    version, token = root.get("version"), root.get("guid") or root.get("instantiationToken")
    if version != __version__:
        return f"is of version {version} of hovercraft-fmu, which is {__version__} now"
    if expected.identity and token != guid(expected.identity()):
        return "was built of other code than there is now"
    return ""
