"""What a scene may ask for: nothing changes where it does not; each term against an exact solution."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from hovercraft_fmu.cli import commands
from hovercraft_fmu.model.craft import DIRECTIONAL, Craft
from hovercraft_fmu.model.dynamics import (
    Controls,
    State,
    actuation,
    derivatives,
    friction_function,
    friction_gains,
    friction_radius,
    kinetic_energy,
    load_function,
    loads,
    slip_speed,
)
from hovercraft_fmu.model.integrators import ADAPTIVE, INTEGRATORS, integrator, integrator_number
from hovercraft_fmu.model.subcycling import Settings, advance
from hovercraft_fmu.scenes import SCENES
from hovercraft_fmu.studies import scene_terms
from hovercraft_fmu.studies.reference_end import reference_end
from hovercraft_fmu.studies.scene_terms import TERMS
from hovercraft_fmu.studies.work_precision import off_at_the_end
from tests.strategies import calm_controls, calm_crafts, controls, numbers, states
from tests.test_trade import RESULTS, records

NONE = Controls(0.0, 0.0, 0.0)
EVERY = pytest.mark.parametrize("method", INTEGRATORS, ids=lambda each: each.name)


# ---- off: not a bit


@settings(suppress_health_check=[HealthCheck.filter_too_much])  # of older versions of hypothesis
@given(calm_crafts, states, calm_controls)
def test_the_general_equations_have_the_bits_of_the_special_ones(craft: Craft, state: State, asked: Controls) -> None:
    """What is left out changes no bit of what it leaves: a wind, or a drag, too small to be seen beside the rest."""
    craft = replace(craft, drag_area=1, rotational_drag=0.0, skirt_friction=0.0)
    assume(min(map(abs, (state.vx, *actuation(asked, craft)))) > 1e-9)
    factors, motion = (0.001 / craft.mass, 0.001 / craft.inertia), state[2:]
    plain = load_function(asked, craft, *factors)(*motion)
    assert load_function(asked._replace(wind_x=5e-324), craft, *factors)(*motion) == plain
    assert load_function(asked._replace(external_moment=5e-324), craft, *factors)(*motion) == plain
    still, nearly = (replace(craft, drag_coefficient=coefficient) for coefficient in (0.0, 1e-300))
    without, with_it = (load_function(asked, each, *factors)(*motion) for each in (still, nearly))
    assert without[:3] == with_it[:3]


# ---- wind


@EVERY
def test_a_craft_that_drifts_takes_on_the_velocity_of_the_wind(method: Any) -> None:
    """The velocity through the air decays as in coasting, w0/(1 + kappa*w0*t); the drag centre is at 0."""
    craft = Craft(drag_center_fraction=0.0)
    kappa, wind = craft.drag_factor / craft.mass, math.hypot(0.3, 0.4)
    h = 1.0 if method.name == "drag_implicit" else 0.01  # of the first, the velocity is exact at any step
    end = advance(State(), Controls(0.0, 0.0, 0.0, 0.3, -0.4), craft, 600.0, Settings(h, method, 1e-10)).state
    left = wind / (1.0 + kappa * wind * 600.0)
    exact = {"semi_implicit_euler": 1e-5}.get(method.name, 1e-10)  # first order: h*kappa*wind^2/(1 + ...)^2 * log
    assert (0.3 - end.vx, -0.4 - end.vy) == pytest.approx((0.6 * left, -0.8 * left), abs=exact)
    assert (end.heading, end.yaw_rate) == (0.0, 0.0)


@EVERY
@given(states, controls)
def test_wind_is_a_motion_of_the_frame(method: Any, state: State, asked: Controls) -> None:
    """Seen by somebody who drifts with it there is no wind (without friction on the ground)."""
    wx, wy, t = asked.wind_x, asked.wind_y, 0.5
    way = Settings(0.01, method, 1e-9)
    there = advance(state, asked, Craft(mass=1e4, inertia=1e6), t, way).state
    drifting = state._replace(vx=state.vx - wx, vy=state.vy - wy)
    here = advance(drifting, asked._replace(wind_x=0.0, wind_y=0.0), Craft(mass=1e4, inertia=1e6), t, way).state
    moved = here._replace(x=here.x + wx * t, y=here.y + wy * t, vx=here.vx + wx, vy=here.vy + wy)
    # positions to 1e3 m; the adaptive method's steps follow roundings, its error the tolerance
    assert there == pytest.approx(moved, rel=0.0, abs=1e-10 if method.integrate else 1e-7)


# ---- directional area


@given(numbers(-math.pi, math.pi), numbers(-math.pi, math.pi), numbers(0.1, 10.0))
def test_the_directional_area_is_the_shadow_of_the_box(heading: float, course: float, speed: float) -> None:
    """The drag at rest of rotation, against the corners of the box seen along the air."""
    craft = Craft(drag_area=DIRECTIONAL)
    state = State(heading=heading, vx=speed * math.cos(course), vy=speed * math.sin(course))
    turned = complex(math.cos(heading), math.sin(heading))
    corners = [complex(a * 10.0, b * 5.0) * turned for a in (-1, 1) for b in (-1, 1)]
    across = [(corner * complex(math.cos(course), -math.sin(course))).imag for corner in corners]
    area = (max(across) - min(across)) * 5.0
    force = loads(state, NONE, craft)
    assert math.hypot(force.x, force.y) == pytest.approx(0.5 * 1.225 * 1.25 * area * speed**2, rel=1e-12)


@EVERY
def test_bow_on_the_terminal_speed_is_that_of_the_bow(method: Any) -> None:
    craft = Craft(drag_area=DIRECTIONAL)
    end = advance(State(), Controls(5.0), craft, 600.0, Settings(0.1, method, 1e-12)).state
    assert end.vx == pytest.approx(math.sqrt(5.0 / (0.5 * 1.225 * 1.25 * 10.0 * 5.0)), rel=1e-12)
    assert end[2:] == (0.0, end.vx, 0.0, 0.0)


@EVERY
def test_abeam_it_coasts_with_its_whole_side(method: Any) -> None:
    """v = v0/(1 + kappa*v0*t), y = ln(1 + kappa*v0*t)/kappa, kappa of L*H; drag centre at 0: it does not turn."""
    craft = Craft(drag_area=DIRECTIONAL, drag_center_fraction=0.0)
    kappa = 0.5 * 1.225 * 1.25 * 20.0 * 5.0 / 100.0
    end = advance(State(vy=2.0), NONE, craft, 60.0, Settings(0.01, method, 1e-10)).state
    growth = 1.0 + kappa * 2.0 * 60.0
    assert end.vy == pytest.approx(2.0 / growth, abs={1: 1e-4, 2: 1e-7}.get(method.order, 1e-9))
    assert end.y == pytest.approx(math.log(growth) / kappa, abs={1: 0.04, 2: 1e-4}.get(method.order, 1e-7))  # 2*h*v0
    assert (end.x, end.heading, end.vx, end.yaw_rate) == (0.0, 0.0, 0.0, 0.0)


# ---- rotational drag


def test_the_moment_on_a_rotating_box_is_that_of_its_strips() -> None:
    """The cross-flow drag of 200 000 strips along the length (midpoint rule: relative 1e-10 of a cube)."""
    craft, r = Craft(rotational_drag=1.0, drag_center_fraction=0.0), -0.7
    s = (np.arange(200000) + 0.5) / 200000 * 20.0 - 10.0
    expected = -np.sum(0.5 * 1.225 * 1.25 * 5.0 * (r * s) * np.abs(r * s) * s) * (20.0 / 200000)
    assert loads(State(yaw_rate=r), NONE, craft).moment == pytest.approx(expected, rel=1e-9)
    half = loads(State(yaw_rate=r), NONE, replace(craft, rotational_drag=0.5)).moment
    assert half == pytest.approx(0.5 * expected, rel=1e-9)


@EVERY
def test_yaw_decays_as_quadratic_drag_does(method: Any) -> None:
    """r = r0/(1 + c*r0*t), heading = ln(1 + c*r0*t)/c, c = rho*Cd*H*L^4/(64*I); the drag centre at 0."""
    craft = Craft(rotational_drag=1.0, drag_center_fraction=0.0)
    c = 1.225 * 1.25 * 5.0 * 20.0**4 / 64.0 / 500.0
    end = advance(State(yaw_rate=0.5), NONE, craft, 60.0, Settings(0.001, method, 1e-10)).state
    growth = 1.0 + c * 0.5 * 60.0
    assert end.yaw_rate == pytest.approx(0.5 / growth, abs=1e-6 if method.name == "semi_implicit_euler" else 1e-9)
    assert end.heading == pytest.approx(math.log(growth) / c, abs={1: 1e-3, 2: 1e-6}.get(method.order, 1e-7))  # 2*h*r0


# ---- friction


def test_the_friction_radius_is_the_mean_distance_of_the_rectangle() -> None:
    """Against the midpoint rule on 1000 x 1000 points; the kink in the centre costs it 1e-6 of a cell."""
    for length, width in ((20.0, 10.0), (3.0, 3.0), (1.0, 40.0)):
        x, y = ((np.arange(1000) + 0.5) / 1000 - 0.5) * length, ((np.arange(1000) + 0.5) / 1000 - 0.5) * width
        mean = np.hypot(x[:, None], y[None, :]).mean()
        assert friction_radius(Craft(length=length, width=width)) == pytest.approx(mean, rel=2e-6)


@pytest.mark.parametrize(("width", "off", "angle"), [(10.0, 0.1, 11.5), (2.0, 0.13, 30.0)])
def test_the_ellipsoid_is_near_the_integral_of_uniform_pressure(width: float, off: float, angle: float) -> None:
    """It takes nearly the same power from every mix of sliding and spinning, exactly on the axes; its force is at most
    that many degrees from that of the integral.
    """
    rho, turned = friction_radius(Craft(width=width)), 0.0
    x, y = np.meshgrid(((np.arange(400) + 0.5) / 400 - 0.5) * 20.0, ((np.arange(400) + 0.5) / 400 - 0.5) * width)
    for course in np.linspace(0.0, math.pi / 2, 7):
        for turning in (0.0, 0.1, 0.3, 0.6, 1.0, 1.5, 3.0, 10.0, 1e9):
            speed = 0.0 if turning == 1e9 else 1.0
            r = (1.0 if turning == 1e9 else turning) / rho
            vx, vy = speed * math.cos(course) - r * y, speed * math.sin(course) + r * x
            exact = np.hypot(vx, vy).mean()  # power per mu*m*g
            ellipsoid = math.hypot(speed, rho * r)
            assert exact == pytest.approx(ellipsoid, rel=1e-3 if speed * turning in (0.0, 1e9) else off)
            if speed:
                force = (vx / np.hypot(vx, vy)).mean() + 1j * (vy / np.hypot(vx, vy)).mean()
                turned = max(turned, abs(np.angle(force / complex(math.cos(course), math.sin(course)), deg=True)))
    assert 0.9 * angle < turned < 1.05 * angle


SLIDING = Craft(drag_coefficient=0.0, skirt_friction=0.01)
DECELERATION = 0.01 * 9.80665
"""m/s2"""


@EVERY
@pytest.mark.parametrize("h", [0.001, 0.01, 0.1])
def test_without_drag_a_sliding_craft_stops_where_it_should(method: Any, h: float) -> None:
    """After v0/(mu*g), at v0^2/(2*mu*g). Euler's pose errs by h*v0/2; rk4's only over the last h*28 s (b = 7*a)."""
    way = Settings(h, method, 1e-8)
    stop = 1.0 / DECELERATION
    start = State(vx=0.6, vy=-0.8)
    before = advance(start, NONE, SLIDING, stop - 2.0 * h, way).state
    after = advance(start, NONE, SLIDING, stop + 2.0 * h, way).state
    assert math.hypot(before.vx, before.vy) == pytest.approx(2.0 * h * DECELERATION, rel=1e-6)
    assert after[3:] == (0.0, 0.0, 0.0)
    error = {"semi_implicit_euler": 0.51 * h, "drag_implicit": 0.51 * h, "rk4": 15.0 * h * h, "adaptive": 1e-6,
             "splitting": h * h}  # fmt: skip
    way_to_go = 0.5 / DECELERATION
    assert (after.x, after.y) == pytest.approx((0.6 * way_to_go, -0.8 * way_to_go), abs=error[method.name])


@EVERY
def test_pure_spin_stops_as_the_contact_pressure_says(method: Any) -> None:
    """The moment is mu*m*g times the mean distance: after I*r0/M, at I*r0^2/(2*M)."""
    moment = SLIDING.friction_force * friction_radius(SLIDING)
    stop = 500.0 * 0.5 / moment
    way = Settings(0.001, method, 1e-9)
    before = advance(State(yaw_rate=-0.5), NONE, SLIDING, stop - 0.01, way).state
    after = advance(State(yaw_rate=-0.5), NONE, SLIDING, stop + 0.01, way).state
    assert before.yaw_rate == pytest.approx(-0.01 * moment / 500.0, rel=1e-6)
    assert after[3:] == (0.0, 0.0, 0.0)
    assert after.heading == pytest.approx(-500.0 * 0.25 / (2.0 * moment), abs=3e-4)  # h*r0/2


pushes = st.tuples(numbers(0.0, 2.0 * math.pi), numbers(0.0, 0.999), st.booleans())
ground = st.builds(Craft, mass=numbers(1e-2, 1e6), inertia=numbers(1e-2, 1e6), skirt_friction=numbers(1e-3, 10.0),
                   thrust_max=st.just(1e9), steering_force=st.just(1.0))  # fmt: skip


@EVERY
@given(ground, numbers(-10.0, 10.0), numbers(0.0, 2.0 * math.pi), numbers(0.0, 0.999), numbers(1e-4, 100.0))
def test_below_its_limit_friction_holds_for_ever(
    method: Any, craft: Craft, heading: float, angle: float, part: float, h: float
) -> None:
    """Not a bit of the pose changes: no creep, no chatter, at any step. The push is any mix of thrust and thruster."""
    limit, radius = craft.friction_force, friction_radius(craft)
    # thrust and side force of one thruster with its moment, on the ellipse of what friction holds
    thrust = part * limit * abs(math.cos(angle))
    side = part * limit * math.sin(angle) / math.hypot(1.0, 0.5 * craft.length / radius)
    craft = replace(craft, steering_force=abs(side))
    asked = Controls(thrust, float(side > 0.0), float(side < 0.0))
    start = State(x=3.0, y=-2.0, heading=heading)
    assert advance(start, asked, craft, 20.0 * h, Settings(h, method)).state == start
    assert derivatives(start, asked, craft) == (0.0,) * 6


@EVERY
@given(numbers(1.01, 10.0), st.sampled_from([0.001, 0.01, 0.1]))
def test_above_its_limit_the_rest_of_the_push_counts(method: Any, part: float, h: float) -> None:
    craft = replace(SLIDING, thrust_max=1e9)
    push = part * craft.friction_force
    end = advance(State(), Controls(push, 0.0, 0.0), craft, 2.0, Settings(h, method)).state
    assert end.vx == pytest.approx(2.0 * (push - craft.friction_force) / craft.mass, rel=1e-9)
    rate = derivatives(State(), Controls(push, 0.0, 0.0), craft).vx
    assert rate == pytest.approx((push - craft.friction_force) / craft.mass, rel=1e-12)


@pytest.mark.parametrize("name", ["semi_implicit_euler", "drag_implicit"])
def test_in_wind_drag_implicit_lets_go_a_little_later(name: str) -> None:
    """At 1 + h*k*q/m times the limit, as documented; Euler at the limit itself."""
    h, wind, craft = 0.5, 0.2, Craft(skirt_friction=0.005, drag_center_fraction=0.0)
    kq = craft.drag_factor * wind
    later = 1.0 + h * kq / craft.mass if name == "drag_implicit" else 1.0
    way = Settings(h, integrator(integrator_number(name)))
    for part, moves in ((0.999, False), (1.001, True)):
        asked = Controls(part * later * craft.friction_force - kq * wind, 0.0, 0.0, wind, 0.0)
        assert (advance(State(), asked, craft, h, way).state.vx > 0.0) == moves


@EVERY
@given(numbers(-1.0, 1.0), numbers(-1.0, 1.0), numbers(-1.0, 1.0), st.sampled_from([0.01, 0.05, 1.0]))
@settings(max_examples=40)
def test_it_comes_to_rest_without_turning_back_and_stays(
    method: Any, vx: float, vy: float, yaw_rate: float, h: float
) -> None:
    """Kinetic energy falls with every step, all the way to nothing; then no bit moves."""
    state, craft, proposed = State(vx=vx, vy=vy, yaw_rate=yaw_rate), Craft(skirt_friction=0.05), 0.0
    if method.name in ("semi_implicit_euler", "rk4"):
        h = min(h, 0.05)  # these have a limit of stability for the drag, 0.3 s here
    way, energy = Settings(h, method), kinetic_energy(state, craft)
    for _ in range(1000):  # 10 s and more; 1.4 m/s last 3 s, 1 rad/s lasts 2 s
        state, _, _, _, proposed = advance(state, NONE, craft, h, way, proposed=proposed)
        after = kinetic_energy(state, craft)
        assert after < energy or after == energy == 0.0
        if energy == 0.0:
            break
        energy = after
    assert state[3:] == (0.0, 0.0, 0.0)
    assert advance(state, NONE, craft, 50.0 * h, way).state == state


@given(calm_crafts, states, numbers(1e-6, 10.0))
def test_the_friction_step_solves_its_equation(craft: Craft, state: State, h: float) -> None:
    """v' = v - a*v'/q, r' = r - b*r'/q, with q the slip speed at the end; or rest, where friction can hold."""
    craft = replace(craft, skirt_friction=0.3)
    a, b = friction_gains(craft, h)
    radius = friction_radius(craft)
    vx, vy, r = friction_function(craft, h)(*state[3:])
    q = slip_speed(vx, vy, radius * r)
    held = (math.hypot(state.vx, state.vy) / a) ** 2 + (radius * state.yaw_rate / b) ** 2
    if held < 1.0 - 1e-12:
        assert (vx, vy, r) == (0.0, 0.0, 0.0)
    elif held > 1.0 + 1e-12:
        size = max(map(abs, (*state[3:5], radius * state.yaw_rate)))
        assert (vx * (1.0 + a / q), vy * (1.0 + a / q)) == pytest.approx(state[3:5], abs=1e-13 * size, rel=1e-11)
        assert radius * r * (1.0 + b / q) == pytest.approx(radius * state.yaw_rate, abs=1e-13 * size, rel=1e-11)


def test_friction_that_takes_all_but_the_last_bit_leaves_next_to_nothing() -> None:
    """Where its equation is hardest to solve, with a spin that it hardly brakes: whatever is left goes on ahead."""
    craft = Craft(mass=1.0, inertia=1e60, gravity=1.0, skirt_friction=1.0)
    vx, vy, yaw_rate = friction_function(craft, 1.0)(math.nextafter(1.0, 0.0), 0.0, 1e-31)
    assert 0.0 <= vx <= 1e-16
    assert (vy, yaw_rate) == (0.0, 1e-31)


def test_what_friction_does_to_the_order() -> None:
    """First order stays; rk4 falls to the second where the craft comes to rest, splitting to the first, from smaller
    errors; adaptive follows its tolerance.
    """
    scene = SCENES["drift_to_rest"]
    assert reference_end(scene, 60.0)[1] < 1e-9
    orders = {}
    for name, steps in (("semi_implicit_euler", (0.05, 0.025, 0.0125, 0.00625)),
                        ("drag_implicit", (0.05, 0.025, 0.0125, 0.00625)),
                        ("splitting", (0.0125, 0.00625, 0.003125, 0.0015625)),
                        ("rk4", (0.0625, 0.03125, 0.015625, 0.0078125))):  # fmt: skip
        errors, _ = off_at_the_end(scene, integrator(integrator_number(name)), steps)
        orders[name] = float(np.polyfit(np.log(steps), np.log(errors), 1)[0])
    assert orders["semi_implicit_euler"] == pytest.approx(1.0, abs=0.1)
    assert orders["drag_implicit"] == pytest.approx(1.0, abs=0.1)
    assert orders["splitting"] == pytest.approx(1.0, abs=0.1)
    assert orders["rk4"] == pytest.approx(2.0, abs=0.2)
    tolerances = (1e-4, 1e-6, 1e-8)
    for tolerance, error in zip(tolerances, off_at_the_end(scene, ADAPTIVE, tolerances)[0], strict=True):
        assert error < 10.0 * tolerance


def test_sliding_alone_rk4_keeps_its_order() -> None:
    """A slide with a turn that does not come to rest: friction is a smooth load."""
    craft = replace(Craft(), skirt_friction=0.002, rotational_drag=0.2)
    start, asked = State(vx=0.5, vy=-0.3, yaw_rate=0.1), Controls(10.0, 0.3, 0.0)

    def end(h: float) -> State:
        return advance(start, asked, craft, 4.0, Settings(h, integrator(integrator_number("rk4")))).state

    exact = end(0.0005)
    steps = np.array([0.025, 0.0125, 0.00625, 0.003125])
    errors = [math.dist(end(h), exact) for h in steps]
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(4.0, abs=0.1)


# ---- all together


@EVERY
@given(calm_crafts, states)
@settings(max_examples=40)
def test_no_term_adds_energy_in_still_air(method: Any, craft: Craft, state: State) -> None:
    craft = replace(craft, mass=craft.mass + 1e4, inertia=craft.inertia + 1e6)  # smooth at a hundredth of a second
    energy = kinetic_energy(state, craft)
    for _ in range(10):
        state = advance(state, NONE, craft, 0.05, Settings(0.01, method, 1e-10)).state
        after = kinetic_energy(state, craft)
        assert after <= energy * (1.0 + 1e-12)
        energy = after


@given(calm_crafts, states, controls)
@settings(max_examples=40)
def test_all_methods_go_the_same_way(craft: Craft, state: State, asked: Controls) -> None:
    """Half a second of heavy craft, every term on: the methods agree to their own errors."""
    craft = replace(craft, mass=craft.mass + 1e4, inertia=craft.inertia + 1e6)
    ends = [advance(state, asked, craft, 0.5, Settings(0.001, each, 1e-9)).state for each in INTEGRATORS]
    for end in ends:
        assert end == pytest.approx(ends[-1], rel=0.0, abs=0.02)  # h times 20 m/s; and 2 rad/s at a 10 m lever
    assert ends[2] == pytest.approx(ends[3], rel=0.0, abs=1e-3)  # coming to rest included


# ---- the study


def test_the_study_finds_what_is_committed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The quick one, with the two scenes of a minute of the short table's three; prices are not compared."""
    short = tuple(name for name in scene_terms.SHOWN if SCENES[name].stop_time <= 60.0)
    monkeypatch.setattr(scene_terms, "SHOWN", short)
    done = CliRunner().invoke(commands, ["measure", "scene-terms", "--quick", "--output", str(tmp_path)])
    assert done.exit_code == 0, done.output
    committed = {(row["term"], row["scene"]): row for row in records(RESULTS / "scene_terms.csv")}
    assert len(committed) == len(TERMS) * len(SCENES)
    rows = records(tmp_path / "scene_terms.csv")
    assert len(rows) == len(TERMS) * len(short) == len(TERMS) * 2
    for row in rows:
        for column in ("position_difference", "path"):
            before = float(committed[row["term"], row["scene"]][column])
            assert float(row[column]) == pytest.approx(before, rel=1e-6, abs=1e-9)
    assert (tmp_path / "scene_terms.png").stat().st_size > 10000
    assert (tmp_path / "scene_terms.md").read_text(encoding="utf-8").startswith("| term ")
