"""The operator, the pace and the camera: whatever keys are held, whenever frames are drawn, wherever the craft is."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hovercraft_fmu.drawing.shapes import outline
from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.dynamics import Controls
from hovercraft_fmu.view.camera import Camera, wrapped
from hovercraft_fmu.view.operator import Action, Operator, Pace, Ramp
from tests.strategies import numbers

steps = st.sampled_from([0.001, 0.01, 0.02, 0.1, 0.3])
keys = st.lists(st.tuples(st.sets(st.sampled_from(Action)), st.integers(1, 40)), max_size=12)
"""Keys held, and for how many communication steps."""


@given(start=numbers(-20.0, 20.0), n=st.integers(1, 2000), step=steps, direction=st.sampled_from([-1, 0, 1]))
def test_a_held_key_changes_a_control_at_its_rate_to_the_last_bit(
    start: float, n: int, step: float, direction: int
) -> None:
    free, limited = Ramp(start, 1.0), Ramp(start, 1.0, -3.0, 3.0)
    for _ in range(n):
        free.hold(direction, step)
        limited.hold(direction, step)
    assert free.value == start + direction * (n * step)
    foot = min(max(start, -3.0), 3.0)
    assert limited.value == min(max(foot + direction * (n * step), -3.0), 3.0)


@given(held=keys, step=steps, reverse=numbers(-10.0, 0.0))
def test_whatever_is_held(held: list[tuple[set[Action], int]], step: float, reverse: float) -> None:
    craft = Craft(thrust_min=reverse)
    operator = Operator(Controls(), craft, step)
    for actions, n in held:
        operator.held = actions
        for _ in range(n):
            before = operator.controls
            operator.pass_step()
            after = operator.controls
            assert craft.thrust_min <= after.thrust <= craft.thrust_max
            assert abs(after.thrust - before.thrust) <= step * (1.0 + 1e-9)
            if {Action.MORE_THRUST, Action.LESS_THRUST} <= actions:
                assert after.thrust == before.thrust
            assert after.port == float(Action.PORT_THRUSTER in actions)
            assert after.starboard == float(Action.STARBOARD_THRUSTER in actions)


def test_wind_blows_where_its_key_points_and_calms() -> None:
    operator = Operator(Controls(wind_x=1.0), Craft(), 0.1)
    operator.held = {Action.WIND_DOWN, Action.WIND_LEFT}
    for _ in range(50):
        operator.pass_step()
    assert (operator.controls.wind_x, operator.controls.wind_y) == pytest.approx((0.5, 0.5), abs=1e-15)
    operator.calm()
    assert (operator.controls.wind_x, operator.controls.wind_y) == (0.0, 0.0)


@given(frames=st.lists(numbers(0.0, 10.0), min_size=1, max_size=40), step=steps, scale=numbers(0.1, 100.0))
def test_the_steps_due_do_not_depend_on_the_frames(frames: list[float], step: float, scale: float) -> None:
    pace, taken = Pace(step, scale, 0.0), 0
    for now in sorted(frames):
        for _ in range(pace.due(now)):
            pace.take()
            taken += 1
    assert taken == math.floor(max(frames) * scale / step)


@given(value=st.floats(allow_nan=False, allow_infinity=False), size=numbers(1.0, 5000.0))
def test_wrapped_is_inside(value: float, size: float) -> None:
    assert 0.0 <= wrapped(value, size) < size


@given(value=numbers(-1e6, 1e6), turns=st.integers(-50, 50))
def test_wrapped_is_the_same_place_a_view_further(value: float, turns: int) -> None:
    once, again = wrapped(value, 1280.0), wrapped(value + turns * 1280.0, 1280.0)
    apart = abs(once - again)
    assert min(apart, 1280.0 - apart) <= 1e-6


@given(x=numbers(-1e4, 1e4), y=numbers(-1e4, 1e4), heading=numbers(-10.0, 10.0))
def test_every_corner_is_seen_wherever_the_craft_is(x: float, y: float, heading: float) -> None:
    camera = Camera(1280, 624, 4.0)
    points = camera.body((x, y, heading), outline(Craft()))
    copies = list(camera.copies(points))
    for i, (px, py) in enumerate(points):
        place = (wrapped(px, 1280.0), wrapped(py, 624.0))
        nearest = min(math.hypot(copy[i][0] - place[0], copy[i][1] - place[1]) for copy in copies)
        assert nearest < 1e-6


def test_metres_are_metres_and_y_is_down() -> None:
    camera = Camera(1280, 624, 4.0)
    assert camera.place(0.0, 0.0) == (128.0, 312.0)
    assert camera.place(10.0, 5.0) == (168.0, 332.0)
    ((bow_x, bow_y),) = camera.body((0.0, 0.0, math.pi / 2.0), [(15.0, 0.0)])  # a quarter turn to starboard
    assert (bow_x, bow_y) == pytest.approx((128.0, 372.0))
