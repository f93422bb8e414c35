"""How the package is laid out: what a reader may rely on."""

import ast
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest

import hovercraft_fmu
from tests.conftest import Fresh

PACKAGE = Path(hovercraft_fmu.__file__).parent
FLOORS = (
    ("_version", "model", "whole"),
    ("stopping",),
    ("fmu",),
    ("autopilot", "scenes"),
    ("tether",),
    ("libraries",),
    ("view.page",),
    ("building",),
    ("host", "drawing"),
    ("simulation", "elsewhere"),
    ("coupling", "cross_check"),
    ("towing",),
    ("view",),
    ("sweeps", "validation", "examples"),
    ("studies",),
    ("cli",),
    ("__main__",),
)
"""What imports only from floors above it in this table, never from beside it; __init__ is the door. The page
has a floor of its own: the FMUs carry it."""
LEVELS = {name: level for level, names in enumerate(FLOORS) for name in names}


def _rooms() -> set[str]:
    """The modules and packages right below the package."""
    paths = [path for path in PACKAGE.iterdir() if path.suffix == ".py" or any(path.glob("*.py"))]
    return {path.stem for path in paths} - {"__init__"}


def _imports(path: Path) -> Iterator[str]:
    """The dotted names that a file imports, wherever in it; relative ones in full."""
    package = ("hovercraft_fmu", *path.relative_to(PACKAGE).parts[:-1])
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            stem = package[: len(package) - node.level + 1] if node.level else ()
            yield from (".".join((*stem, *filter(None, (node.module, alias.name)))) for alias in node.names)


def _room(name: str) -> str:
    """The one that a dotted name is in."""
    return next((".".join(name.split(".")[:n]) for n in (2, 1) if ".".join(name.split(".")[:n]) in LEVELS), name)


def test_every_room_has_a_floor() -> None:
    assert sorted(name for name in LEVELS if "." not in name) == sorted(_rooms())


@pytest.mark.parametrize("room", LEVELS)
def test_imports_point_downward(room: str) -> None:
    """All imports, also those within a function or for types alone."""
    place = PACKAGE / room.replace(".", "/")
    files = [place.with_name(f"{place.name}.py"), *place.rglob("*.py")]
    wrong = [
        f"{path.relative_to(PACKAGE)} imports {name}"
        for path in files
        if path.exists() and _room(".".join(path.relative_to(PACKAGE).with_suffix("").parts)) == room
        for name in _imports(path)
        if name.startswith("hovercraft_fmu.")
        and (other := _room(name.removeprefix("hovercraft_fmu."))) != room
        and LEVELS.get(other, -1) >= LEVELS[room]
    ]
    assert wrong == []


def test_a_module_name_stands_once() -> None:
    names = Counter(path.name for path in PACKAGE.rglob("*.py") if not path.name.startswith("__"))
    assert [name for name, count in names.items() if count > 1] == []


@pytest.mark.parametrize("code", ["import hovercraft_fmu", "from hovercraft_fmu.cli import main; main(['--help'])"])
def test_nothing_is_loaded_before_it_is_needed(code: str, fresh: Fresh) -> None:
    """The measure is the libraries that take time to load; the command itself needs click and rich."""
    heavy = "numpy", "fmpy", "lxml", "PIL", "jinja2", "scipy", "matplotlib", "polars"
    tell = f"import atexit, sys; atexit.register(lambda: print([name for name in {heavy} if name in sys.modules])); "
    assert fresh(tell + code).splitlines()[-1] == "[]"
