"""The Python, by coverage.py, in all processes of the run: pytest's, commands, the slaves inside FMUs.

A run leaves build/coverage/python.sqlite. Its contexts are the tests that ran a line, by the names that pytest takes
('' is what runs outside of them: what importing runs):

    data = coverage.CoverageData("build/coverage/python.sqlite")
    data.read()
    data.contexts_by_lineno(str(ROOT / "hovercraft_fmu/model/craft.py"))  # {line: [test, ...]}

What a fixture of a whole session runs, an FMU's building, stands by the first test of each file that asked for it.
"""

import importlib.util
import json
import site
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from tests.coverage.branches import ROOT, Branch, Taken

PACKAGE = ROOT / "hovercraft_fmu"
TEST = "COVERED_TEST"
"""The environment variable of the test that runs."""
HOOK = "*coverage.pth"
"""What coverage installs beside itself."""
PLUGIN = {"PYTEST_PLUGINS": "tests.coverage.plugin"}
# What a Python FMU carries is a copy: resources/hovercraft_<digest>/model/craft.py.
CONFIGURATION = """\
[run]
branch = true
parallel = true
data_file = {data}
include =
    {tree}/hovercraft_fmu/**/*.py
    */resources/*_????????????????/*
omit = */pythonfmu/*
concurrency = multiprocessing,thread
patch = _exit
context = ${{{test}-}}
disable_warnings = no-data-collected

[paths]
package =
    {package}
    {tree}/hovercraft_fmu
    */resources/*_????????????????
"""


class Python:
    """the Python of hovercraft_fmu/"""

    goal: Sequence[str] = tuple(f"{PACKAGE.name}/{room}/" for room in ("model", "fmu", "host"))

    def __init__(self, tree: Path) -> None:
        self.data = tree.parent / "python.sqlite"
        self.parts = tree.parent / "python"
        self.parts.mkdir()
        self.configuration = self.parts / "coverage.ini"
        names = {"data": self.parts / self.data.name, "tree": tree, "package": PACKAGE, "test": TEST}
        self.configuration.write_text(CONFIGURATION.format(**names), encoding="utf-8")

    @staticmethod
    def missing() -> str:
        """Why it cannot be measured here."""
        folders = (*site.getsitepackages(), site.getusersitepackages())
        if importlib.util.find_spec("coverage") and any(path for each in folders for path in Path(each).glob(HOOK)):
            return ""
        return f"no coverage that starts with each Python ({HOOK}): pip install -e '.[test]'"

    def environment(self, test_file: Path) -> Mapping[str, str]:  # noqa: ARG002 - all files alike
        """Every process of the run finds the configuration there."""
        return {**PLUGIN, "COVERAGE_PROCESS_START": str(self.configuration)}

    def taken(self) -> Taken:
        """Ways out of lines that have several; and, so that none hides, statements that never run."""
        from coverage import Coverage

        measured = Coverage(data_file=str(self.data), config_file=str(self.configuration))
        measured.combine([str(self.parts)], strict=True)
        measured.get_data().touch_files([str(path) for path in PACKAGE.rglob("*.py")])
        measured.save()
        report = self.parts / "report.json"
        measured.json_report(include=[f"{PACKAGE}/**/*.py"], outfile=str(report))
        files = json.loads(report.read_text(encoding="utf-8"))["files"]
        return {branch: was for name, seen in files.items() for branch, was in _branches(name, seen)}


def _branches(name: str, seen: Mapping[str, Any]) -> Iterator[tuple[Branch, bool]]:
    text = (ROOT / name).read_text(encoding="utf-8").splitlines()
    for key, was in (("executed_branches", True), ("missing_branches", False)):
        for start, end in seen[key]:
            yield Branch(name, start, 0, f"to {text[end - 1].strip()}" if end > 0 else "out"), was
    for line in seen["missing_lines"]:
        yield Branch(name, line, 0, "run"), False
