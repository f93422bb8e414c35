"""Any sequence of FMI calls with any arguments, 12 s a standard; `python -m tests.fuzz` takes ten minutes for each."""

import re
from pathlib import Path

import pytest

from hovercraft_fmu.fmu.description import NATIVE, NATIVE3, Flavour
from tests import fuzz
from tests.native import written_sources

pytestmark = pytest.mark.once


@pytest.mark.parametrize("flavour", [NATIVE, NATIVE3], ids=lambda flavour: flavour.identifier)
def test_twelve_seconds_without_a_finding(flavour: Flavour, tmp_path: Path) -> None:
    if missing := fuzz.missing():
        pytest.skip(missing)
    report = fuzz.fuzz(tmp_path, 12, flavour)
    done = re.search(r"number_of_executed_units: (\d+)", report)
    assert done
    assert int(done[1]) > 10_000


SPOILED = {
    "variables.c": (
        "    for (size_t i = 0; i < n; i++) { /* all are checked before one is set */\n",
        "        if (is_real(references[i]) && instance_place(INPUTS, INPUT_COUNT, references[i]) < INPUT_COUNT)\n"
        "            instance->now.reals[references[i]] = 1.0;\n",
    ),
    "exchange.c": (
        "    struct content *now = &instance->now;\n",
        "    if (n > 0 && isfinite(values[0]))\n        now->state.x = values[0], now->motion_unread = true;\n",
    ),
    "partials.c": (
        "    kernel_linearize(&now->state, &now->controls, &now->craft, now->phase == INITIALIZING, linearization);\n",
        "    if (now->phase == INITIALIZING && n_knowns > 0 && knowns[0] >= V_MASS && knowns[0] <= V_THRUST_MAX)\n"
        "        instance->now.time += 1.0;\n",
    ),
    "variant.c": (
        "    const struct variant *v = variant();\n",
        "    if (v->size == sizeof *v)\n        return FINE;\n",
    ),
}
"""File: a line before inputs, states, or derivatives over a parameter are all checked, and one that sets some there; or
before the start values in the library are, and one that takes them."""
FINDINGS = {"variant.c": "damaged start values were taken|runtime error"}


@pytest.mark.parametrize("file", SPOILED)
def test_it_would_find_a_refused_call_that_changes_something(
    file: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A test of the test: an instance that sets what it has not yet checked."""
    if missing := fuzz.missing():
        pytest.skip(missing)
    whole = written_sources

    def spoiled(folder: Path, flavour: Flavour) -> Path:
        path = whole(folder, flavour) / file
        text = path.read_text(encoding="utf-8")
        check, early = SPOILED[file]
        assert text.count(check) == 1
        path.write_text(text.replace(check, check + early), encoding="utf-8")
        return folder

    monkeypatch.setattr(fuzz, "written_sources", spoiled)
    with pytest.raises(AssertionError, match=FINDINGS.get(file, "a refused call changed something")):
        fuzz.fuzz(tmp_path, 240)  # it ends when it has found it; the draws are the same on every machine
