"""What is advised: the cheapest setting that keeps the wanted error, checked by exact solutions."""

import math
from dataclasses import fields
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from hovercraft_fmu import Advice, advise, simulate
from hovercraft_fmu.model.dynamics import Controls, State
from hovercraft_fmu.model.integrators import integrator, integrator_number
from hovercraft_fmu.scenes import Scene, held
from hovercraft_fmu.simulation import counted
from tests.reference import reference_loads
from tests.shell import Shell

COAST = Scene("coast", "", held(10.0, (0.0, 0.0, 0.0, 0.0)), start=State(vx=2.0), communication_step=0.5)


def exact(times: np.ndarray) -> np.ndarray:
    """x = ln(1 + kappa*v0*t)/kappa."""
    kappa = COAST.craft.drag_factor / COAST.craft.mass
    return np.asarray(np.log1p(kappa * 2.0 * times) / kappa)


@pytest.fixture(scope="module")
def advice(native_fmu: Path) -> Advice:
    return advise(COAST, native_fmu, within=1e-4)


def test_the_advice_is_right_and_what_is_coarser_is_not(advice: Advice, native_fmu: Path) -> None:
    """What is coarser is off or warned of; and what the advice says of its error is what the exact solution says."""
    best = advice.best
    assert advice.is_met
    name, coarser = ("tolerance", 10.0) if "tolerance" in best.start_values else ("step_size", 2.5)
    for factor, met in ((1.0, True), (coarser, False)):
        setting = {**best.start_values, name: factor * float(best.start_values[name])}
        result = simulate(COAST, native_fmu, start_values=setting)
        off = float(np.abs(result["pose.x"] - exact(result["time"])).max())
        assert (off <= advice.within and not result.warnings) == met
        if met:
            assert best.true == pytest.approx(off, abs=1e-9)
            assert best.told == pytest.approx(off, rel=0.2)
            method = integrator(integrator_number(str(best.start_values["integrator"])))
            assert best.loads == round(counted(method, best.substeps))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_random_advice_is_right_by_an_independent_solver(seed: int, native_fmu: Path) -> None:
    """DOP853 on the reference's own forces: another solver, and the equations written down another way."""
    rng = np.random.default_rng(seed)
    length, top = rng.uniform(5.0, 25.0), rng.uniform(5.0, 50.0)
    parameters = {
        "mass": rng.uniform(50.0, 500.0), "inertia": rng.uniform(200.0, 3000.0), "length": length,
        "width": 0.5 * length, "air_density": 10.0 ** rng.uniform(-2.0, 0.3),
        "drag_center_fraction": rng.uniform(-0.4, 0.0), "thrust_max": top,
    }  # fmt: skip
    pulses = [(3.0 * k, rng.uniform(0.0, top), *rng.integers(0, 2, 2).astype(float)) for k in range(4)]
    heading, vx, vy = rng.uniform(-1.0, 1.0, 3)
    start = State(heading=heading, vx=vx, vy=vy, yaw_rate=rng.uniform(-0.2, 0.2))
    random = Scene("random", "", held(12.0, *pulses), parameters=parameters, start=start, communication_step=0.5)
    within = 10.0 ** rng.uniform(-5.0, -1.0)
    advice = advise(random, native_fmu, within=within)
    assert advice.is_met
    result = simulate(random, native_fmu, start_values=advice.best.start_values)
    off = float(np.hypot(*(np.array([result["pose.x"], result["pose.y"]]) - solved(random, result["time"]))).max())
    assert off <= within
    assert advice.best.true == pytest.approx(off, rel=1e-3, abs=1e-9)


def solved(scene: Scene, times: np.ndarray) -> np.ndarray:
    """x and y [m] at some times [s], shape (2, times), of controls that hold from row to row."""
    craft: Any = {field.name: getattr(scene.craft, field.name) for field in fields(scene.craft)}
    found, state = np.tile(np.array(scene.start[:2])[:, None], len(times)), np.array(scene.start)

    def rates(_time: float, y: np.ndarray, controls: Controls) -> list[float]:
        force, moment, *_ = reference_loads(tuple(y), controls, craft)
        return [*y[3:], *(force / craft["mass"]), moment / craft["inertia"]]

    for first, last in pairwise(scene.rows):
        if last[0] > first[0]:
            here = (times > first[0]) & (times <= last[0])
            stops = np.unique(np.append(times[here], last[0]))
            controls = (Controls(*first[1:]),)
            way = solve_ivp(rates, (first[0], last[0]), state, "DOP853", stops, args=controls, rtol=1e-11, atol=1e-11)
            found[:, here], state = way.y[:2, np.searchsorted(stops, times[here])], way.y[:, -1]
    return found


def test_the_runner_up_is_another_method_that_costs_more(advice: Advice) -> None:
    other = advice.runner_up
    assert other is not None
    assert other.start_values["integrator"] != advice.best.start_values["integrator"]
    assert other.loads >= advice.best.loads
    assert max(other.told, other.true) <= advice.within
    assert min(other.seconds, advice.best.seconds) > 0.0


def test_what_holding_the_inputs_costs(native_fmu: Path) -> None:
    """A ramp of a = 0.5 N/s over n = 10 steps of H = 1 s, without drag: a*H^3/m*(n*(n - 1)/4 + n/6) behind."""
    rows = ((0.0, 0.0, 0.0, 0.0), (10.0, 5.0, 0.0, 0.0))
    ramp = Scene("ramp", "", rows, parameters={"drag_coefficient": 0.0}, communication_step=1.0)
    assert advise(ramp, native_fmu).held == pytest.approx(0.5 / 100.0 * (90.0 / 4.0 + 10.0 / 6.0), rel=1e-9)


@pytest.mark.parametrize("within", [0.0, -1.0, math.nan, math.inf])
def test_an_impossible_wish_is_refused(within: float, native_fmu: Path) -> None:
    with pytest.raises(ValueError, match=f"within = {within!r} m: must be a finite number greater than 0"):
        advise(COAST, native_fmu, within=within)


def test_what_is_looked_for_cannot_be_given(native_fmu: Path) -> None:
    with pytest.raises(ValueError, match="integrator: must not be given: it is what is looked for"):
        advise(COAST, native_fmu, start_values={"integrator_number": 3})


@pytest.mark.usefixtures("native_at_hand")
def test_the_command_gives_the_command(shell: Shell) -> None:
    (shell.folder / "log.csv").write_text("time,thrust\n0,5\n3,5\n")
    printed = shell.ok("advise", "--input", "log.csv", "--within", "0.001", "--communication-step", "0.5")
    assert "ranked by the loads that are worked out" in printed
    assert "log.csv, 3 s: at most 1 mm off" in printed
    shell.ok(*printed.splitlines()[-1].split()[1:])
    refused = shell.run("advise", "--input", "log.csv", "--within", "1e-300", "--communication-step", "0.5")
    assert refused.status == 1
    assert refused.err == "hovercraft-fmu: no setting stays within 1e-300 m; that is the best there is\n"
    assert "to run it:" in refused.out
