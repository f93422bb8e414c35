"""The autopilot's law: symmetries, limits, gains; voyages, and what it tells of them."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from hovercraft_fmu.autopilot.guidance import (
    ARRIVED,
    AWAY,
    CIRCLING,
    LONG_STEP,
    MISSED,
    NOTHING_TO_STEER,
    SATURATED,
    STEP_PLANNED,
    WIND,
    Commands,
    Orders,
    Pilot,
    Waypoint,
    beginning,
    check_order,
    gains_for,
    steer,
)
from hovercraft_fmu.autopilot.pilot_interface import DEMO_COURSE
from hovercraft_fmu.coupling import sail_bare
from hovercraft_fmu.model.craft import Craft, preset
from hovercraft_fmu.model.dynamics import Controls, State
from hovercraft_fmu.model.integrators import integrator
from hovercraft_fmu.model.subcycling import Settings, advance
from hovercraft_fmu.scenes import VOYAGES
from tests.strategies import numbers

RK4 = Settings(0.5, integrator(3))
FINE = Settings(0.1, integrator(3))
"""For a light craft."""
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
choices = st.sampled_from([Orders(), Orders(keep_station=1), Orders(thrust_min=-4.0, turn_back=1)])


def under_way(origin: Waypoint, push: tuple[float, float], motion: State) -> Pilot:
    """On a leg, with a lasting force; the heading that is asked for is a little to starboard."""
    return beginning(motion)._replace(origin=origin, push_x=push[0], push_y=push[1], heading=motion.heading + 0.2)


@given(points, pushes, motions, courses, durations, choices)
def test_commands_are_within_their_limits_and_never_fight(
    origin: Waypoint, push: tuple[float, float], motion: State, course: list[Waypoint], duration: float, orders: Orders
) -> None:
    pilot, (thrust, port, starboard), sight = steer(under_way(origin, push, motion), motion, course, orders, duration)
    assert orders.thrust_min <= thrust <= orders.thrust_max
    assert 0.0 <= port <= 1.0
    assert 0.0 <= starboard <= 1.0
    assert port == 0.0 or starboard == 0.0
    assert sight.distance > orders.acceptance_radius or pilot.passed == len(course)
    # the heading that is asked for changes by no more than its rate allows
    assert abs(pilot.heading - motion.heading) <= 0.2 + gains_for(orders, duration).turn_rate * duration + 1e-9


def mirrored(waypoint: Waypoint) -> Waypoint:
    return Waypoint(waypoint.x, -waypoint.y)


def mirrored_pilot(pilot: Pilot) -> Pilot:
    changed = {name: -getattr(pilot, name) for name in ("heading", "y", "vy", "push_y", "swept")}
    return pilot._replace(origin=mirrored(pilot.origin), **changed)


@given(points, pushes, motions, courses, durations, choices)
def test_a_mirrored_course_gives_mirrored_commands(
    origin: Waypoint, push: tuple[float, float], motion: State, course: list[Waypoint], duration: float, orders: Orders
) -> None:
    """To the bit, but for the turn right round, which is to one side or the other."""
    before = under_way(origin, push, motion)
    pilot, commands, sight = steer(before, motion, course, orders, duration)
    x, y, heading, vx, vy, yaw_rate = motion
    other, others, seen = steer(
        mirrored_pilot(before),
        State(x, -y, -heading, vx, -vy, -yaw_rate),
        [mirrored(each) for each in course],
        orders,
        duration,
    )
    assert (others.thrust, others.starboard, others.port) == commands
    assert (seen.cross_track, seen.distance) == (-sight.cross_track, sight.distance)
    assert other == mirrored_pilot(pilot)


@given(points, pushes, motions, points, numbers(-3.0, 3.0))
def test_turning_the_whole_scene_changes_no_command(
    origin: Waypoint, push: tuple[float, float], motion: State, point: Waypoint, angle: float
) -> None:
    """But for the turn right round, and a waypoint on the rim of its circle, or just abeam."""
    c, s = math.cos(angle), math.sin(angle)

    def turned(x: float, y: float) -> Waypoint:
        return Waypoint(c * x - s * y, s * x + c * y)

    leg = point.x - origin.x, point.y - origin.y
    assume(math.hypot(*leg) > 1e-3 and abs(math.dist(motion[:2], point) - 10.0) > 1e-6)
    assume(abs((point.x - motion.x) * leg[0] + (point.y - motion.y) * leg[1]) > 1e-6)
    _, commands, sight = steer(under_way(origin, push, motion), motion, [point], Orders(), 0.5)
    x, y, heading, vx, vy, yaw_rate = motion
    moved = State(*turned(x, y), heading + angle, *turned(vx, vy), yaw_rate)
    _, others, seen = steer(under_way(turned(*origin), turned(*push), moved), moved, [turned(*point)], Orders(), 0.5)
    assert seen == pytest.approx(sight, abs=1e-9)
    assert others.thrust == pytest.approx(commands.thrust, abs=1e-6)
    way = others.port - others.starboard, commands.port - commands.starboard
    gains = gains_for(Orders(), 0.5)
    right_round = 2.0 * gains.heading * gains.turn_rate * 0.5
    assert way[0] == pytest.approx(way[1], abs=1e-6) or abs(way[0] - way[1]) == pytest.approx(right_round, rel=1.0)


# ---- waypoints


def test_waypoints_are_reached_one_after_the_other_and_then_everything_is_off() -> None:
    course = [Waypoint(5.0, 0.0), Waypoint(8.0, 0.0), Waypoint(50.0, 0.0)]
    pilot, _, sight = steer(beginning(State()), State(), course, Orders(), 0.0)
    assert (pilot.passed, pilot.origin, sight.distance) == (2, course[1], 50.0)
    pilot, commands, _ = steer(pilot, State(x=45.0), course, Orders(), 1.0)
    assert (pilot.passed, pilot.missed, commands, pilot.status) == (3, 0, Commands(), ARRIVED)
    pilot, commands, sight = steer(pilot, State(x=-5.0), course, Orders(), 1.0)
    assert (pilot.passed, commands, sight.distance) == (3, Commands(), 55.0)


def test_a_waypoint_that_lies_behind_is_missed_and_the_next_leg_begins() -> None:
    """Beyond the perpendicular through it, 20 m abeam; one at the same place is passed with it."""
    course = [Waypoint(100.0, 0.0), Waypoint(100.0, 0.0), Waypoint(200.0, 0.0)]
    before, _, _ = steer(beginning(State()), State(x=99.9, y=20.0), course, Orders(), 0.5)
    assert (before.passed, before.missed, before.status) == (0, 0, 0)
    after, _, _ = steer(before, State(x=100.1, y=20.0), course, Orders(), 0.5)
    assert (after.passed, after.missed, after.origin, after.status) == (2, 2, course[1], MISSED)
    told_to, _, _ = steer(before, State(x=100.1, y=20.0), course, Orders(turn_back=1), 0.5)
    assert (told_to.passed, told_to.missed) == (0, 0)


def test_a_craft_that_is_told_to_turns_back_to_a_waypoint_that_it_has_passed() -> None:
    at_rest, course, orders = State(x=130.0, y=30.0), [Waypoint(100.0, 0.0)], Orders(turn_back=1)
    pilot = beginning(at_rest)._replace(origin=Waypoint(0.0, 0.0))
    for _ in range(5):
        pilot, (thrust, port, starboard), _ = steer(pilot, at_rest, course, orders, 0.5)
    assert (thrust, port) == (0.0, 0.0)
    assert starboard > 0.2


def test_turns_round_the_waypoint_are_counted_and_told() -> None:
    """On a circle of 20 m, clockwise on the screen."""
    course, orders, start = [Waypoint(0.0, 0.0)], Orders(turn_back=1), State(x=-20.0)
    pilot = beginning(start)
    for k in range(1, 150):
        angle = math.pi + 2.0 * math.pi * k / 60
        pilot, _, _ = steer(pilot, State(20.0 * math.cos(angle), 20.0 * math.sin(angle)), course, orders, 0.5)
        assert pilot.turns == pytest.approx(k / 60)
        if k != 60:
            assert bool(pilot.status & CIRCLING) == (k > 60)
    assert pilot.passed == 0


# ---- voyages


@dataclass(frozen=True)
class Sailed:
    """How a voyage went."""

    state: State
    pilot: Pilot
    cross_track: NDArray[np.float64]
    """m, at every sample"""
    speed: float
    """m/s, the largest"""
    full: float
    """1, the share of the samples with a thruster at its limit"""

    @property
    def off(self) -> float:
        """m, root mean square"""
        return float(np.sqrt(np.mean(self.cross_track**2)))


DEMO = tuple(Waypoint(*point) for point in DEMO_COURSE)
LONG = (Waypoint(1e4, 0.0),)
STILL = (0.0, 0.0)


def sailed(
    craft: Craft,
    orders: Orders,
    wind: tuple[float, float] = STILL,
    course: tuple[Waypoint, ...] = DEMO,
    seconds: float = 4000.0,
    late: int = 0,
    settings: Settings = RK4,
) -> Sailed:
    """From rest to the end of the course, or for a time [s]. Commands act at once, or a step late (a Jacobi loop)."""
    state, full, speed, off = State(), 0, 0.0, []
    pilot, told = beginning(state), [Commands()] * late
    for _ in range(round(seconds / 0.5)):
        pilot, commands, sight = steer(pilot, state, course, orders, 0.5)
        if pilot.passed == len(course) and not orders.keep_station:
            break
        off.append(sight.cross_track)
        full += max(commands.port, commands.starboard) == 1.0
        told.append(commands)
        state = advance(state, Controls(*told.pop(0), *wind), craft, 0.5, settings).state
        speed = max(speed, math.hypot(state.vx, state.vy))
    return Sailed(state, pilot, np.array(off), speed, full / len(off))


@pytest.mark.parametrize("craft", [Craft(), Craft(mass=50.0), Craft(mass=200.0), Craft(mass=200.0, inertia=1000.0)])
@pytest.mark.parametrize("wind", [(0.0, 0.2), (0.1, 0.15)])
def test_wind_leaves_no_error(craft: Craft, wind: tuple[float, float]) -> None:
    """The craft crabs, though the autopilot was told of no other mass: its velocity lies along the leg."""
    way = sailed(craft, Orders(), wind, LONG, 900.0)
    assert abs(way.cross_track[-1]) < 1e-3
    assert (way.state.vx, way.state.vy) == pytest.approx((Orders().cruise_speed, 0.0), abs=1e-5)
    # the drag acts along the air's velocity past the craft, and the propeller holds against it: the bow is there
    air = math.atan2(-wind[1], Orders().cruise_speed - wind[0])
    assert way.state.heading == pytest.approx(air, abs=1e-3)
    assert way.pilot.status == 0


def test_a_wind_that_it_cannot_stem_is_told_and_is_no_reason_to_wind_up() -> None:
    """Ten minutes against a gale, then calm: at the cruise speed within two minutes."""
    state, told = State(), math.inf
    pilot = beginning(state)
    for k in range(1440):
        pilot, commands, _ = steer(pilot, state, LONG, Orders(), 0.5)
        told = min(told, k) if pilot.status & WIND else told
        wind = -1.0 if k < 1200 else 0.0
        state = advance(state, Controls(*commands, wind, 0.0), Craft(), 0.5, RK4).state
    assert 60 < told < 300  # half a minute, and what it takes to drift
    assert pilot.status & ~AWAY == WIND
    assert state.vx == pytest.approx(Orders().cruise_speed, rel=0.1)


def test_off_the_legs_no_more_than_before_on_the_demo_and_a_third_of_that_on_ice() -> None:
    """Before: 1.80 m in calm air, 1.90 m in the crosswind, and 13.6 m on ice at 2 m/s (root mean squares)."""
    assert sailed(Craft(), Orders(), late=1).off < 1.80
    assert sailed(Craft(), Orders(), (0.0, 0.2), late=1).off < 1.90
    assert sailed(preset("ice"), Orders(cruise_speed=2.0), late=1).off < 13.6 / 3


def test_gains_of_a_short_step_that_are_given_hold_the_legs_at_2_s_too() -> None:
    """What the softened ones lose, 3.1 m off, is no more than it was, 2.0 m: as the page says."""
    gains = {"heading_gain": 1.5, "yaw_rate_gain": 10.0, "velocity_gain": 24.0, "integral_time": 10.0,
             "lookahead": 10.0, "turn_rate": 0.105}  # fmt: skip
    assert tuple(gains_for(Orders(), 0.5)) == pytest.approx(tuple(gains.values()))
    off = []
    for chosen in ({}, gains):
        voyage = replace(VOYAGES["crosswind"], autopilot=chosen)
        passage = sail_bare(voyage, communication_step=2.0, settings=RK4)
        assert passage.arrived
        off.append(math.sqrt(np.mean(passage["cross_track_error"] ** 2)))
    assert off == pytest.approx([3.1, 2.0], abs=0.05)


def test_on_ice_at_a_speed_that_no_corner_allows_it_slows_down_and_reaches_every_waypoint() -> None:
    """At 5 m/s it went round the third for hours."""
    way = sailed(preset("ice"), Orders(cruise_speed=5.0))
    assert (way.pilot.passed, way.pilot.status) == (6, ARRIVED)
    assert way.speed > 3.5


def test_a_turn_round_at_a_limited_rate_is_no_burst_of_speed() -> None:
    """At 0.3 m/s asked for, it gave 0.86 m/s: the craft moves about its drag point, a quarter of its length astern."""
    there_and_back = (Waypoint(60.0, 0.0), Waypoint(0.0, 5.0))
    assert sailed(Craft(), Orders(), (0.0, 0.2), there_and_back).speed < 0.65
    assert sailed(Craft(), Orders(turn_rate=0.03), (0.0, 0.2), there_and_back).speed < 0.45


@pytest.mark.parametrize(("thrust_min", "turned"), [(-10.0, False), (0.0, True)])
def test_on_ice_it_brakes_with_reverse_thrust_or_turned_round(thrust_min: float, turned: bool) -> None:
    """To a stand beside the last waypoint."""
    craft, course = replace(preset("ice"), thrust_min=thrust_min), (Waypoint(100.0, 0.0),)
    orders = Orders(cruise_speed=1.5, thrust_min=thrust_min, keep_station=1)
    state, least, furthest = State(y=1.0), 0.0, 0.0
    pilot = beginning(state)
    for _ in range(600):
        pilot, commands, _ = steer(pilot, state, course, orders, 0.5)
        state = advance(state, Controls(*commands), craft, 0.5, RK4).state
        least = min(least, commands.thrust)
        furthest = max(furthest, abs(state.heading) if pilot.passed == 0 else 0.0)
    assert (furthest > 2.0) == turned
    assert (least < -1.0) == (not turned)
    assert math.hypot(state.x - 100.0, state.y) < 10.0
    assert math.hypot(state.vx, state.vy) < 0.2


def test_at_the_end_it_drifts_or_keeps_its_station() -> None:
    wind, course = (0.1, 0.1), (Waypoint(30.0, 0.0),)
    assert sailed(Craft(), Orders(), wind, course, 600.0).pilot.status == ARRIVED
    kept = sailed(Craft(), Orders(keep_station=1), wind, course, 900.0)
    assert kept.pilot.status == ARRIVED
    assert math.hypot(kept.state.x - 30.0, kept.state.y) < 0.1
    assert math.hypot(kept.state.vx, kept.state.vy) < 1e-3


# ---- what it tells


def test_a_waypoint_that_no_turn_reaches_is_missed() -> None:
    """It went round the first one 169 times."""
    tiny = sailed(Craft(), Orders(acceptance_radius=0.001))
    assert tiny.pilot.passed == 6
    assert tiny.pilot.missed > 0
    assert tiny.pilot.status == ARRIVED | MISSED


def test_thrusters_that_slam_are_told_and_softer_gains_do_not() -> None:
    """A light craft in thin air at the default step: h*M*Q/I = 3 with the gains of the textbook craft."""
    light = replace(preset("ice"), mass=10.0, inertia=50.0)
    told = Orders(mass=10.0, inertia=50.0)
    for orders, status in ((Orders(), 0), (told, LONG_STEP)):
        stiff = replace(orders, heading_gain=1.5, yaw_rate_gain=10.0)
        slams = sailed(light, stiff, (0.0, 0.2), seconds=200.0, late=1, settings=FINE)
        assert slams.full > 0.5
        assert slams.pilot.status == status | SATURATED
    soft = sailed(light, told, (0.0, 0.2), late=1, settings=FINE)
    assert soft.full < 0.01
    assert soft.pilot.status == ARRIVED | LONG_STEP


def test_a_craft_that_is_carried_off_tells_it() -> None:
    orders, pilot = Orders(turn_back=1), beginning(State())
    furthest = orders.acceptance_radius + 2.0 * gains_for(orders, 0.5).lookahead
    for x, status in ((-furthest, 0), (-furthest - 0.1, AWAY), (0.0, AWAY)):
        pilot, _, _ = steer(pilot, State(x=x), [Waypoint(100.0, 0.0)], orders, 0.5)
        assert pilot.status == status


def test_without_thrusters_nothing_is_asked_for() -> None:
    pilot, commands, _ = steer(beginning(State()), State(), LONG, Orders(steering_force=0.0), 0.5)
    assert (commands, pilot.status) == (Commands(), NOTHING_TO_STEER)


# ---- gains


@pytest.mark.parametrize(
    "craft", [{}, {"mass": 1000.0, "inertia": 5000.0}, {"steering_force": 6.0, "length": 10.0, "inertia": 100.0}]
)
def test_gains_follow_from_the_craft_as_the_text_says(craft: dict[str, float]) -> None:
    """Critically damped: (s + w)^2 = s^2 + M*Q/I*s + M*P/I."""
    orders = Orders(**craft)  # type: ignore[arg-type]
    gains, w = gains_for(orders, 0.0), orders.frequency
    share = 0.5 * orders.length * orders.steering_force / orders.inertia
    assert gains.heading == pytest.approx(1.5)
    assert (share * gains.yaw_rate, share * gains.heading) == pytest.approx((2.0 * w, w * w))
    assert (gains.velocity, gains.lag) == pytest.approx((0.8 * orders.mass * w, 3.0 / w))
    if not craft:
        assert (w, gains.yaw_rate) == pytest.approx((0.3, 10.0))


def test_gains_that_are_given_are_taken_and_the_others_fit_the_communication_step() -> None:
    given = Orders(lookahead=20.0, velocity_gain=20.0, integral_time=30.0, heading_gain=1.5, yaw_rate_gain=10.0,
                   turn_rate=0.05)  # fmt: skip
    assert gains_for(given, 4.0) == (1.5, 10.0, 20.0, 30.0, 20.0, 0.05)
    for h in (0.5, 1.0, 2.0, 8.0):
        number = h * Orders().steering_moment * gains_for(Orders(), h).yaw_rate / Orders().inertia
        assert number == pytest.approx(min(STEP_PLANNED, 2.0 * 0.3 * h))


@pytest.mark.parametrize("value", [-1.0, math.nan, math.inf])
def test_an_impossible_order_is_refused(value: float) -> None:
    with pytest.raises(ValueError, match=rf"lookahead = {value!r} m: must be a finite number, 0 or greater"):
        Orders(lookahead=value)
    with pytest.raises(ValueError, match=rf"mass = {value!r} kg: must be a finite number greater than 0"):
        Orders(mass=value)


def test_orders_that_are_impossible_for_other_reasons_are_refused() -> None:
    with pytest.raises(ValueError, match=r"acceptance_radius = 0\.0 m: must be a finite number greater than 0"):
        Orders(acceptance_radius=0.0)
    with pytest.raises(ValueError, match=r"thrust_min = 1\.0 N: must be a finite number, 0 or less"):
        Orders(thrust_min=1.0)
    with pytest.raises(ValueError, match=r"turn_back = 2: must be 0 or 1"):
        check_order("turn_back", 2)
    with pytest.raises(ValueError, match=r"frequency = inf rad/s of the heading's loop: must be a finite number"):
        Orders(inertia=1e-300, steering_force=1e300)
