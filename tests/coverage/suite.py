"""The ordinary suite in a copy of the tree, each test file in a process of its own, with what measures it."""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Protocol

from hovercraft_fmu.libraries import compile_libraries
from tests.coverage.branches import ROOT, Branch, Taken

RESULTS = ROOT / "build" / "coverage"
"""What a run leaves; the copy of the tree is in it."""
LEFT_OUT = shutil.ignore_patterns(".git", ".venv*", "build", "__pycache__", ".*_cache", ".hypothesis")


class Part(Protocol):
    """One language."""

    goal: Sequence[str]
    """Folders and files, from ROOT, of which every branch is to be taken."""

    def __init__(self, tree: Path) -> None:
        """Prepare the copy of the tree. Raises RuntimeError."""

    @staticmethod
    def missing() -> str:
        """Why it cannot be measured here; '' where it can."""

    def environment(self, test_file: Path) -> Mapping[str, str]:
        """What the pytest of that file needs."""

    def taken(self) -> Taken:
        """Once all have run."""


def run(parts: Sequence[type[Part]], files: Sequence[Path]) -> tuple[Taken, list[Path]]:
    """The branches, and the files of which a test failed, or that have none.

    Raises RuntimeError: C does not compile.
    """
    if why := compile_libraries():
        raise RuntimeError(why)
    shutil.rmtree(RESULTS, ignore_errors=True)
    tree = RESULTS / "tree"
    shutil.copytree(ROOT, tree, ignore=LEFT_OUT)
    (tree / "build").mkdir()
    for name in (".gitignore", "README.md"):
        shutil.copy(ROOT / "build" / name, tree / "build")
    made = [part(tree) for part in parts]
    taken: dict[Branch, bool] = {}
    with tempfile.TemporaryDirectory(prefix="coverage-") as place, ThreadPoolExecutor(os.cpu_count()) as pool:
        ended = list(pool.map(lambda file: _tested(made, tree, file, Path(place)), files))
        for part in made:
            taken |= part.taken()
    return taken, [file for file, well in zip(files, ended, strict=True) if not well]


def _tested(parts: Sequence[Part], tree: Path, file: Path, place: Path) -> bool:
    """Whether that file has tests, and all passed; what they said is in RESULTS, what they made in `place`."""
    added = {"PYTHONPATH": str(tree)}
    for part in parts:
        added |= part.environment(file)
    with (RESULTS / f"{file.stem}.txt").open("w") as said:
        command = [
            sys.executable,
            "-m",
            "pytest",
            "-p",
            "no:cacheprovider",
            "--basetemp",
            str(place / file.stem),
            str(file),
        ]
        done = subprocess.run(
            command, cwd=tree, env={**os.environ, **added}, stdout=said, stderr=said, stdin=subprocess.DEVNULL,
            check=False,
        )  # fmt: skip
    return done.returncode == 0
