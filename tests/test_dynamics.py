import math
from dataclasses import asdict

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.dynamics import (
    Controls,
    State,
    body_velocity,
    derivatives,
    kinetic_energy,
    loads,
    over_zero,
    saturate,
)
from hovercraft_fmu.model.subcycling import Settings, advance
from tests.reference import reference_loads, reference_step
from tests.strategies import calm_crafts, controls, crafts, numbers, states

RELATIVE = 1e-12
"""Of the sum of the sizes of the forces: some tens of roundings of 1.1e-16, and room."""
LEAST = 1e-150
"""N, N.m: the squares of smaller ones are lost in the sizes."""


@given(crafts, states, controls)
def test_loads_agree_with_the_page_written_down_again(craft: Craft, state: State, asked: Controls) -> None:
    force, moment, force_size, moment_size = reference_loads(state, asked, asdict(craft))
    ours = loads(state, asked, craft)
    assert ours.x == pytest.approx(force[0], rel=0.0, abs=RELATIVE * force_size + LEAST)
    assert ours.y == pytest.approx(force[1], rel=0.0, abs=RELATIVE * force_size + LEAST)
    assert ours.moment == pytest.approx(moment, rel=0.0, abs=RELATIVE * moment_size + LEAST)


@given(crafts, states, controls, numbers(1e-4, 1e-2))
def test_a_step_agrees_with_the_page_written_down_again(craft: Craft, state: State, asked: Controls, h: float) -> None:
    ours, n, *_ = advance(state, asked, craft, h, Settings(h))
    theirs = reference_step(state, asked, asdict(craft), h)
    _, _, force_size, moment_size = reference_loads(state, asked, asdict(craft))
    scale = 1.0 + max(map(abs, state)) + h * force_size / craft.mass + h * moment_size / craft.inertia
    assert n == 1
    assert ours == pytest.approx(theirs, rel=0.0, abs=RELATIVE * scale)


# worked by hand, with k = 0.5*1.225*75*1.25 = 57.421875 kg/m and the fin 5 m behind the centre of gravity
@pytest.mark.parametrize(
    ("state", "asked", "expected"),
    [
        # abeam at 2 m/s, not turning: q = 2, drag = -57.421875*2*2 = -229.6875 N to starboard,
        # moment = -5 * -229.6875; thrust 5 N ahead
        (State(vy=2.0), Controls(5.0, 0.0, 0.0), (5.0, -229.6875, 1148.4375)),
        # turning on the spot at 0.4 rad/s: the fin moves at 0.4*-5 = -2 m/s; drag +229.6875, moment -1148.4375;
        # the port thruster adds 3 N and 10 m * 3 N
        (State(yaw_rate=0.4), Controls(0.0, 1.0, 0.0), (0.0, 232.6875, -1118.4375)),
        # heading down the screen (90 deg), 3 m/s along it and 4 m/s to port (+x of the world): u = 3, v = -4, q = 5,
        # drag ahead -57.421875*5*3 = -861.328125, to starboard +1148.4375, moment -5 * 1148.4375; reverse thrust is
        # cut off at 0; both thrusters half on cancel. Ahead is +y, starboard is -x.
        (State(heading=math.pi / 2, vx=4.0, vy=3.0), Controls(-7.0, 0.5, 0.5), (-1148.4375, -861.328125, -5742.1875)),
    ],
)
def test_loads_worked_by_hand(state: State, asked: Controls, expected: tuple[float, float, float]) -> None:
    # cos(pi/2) is 6e-17 in floating point: 1e-12 of the largest load
    assert loads(state, asked, Craft()) == pytest.approx(expected, rel=0.0, abs=1e-12 * max(map(abs, expected)))


def test_from_rest_the_port_thruster_alone() -> None:
    rates = derivatives(State(), Controls(0.0, 1.0, 0.0), Craft())
    assert rates.yaw_rate == pytest.approx(0.06, rel=1e-15)  # 10 m * 3 N / 500 kg.m2
    assert rates.vy == pytest.approx(0.03, rel=1e-15)  # 3 N / 100 kg
    assert (rates.x, rates.y, rates.heading, rates.vx) == (0.0, 0.0, 0.0, 0.0)


def test_at_rest_drag_is_exactly_zero() -> None:
    assert loads(State(heading=0.7), Controls(0.0, 0.0, 0.0), Craft()) == (0.0, 0.0, 0.0)


@given(crafts, controls)
def test_controls_saturate(craft: Craft, asked: Controls) -> None:
    held = saturate(asked, craft)
    assert held.thrust == min(max(asked.thrust, craft.thrust_min), craft.thrust_max)
    assert (held.port, held.starboard) == (min(max(asked.port, 0.0), 1.0), min(max(asked.starboard, 0.0), 1.0))
    assert saturate(held, craft) == held


@given(states)
def test_body_velocity_is_the_world_velocity_turned(state: State) -> None:
    surge, sway = body_velocity(state)
    turned = complex(state.vx, state.vy) * complex(math.cos(state.heading), -math.sin(state.heading))
    assert (surge, sway) == pytest.approx((turned.real, turned.imag), abs=1e-13)


@given(crafts, states, controls)
def test_power_is_the_rate_of_kinetic_energy(craft: Craft, state: State, asked: Controls) -> None:
    force_x, force_y, moment = loads(state, asked, craft)
    rates = derivatives(state, asked, craft)
    power = force_x * state.vx + force_y * state.vy + moment * state.yaw_rate
    growth = craft.mass * (state.vx * rates.vx + state.vy * rates.vy) + craft.inertia * state.yaw_rate * rates.yaw_rate
    size = abs(force_x * state.vx) + abs(force_y * state.vy) + abs(moment * state.yaw_rate)
    assert growth == pytest.approx(power, rel=0.0, abs=1e-14 * size)


@given(crafts, states, st.integers(1, 50))
def test_drag_alone_never_adds_energy(craft: Craft, state: State, n: int) -> None:
    """A step changes the energy by -h*P + h*h/2*(F*F/m + N*N/I), with P = k*q^3, F <= k*q*q and |N| <= |x_d|*k*q*q.

    So it does not grow while h*k*q*(1/m + x_d^2/I) <= 2, and q is bounded by the energy at the start. The directional
    area's k is at most the diagonal of its two; the rotational drag adds its own rate.
    """
    energy = kinetic_energy(state, craft)
    spin = math.sqrt(2.0 * energy / craft.inertia)
    q = math.sqrt(2.0 * energy / craft.mass) + abs(craft.drag_center) * spin
    k = max(craft.drag_factor, math.hypot(craft.drag_factor_ahead, craft.drag_factor_abeam))
    rate = k * q * (1.0 / craft.mass + craft.drag_center**2 / craft.inertia) + craft.spin_rate * spin
    h = 1.0 / rate if rate > 1e-3 else 1.0
    for _ in range(n):
        state = advance(state, Controls(0.0, 0.0, 0.0), craft, h, Settings(h)).state
        after = kinetic_energy(state, craft)
        assert after <= energy * (1.0 + 1e-14)  # rounding of the six products
        energy = after


@given(calm_crafts, states, controls)
def test_a_mirrored_scene_gives_the_mirrored_path_to_the_bit(craft: Craft, state: State, asked: Controls) -> None:
    def mirrored(s: State) -> State:
        return State(s.x, -s.y, -s.heading, s.vx, -s.vy, -s.yaw_rate)

    thrust, port, starboard, wind_x, wind_y, force_x, force_y, moment = asked
    swapped = Controls(thrust, starboard, port, wind_x, -wind_y, force_x, -force_y, -moment)
    there = advance(state, asked, craft, 0.05).state
    back = advance(mirrored(state), swapped, craft, 0.05).state
    assert mirrored(back) == there


@given(states, controls, numbers(-math.pi, math.pi))
def test_turning_the_scene_turns_the_path(state: State, asked: Controls, angle: float) -> None:
    def turned(s: State) -> State:
        position = complex(s.x, s.y) * complex(math.cos(angle), math.sin(angle))
        velocity = complex(s.vx, s.vy) * complex(math.cos(angle), math.sin(angle))
        return State(position.real, position.imag, s.heading + angle, velocity.real, velocity.imag, s.yaw_rate)

    turn = complex(math.cos(angle), math.sin(angle))
    wind, force = complex(*asked[3:5]) * turn, complex(*asked[5:7]) * turn
    there = advance(state, asked, Craft(), 0.05).state
    turned_controls = Controls(*asked[:3], wind.real, wind.imag, force.real, force.imag, asked.external_moment)
    other = advance(turned(state), turned_controls, Craft(), 0.05).state
    assert other == pytest.approx(turned(there), rel=0.0, abs=1e-11)  # positions to 1e3 m: 1e-13 a rounding


def test_without_drag_a_spinning_craft_goes_straight() -> None:
    craft = Craft(drag_coefficient=0.0)
    end = advance(State(vx=3.0, vy=-4.0, yaw_rate=100.0), Controls(0.0, 0.0, 0.0), craft, 10.0).state
    # the velocity keeps its bits; the position is 10^4 additions of h*v
    assert (end.vx, end.vy, end.yaw_rate) == (3.0, -4.0, 100.0)
    assert (end.x, end.y) == pytest.approx((30.0, -40.0), rel=1e-11)


@pytest.mark.parametrize("value", [1.0, -1.0, 5e-324, 0.0, -0.0, math.inf, -math.inf, math.nan])
def test_over_zero_is_the_division_of_ieee_754(value: float) -> None:
    with np.errstate(all="ignore"):
        expected = np.float64(value) / np.float64(0.0)
    assert over_zero(value) == expected or (math.isnan(over_zero(value)) and math.isnan(expected))
