import numpy as np
import pytest

from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.dynamics import Controls, State
from hovercraft_fmu.model.subcycling import Settings, advance
from hovercraft_fmu.scenes import SCENES, Scene, held, scene
from hovercraft_fmu.simulation import plan, run_model, schedule

EXACT = [each for each in SCENES.values() if each.exact]
NAMES = [each.name for each in EXACT]


def end_error(each: Scene, h: float) -> float:
    """The largest component error at the end of the scene, whose controls hold all the time."""
    assert each.exact
    state = advance(each.start, Controls(*each.rows[0][1:]), each.craft, each.stop_time, Settings(h)).state
    exact = each.exact(np.array([each.stop_time]))
    return max(abs(value - float(part[0])) for value, part in zip(state, exact, strict=True))


def test_the_named_scenes_are_there() -> None:
    assert {"launch", "coast", "turn", "slalom", "stop", "ice"} <= set(SCENES)
    assert set(NAMES) == {"launch", "coast", "cycloid"}
    with pytest.raises(ValueError, match="'nix': must be one of launch"):
        scene("nix")


@pytest.mark.parametrize("each", EXACT, ids=NAMES)
def test_the_exact_solution_solves_the_equations(each: Scene) -> None:
    """Its rates, by central differences of fourth order, are those of the model; it starts where the scene does."""
    from hovercraft_fmu.model.dynamics import derivatives

    assert each.exact
    at_start = each.exact(np.array([0.0]))
    assert [float(part[0]) for part in at_start] == pytest.approx(each.start, abs=1e-15)
    d = 1e-3
    for time in (0.5, 3.0, 20.0):
        values = np.array(each.exact(time + d * np.array([-2.0, -1.0, 0.0, 1.0, 2.0])))
        rates = values @ np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / (12.0 * d)
        expected = derivatives(State(*values[:, 2]), Controls(*each.rows[0][1:]), each.craft)
        # values of up to 15, rounded to 2e-15, divided by 12e-3, times 18: 3e-12; d^4 = 1e-12
        assert rates == pytest.approx(expected, abs=2e-11)


@pytest.mark.parametrize("each", EXACT, ids=NAMES)
def test_the_default_method_is_of_first_order(each: Scene) -> None:
    steps = np.array([0.04, 0.02, 0.01, 0.005])
    errors = [end_error(each, h) for h in steps]
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("each", EXACT, ids=NAMES)
def test_the_whole_run_stays_near_the_exact_solution(each: Scene) -> None:
    assert each.exact
    result = run_model(plan(each))
    exact = each.exact(result["time"])
    # first order, h = 1 ms: h times the largest change of acceleration over the time, by hand at most 3 m/s2
    for name, part in zip(("pose.x", "pose.y", "pose.heading", "velocity.x", "velocity.y"), exact, strict=False):
        assert result[name] == pytest.approx(part, abs=3e-3)


def test_launch_reaches_the_terminal_speed_of_the_page() -> None:
    result = run_model(plan("launch"))
    assert result["velocity.x"][-1] == pytest.approx(0.29508, abs=5e-6)


def test_turn_has_pulses_at_whole_seconds() -> None:
    turn = SCENES["turn"]
    assert (turn.stop_time, turn.craft) == (60.0, Craft())
    assert all(time == round(time) for time, *_ in turn.rows)
    inputs = np.array(turn.rows)[:, 1:]
    assert all(len(set(column)) > 1 for column in inputs.T)


def test_stop_reverses_through_rest() -> None:
    surge = run_model(plan("stop"))["body.surge"]
    assert surge.max() > 0.4
    assert surge.min() < -0.3


def test_ice_is_a_drive_worth_a_picture() -> None:
    """At least ten craft lengths, turns of at least 90 degrees to both sides, throttle up and off."""
    result = run_model(plan("ice"))
    heading = np.degrees(result["pose.heading"])
    assert result.distance >= 10 * 20.0
    assert (heading - np.minimum.accumulate(heading)).max() >= 90.0
    assert (np.maximum.accumulate(heading) - heading).max() >= 90.0
    assert (result["applied.thrust"][0], result["applied.thrust"].max(), result["applied.thrust"][-1]) == (
        0.0,
        10.0,
        0.0,
    )


def test_held_controls_jump() -> None:
    rows = held(9.0, (0.0, 5.0, 0.0, 0.0), (4.0, 6.0, 1.0, 0.0))
    assert rows == ((0.0, 5.0, 0.0, 0.0), (4.0, 5.0, 0.0, 0.0), (4.0, 6.0, 1.0, 0.0), (9.0, 6.0, 1.0, 0.0))


def test_a_jump_between_communication_points_is_one() -> None:
    run = plan(Scene("jump", "", held(1.0, (0.0, 5.0, 0.0, 0.0), (0.25, 6.0, 0.0, 0.0))), communication_step=0.2)
    points = [piece.end for piece in schedule(run) if piece.is_point]
    assert points == pytest.approx([0.2, 0.25, 0.4, 0.6, 0.8, 1.0])
