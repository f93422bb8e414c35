"""How the package is laid out: what a reader may rely on."""

from collections import Counter
from pathlib import Path

import pytest

import hovercraft_fmu
from tests.conftest import Fresh

PACKAGE = Path(hovercraft_fmu.__file__).parent


def test_a_module_name_stands_once() -> None:
    names = Counter(path.name for path in PACKAGE.rglob("*.py") if not path.name.startswith("__"))
    assert [name for name, count in names.items() if count > 1] == []


@pytest.mark.parametrize("code", ["import hovercraft_fmu", "from hovercraft_fmu.cli import main; main(['--help'])"])
def test_nothing_is_loaded_before_it_is_needed(code: str, fresh: Fresh) -> None:
    """The measure is the libraries that take time to load; the command itself needs click and rich."""
    heavy = "numpy", "fmpy", "lxml", "PIL", "jinja2", "scipy", "matplotlib", "polars"
    tell = f"import atexit, sys; atexit.register(lambda: print([name for name in {heavy} if name in sys.modules])); "
    assert fresh(tell + code).splitlines()[-1] == "[]"
