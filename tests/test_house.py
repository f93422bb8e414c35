"""How the package is laid out: what a reader may rely on."""

from collections import Counter
from pathlib import Path

import hovercraft_fmu

PACKAGE = Path(hovercraft_fmu.__file__).parent


def test_a_module_name_stands_once() -> None:
    names = Counter(path.name for path in PACKAGE.rglob("*.py") if not path.name.startswith("__"))
    assert [name for name, count in names.items() if count > 1] == []
