"""The C, by clang's source-based coverage: both ways of each condition that stands in the code.

In the copy of the tree the compiled libraries of this machine are exchanged for such that count, and the compilers'
names stand for scripts by which what tests compile counts, too (what clang cannot make the compiler that was meant
makes, as it was meant). Code for Windows and WebAssembly alone is not compiled here, so not counted.

A run leaves in build/coverage/:

    c_lines.json  {"hovercraft_fmu/fmu/native/...": {"LINE": ["tests/test_....py", ...]}}: the files of tests that
                  execute a line of C; the list is empty where none executes a line that has code
    TEST_FILE.txt what pytest said
"""

import hashlib
import itertools
import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from hovercraft_fmu.elsewhere import COMPILERS
from hovercraft_fmu.fmu.machine_code import C_FOLDER, LIBRARY_OPTIONS, OPTIONS, Library
from hovercraft_fmu.libraries import libraries
from tests.coverage.branches import ROOT, Branch, Taken

PLATFORM = "x86_64-linux"
COUNTING = ("-fprofile-instr-generate", "-fcoverage-mapping")
"""Counts are of the source, whatever is optimized."""
OURS = {path.name: str(path.relative_to(ROOT)) for path in C_FOLDER.rglob("*.[ch]")}
"""Each name is there once."""
AS_SHIPPED = (
    "test_build.py::test_the_wheel_of_a_checkout_and_of_the_sdist_and_their_fmus",
    "test_native_binaries.py::test_it_is_small",
    "test_native_binaries.py::test_libraries_of_linux",
    "test_native_platforms.py::test_the_hosts_floating_point_environment_changes_no_bit_and_is_left_as_it_was",
    "test_native_sources.py::test_a_linker_sees_the_fmi_functions_alone",
)
"""Tests that look at bytes, sizes or symbols, or need another compiler: left out."""
WAYS = (("true", 4), ("false", 5))
"""Of a condition, and where llvm-cov has the count."""
WRAPPER = """\
#!/bin/sh
# What {compiler} makes, as clang makes it with counters; what clang cannot make, or what none would count, as it is.
case " $* " in *" -print-"*|*" --version "*{others}) exec {compiler} "$@";; esac
{clang} {counting} -w "$@" 2> /dev/null || exec {compiler} "$@"
while [ $# -gt 1 ]; do
    if [ "$1" = -o ]; then cp "$2" "{objects}/$$-$(basename "$2")"; fi
    shift
done
exit 0
"""


class C:
    """the C of native/"""

    goal: Sequence[str] = ("hovercraft_fmu/fmu/native/",)

    def __init__(self, tree: Path) -> None:
        self.tree = tree
        self.objects = tree.parent / "objects"
        self.counts = tree.parent / "counts"
        self.scripts = tree.parent / "scripts"
        for folder in (self.objects, self.counts, self.scripts):
            folder.mkdir()
        words = {"clang": shutil.which("clang"), "counting": " ".join(COUNTING), "objects": self.objects}
        for name in COMPILERS:
            if compiler := shutil.which(name):
                others = "" if name == "clang" else '|*" -fsanitize"*'  # their runtimes are their own
                (self.scripts / name).write_text(WRAPPER.format(compiler=compiler, others=others, **words))
                (self.scripts / name).chmod(0o755)
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(self._compile, libraries()))

    @staticmethod
    def missing() -> str:
        """Why it cannot be measured here."""
        if sys.platform != "linux":
            return "the C is measured on Linux alone"
        absent = [name for name in ("clang", "llvm-profdata", "llvm-cov") if not shutil.which(name)]
        return f"no {absent[0]}: apt-get install clang llvm" if absent else ""

    def environment(self, test_file: Path) -> Mapping[str, str]:
        """Its counts in a folder of its own: one file for each program or library, whichever process runs it."""
        folder = self.counts / test_file.stem
        return {
            "PATH": f"{self.scripts}{os.pathsep}{os.environ['PATH']}",
            "LLVM_PROFILE_FILE": f"{folder}/%m.profraw",
            "PYTEST_ADDOPTS": " ".join(f"--deselect=tests/{name}" for name in AS_SHIPPED),
        }

    def _compile(self, library: Library) -> None:
        """In place of what is shipped."""
        folder = self.objects / f"{library.name}.sources"
        for name, content in library.files.items():
            path = folder / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_bytes(content)
        made = self.objects / f"{library.name}.so"
        command = ["clang", *COUNTING, *OPTIONS, *LIBRARY_OPTIONS, "-I.", "-shared", "-fPIC", *library.sources]
        done = subprocess.run([*command, "-o", str(made)], cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise RuntimeError(f"compiling {library.name} failed: {done.stderr}")
        shipped = self.tree / library.file(PLATFORM).relative_to(ROOT)
        shutil.copy(made, shipped)

    def taken(self) -> Taken:
        """Once all tests have run."""
        taken: dict[Branch, bool] = {}
        lines: dict[str, dict[int, list[str]]] = {}
        folders = sorted(path for path in self.counts.iterdir() if path.is_dir())
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            for folder, exported in zip(folders, pool.map(self._exported, folders), strict=True):
                test = f"tests/{folder.name}.py"
                for file, found in exported:
                    of_file = lines.setdefault(file, {})
                    for branch, was in _branches(file, found["branches"]):
                        taken[branch] = taken.get(branch, False) or was
                    for line, was in _lines(found["segments"]).items():
                        tests = of_file.setdefault(line, [])
                        if was and test not in tests:
                            tests.append(test)
        (self.counts.parent / "c_lines.json").write_text(json.dumps(lines, indent=1, sort_keys=True))
        return taken

    def _exported(self, folder: Path) -> list[tuple[str, dict[str, Any]]]:
        """What llvm-cov has for files of ours, by their path from ROOT; a file that is compiled in two places twice."""
        merged = folder / "merged.profdata"
        counts = [str(path) for path in folder.glob("*.profraw")]
        _run("llvm-profdata", "merge", "-sparse", "-failure-mode=all", *counts, "-o", str(merged))
        objects = [f"-object={path}" for path in self._programs]
        printed = _run(
            "llvm-cov", "export", "-skip-functions", "-skip-expansions", f"-instr-profile={merged}", *objects
        )
        files = json.loads(printed)["data"][0]["files"]
        named = ((_ours(Path(each["filename"])), each) for each in files)
        return [(name, each) for name, each in named if name]

    @cached_property
    def _programs(self) -> list[Path]:
        """All that count, each once."""
        found = [path for path in self.objects.iterdir() if path.is_file()]
        return list({hashlib.sha256(path.read_bytes()).digest(): path for path in sorted(found)}.values())


@cache
def _ours(compiled: Path) -> str:
    """The file of ours that it is a copy of, from ROOT; '' where it is none: tests make some that are wrong."""
    name = OURS.get(compiled.name, "")
    return name if name and compiled.is_file() and compiled.read_bytes() == (ROOT / name).read_bytes() else ""


def _run(*command: str) -> str:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise RuntimeError(f"{command[0]} failed: {done.stderr}")
    return done.stdout


def _branches(file: str, found: Iterable[list[int]]) -> Iterator[tuple[Branch, bool]]:
    """Of conditions that are not the same at every run: where both counts are 0 at every run they are constants."""
    for row in found:
        for way, at in WAYS:
            yield Branch(file, row[0], row[1], way), row[at] > 0


def _lines(segments: Sequence[tuple[int, int, int, bool, bool, bool]]) -> dict[int, bool]:
    """Of lines that have code, whether any of it was executed.

    A segment is (line, column, count, has a count, begins a region, is a gap), and reaches up to the next.
    """
    lines: dict[int, bool] = {}
    for (line, _, count, counts, *_, gap), (until, column, *_) in itertools.pairwise(segments):
        for each in range(line, until + (column > 1)) if counts and not gap else ():
            lines[each] = lines.get(each, False) or count > 0
    return lines
