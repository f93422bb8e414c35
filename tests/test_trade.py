"""The measurement measures: its errors, its orders, its advice. No clock is asserted."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from rich.console import Console

from hovercraft_fmu.cli import commands
from hovercraft_fmu.fmu.description import NATIVE
from hovercraft_fmu.fmu.machine_code import library
from hovercraft_fmu.model.integrators import INTEGRATORS
from hovercraft_fmu.scenes import SCENES, Scene
from hovercraft_fmu.simulation import schedule
from hovercraft_fmu.studies import model_exchange, step_costs
from hovercraft_fmu.studies.reference_end import reference_end
from hovercraft_fmu.studies.rows import Setting
from hovercraft_fmu.studies.trade import (
    ACCURACIES,
    holding_costs,
    observed_orders,
    planned,
    timed_bare,
    tolerance_errors,
)
from tests.conftest import ROOT

RESULTS = ROOT / "hovercraft_fmu" / "studies" / "results"


def records(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_the_reference_is_that_of_the_closed_form() -> None:
    """The solver, on scenes whose closed form it is not told, agrees to its tolerance."""
    from dataclasses import replace

    for name in ("launch", "coast", "cycloid"):
        exact, _ = reference_end(SCENES[name], 60.0)
        solved, uncertainty = reference_end(replace(SCENES[name], exact=None), 60.0)
        assert solved == pytest.approx(exact, abs=1e-9)
        assert uncertainty < 1e-7


@pytest.mark.parametrize("name", SCENES)
def test_the_reference_is_sharp_enough_for_every_accuracy_advised(name: str) -> None:
    _, uncertainty = reference_end(SCENES[name], 60.0)
    assert uncertainty < 0.01 * min(ACCURACIES)


def test_observed_orders() -> None:
    orders = {(each.scene, each.integrator): each.slope for each in observed_orders()}
    for scene in ("launch", "cycloid"):
        assert orders[scene, "semi_implicit_euler"] == pytest.approx(1.0, abs=0.1)
        assert orders[scene, "drag_implicit"] == pytest.approx(1.0, abs=0.1)
        assert orders[scene, "rk4"] == pytest.approx(4.0, abs=0.1)
    assert orders["stop", "rk4"] < 3.0  # the kink at rest
    assert orders["drift_to_rest", "rk4"] == pytest.approx(2.0, abs=0.4)  # coarse steps; tests/test_terms.py is sharper


def test_holding_costs_a_first_order() -> None:
    holding = holding_costs()
    steps, errors = zip(*holding, strict=True)
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(1.0, abs=0.1)


def test_a_millimetre_on_turn() -> None:
    """The default meets it; RK4 meets it with a five-hundredth of the sub-steps."""
    exact, _ = reference_end(SCENES["turn"], 60.0)
    for setting, most in ((Setting("semi_implicit_euler", 0.001, 0.5), 60000), (Setting("rk4", 0.5, 0.5), 120)):
        run = planned(SCENES["turn"], setting)
        _, end, count = timed_bare(run, list(schedule(run)))
        assert math.hypot(end.x - exact.x, end.y - exact.y) <= 1e-3
        assert count == most


def test_the_error_of_adaptive_follows_its_tolerance_on_every_held_scene() -> None:
    """Over six decades; at most a thousand times the tolerance at the end of a minute of hundreds of steps."""
    for row in tolerance_errors():
        assert row.error <= 1e3 * row.tolerance + 1e-9, row


@pytest.mark.once
def test_the_command(tmp_path: Path) -> None:
    done = CliRunner().invoke(commands, ["trade", "--quick", "--output", str(tmp_path)])
    assert done.exit_code == 0, done.output
    rows, advice = records(tmp_path / "work_precision.csv"), records(tmp_path / "advice.csv")
    assert {row["integrator"] for row in rows} == {"semi_implicit_euler", "drag_implicit", "rk4", "adaptive"}
    assert [float(row["accuracy_m"]) for row in advice] == list(ACCURACIES)
    assert all(float(row["position_error"]) <= float(row["accuracy_m"]) for row in advice)
    assert all(float(row["fmu_cost"]) > 0.0 < float(row["bare_cost"]) for row in rows)
    assert all((tmp_path / name).stat().st_size > 10000 for name in ("work_precision.png", "holding.png"))
    if not step_costs.missing():
        costs, before = (records(folder / "native.csv") for folder in (tmp_path, RESULTS))
        assert [row["what"] for row in costs] == [row["what"] for row in before]
        assert all(float(row["native"]) > 0.0 < float(row["other"]) for row in costs)
        assert {f"{method.name}: a sub-step" for method in INTEGRATORS} <= {row["what"] for row in costs}
        plain = [row["what"] for row in costs if row["compared_with"].startswith("plain C loop")]
        assert plain == ["semi_implicit_euler: a sub-step", "adaptive: a sub-step"]
    if not library(NATIVE).missing:
        chosen, runs, before = (
            records(folder / name)
            for folder, name in (
                (tmp_path, "exchange.csv"),
                (tmp_path, "exchange_runs.csv"),
                (RESULTS, "exchange_runs.csv"),
            )
        )
        assert [float(row["accuracy_m"]) for row in chosen] == list(model_exchange.ACCURACIES)
        assert {row["scene"] for row in before} == {scene.name for scene in model_exchange.SMOOTH}
        committed_runs = [row for row in before if row["scene"] == "turn"]
        for ours, committed in zip(runs, committed_runs, strict=True):
            assert ours["solver"] == committed["solver"]
            assert float(ours["error"]) <= 2.0 * float(committed["error"]) + 1e-10
            assert float(ours["cost"]) > 0.0 < float(ours["evaluations"])
    # what is committed was written by the same command, and tells the same of the errors
    for ours, committed in zip(advice, records(RESULTS / "advice.csv"), strict=True):
        assert float(committed["position_error"]) <= float(committed["accuracy_m"])
        assert ours.keys() == committed.keys()


@pytest.mark.parametrize("name", ["advice.md", "native.md"])
def test_the_readme_shows_what_is_committed(name: str) -> None:
    assert (RESULTS / name).read_text(encoding="utf-8") in (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("scene", model_exchange.SMOOTH, ids=lambda scene: scene.name)
def test_stretches_are_the_controls_of_the_scene(scene: Scene) -> None:
    """At any time, and without a gap; outputs are read at least every half second."""
    names = (scene.signals.dtype.names or ())[1:]
    times = np.linspace(0.01, 59.99, 997)
    parts = list(model_exchange.stretches(scene))
    assert [part.begin for part in parts] == [0.0, *(part.end for part in parts[:-1])]
    for time in times:
        part = next(part for part in parts if part.begin <= time < part.end)
        expected = [np.interp(time, scene.signals["time"], scene.signals[name]) for name in names]
        assert part.at(time)[: len(expected)] == pytest.approx(expected, abs=1e-12)
    points = [point for part in parts for point in part.points()]
    assert 0.0 < min(np.diff([0.0, *points])) <= max(np.diff([0.0, *points])) <= 0.5
    assert points[-1] == 60.0


def test_what_the_native_fmu_costs_is_said_where_it_cannot_be_measured(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(step_costs, "compiler", lambda: None)
    shown = Console(record=True)
    shown.print(step_costs.run(tmp_path))
    assert "not measured: no C compiler" in shown.export_text()
    assert list(tmp_path.iterdir()) == []
