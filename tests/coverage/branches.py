"""What every part of the coverage hands over, and what is said of it."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parent.parent.parent
AT_MOST = 20
"""Exceptions."""


class Branch(NamedTuple):
    """One way out of a decision."""

    file: str
    """From ROOT."""
    line: int
    """From 1."""
    column: int
    way: str
    """'true', 'false', or where it goes."""


class Exempt(NamedTuple):
    """A branch that no test takes."""

    file: str
    text: str
    """With which its line goes on where it is, as far as it takes to be the only one."""
    way: str
    why: str


Taken = Mapping[Branch, bool]
"""Whether each branch of some files was taken."""


def closing_lines(taken: Taken, exceptions: Sequence[Exempt], goal: Sequence[str]) -> tuple[list[str], bool]:
    """Lines for each file, the exceptions, and what is wrong; and whether all is well.

    Args:
        taken: of all parts that were measured.
        exceptions: of all parts; those of files that were not measured are left out.
        goal: folders and files, from ROOT, of which every branch is to be taken or listed.
    """
    files = sorted({branch.file for branch in taken})
    lines, wrong = [], []
    for file in files:
        of_file = {branch: was for branch, was in taken.items() if branch.file == file}
        lines.append(f"{file}: {sum(of_file.values())} of {len(of_file)} branches")
        listed = [each for each in exceptions if each.file == file]
        for each in listed:
            same = [branch for branch in of_file if is_meant(each, branch)]
            lines.append(f"  listed: {each.text} ({each.way}): {each.why}")
            if len(same) != 1:
                wrong.append(f"{file}: {len(same)} branches are {each.text!r} ({each.way}), listed: must be one")
            wrong += [f"{at(branch)}: is taken, and listed" for branch in same if of_file[branch]]
        missed = [branch for branch, was in of_file.items() if not was]
        if missed:
            lines.append(f"  not taken, in lines {' '.join(map(str, sorted({branch.line for branch in missed})))}")
        if file.startswith(tuple(goal)):
            wrong += [
                f"{at(branch)}: {text(branch)}: neither taken nor listed"
                for branch in sorted(missed)
                if not any(is_meant(each, branch) for each in listed)
            ]
    if len(exceptions) > AT_MOST:
        wrong.append(f"{len(exceptions)} exceptions: must be at most {AT_MOST}")
    aimed = [was for branch, was in taken.items() if branch.file.startswith(tuple(goal))]
    all_taken = f"{sum(taken.values())} of {len(taken)} in {len(files)} files"
    total = f"{sum(aimed)} of {len(aimed)} branches of the goal; {all_taken}"
    return [*lines, *wrong, f"{total}; {len(wrong)} to be mended" if wrong else total], not wrong


def is_meant(exempt: Exempt, branch: Branch) -> bool:
    """Whether that branch is the one that is listed."""
    is_there = _line(branch)[max(branch.column - 1, 0) :].strip().startswith(exempt.text)
    return (exempt.file, exempt.way) == (branch.file, branch.way) and is_there


def text(branch: Branch) -> str:
    """Of its line."""
    return _line(branch).strip()


def _line(branch: Branch) -> str:
    return (ROOT / branch.file).read_text(encoding="utf-8").splitlines()[branch.line - 1]


def at(branch: Branch) -> str:
    """Where it is, for a reader."""
    return f"{branch.file}:{branch.line}:{branch.column} ({branch.way})"
