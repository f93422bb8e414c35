"""The FMU in hosts that others wrote: the bits that fmpy gives, which are the bare model's."""

import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from hovercraft_fmu.cli import commands
from hovercraft_fmu.fmu.interface import observe_motion
from hovercraft_fmu.hosts import COMMUNICATION_STEP, CONTROLS, HOSTS, run_in
from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.dynamics import Controls, State
from hovercraft_fmu.model.subcycling import advance
from tests.conftest import ROOT

TABLE = (ROOT / "hovercraft_fmu" / "fmu" / "documentation" / "checked.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", HOSTS)
def test_every_host_gives_the_bits_of_the_bare_model(name: str, fmu: Path) -> None:
    if missing := HOSTS[name].missing():
        pytest.skip(f"{name}: {missing}")
    state, expected = State(), []
    for controls in CONTROLS:
        state = advance(state, Controls(*controls), Craft(), COMMUNICATION_STEP).state
        expected.append([*state, *observe_motion(state)])
    assert run_in(name, fmu) == expected


def _without_versions(table: str) -> list[list[str]]:
    rows = [line.strip("| ").split(" | ") for line in table.strip().splitlines()]
    return [[checker, what, result] for checker, _, what, result in rows]


def test_the_table_is_what_the_command_prints(fmu: Path) -> None:
    """Versions move on; checkers, what was run, and the results are those of the committed table."""
    if missing := "".join(host.missing() for host in HOSTS.values()):
        pytest.skip(missing)
    done = CliRunner().invoke(commands, ["validate", "--table", str(fmu)])
    assert done.exit_code == 0, done.output
    assert _without_versions(done.stdout) == _without_versions(TABLE)
    assert TABLE in (ROOT / "README.md").read_text(encoding="utf-8")
    assert all(row[-1] == "ok" for row in _without_versions(TABLE)[2:])
    assert re.search(r"\| fmpy \| \d", TABLE)
