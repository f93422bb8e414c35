"""The measurement measures: its errors, its orders, its advice. No clock is asserted."""

import csv
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from click.testing import CliRunner

from hovercraft_fmu.cli import commands
from hovercraft_fmu.elsewhere import compiler
from hovercraft_fmu.fmu.interface import STATES
from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.dynamics import Controls, State
from hovercraft_fmu.model.integrators import INTEGRATORS
from hovercraft_fmu.model.subcycling import advance, substeps
from hovercraft_fmu.scenes import SCENES, Scene
from hovercraft_fmu.simulation import held_steps, plan, schedule, simulate
from hovercraft_fmu.studies import model_exchange, trade
from hovercraft_fmu.studies.laboratory import Ready, Timed, interleaved, text
from hovercraft_fmu.studies.owners import ACCURACIES, TIE, of_scenes
from hovercraft_fmu.studies.reference_end import reference_end, reference_path
from hovercraft_fmu.studies.step_costs import OURS, PLAIN, Loops
from hovercraft_fmu.studies.work_precision import (
    HELD,
    MIDDLE,
    fitted,
    go,
    holding_costs,
    observed_orders,
    tolerance_errors,
)
from tests.conftest import FMI_2, ROOT

RESULTS = ROOT / "hovercraft_fmu" / "studies" / "results"


def records(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_the_reference_is_that_of_the_closed_form() -> None:
    """The solver, on scenes whose closed form it is not told, agrees to its tolerance."""
    for name in ("launch", "coast", "cycloid"):
        exact, _ = reference_end(SCENES[name], 60.0)
        solved, uncertainty = reference_end(replace(SCENES[name], exact=None), 60.0)
        assert solved == pytest.approx(exact, abs=1e-9)
        assert uncertainty < 1e-7


@pytest.mark.parametrize("name", SCENES)
def test_the_reference_is_sharp_enough_for_every_accuracy(name: str) -> None:
    """And on the way it is what it is at the end of a shorter run."""
    scene = SCENES[name]
    assert reference_end(scene, scene.stop_time)[1] < 0.2 * min(ACCURACIES)
    middle = 0.45 * scene.stop_time
    on_the_way = reference_path(scene, [middle, scene.stop_time])[:, 0]
    assert on_the_way == pytest.approx(reference_end(scene, middle)[0], abs=1e-8)


def test_observed_orders() -> None:
    orders = {(scene, integrator): slope for scene, integrator, slope in observed_orders().iter_rows()}
    for scene in ("launch", "cycloid"):
        assert orders[scene, "semi_implicit_euler"] == pytest.approx(1.0, abs=0.1)
        assert orders[scene, "drag_implicit"] == pytest.approx(1.0, abs=0.1)
        assert orders[scene, "rk4"] == pytest.approx(4.0, abs=0.1)
    assert orders["stop", "rk4"] < 3.0  # the kink at rest
    assert orders["drift_to_rest", "rk4"] == pytest.approx(2.0, abs=0.4)  # coarse steps; tests/test_terms.py is sharper


def test_holding_costs_a_first_order_and_the_middle_a_second() -> None:
    found = holding_costs(["slalom"], (0.1, 0.5, 1.0))
    for given, order in ((HELD, 1.0), (MIDDLE, 2.0)):
        own = found.filter(given=given)
        assert fitted(own["communication_step"], own["position_error"]) == pytest.approx(order, abs=0.1)


@pytest.mark.parametrize(("number", "name", "setting"), [(2, "step_size", 0.1), (3, "tolerance", 1e-4)])
def test_the_study_runs_what_the_fmu_runs(number: int, name: str, setting: float, native_fmu: Path) -> None:
    """Inputs that ramp, jump and bend inside a communication step; and the largest error is that of the way."""
    method, run = INTEGRATORS[number], plan("ice", communication_step=5.0)
    values: dict[str, str | float] = {"step_size": 0.01, "integrator": method.name, name: setting}
    result = simulate("ice", native_fmu, start_values=values, communication_step=5.0)
    ends = [piece.end for piece in schedule(run)]
    truth = reference_path(SCENES["ice"], ends)
    went = go(run, method, [setting], truth)
    assert went.ends[:, 0].tolist() == [result[name][-1] for name in STATES]
    assert went.substeps[0] == result["substeps"][-1]
    seen = np.array([np.interp(ends, result["time"], result[axis]) for axis in ("pose.x", "pose.y")])
    points = np.isin(ends, result["time"])
    assert went.largest[0] >= np.hypot(*(seen - truth[:2]))[points].max()


def test_a_run_that_leaves_the_numbers_is_marked() -> None:
    wild = replace(SCENES["coast"], start=State(vx=1e4))
    went = go(plan(wild), INTEGRATORS[0], [1e-4, 0.1])
    assert np.isnan(went.ends).all(axis=0).tolist() == [False, True]


def test_the_owner_is_the_cheapest_and_ties_are_marked() -> None:
    rows = [("a", 0.1, 8.0, 1e-3, "nothing"), ("a", 0.5, 2.0, 0.5, "nothing"), ("b", 0.5, 7.0, 1e-3, "nothing"),
            ("c", 0.5, 1.0, 1e-6, "warned"), ("d", 0.5, 100.0, 1e-6, "nothing")]  # fmt: skip
    names = "method", "setting", "loads", "largest_error", "said"
    table = [{"scene": "s", "communication_step": 5.0, **dict(zip(names, row, strict=True))} for row in rows]
    owners = {owner.within: owner.owner for owner in of_scenes(pl.DataFrame(table))}
    assert TIE == 1.25
    assert owners == {"1 m": "a", "10 mm": "b = a", "1 mm": "b = a", "1e-05 m": "d"}


def test_the_error_of_adaptive_follows_its_tolerance_on_every_held_scene() -> None:
    """Over six decades; at most a thousand times the tolerance at the end of a minute of hundreds of steps."""
    for row in tolerance_errors().iter_rows(named=True):
        assert row["error"] <= 1e3 * row["tolerance"] + 1e-9, row


def test_cases_are_run_in_turn_and_the_least_counts() -> None:
    made: list[str] = []

    def case(name: str) -> Ready[int]:
        def go() -> int:
            made.append(name)
            return len(made)

        return lambda: go

    told: list[float] = []
    timed = interleaved({name: case(name) for name in "ab"}, 3, told.append)
    assert "".join(made) == "ababab"
    assert told == pytest.approx([1 / 6, 2 / 6, 3 / 6, 4 / 6, 5 / 6, 1.0])
    assert timed["b"].found == 6
    assert (Timed((3.0, 2.0, 2.5), None).least, Timed((3.0, 2.0, 2.5), None).spread) == (2.0, 0.25)


@pytest.fixture(scope="module")
def loops(tmp_path_factory: pytest.TempPathFactory) -> Loops:
    if compiler() is None:
        pytest.skip("no C compiler (cc, gcc, clang)")
    return Loops(tmp_path_factory.mktemp("loops"))


PLAIN_SCENES = [each for each in SCENES.values() if each.craft.plain_drag and not each.craft.rubs
                and len(each.rows[0]) == 4]  # fmt: skip


def _assert_near(ours: State, theirs: State) -> None:
    """They differ by the roundings of constants that the model multiplies once and the plain loop in each sub-step."""
    for value, wanted in zip(ours, theirs, strict=True):
        assert abs(value - wanted) <= 1e-12 * max(1.0, math.hypot(*theirs[:2]))


@pytest.mark.parametrize("scene", PLAIN_SCENES, ids=lambda each: each.name)
def test_a_scene_with_every_term_off_is_that_of_the_plain_loop(scene: Scene, loops: Loops) -> None:
    """What speed is compared with does the same."""
    run = plan(scene)
    ours = theirs = run.start
    for time, end, asked in held_steps(run):
        ours = advance(ours, asked, run.craft, end - time, run.settings).state
        n, h = substeps(end - time, run.settings.step_size)
        theirs = loops.plain(theirs, asked, run.craft, h, n)
        _assert_near(ours, theirs)


def test_seven_scenes_are_plain() -> None:
    assert len(PLAIN_SCENES) == 7
    assert set(SCENES) - {each.name for each in PLAIN_SCENES} == {"crosswind", "drift_to_rest"}


def test_the_plain_loop_has_thrusters(loops: Loops) -> None:
    asked, start = Controls(5.0, 0.5, 0.2), State(1.0, -2.0, 0.3, 0.4, -0.1, 0.05)
    _assert_near(advance(start, asked, Craft(), 5.0).state, loops.plain(start, asked, Craft(), 0.001, 5000))


def quick(name: str, folder: Path) -> str:
    done = CliRunner().invoke(commands, ["measure", name, "--quick", "--output", str(folder)])
    assert done.exit_code == 0, done.output
    return done.output


@pytest.mark.once
@FMI_2
def test_the_quick_trade(tmp_path: Path, complete_native_fmu: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is committed was written by the same command: of methods with a fixed step every count and error again."""
    monkeypatch.setattr(trade, "TIMED", {"rk4": (0.5,)})
    monkeypatch.setattr("hovercraft_fmu.studies.owners.KEPT", 40)
    monkeypatch.setattr(model_exchange, "TOLERANCES", model_exchange.TOLERANCES[1::3])
    assert complete_native_fmu.exists()  # so there is machine code
    printed = quick("trade", tmp_path)
    runs, committed = (pl.read_csv(each / "work_precision.csv") for each in (tmp_path, RESULTS))
    assert set(runs["method"]) == {method.name for method in INTEGRATORS}
    assert set(committed["scene"]) == set(SCENES)
    key = ["scene", "method", "setting", "communication_step"]
    both = runs.filter(pl.col("method") != "adaptive").join(committed, on=key, suffix="_known")
    assert len(both) > 60
    for name in ("loads", "end_error", "largest_error"):
        assert both[name].to_list() == pytest.approx(both[f"{name}_known"].to_list(), rel=1e-3, abs=1e-9, nan_ok=True)
    owners = records(tmp_path / "owners.csv")
    assert {row["region"] for row in owners} > {"turn", "random, driven"}
    assert all(row["owner"] for row in owners)
    assert {row["region"] for row in records(RESULTS / "owners.csv")} > set(SCENES)
    assert (tmp_path / "work_precision.png").stat().st_size > 10000
    others = {float(row["tolerance"]): row for row in records(RESULTS / "exchange_runs.csv") if row["scene"] == "turn"}
    for row in records(tmp_path / "exchange_runs.csv"):
        assert float(row["error"]) <= 2.0 * float(others[float(row["tolerance"])]["error"]) + 1e-10
    (time,) = records(tmp_path / "times.csv")
    assert float(time["fmpy"]) < float(time["Python FMU"])
    assert "| region" in printed


@pytest.mark.once
@FMI_2
def test_the_quick_costs_of_a_step(tmp_path: Path, complete_native_fmu: Path) -> None:
    assert complete_native_fmu.exists()
    quick("step-costs", tmp_path)
    costs = records(tmp_path / "native.csv")
    assert {f"{method.name}: a sub-step" for method in INTEGRATORS} <= {row["what"] for row in costs}
    assert OURS not in {row["compared_with"] for row in costs}
    if compiler():
        assert [row["what"] for row in costs if row["compared_with"] == PLAIN] == ["semi_implicit_euler: a sub-step"]
        assert len([row for row in costs if row["what"].startswith("C host: ")]) == 4
        parts = {row["what"]: 1.0 / float(row["ratio"]) for row in costs}
        assert 0.0 < parts["a square root"] < parts["a sine with its cosine"] < 1.0
    for row in costs:
        assert float(row["ratio"]) == pytest.approx(float(row["other"]) / float(row["native"]))
    # a Python call of a step of a second costs less than the thousand sub-steps of it in Python
    (second,) = (row for row in costs if row["what"] == "fmpy: set, doStep of 1 s, get")
    assert float(second["native"]) < float(second["other"])


def test_a_table_is_markdown_with_three_digits() -> None:
    frame = pl.DataFrame({"name": ["a", "b"], "value": [1.23456, None], "count": [100000, 2]})
    lines = [[cell.strip() for cell in line.strip("|").split("|")] for line in text(frame).splitlines()]
    assert [lines[0], *lines[2:]] == [["name", "value", "count"], ["a", "1.23", "100000"], ["b", "", "2"]]
    assert set("".join(lines[1])) == {"-"}


def test_the_readme_shows_what_is_committed() -> None:
    assert (RESULTS / "advice.md").read_text(encoding="utf-8") in (ROOT / "README.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("scene", model_exchange.SMOOTH, ids=lambda scene: scene.name)
def test_ramps_are_the_controls_of_the_scene(scene: Scene) -> None:
    """At any time, and without a gap; outputs are read at least every half second."""
    names = (scene.signals.dtype.names or ())[1:]
    times = np.linspace(0.01, scene.stop_time - 0.01, 997)
    parts = list(model_exchange.ramps(scene))
    assert [part.begin for part in parts] == [0.0, *(part.end for part in parts[:-1])]
    for time in times:
        part = next(part for part in parts if part.begin <= time < part.end)
        expected = [np.interp(time, scene.signals["time"], scene.signals[name]) for name in names]
        assert part.at(time)[: len(expected)] == pytest.approx(expected, abs=1e-12)
    points = [point for part in parts for point in part.points()]
    assert 0.0 < min(np.diff([0.0, *points])) <= max(np.diff([0.0, *points])) <= 0.5
    assert points[-1] == scene.stop_time
