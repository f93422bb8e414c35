"""python -m tests.coverage [--c] [--python] [--page] [TEST_FILE ...]: the branches that the ordinary suite takes.

Without options all of them, without files the whole suite. A copy of the tree is tested, each test file in a pytest of
its own; c.py and python.py say what they leave in
build/coverage/. Ends with 1 where a branch of the goal is neither taken nor listed
in exceptions.py, where a listed one is taken, and where a test fails.
"""

import argparse
import sys
from fnmatch import fnmatch
from pathlib import Path

from tests.coverage import c, page, python
from tests.coverage.branches import ROOT, closing_lines
from tests.coverage.exceptions import EXCEPTIONS
from tests.coverage.suite import Part, run

PARTS: dict[str, type[Part]] = {"c": c.C, "python": python.Python, "page": page.Page}
"""By the names of the options."""
TESTS = "test_*.py"


def main() -> int:
    """The command."""
    parser = argparse.ArgumentParser(prog="python -m tests.coverage", description="the branches that the suite takes")
    for name, part in PARTS.items():
        parser.add_argument(f"--{name}", action="store_true", help=part.__doc__)
    parser.add_argument("files", nargs="*", type=Path, metavar="TEST_FILE", help="the whole suite without it")
    given = parser.parse_args()
    for file in given.files:
        if not (file.is_file() and fnmatch(file.name, TESTS) and file.resolve().parent == ROOT / "tests"):
            sys.exit(f"{file}: must be a file of tests, tests/{TESTS}")
    files = [file.resolve().relative_to(ROOT) for file in given.files] or sorted(
        path.relative_to(ROOT) for path in (ROOT / "tests").glob(TESTS)
    )
    wanted = [part for name, part in PARTS.items() if getattr(given, name)] or list(PARTS.values())
    for part in wanted:
        if why := part.missing():
            sys.exit(why)
    try:
        taken, failed = run(wanted, files)
    except RuntimeError as error:
        sys.exit(str(error))
    goal = [each for part in wanted for each in part.goal]
    lines, well = closing_lines(taken, EXCEPTIONS, goal)
    print("\n".join(lines))
    for file in failed:
        print(f"{file}: a test failed, or there is none: build/coverage/{file.stem}.txt")
    return 0 if well and not failed else 1


if __name__ == "__main__":
    sys.exit(main())
