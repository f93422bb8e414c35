"""Sweeps: a run of one has the bits of `simulate`, whoever makes it, when and beside what."""

import csv
import itertools
import json
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq
import pytest
from fsspec import filesystem
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from hovercraft_fmu import SimulationError, simulate
from hovercraft_fmu.fmu.interface import STEP_UNSTABLE
from hovercraft_fmu.model.dynamics import Controls
from hovercraft_fmu.model.integrators import INTEGRATORS, integrator
from hovercraft_fmu.model.subcycling import Settings, meant_step, substeps
from hovercraft_fmu.scenes import SCENES
from hovercraft_fmu.simulation import Value
from hovercraft_fmu.studies import carry_out, sweep_costs
from hovercraft_fmu.sweeps import STUDIES, chunks, cluster, load, read_study, sweep
from hovercraft_fmu.sweeps import place as place_module
from hovercraft_fmu.sweeps import runner as runner_module
from hovercraft_fmu.sweeps.charts import plot_sweep
from hovercraft_fmu.sweeps.engines import Plan
from hovercraft_fmu.sweeps.place import Place, place_of
from hovercraft_fmu.sweeps.quantities import FORMULAS, OBSERVED
from hovercraft_fmu.sweeps.sampling import Factor, Sampling
from hovercraft_fmu.sweeps.seen import check_seen
from hovercraft_fmu.sweeps.store import store
from hovercraft_fmu.sweeps.timeline import Leg, merged, timeline
from hovercraft_fmu.sweeps.work import DRIVERS, Job, make_chunk
from tests.conftest import FMI_2
from tests.shell import Shell

COARSE = {"integrator": "rk4", "step_size": 0.1}
MASSES: dict[str, Any] = {
    "scene": "turn",
    "set": COARSE,
    "sweep": {"mass": [60.0, 100.0, 170.0], "air_density": [0.3, 1.2]},
    "keep": {"end": ["pose.x", "pose.y", "speed"]},
}


def but(study: Mapping[str, Any] = MASSES, **changes: Any) -> dict[str, Any]:
    return {**study, **changes}


def loaded(folder: Path, what: str = "runs") -> pa.Table:
    made: pa.Table = load(folder, what).to_table()
    return made


def rows(table: pa.Table) -> list[dict[str, Any]]:
    made: list[dict[str, Any]] = table.to_pylist()
    return made


def bits(table: pa.Table) -> pa.Table:
    """What must be the same: all but the metadata."""
    return table.replace_schema_metadata(None)


# ---- the runs


@pytest.mark.parametrize("scene", ["turn", "slalom", "crosswind", "drift_to_rest"])
def test_a_run_has_the_bits_of_simulate(scene: str, each_fmu: Path, tmp_path: Path) -> None:
    """At every communication point, whatever was run on the instance before."""
    study = {
        "scene": scene,
        "stop_time": 4.0,
        "set": {"step_size": 0.01},
        "sweep": {"mass": [60.0, 170.0], "integrator": [method.name for method in INTEGRATORS]},
        "keep": {"trajectory": {"every": 0.1, "of": list(OBSERVED)}},
    }
    sweep(study, each_fmu, workers=1, output=tmp_path)
    paths = loaded(tmp_path, "trajectories")
    for row in rows(loaded(tmp_path)):
        settings = {"step_size": 0.01, "mass": row["mass"], "integrator": row["integrator"]}
        alone = simulate(scene, each_fmu, start_values=settings, stop_time=4.0)
        own = paths.filter(pc.equal(paths["run"], row["run"]))
        for name in ("time", *OBSERVED):
            assert np.array_equal(own[name].to_numpy(), alone[name]), (row, name)


@pytest.mark.parametrize("method", [method.name for method in INTEGRATORS])
@pytest.mark.parametrize("step_size", [0.1, 0.03])
def test_what_is_kept_changes_no_bit(method: str, step_size: float, native_fmu: Path, tmp_path: Path) -> None:
    assert_what_is_kept_changes_no_bit(method, step_size, native_fmu, tmp_path)


def test_what_is_kept_changes_no_bit_of_any_fmu(each_fmu: Path, tmp_path: Path) -> None:
    assert_what_is_kept_changes_no_bit("rk4", 0.1, each_fmu, tmp_path)


def assert_what_is_kept_changes_no_bit(method: str, step_size: float, fmu: Path, tmp_path: Path) -> None:
    """Where the end alone is kept communication steps are made as one; the end is the same, what is watched and all."""
    changed = but(set={"integrator": method, "step_size": step_size})
    few = {"end": list(OBSERVED)}
    sweep(but(changed, keep=few), fmu, workers=1, output=tmp_path / "few")
    sweep(but(changed, keep=few | {"distance": True}), fmu, workers=1, output=tmp_path / "all")
    every = loaded(tmp_path / "all").drop_columns("distance")
    assert bits(loaded(tmp_path / "few")).equals(bits(every))


def test_how_many_steps_are_left_out() -> None:
    def legs(scene: str, method: int, step_size: float, **keep: Any) -> int:
        study = read_study(but(scene=scene, keep=keep))
        settings = Settings(step_size, integrator(method))
        return len(merged(timeline(study.run, study.keep).legs, study.run.start_time, settings))

    jumps = 10
    assert legs("turn", 3, 0.1, end=["speed"]) == jumps
    assert legs("turn", 1, 0.001, end=["speed"]) == jumps
    assert legs("turn", 3, 0.1, distance=True) == 600
    assert legs("turn", 3, 0.1, trajectory={"every": 30.0, "of": ["speed"]}) == jumps + 1
    assert legs("turn", 3, 0.03, end=["speed"]) == 600  # no whole number of sub-steps
    assert legs("turn", 4, 0.1, end=["speed"]) == 600  # adaptive ends a step at each
    assert legs("slalom", 3, 0.1, end=["speed"]) == 600  # the controls change all the time


@given(
    st.lists(st.tuples(st.integers(1, 40), st.booleans(), st.integers(0, 1)), min_size=1, max_size=30),
    st.sampled_from([0.1, 0.025, 0.004, 1.0, 0.03]),
    st.integers(1, 4),
)
def test_merging_keeps_time_controls_sub_steps_and_what_is_kept(
    parts: list[tuple[int, bool, int]], step_size: float, method: int
) -> None:
    ends = np.cumsum([0, *(n for n, _, _ in parts)])
    legs = [
        Leg(ends[i] * 0.1, ends[i + 1] * 0.1, Controls(float(thrust)), Controls(float(thrust)), kept)
        for i, (_, kept, thrust) in enumerate(parts)
    ]
    settings = Settings(step_size, integrator(method))
    made = merged(legs, 0.0, settings)
    assert [leg.end for leg in made if leg.kept] == [leg.end for leg in legs if leg.kept]
    assert (made[0].time, made[-1].end) == (legs[0].time, legs[-1].end)
    assert all(a.end == b.time for a, b in itertools.pairwise(made))
    for leg in made:
        inside = [each for each in legs if leg.time <= each.time and each.end <= leg.end]
        assert {(each.first, each.last) for each in inside} == {(leg.first, leg.last)}
        if len(inside) > 1:
            steps = [meant_step(each.time, each.end - each.time, 0.0, step_size) for each in (*inside, leg)]
            *cuts, whole = (substeps(step, step_size) for step in steps)
            assert whole == (sum(n for n, _ in cuts), step_size)
            assert {h for _, h in cuts} == {step_size}


FAILING = but(sweep={"thrust_min": [0.0, 20.0], "velocity.x": [0.0, 1e200, 5.0]}, set=COARSE | {"drag_area": 2})
"""thrust_min above thrust_max; so fast that the drag overflows; and good ones between them."""


def test_a_failed_run_is_a_row_with_its_error(each_fmu: Path, tmp_path: Path) -> None:
    outcome = sweep(FAILING, each_fmu, workers=1, output=tmp_path)
    made = rows(loaded(tmp_path))
    assert [row["error"] is None for row in made] == [True, False, True, False, False, False]
    assert (outcome.new, outcome.failed) == (6, 4)
    assert outcome.error == f"run 1: {made[1]['error']}"
    assert "must stay a finite number; the step was refused" in made[1]["error"]
    assert made[3]["error"] == "thrust_min = 20.0 N: must not be above thrust_max = 10.0 N"
    assert all(made[i][name] is None for i in (1, 3, 4, 5) for name in ("end.pose.x", "end.speed", "warnings"))
    start: dict[str, Value] = {"integrator": "rk4", "step_size": 0.1, "drag_area": 2, "velocity.x": 5.0}
    alone = simulate("turn", each_fmu, start_values=start)
    assert [made[2][f"end.{name}"] for name in ("pose.x", "speed")] == [alone[name][-1] for name in ("pose.x", "speed")]


# ---- the batch


@pytest.mark.parametrize(
    ("scene", "sweeps"),
    [
        ("turn", {"mass": [60.0, 170.0], "drag_area": [1, 2], "rotational_drag": [0.0, 0.5]}),
        ("slalom", {"mass": [60.0, 170.0], "step_size": [0.02, 0.013], "drag_coefficient": [0.0, 1.25]}),
        ("crosswind", {"thrust_max": [7.0, 12.0], "wind.x": [0.0, 0.3], "velocity.yaw_rate": [-9.0, 0.1]}),
        ("drift_to_rest", {"skirt_friction": [0.0, 0.002, 0.008], "wind.y": [0.0, 0.3]}),
    ],
)
@pytest.mark.usefixtures("fleet")
def test_the_batch_has_the_rows_of_the_native_fmu(
    scene: str, sweeps: dict[str, Any], native_fmu: Path, tmp_path: Path
) -> None:
    """Bit by bit: every method at once, all that can be kept, at every communication point, and only at the end."""
    study = {
        "scene": scene,
        "stop_time": 8.0,
        "set": {"step_size": 0.02},
        "sweep": {"integrator": [method.name for method in INTEGRATORS], **sweeps},
        "keep": {
            "end": [*OBSERVED, *FORMULAS],
            "trajectory": {"every": 0.1, "of": list(OBSERVED)},
            "events": {"moves": {"of": "speed", "above": 0.1, "values": ["pose.x"]}},
        },
    }
    if "step_size" in sweeps:
        study["set"] = {}
    for name, keep in (("all", study["keep"]), ("end", {"end": ["pose.x"]})):
        sweep(study | {"keep": keep}, native_fmu, workers=1, output=tmp_path / f"{name} fmu")
        sweep(study | {"keep": keep}, engine="batch", workers=1, output=tmp_path / f"{name} batch")
        assert bits(loaded(tmp_path / f"{name} batch")).equals(bits(loaded(tmp_path / f"{name} fmu")))
    ours, theirs = (loaded(tmp_path / f"all {engine}", "trajectories") for engine in ("batch", "fmu"))
    assert bits(ours).equals(bits(theirs))


def test_a_failed_craft_of_a_batch_leaves_the_others(tmp_path: Path) -> None:
    sweep(FAILING, engine="batch", workers=1, output=tmp_path)
    made = rows(loaded(tmp_path))
    assert [row["error"] is None for row in made] == [True, False, True, False, False, False]
    assert "must stay a finite number" in made[1]["error"]
    assert made[3]["error"] == "thrust_min = 20.0 N: must not be above thrust_max = 10.0 N"
    good = but(FAILING, sweep={"thrust_min": [0.0], "velocity.x": [0.0, 5.0]})
    sweep(good, engine="batch", workers=1, output=tmp_path / "good")
    assert [row["end.pose.x"] for row in rows(loaded(tmp_path / "good"))] == [
        made[0]["end.pose.x"],
        made[2]["end.pose.x"],
    ]


@pytest.mark.usefixtures("fleet")
def test_the_batch_names_an_input_that_no_step_helps_as_the_fmu_does(native_fmu: Path, tmp_path: Path) -> None:
    study = but(
        set={"step_size": 0.1}, stop_time=1.0,
        sweep={"integrator": [method.name for method in INTEGRATORS], "external.force.x": [-1e308, 1e12, 1.0]},
    )  # fmt: skip
    sweep(study, native_fmu, workers=1, output=tmp_path / "fmu")
    sweep(study, engine="batch", workers=1, output=tmp_path / "batch")
    assert bits(loaded(tmp_path / "batch")).equals(bits(loaded(tmp_path / "fmu")))
    errors = [row["error"] for row in rows(loaded(tmp_path / "batch"))]
    assert all("external.force.x = -1e+308: must not drive the craft" in error for error in errors[::3])
    assert not any("must not drive" in error for error in [*errors[1::3], *errors[2::3]] if error)


def test_the_batch_warns_as_the_fmu_does(fmu: Path, tmp_path: Path) -> None:
    study = but(
        set=COARSE | {"drag_center_fraction": 0.0},
        sweep={"velocity.x": [0.0, 30.0], "velocity.yaw_rate": [0.0, -9.0], "thrust_max": [7.0, 12.0]},
    )
    sweep(study, fmu, workers=1, output=tmp_path / "fmu")
    outcome = sweep(study, engine="batch", workers=1, output=tmp_path / "batch")
    theirs = loaded(tmp_path / "fmu")["warnings"].to_pylist()
    assert loaded(tmp_path / "batch")["warnings"].to_pylist() == theirs
    assert len(set(theirs)) > 3
    assert any(each & STEP_UNSTABLE for each in theirs)
    assert outcome.warned == sum(each != 0 for each in theirs)


# ---- what is kept, and what is swept


def test_what_is_kept_is_what_the_closed_form_says(tmp_path: Path) -> None:
    """A launch: v = v_t*tanh(t/tau), x = v_t*tau*ln(cosh(t/tau)); thrust 5 N, so v_t = sqrt(T/k), tau = m*v_t/T."""
    study = {
        "scene": "launch",
        "set": {"integrator": "rk4", "step_size": 0.02},
        "communication_step": 0.02,
        "sweep": {"mass": {"from": 50.0, "to": 200.0, "count": 4}},
        "keep": {
            "end": ["drift_angle", "turning_radius"],
            "maximum": ["acceleration.x"],
            "minimum": ["speed"],
            "distance": True,
            "events": {
                "half": {"of": "speed", "above": 0.5 * math.sqrt(5.0 / 57.421875), "values": ["pose.x"]},
                "at_once": {"of": "pose.x", "below": 1.0},
                "never": {"of": "pose.y", "above": 1.0, "values": ["speed"]},
            },
        },
    }
    sweep(study, engine="batch", workers=1, output=tmp_path)
    terminal = math.sqrt(5.0 / 57.421875)
    for row, mass in zip(rows(loaded(tmp_path)), (50.0, 100.0, 150.0, 200.0), strict=True):
        tau = mass * terminal / 5.0
        assert row["mass"] == mass
        assert row["distance"] == pytest.approx(terminal * tau * math.log(math.cosh(60.0 / tau)), rel=1e-9)
        # linear in a step of 0.02 s: the error is at most v''*h^2/8 over the slope
        assert row["half.time"] == pytest.approx(tau * math.atanh(0.5), abs=0.02**2 / tau)
        assert row["half.pose.x"] == pytest.approx(terminal * tau * math.log(math.cosh(math.atanh(0.5))), abs=1e-4)
        assert (row["at_once.time"], row["never.time"], row["never.speed"]) == (0.0, None, None)
        assert row["maximum.acceleration.x"] == 5.0 / mass
        assert (row["minimum.speed"], row["end.drift_angle"], row["end.turning_radius"]) == (0.0, 0.0, math.inf)


def test_the_study_of_turning_circles_obeys_newton(tmp_path: Path) -> None:
    """A steady turn: no moment, so the drag's is that of the thruster, x_d*Y = -L/2*side; and m*r*u = Y + side.

    With x_d = f*L: m*r*u = side*(1 - 1/(2f)), whatever the density; there r*u = (speed/radius)*speed*cos(drift).
    """
    assert STUDIES == ("turning_circle",)
    whole = read_study("turning_circle")
    assert whole.runs == 775
    few = (Factor("drag_center_fraction", (-0.4, -0.25, -0.1)), Factor("air_density", (0.3, 1.5)))
    keep = replace(whole.keep, end=("turning_radius", "drift_angle", "speed", "body.surge", "velocity.yaw_rate"))
    sweep(replace(whole, sampling=Sampling(few, 6, None), keep=keep), engine="batch", workers=1, output=tmp_path)
    side, mass = 0.2 * 3.0, 100.0
    made = rows(loaded(tmp_path))
    for row in made:
        f = row["drag_center_fraction"]
        turn = row["end.speed"] ** 2 / row["end.turning_radius"] * math.cos(row["end.drift_angle"])
        assert turn == pytest.approx(side * (1.0 - 1.0 / (2.0 * f)) / mass, rel=1e-4)
        assert row["end.velocity.yaw_rate"] * row["end.body.surge"] == pytest.approx(turn, rel=1e-12)
    radius = {(row["drag_center_fraction"], row["air_density"]): row["end.turning_radius"] for row in made}
    assert radius[-0.4, 0.3] > radius[-0.25, 0.3] > radius[-0.1, 0.3]
    assert all(radius[f, 0.3] > 3.0 * radius[f, 1.5] for f in (-0.4, -0.25, -0.1))


@given(st.integers(1, 200), st.integers(0, 2**32), st.sampled_from(["linear", "log"]))
def test_a_latin_hypercube_has_one_run_in_every_stratum(runs: int, seed: int, scale: str) -> None:
    study = but(
        sweep={"mass": {"from": 50.0, "to": 200.0, "scale": scale}, "inertia": {"normal": [500.0, 20.0]},
               "drag_area": ["constant", "directional"]},
        sampling={"method": "latin_hypercube", "runs": runs, "seed": seed},
    )  # fmt: skip
    numbers = np.arange(runs)
    drawn = read_study(study).samples(numbers)
    mass = (
        (lambda m: np.log(m / 50.0) / np.log(4.0))(drawn["mass"]) if scale == "log" else (drawn["mass"] - 50.0) / 150.0
    )
    normal = np.array([0.5 * (1.0 + math.erf((each - 500.0) / 20.0 / math.sqrt(2.0))) for each in drawn["inertia"]])
    for part in (mass, normal):
        assert sorted(np.floor(part * runs * (1.0 - 1e-12)).astype(int)) == list(numbers)
    assert abs(np.count_nonzero(drawn["drag_area"] == 1) - runs / 2) <= 1.0
    # a run's parameters follow from its number alone
    again = read_study(study).samples(numbers[::-1])
    assert all(np.array_equal(again[name][::-1], drawn[name]) for name in drawn)


def test_distributions_have_their_quantiles() -> None:
    study = but(
        sweep={"mass": {"lognormal": [100.0, 0.2]}, "inertia": {"triangular": [400.0, 500.0, 700.0]}},
        sampling={"method": "latin_hypercube", "runs": 20000, "seed": 3},
    )
    drawn = read_study(study).samples(np.arange(20000))
    assert np.median(drawn["mass"]) == pytest.approx(100.0, rel=1e-3)
    assert np.std(np.log(drawn["mass"])) == pytest.approx(0.2, rel=1e-3)
    assert np.mean(drawn["inertia"]) == pytest.approx((400.0 + 500.0 + 700.0) / 3.0, rel=1e-4)
    assert 400.0 <= drawn["inertia"].min() < drawn["inertia"].max() <= 700.0


def test_a_grid_is_every_combination() -> None:
    drawn = read_study(MASSES).samples(np.arange(6))
    assert list(zip(*drawn.values(), strict=True)) == [(m, d) for m in (60.0, 100.0, 170.0) for d in (0.3, 1.2)]


RANGE = {"from": 50.0, "to": 200.0}


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"frob": 3}, "frob = 3: the key must be one of scene, inputs, preset"),
        ({"inputs": "log.csv"}, "scene: must be given, or else inputs"),
        ({"scene": "nix"}, "scene = 'nix': must be one of launch"),
        ({"scene": 3}, "scene = 3: must be text"),
        ({"scene": "log.csv"}, "must be the name of a scene; a control log is given as inputs"),
        ({"preset": "moon"}, "preset = 'moon': must be one of textbook, ice"),
        ({"stop_time": "soon"}, "stop_time = 'soon': must be a finite number"),
        ({"stop_time": 0}, "stop_time = 0.0 s: must be after start_time = 0.0 s"),
        ({"set": {"frob": 3}}, "set.frob = 3: must be a variable that can be set: thrust"),
        ({"set": {"length": -3}}, "set.length = -3.0: must be greater than 0"),
        ({"set": {"length": True}}, "set.length = True: must be a"),
        ({"set": {"integrator": 1.5}}, "set.integrator = 1.5: must be a whole number or a name"),
        ({"stop_time": 1e300}, "must not make more than 10^8 steps"),
        ({"set": {"integrator": "magic"}}, "set.integrator = 'magic': must be one of semi_implicit_euler"),
        ({"set": {"step_size": 0.0}}, "set.step_size = 0.0 s: must be a finite number greater than 0"),
        ({"set": {"mass": 90}}, "set.mass = 90: must not be swept, too"),
        ({"set": 3}, "set = 3: must be a table"),
        ({"sweep": {}}, "sweep: must have at least one parameter"),
        ({"sweep": {"mass": []}}, "sweep.mass = []: must have at least one value"),
        ({"sweep": {"mass": 3}}, "sweep.mass = 3: must be a list of values, a range or a distribution"),
        ({"sweep": {"mass": [1.0, 0.0]}}, "sweep.mass = 0.0: must be greater than 0"),
        ({"sweep": {"mass": [1.0, math.nan]}}, "sweep.mass = nan: must be a finite number"),
        ({"sweep": {"speed": [1.0]}}, "sweep.speed = 1.0: must be a variable that can be set"),
        ({"sweep": {"frob": RANGE}}, "must be a variable that can be set"),
        ({"sweep": {"thrust": [1.0]}}, "must be an input that turn leaves alone"),
        ({"set": {}, "sweep": {"integrator": RANGE}}, "must be a list of values: the variable is no real number"),
        ({"sweep": {"mass": {"from": 50.0, "count": 3}}}, "sweep.mass.to: must be given"),
        ({"sweep": {"mass": {"from": 50.0, "to": 40, "count": 3}}}, "sweep.mass.to = 40.0: must be above from = 50.0"),
        ({"sweep": {"mass": {"from": 0.0, "to": 40.0, "count": 3}}}, "sweep.mass = 0.0: must be greater than 0"),
        ({"sweep": {"mass": RANGE | {"count": 1}}}, "sweep.mass.count = 1: must be a whole number from 2"),
        ({"sweep": {"mass": RANGE | {"scale": "odd"}}}, "sweep.mass.scale = 'odd': must be linear or log"),
        ({"sweep": {"mass": RANGE | {"step": 1}}}, "sweep.mass.step = 1: the key must be one of from, to, count"),
        ({"sweep": {"mass": RANGE}}, "sweep.mass: must be a list, or a range with a count, where sampling"),
        ({"sweep": {"mass": {"normal": [1.0]}}}, "sweep.mass.normal = [1.0]: must be a list of mean, standard"),
        ({"sweep": {"mass": {"normal": [1.0, 0.0]}}}, "the standard deviation must be greater than 0"),
        ({"sweep": {"mass": {"triangular": [3, 2, 4]}}}, "sweep.mass.triangular = [3, 2, 4]: must rise"),
        ({"sampling": {"method": "luck"}}, "sampling.method = 'luck': must be one of grid, latin_hypercube"),
        ({"sampling": {"runs": 3}}, "sampling.runs = 3: the key must be one of method"),
        ({"set": {"thrust": 1.0}}, "set.thrust = 1.0: must be an input that turn leaves alone: its start value has no"),
        ({"keep": {"trajectory": {"every": 1e300, "of": ["speed"]}}}, "every = 1e+300 s: must be a whole number"),
        ({"sampling": {"method": "latin_hypercube", "seed": 1}}, "sampling.runs = None: must be a whole number from 1"),
        ({"sampling": {"method": "latin_hypercube", "runs": 9}}, "sampling.seed = None: must be a whole number from 0"),
        ({"sampling": {"method": "latin_hypercube", "runs": 10**11, "seed": 1}}, "must not be more than 10000000000"),
        ({"keep": {}}, "keep: must name what to keep"),
        ({"keep": {"end": ["mass"]}}, "keep.end = 'mass': must be one of pose.x"),
        ({"keep": {"end": "speed"}}, "keep.end = 'speed': must be a list of names, each once"),
        ({"keep": {"distance": 1}}, "keep.distance = 1: must be true or false"),
        ({"keep": {"events": {"a": {"of": "speed"}}}}, "keep.events.a: must have above or below, one of them"),
        ({"keep": {"events": {"a": {"above": 1.0}}}}, "keep.events.a.of = None: must be one of"),
        ({"keep": {"trajectory": {"every": 0.25, "of": ["speed"]}}},
         "keep.trajectory.every = 0.25 s: must be a whole number of communication steps of 0.1 s"),
        ({"keep": {"trajectory": {"every": 0.5}}}, "keep.trajectory.of = None: must be a list of names"),
    ],
)  # fmt: skip
def test_a_bad_study_gets_one_clear_line(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError) as caught:  # noqa: PT011 - the message is compared below
        read_study(but(**changes))
    assert message in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1


def test_a_study_lists_all_its_mistakes_at_once(tmp_path: Path) -> None:
    """Each on a line of its own, with the file; and what follows from another mistake is none."""
    file = tmp_path / "wild.toml"
    file.write_text("""
        scene = "turn"
        stop_time = -1.0
        communication_step = 0.0
        speed = 3
        set = {mass = -3, port_thruster = 1, integrator = 2.7}
        sampling = {method = "latin_hypercube", runs = 0, seed = "x"}
        [sweep]
        length = [20.0, 0.0, -1.0]
        frob = [1]
        height = [5.0]
        thrust = [1.0]
        width = {from = 5.0, to = 4.0, count = 1, by = 2}
        [keep]
        end = ["mass", "speed", "frob"]
        distance = 1
        events.a = {of = "nix", above = 1.0, below = 2.0}
        trajectory = {every = "often", of = ["frob"]}
    """)
    with pytest.raises(ValueError, match="wild") as caught:
        read_study(file)
    lines = str(caught.value).splitlines()
    assert all(line.startswith(f"{file}: ") for line in lines)
    told = [line.removeprefix(f"{file}: ").split(": must")[0].split(": the key")[0] for line in lines]
    assert sorted(told) == sorted([
        "speed = 3", "stop_time = -1.0 s", "communication_step = 0.0 s", "set.mass = -3.0", "set.integrator = 2.7",
        "set.port_thruster = 1", "sampling.runs = 0", "sampling.seed = 'x'",
        "sweep.length = 0.0", "sweep.length = -1.0",
        "sweep.frob = 1", "sweep.thrust = [1.0]", "sweep.width.by = 2", "sweep.width.count = 1", "sweep.width.to = 4.0",
        "keep.end = 'mass'", "keep.end = 'frob'", "keep.distance = 1", "keep.events.a.of = 'nix'", "keep.events.a",
        "keep.trajectory.every = 'often'", "keep.trajectory.of = 'frob'",
    ])  # fmt: skip


def test_the_command_tells_each_mistake_on_a_line(tmp_path: Path, shell: Shell) -> None:
    file = tmp_path / "bad.toml"
    file.write_text('scene = "turn"\nset.mass = -1\nsweep.length = [0.0]\nkeep.end = ["speed"]\n')
    lines = shell.run("sweep", str(file)).err.splitlines()
    assert [line.split(": must")[0] for line in lines] == [
        f"hovercraft-fmu: {file}: set.mass = -1.0",
        f"hovercraft-fmu: {file}: sweep.length = 0.0",
    ]


def test_a_study_in_a_file(tmp_path: Path) -> None:
    file = tmp_path / "blown.toml"
    file.write_text(
        'inputs = "log.csv"\nstop_time = 5\nset.wind.x = 0.1\nsweep.wind.y = [0.1, 0.2]\nkeep.end = ["speed"]\n'
    )
    with pytest.raises(OSError, match=r"log\.csv"):
        read_study(file)
    (tmp_path / "log.csv").write_text("time,thrust\n0,5\n10,5\n")
    study = read_study(file)
    assert (study.name, study.runs, study.run.stop_time) == ("blown", 2, 5.0)
    assert study.factors[0].values == (0.1, 0.2)
    assert set(study.run.signals["wind.x"]) == {0.1}
    (tmp_path / "log.csv").write_text("time,thrust\n0,6\n10,6\n")
    assert read_study(file).content != study.content  # other inputs, another study
    for text, message in (("scene = ", "must be a TOML file"), ('scene = "nix"', "scene = 'nix': must be one of")):
        file.write_text(text)
        with pytest.raises(ValueError, match=r"blown\.toml: ") as caught:
            read_study(file)
        assert message in str(caught.value)
    with pytest.raises(FileNotFoundError):
        read_study(tmp_path / "nix.toml")


# ---- the store


def test_the_metadata_tells_where_the_rows_come_from(fmu: Path, tmp_path: Path) -> None:
    import hashlib

    sweep(MASSES, fmu, workers=1, output=tmp_path)
    about = json.loads(loaded(tmp_path).schema.metadata[b"hovercraft_fmu"])
    assert json.loads(about["study"]) == MASSES
    assert about["fmu_sha256"] == hashlib.sha256(fmu.read_bytes()).hexdigest()
    assert {"python", "numpy", "pyarrow", "dask"} == about["versions"].keys()
    # any one file is plain Parquet, and says the same
    one = json.loads(pq.read_schema(tmp_path / "runs" / "00002.parquet").metadata[b"hovercraft_fmu"])
    assert one.items() >= about.items()
    assert (one["what"], one["number"], one["rows"]) == ("runs", 2, 1)
    assert one["study_sha256"] == hashlib.sha256(one["study"].encode()).hexdigest()


def _cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-1000])


def _flip(path: Path) -> None:
    content = bytearray(path.read_bytes())
    content[len(content) // 5] ^= 1
    path.write_bytes(content)


def _copy_over(path: Path) -> None:
    path.write_bytes(path.with_name("00001.parquet").read_bytes())


def _tamper(path: Path) -> None:
    path.write_bytes(path.read_bytes().replace(b'"engine": "batch"', b'"engine": "birch"'))


def _other_study(path: Path) -> None:
    sweep(but(KEPT, set={"step_size": 0.1}), engine="batch", workers=1, output=path.parents[1] / "other")
    path.write_bytes((path.parents[1] / "other" / path.parent.name / path.name).read_bytes())


KEPT = but(keep={"end": ["speed"], "trajectory": {"every": 30.0, "of": ["speed"]}})
SPOILED: dict[str, tuple[Callable[[Path], Any], str]] = {
    "cut": (_cut, "is damaged"),
    "emptied": (lambda path: path.write_bytes(b""), "is no file of a sweep, or cut"),
    "flipped": (_flip, "is damaged"),
    "copied over": (_copy_over, "is chunk 1 of the (runs|trajectories), under another name"),
    "tampered with": (_tamper, "is damaged"),
    "foreign": (_other_study, r"another sweep \(study differ\)"),
    "gone": (Path.unlink, "is missing|1 of 2 chunks are there"),
}


@pytest.mark.parametrize("how", SPOILED)
@pytest.mark.parametrize("what", ["runs", "trajectories"])
def test_a_spoiled_chunk_is_named_and_made_anew(how: str, what: str, tmp_path: Path) -> None:
    spoil, why = SPOILED[how]
    sweep(KEPT, engine="batch", workers=1, output=tmp_path)
    whole = [loaded(tmp_path, each) for each in ("runs", "trajectories")]
    spoil(tmp_path / what / "00000.parquet")
    with pytest.raises(ValueError, match=why):
        loaded(tmp_path, what)
    outcome = sweep(KEPT, engine="batch", workers=1, output=tmp_path)
    assert outcome.new == 3
    if (how, what) != ("gone", "runs"):
        (named,) = outcome.spoiled
        assert re.search(f"{what}/00000.parquet: .*({why})", named)
    assert [loaded(tmp_path, each) for each in ("runs", "trajectories")] == whole


def test_a_file_that_is_no_chunk_is_refused(tmp_path: Path) -> None:
    sweep(MASSES, engine="batch", workers=1, output=tmp_path)
    (tmp_path / "runs" / "mine.parquet").touch()
    for use in (loaded, lambda folder: sweep(MASSES, engine="batch", workers=1, output=folder)):
        with pytest.raises(ValueError, match=r"mine\.parquet: is none of a sweep's files: move it elsewhere"):
            use(tmp_path)


def test_two_sweeps_cannot_share_a_folder(tmp_path: Path) -> None:
    """Nor can the same one be made twice at a time; a killed one leaves no lock."""

    def try_another(_: int) -> None:
        for study in (MASSES, but(set={})):
            with pytest.raises(ValueError, match="another sweep is at work here"):
                sweep(study, engine="batch", workers=1, output=tmp_path)

    sweep(MASSES, engine="batch", workers=1, output=tmp_path, tell=try_another)
    code = f"""
import os, signal
from hovercraft_fmu.sweeps import sweep
sweep({MASSES}, engine="batch", workers=1, output={str(tmp_path / "killed")!r},
      tell=lambda runs: os.kill(os.getpid(), signal.SIGKILL) if runs else None)
"""
    assert subprocess.run([sys.executable, "-c", code], timeout=60).returncode == -signal.SIGKILL
    assert sweep(MASSES, engine="batch", workers=1, output=tmp_path / "killed").new == 3


def test_parts_are_the_whole(tmp_path: Path) -> None:
    """To the bit, made at the same time; each says what is missing yet of the whole."""
    study = but(KEPT, sweep={"mass": RANGE}, sampling={"method": "latin_hypercube", "runs": 7, "seed": 1})
    once = sweep(study, engine="batch", workers=1, output=tmp_path / "whole")
    there = tmp_path / "parts"

    def meanwhile(done: int) -> None:
        if not done:
            made = sweep(study, engine="batch", workers=1, output=there, part="2/3")
            assert (made.runs, made.new, made.missing) == (3, 3, 4)
            with pytest.raises(ValueError, match="another sweep is at work here"):
                sweep(study, engine="batch", workers=1, output=there)
            with pytest.raises(ValueError, match=r"holds the results of another sweep \(study differ\)"):
                sweep(but(study, stop_time=30.0), engine="batch", workers=1, output=there, part="3/3")

    first = sweep(study, engine="batch", workers=1, output=there, part="1/3", tell=meanwhile)
    assert (once.runs, first.runs, first.new, first.missing) == (7, 4, 4, 0)
    assert sweep(study, engine="batch", workers=1, output=there, part="3/3").runs == 0  # there are two chunks
    for what in ("runs", "trajectories"):
        assert load(there, what).to_table().equals(load(tmp_path / "whole", what).to_table())
    with pytest.raises(ValueError, match="overwrite: must not be given with part"):
        sweep(study, engine="batch", workers=1, output=there, part="1/3", overwrite=True)


def test_a_folder_may_have_any_name(tmp_path: Path) -> None:
    folder = tmp_path / "a::b" / "ä *?[#]"
    assert sweep(MASSES, engine="batch", workers=1, output=folder).folder == folder
    assert sweep(MASSES, engine="batch", workers=1, output=f"file://{tmp_path}/c").folder == tmp_path / "c"
    assert load(folder).to_table() == load(tmp_path / "c").to_table()


@pytest.mark.parametrize("part", ["3/2", "0/2", "x", "1/0", "-1/2", "1/2/3", "1.0/2", "", "1"])
def test_a_part_that_is_none(part: str, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=f"part = '{part}': must be k/n with k from 1 to n, as 2/8"):
        sweep(MASSES, engine="batch", output=tmp_path / "new", part=part)
    assert not (tmp_path / "new").exists()


@pytest.fixture
def memory() -> Iterator[str]:
    """An address of a store of objects in this process, empty."""
    yield "memory://bucket/sweep"
    filesystem("memory").rm("/bucket", recursive=True)


@pytest.mark.parametrize("aside", [False, True], ids=["put whole", "renamed"])
def test_a_sweep_at_an_address_is_that_of_a_folder(
    aside: bool, memory: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And goes on there, is whole again where it was spoiled, refuses another study, is overwritten by one."""
    if aside:  # as over SFTP
        monkeypatch.setattr(place_module, "PUT_WHOLE", set())
    sweep(KEPT, engine="batch", workers=1, output=tmp_path)
    outcome = sweep(KEPT, engine="batch", workers=1, output=memory)
    assert (outcome.folder, outcome.new) == (memory, 6)
    for what in ("runs", "trajectories"):
        assert names_at(f"{memory}/{what}") == ["00000.parquet", "00001.parquet"]
        assert load(memory, what).to_table().equals(load(tmp_path, what).to_table())
    file = "/bucket/sweep/runs/00001.parquet"
    filesystem("memory").pipe(file, filesystem("memory").cat(file)[:-100])
    outcome = sweep(KEPT, engine="batch", workers=1, output=memory)
    assert (outcome.new, len(outcome.spoiled)) == (3, 1)
    assert names_at(f"{memory}/runs") == [".00001.parquet.spoiled", "00000.parquet", "00001.parquet"]
    assert load(memory).to_table().equals(load(tmp_path).to_table())
    # a store looks after its bytes: of a file that is there its end is read, and all of it by `load`
    content = bytearray(filesystem("memory").cat(file))
    content[100] ^= 1
    filesystem("memory").pipe(file, bytes(content))
    assert sweep(KEPT, engine="batch", workers=1, output=memory).new == 0
    with pytest.raises(ValueError, match=r"runs/00001\.parquet: is damaged: .*: remove it; the same command makes it"):
        load(memory).to_table()
    with pytest.raises(ValueError, match=rf"{memory}: holds the results of another sweep \(study differ\)"):
        sweep(MASSES, engine="batch", workers=1, output=memory)
    assert sweep(MASSES, engine="batch", workers=1, output=memory, overwrite=True).new == 6
    assert names_at(f"{memory}/trajectories") == []


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("nix://here", "must be a folder, or an address as s3://bucket/folder; ValueError: Protocol not known: nix"),
        ("s3://me:secret@bucket/a", "output = 's3://bucket/a': must be without credentials and options"),
        ("s3://bucket/a?secret=secret", "output = 's3://bucket/a': must be without credentials and options"),
        ("gs://bucket/a", "output = 'gs://bucket/a': must be of a store whose library is installed: pip install gcsfs"),
    ],
)
def test_an_address_that_cannot_be(address: str, message: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "gcsfs", None)
    with pytest.raises(ValueError, match=re.escape(message)) as refused:
        sweep(MASSES, engine="batch", workers=1, output=address)
    assert "secret" not in str(refused.value)


@pytest.mark.skipif(not hasattr(os, "seteuid"), reason="users of POSIX")
def test_a_folder_without_permission(tmp_path: Path) -> None:
    """It is named; root, who may write anywhere, tries it as nobody."""
    about = runner_module.job_of(read_study(MASSES), None, "batch", place_of(tmp_path)).about
    user = os.geteuid()
    with tempfile.TemporaryDirectory() as place:
        Path(place).chmod(0o555)
        os.seteuid(user or 65534)
        try:
            with pytest.raises(PermissionError) as refused, store(place_of(f"{place}/new"), about):
                pass
        finally:
            os.seteuid(user)
    assert refused.value.filename == f"{place}/new"


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="needs /proc")
def test_memory_does_not_depend_on_the_runs(tmp_path: Path) -> None:
    """Of a process that makes runs of a billion, as many at a time as memory allows: one that starts a sweep, too."""
    study = but(
        sweep={"mass": RANGE, "inertia": {"normal": [500.0, 9.0]}},
        sampling={"method": "latin_hypercube", "runs": 10**9, "seed": 1},
        keep={"trajectory": {"every": 0.1, "of": ["pose.x", "pose.y"]}},
    )
    code = f"""
from hovercraft_fmu.sweeps import sweep
def tell(runs):
    if runs:
        lines = open("/proc/self/status").readlines()
        print(runs, next(line.split()[1] for line in lines if line.startswith("VmHWM:")))
        raise SystemExit
sweep({study}, engine="batch", workers=1, output={str(tmp_path)!r}, tell=tell)
"""
    made = subprocess.run([sys.executable, "-c", code], timeout=60, check=True, capture_output=True, text=True)
    runs, kilobytes = map(int, made.stdout.split())
    assert runs > 500
    assert kilobytes < 250e3


@pytest.mark.parametrize("name", ["..", "a b", "ä", ".hidden", "a/b"])
def test_a_study_that_names_no_folder_is_refused(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ValueError, match="must be letters, digits, _, - and dots between them"):
        sweep(replace(read_study(MASSES), name=name), engine="batch", workers=1)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("keep", "column"),
    [
        ({"end": ["speed"], "events": {"end": {"of": "speed", "above": 0.1, "values": ["speed"]}}}, "end.speed"),
        ({"maximum": ["speed"], "events": {"maximum": {"of": "speed", "above": 0.1, "values": ["speed"]}}},
         "maximum.speed"),
    ],
)  # fmt: skip
def test_a_column_is_there_once(keep: dict[str, Any], column: str) -> None:
    with pytest.raises(ValueError, match=f"keep: the column {column} must be there once"):
        read_study(but(keep=keep))


def test_a_sweep_goes_on_only_as_it_began(fmu: Path, native_fmu: Path, tmp_path: Path) -> None:
    assert sweep(MASSES, fmu, workers=1, output=tmp_path).new == 6
    assert sweep(MASSES, fmu, workers=1, output=tmp_path).new == 0
    with pytest.raises(ValueError, match=r"holds the results of another sweep \(study differ\)"):
        sweep(but(set={}), fmu, workers=1, output=tmp_path)
    with pytest.raises(ValueError, match=r"\(fmu_sha256 differ\)"):
        sweep(MASSES, native_fmu, workers=1, output=tmp_path)
    with pytest.raises(ValueError, match=r"\(engine, fmu_sha256, chunk differ\)"):
        sweep(MASSES, engine="batch", workers=1, output=tmp_path)
    before = loaded(tmp_path)
    (tmp_path / "runs" / "00003.parquet").unlink()
    with pytest.raises(ValueError, match="5 of 6 chunks are there, not 3: finish it with the same command"):
        loaded(tmp_path)
    assert sweep(MASSES, fmu, workers=1, output=tmp_path).new == 1
    assert loaded(tmp_path).equals(before)
    with pytest.raises(ValueError, match="the sweep kept no trajectories"):
        loaded(tmp_path, "trajectories")
    with pytest.raises(FileNotFoundError, match="no sweep is there"):
        loaded(tmp_path / "nix")


KILLED = """
import json, sys
from hovercraft_fmu.sweeps import sweep
if __name__ == "__main__":
    sweep(json.loads(sys.argv[1]), sys.argv[2], workers=2, output=sys.argv[3])
"""


def _has_ended(process: psutil.Process) -> bool:
    try:
        return process.status() == psutil.STATUS_ZOMBIE  # not everywhere is there somebody who asks what became of it
    except psutil.NoSuchProcess:
        return True


def test_a_killed_sweep_goes_on_and_loses_nothing(fmu: Path, tmp_path: Path) -> None:
    study = but(
        sweep={"mass": RANGE},
        sampling={"method": "latin_hypercube", "runs": 32, "seed": 1},
        keep={"distance": True, "trajectory": {"every": 30.0, "of": ["pose.x", "pose.y"]}},
    )
    there = tmp_path / "killed" / "runs"
    command = [sys.executable, "-W", "error", "-c", KILLED, json.dumps(study), str(fmu), str(tmp_path / "killed")]
    process = subprocess.Popen(command)
    while len(list(there.glob("*.parquet"))) < 2:
        assert process.poll() is None
        time.sleep(0.005)
    workers = psutil.Process(process.pid).children()
    assert len(workers) >= 2
    process.kill()
    process.wait()
    for _ in range(6000):  # or they have not ended with the process that started them
        if all(_has_ended(each) for each in workers):
            break
        time.sleep(0.01)
    assert all(_has_ended(each) for each in workers)
    made = len(list(there.glob("*.parquet")))
    assert 2 <= made < 16
    kept = {path: path.stat().st_mtime_ns for path in there.glob("*.parquet")}
    assert sweep(study, fmu, workers=1, output=tmp_path / "killed").new == 32 - made
    assert all(path.stat().st_mtime_ns == when for path, when in kept.items())
    sweep(study, fmu, workers=1, output=tmp_path / "whole")
    for what in ("runs", "trajectories"):
        assert loaded(tmp_path / "killed", what).equals(loaded(tmp_path / "whole", what))


def chunk_of(study: dict[str, Any], fmu: Path | None = None, runs: int = 10**9, **swept: Any) -> int:
    """Runs in a chunk of a study with so many."""
    latin = {"method": "latin_hypercube", "runs": runs, "seed": 1}
    chosen = read_study(but(study, sweep={"mass": RANGE, **swept}, sampling=latin))
    job = runner_module.job_of(chosen, fmu, "fmu" if fmu else "batch", place_of("nowhere"))
    return int(job.about["chunk"])


def test_a_chunk_is_some_seconds_of_counted_work(fmu: Path, native_fmu: Path) -> None:
    """Half the sub-step, half the runs; where memory is short, as many as it holds. Nothing is timed."""
    fine, finer = (but(set={"integrator": "semi_implicit_euler", "step_size": h}) for h in (1e-4, 5e-5))
    assert chunk_of(fine) == pytest.approx(2 * chunk_of(finer), rel=0.02)
    assert chunk_of(fine, runs=10**5) == chunk_of(fine)
    # a sub-step of Euler's takes some 7 ns in the batch, 30 in the native FMU, 900 in Python
    usual = but(set={"integrator": "semi_implicit_euler", "step_size": 1e-3})
    for path, nanoseconds in ((None, 7.0), (native_fmu, 30.0), (fmu, 900.0)):
        assert 1.0 < chunk_of(usual, path) * 60_000 * 1e-9 * nanoseconds < 5.0
    for every in (0.1, 0.3):  # each value of 8 bytes is there some times
        points = but(keep={"trajectory": {"every": every, "of": list(OBSERVED)}})
        assert 0.05 < chunk_of(points) * 8 * len(OBSERVED) * (60.0 / every) / chunks.MOST_BYTES < 0.5
    assert [chunk_of(MASSES, runs=runs) for runs in (1, 2, 100)] == [1, 1, 50]
    assert [chunk_of(MASSES, native_fmu, runs=runs) for runs in (32, 3200)] == [1, 100]


def test_swept_settings_count_on_average() -> None:
    one, other, both = (
        chunk_of(but(set={"integrator": "splitting"}), step_size=sizes) for sizes in ([1e-4], [1e-3], [1e-4, 1e-3])
    )
    assert both == pytest.approx(2.0 / (1.0 / one + 1.0 / other), rel=0.01)


# ---- on workers


@pytest.mark.once
def test_the_bits_do_not_depend_on_who_makes_the_runs(fmu: Path, native3_fmu: Path, tmp_path: Path) -> None:
    """In this process; on two processes of a cluster on loopback, which get the FMU by content: its file is gone."""
    import distributed

    cluster = {"n_workers": 2, "threads_per_worker": 1, "host": "127.0.0.1"}
    with distributed.LocalCluster(**cluster, dashboard_address="127.0.0.1:0") as there:
        for path in (fmu, native3_fmu):
            assert_the_bits_are_those_of(there.scheduler_address, path, tmp_path / path.stem)
        # memory is each process's own
        with pytest.raises(OSError, match=r"2 of 2 do not: tcp://.*, tcp://.* \(what is written here is not there\)"):
            sweep(MASSES, fmu, scheduler=there.scheduler_address, output="memory://blind")
    assert names_at("memory://blind") == ["sweep.json"]


def assert_the_bits_are_those_of(scheduler: str, fmu: Path, folder: Path) -> None:
    import distributed

    study = but(FAILING, keep={"distance": True, "trajectory": {"every": 15.0, "of": ["pose.x"]}})
    sweep(study, fmu, workers=1, output=folder / "here")
    copy = folder / "copy.fmu"
    copy.write_bytes(fmu.read_bytes())
    outcome = sweep(
        study, copy, scheduler=scheduler, output=folder / "there", tell=lambda _: copy.unlink(missing_ok=True)
    )
    assert not copy.exists()
    with distributed.Client(scheduler, set_as_default=False) as client:
        left = client.run(_drivers)
        assert list(left.values()) == [0, 0]  # every instance was freed
    assert (outcome.new, outcome.failed) == (6, 4)
    for what in ("runs", "trajectories"):
        here = bits(loaded(folder / "here", what))
        assert bits(loaded(folder / "there", what)).equals(here)


def _drivers() -> int:
    return len(DRIVERS)


class Elsewhere:
    """A worker whose folder is another one, with what was there at first."""

    def run(self, function: Callable[..., Any], place: Place, mark: str, on_error: str) -> dict[str, Any]:
        assert on_error == "return"
        there = Path(place.address).with_name("elsewhere")
        shutil.copytree(place.address, there)
        return {"tls://10.0.0.2:4000": function(place_of(there), mark)}


def test_a_place_that_a_worker_does_not_see_is_refused(tmp_path: Path) -> None:
    """In either direction; and by a worker that comes later, at its first chunk. Nothing is left of the trial."""
    with pytest.raises(OSError, match=r"1 of 1 do not: tls://10\.0\.0\.2:4000 \(what it writes is not here\)"):
        check_seen(Elsewhere(), place_of(tmp_path / "here"))
    assert names_at(str(tmp_path / "here")) == []
    job = runner_module.job_of(read_study(MASSES), None, "batch", place_of(tmp_path / "there"))
    with pytest.raises(OSError, match="must be a place that every worker sees"):
        make_chunk(job, 0)
    assert not (tmp_path / "there").exists()


def names_at(address: str) -> list[str]:
    return sorted(place_of(address).names(""))


@pytest.mark.once
def test_two_workers_of_this_machine_give_the_bits_of_one(tmp_path: Path) -> None:
    """With the batch, too."""
    study = but(sweep={"mass": RANGE}, sampling={"method": "latin_hypercube", "runs": 300, "seed": 1})
    for workers in (1, 2):
        sweep(study, engine="batch", workers=workers, output=tmp_path / str(workers))
    assert loaded(tmp_path / "1").equals(loaded(tmp_path / "2"))


@pytest.mark.once
def test_nothing_listens_and_no_worker_is_left(native_fmu: Path, tmp_path: Path) -> None:
    def listening() -> list[str]:
        connections = [one for each in (me, *me.children(recursive=True)) for one in each.net_connections()]
        return [one.laddr.ip for one in connections if one.status == "LISTEN"]

    me, seen = psutil.Process(), []
    before = {child.pid for child in me.children()}, listening()
    sweep(MASSES, native_fmu, workers=2, output=tmp_path, tell=lambda _: seen.append(listening()))
    assert seen == [before[1]] * 7
    assert len({child.pid for child in me.children()} - before[0]) <= 1  # Python's own tracker of resources


@pytest.mark.once
def test_a_worker_that_is_killed_is_an_error_and_what_was_made_stays(native_fmu: Path, tmp_path: Path) -> None:
    def kill(runs: int) -> None:
        if runs == 1:
            victim = next(each for each in psutil.Process().children() if "spawn_main" in " ".join(each.cmdline()))
            victim.kill()
            victim.wait()

    study = but(sweep={"mass": RANGE}, sampling={"method": "latin_hypercube", "runs": 32, "seed": 1})
    with pytest.raises(SimulationError, match="a worker is gone: its process ended"):
        sweep(study, native_fmu, workers=2, output=tmp_path, tell=kill)
    made = len(list((tmp_path / "runs").glob("*.parquet")))
    assert sweep(study, native_fmu, workers=1, output=tmp_path).new == 32 - made < 32


@pytest.fixture(scope="session")
def identities(tmp_path_factory: pytest.TempPathFactory) -> dict[str, tuple[Path, Path]]:
    """A certificate, signed by itself, and its key: ours, and a stranger's."""
    openssl = shutil.which("openssl")
    if not openssl:
        pytest.skip("no openssl: apt-get install openssl")
    folder = tmp_path_factory.mktemp("identities")
    made: dict[str, tuple[Path, Path]] = {}
    for name in ("ours", "stranger"):
        cert, key = folder / f"{name}.pem", folder / f"{name}.key"
        command = [openssl, "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes",
                   "-subj", f"/CN={name}", "-keyout", str(key), "-out", str(cert)]  # fmt: skip
        subprocess.run(command, check=True, capture_output=True)
        made[name] = cert, key
    return made


@pytest.mark.once
def test_a_cluster_lets_in_who_has_the_key(
    identities: dict[str, tuple[Path, Path]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Over TLS; without it whoever reaches a scheduler runs code there."""
    import distributed

    ours = identities["ours"][0], *identities["ours"]
    names = [f"tls_{who}_{what}" for who in ("client", "scheduler", "worker") for what in ("cert", "key")]
    security = distributed.Security(
        tls_ca_file=str(ours[0]), require_encryption=True, **dict(zip(names, map(str, ours[1:] * 3), strict=True))
    )
    monkeypatch.setattr(cluster, "CONNECT", 1.0)
    here = {"n_workers": 1, "threads_per_worker": 1, "host": "127.0.0.1", "processes": False, "dashboard_address": ":0"}
    with distributed.LocalCluster(**here, security=security, protocol="tls://") as there:
        address = there.scheduler_address
        outcome = sweep(MASSES, engine="batch", scheduler=address, tls=ours, output=tmp_path / "ours")
        assert outcome.new == 6
        strange = ours[0], *identities["stranger"]
        with pytest.raises(OSError, match="must be there, and let in who has this certificate"):
            sweep(MASSES, engine="batch", scheduler=address, tls=strange, output=tmp_path / "strangers")
        plain = address.replace("tls://", "tcp://")
        with pytest.raises(OSError, match="must be there"):
            sweep(MASSES, engine="batch", scheduler=plain, output=tmp_path / "no one's")
    refused: list[tuple[Any, str, str]] = [
        ((ours[0], None, None), address, "must be given all three"),
        ((None, None, None), address, "must be given all three for tls://"),
        (ours, "tcp://127.0.0.1:1", "must be as tls://"),
        ((*ours[:2], strange[2]), address, "must be PEM files of one identity"),
    ]
    for tls, scheduler, message in refused:
        with pytest.raises(ValueError, match=message):
            sweep(MASSES, engine="batch", scheduler=scheduler, tls=tls, output=tmp_path / "bad")


def test_a_scheduler_that_is_not_there(fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cluster, "CONNECT", 0.5)
    with pytest.raises(OSError, match=r"127\.0\.0\.1:1"):
        sweep(MASSES, fmu, scheduler="tcp://127.0.0.1:1", output=tmp_path)
    with pytest.raises(ValueError, match="scheduler = 'nonsense': must be an address as tcp://"):
        sweep(MASSES, fmu, scheduler="nonsense", output=tmp_path)


def test_an_fmu_of_another_model_is_refused(tmp_path: Path, autopilot: Path) -> None:
    with pytest.raises(ValueError, match=r"Autopilot\.fmu: is an FMU of the model 'Autopilot': must be of"):
        sweep(MASSES, autopilot, workers=1, output=tmp_path)


def test_bad_arguments(tmp_path: Path, fmu: Path) -> None:
    for options, message in (
        ({"engine": "steam"}, "engine = 'steam': must be one of fmu, batch"),
        ({"workers": 0}, "workers = 0: must be at least 1"),
        ({"workers": 2, "scheduler": "tcp://127.0.0.1:1"}, "workers = 2: must not be given with a scheduler"),
        ({"engine": "batch"}, "must not be given with the engine batch"),
    ):
        with pytest.raises(ValueError, match=message):
            sweep(MASSES, fmu, output=tmp_path, **options)
    with pytest.raises(FileNotFoundError, match="no such FMU"):
        sweep(MASSES, tmp_path / "nix.fmu", output=tmp_path)


def test_a_worker_with_another_version_is_refused() -> None:
    study = read_study(MASSES)
    plan = Plan(study.run, study.keep, timeline(study.run, study.keep))
    job = Job("any", "9.9", plan, study.sampling, None, {}, place_of("nowhere"))
    with pytest.raises(ValueError, match=r"a worker has hovercraft-fmu .*: must be 9\.9"):
        make_chunk(job, 0)


# ---- pictures, the command


def test_pictures_show_the_results(tmp_path: Path) -> None:
    """Each kind of study has its own; it is drawn the same again, and otherwise where the results are others."""
    latin = {"method": "latin_hypercube", "runs": 12, "seed": 1}
    two = {"mass": RANGE, "air_density": {"from": 0.3, "to": 1.2}}
    studies = {
        "curve": but(sweep={"mass": [60.0, 100.0, 170.0]}),
        "map": MASSES,
        "cloud": but(sweep=two, sampling=latin),
        "points": but(sweep=two | {"inertia": {"normal": [500.0, 20.0]}}, sampling=latin),
        "paths": but(keep={"trajectory": {"every": 1.0, "of": ["pose.x", "pose.y"]}}),
    }
    others = {"curve of others": but(studies["curve"], set=COARSE | {"steering_force": 1.0})}
    seen = set()
    for kind, study in (studies | others).items():
        sweep(study, engine="batch", workers=1, output=tmp_path / kind)
        seen.add(plot_sweep(tmp_path / kind, tmp_path / "new" / f"{kind}.png").read_bytes())
    assert len(seen) == 6
    assert plot_sweep(tmp_path / "curve", tmp_path / "again.png").read_bytes() in seen


STUDY = """
scene = "turn"
set.integrator = "rk4"
set.step_size = 0.1
sweep.mass = [60, 100, 170]
sweep.thrust_min = [0, 20]
keep.end = ["speed"]
"""


@pytest.mark.usefixtures("native_at_hand")
def test_the_command(tmp_path: Path, shell: Shell) -> None:
    (tmp_path / "masses.toml").write_text(STUDY)
    printed = shell.ok("sweep", "masses.toml", "--workers", "1", "--plot", "masses.png")
    assert "build/sweep/masses: 6 runs, 6 of them made now in " in printed
    assert "3 failed; the first is run 1: thrust_min = 20.0 N: must not be above thrust_max = 10.0 N" in printed
    with Image.open(tmp_path / "masses.png") as picture:
        picture.verify()
    assert "6 runs, 0 of them made now" in shell.ok("sweep", "masses.toml", "--workers", "1")
    part = ("sweep", "masses.toml", "--workers", "1", "--output", "parts", "--part")
    told = shell.ok(*part, "1/2", "--plot", "parts.png")
    assert "parts: 3 runs, 3 of them made now in " in told
    assert "3 of the 6 runs of the study, of other parts, are missing yet; parts.png is drawn when all are" in told
    assert "least" in shell.ok(*part, "2/2")
    speeds = loaded(tmp_path / "build" / "sweep" / "masses")["end.speed"].drop_null().to_pylist()
    assert len(speeds) == 3
    assert [printed.count(f" {speed:.4g} m/s") for speed in (min(speeds), max(speeds))] == [1, 1]


@pytest.mark.usefixtures("native_at_hand")
def test_what_is_wrong_is_one_clear_line(tmp_path: Path, shell: Shell) -> None:
    (tmp_path / "bad.toml").write_text(STUDY + "frob = 3\n")
    for arguments, message in (
        (("nix.toml",), "study = 'nix.toml': must be a TOML file, or one of turning_circle"),
        (("NOSUCH",), "study = 'NOSUCH': must be a TOML file, or one of turning_circle"),
        (("bad.toml",), "bad.toml: frob = 3: the key must be one of scene"),
        (("turning_circle", "nix.fmu"), "nix.fmu: no such FMU"),
        (("turning_circle", "--engine", "steam"), "engine = 'steam': must be one of fmu, batch"),
    ):
        assert message in shell.refused("sweep", *arguments)
    assert "Missing argument 'STUDY'" in shell.refused("sweep", status=2)


@pytest.mark.once
@FMI_2
def test_the_quick_costs_of_a_run(tmp_path: Path, complete_native_fmu: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Every way is measured, here with few runs; no clock is asserted."""
    monkeypatch.setattr(sweep_costs, "QUICK", tuple(way._replace(runs=5) for way in sweep_costs.QUICK))
    assert complete_native_fmu.exists()
    report = carry_out("sweeps", quick=True, folder=tmp_path)
    rows = list(csv.DictReader((tmp_path / "sweep.csv").read_text(encoding="utf-8").splitlines()))
    assert [row["way"] for row in rows] == list(dict.fromkeys(way.way for way in sweep_costs.WAYS))
    assert float(rows[0]["to_fmpy"]) == 1.0
    for row in rows:
        seconds = 1e-3 * float(row["milliseconds_a_run"]) * int(row["runs"])
        assert seconds == pytest.approx(float(row["seconds"]))
        assert float(row["peak_memory"]) > 10.0 or not Path("/proc/self/status").exists()
    assert (tmp_path / "sweep.md").read_text(encoding="utf-8").strip() in report


@pytest.mark.usefixtures("native_at_hand")
def test_what_a_person_is_told(shell: Shell) -> None:
    """Runs that never reached an event; degrees; a sweep that takes the place of another one."""
    (shell.folder / "many.toml").write_text(
        """scene = "turn"
set.integrator = "rk4"
set.step_size = 0.1
keep.end = ["pose.heading"]
keep.events.far = { of = "pose.x", above = 18.0, values = ["speed"] }
sweep.mass = [50.0, 100.0, 400.0]
sweep.pose.heading = [0.0, 3.141592653589793]
"""
    )
    command = ("sweep", "many.toml", "--engine", "batch", "--workers", "1")
    printed = shell.ok(*command)
    runs = loaded(shell.folder / "build" / "sweep" / "many")
    never = [number for number, x in enumerate(runs["far.time"].to_pylist()) if x is None]
    assert 0 < len(never) < 6
    assert f"far: {len(never)} of 6 runs never reached it: run {', '.join(map(str, never))}" in printed
    assert "pose.heading [deg] = 180" in printed
    assert "another sweep" in shell.refused(*command[:2], "--fmu", "native")
    told = json.loads(shell.ok(*command, "--overwrite", "--json"))
    assert (told["runs"], told["new"]) == (6, 6)
    assert told["never_reached"] == [{"event": "far", "runs": len(never), "first": never}]
    assert [each["unit"] for each in told["extremes"] if each["column"] == "end.pose.heading"] == ["deg"]


def test_every_scene_can_be_swept() -> None:
    for name in SCENES:
        assert read_study(but(scene=name)).runs == 6


def test_stopping_is_no_harm(fmu: Path, tmp_path: Path) -> None:
    """Ctrl-C: one line, and what was made is there."""
    (tmp_path / "many.toml").write_text(
        'scene = "turn"\nset.integrator = "rk4"\nset.step_size = 0.1\nkeep.distance = true\n'
        "sweep.mass = { from = 50, to = 200, count = 300 }\n"
    )
    line = [sys.executable, "-W", "error", "-m", "hovercraft_fmu", "sweep"]
    command = [*line, "many.toml", str(fmu), "--workers", "1"]
    # a background job of a shell ignores it, and so would the sweep
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    process = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    signal.signal(signal.SIGINT, before)
    there = tmp_path / "build" / "sweep" / "many" / "runs"
    while not list(there.glob("*.parquet")):
        assert process.poll() is None
        time.sleep(0.01)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert (process.returncode, said.strip()) == (130, "hovercraft-fmu: stopped")
    assert not list(there.glob(".*"))
