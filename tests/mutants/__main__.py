"""python -m tests.mutants [FILE ...]: change one thing in a file of C or Python, and see whether tests notice.

Without files: those that Python and native FMUs are made of, of which a sample is drawn. What was found is kept in
build/mutants.jsonl, so a run that was stopped goes on where it was.
"""

import argparse
import json
import os
import shutil
import signal
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from hashlib import sha256
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from .judging import (
    NONE,
    NOTICED,
    SAME_CODE,
    SURVIVED,
    TIMED_OUT,
    BeforeError,
    Known,
    Verdict,
    baseline,
    compile_all,
    copied,
    enter,
    judge,
    judges,
    module,
)
from .mutations import Mutant, mutants

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

ROOT = Path(__file__).parents[2]
KEPT = ROOT / "build" / "mutants.jsonl"
COVERAGE = KEPT.parent / "coverage"
KNOWN = Path(__file__).with_name("known.toml")
SURVIVORS = Path(__file__).with_name("survivors.toml")
NATIVE = "hovercraft_fmu/fmu/native"
PARTS = (f"{NATIVE}/room/*.c", f"{NATIVE}/hovercraft/*.c", "hovercraft_fmu/model/*.py", "hovercraft_fmu/fmu/**/*.py")
AT_ONCE = 350
"""Mutants that are shared out between processes at a time."""


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.mutants", description=__doc__)
    parser.add_argument("files", nargs="*", metavar="FILE", help="of C or Python, in the project")
    parser.add_argument("--sample", type=int, default=200, metavar="N", help="mutants to draw (default: 200)")
    parser.add_argument("--seed", type=int, default=1, help="of the drawing (default: 1)")
    parser.add_argument("--parallel", type=int, default=os.cpu_count(), metavar="N", help="processes (default: cores)")
    parser.add_argument("--seconds", type=float, default=20.0, help="CPU time of the tests of a mutant (default: 20)")
    parser.add_argument("--known", action="store_true", help="judge those of known.toml, each by the test named there")
    parser.add_argument("--renew", action="store_true", help="make known.toml of what was found")
    given = parser.parse_args()
    signal.signal(signal.SIGTERM, signal.default_int_handler)  # so that its trees are removed
    try:
        if given.known or given.renew:
            return known_ones(given.parallel) if given.known else renew(given.seed)
        drawn = drawing(given.files, given.seed)
        for name in map(_inside, given.files):
            _require_tests(name)
        verdicts = Run(given.parallel, given.seconds).judge(drawn, given.sample)
    except (BeforeError, OSError, SyntaxError) as error:
        return print(f"error: {error}", file=sys.stderr) or 2
    except KeyboardInterrupt:
        return print(f"stopped; what was found is in {KEPT.relative_to(ROOT)}: the same command goes on") or 130
    report(verdicts, given.seed)
    return 0


def drawing(files: Sequence[str], seed: int) -> list[Mutant]:
    """All mutants of the files, in an order that depends on the seed alone. Raises ValueError."""
    names = [_inside(file) for file in files] or sorted(
        str(path.relative_to(ROOT)) for part in PARTS for path in ROOT.glob(part)
    )
    found = [mutant for name in names for mutant in mutants(ROOT, name)]
    if not found:
        raise BeforeError(f"{', '.join(names)}: nothing in it to change")
    return sorted(found, key=lambda mutant: mutant.rank(seed))


def _inside(file: str) -> str:
    path = Path(file).resolve()
    if not path.is_file():
        raise BeforeError(f"{file}: no such file")
    if path.suffix not in (".c", ".h", ".py") or not path.is_relative_to(ROOT / "hovercraft_fmu"):
        raise BeforeError(f"{file}: must be a file of C or Python in hovercraft_fmu/")
    return str(path.relative_to(ROOT))


def _require_tests(name: str) -> None:
    tests = Known({}, 0.0, COVERAGE, KEPT).through(name)
    if tests is not None and not any(judges(module(test)) for test in tests):
        raise BeforeError(f"{name}: no test that judges mutants runs it, as build/coverage/ tells")


# ---- known ones


def known_ones(parallel: int) -> int:
    """Judge those of known.toml: a test of the tests, and of this. Returns 1 where a verdict is another one."""
    entries = {each["mutant"]: each for each in _table(KNOWN, "known")}
    here = {mutant.name: mutant for mutant in drawing((), 0)}
    wrong = [f"{name}: its line is gone" for name in entries if name not in here]
    only = {name: each["by"] for name, each in entries.items() if name in here}
    with tempfile.TemporaryDirectory(prefix="mutants") as place:
        run = Run(parallel, 60.0, Path(place) / "mutants.jsonl")
        known = Known({test: 1.0 for tests in only.values() for test in tests}, 60.0, None, run.path, only)
        copied(ROOT, Path(place) / "base")
        _in_process(_prepared, Path(place) / "base")
        run.share([here[name] for name in only], run.trees(Path(place)), known)
        verdicts = run.kept()
    for name in only:
        found, before = verdicts[name].verdict, entries[name]["verdict"]
        wrong += [f"{name}: {found}, and was {before}"] if found != before else []
    for line in wrong:
        print(f"{line}: renew it, python -m tests.mutants --sample 200, then --renew")
    print(f"{len(entries)} known mutants: {len(entries) - len(wrong)} as before")
    return int(bool(wrong))


def renew(seed: int) -> int:
    """Write known.toml: 40 of the sample, at most six that survive for a reason, and the first that are noticed."""
    found = Run(1, 0.0).kept()
    drawn = [found[mutant.name] for mutant in drawing((), seed) if mutant.name in found]
    reasons = {each["mutant"] for each in _table(SURVIVORS, "survivor") if each["equivalent"]}
    left = [each for each in drawn if each.name in reasons][:6]
    killed = [each for each in drawn if each.verdict == NOTICED and "::" in each.by and each.seconds < 5.0]
    killed = killed[: 40 - len(left)]
    tests = list(dict.fromkeys(each.by for each in killed))
    fields = [{"mutant": each.name, "verdict": NOTICED, "by": [each.by]} for each in killed]
    fields += [{"mutant": each.name, "verdict": SURVIVED, "by": tests} for each in left]
    parts = ("".join(f"{key} = {json.dumps(value)}\n" for key, value in each.items()) for each in fields)
    KNOWN.write_text("\n".join(f"[[known]]\n{part}" for part in parts), encoding="utf-8")
    return print(f"{KNOWN.name}: {len(killed)} that are noticed, {len(left)} that survive") or 0


# ---- a run


class Run:
    """A tree for each process, and what was found before."""

    def __init__(self, parallel: int, seconds: float, path: Path = KEPT) -> None:
        self.parallel, self.seconds, self.path = parallel, seconds, path
        self.tests = _digest("tests/*.py", "tests/c/*")
        self.code = _digest("hovercraft_fmu/**/*.py", "hovercraft_fmu/**/*.[ch]")
        KEPT.parent.mkdir(exist_ok=True)

    def kept(self) -> dict[str, Verdict]:
        """By name, of mutants that need not be judged again: a survivor is where tests have changed since."""
        found: dict[str, Verdict] = {}
        for line in self.path.read_text(encoding="utf-8").splitlines() if self.path.exists() else ():
            try:
                fields = json.loads(line)
            except json.JSONDecodeError:
                continue  # the end of a run that was killed
            tests = fields.pop("tests")
            verdict = Verdict(**fields)
            found.pop(verdict.name, None)
            if verdict.verdict != SURVIVED or tests == self.tests:
                found[verdict.name] = verdict
        return found

    def judge(self, drawn: Sequence[Mutant], sample: int) -> list[Verdict]:
        """As many of the first as make the sample: those that are no mutants are replaced by the next ones."""
        with tempfile.TemporaryDirectory(prefix="mutants") as place:
            trees: list[Path] = []
            while True:
                kept, wanted, open_ = self.kept(), [], []
                counted = 0
                for mutant in drawn:
                    if counted == sample:
                        break
                    verdict = kept.get(mutant.name)
                    open_ += [] if verdict else [mutant]
                    wanted += [verdict] if verdict else []
                    counted += not (verdict and verdict.verdict == NONE)
                if not open_:
                    return wanted
                if not trees:
                    known = self.prepared(Path(place))
                    trees = self.trees(Path(place))
                self.share(open_[:AT_ONCE], trees, known)

    def prepared(self, place: Path) -> Known:
        """The tree that is copied, and the baseline, which holds for these tests and this code."""
        tree, path = place / "base", KEPT.with_name("mutants_baseline.json")
        copied(ROOT, tree)
        key = f"{self.tests} {self.code}"
        found = json.loads(path.read_text()) if path.exists() else {}
        if found.get("key") != key:
            found = {"key": key, "costs": _in_process(_baseline, tree)}
            path.write_text(json.dumps(found))
        _in_process(_prepared, tree)
        return Known(found["costs"], self.seconds, COVERAGE, self.path)

    def trees(self, place: Path) -> list[Path]:
        """A copy for each process, without what tests left: among that are pipes, and links to files without end."""
        left = shutil.ignore_patterns("temporary")
        return [Path(shutil.copytree(place / "base", place / str(i), ignore=left)) for i in range(self.parallel)]

    def share(self, mutants: Sequence[Mutant], trees: Sequence[Path], known: Known) -> None:
        """Judge them all, in a process for each tree."""
        context = get_context("fork")
        following = context.Value("i", 0)
        workers = [context.Process(target=self.work, args=(tree, mutants, following, known)) for tree in trees]
        try:
            for worker in workers:
                worker.start()
            for worker in workers:
                worker.join()
        finally:
            for worker in workers:
                worker.terminate()
        if any(worker.exitcode for worker in workers):
            raise BeforeError("a process that judges ended early")

    def work(self, tree: Path, mutants: Sequence[Mutant], following: Any, known: Known) -> None:
        def taken() -> Iterator[Mutant]:
            while True:
                with following.get_lock():
                    at = following.value
                    following.value += 1
                if at >= len(mutants):
                    return
                yield mutants[at]

        signal.signal(signal.SIGINT, signal.SIG_IGN)  # who started this one ends it
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        enter(tree)
        try:
            judge(tree, taken(), known, self.record)
        except BeforeError as error:
            sys.exit(f"error: {error}")

    def record(self, verdict: Verdict) -> None:
        line = json.dumps({**asdict(verdict), "seconds": round(verdict.seconds, 2), "tests": self.tests}) + "\n"
        with self.path.open("a", encoding="utf-8") as kept:
            kept.write(line)


def _baseline(tree: Path) -> dict[str, float]:
    enter(tree)
    return baseline(tree, lambda line: print(line, flush=True))


def _prepared(tree: Path) -> None:
    enter(tree)
    compile_all(tree)


def _in_process(work: Any, *given: Any) -> Any:
    """So that this process imports nothing of the project."""
    with get_context("fork").Pool(1, signal.signal, (signal.SIGTERM, signal.SIG_DFL)) as pool:  # as it ends them
        return pool.apply(work, given)


def _digest(*patterns: str) -> str:
    paths = sorted(path for pattern in patterns for path in ROOT.glob(pattern) if path.is_file())
    return sha256(b"".join(path.read_bytes() for path in paths)).hexdigest()[:12]


def report(verdicts: Sequence[Verdict], seed: int) -> None:
    counts = Counter(verdict.verdict for verdict in verdicts)
    reasons = {each["mutant"]: each["why"] for each in _table(SURVIVORS, "survivor")}
    left = [verdict for verdict in verdicts if verdict.verdict == SURVIVED]
    for verdict in left:
        why = reasons.get(verdict.name) or verdict.by or "not judged"
        print(f"survivor: line {verdict.line} of {verdict.name}: {why}")
    drawn = len(verdicts) - counts[NONE]
    same = {each["mutant"] for each in _table(SURVIVORS, "survivor") if each["equivalent"]}
    equivalent = sum(verdict.name in same or verdict.by == SAME_CODE for verdict in left)
    noticed = counts[NOTICED] + counts[TIMED_OUT]
    spent = sum(verdict.seconds for verdict in verdicts) / max(1, len(verdicts))
    print(
        f"{drawn} mutants drawn with seed {seed} ({counts[NONE]} more do not compile): {noticed} noticed "
        f"({counts[TIMED_OUT]} of them by a time limit), {len(left)} survived ({equivalent} equivalent, "
        f"{len(left) - equivalent} not): {100 * noticed / max(1, drawn):.1f} % noticed; {spent:.1f} s of CPU time each"
    )


def _table(path: Path, name: str) -> list[dict[str, Any]]:
    return list(tomllib.loads(path.read_text(encoding="utf-8"))[name]) if path.exists() else []


if __name__ == "__main__":
    sys.exit(main())
