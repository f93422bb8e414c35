"""The FMU in hosts that others wrote: the bits that fmpy gives, which are the bare model's."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from click.testing import CliRunner

from hovercraft_fmu.cli import commands
from hovercraft_fmu.elsewhere import COMMUNICATION_STEP, CONTROLS, hosts_of, module_command, run_in
from hovercraft_fmu.fmu import document
from hovercraft_fmu.fmu.description import NATIVE, NATIVE3, PYTHON, Flavour
from hovercraft_fmu.fmu.document import pages
from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.dynamics import Controls, State
from hovercraft_fmu.model.observation import observe_motion
from hovercraft_fmu.model.subcycling import advance
from tests.conftest import ROOT

DOCUMENTATION = ROOT / "hovercraft_fmu" / "fmu" / "documentation"
TABLES = {"python": "checked.md", "native": "checked_native.md", "native3": "checked_native3.md"}


def test_fmpy_gives_the_bits_of_the_bare_model(fmu: Path) -> None:
    """And every other host those of fmpy: see the table. (The error estimates are off: 0.)"""
    state, expected = State(), []
    for controls in CONTROLS:
        state = advance(state, Controls(*controls), Craft(), COMMUNICATION_STEP).state
        expected.append([*state, *observe_motion(state), 0.0, 0.0])
    assert run_in("fmpy", fmu) == expected


@pytest.mark.parametrize("started", ["hovercraft_fmu.elsewhere", "fmu_manipulation_toolbox"])
def test_a_host_runs_no_module_of_the_current_folder(
    started: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`validate --table` once ran an fmpy.py that lay there."""
    for name in ("fmpy", "numpy", "json", "runpy", started):
        (tmp_path / f"{name}.py").write_text("raise SystemExit('a module of the current folder')")
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend("")
    done = subprocess.run(module_command(started, "-h"), capture_output=True, text=True, check=False)
    assert "a module of the current folder" not in done.stderr
    as_before = subprocess.run([sys.executable, "-m", started], capture_output=True, text=True, check=False)
    assert "a module of the current folder" in as_before.stderr


def _without_versions(table: str) -> list[list[str]]:
    rows = [line.strip("| ").split(" | ") for line in table.strip().splitlines()]
    return [[checker, what, result] for checker, _, what, result in rows]


def test_the_table_is_what_the_command_prints(each_fmu: Path, flavour: str) -> None:
    """Versions move on; checkers, what was run, and the results are those of the committed table."""
    if missing := "".join(host.missing() for host in hosts_of(each_fmu).values()):
        pytest.skip(missing)
    table = (DOCUMENTATION / TABLES[flavour]).read_text(encoding="utf-8")
    done = CliRunner().invoke(commands, ["validate", "--table", str(each_fmu)])
    assert done.exit_code == 0, done.output
    assert _without_versions(done.stdout) == _without_versions(table)
    assert all(row[-1] == "ok" for row in _without_versions(table)[2:])
    assert re.search(r"\| fmpy \| \d", table)


@pytest.mark.parametrize("flavour", [PYTHON, NATIVE, NATIVE3], ids=lambda flavour: flavour.identifier)
def test_the_page_shows_the_table_and_is_made_without_it(
    flavour: Flavour, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first build comes before the first check."""
    host = "<td>LD_PRELOAD=" if flavour == PYTHON else "<td>no Python</td>"
    page = pages(flavour)["index.html"]
    assert "Where it ran" in page
    assert host in page
    folder = tmp_path / "documentation"
    shutil.copytree(DOCUMENTATION, folder, ignore=shutil.ignore_patterns("checked*.md"))
    monkeypatch.setattr(document, "FOLDER", folder)
    assert "Where it ran" not in pages(flavour)["index.html"]
