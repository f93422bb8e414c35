"""Any sequence of FMI calls with any arguments; `python -m tests.fuzz calls` takes ten minutes for each standard."""

from pathlib import Path

import pytest

from hovercraft_fmu.fmu.description import Flavour
from hovercraft_fmu.libraries import NATIVE_FLAVOURS
from tests import fuzz
from tests.native import written_sources

pytestmark = pytest.mark.once


@pytest.mark.parametrize("flavour", NATIVE_FLAVOURS, ids=lambda flavour: flavour.identifier)
def test_many_sequences_without_a_finding(flavour: Flavour, tmp_path: Path) -> None:
    if missing := fuzz.missing():
        pytest.skip(missing)
    program = fuzz.compiled(written_sources(tmp_path, flavour), flavour)
    report = fuzz.fuzz(program, f"-runs={fuzz.SEEDS}")
    assert f"number_of_executed_units: {fuzz.SEEDS + 1}" in report  # and none


SPOILED = {
    "variables.c": (
        "    for (size_t i = 0; i < n; i++) { /* all are checked before one is set */\n",
        "        if (is_real(references[i]) && instance_place(INPUTS, INPUT_COUNT, references[i]) < INPUT_COUNT)\n"
        "            instance->now.reals[references[i]] = 1.0;\n",
    ),
    "exchange.c": (
        "    struct content *now = &instance->now;\n",
        "    if (n > 0 && isfinite(values[0]))\n        states_of(now)[0] = values[0], now->unread = true;\n",
    ),
    "hovercraft.c": (
        "    const struct controls controls = to_come ? inputs_of(now) : m->controls;\n",
        "    if (now->phase == INITIALIZING && n_unknowns > 0)\n        instance->now.time += 1.0;\n",
    ),
    "messages.c": ("    instance->telling = true;\n", "        instance->telling = false;\n"),
    "instance.c": (
        "        *state = services->allocate(services->sink, sizeof *content);\n",
        "        instance_come_back(instance, inside);\n        if (!*state)\n            return FINE;\n",
    ),
    "instance.h": (
        "    instance->host = environment_enter();\n",
        "        environment_leave(&instance->host);\n",
    ),
    "variant.c": (
        "    const struct variant *v = variant();\n",
        "    if (v->size == sizeof *v)\n        return FINE;\n",
    ),
}
"""File: a line before inputs, states, or derivatives over a parameter are all checked, and one that sets some there; or
before the start values in the library are, and one that takes them; where a logger may not call back, memory may be
missing, or rounding is the instance's own, and one that forgets that."""
OF_HOSTILE_HOSTS = ("messages.c", "instance.c", "instance.h")
FOUND = "fuzz: a refused call changed something"
FINDINGS = {
    "messages.c": "fuzz: a call from inside the logger was taken|fuzz: the logger was called from inside the logger",
    "instance.c": "fuzz: there was no memory for a call",
    "instance.h": "fuzz: the host's rounding changed a bit",
    "variant.c": "damaged start values were taken|runtime error",
}


def test_it_would_find_a_refused_call_that_changes_something(tmp_path: Path) -> None:
    """A test of the test: an instance that sets what it has not yet checked, in one of these files at a time."""
    if missing := fuzz.missing():
        pytest.skip(missing)
    written_sources(tmp_path)
    for file, (check, early) in SPOILED.items():
        text = (tmp_path / file).read_text(encoding="utf-8")
        assert text.count(check) == 1
        chosen = f'    if (getenv("SPOILED") && !strcmp(getenv("SPOILED"), "{file}")) {{\n{early}    }}\n'
        includes = "#include <stdlib.h>\n#include <string.h>\n"
        (tmp_path / file).write_text(includes + text.replace(check, check + chosen), encoding="utf-8")
    program = fuzz.compiled(tmp_path, options=fuzz.DEMANDS_ALONE)
    for file in SPOILED:
        calm = {} if file in OF_HOSTILE_HOSTS else {"CALM": "1"}
        with pytest.raises(AssertionError, match=FINDINGS.get(file, FOUND)):
            fuzz.fuzz(program, "-runs=1000000", SPOILED=file, **calm)  # until it has found it
