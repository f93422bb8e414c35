"""Solvers on the native FMU in model exchange: CVode over seven decades of tolerance, and fmpy alone."""

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import fmpy
import pytest
from fmpy.fmi1 import FMICallException

from hovercraft_fmu.fmu.interface import STATES
from hovercraft_fmu.host import Fmu, Instance, SimulationError
from hovercraft_fmu.scenes import SCENES, Scene, held
from hovercraft_fmu.simulation import plan
from hovercraft_fmu.studies.model_exchange import SMOOTH, TOLERANCES, solved
from hovercraft_fmu.studies.reference_end import reference_end
from hovercraft_fmu.studies.work_precision import fitted, largest


@pytest.fixture(scope="module")
def shared(each_native_fmu: Path) -> Iterator[Instance]:
    with Fmu(each_native_fmu) as fmu, fmu.instance(exchange=True) as made:
        yield made


def test_fmpy_takes_co_simulation_unless_asked(native_fmu: Path) -> None:
    options = {"stop_time": 1.0, "output_interval": 0.5, "output": ["pose.x", "substeps"]}
    stepped, solved = (fmpy.simulate_fmu(str(native_fmu), fmi_type=kind, **options) for kind in (None, "ModelExchange"))
    assert list(stepped["substeps"]) == [0, 500, 1000]
    assert list(solved["substeps"]) == [0, 0, 0]
    assert solved["pose.x"][-1] == pytest.approx(stepped["pose.x"][-1], abs=1e-4)


@pytest.mark.once
@pytest.mark.parametrize("scene", SMOOTH, ids=lambda scene: scene.name)
def test_cvode_meets_the_reference_and_its_error_follows_the_tolerance(scene: Scene, shared: Instance) -> None:
    """Over seven decades. CVode bounds the error of a step, relative to the states and their nominals; they add up."""
    exact, uncertainty = reference_end(scene, scene.stop_time)
    errors, tolerances = [], TOLERANCES[::2]
    for tolerance in tolerances:
        errors.append(largest(solved(shared, scene, tolerance)[0], exact))
        assert errors[-1] <= 500.0 * tolerance * max(1.0, *map(abs, exact)) + uncertainty
    assert fitted(tolerances, errors) == pytest.approx(0.9, abs=0.2)


@pytest.mark.parametrize("name", [scene.name for scene in SMOOTH if scene.name not in ("slalom", "ice")])
def test_fmpy_alone_meets_the_reference_where_inputs_hold(name: str, native_fmu: Path) -> None:
    exact, _ = reference_end(SCENES[name], SCENES[name].stop_time)
    run = plan(name)
    result = fmpy.simulate_fmu(
        str(native_fmu), fmi_type="ModelExchange", stop_time=run.stop_time, output_interval=0.5,
        relative_tolerance=1e-8,
        input=run.signals, start_values=dict(run.start_values), output=list(STATES),
    )  # fmt: skip
    end = [result[name][-1] for name in STATES]
    assert end == pytest.approx(exact, abs=500.0 * 1e-8 * max(1.0, *map(abs, exact)))


def test_fmpy_alone_holds_ramps_over_an_output_interval(native_fmu: Path) -> None:
    """As documented: of first order in it."""
    exact, _ = reference_end(SCENES["slalom"], 60.0)
    run = plan("slalom")
    errors = []
    for interval in (0.5, 0.05):
        result = fmpy.simulate_fmu(
            str(native_fmu), fmi_type="ModelExchange", stop_time=60.0, output_interval=interval,
            relative_tolerance=1e-6, input=run.signals, output=["pose.x", "pose.y"],
        )  # fmt: skip
        errors.append(math.hypot(result["pose.x"][-1] - exact.x, result["pose.y"][-1] - exact.y))
    assert math.log10(errors[0] / errors[1]) == pytest.approx(1.0, abs=0.1)


def test_what_the_fmu_says_to_the_solver_is_told(shared: Instance) -> None:
    """CVode is C: an exception of fmpy's does not come through it."""
    scene = replace(SCENES["launch"], rows=held(60.0, (0.0, 99.0, 0.0, 0.0)))
    with pytest.raises(SimulationError, match=r"thrust = 99\.0: is outside its limits"):
        solved(shared, scene, 1e-6)


def test_fmpy_refuses_the_scene_with_friction(native_fmu: Path) -> None:
    values = dict(plan("drift_to_rest").start_values)
    assert values["skirt_friction"] == SCENES["drift_to_rest"].parameters["skirt_friction"]
    with pytest.raises(FMICallException):
        fmpy.simulate_fmu(str(native_fmu), fmi_type="ModelExchange", stop_time=1.0, start_values=values)
