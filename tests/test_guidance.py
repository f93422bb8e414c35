"""The autopilot's law: symmetries, limits, margins; and a leg in the wind."""

import cmath
import math
import re

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from hovercraft_fmu.autopilot import guidance
from hovercraft_fmu.autopilot.guidance import Commands, Gains, Pilot, Waypoint, check_gain, steer
from hovercraft_fmu.autopilot.pilot_interface import DEMO_COURSE
from hovercraft_fmu.model.craft import Craft, preset
from hovercraft_fmu.model.dynamics import Controls, State
from hovercraft_fmu.model.integrators import integrator
from hovercraft_fmu.model.subcycling import Settings, advance
from tests.strategies import numbers

RK4 = Settings(0.5, integrator(3))
points = st.builds(Waypoint, numbers(-300.0, 300.0), numbers(-300.0, 300.0))
courses = st.lists(points, min_size=1, max_size=8)
motions = st.builds(
    State,
    x=numbers(-400.0, 400.0),
    y=numbers(-400.0, 400.0),
    heading=numbers(-10.0, 10.0),
    vx=numbers(-2.0, 2.0),
    vy=numbers(-2.0, 2.0),
    yaw_rate=numbers(-0.5, 0.5),
)
pushes = st.tuples(numbers(-7.0, 7.0), numbers(-7.0, 7.0))
durations = st.one_of(st.just(0.0), numbers(1e-6, 1e6))


def beginning(origin: Waypoint, push: tuple[float, float]) -> Pilot:
    return Pilot(origin, 0, *push)


@given(points, pushes, motions, courses, durations)
def test_commands_are_within_their_limits_and_never_fight(
    origin: Waypoint, push: tuple[float, float], motion: State, course: list[Waypoint], duration: float
) -> None:
    assume(origin != course[0])
    pilot, (thrust, port, starboard), sight = steer(beginning(origin, push), motion, course, Gains(), duration)
    assert 0.0 <= thrust <= Gains().thrust_max
    assert 0.0 <= port <= 1.0
    assert 0.0 <= starboard <= 1.0
    assert port == 0.0 or starboard == 0.0
    assert math.hypot(pilot.push_x, pilot.push_y) <= Gains().thrust_max * (1.0 + 1e-12)
    assert sight.distance > Gains().acceptance_radius or pilot.reached == len(course)


def mirrored(waypoint: Waypoint) -> Waypoint:
    return Waypoint(waypoint.x, -waypoint.y)


@given(points, pushes, motions, courses, durations)
def test_a_mirrored_course_gives_mirrored_commands(
    origin: Waypoint, push: tuple[float, float], motion: State, course: list[Waypoint], duration: float
) -> None:
    """To the bit, but for the turn right round, which is to one side or the other."""
    assume(origin != course[0])
    x, y, heading, vx, vy, yaw_rate = motion
    pilot, commands, sight = steer(beginning(origin, push), motion, course, Gains(), duration)
    other, others, seen = steer(
        beginning(mirrored(origin), (push[0], -push[1])),
        State(x, -y, -heading, vx, -vy, -yaw_rate),
        [mirrored(each) for each in course],
        Gains(),
        duration,
    )
    assert (others.thrust, others.starboard, others.port) == commands
    assert (seen.cross_track, seen.distance) == (-sight.cross_track, sight.distance)
    assert (other.reached, other.push_x, other.push_y) == (pilot.reached, pilot.push_x, -pilot.push_y)


@given(points, pushes, motions, courses, numbers(-3.0, 3.0))
def test_turning_the_whole_scene_changes_no_command(
    origin: Waypoint, push: tuple[float, float], motion: State, course: list[Waypoint], angle: float
) -> None:
    """But for the turn right round, and a waypoint on the rim of its circle."""
    c, s = math.cos(angle), math.sin(angle)

    def turned(x: float, y: float) -> Waypoint:
        return Waypoint(c * x - s * y, s * x + c * y)

    assume(math.dist(origin, course[0]) > 1e-3 and abs(math.dist(motion[:2], course[0]) - 10.0) > 1e-6)
    _, commands, sight = steer(beginning(origin, push), motion, course[:1], Gains(), 0.5)
    x, y, heading, vx, vy, yaw_rate = motion
    moved = State(*turned(x, y), heading + angle, *turned(vx, vy), yaw_rate)
    _, others, seen = steer(
        beginning(turned(*origin), turned(*push)), moved, [turned(*each) for each in course[:1]], Gains(), 0.5
    )
    assert seen == pytest.approx(sight, abs=1e-9)
    assert others.thrust == pytest.approx(commands.thrust, abs=1e-6)
    way = others.port - others.starboard, commands.port - commands.starboard
    assert way[0] == pytest.approx(way[1], abs=1e-6) or min(map(abs, way)) == 1.0


def test_waypoints_are_reached_one_after_the_other_and_then_everything_is_off() -> None:
    course = [Waypoint(5.0, 0.0), Waypoint(8.0, 0.0), Waypoint(50.0, 0.0)]
    pilot, _, sight = steer(Pilot(Waypoint(0.0, 0.0)), State(), course, Gains(), 0.0)
    assert (pilot.reached, pilot.origin, sight.distance) == (2, course[1], 50.0)
    pilot, commands, _ = steer(pilot, State(x=45.0), course, Gains(), 1.0)
    assert (pilot.reached, commands) == (3, Commands(0.0, 0.0, 0.0))
    pilot, commands, sight = steer(pilot, State(x=-500.0), course, Gains(), 1.0)
    assert (pilot.reached, commands, sight.distance) == (3, Commands(0.0, 0.0, 0.0), 550.0)


def test_a_leg_without_a_length_is_refused() -> None:
    """Only a craft that is put elsewhere than where its leg begins can meet one."""
    with pytest.raises(ValueError, match=r"a leg of 0\.0 m: must be a finite length greater than 0"):
        steer(Pilot(Waypoint(50.0, 0.0)), State(), [Waypoint(50.0, 0.0)], Gains(), 0.5)


def test_a_craft_that_has_passed_its_waypoint_turns_back() -> None:
    at_rest, course = State(x=130.0, y=30.0), [Waypoint(100.0, 0.0)]
    _, (thrust, port, starboard), _ = steer(Pilot(Waypoint(0.0, 0.0)), at_rest, course, Gains(), 0.5)
    assert (thrust, port, starboard) == (0.0, 0.0, 1.0)


def sailed(craft: Craft, wind: tuple[float, float], seconds: float, h: float = 0.5) -> tuple[State, float]:
    """A long leg along x, from rest; the state, and the cross-track error."""
    state, pilot, course = State(), Pilot(Waypoint(0.0, 0.0)), [Waypoint(1e4, 0.0)]
    cross_track = 0.0
    for _ in range(round(seconds / h)):
        pilot, commands, (cross_track, _) = steer(pilot, state, course, Gains(), h)
        state = advance(state, Controls(*commands, *wind), craft, h, RK4).state
    return state, cross_track


@pytest.mark.parametrize("craft", [Craft(), Craft(mass=50.0), Craft(mass=200.0), Craft(mass=200.0, inertia=1000.0)])
@pytest.mark.parametrize("wind", [(0.0, 0.2), (0.0, -0.2), (0.1, 0.15)])
def test_wind_leaves_no_error(craft: Craft, wind: tuple[float, float]) -> None:
    """The craft crabs: its velocity, not its heading, lies along the leg; and it keeps the cruise speed."""
    state, cross_track = sailed(craft, wind, 1500.0)
    assert abs(cross_track) < 1e-3
    assert (state.vx, state.vy) == pytest.approx((Gains().cruise_speed, 0.0), abs=1e-5)
    # the drag acts along the air's velocity past the craft, and the propeller holds against it: the bow is there
    air = math.atan2(-wind[1], Gains().cruise_speed - wind[0])
    assert state.heading == pytest.approx(air, abs=1e-3)


def test_a_wind_that_it_cannot_stem_is_no_reason_to_wind_up() -> None:
    """An hour against a gale, then calm: back at the cruise speed within two minutes."""
    state, pilot, course = State(), Pilot(Waypoint(0.0, 0.0)), [Waypoint(1e4, 0.0)]
    for k in range(7440):
        pilot, commands, _ = steer(pilot, state, course, Gains(), 0.5)
        wind = -1.0 if k < 7200 else 0.0
        state = advance(state, Controls(*commands, wind, 0.0), Craft(), 0.5, RK4).state
        assert math.hypot(pilot.push_x, pilot.push_y) <= Gains().thrust_max
    assert state.vx == pytest.approx(Gains().cruise_speed, rel=0.1)


@pytest.mark.parametrize(("cruise_speed", "widest"), [(0.5, 10.0), (2.0, 50.0)])
@pytest.mark.parametrize("wind", [0.0, 0.2])
def test_on_ice_it_swings_wide_and_still_arrives(cruise_speed: float, widest: float, wind: float) -> None:
    gains, course = Gains(cruise_speed=cruise_speed), [Waypoint(*point) for point in DEMO_COURSE]
    state, pilot, steps = State(), Pilot(Waypoint(0.0, 0.0)), 0
    while pilot.reached < len(course):
        pilot, commands, sight = steer(pilot, state, course, gains, 0.5)
        assert abs(sight.cross_track) < widest
        state = advance(state, Controls(*commands, 0.0, wind), preset("ice"), 0.5, RK4).state
        steps += 1
        assert steps < 2000


def margin(mass: float) -> tuple[float, float]:
    """Of the velocity loop abeam: where it crosses 1 [rad/s], and how much phase is left there [degrees]."""
    gains, craft = Gains(), Craft(mass=mass)
    moment = craft.thruster_moment
    w = math.sqrt(gains.heading_gain * moment / craft.inertia)
    assert gains.yaw_rate_gain * moment / craft.inertia == pytest.approx(2.0 * w)  # critically damped
    drag = craft.drag_factor * gains.cruise_speed

    def loop(frequency: float) -> complex:
        s = 1j * frequency
        proportional_integral = gains.velocity_gain * (1.0 + 1.0 / (gains.integral_time * s))
        return proportional_integral / (mass * s + drag) * (w / (s + w)) ** 2

    low, high = 1e-3, 1.0
    for _ in range(60):
        middle = math.sqrt(low * high)
        low, high = (middle, high) if abs(loop(middle)) > 1.0 else (low, middle)
    return low, 180.0 + math.degrees(cmath.phase(loop(low)))


def test_the_margins_are_those_of_the_text() -> None:
    text = " ".join((guidance.__doc__ or "").split())
    found = re.search(r"crosses 1 at ([\d.]+) rad/s, a third of w, with (\d+) degrees", text)
    others = re.search(r"to ([\d.]+) or ([\d.]+) rad/s, and leaves (\d+) or (\d+) degrees", text)
    assert found
    assert others
    said = {100.0: found.groups(), 50.0: others.group(1, 3), 200.0: others.group(2, 4)}
    for mass, (crossing, phase) in said.items():
        w, left = margin(mass)
        assert (f"{w:.2f}", f"{left:.0f}") == (crossing, phase)
    assert pytest.approx(Gains().heading_gain) == 0.3 * 500.0 * 0.3 / 30.0


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
def test_an_impossible_gain_is_refused(value: float) -> None:
    with pytest.raises(ValueError, match=rf"lookahead = {value!r} m: must be a finite number greater than 0"):
        Gains(lookahead=value)
    with pytest.raises(ValueError, match=r"yaw_rate_gain = .* s/rad: must be"):
        check_gain("yaw_rate_gain", value)
