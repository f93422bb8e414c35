"""The README promises nothing that does not run."""

import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from hovercraft_fmu.sweeps import load
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


@pytest.mark.usefixtures("fleet")
def test_the_job_script_on_the_page_makes_the_sweep(shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    """With the variables that SLURM gives to the tasks of an array."""
    page = (ROOT / "hovercraft_fmu/fmu/documentation/sweeps.html").read_text(encoding="utf-8")
    (script,) = (block for block in re.findall(r"<pre>\n(.*?)</pre>", page, re.DOTALL) if "#SBATCH --array=1-" in block)
    (command,) = re.findall(rf"^{OWN}(.*)", script.replace("\\\n", ""), re.MULTILINE)
    study = (
        'scene = "turn"\nstop_time = 1.0\nset.step_size = 0.1\nsweep.mass = [60, 80, 100, 120]\nkeep.end = ["speed"]\n'
    )
    (shell.folder / "STUDY.toml").write_text(study)
    monkeypatch.setenv("SLURM_ARRAY_TASK_COUNT", "2")
    for number in "21":
        monkeypatch.setenv("SLURM_ARRAY_TASK_ID", number)
        words = shlex.split(os.path.expandvars(command).replace("/scratch/me/", ""))
        printed = shell.ok(*words, "--workers", "1")
        assert printed.startswith("study: 2 runs, 2 of them made now")
        assert ("2 of the 4 runs of the study, of other parts, are missing yet" in printed) == (number == "2")
    assert load(shell.folder / "study").to_table()["run"].to_pylist() == [0, 1, 2, 3]
