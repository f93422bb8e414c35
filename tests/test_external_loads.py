"""Loads from outside: exact solutions, what a host makes of them, and that friction holds against them."""

import math

import numpy as np
import pytest
from hypothesis import given

from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.dynamics import Controls, State, kinetic_energy, loads
from hovercraft_fmu.model.integrators import INTEGRATORS
from hovercraft_fmu.model.subcycling import Settings, advance
from tests.strategies import controls, states

METHODS = {method.name: method for method in INTEGRATORS}
EVERY = pytest.mark.parametrize("name", METHODS)
NONE = Controls(0.0)
FREE = Craft(drag_coefficient=0.0)


def load(x: float = 0.0, y: float = 0.0, moment: float = 0.0, thrust: float = 0.0) -> Controls:
    return Controls(thrust, external_force_x=x, external_force_y=y, external_moment=moment)


@EVERY
def test_a_constant_load_without_drag(name: str) -> None:
    """v = F/m*t, x = F/m*t^2/2, and so for the moment: Euler's velocity is exact, its position off by v*h/2."""
    h, t, push = 0.01, 20.0, load(-3.0, 7.0, 11.0)
    end = advance(State(heading=0.4), push, FREE, t, Settings(h, METHODS[name], 1e-9)).state
    velocity = -3.0 / 100.0 * t, 7.0 / 100.0 * t, 11.0 / 500.0 * t
    assert end[3:] == pytest.approx(velocity, rel=1e-12)
    late = h / 2 if METHODS[name].order == 1 else 0.0
    way = [v * (t / 2 + late) for v in velocity]
    assert (end.x, end.y, end.heading - 0.4) == pytest.approx(way, rel=1e-11)


@pytest.mark.parametrize("name", ["rk4", "adaptive"])
def test_on_a_slope_the_craft_comes_to_the_speed_of_its_weight(name: str) -> None:
    """Down a slope of angle a the force is m*g*sin(a); bow first, that is the launch by such a thrust."""
    angle, heading, craft = 0.01, 0.7, Craft()
    weight = craft.mass * craft.gravity * math.sin(angle)
    v_t = math.sqrt(weight / craft.drag_factor)
    tau = craft.mass * v_t / weight
    start = State(heading=heading)
    push = load(weight * math.cos(heading), weight * math.sin(heading))
    end = advance(start, push, craft, 4.0, Settings(0.005, METHODS[name], 1e-10)).state
    speed, way = v_t * math.tanh(4.0 / tau), v_t * tau * math.log(math.cosh(4.0 / tau))
    assert (math.hypot(end.vx, end.vy), math.hypot(end.x, end.y)) == pytest.approx((speed, way), rel=1e-8)
    assert math.atan2(end.y, end.x) == pytest.approx(heading, abs=1e-12)


@EVERY
def test_friction_holds_against_them_and_lets_go(name: str) -> None:
    """On a slope whose weight is less than the friction, and under a moment less than its own, not a bit moves."""
    craft, way = Craft(skirt_friction=0.02, drag_coefficient=0.0), Settings(0.01, METHODS[name])
    grip = craft.friction_force
    for push in (load(0.99 * grip), load(0.6 * grip, -0.79 * grip), load(moment=5.0 * grip)):
        assert advance(State(), push, craft, 5.0, way).state == State()
        assert loads(State(), push, craft) == (0.0, 0.0, 0.0)
    end = advance(State(), load(1.5 * grip), craft, 5.0, way).state
    assert end.vx == pytest.approx(0.5 * grip / craft.mass * 5.0, rel=1e-4)  # adaptive: its tolerance, as it lets go


@pytest.mark.parametrize("name", ["semi_implicit_euler", "drag_implicit"])
def test_a_thrust_off_the_centre_line_is_a_craft_with_that_thruster(name: str) -> None:
    """The port thruster as a host makes it of the heading, sub-step by sub-step: but for the roundings of the turning
    to and fro the craft's own.
    """
    craft, way, push = Craft(), Settings(0.01, METHODS[name]), 3.0
    own, other = State(vx=0.2, yaw_rate=0.05), State(vx=0.2, yaw_rate=0.05)
    for _ in range(2000):
        own = advance(own, Controls(4.0, port=1.0), craft, 0.01, way).state
        c, s = math.cos(other.heading), math.sin(other.heading)
        outside = load(-s * push, c * push, 0.5 * craft.length * push, thrust=4.0)
        other = advance(other, outside, craft, 0.01, way).state
    assert other == pytest.approx(own, rel=1e-11)


def test_the_error_of_a_spring_that_a_host_writes_is_of_first_order() -> None:
    """To the origin, F = -k*x held over each communication step: x = cos(w*t) in closed form; and the amplitude grows
    by sqrt(1 + (H*w)^2/2) a step, as the held force feeds it.
    """
    stiffness, omega, periods = 25.0, 0.5, 1.5 * math.pi  # at 3/4 of a turn the velocity is largest

    def end(n: int) -> State:
        state, step = State(x=1.0), periods / omega / n
        for _ in range(n):
            state = advance(state, load(-stiffness * state.x), FREE, step, Settings(step, METHODS["rk4"])).state
        return state

    steps = np.array([400, 800, 1600])
    errors = [math.hypot(found.x, (found.vx - omega) / omega) for found in map(end, steps.tolist())]
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(-1.0, abs=0.02)
    step = periods / omega / 400
    growth = (1.0 + (step * omega) ** 2 / 2.0) ** 200
    size = math.hypot(end(400).x, end(400).vx / omega)
    assert size == pytest.approx(growth, rel=step * omega)  # an oscillation about the circle, of the order of a step


@given(states, controls)
def test_the_energy_grows_by_the_work_and_drag_takes_of_it(state: State, asked: Controls) -> None:
    push = Controls(0.0, 0.0, 0.0, 0.0, 0.0, *asked[5:])
    way = Settings(0.1, METHODS["rk4"])
    for craft in (FREE, Craft(mass=1e4, inertia=1e6)):
        energy, work, now = kinetic_energy(state, craft), 0.0, state
        for _ in range(10):
            after = advance(now, push, craft, 0.1, way).state
            work += push[5] * (after.x - now.x) + push[6] * (after.y - now.y) + push[7] * (after.heading - now.heading)
            now = after
        size = kinetic_energy(now, craft) + energy + abs(work)
        gained = kinetic_energy(now, craft) - energy
        if craft is FREE:
            assert gained == pytest.approx(work, rel=0.0, abs=1e-10 * size)
        else:
            assert gained <= work + 1e-5 * size  # RK4's own error
