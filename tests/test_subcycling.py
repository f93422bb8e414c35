import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.dynamics import Controls, State
from hovercraft_fmu.model.integrators import INTEGRATORS, integrator, integrator_number
from hovercraft_fmu.model.subcycling import MAX_SUBSTEPS, NonFiniteError, Settings, advance, meant_step, substeps
from tests.strategies import controls, crafts, numbers, states


@pytest.mark.parametrize(
    ("communication_step", "step_size", "expected"),
    [
        (0.01, 0.001, (10, 0.001)),
        (0.009999999999999998, 0.001, (10, 0.001)),
        (0.009999999999999787, 0.001, (10, 0.0009999999999999787)),  # what it means, without the time, nobody knows
        (1.0, 0.001, (1000, 0.001)),
        (0.001 * (1 + 1e-12), 0.001, (2, 0.0005000000000005)),
        (0.0005, 0.001, (1, 0.0005)),
        (0.0015, 0.001, (2, 0.00075)),
        (1e-13, 0.001, (1, 1e-13)),
        (5e-324, 0.001, (1, 5e-324)),
        (3600.0, 0.001, (3600000, 0.001)),
        (1e6, 0.001, (MAX_SUBSTEPS, 0.001)),
    ],
)
def test_how_a_communication_step_is_cut(
    communication_step: float, step_size: float, expected: tuple[int, float]
) -> None:
    assert substeps(communication_step, step_size) == expected


@given(numbers(1e-13, 3600.0), numbers(1e-5, 10.0))
def test_no_time_is_lost(communication_step: float, step_size: float) -> None:
    n, h = substeps(communication_step, step_size)
    assert n >= 1
    if h == step_size:
        assert abs(n * h - communication_step) <= 1e-15 * communication_step
    else:
        assert h < step_size * (1 + 1e-15)
        assert n == math.ceil(communication_step / step_size)
        assert n * h == pytest.approx(communication_step, rel=1e-15)


@pytest.mark.parametrize("bad", [-1e-9, math.nan, math.inf, -math.inf])
def test_impossible_communication_steps(bad: float) -> None:
    with pytest.raises(ValueError, match="communication step"):
        advance(State(), Controls(), Craft(), bad)


@pytest.mark.parametrize("bad", [0.0, -0.001, math.nan, math.inf])
def test_impossible_substeps(bad: float) -> None:
    with pytest.raises(ValueError, match="step_size"):
        advance(State(), Controls(), Craft(), 1.0, Settings(bad))


@pytest.mark.parametrize(
    ("communication_step", "step_size"), [(1e6 + 1.0, 0.001), (1e300, 1e-300), (1.0, 1e-10), (1e9 + 0.5, 1.0)]
)
def test_too_many_substeps_are_refused(communication_step: float, step_size: float) -> None:
    with pytest.raises(ValueError, match=r"10\^9"):
        substeps(communication_step, step_size)


@given(states, crafts, controls)
def test_a_step_of_nothing_changes_no_bit(state: State, craft: Craft, asked: Controls) -> None:
    assert advance(state, asked, craft, 0.0)[:2] == (state, 0)


@pytest.mark.parametrize("number", [i for i, method in enumerate(INTEGRATORS, 1) if method.integrate])
def test_the_bits_do_not_depend_on_how_the_time_is_cut(number: int) -> None:
    settings = Settings(0.001, integrator(number))
    asked, craft = Controls(8.0, 1.0, 0.25), Craft()
    start = State(1.0, -2.0, 0.3, 0.4, -0.1, 0.05)
    ends = []
    for steps, communication_step in ((1000, 0.001), (100, 0.01), (100, 0.009999999999999787), (1, 1.0)):
        state = start
        meant = meant_step(20.0, communication_step, 0.0, 0.001)
        for _ in range(steps):
            state = advance(state, asked, craft, meant, settings).state
        ends.append(state)
    assert ends == [ends[0]] * 4


@given(st.lists(numbers(1e-13, 0.05), min_size=1, max_size=40))
def test_a_run_cut_anywhere_ends_on_time(steps: list[float]) -> None:
    state = State(vx=1.0)
    for step in steps:
        state = advance(state, Controls(0.0, 0.0, 0.0), Craft(drag_coefficient=0.0), step).state
    assert state.x == pytest.approx(math.fsum(steps), rel=1e-12)  # at 1 m/s the position is the time


@pytest.mark.parametrize("start", [State(vx=1e200), State(yaw_rate=1e200), State(vx=1e160, vy=1e160)])
def test_a_motion_out_of_range_is_refused(start: State) -> None:
    with pytest.raises(NonFiniteError, match="must stay a finite number"):
        advance(start, Controls(), Craft(), 0.1)


def test_the_first_that_leaves_the_range_is_named() -> None:
    with pytest.raises(NonFiniteError, match=r"x = inf after sub-steps of 1\.0 s"):
        advance(State(x=1.7e308, vx=1.7e308), Controls(), Craft(drag_coefficient=0.0), 1.0, Settings(1.0))


def test_any_finite_place_is_a_place() -> None:
    """Where x + y is none: 'finite' is said of each number, not of their sum."""
    assert advance(State(x=1.7e308, y=1.7e308), Controls(0.0), Craft(), 1.0, Settings(1.0)).state.x == 1.7e308


def test_methods_have_names_and_numbers() -> None:
    assert integrator_number("semi_implicit_euler") == 1
    assert [method.name for method in INTEGRATORS] == [
        "semi_implicit_euler",
        "drag_implicit",
        "rk4",
        "adaptive",
        "splitting",
    ]
    bads: tuple[Any, ...] = (0, -1, len(INTEGRATORS) + 1, 2.7, True)
    for bad in bads:
        with pytest.raises(ValueError, match=f"integrator = {bad}: must be one of 1 "):
            integrator(bad)
    with pytest.raises(ValueError, match="'magic': must be one of semi_implicit_euler"):
        integrator_number("magic")
