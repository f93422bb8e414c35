"""The README promises nothing that does not run."""

import re
import subprocess
import sys
from pathlib import Path

import pytest

from hovercraft_fmu import build_fmu
from tests.conftest import ROOT

README = (ROOT / "README.md").read_text(encoding="utf-8")
BIN = Path(sys.executable).parent


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", README, re.MULTILINE | re.DOTALL)


def commands() -> list[str]:
    """Every shell command but the making of the environment that these tests run in, and these tests themselves."""
    lines = [line for block in blocks("bash") for line in block.splitlines()]
    parts = [part.strip() for line in lines for part in line.split("&&")]
    return [part for part in parts if not re.search(r"-m venv|pip install|pytest -n logical$", part)]


def test_the_parts_are_found() -> None:
    assert len(blocks("python")) == 2
    assert len(commands()) == 11
    assert commands()[0].endswith("hovercraft-fmu demo")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with the FMU in build/."""
    build_fmu(tmp_path / "build" / "Hovercraft.fmu")
    return tmp_path


@pytest.mark.parametrize("code", blocks("python"))
def test_python_blocks_run(code: str, folder: Path) -> None:
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], cwd=folder, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout


@pytest.mark.parametrize("command", commands())
def test_commands_run(command: str, folder: Path) -> None:
    """In this environment: the package's own command in a folder apart, the developer's tools in the checkout."""
    place = folder if "/hovercraft-fmu " in command else ROOT
    command = command.replace(".venv/bin/", f"{BIN}/")
    done = subprocess.run(command, shell=True, cwd=place, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr


def test_pictures_and_links_exist() -> None:
    targets = re.findall(r"\]\(([^)]+)\)", README)
    assert targets
    assert all((ROOT / target).is_file() for target in targets)
