"""What is asked for between communication points is what is run: inputs that are linear, bend and jump.

Right values are from an own solver over the equations of tests/reference.py, and from closed forms.
"""

import itertools
import math
from functools import lru_cache
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from hovercraft_fmu import simulate
from hovercraft_fmu.fmu.interface import CRAFT_PARAMETERS, INPUTS, STATES
from hovercraft_fmu.fmu.start_values import Value
from hovercraft_fmu.scenes import SCENES, Signals, signals
from hovercraft_fmu.simulation import holding, plan, points, read_inputs, run_fmu, run_model, schedule
from hovercraft_fmu.sweeps import load, sweep
from tests.conftest import FLAVOURS
from tests.reference import reference_loads

SMOOTH = [name for name, scene in SCENES.items() if not scene.craft.rubs]
RK4: dict[str, Value] = {"integrator": "rk4", "step_size": 0.1}
WAYS = (*FLAVOURS, "bare", "batch")


@lru_cache
def solved(name: str) -> NDArray[np.float64]:
    """The state at the end of a scene: DOP853 at 1e-12, begun anew at every row."""
    run = plan(name)
    craft = {parameter: float(run.value(parameter)) for parameter in CRAFT_PARAMETERS}
    state, rows = np.array(run.start), [tuple(map(float, row)) for row in run.signals]

    def rates(time: float, y: NDArray[np.float64], left: Any, right: Any) -> list[float]:
        share = (time - left[0]) / (right[0] - left[0])
        inputs = tuple(a + share * (b - a) for a, b in zip(left[1:], right[1:], strict=True))
        force, moment, _, _ = reference_loads(tuple(y), inputs, craft)
        return [*y[3:], force[0] / craft["mass"], force[1] / craft["mass"], moment / craft["inertia"]]

    for left, right in itertools.pairwise(rows):
        if right[0] > left[0]:
            span = left[0], right[0]
            state = solve_ivp(rates, span, state, "DOP853", rtol=1e-12, atol=1e-12, args=(left, right)).y[:, -1]
    return state


@pytest.fixture(params=WAYS)
def way(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def end(way: str, request: pytest.FixtureRequest, tmp_path: Path) -> Any:
    """The last state of a scene, or of inputs, at a communication step, by one of the ways to run it."""
    kind = "fmu" if way == "python" else f"{way}_fmu"
    path = request.getfixturevalue("fleet" if way == "batch" else kind) if way != "bare" else None

    def run_it(inputs: str | Signals, step: float | None) -> list[float]:
        if way == "batch":
            assert isinstance(inputs, str)
            study = {"scene": inputs, "set": RK4, "sweep": {"mass": [100.0]}, "keep": {"end": list(STATES)}}
            given, folder = {} if step is None else {"communication_step": step}, tmp_path / f"{inputs} {step}"
            sweep(study | given, engine="batch", workers=1, output=folder)
            return [load(folder).to_table()[f"end.{name}"][0].as_py() for name in STATES]
        run = plan(inputs, start_values=RK4, communication_step=step)
        result = run_fmu(run, path) if path else run_model(run)
        return [float(result[name][-1]) for name in STATES]

    return run_it


def test_a_scene_ends_on_its_solution(end: Any, way: str) -> None:
    """Within 1 mm at its own communication step, within 1 cm at 1 s, and where rows are inside steps."""
    for name in SMOOTH:
        right = solved(name)
        for step, bound in ((None, 1e-3), (1.0, 1e-2), (0.7, 1e-2)):
            off = math.dist(end(name, step)[:2], right[:2])
            print(f"\n{name:10} {way:8} {step or SCENES[name].communication_step} s: {off:.1e} m", end="")
            assert off <= bound, (name, step)


def test_what_holding_costs_is_that_of_the_readme(native_fmu: Path) -> None:
    """77 m on ice, with steps of 0.1 s."""
    ended = run_fmu(holding(plan("ice", start_values=RK4)), native_fmu)
    assert math.dist((ended["pose.x"][-1], ended["pose.y"][-1]), solved("ice")[:2]) == pytest.approx(77.1, abs=0.1)


def test_the_way_out_of_the_readme(native_fmu: Path) -> None:
    """fmpy alone, with two rows for each interval, both with the value at its middle."""
    run = plan("ice", start_values=RK4)
    points = np.linspace(0.0, 240.0, 2401)
    middles = np.zeros(4800, run.signals.dtype)
    middles["time"] = np.repeat(points, 2)[1:-1]
    for name in INPUTS:
        values = np.interp(0.5 * (points[1:] + points[:-1]), run.signals["time"], run.signals[name])
        middles[name] = np.repeat(values, 2)
    ended = fmpy.simulate_fmu(
        str(native_fmu), input=middles, start_values=dict(run.start_values), stop_time=240.0, output_interval=0.1
    )
    assert math.dist((ended["pose.x"][-1], ended["pose.y"][-1]), solved("ice")[:2]) < 1e-3


def test_friction_errs_as_its_method_does(end: Any) -> None:
    """Where inputs hold, and rows are at whole seconds, the communication step makes no difference but rounding."""
    assert end("drift_to_rest", 1.0) == pytest.approx(end("drift_to_rest", 0.1), abs=1e-9)


def launched(thrust: float, duration: float) -> float:
    """m: x = v_t*tau*ln(cosh(t/tau))."""
    terminal = math.sqrt(thrust / 57.421875)
    tau = 100.0 * terminal / thrust
    return terminal * tau * math.log(math.cosh(duration / tau))


@pytest.mark.parametrize("step", [0.01, 0.1, 0.4, 1.0, 5.0])
def test_a_jump_is_a_jump(step: float, each_fmu: Path) -> None:
    """At the first row, between and inside steps, and at the last row."""
    for jump in (0.0, 2.0, 3.3):
        rows = [(0.0, 0.0), (jump, 0.0), (jump, 10.0), (jump + 7.0, 10.0), (jump + 7.0, 0.0)][jump == 0.0 :]
        log = signals([(*row, 0.0, 0.0) for row in rows])
        result = simulate(log, each_fmu, start_values=RK4, communication_step=step)
        # of 4th order: 3e-9 m seen; at a jump inside a step a sub-step is cut, no more
        assert result["pose.x"][-1] == pytest.approx(launched(10.0, 7.0), abs=1e-7)
        assert (result["thrust"][0], result["thrust"][-1]) == (0.0, 10.0)
        assert result.whole is not None
        assert result.whole["thrust"][[0, -1]].tolist() == [0.0, 0.0]


BUSY = """time,thrust,port_thruster
0,0,0
0,10,0.2
0.93,4,1
1.5,4,1
1.5,4,0
2.2,9,0
2.200,1,0
3.1,1,0.5
3.9,8,0.5
3.9,8,0
"""
"""Jumps at the first row, at a communication point, inside a step, at the last row; bends inside steps."""


def test_a_result_as_inputs_gives_the_same_motion_again(each_fmu: Path, tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text(BUSY)
    for step in (0.1, 0.25):
        first = simulate(tmp_path / "log.csv", each_fmu, start_values=RK4, communication_step=step)
        file = first.write_csv(tmp_path / "result.csv")
        again = simulate(file, each_fmu, start_values=RK4, communication_step=step)
        assert np.array_equal(again.data, first.data)
        assert again.whole is not None
        assert first.whole is not None
        assert np.array_equal(again.whole, first.whole)
        asked, kept = (read_inputs(path)[["time", "thrust", "port_thruster"]] for path in (tmp_path / "log.csv", file))
        assert {rounded(row) for row in asked} <= {rounded(row) for row in kept}


def rounded(row: Any) -> tuple[float, ...]:
    """3.9 s is a communication point, 39 * 0.1 s."""
    return tuple(round(float(value), 12) for value in row)


def test_the_columns_show_what_was_asked_for(each_fmu: Path) -> None:
    """At communication points, and those alone: before a jump."""
    log = signals([(0.0, 0.0, 1.0, 0.0), (0.5, 5.0, 0.5, 0.0), (0.5, 1.0, 0.5, 0.0), (2.0, 1.0, 0.0, 0.0)])
    result = simulate(log, each_fmu, communication_step=0.25)
    assert result["time"].tolist() == [0.25 * n for n in range(9)]
    assert result["thrust"].tolist() == [0.0, 2.5, 5.0, *[1.0] * 6]
    assert result["port_thruster"] == pytest.approx(np.interp(result["time"], log["time"], log["port_thruster"]))


def test_what_holds_is_not_cut(each_fmu: Path) -> None:
    """Rows that change nothing inside a step change no bit."""
    whole = signals([(0.0, 7.0, 0.3, 0.0), (5.0, 7.0, 0.3, 0.0)])
    times = (0.0, 0.55, 0.55, 1.23, 4.0, 5.0)
    cut = signals([(time, 7.0, 0.3, 0.0) for time in times])
    found, expected = (simulate(log, each_fmu, communication_step=0.5) for log in (cut, whole))
    assert np.array_equal(found.data, expected.data)


def test_communication_points_are_counted() -> None:
    """Whatever the start, no rounding adds up; a row that differs from one by rounding is at it."""
    for start in (0.0, -3.0, 86400.0, 1.7e9):
        log = signals([(start + time, thrust, 0.0, 0.0) for time, thrust in ((0.0, 1.0), (0.3, 5.0), (40.0, 0.0))])
        pieces = list(schedule(plan(log, communication_step=0.1)))
        assert [piece.end for piece in pieces] == [start + (n + 1) * 0.1 for n in range(400)]
        assert all(piece.is_point for piece in pieces)
        assert pieces[2].last == pieces[3].first


def looks(monkeypatch: pytest.MonkeyPatch, log: Signals) -> int:
    """How often times are compared in the schedule of a run."""
    count = 0
    compare = points._Inputs.is_same

    def counted(self: Any, a: float, b: float) -> bool:
        nonlocal count
        count += 1
        return compare(self, a, b)

    with monkeypatch.context() as patch:
        patch.setattr(points._Inputs, "is_same", counted)
        assert len(list(schedule(plan(log)))) >= len(log) // 2 - 1
    return count


def test_jumps_cost_what_ramps_cost(monkeypatch: pytest.MonkeyPatch) -> None:
    """Twice as many rows take twice the work, not four times: no search from the start at each step."""

    def jumps(n: int) -> Signals:
        return signals([(0.01 * (i // 2), float((i + 1) // 2 % 2), 0.0, 0.0) for i in range(n)])

    few, many = (looks(monkeypatch, jumps(n)) for n in (500, 1000))
    assert many <= 2.1 * few
    assert many <= 20 * 1000
