"""The mutants: what is changed and what never is; a name holds while a line does; what the command refuses."""

import ast
import json
from pathlib import Path

import pytest

from tests.mutants.__main__ import drawing, main
from tests.mutants.mutations import mutants

PYTHON = '''\
"""Docstring: 1 + 1."""

LIMITS: tuple[int, ...] = (
    1,
    22,
    333,
)


def held(value: int | None, low: float = -0.5) -> float:
    """Not 2."""
    assert value is not None  # 3 < 4
    kept = value * low
    if not kept and value < 7:
        kept = max(kept, 0.0)
        value = kept + 1
    return f(value, *LIMITS) - f(kept, low)
'''
C = """\
#include "held.h"

/* 1 + 1 */
static const struct row ROWS[] = {
    {1, "1 + 2"},
    {2, "b"},
};

static double held(const struct craft *craft, double value)
{
    double *kept = &craft->kept;
    if (!craft)
        return -1.0;
    *kept = value * 2.0; /* 3 */
    value = *kept + clip(value, craft->low);
    return value <= 0.0 ? value : *kept;
}
"""
EXPECTED = {
    "held.py": {
        ("constant", "22,", "23,"), ("sign", "low: float = -0.5", "low: float = 0.5"), ("row", "1, 22,", "22,"),
        ("word", "and value", "or value"), ("operator", "value * low", "value / low"),
        ("comparison", "value < 7", "value <= 7"), ("comparison", "value < 7", "value >= 7"),
        ("dropped", "value = kept + 1", "pass"), ("arguments", "f(kept, low)", "f(low, kept)"),
        ("order", "kept = max(kept, 0.0) value = kept + 1", "value = kept + 1 kept = max(kept, 0.0)"),
    },
    "held.c": {
        ("sign", "!craft", "craft"), ("constant", "-1.0", "--1.0"), ("operator", "value * 2.0", "value / 2.0"),
        ("comparison", "value <= 0.0", "value < 0.0"), ("dropped", "*kept = value * 2.0;", ";"), ("row", '"b"},', ""),
        ("arguments", "clip(value, craft->low)", "clip(craft->low, value)"),
        ("return", "return value <= 0.0 ? value : *kept;", "return !("),
    },
}  # fmt: skip
"""Of each text some: the operator, a part of what was there, a part of what is there instead."""
UNTOUCHED = (
    "Docstring",
    "Not 2",
    "assert",
    "3 < 4",
    "int | None",
    "/* 1",
    "#include",
    "double *kept",
    "/* 3 */",
)


@pytest.mark.parametrize(("file", "text"), [("held.py", PYTHON), ("held.c", C)])
def test_what_is_changed(file: str, text: str, tmp_path: Path) -> None:
    (tmp_path / file).write_text(text)
    found = mutants(tmp_path, file)
    for operator, before, after in EXPECTED[file]:
        alike = [each for each in found if each.operator == operator and before in each.before and after in each.after]
        assert alike, f"no mutant that makes {after!r} of {before!r}"
    for each in found:
        changed = each.applied(text)
        assert changed != text
        assert all(changed.count(part) == text.count(part) for part in UNTOUCHED)
        if file.endswith(".py"):
            ast.parse(changed)


def test_names_are_unique_and_stay_where_lines_move(tmp_path: Path) -> None:
    (tmp_path / "held.c").write_text(C)
    names = [each.name for each in mutants(tmp_path, "held.c")]
    assert len(names) == len(set(names))
    (tmp_path / "held.c").write_text(C.replace("static double", "static int another;\n\nstatic double"))
    assert [each.name for each in mutants(tmp_path, "held.c")] == names


def test_the_sample_depends_on_the_seed_alone() -> None:
    """A file that is not looked at takes nothing out of the order of the others."""
    name = "hovercraft_fmu/model/observation.py"
    both = drawing([name, "hovercraft_fmu/model/craft.py"], 1)
    assert [each for each in both if each.file == name] == drawing([name], 1) != drawing([name], 2)


@pytest.mark.parametrize(
    ("file", "message"),
    [("no.c", "no.c: no such file"), ("README.md", "README.md: must be a file of C or Python in hovercraft_fmu/"),
     ("hovercraft_fmu/fmu/__init__.py", "hovercraft_fmu/fmu/__init__.py: nothing in it to change")],
)  # fmt: skip
def test_what_cannot_be_changed(
    file: str, message: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(Path(__file__).parents[1])
    monkeypatch.setattr("sys.argv", ["mutants", file])
    assert main() == 2
    assert capsys.readouterr().err == f"error: {message}\n"


def test_a_file_without_tests_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A study's test alone runs it: those judge nothing."""
    name = "hovercraft_fmu/fmu/native/room/text.c"
    (tmp_path / "c_lines.json").write_text(json.dumps({name: {"7": ["tests/test_trade.py"], "8": []}}))
    monkeypatch.chdir(Path(__file__).parents[1])
    monkeypatch.setattr("sys.argv", ["mutants", name])
    monkeypatch.setattr("tests.mutants.__main__.COVERAGE", tmp_path)
    assert main() == 2
    assert capsys.readouterr().err.startswith(f"error: {name}: no test that judges mutants runs it")
