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


DEMO = f"{OWN}demo"


def test_it_is_short_and_begins_with_the_demo() -> None:
    """The first command of all is run as a program by test_cli.py."""
    assert len(README.splitlines()) <= 150
    assert commands()[0] == DEMO


@pytest.mark.parametrize("command", [each for each in commands() if each != DEMO])
@pytest.mark.usefixtures("folder")
def test_commands_run(command: str, shell: Shell) -> None:
    shell.ok(*shlex.split(command.removeprefix(OWN)))


def test_pictures_and_links_exist() -> None:
    targets = re.findall(r"\]\(([^)]+)\)", README)
    assert targets
    assert all((ROOT / target).is_file() for target in targets)
