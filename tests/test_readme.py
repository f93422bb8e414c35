"""The README promises nothing that does not run."""

import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.conftest import ROOT
from tests.shell import Shell

README = (ROOT / "README.md").read_text(encoding="utf-8")
OWN = ".venv/bin/hovercraft-fmu "


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)


def commands() -> list[str]:
    """Every command of this package; what else is in the blocks of shell .ci/run takes from there."""
    lines = [line for block in blocks("bash") for line in block.splitlines()]
    parts = [part.strip() for line in lines for part in line.split("&&")]
    return [part for part in parts if part.startswith(OWN)]


@pytest.fixture
def folder(native_at_hand: Path, autopilot: Path, tmp_path: Path) -> Path:
    """A folder with FMUs in build/."""
    shutil.copy(autopilot, native_at_hand.parent)
    return tmp_path


@pytest.mark.parametrize("code", blocks("python"))
def test_python_blocks_run(code: str, folder: Path) -> None:
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], cwd=folder, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout
    assert "warning" not in done.stdout.lower()  # fmpy prints it of an input without a column
    assert "[" not in done.stdout  # numbers, no arrays


DEMOS = [f"{OWN}demo", f"{OWN}demo --loop"]


def test_the_demos_are_those_of_other_tests() -> None:
    """The first command of all, which test_cli.py runs as a program, and the one that test_loops.py runs."""
    assert commands()[0] == DEMOS[0]
    assert [each for each in commands() if "demo" in each] == DEMOS


@pytest.mark.parametrize("command", [each for each in commands() if each not in DEMOS])
@pytest.mark.usefixtures("folder")
def test_commands_run(command: str, shell: Shell) -> None:
    shell.ok(*shlex.split(command.removeprefix(OWN)))


def test_pictures_and_links_exist() -> None:
    targets = re.findall(r"\]\(([^)]+)\)", README)
    assert targets
    assert all((ROOT / target).is_file() for target in targets)
