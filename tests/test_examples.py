"""The examples run as they stand, in a folder with FMUs in build/."""

import ast
import json
import re
import runpy
import shutil
from pathlib import Path
from typing import Any

import nbformat
import pytest

import hovercraft_fmu.examples
from hovercraft_fmu.building.ssp import build_ssp
from hovercraft_fmu.elsewhere import HOSTS
from tests.conftest import Fresh

HERE = Path(hovercraft_fmu.examples.__file__).parent
PRINTED = {
    "fmpy_alone": r"\A\(\d+\.\d+, -?\d+\.\d+\) m, -?\d+\.\d deg\n$",
    "one_run": r"error, as told .*\n(.*\n)+the cheapest way to a millimetre on a slalom: \w+, \S+ s\n$",
    "sweep_in_pandas": r"mass  .*\n",
    "many_craft": r"^set aside by \d+\.\d\d m where light, by \d+\.\d\d m where heavy; 0 were refused\n$",
}
"""What each prints."""


@pytest.fixture
def folder(native_at_hand: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The current one."""
    monkeypatch.chdir(native_at_hand.parents[1])
    return native_at_hand.parents[1]


def test_scripts_are_short_and_all_are_run() -> None:
    scripts = {path.stem: path.read_text(encoding="utf-8") for path in HERE.glob("*.py") if path.stem != "__init__"}
    assert scripts.keys() - {"cloud"} == PRINTED.keys() | {"in_libcosim"}
    assert all(len(text.splitlines()) <= 30 for name, text in scripts.items() if name != "cloud")


@pytest.mark.usefixtures("folder")
@pytest.mark.parametrize("name", PRINTED)
def test_a_script_runs(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    if name in ("one_run", "sweep_in_pandas"):
        pytest.importorskip("pandas")
    runpy.run_path(str(HERE / f"{name}.py"), run_name="__main__")
    assert re.search(PRINTED[name], capsys.readouterr().out, re.MULTILINE)


def test_the_loop_in_libcosim_runs(folder: Path, native_fmu: Path, native_autopilot: Path, fresh: Fresh) -> None:
    """In a process of its own, as it loads a library that others wrote."""
    if missing := HOSTS["libcosimpy"].missing():
        pytest.skip(missing)
    shutil.copy(build_ssp(folder / "HovercraftNativeLoop.ssp", native_fmu, native_autopilot), folder / "build")
    printed = fresh((HERE / "in_libcosim.py").read_text(encoding="utf-8"))
    assert re.search(r"^after 5 min: \(\d\d\.\d, -?\d+\.\d\) m$", printed, re.MULTILINE)


@pytest.mark.usefixtures("folder")
def test_the_notebook_runs() -> None:
    """It is one as Jupyter wants it; each cell runs after those before, and shows something by its last line."""
    pytest.importorskip("pandas")
    notebook = json.loads((HERE / "first_steps.ipynb").read_text(encoding="utf-8"))
    nbformat.validate(notebook)
    names: dict[str, Any] = {}
    shown = []
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            assert cell["outputs"] == []
            *body, last = ast.parse("".join(cell["source"])).body
            assert isinstance(last, ast.Expr)
            exec(compile(ast.Module(body, []), "cell", "exec"), names)
            shown.append(eval(compile(ast.Expression(last.value), "cell", "eval"), names))
    assert "ice" in shown[0]
    assert type(shown[2]).__name__ == "Figure"
    assert "<svg" in shown[1]._repr_html_()
    assert shown[3] < 0.0  # twice as heavy it comes less far
    assert "as told" in repr(shown[5])
