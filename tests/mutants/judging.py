"""Whether tests notice a mutant. It is put into a copy of the tree, one for each of the processes side by side.

What a run of tests does first, to import libraries and to collect tests, is done once: then a process forks for each
mutant, and the child runs tests until the first fails. C is compiled for this machine alone, without optimization. A
function of Python gets its other code where it is; what that does not show is imported anew. Those tests come first
that noticed most for their time, of the same file above all; a mutant has so much CPU time, then it has survived: or
of C the suite's sanitized run, which compiles for itself, has the last word.
"""

import ctypes
import gc
import importlib
import inspect
import json
import os
import pickle
import re
import select
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, field
from functools import cache, partial
from hashlib import sha256
from pathlib import Path
from types import CodeType, FunctionType
from typing import IO, Any, TypeAlias

import pytest

from .mutations import Mutant

LEFT_OUT = ("sweep", "trade", "loops", "examples", "play", "readme", "drive", "stability", "animation", "endurance",
            "platforms", "native_binaries", "build", "attacks", "operator", "palette", "stopping", "tutorial", "hosts",
            "advice", "cross_check", "native_fuzz", "house", "coverage", "mutants")  # fmt: skip
"""Test files that judge nothing: studies, browsers, other platforms' machines, what is above the FMU."""
ANEW = ("autopilot", "cli", "control_log", "door", "fleet", "guidance", "native_autopilot", "pages", "scenes",
        "simulation", "solvers", "tether")  # fmt: skip
"""Test files for what is imported anew alone: of C others say more."""
THREADS = "test_the_study_is_held_against_scipy"
"""A test that needs threads that a fork has not got."""
OTHERS = (*("autopilot", "fleet", "guidance", "tether"), "every", "letter", "machine", "variants")
"""Test files that need machine code of other models, or of many craft."""
NOT_OF_C = ("craft", "dynamics", "folding", "identity", "integrators", "interface", "subcycling")
"""Test files that run no native FMU, or of which other ones say more."""
LIKELY = {
    "kernel.c": "native_kernel same_time", "linearization.c": "partial_derivatives",
    "partials.c": "partial_derivatives",
    "exchange.c": "exchange", "serialize.c": "lifecycle native", "text.c": "native_kernel", "fmi2.c": "lifecycle calls",
    "fmi3.c": "fmi3 intermediate_update", "hovercraft.c": "native error_estimate", "variant.c": "variants",
    "rates.c": "native fmi3", "step.c": "lifecycle intermediate_update", "messages.c": "fmi3 lifecycle",
    "memory.c": "own_memory", "mach_o.py": "mach_o", "variables.c": "lifecycle fmi3 every_model",
    "craft_native.py": "fmi3 choices native",
    "dynamics.py": "dynamics terms native_kernel", "integrators.py": "integrators native_kernel", "craft.py": "craft",
    "subcycling.py": "subcycling same_time interface native_kernel integrators", "variable.py": "interface",
    "archive.py": "fmu identity", "error_estimate.py": "error_estimate native_kernel",
    "description.py": "exchange fmi3 fmu interface", "interface.py": "lifecycle interface fmi3", "block.py": "variants",
    "machine_code.py": "machine_code", "start_values.py": "variants", "extras.py": "letter",
    "native_package.py": "letter", "document.py": "fmu pages",
    "native_header.py": "lifecycle native_sources", "wrapper.py": "lifecycle fmu",
    "life_cycle.py": "lifecycle variants",
}  # fmt: skip
"""Test files that are tried first for a file, as long as nothing is known of it; of others test_lifecycle.py."""
FIRST = 40
"""Tests that are run one by one, the best first; the rest follows file by file."""
SANITIZED = "tests/test_native.py::test_clean_under_sanitizers_over_the_life_cycle"
"""Of C what no other test notices: what is read or written beside memory."""
TIME_LIMIT = 900.0
"""s, of all tests of a mutant; a test alone has ten times the CPU time it takes, and 4 s."""
COMPILER = (shutil.which("clang") or "gcc", "-std=c11", "-ffp-contract=off", "-fno-math-errno", "-fPIC", "-g0",
            "-I.", "-Werror=incompatible-pointer-types", "-Werror=int-conversion", "-fvisibility=hidden",
            "-DFMI2_OVERRIDE_FUNCTION_PREFIX", "-DFMI3_OVERRIDE_FUNCTION_PREFIX")  # fmt: skip
"""Without optimization, which is where most of the time would go: the bits are the same."""


@dataclass(frozen=True)
class Verdict:
    """What came of a mutant: noticed, timed out, survived, or no mutant (it does not compile, say)."""

    name: str
    file: str
    line: int
    verdict: str
    by: str
    """The test, or why."""
    seconds: float
    """CPU time."""


NOTICED, TIMED_OUT, SURVIVED, NONE = "noticed", "timed out", "survived", "no mutant"
SAME_CODE, ELSEWHERE = "same machine code", "not in this machine's build"
DIGESTS = re.compile(
    rb"(?<![0-9a-f])[0-9a-f]{8}(?:-?[0-9a-f]{4}){3}-?[0-9a-f]{12}(?![0-9a-f])|^    UINT64_C\(0x[0-9a-f]+\)$",
    re.MULTILINE,
)
"""Of the code, as it is or as a GUID, and the checksum of what holds them: others in every mutant."""
STAGES = (("-E", "-P"), ("-O2",))
"""Options that show what the compiler sees of the units, and the machine code that it makes."""


class BeforeError(Exception):
    """Of a tree that fails before anything is changed."""


# ---- trees


def copied(root: Path, tree: Path) -> None:
    """All that tests need of the project."""
    shutil.copytree(root / "tests", tree / "tests")
    ignored = shutil.ignore_patterns("compiled")
    shutil.copytree(root / "hovercraft_fmu", tree / "hovercraft_fmu", ignore=ignored)
    for path in root.iterdir():
        if path.is_file():
            shutil.copy2(path, tree)
    shutil.copytree(root / "licenses", tree / "licenses")
    shutil.copytree(root / ".readme", tree / ".readme")
    (tree / "build").mkdir()


def enter(tree: Path) -> None:
    """From here on this process, and those that it starts, import from there alone."""
    os.chdir(tree)
    for name in [name for name in sys.modules if name.split(".")[0] in ("tests", "hovercraft_fmu")]:
        if not name.startswith("tests.mutants"):
            del sys.modules[name]
    sys.path[:] = [str(tree), *(path for path in sys.path if path and not Path(path, "hovercraft_fmu").exists())]
    os.environ.update(PYTHONPATH=str(tree), PYTHONDONTWRITEBYTECODE="1")
    sys.dont_write_bytecode = True  # mutants of one file may have one size and time, and so another's byte code
    os.environ.pop("CI", None)  # there a test that is skipped fails


class Change:
    """A mutant in a tree, and back. A file that comes back has its old time, so what was compiled of it is good."""

    def __init__(self, tree: Path, mutant: Mutant) -> None:
        self.path, self.mutant = tree / mutant.file, mutant

    def __enter__(self) -> None:
        self.before, self.stat = self.path.read_text(encoding="utf-8"), self.path.stat()
        self.path.write_text(self.mutant.applied(self.before), encoding="utf-8")
        future = self.stat.st_mtime_ns + 1_000_000_000_000
        os.utime(self.path, ns=(future, future))

    def __exit__(self, *_: object) -> None:
        self.path.write_text(self.before, encoding="utf-8")
        os.utime(self.path, ns=(self.stat.st_atime_ns, self.stat.st_mtime_ns))


# ---- machine code


class Compilation:
    """The native FMUs of the tree that this process imports, for this machine alone, by its own compiler."""

    def __init__(self, tree: Path) -> None:
        self.objects = tree / "objects"
        self.objects.mkdir(exist_ok=True)

    def __call__(self, every: bool) -> None:
        """Those of the hovercraft, or of every model and many craft. Raises CalledProcessError."""
        from hovercraft_fmu.libraries import libraries

        for each in libraries() if every else libraries()[:2]:
            path = each.file("x86_64-linux")
            if not path.exists():
                path.parent.mkdir(parents=True, exist_ok=True)
                made = [self.object(each, source, "-O0") for source in each.sources]
                subprocess.run([*COMPILER, "-shared", *map(str, made), "-o", str(path)], check=True)

    def object(self, each: Any, source: str, *options: str, named: bool = True) -> Path:
        """Of a unit, with the digest of the code in it or with none; one that was compiled before is kept."""
        folder = f"{Path(source).parent}/"
        files = {name: content for name, content in each.files.items() if name.startswith(folder)}
        if not named:
            files = {name: DIGESTS.sub(b"0", content) for name, content in files.items()}
        key = sha256(repr((source, options, sorted(files.items()))).encode()).hexdigest()
        path = self.objects / f"{key}.o"
        if not path.exists():
            place = self.objects / key
            for name, content in files.items():
                (place / name).parent.mkdir(parents=True, exist_ok=True)
                (place / name).write_bytes(content)
            command = [*COMPILER, *options, "-c", source, "-o", f"{path}.new"]
            subprocess.run(command, cwd=place, check=True, capture_output=True)
            shutil.rmtree(place)
            Path(f"{path}.new").rename(path)
        return path

    def units(self, *options: str) -> list[bytes]:
        """The machine code of the hovercraft's units, or with -E what the compiler sees of them."""
        from hovercraft_fmu.libraries import libraries

        return [
            self.object(each, source, *options, named=False).read_bytes()
            for each in libraries()[:2]
            for source in each.sources
        ]


def compile_all(tree: Path) -> None:
    """Of the tree as it is: its copies have it then."""
    compilation = Compilation(tree)
    compilation(True)
    for options in STAGES:
        compilation.units(*options)


# ---- running tests


def cpu() -> float:
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


@dataclass(eq=False)
class Running:
    """A plugin of pytest: runs chosen tests in a chosen order, tells the name of each and how it went."""

    serve: Callable[[pytest.Session], None]
    """What is done instead of the usual loop."""
    outcomes: dict[str, str] = field(default_factory=dict)

    def pytest_collectstart(self) -> None:
        from hypothesis import Phase, settings

        profile = settings.get_profile("repeatable")  # that a test fails is enough: nobody reads the smallest example
        settings.register_profile("judging", profile, phases=(Phase.explicit, Phase.generate), database=None)
        settings.load_profile("judging")

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.outcome != "passed" or report.when == "call":
            self.outcomes[report.nodeid] = report.outcome

    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        if session.testsfailed:
            raise BeforeError("collection")
        self.serve(session)
        return True

    def run(self, items: Sequence[pytest.Item], costs: dict[str, float], told: IO[str]) -> bool:
        """Until one fails. Each has an amount of CPU time."""
        for item, following in zip(items, [*items[1:], None], strict=True):
            print(item.nodeid, file=told, flush=True)
            signal.setitimer(signal.ITIMER_PROF, 4.0 + 10.0 * costs.get(item.nodeid, 30.0))
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
            if self.outcomes.get(item.nodeid) == "failed":
                return False
        return True


def run_pytest(tree: Path, files: Iterable[str], serve: Callable[[pytest.Session, Running], None]) -> int:
    """Collect those files in the tree, then serve."""
    options = ["-p", "no:cacheprovider", "-p", "no:terminal", "-o", "addopts=", "-m", "not once",
               f"--basetemp={tree / 'temporary'}"]  # fmt: skip
    plugin = Running(lambda session: serve(session, plugin))
    return int(pytest.main([*options, *(str(tree / "tests" / f"{name}.py") for name in files)], plugins=[plugin]))


def prepared(tree: Path) -> Compilation:
    """The tests of this process use this machine's compiler, in its quickest way."""
    conftest, native = (importlib.import_module(f"tests.{name}") for name in ("conftest", "native"))
    compilation = Compilation(tree)
    vars(conftest)["compile_libraries"] = lambda _: ""
    vars(native)["OPTIONS"] = tuple(option.replace("-O2", "-O0") for option in native.OPTIONS)
    return compilation


def in_fork(work: Callable[[IO[str]], bool], limit: float = TIME_LIMIT) -> tuple[str, str, float]:
    """Do it in a child that tells what it does. Returns what came of it, what it told last, and the CPU time.

    A child that raises, fails or dies has noticed something.
    """
    began = cpu()
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(read)
        _in_child(work, write)
    os.close(write)
    told, in_time = _heard(child, read, time.monotonic() + limit)
    if not in_time:
        os.killpg(child, signal.SIGKILL)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    with suppress(ProcessLookupError):
        os.killpg(child, signal.SIGKILL)  # what it left behind
    outcome = TIMED_OUT if not in_time or status == -signal.SIGPROF else SURVIVED if status == 0 else NOTICED
    return outcome, told, cpu() - began


def _in_child(work: Callable[[IO[str]], bool], write: int) -> None:
    import resource  # Windows has none; the rest of this file is read there, too

    code = 1
    try:
        os.setsid()
        with suppress(AttributeError):
            ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # on Linux: not longer than its parent
        resource.setrlimit(resource.RLIMIT_AS, (8 << 30, resource.getrlimit(resource.RLIMIT_AS)[1]))
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        nothing = os.open(os.devnull, os.O_RDWR)
        for descriptor in (0, 1, 2):
            os.dup2(nothing, descriptor)
        code = 0 if work(os.fdopen(write, "w")) else 1
    finally:
        os._exit(code)


def _heard(child: int, read: int, until: float) -> tuple[str, bool]:
    """The last line, and whether the child ended in time."""
    text = b"import\n"
    while time.monotonic() < until:
        ended = os.waitid(os.P_PID, child, os.WEXITED | os.WNOWAIT | os.WNOHANG)
        while select.select([read], [], [], 0.0 if ended else 0.1)[0]:
            more = os.read(read, 65536)
            if not more:
                time.sleep(0.0 if ended else 0.002)
                break
            text = (text + more)[-4000:]
        if ended:
            break
    os.close(read)
    return text.decode(errors="replace").strip().splitlines()[-1], bool(ended)


# ---- what is known of the tests


@dataclass
class Known:
    """What tests cost [s], and how often each noticed a mutant of a file."""

    costs: dict[str, float]
    seconds: float
    """CPU time of the tests of one mutant."""
    coverage: Path | None
    path: Path
    only: dict[str, list[str]] = field(default_factory=dict)
    """By the name of a mutant its tests, where no others are wanted."""
    kills: Counter[tuple[str, str]] = field(default_factory=Counter)
    read: int = 0

    def learn(self) -> None:
        """From what all processes have found out since."""
        if self.path.exists():
            with self.path.open(encoding="utf-8") as lines:
                lines.seek(self.read)
                for line in iter(lines.readline, ""):
                    found = json.loads(line)
                    self.kills[found["file"], found["by"]] += found["verdict"] in (NOTICED, TIMED_OUT)
                self.read = lines.tell()

    def cheapest(self) -> list[str]:
        """Tests that show whether anything runs at all."""
        if self.only:
            return list(dict.fromkeys(test for tests in self.only.values() for test in tests))
        return sorted(
            (test for test in self.costs if not needs_others(test) and module(test)[5:] not in ANEW),
            key=lambda test: self.costs[test],
        )[:100]

    def ordered(self, mutant: Mutant, share: float = 1.0) -> list[str]:
        """Tests that may notice it, as many as its time, or a share of it, allows, the best first."""
        if self.only:
            return self.only[mutant.name]
        is_c = not mutant.file.endswith(".py")
        likely = LIKELY.get(Path(mutant.file).name, "lifecycle").split()
        covering = self.through(mutant.file, mutant.line - 4, mutant.line + 1) or set()
        noticed, alike = Counter[str](), Counter[str]()
        for (file, test), times in self.kills.items():
            weight = 5 * times if file == mutant.file else times if file[-2:] == mutant.file[-2:] else 0
            noticed[test] += weight
            alike[test.split("[")[0]] += weight
        worth = {}
        for test, cost in self.costs.items():
            name = module(test).removeprefix("test_")
            if is_c:
                runs_it = not covering or name in likely or test.split("::")[0] in covering
                is_apt = runs_it and name not in (*NOT_OF_C, *ANEW) and "[python" not in test
            else:
                is_apt = share == 1.0 or name not in ANEW
            if is_apt and THREADS not in test:
                sooner = 0.05 + 3.0 * (name in likely) + 1.0 * (test in covering)
                worth[test] = (noticed[test] + 0.1 * alike[test.split("[")[0]] + sooner) / (cost + 0.03)
        chosen, spent = [], 0.0
        for test in sorted(worth, key=lambda test: -worth[test]):
            spent += self.costs[test]
            chosen += [test] if spent < share * self.seconds else []
        first, rest = chosen[:FIRST], chosen[FIRST:]
        order = list(dict.fromkeys(module(test) for test in rest))
        return [*first, *sorted(rest, key=lambda test: order.index(module(test)))]

    def through(self, file: str, first: int = 0, last: int = 1 << 30) -> set[str] | None:
        """Tests that go through lines of a file: of C, files of tests. None where `tests.coverage` has not told."""
        if not self.coverage:
            return None
        database_path, lines_path = self.coverage / "python.sqlite", self.coverage / "c_lines.json"
        if file.endswith(".py") and database_path.exists():
            with closing(sqlite3.connect(f"file:{database_path}?mode=ro", uri=True)) as database:
                found = database.execute(
                    "select distinct context from arc join file on file.id = file_id "
                    "join context on context.id = context_id where path like ? and abs(tono) between ? and ?",
                    (f"%/{file}", first, last),
                )
                return {name.split("|")[0] for (name,) in found} - {""}
        if not file.endswith(".py") and lines_path.exists():
            lines = json.loads(lines_path.read_text(encoding="utf-8")).get(file, {})
            return {test for line, tests in lines.items() if first <= int(line) <= last for test in tests}
        return None


def module(test: str) -> str:
    return Path(test.split("::")[0]).stem


def needs_others(test: str) -> bool:
    """Whether a test needs machine code of another model."""
    return any(each in OTHERS for each in module(test).split("_"))


def test_files(tree: Path) -> list[str]:
    return sorted(path.stem for path in (tree / "tests").glob("test_*.py") if judges(path.stem))


def judges(name: str) -> bool:
    return not any(name == f"test_{each}" or each in name.split("_") for each in LEFT_OUT)


def baseline(tree: Path, said: Callable[[str], None]) -> dict[str, float]:
    """Run all tests once, without a mutant: what fails or is skipped then judges nothing. Raises BeforeError.

    Returns:
        CPU time [s] of each test that judges.
    """
    found = tree / "baseline.json"

    def once(session: pytest.Session, running: Running) -> None:
        prepared(tree)(True)
        costs: dict[str, float] = {}
        for item, following in zip(session.items, [*session.items[1:], None], strict=True):
            began = cpu()
            item.config.hook.pytest_runtest_protocol(item=item, nextitem=following)
            costs[item.nodeid] = round(cpu() - began, 4)
        found.write_text(json.dumps([costs, running.outcomes]))

    outcome, told, _ = in_fork(lambda _: run_pytest(tree, test_files(tree), once) in (0, 1), 3600.0)
    if outcome != SURVIVED or not found.exists():
        raise BeforeError(f"the tests do not run before any mutation ({told}): run pytest")
    costs, outcomes = json.loads(found.read_text())
    failed = [test for test, outcome in outcomes.items() if outcome == "failed"]
    costs = {test: costs[test] for test, outcome in outcomes.items() if outcome == "passed"}
    said(f"{len(costs)} tests judge, {sum(costs.values()):.0f} s of CPU time")
    if failed:
        said(f"{len(failed)} fail before any mutation and judge nothing: {', '.join(failed[:5])}")
    if len(failed) > len(costs):
        raise BeforeError("most tests fail before any mutation: run pytest")
    return costs


# ---- mutants

Record: TypeAlias = Callable[[Verdict], None]
Run: TypeAlias = Callable[[Sequence[str], bool, IO[str]], bool]


def judge(tree: Path, mutants: Iterator[Mutant], known: Known, record: Record) -> None:
    """In a process that has imported nothing of the project. Raises BeforeError.

    A child of it has collected all tests, and judges. What it leaves is imported anew: functions of Python whose change
    nobody noticed there, and what is worked out while a module is imported.
    """
    left = tree / "left.pickle"

    def serve(told: IO[str], session: pytest.Session, running: Running) -> None:
        waiting = []
        compiled = prepared(tree)
        compiled(True)
        items = {item.nodeid: item for item in session.items}

        def run(order: Sequence[str], others: bool, told: IO[str]) -> bool:
            chosen = [items[test] for test in order if test in items and needs_others(test) == others]
            return running.run(chosen, known.costs, told)

        def is_sound(test: str) -> bool:
            """Whether it passes, alone, where nothing is changed: asked when it is the first time that it noticed."""
            if any(by == test for _, by in known.kills):
                return True
            return in_fork(lambda told: running.run([items[test]], known.costs, told))[0] == SURVIVED

        before = in_fork(lambda each: run(known.cheapest(), False, each))
        print(before[1], file=told, flush=True)
        _require(before)
        for mutant in mutants:
            known.learn()
            judged = _exchanged if mutant.file.endswith(".py") else _compiled
            verdict = judged(tree, mutant, known, compiled, run)
            while verdict and verdict.by in items and not is_sound(verdict.by):
                del known.costs[verdict.by]
                verdict = judged(tree, mutant, known, compiled, run)
            is_c = not mutant.file.endswith(".py")
            if verdict and verdict.verdict == SURVIVED and not verdict.by and is_c and not known.only:
                print(SANITIZED, file=told, flush=True)
                verdict = _sanitized(tree, mutant, verdict)
            if verdict:
                record(verdict)
            else:
                waiting.append(mutant)
        left.write_bytes(pickle.dumps(waiting))

    files = sorted(name for name in {module(test) for test in known.costs} if name.removeprefix("test_") not in ANEW)
    _require(in_fork(lambda told: run_pytest(tree, files, partial(serve, told)) == 0 and left.exists(), 1e9))
    waiting = pickle.loads(left.read_bytes())
    left.unlink()
    if waiting:
        _import_libraries(tree, known)
    for mutant in waiting:
        known.learn()
        record(_imported(tree, mutant, known))


def _require(found: tuple[str, str, float]) -> None:
    if found[0] != SURVIVED:
        raise BeforeError(f"the tests do not run before any mutation ({found[1]}): run pytest")


def _verdict(mutant: Mutant, outcome: str, by: str, spent: float) -> Verdict:
    return Verdict(mutant.name, mutant.file, mutant.line, outcome, by, spent)


def _exchanged(tree: Path, mutant: Mutant, known: Known, compiled: Compilation, run: Run) -> Verdict | None:
    """Of a change in a function: the function gets other code where it is. None where that tells nothing."""
    change = Change(tree, mutant)
    source = (tree / mutant.file).read_text(encoding="utf-8")
    try:
        codes = _other_code(*(compile(text, str(change.path), "exec") for text in (source, mutant.applied(source))))
    except SyntaxError as error:
        return _verdict(mutant, NONE, str(error), 0.0)
    if not codes:
        return None
    functions = [each for each in gc.get_objects() if isinstance(each, FunctionType) and each.__code__ in codes]

    def work(told: IO[str]) -> bool:
        for function in functions:
            function.__code__ = codes[function.__code__]
        print("compiling", file=told, flush=True)
        compiled(False)
        return run(known.ordered(mutant, 0.15), False, told)

    with change:
        outcome, by, spent = in_fork(work)
    return None if outcome == SURVIVED or not functions else _verdict(mutant, outcome, by, spent)


def _other_code(old: CodeType, new: CodeType) -> dict[CodeType, CodeType]:
    """By the code of functions what it becomes; nothing where code outside of functions is another, too."""
    pairs = [(old, new)]
    found = {}
    while pairs:
        one, other = pairs.pop()
        parts = [[each for each in code.co_consts if isinstance(each, CodeType)] for code in (one, other)]
        rest = [[each for each in code.co_consts if not isinstance(each, CodeType)] for code in (one, other)]
        is_function = bool(one.co_flags & inspect.CO_OPTIMIZED)
        is_other = (one.co_code, one.co_names, repr(rest[0])) != (other.co_code, other.co_names, repr(rest[1]))
        if is_function and one != other:
            found[one] = other
        elif is_other or len(parts[0]) != len(parts[1]):
            return {}
        else:
            pairs += zip(*parts, strict=True)
    return found


def _import_libraries(tree: Path, known: Known) -> None:
    """What tests import, but for the project and what pytest imports itself: done here, it is done once."""
    cheapest = known.cheapest()
    files = sorted({module(test) for test in cheapest})
    names = tree / "imported.json"
    not_here = ("xdist", "hypothesis", "execnet", "pytest", "tests", "hovercraft", "conftest", "test_", "_")

    def look(told: IO[str]) -> bool:
        _collected(tree, files, cheapest[:1], known, told)
        names.write_text(json.dumps([name for name in sys.modules if not name.startswith(not_here)]))
        return True

    in_fork(look)
    for name in json.loads(names.read_text()):
        with suppress(Exception):
            importlib.import_module(name)
    _require(in_fork(lambda told: _collected(tree, files, cheapest, known, told)))


def _imported(tree: Path, mutant: Mutant, known: Known) -> Verdict:
    order = known.ordered(mutant)
    likely, every = {module(test) for test in order[:8]}, dict.fromkeys(module(test) for test in order)
    outcome, by, spent = SURVIVED, "", 0.0
    with Change(tree, mutant):
        for files in ([name for name in every if (name in likely) == wanted] for wanted in (True, False)):
            if outcome == SURVIVED and files:
                outcome, by, seconds = in_fork(partial(_collected, tree, files, order, known))
                spent += seconds
    return _verdict(mutant, outcome, "" if outcome == SURVIVED else by, spent)


def _collected(tree: Path, files: list[str], order: list[str], known: Known, told: IO[str]) -> bool:
    fine = False

    def serve(session: pytest.Session, running: Running) -> None:
        nonlocal fine
        compiled = prepared(tree)
        items = {item.nodeid: item for item in session.items}
        gone = [test for test in order if module(test) in files and test not in items]
        if gone:
            print(gone[0], file=told, flush=True)  # it was made of a table
            return
        for others in (False, True):
            chosen = [items[test] for test in order if test in items and needs_others(test) == others]
            if chosen:
                print("compiling", file=told, flush=True)
                compiled(others)
                if not running.run(chosen, known.costs, told):
                    return
        fine = True

    run_pytest(tree, files, serve)
    return fine


def _alone(test: str, tree: Path) -> int:
    """What pytest returns of a test that compiles for itself; 1 where it does not end, too."""
    import resource

    place = str(tree / "alone")
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--basetemp", place, test]
    limit = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (limit[1], limit[1]))  # sanitizers ask for terabytes that they do not use
    try:
        return subprocess.run(command, cwd=tree, capture_output=True, check=False, timeout=TIME_LIMIT).returncode
    except subprocess.TimeoutExpired:
        return 1
    finally:
        resource.setrlimit(resource.RLIMIT_AS, limit)


_passes = cache(_alone)


def _sanitized(tree: Path, mutant: Mutant, verdict: Verdict) -> Verdict:
    """The last word on C that survived. That run clears away machine code of others."""
    from hovercraft_fmu.fmu.machine_code import COMPILED

    began, kept = cpu(), shutil.copytree(COMPILED, tree / "kept")
    _require((SURVIVED if _passes(SANITIZED, tree) == 0 else NOTICED, SANITIZED, 0.0))
    with Change(tree, mutant):
        outcome, by = (NOTICED, SANITIZED) if _alone(SANITIZED, tree) else (SURVIVED, "")
    shutil.rmtree(COMPILED)
    kept.rename(COMPILED)
    return _verdict(mutant, outcome, by, verdict.seconds + cpu() - began)


def _compiled(tree: Path, mutant: Mutant, known: Known, compiled: Compilation, run: Run) -> Verdict:
    from hovercraft_fmu.fmu.machine_code import COMPILED

    began, before = cpu(), {*COMPILED.iterdir(), *compiled.objects.iterdir()}
    order = known.ordered(mutant)
    outcome, by = SURVIVED, ""
    with Change(tree, mutant):
        try:
            for others in (False, True):
                if outcome == SURVIVED and any(needs_others(test) == others for test in order):
                    compiled(others)
                    outcome, by, _ = in_fork(partial(run, order, others))
            seen = [compiled.units(*options) for options in STAGES] if outcome == SURVIVED else []
        except subprocess.CalledProcessError as error:
            outcome, by = NONE, (error.stderr or b"").decode(errors="replace").split("error: ")[-1].splitlines()[0]
        left = {*COMPILED.iterdir(), *compiled.objects.iterdir()} - before
    if outcome == SURVIVED:
        text, code = (found == compiled.units(*options) for found, options in zip(seen, STAGES, strict=True))
        by = ELSEWHERE if text else SAME_CODE if code else ""
    for path in left:
        shutil.rmtree(path) if path.is_dir() else path.unlink()
    return _verdict(mutant, outcome, by, cpu() - began)
