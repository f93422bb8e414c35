"""The control law: from where the craft is and how it moves to thrust and bow thrusters. Pure functions.

Frames and signs are the hovercraft's: y down, the heading grows to starboard. Three loops, each faster than the one
around it:

- Line of sight. On the leg from one waypoint to the next the craft is to go, at the cruise speed U, toward the point
  of the leg that lies the lookahead D further on, and no further than the waypoint (Fossen, Handbook of Marine Craft
  Hydrodynamics and Motion Control, 2011, chapter 10). A small cross-track error falls as e' = -U*e/D. Before a corner
  the speed goes down to what the propeller turns along an arc that begins at the acceptance radius, v^2 = a*r/tan(b/2)
  for a turn by b, and on the way there it is what can still be braked off, v^2 + 2*a*distance, with a = 0.3 of the
  largest thrust per mass; a craft that turns round to brake begins earlier by the way that it makes meanwhile.
- Velocity. The craft slides: its course is not its heading. So what is controlled is the velocity v over ground: the
  force that is wanted is K*(v_wanted - v) + p, cut to what the propeller has. p is the force that the craft was seen
  to need beside its inertia, behind a lag of the time T: p + T*p' = force - m*v' (a disturbance observer). It comes to
  hold the drag of the air, wind included, whatever the density is, is what makes the craft crab in a crosswind, and
  cannot wind up.
- Heading. The propeller pushes along the heading, so the bow goes where the force is wanted; the thrust is the force's
  part along the heading. The heading that is asked for changes at a limited rate. Steering is proportional to its error
  and to the yaw rate. One thruster at a time. To brake harder than drag does the propeller pushes astern where it can,
  else the craft turns round.

Gains that are 0 follow from the craft as the autopilot is told it (mass m, inertia I, steering moment
M = 0.5*length*steering_force) through one frequency w:

- Heading: I*psi'' = M*(P*error - Q*psi') has the frequency w, critically damped without any air, for P = I*w^2/M and
  Q = 2*I*w/M. w = sqrt(1.5*M/I) makes P = 1.5 1/rad: full steering from 38 degrees on. For the textbook craft
  (m = 100 kg, I = 500 kg.m2, M = 30 N.m) w = 0.3 rad/s and Q = 10 s/rad.
- The communication step h holds a command, and masters that step both parts side by side deliver it one step late: the
  loop is stable up to h*M*Q/I = 0.85 (see `STEP_LIMIT`), and w is at most 0.3/h, which is h*M*Q/I = 0.6.
- Velocity: K = 0.8*m*w, T = 3/w. Line of sight: D = 5*U/w, or half a length. The heading asked for changes by at most
  w/2, and 7*U a length.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import NamedTuple

from ..model.dynamics import State

AHEAD = 0.2
"""Of the largest thrust: the least force ahead that the heading is chosen for."""
BRAKE = 0.3
"""Of the largest thrust: a force astern beyond this is more than is left to the drag."""
SHARE = 0.3
"""Of the largest thrust: what turning and braking before a corner are planned with."""
DAMPED = 1.5
"""1/rad: bow thruster per error of the heading, where nothing else limits it."""
STEP_LIMIT = 0.85
"""1: h*M*Q/I, up to which the loop of the heading is stable with a command that is held and one step late."""
STEP_PLANNED = 0.6
"""1: the same, that gains which are not given keep to."""
CREEP = 0.1
"""Of the cruise speed: what is asked for at least."""
MINUTE = 60.0
"""s: the lag of what is told of the last minute."""
ARRIVED, MISSED, AWAY, CIRCLING, SATURATED, WIND, LONG_STEP, NOTHING_TO_STEER = (1 << bit for bit in range(8))
"""The bits of `Pilot.status`; each stays."""
UNITS_OF_ORDERS = {
    "acceptance_radius": "m",
    "cruise_speed": "m/s",
    "lookahead": "m",
    "velocity_gain": "kg/s",
    "integral_time": "s",
    "heading_gain": "1/rad",
    "yaw_rate_gain": "s/rad",
    "thrust_max": "N",
    "thrust_min": "N",
    "turn_rate": "rad/s",
    "mass": "kg",
    "inertia": "kg.m2",
    "length": "m",
    "steering_force": "N",
}
POSITIVE = ("acceptance_radius", "cruise_speed", "thrust_max", "mass", "inertia", "length")
CHOICES = ("turn_back", "keep_station")


@dataclass(frozen=True)
class Orders:
    """What the autopilot is told. Raises ValueError, with the name, the value and the rule, where one is impossible."""

    acceptance_radius: float = 10.0
    """m: a waypoint this near is reached."""
    cruise_speed: float = 0.3
    """m/s, over ground."""
    lookahead: float = 0.0
    """m; 0, here and below: follows from the craft."""
    velocity_gain: float = 0.0
    """kg/s: force per error of the velocity."""
    integral_time: float = 0.0
    """s: of the lag of the lasting part of that force."""
    heading_gain: float = 0.0
    """1/rad: bow thruster per error of the heading."""
    yaw_rate_gain: float = 0.0
    """s/rad: bow thruster per yaw rate."""
    thrust_max: float = 10.0
    """N."""
    thrust_min: float = 0.0
    """N; below 0: reverse thrust, to brake with."""
    turn_rate: float = 0.0
    """rad/s: of the heading asked for, at most."""
    mass: float = 100.0
    """kg, the craft's, as the next three."""
    inertia: float = 500.0
    """kg.m2."""
    length: float = 20.0
    """m: the bow thrusters push half of it ahead of the centre of gravity."""
    steering_force: float = 3.0
    """N, of one bow thruster; 0: there is nothing to steer with."""
    turn_back: int = 0
    """1: turn back to a waypoint that was missed; 0: leave it."""
    keep_station: int = 0
    """1: keep the place of the last waypoint; 0: everything off there."""

    def __post_init__(self) -> None:
        for field in fields(self):
            check_order(field.name, getattr(self, field.name))
        if not self.frequency < math.inf:
            raise ValueError(
                f"frequency = {self.frequency!r} rad/s of the heading's loop: must be a finite number; it is made of "
                "inertia, length, steering_force"
            )

    @cached_property
    def steering_moment(self) -> float:
        """N.m, of one bow thruster, full on."""
        return 0.5 * self.length * self.steering_force

    @cached_property
    def frequency(self) -> float:
        """rad/s, of the heading's loop; 0: nothing to steer with."""
        return math.sqrt(DAMPED * self.steering_moment / self.inertia)


def check_order(name: str, value: float) -> None:
    """Raises ValueError where a value alone is impossible."""
    if name in CHOICES:
        if value not in (0, 1):
            raise ValueError(f"{name} = {value!r}: must be 0 or 1")
        return
    if name in POSITIVE:
        good, rule = 0.0 < value < math.inf, "must be a finite number greater than 0"
    elif name == "thrust_min":
        good, rule = -math.inf < value <= 0.0, "must be a finite number, 0 or less"
    else:
        good, rule = 0.0 <= value < math.inf, "must be a finite number, 0 or greater"
    if not good:
        raise ValueError(f"{name} = {value!r} {UNITS_OF_ORDERS[name]}: {rule}")


class Waypoint(NamedTuple):
    """A point to reach, world frame."""

    x: float
    """m"""
    y: float
    """m, down the screen"""


class Pilot(NamedTuple):
    """What the autopilot remembers."""

    origin: Waypoint
    """Where the leg began: the waypoint before, or where the craft was at the start."""
    heading: float
    """rad, asked for"""
    x: float
    """m, of the sample before, as the next three"""
    y: float
    """m"""
    vx: float = 0.0
    """m/s"""
    vy: float = 0.0
    """m/s"""
    push_x: float = 0.0
    """N, the lasting part of the force, world frame"""
    push_y: float = 0.0
    """N"""
    swept: float = 0.0
    """rad, round the active waypoint"""
    saturated: float = 0.0
    """1, the share of the last minute with a thruster at its limit"""
    driven: float = 0.0
    """1, the share of the last minute in which the largest thrust made no way"""
    passed: int = 0
    """How many waypoints, reached or missed; the one after these is the active one."""
    missed: int = 0
    """How many of them were missed"""
    braking: int = 0
    """1: with the propeller"""
    status: int = 0
    """The sum of the bits that were set"""

    @property
    def turns(self) -> float:
        """1: round the active waypoint, clockwise on the screen."""
        return self.swept / (2.0 * math.pi)


def beginning(motion: State) -> Pilot:
    """The first leg begins where the craft is."""
    return Pilot(Waypoint(motion.x, motion.y), motion.heading, motion.x, motion.y, motion.vx, motion.vy)


class Gains(NamedTuple):
    """The constants of the three loops."""

    heading: float
    """1/rad"""
    yaw_rate: float
    """s/rad"""
    velocity: float
    """kg/s"""
    lag: float
    """s"""
    lookahead: float
    """m"""
    turn_rate: float
    """rad/s"""


class Commands(NamedTuple):
    """What the craft is told."""

    thrust: float = 0.0
    """N, the smallest to the largest"""
    port: float = 0.0
    """1, 0 to 1"""
    starboard: float = 0.0
    """1, 0 to 1; never both thrusters at once"""


class Sight(NamedTuple):
    """Where the craft is on its leg."""

    cross_track: float = 0.0
    """m, off the leg, to starboard"""
    distance: float = 0.0
    """m, to the active waypoint"""


class Leg(NamedTuple):
    """The straight line to the active waypoint, and where the craft is beside it."""

    x: float
    """1, a unit vector; 0 where the leg has no length"""
    y: float
    """1"""
    length: float
    """m"""
    left: float
    """m along it; negative beyond the perpendicular through the waypoint"""
    cross_track: float
    """m, off it, to starboard"""


class Way(NamedTuple):
    """Where to go from here."""

    x: float
    """1, a unit vector"""
    y: float
    """1"""
    speed: float
    """m/s"""


def steer(
    pilot: Pilot, motion: State, course: Sequence[Waypoint], orders: Orders, duration: float
) -> tuple[Pilot, Commands, Sight]:
    """One sample of the law, which then holds for `duration` [s]; 0 remembers nothing but waypoints that are passed.

    A motion that is out of range gives outputs that are no finite numbers.
    """
    pilot = pass_waypoints(pilot, motion, course, orders)
    gains = gains_for(orders, duration)
    arrived = pilot.passed >= len(course)
    active = course[-1] if arrived else course[pilot.passed]
    distance = _length(active.x - motion.x, active.y - motion.y)
    leg = leg_to(active if arrived else pilot.origin, active, motion)
    if arrived:
        way = to_station(active, motion, orders, gains)
    else:
        way = along(leg, speed_before_corner(leg, pilot, motion, course, orders, gains), gains)
    lasting = lasting_force(pilot, motion, orders, gains)
    commands = Commands()
    if orders.frequency > 0.0 and (orders.keep_station == 1 or not arrived):
        force = wanted_force(way, motion, lasting, orders, gains)
        if arrived:
            braking, to = 0, into_the_wind(motion, force, orders)
        else:
            braking, to = brakes(pilot, motion, way, force, orders, gains), way
        turn = wanted_turn(braking, motion, to, force, orders)
        pilot, commands = helm(pilot, motion, force, turn, orders, gains, duration)
        pilot = pilot._replace(braking=braking)
    if duration > 0.0:
        pilot = watch(pilot, motion, active, arrived, way, lasting, commands, orders, duration)
        pilot = learn(pilot, motion, lasting, commands, orders, gains, duration)
        seen = noticed(pilot, arrived, leg, distance, orders, gains, duration)
        pilot = pilot._replace(status=pilot.status | seen)
    return pilot, commands, Sight(leg.cross_track, distance)


# ---- where to go


def pass_waypoints(pilot: Pilot, motion: State, course: Sequence[Waypoint], orders: Orders) -> Pilot:
    """Waypoints that are near enough are reached, those that lie behind are missed: the next leg begins there."""
    while pilot.passed < len(course):
        active = course[pilot.passed]
        reached = _length(active.x - motion.x, active.y - motion.y) <= orders.acceptance_radius
        leg = leg_to(pilot.origin, active, motion)
        # a waypoint at the place of the one before is passed with it
        beyond = leg.length == 0.0 or (orders.turn_back == 0 and leg.left <= 0.0)
        if not (reached or beyond):
            return pilot
        missed = pilot.missed if reached else pilot.missed + 1
        pilot = pilot._replace(origin=active, passed=pilot.passed + 1, missed=missed, swept=0.0)
    return pilot


def leg_to(origin: Waypoint, active: Waypoint, motion: State) -> Leg:
    """From where it began to the waypoint."""
    x, y = active.x - origin.x, active.y - origin.y
    length = _length(x, y)
    if length == 0.0:
        return Leg(0.0, 0.0, 0.0, 0.0, 0.0)
    x, y = x / length, y / length
    gone_x, gone_y = motion.x - origin.x, motion.y - origin.y
    return Leg(x, y, length, length - (x * gone_x + y * gone_y), x * gone_y - y * gone_x)


def along(leg: Leg, speed: float, gains: Gains) -> Way:
    """Toward the point of the leg that lies ahead."""
    ahead = gains.lookahead if gains.lookahead < leg.left else leg.left
    x, y = ahead * leg.x + leg.cross_track * leg.y, ahead * leg.y - leg.cross_track * leg.x
    length = _length(x, y)
    if length == 0.0:
        return Way(leg.x, leg.y, speed)
    return Way(x / length, y / length, speed)


def to_station(station: Waypoint, motion: State, orders: Orders, gains: Gains) -> Way:
    """Toward the last waypoint, and the slower the nearer it is."""
    x, y = station.x - motion.x, station.y - motion.y
    distance = _length(x, y)
    if distance == 0.0:
        return Way(0.0, 0.0, 0.0)
    share = distance / gains.lookahead if distance < gains.lookahead else 1.0
    return Way(x / distance, y / distance, share * orders.cruise_speed)


def speed_before_corner(
    leg: Leg, pilot: Pilot, motion: State, course: Sequence[Waypoint], orders: Orders, gains: Gains
) -> float:
    """m/s: the cruise speed, or less where more cannot be braked down to what the propeller turns at the corner."""
    square = corner_square(leg, pilot, course, orders)
    room = leg.left - orders.acceptance_radius
    brake = orders.thrust_max
    if orders.thrust_min < 0.0:
        brake = -orders.thrust_min
    elif pilot.braking == 0:  # it turns round first
        half_turn = math.pi * _length(motion.vx, motion.vy)
        room = room - half_turn / gains.turn_rate if room * gains.turn_rate > half_turn else 0.0
    if room > 0.0:
        square = square + 2.0 * (SHARE * brake / orders.mass) * room
    speed = math.sqrt(square)
    return _held(speed, CREEP * orders.cruise_speed, orders.cruise_speed)


def corner_square(leg: Leg, pilot: Pilot, course: Sequence[Waypoint], orders: Orders) -> float:
    """m2/s2: the square of the speed that the next corner allows, v^2 = a*r/tan(b/2)."""
    if pilot.passed + 1 >= len(course):
        return 0.0 if orders.keep_station == 1 else math.inf
    active, after = course[pilot.passed], course[pilot.passed + 1]
    x, y = after.x - active.x, after.y - active.y
    length = _length(x, y)
    cosine = (leg.x * x + leg.y * y) / length if length > 0.0 else 1.0
    if cosine >= 1.0:
        return math.inf
    if cosine <= -1.0:
        return 0.0
    # 1/tan(b/2) by the half-angle formula
    return (
        SHARE * orders.thrust_max / orders.mass * orders.acceptance_radius * math.sqrt((1.0 + cosine) / (1.0 - cosine))
    )


# ---- how to go there


def gains_for(orders: Orders, duration: float) -> Gains:
    """Those that are given; those of the craft that are not, for a command that is held for `duration` [s]."""
    moment, frequency = orders.steering_moment, orders.frequency
    if frequency == 0.0:
        moment = frequency = 1.0  # nothing is steered
    if 2.0 * frequency * duration > STEP_PLANNED:
        frequency = 0.5 * STEP_PLANNED / duration
    turn_rate = 0.5 * frequency
    if turn_rate > 7.0 * orders.cruise_speed / orders.length:
        turn_rate = 7.0 * orders.cruise_speed / orders.length
    lookahead = 5.0 * orders.cruise_speed / frequency
    if lookahead < 0.5 * orders.length:
        lookahead = 0.5 * orders.length
    return Gains(
        heading=orders.heading_gain if orders.heading_gain > 0.0 else orders.inertia * frequency * frequency / moment,
        yaw_rate=orders.yaw_rate_gain if orders.yaw_rate_gain > 0.0 else 2.0 * orders.inertia * frequency / moment,
        velocity=orders.velocity_gain if orders.velocity_gain > 0.0 else 0.8 * orders.mass * frequency,
        lag=orders.integral_time if orders.integral_time > 0.0 else 3.0 / frequency,
        lookahead=orders.lookahead if orders.lookahead > 0.0 else lookahead,
        turn_rate=orders.turn_rate if orders.turn_rate > 0.0 else turn_rate,
    )


def lasting_force(pilot: Pilot, motion: State, orders: Orders, gains: Gains) -> tuple[float, float]:
    """N, world frame: what the craft was seen to need beside its inertia; see `learn`."""
    rate = orders.mass / gains.lag
    return pilot.push_x + rate * (pilot.vx - motion.vx), pilot.push_y + rate * (pilot.vy - motion.vy)


def wanted_force(
    way: Way, motion: State, lasting: tuple[float, float], orders: Orders, gains: Gains
) -> tuple[float, float]:
    """N, world frame: proportional to the error of the velocity, and lasting; cut to the largest thrust."""
    x = gains.velocity * (way.speed * way.x - motion.vx) + lasting[0]
    y = gains.velocity * (way.speed * way.y - motion.vy) + lasting[1]
    size = _length(x, y)
    if size <= orders.thrust_max:
        return x, y
    return x * (orders.thrust_max / size), y * (orders.thrust_max / size)


def into_the_wind(motion: State, force: tuple[float, float], orders: Orders) -> Way:
    """On station: the bow toward a force that is worth it, else where it is."""
    size = _length(force[0], force[1])
    if size > AHEAD * orders.thrust_max:
        return Way(force[0] / size, force[1] / size, 0.0)
    return Way(math.cos(motion.heading), math.sin(motion.heading), 0.0)


def brakes(pilot: Pilot, motion: State, way: Way, force: tuple[float, float], orders: Orders, gains: Gains) -> int:
    """1 where the propeller is to brake: until the force is wanted ahead again.

    It is not begun in the middle of a turn: while the bow swings, the craft moves about a point astern.
    """
    ahead = force[0] * way.x + force[1] * way.y
    if ahead > 0.0:
        return 0
    if ahead < -BRAKE * orders.thrust_max and abs(motion.yaw_rate) < 0.3 * gains.turn_rate:
        return 1
    return pilot.braking


def wanted_turn(braking: int, motion: State, way: Way, force: tuple[float, float], orders: Orders) -> float:
    """rad, from the heading that there is to the one that is wanted: the bow toward the force, or away from it."""
    push = -1.0 if braking == 1 else 1.0  # along the way, or against it
    bow = -1.0 if braking == 1 and orders.thrust_min >= 0.0 else 1.0  # turned round
    cosine, sine = math.cos(motion.heading), math.sin(motion.heading)
    x, y = bow * way.x, bow * way.y
    # which way round is decided by the direction to go alone: while the craft turns, its own motion swings the force
    # that is wanted, and with it the shorter way would swing to and fro
    across, abreast = cosine * y - sine * x, cosine * x + sine * y
    turn = math.atan2(across, abreast)
    if abreast <= 0.0:
        return turn
    ahead = push * (force[0] * way.x + force[1] * way.y)
    if ahead < AHEAD * orders.thrust_max:
        ahead = AHEAD * orders.thrust_max
    return turn + math.atan2(push * (force[1] * way.x - force[0] * way.y), ahead)


def helm(
    pilot: Pilot, motion: State, force: tuple[float, float], turn: float, orders: Orders, gains: Gains, duration: float
) -> tuple[Pilot, Commands]:
    """Thrust: the part of the wanted force along the heading. Steering: to the wanted heading, at a limited rate."""
    cosine, sine = math.cos(motion.heading), math.sin(motion.heading)
    asked_x, asked_y = math.cos(pilot.heading), math.sin(pilot.heading)
    error = math.atan2(cosine * asked_y - sine * asked_x, cosine * asked_x + sine * asked_y)
    most = gains.turn_rate * duration
    error = error + _held(turn - error, -most, most)
    steering = _held(gains.heading * error - gains.yaw_rate * motion.yaw_rate, -1.0, 1.0)
    thrust = _held(force[0] * cosine + force[1] * sine, orders.thrust_min, orders.thrust_max)
    commands = Commands(thrust, steering if steering > 0.0 else 0.0, -steering if steering < 0.0 else 0.0)
    return pilot._replace(heading=motion.heading + error), commands


# ---- what is remembered


def learn(
    pilot: Pilot,
    motion: State,
    lasting: tuple[float, float],
    commands: Commands,
    orders: Orders,
    gains: Gains,
    duration: float,
) -> Pilot:
    """The lasting force p comes from what the craft is told: p + T*p' = force - m*v'.

    With q = p + m*v/T this is q + T*q' = force + m*v/T, which needs no derivative of the velocity. What is kept is
    q - m*v/T, and the velocity v of this sample.
    """
    x, y = pushed(motion, commands, orders)
    share = _share(duration, gains.lag)
    return pilot._replace(
        push_x=lasting[0] + share * (x - lasting[0]),
        push_y=lasting[1] + share * (y - lasting[1]),
        x=motion.x,
        y=motion.y,
        vx=motion.vx,
        vy=motion.vy,
    )


def pushed(motion: State, commands: Commands, orders: Orders) -> tuple[float, float]:
    """N, world frame: what the craft is told to push with, thrusters and all."""
    cosine, sine = math.cos(motion.heading), math.sin(motion.heading)
    side = orders.steering_force * (commands.port - commands.starboard)
    return commands.thrust * cosine - side * sine, commands.thrust * sine + side * cosine


def watch(
    pilot: Pilot,
    motion: State,
    active: Waypoint,
    arrived: bool,
    way: Way,
    lasting: tuple[float, float],
    commands: Commands,
    orders: Orders,
    duration: float,
) -> Pilot:
    """How far round the waypoint; how much of the last minute a thruster was at its limit, and the thrust in vain."""
    from_x, from_y = pilot.x - active.x, pilot.y - active.y
    to_x, to_y = motion.x - active.x, motion.y - active.y
    swept = math.atan2(from_x * to_y - from_y * to_x, from_x * to_x + from_y * to_y)
    share = _share(duration, MINUTE)
    at_limit = 1.0 if commands.port >= 1.0 or commands.starboard >= 1.0 else 0.0
    needed = lasting[0] * way.x + lasting[1] * way.y
    made_good = motion.vx * way.x + motion.vy * way.y
    in_vain = 1.0 if needed >= 0.9 * orders.thrust_max and made_good < CREEP * orders.cruise_speed else 0.0
    return pilot._replace(
        swept=0.0 if arrived else pilot.swept + swept,
        saturated=pilot.saturated + share * (at_limit - pilot.saturated),
        driven=pilot.driven + share * (in_vain - pilot.driven),
    )


def noticed(
    pilot: Pilot, arrived: bool, leg: Leg, distance: float, orders: Orders, gains: Gains, duration: float
) -> int:
    """The bits of the status that are true now."""
    bits = 0
    if arrived:
        bits |= ARRIVED
    if pilot.missed > 0:
        bits |= MISSED
    drifts = arrived and orders.keep_station == 0
    if not drifts and distance > leg.length + orders.acceptance_radius + 2.0 * gains.lookahead:
        bits |= AWAY
    if abs(pilot.swept) >= 2.0 * math.pi:
        bits |= CIRCLING
    if pilot.saturated > 0.5:
        bits |= SATURATED
    if pilot.driven > 0.5:
        bits |= WIND
    if step_number(orders, duration) > STEP_LIMIT:
        bits |= LONG_STEP
    if orders.frequency == 0.0:
        bits |= NOTHING_TO_STEER
    return bits


def step_number(orders: Orders, duration: float) -> float:
    """1: h*M*Q/I, with the gain that is given, or the one that the craft could have."""
    if orders.yaw_rate_gain > 0.0:
        return duration * (orders.steering_moment / orders.inertia) * orders.yaw_rate_gain
    return 2.0 * orders.frequency * duration


def _share(duration: float, lag: float) -> float:
    """1: of the way to its end that a lag goes; the exponential to the second order, without it. 1 for a long time."""
    z = duration / lag
    return 1.0 - 1.0 / (1.0 + z * (1.0 + 0.5 * z))


def _length(x: float, y: float) -> float:
    """Of a vector; without overflow, and 0 or infinite only where it is."""
    larger = abs(x) if abs(x) > abs(y) else abs(y)
    if not 0.0 < larger < math.inf:
        return larger
    x, y = x / larger, y / larger
    return larger * math.sqrt(x * x + y * y)


def _held(value: float, low: float, high: float) -> float:
    """In this order a NaN stays one."""
    return low if value < low else high if value > high else value
