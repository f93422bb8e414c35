"""What the FMU says of its own error, against exact solutions; and that it costs nothing where nobody asks."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl
import pytest
from fmpy.fmi1 import FMICallException

from hovercraft_fmu.elsewhere import COMMUNICATION_STEP, CONTROLS, INPUT_REFERENCES
from hovercraft_fmu.fmu.description import NATIVE, NATIVE3, PYTHON
from hovercraft_fmu.fmu.interface import CRAFT_PARAMETERS, ERROR_LOST, ERRORS, MOTION, STATES
from hovercraft_fmu.fmu.start_values import variant
from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.dynamics import Controls, State
from hovercraft_fmu.model.error_estimate import LARGEST, Companion, accompany, error_factor, estimated_error
from hovercraft_fmu.model.integrators import INTEGRATORS, Integrator, integrator_number
from hovercraft_fmu.model.subcycling import Settings, advance
from hovercraft_fmu.scenes import SCENES, Scene, held
from hovercraft_fmu.simulation import Value, simulate
from hovercraft_fmu.studies.estimates import KINDS, REPORTED, SEGMENTS, judged, sampled, shares
from hovercraft_fmu.studies.reference_end import reference_end
from hovercraft_fmu.sweeps import load, sweep
from hovercraft_fmu.view.animation import Track
from tests.lowlevel import another, count, get, kept, one, put, reference, start
from tests.shell import Shell

METHODS = {method.name: method for method in INTEGRATORS}
ON = 2


# ---- the estimate


def driven(
    state: State, controls: Controls, craft: Craft, settings: Settings, communication_step: float, steps: int
) -> tuple[State, tuple[float, float]]:
    """Where the craft is in the end, and what it says of its error."""
    companion, proposed = Companion(state), 0.0
    for _ in range(steps):
        companion = accompany(companion, controls, craft, communication_step, settings)
        made = advance(state, controls, craft, communication_step, settings, proposed)
        state, proposed = made.state, made.proposed
    return state, estimated_error(state, companion, craft, settings.integrator)


STEPS = {"semi_implicit_euler": 0.02, "drag_implicit": 0.02, "rk4": 0.5, "adaptive": 0.5, "splitting": 0.1}


@pytest.mark.parametrize("scene", ["launch", "coast"])
@pytest.mark.parametrize("method", METHODS)
def test_the_estimate_is_the_error_where_there_is_an_exact_solution(method: str, scene: str) -> None:
    """What Richardson neglects is of the next order: a few percent at steps this long; of adaptive its companion's
    steps are not quite half as long.
    """
    chosen = SCENES[scene]
    settings = Settings(STEPS[method], METHODS[method], tolerance=1e-5)
    thrust = chosen.rows[0][1]
    end, (position, heading) = driven(chosen.start, Controls(thrust), chosen.craft, settings, 1.0, 20)
    assert chosen.exact is not None
    exact = chosen.exact(np.array([20.0]))[0][0]
    assert abs(end.x - exact) > 1e-9
    assert position == pytest.approx(abs(end.x - exact), rel=0.05 if method != "adaptive" else 0.3)
    assert heading == 0.0


@pytest.mark.parametrize("method", ["semi_implicit_euler", "drag_implicit", "rk4"])
def test_what_the_estimate_itself_is_off_by_is_of_the_next_order(method: str) -> None:
    """|estimate/error - 1| falls by 2 where the step is halved."""
    craft, state = Craft(), State(vx=2.0)
    exact = math.log(1.0 + craft.drag_factor / craft.mass * 2.0 * 8.0) * craft.mass / craft.drag_factor
    longest = {"rk4": 0.25}.get(method, 0.04)
    off = []
    for h in (longest, longest / 2.0):
        end, (position, _) = driven(state, Controls(0.0), craft, Settings(h, METHODS[method]), 1.0, 8)
        off.append(abs(position / abs(end.x - exact) - 1.0))
    assert off[0] / off[1] == pytest.approx(2.0, abs=0.5)


def test_a_turn_is_off_in_heading_too() -> None:
    """A push of the thrusters, no drag: psi = N/(2*I)*t^2, and Euler's is N/(2*I)*t*(t + h)."""
    craft = Craft(drag_coefficient=0.0)
    settings = Settings(0.1, METHODS["semi_implicit_euler"])
    _, (_, heading) = driven(State(), Controls(0.0, 1.0), craft, settings, 0.5, 8)
    assert heading == pytest.approx(30.0 / (2.0 * 500.0) * 4.0 * 0.1, rel=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_straight_sliding_on_ground_that_rubs_stops_where_it_does(method: str) -> None:
    """x = v0^2/(2*mu*g), without drag. While it slides RK4 is exact: its error is that of the last sub-steps, of which
    the estimate is within the factor of two; Euler's is of first order all the way.
    """
    craft = Craft(drag_coefficient=0.0, skirt_friction=0.02)
    deceleration = craft.skirt_friction * craft.gravity
    settings = Settings(0.1, METHODS[method], tolerance=1e-4)
    start = State(vx=1.03)
    end, (position, _) = driven(start, Controls(0.0), craft, settings, 0.5, 30)
    error = abs(end.x - 1.03 * 1.03 / (2.0 * deceleration))
    assert end.vx == 0.0
    assert error > 1e-9
    assert 0.5 <= position / error <= 2.0


@pytest.mark.parametrize("rubs", [False, True])
@pytest.mark.parametrize("method", INTEGRATORS)
def test_the_factor_is_that_of_the_order(method: Integrator, rubs: bool) -> None:
    """2^p/(2^p - 1); with friction no order is above 3, and that of splitting is 1."""
    wanted = {
        "semi_implicit_euler": (2.0, 2.0),
        "drag_implicit": (2.0, 2.0),
        "rk4": (16.0 / 15.0, 8.0 / 7.0),
        "adaptive": (32.0 / 31.0, 8.0 / 7.0),
        "splitting": (4.0 / 3.0, 2.0),
    }
    assert error_factor(method, rubs) == wanted[method.name][rubs]


def test_a_companion_is_half_even_where_a_step_is_shorter_than_a_substep() -> None:
    """Communication steps of 0.05 s and sub-steps of 0.2 s: one of 0.05 s, and two of 0.025 s beside it."""
    settings = Settings(0.2, METHODS["semi_implicit_euler"])
    found = accompany(Companion(State()), Controls(), Craft(), 0.05, settings).state
    half = Settings(0.025, METHODS["semi_implicit_euler"])
    assert (
        found
        == advance(State(), Controls(), Craft(), 0.05, half).state
        != advance(State(), Controls(), Craft(), 0.05, settings).state
    )


# ---- the FMUs


def begin(instance: Any, method: str, **values: float) -> None:
    instance.setInteger([reference("integrator"), reference("error_estimate")], [integrator_number(method), ON])
    start(instance, **values)


def steps_of(instance: Any, first: int = 0, last: int = len(CONTROLS)) -> list[list[float]]:
    """The outputs of some of the steps of the standing run."""
    rows = []
    for k in range(first, last):
        instance.setReal(INPUT_REFERENCES, CONTROLS[k])
        instance.doStep(k * COMMUNICATION_STEP, COMMUNICATION_STEP)
        rows.append(get(instance, *STATES, *MOTION, *ERRORS))
    return rows


@pytest.mark.parametrize("friction", [0.0, 1e-3])
@pytest.mark.parametrize("method", METHODS)
def test_every_fmu_says_what_the_model_says(method: str, friction: float, each_fmu: Path) -> None:
    """And the motion has its bits. The native ones have a sine of their own: what is off by 1e-4 m of 1 m is so to
    1e-10 of that.
    """
    craft = Craft(skirt_friction=friction)
    settings = Settings(0.025, METHODS[method], 1e-4)
    state, proposed = State(vx=0.5, yaw_rate=0.1), 0.0
    companion = Companion(state)
    with one(each_fmu) as (instance, messages):
        begin(instance, method, step_size=0.025, tolerance=1e-4, velocity__x=0.5, velocity__yaw_rate=0.1,
              skirt_friction=friction)  # fmt: skip
        assert get(instance, *ERRORS) == [0.0, 0.0]
        with_estimate = steps_of(instance)
        instance.reset()
        instance.setInteger([reference("integrator")], [integrator_number(method)])
        start(instance, step_size=0.025, tolerance=1e-4, velocity__x=0.5, velocity__yaw_rate=0.1,
              skirt_friction=friction)  # fmt: skip
        without = steps_of(instance)
        assert [row[:-2] for row in with_estimate] == [row[:-2] for row in without]
        assert all(row[-2:] == [0.0, 0.0] for row in without)
        assert messages == []
    for row, controls in zip(with_estimate, CONTROLS, strict=True):
        held = Controls(*controls)
        companion = accompany(companion, held, craft, COMMUNICATION_STEP, settings)
        made = advance(state, held, craft, COMMUNICATION_STEP, settings, proposed)
        state, proposed = made.state, made.proposed
        assert row[-2:] == pytest.approx(estimated_error(state, companion, craft, METHODS[method]), rel=1e-9, abs=1e-14)
    assert with_estimate[-1][-2] > 1e-9


@pytest.mark.parametrize("through_bytes", [False, True])
@pytest.mark.parametrize("method", ["semi_implicit_euler", "adaptive"])
def test_a_state_has_the_companion_in_it(method: str, through_bytes: bool, each_fmu: Path) -> None:
    with one(each_fmu) as (instance, _):
        begin(instance, method, step_size=0.05)
        steps_of(instance, 0, 5)
        state = kept(instance, through_bytes)
        later = steps_of(instance, 5)
        instance.setFMUstate(state)
        assert steps_of(instance, 5) == later
        second = another(instance)
        start(second)
        second.setFMUstate(state)
        assert steps_of(second, 5) == later
        instance.reset()
        begin(instance, method, step_size=0.05)
        steps_of(instance, 0, 5)
        assert steps_of(instance, 5) == later


def test_only_with_it_a_state_has_nine_numbers_more(each_fmu: Path) -> None:
    with one(each_fmu) as (instance, _):
        sizes = []
        for chosen in (1, ON):
            instance.reset()
            instance.setInteger([reference("error_estimate")], [chosen])
            start(instance)
            sizes.append(len(instance.serializeFMUstate(instance.getFMUstate())))
        assert sizes[1] - sizes[0] in ([9 * 8] if "Native" in each_fmu.stem else range(20, 200))


def test_the_companion_follows_what_is_tuned(each_fmu: Path) -> None:
    """From rest without drag Euler is off by a*h*t/2, whatever the thrust's limit was meanwhile."""
    with one(each_fmu) as (instance, _):
        begin(instance, "semi_implicit_euler", step_size=0.1, drag_coefficient=0.0, thrust=10.0)
        instance.doStep(0.0, 1.0)
        put(instance, thrust_max=5.0)
        instance.doStep(1.0, 1.0)
        # v is exact; x is off by h/2*v
        assert get(instance, "error.position") == pytest.approx([0.05 * (0.1 + 0.05)], rel=1e-9)


def test_an_estimate_that_is_lost_says_so_once(each_fmu: Path) -> None:
    """Thrust that turns by 6 rad a sub-step, without drag: the craft should stay within 1 m. The message names what to
    change.
    """
    with one(each_fmu) as (instance, messages):
        begin(instance, "semi_implicit_euler", step_size=1.0, drag_coefficient=0.0, velocity__yaw_rate=6.0)
        for k in range(40):
            instance.doStep(float(k), 1.0)
        assert count(instance, "warnings") & ERROR_LOST
        said = [message for message in messages if message.startswith("error.position")]
        assert len(said) == 1
        assert said[0].endswith(": cannot be trusted; set a smaller step_size (said once)")


def test_of_the_adaptive_method_it_is_the_tolerance_that_is_too_large(each_fmu: Path) -> None:
    """100 m: its steps are longer than drag lets any be that are to be stable."""
    with one(each_fmu) as (instance, messages):
        begin(instance, "adaptive", step_size=10.0, tolerance=100.0, thrust=5.0, velocity__x=10.0,
              velocity__yaw_rate=0.5)  # fmt: skip
        instance.doStep(0.0, 10.0)
        assert count(instance, "warnings") & ERROR_LOST
        assert messages[-1].endswith(": cannot be trusted; set a smaller tolerance (said once)")


def test_a_stop_within_a_few_substeps_cannot_be_trusted(each_fmu: Path) -> None:
    """Slower than friction takes away in half a sub-step, 0.098 m/s, craft and companion stop at once, each where it
    was: no difference, and off by v0^2/(2*mu*g). A stop after many sub-steps can be trusted, and so can a launch.
    """
    with one(each_fmu) as (instance, messages):
        for speed, thrust, trusted in ((0.09, 0.0, False), (0.15, 0.0, False), (6.0, 0.0, True), (0.0, 30.0, True)):
            instance.reset()
            begin(instance, "drag_implicit", step_size=1.0, skirt_friction=0.02, drag_coefficient=0.0, inertia=2e4,
                  thrust=thrust, thrust_max=30.0, velocity__x=speed)  # fmt: skip
            messages.clear()
            for k in range(40):
                instance.doStep(float(k), 1.0)
            assert count(instance, "warnings") & ERROR_LOST == (0 if trusted else ERROR_LOST)
        assert messages == []


@pytest.mark.parametrize("method", INTEGRATORS, ids=lambda each: each.name)
def test_a_companion_that_cannot_go_on_is_lost_for_good(method: Integrator) -> None:
    """Turned beyond all numbers; or, by the adaptive method, faster than it can follow."""
    spinning, craft, how = State(heading=1.7e308, yaw_rate=1.7e308), Craft(drag_coefficient=0.0), Settings(1.0, method)
    lost = accompany(Companion(spinning), Controls(), craft, 3.0, how)
    assert all(map(math.isnan, lost.state))
    assert repr(accompany(lost, Controls(), craft, 3.0, how)) == repr(lost)
    assert estimated_error(spinning, lost, craft, method) == (LARGEST, LARGEST)


def test_where_the_companion_alone_runs_away_the_motion_goes_on(each_fmu: Path) -> None:
    """A long, narrow craft that spins by half a turn a sub-step shows the air its bow or its stern at every one; its
    companion, by a quarter of a turn, its side at every other: there Euler's step is too long, and diverges.
    """
    with one(each_fmu) as (instance, _):
        instance.setInteger([reference("drag_area")], [2])
        begin(instance, "semi_implicit_euler", step_size=1.0, length=200.0, width=1.0, height=1.0, thrust=0.0,
              drag_center_fraction=0.0, velocity__x=5.0, velocity__yaw_rate=math.pi)  # fmt: skip
        for k in range(40):
            instance.doStep(float(k), 1.0)
        assert get(instance, *ERRORS) == [LARGEST, LARGEST]
        assert count(instance, "warnings") & ERROR_LOST
        assert all(map(math.isfinite, get(instance, *STATES)))


# ---- refused


def test_numbers_of_no_item_are_refused(each_fmu: Path) -> None:
    with one(each_fmu) as (instance, messages):
        for value in (0, 3):
            with pytest.raises(FMICallException):
                instance.setInteger([reference("error_estimate")], [value])
        assert messages == [f"error_estimate = {value}: must be one of 1 (off), 2 (on)" for value in (0, 3)]


@pytest.mark.parametrize("name", ["error_estimate", "error_estimate_number"])
def test_model_exchange_has_none(name: str, each_native_fmu: Path) -> None:
    with one(each_native_fmu, exchange=True) as (instance, messages):
        with pytest.raises(FMICallException):
            instance.setInteger([reference(name)], [ON])
        assert messages == [
            f"{name} = 2: must be off in model exchange: there the error is that of the importer's solver; use "
            "co-simulation"
        ]


@pytest.mark.parametrize("flavour", [PYTHON, NATIVE, NATIVE3], ids=lambda each: each.identifier)
def test_an_fmu_that_starts_with_it_is_for_steps_alone(flavour: Any) -> None:
    made = variant(flavour, "Told", {"error_estimate": "on"})
    assert made.exchange == {}
    assert made.own_starts == {"error_estimate": ON}


# ---- the command


@pytest.mark.usefixtures("native_at_hand")
def test_a_run_tells_how_far_it_is_off(shell: Shell) -> None:
    """The line is that of the columns; the estimate of the launch is near what the exact solution says."""
    files = ("--output", "run.csv", "--plot", "run.png", "--animate", "run.html")
    printed = shell.ok("simulate", "--error", "--set", "step_size=0.1", "--stop-time", "20", *files)
    table = np.genfromtxt(shell.folder / "run.csv", delimiter=",", names=True, deletechars="")
    off = table["error.position"]
    exact = SCENES["launch"].exact
    assert exact is not None
    assert off[1:] == pytest.approx(np.abs(exact(table["time"])[0] - table["pose.x"])[1:], rel=0.02)
    share = 100.0 * off[-1] / table["pose.x"][-1]
    line = f"error, as told  at the end {1e3 * off[-1]:.3g} mm off ({share:.2g} % of the path), at most"
    assert line in printed
    assert "mm off" in (shell.folder / "run.html").read_text()
    assert "error, as told" not in shell.ok("simulate", "--stop-time", "1")


def test_a_circle_as_wide_as_the_doubt_goes_with_the_craft(native_fmu: Path) -> None:
    start_values: dict[str, Value] = {"error_estimate": "on", "integrator": "drag_implicit", "step_size": 0.5}
    result = simulate("turn", native_fmu, start_values=start_values, stop_time=20.0)
    track = Track(result, "", "#000000")
    for i in (50, -1):
        radii = np.hypot(*(np.array(track.doubt(i)) - [track.x[i], track.y[i]]).T)
        assert radii == pytest.approx(np.full(len(radii), result["error.position"][i]))
    assert Track(simulate("turn", native_fmu, stop_time=1.0), "", "#000000").doubt(-1) == []


def test_where_it_is_lost_the_words_say_so(native_fmu: Path) -> None:
    start_values: dict[str, Value] = {
        "error_estimate": "on", "step_size": 1.0, "drag_coefficient": 0.0, "velocity.yaw_rate": 6.0,
    }  # fmt: skip
    result = simulate("launch", native_fmu, start_values=start_values, stop_time=40.0, communication_step=1.0)
    assert result.error_in_words == "cannot be told: see the warning"


# ---- a sweep


def test_a_sweep_keeps_it(native_fmu: Path, tmp_path: Path) -> None:
    study: dict[str, Any] = {
        "scene": "turn",
        "stop_time": 20.0,
        "set": {"error_estimate": "on", "integrator": "drag_implicit"},
        "sweep": {"step_size": [0.1, 0.05]},
        "keep": {"end": ["error.position"], "maximum": ["error.heading"]},
    }
    sweep(study, native_fmu, workers=1, output=tmp_path)
    table = load(tmp_path).to_table()
    for row, step in zip(table.to_pylist(), (0.1, 0.05), strict=True):
        alone = simulate("turn", native_fmu, stop_time=20.0, start_values=study["set"] | {"step_size": step})
        assert row["end.error.position"] == alone["error.position"][-1]
        assert row["maximum.error.heading"] == alone["error.heading"].max()


@pytest.mark.parametrize("place", ["set", "sweep"])
def test_the_batch_tells_no_error(place: str, tmp_path: Path) -> None:
    study: dict[str, Any] = {"scene": "turn", "sweep": {"mass": [90.0, 100.0]}, "keep": {"end": ["error.position"]}}
    study |= {"set": {"error_estimate": "on"}} if place == "set" else {}
    study["sweep"] |= {"error_estimate": ["off", "on"]} if place == "sweep" else {}
    with pytest.raises(ValueError, match="error_estimate: must be off with the engine batch"):
        sweep(study, engine="batch", output=tmp_path)


# ---- the study


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.usefixtures("fleet")
def test_the_study_is_held_against_scipy(kind: str) -> None:
    """The shortest of some runs, by another solver; and what the FMU would say of it, and does not keep quiet about."""
    runs = sampled(REPORTED, 8, INTEGRATORS[0], kind)
    found = judged(runs, INTEGRATORS[0])
    i = int(np.argmin(runs.duration))
    stop = SEGMENTS * float(runs.duration[i])
    rows = [
        (k * float(runs.duration[i]), *(float(values[i]) for values in np.broadcast_arrays(*held_controls[:3])))
        for k, held_controls in enumerate(runs.controls)
    ]
    craft = runs.crafts.one(i)
    parameters = {name: getattr(craft, name) for name in CRAFT_PARAMETERS}
    start = State(*(float(np.ravel(each)[i % np.size(each)]) for each in runs.start))
    end, _ = reference_end(Scene("", "", held(stop, *rows), parameters=parameters, start=start), stop)
    assert (found["x"][i], found["y"][i]) == pytest.approx(end[:2], abs=1e-6)
    (row,) = shares(found.with_columns(kind=pl.lit(kind), method=pl.lit("any"))).to_dicts()
    assert (row["runs"], row["missed"]) == (8, 0)
    assert row["within_factor_2"] == 1.0


# ---- inputs that change inside a step


@pytest.mark.parametrize("method", METHODS)
def test_inputs_inside_a_step_are_the_companions_too(method: str, each_native_fmu: Path) -> None:
    """Ramps of FMI 2.0, intermediate update of FMI 3.0: the motion keeps its bits, and the estimate is how far the run
    is off one with a tolerance of 1e-11.
    """
    accuracy: dict[str, Value] = {"integrator": method, "step_size": 0.25, "tolerance": 1e-4}
    settings: list[dict[str, Value]] = [{"error_estimate": "on", **accuracy}, accuracy]
    settings.append({"integrator": "adaptive", "tolerance": 1e-11})
    with_estimate, without, exact = (
        simulate("slalom", each_native_fmu, start_values=values, communication_step=1.0, stop_time=20.0)
        for values in settings
    )
    for name in STATES:
        assert np.array_equal(with_estimate[name], without[name])
    off = np.hypot(*(with_estimate[name] - exact[name] for name in STATES[:2]))[-1]
    assert off > 1e-9
    assert with_estimate["error.position"][-1] == pytest.approx(off, rel=0.2)
