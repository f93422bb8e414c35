"""What this package makes: a table of files, and one function that writes any of them."""

import os
import platform
import sys
import zipfile
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import MappingProxyType
from typing import Literal, NamedTuple, TypeAlias, get_args
from xml.etree.ElementTree import ParseError, fromstring

from .._version import __version__
from ..autopilot.pilot_native import AUTOPILOT, AUTOPILOT_NATIVE, AUTOPILOT_NATIVE3
from ..autopilot.pilot_package import CONTENT as AUTOPILOT_CONTENT
from ..autopilot.pilot_package import build_autopilot, build_native_autopilot
from ..fmu.archive import check_target
from ..fmu.block import guid
from ..fmu.description import NATIVE, NATIVE3, PYTHON, Flavour
from ..fmu.machine_code import identity
from ..fmu.native_package import build_native_fmu
from ..fmu.near_names import explains_keywords, must_be_one_of
from ..fmu.python_package import build_fmu, hovercraft_content, python_identity
from ..fmu.start_values import Value, variant
from ..tether.tether_native import TETHER_NATIVE, TETHER_NATIVE3
from ..tether.tether_package import CONTENT as TETHER_CONTENT
from ..tether.tether_package import build_native_tether, build_tether
from ..view.page import FILE as PAGE
from ..view.page import page
from ..whole import temporary_folder
from .ssp import build_ssp, build_tow_ssp

Kind: TypeAlias = Literal[
    "native", "native3", "python",
    "native_autopilot", "native3_autopilot", "autopilot",
    "native_tether", "native3_tether", "tether",
    "native_loop", "native3_loop", "python_loop",
    "native_tow", "native3_tow",
]  # fmt: skip
FOLDER = Path("build")


class Product(NamedTuple):
    """A file."""

    name: str
    purpose: str
    """What it is for."""
    write: Callable[[Path], Path]
    identity: Callable[[], str] | None = None
    """Of an FMU: what it is, in 32 hexadecimal digits."""


FLAVOURS: Mapping[str, Flavour] = MappingProxyType({"native": NATIVE, "native3": NATIVE3, "python": PYTHON})
"""The FMUs of the hovercraft, by kind."""
AUTOPILOTS: Mapping[int, Flavour] = MappingProxyType({2: AUTOPILOT_NATIVE, 3: AUTOPILOT_NATIVE3})
"""Machine code, by standard."""
LOOPS: Mapping[str, str] = MappingProxyType({f"{kind}_loop": kind for kind in FLAVOURS})
"""A closed loop -> the kind of the FMU in it."""


def _craft(flavour: Flavour) -> Callable[[Path], Path]:
    if not flavour.parts:
        return lambda path: build_fmu(path, flavour)
    return lambda path: build_native_fmu(path, flavour, more={PAGE: page(flavour)})


def _pilot(flavour: Flavour) -> Callable[[Path], Path]:
    """The autopilot of the same standard and kind as that FMU of the hovercraft."""
    if not flavour.native:
        return build_autopilot
    return lambda path: build_native_autopilot(path, AUTOPILOTS[flavour.fmi])


def _loop(flavour: Flavour) -> Product:
    own = AUTOPILOTS[flavour.fmi] if flavour.native else AUTOPILOT
    fmu, pilot = f"{flavour.identifier}.fmu", f"{own.identifier}.fmu"

    def write(path: Path) -> Path:
        check_target(path, ".ssp")
        with temporary_folder() as folder:
            return build_ssp(path, _craft(flavour)(Path(folder) / fmu), _pilot(flavour)(Path(folder) / pilot))

    purpose = f"SSP 1.0: the closed loop of {fmu} and {pilot}, for co-simulation masters"
    return Product(f"{flavour.identifier}Loop.ssp", purpose, write)


def _tow(craft: Flavour, tether: Flavour) -> Product:
    fmu, line = f"{craft.identifier}.fmu", f"{tether.identifier}.fmu"

    def write(path: Path) -> Path:
        check_target(path, ".ssp")
        with temporary_folder() as folder:
            files = _craft(craft)(Path(folder) / fmu), build_native_tether(Path(folder) / line, tether)
            return build_tow_ssp(path, *files)

    purpose = f"SSP 1.0: a tow of {fmu}, twice, and {line}, for co-simulation masters"
    return Product(f"{craft.identifier}Tow.ssp", purpose, write)


PRODUCTS: Mapping[Kind, Product] = MappingProxyType(
    {
        "native": Product(
            "HovercraftNative.fmu",
            "FMI 2.0, machine code: for every tool; needs nothing",
            _craft(NATIVE),
            lambda: identity(NATIVE),
        ),
        "native3": Product(
            "HovercraftNative3.fmu",
            "FMI 3.0, machine code: for tools that want FMI 3.0, and for arm64 Linux in fmpy",
            _craft(NATIVE3),
            lambda: identity(NATIVE3),
        ),
        "python": Product(
            "Hovercraft.fmu",
            "FMI 2.0, Python: to read or change the model; needs Python 3.10 or newer where it runs",
            _craft(PYTHON),
            lambda: python_identity(hovercraft_content(PYTHON)),
        ),
        "native_autopilot": Product(
            "AutopilotNative.fmu",
            "FMI 2.0, machine code: takes the craft from waypoint to waypoint",
            _pilot(NATIVE),
            lambda: identity(AUTOPILOT_NATIVE),
        ),
        "native3_autopilot": Product(
            "AutopilotNative3.fmu",
            "FMI 3.0, machine code: takes the craft from waypoint to waypoint",
            _pilot(NATIVE3),
            lambda: identity(AUTOPILOT_NATIVE3),
        ),
        "autopilot": Product(
            "Autopilot.fmu",
            "FMI 2.0, Python: takes the craft from waypoint to waypoint; to read or change the law",
            build_autopilot,
            lambda: python_identity(AUTOPILOT_CONTENT),
        ),
        "native_tether": Product(
            "TetherNative.fmu",
            "FMI 2.0, machine code: a line between two hovercraft",
            lambda path: build_native_tether(path, TETHER_NATIVE),
            lambda: identity(TETHER_NATIVE),
        ),
        "native3_tether": Product(
            "TetherNative3.fmu",
            "FMI 3.0, machine code: a line between two hovercraft",
            lambda path: build_native_tether(path, TETHER_NATIVE3),
            lambda: identity(TETHER_NATIVE3),
        ),
        "tether": Product(
            "Tether.fmu",
            "FMI 2.0, Python: a line between two hovercraft; to read or change the law",
            build_tether,
            lambda: python_identity(TETHER_CONTENT),
        ),
        "native_loop": _loop(NATIVE),
        "native3_loop": _loop(NATIVE3),
        "python_loop": _loop(PYTHON),
        "native_tow": _tow(NATIVE, TETHER_NATIVE),
        "native3_tow": _tow(NATIVE3, TETHER_NATIVE3),
    }
)
assert tuple(PRODUCTS) == get_args(Kind)


@explains_keywords
def build(
    kind: Kind = "native",
    path: str | os.PathLike[str] | None = None,
    *,
    name: str | None = None,
    preset: str | None = None,
    start_values: Mapping[str, Value] | None = None,
) -> Path:
    """Write a file of that kind to `path` (its folder is made) and return the path; two builds give the same bytes.

    Args:
        kind: what: the key of a row of PRODUCTS.
        path: the file; without it that of PRODUCTS, or the name given here, in build/.
        name: of an FMU with start values of its own: a C identifier. (Of a loop: of the FMU in it.)
        preset: a craft whose values those are.
        start_values: and others, by name; they come after the preset's.

    Raises:
        ValueError: no such kind, or the path does not end in .fmu (.ssp for a loop or a tow); a name, preset or start
            value that cannot be.
        NotCompiledError: there is no machine code for a native one; the message says how to get it.
        OSError: the file cannot be written; one that stood there before still does.
    """
    chosen = product(kind) if name is None else variant_product(kind, name, preset, start_values)
    if name is None and (preset is not None or start_values):
        raise ValueError("name: must be given, as an FMU with start values of its own is not to be taken for another")
    return chosen.write(FOLDER / chosen.name if path is None else Path(path))


def variant_product(kind: str, name: str, preset: str | None, start_values: Mapping[str, Value] | None) -> Product:
    """A row for an FMU with start values of its own, or a loop with it. Raises ValueError as `build` does."""
    row, ordinary = product(kind), FLAVOURS.get(LOOPS.get(kind, kind))
    if ordinary is None:
        can = ", ".join((*FLAVOURS, *LOOPS))
        raise ValueError(f"kind = {kind!r}: must be one of {can} to have start values of its own")
    # without regard to case, as some file systems are
    if taken := [each.name for each in PRODUCTS.values() if Path(each.name).stem.lower() == name.lower()]:
        raise ValueError(f"name = {name!r}: must be another one: {taken[0]} has no start values of its own")
    flavour = variant(ordinary, name, start_values, preset)
    own = _loop(flavour) if kind in LOOPS else row._replace(name=f"{name}.fmu", write=_craft(flavour), identity=None)
    return own._replace(purpose="; ".join(filter(None, (own.purpose, flavour.model.listed(flavour.own_starts)))))


def product(kind: str) -> Product:
    """The row of PRODUCTS. Raises ValueError: no such kind."""
    for known, row in PRODUCTS.items():
        if kind == known:
            return row
    raise ValueError(must_be_one_of("kind", kind, PRODUCTS))


def default_kind() -> Kind:
    """The FMU that is run where none is named: machine code, FMI 2.0; on arm64 Linux FMI 3.0, as fmpy takes linux64 for
    the folder of FMI 2.0 there, too.
    """
    return "native3" if sys.platform == "linux" and platform.machine() == "aarch64" else "native"


def default_autopilot_kind() -> Kind:
    """The same of the autopilot."""
    return "native3_autopilot" if default_kind() == "native3" else "native_autopilot"


def default_tether_kind() -> Kind:
    """The same of the tether."""
    return "native3_tether" if default_kind() == "native3" else "native_tether"


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


@contextmanager
def fmu_to_try(kind: Kind | None = None) -> Iterator[Path]:
    """The same file; where it is not there one that is gone with the context, so that nothing is left in build/."""
    kind = kind or default_kind()
    name = product(kind).name
    if (FOLDER / name).exists():
        yield default_fmu(kind)
        return
    with temporary_folder() as folder:
        yield build(kind, Path(folder) / name)


def built_fmus() -> list[Path]:
    """The FMUs of PRODUCTS that are in build/; where there is none the default one, which is built.

    Raises as `default_fmu` does.
    """
    kinds = [kind for kind, each in PRODUCTS.items() if each.identity and (FOLDER / each.name).exists()]
    return [default_fmu(kind) for kind in kinds or [default_kind()]]


def _foreign(path: Path, expected: Product) -> str:
    """What a file that was built before is, where it is not what this package builds; '' where it is that."""
    try:
        with zipfile.ZipFile(path) as archive:
            root = fromstring(archive.read("modelDescription.xml"))  # noqa: S314 - entities are bounded
    except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, KeyError, ParseError) as error:
        return f"must be an FMU with a model description ({error})"
    version, token = root.get("version"), root.get("guid") or root.get("instantiationToken")
    if version != __version__:
        return f"is of version {version} of hovercraft-fmu, which is {__version__} now"
    if expected.identity and token != guid(expected.identity()):
        return "was built of other code than there is now"
    return ""
