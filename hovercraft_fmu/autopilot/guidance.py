"""The control law: from where the craft is and how it moves to thrust and bow thrusters. Pure functions.

Frames and signs are the hovercraft's: y down, the heading grows to starboard. Three loops, each faster than the one
around it:

- Line of sight. On the leg from one waypoint to the next the craft is to go, at the cruise speed U, toward the point
  of the leg that lies the lookahead D further on, and no further than the waypoint (Fossen, Handbook of Marine Craft
  Hydrodynamics and Motion Control, 2011, chapter 10). A small cross-track error falls as e' = -U*e/D.
- Velocity. The craft slides: its course is not its heading. So what is controlled is the velocity v over ground: the
  force that is wanted is K*(v_wanted - v) + p, cut to what the propeller has. Its integral part p is that cut force
  behind a lag of the time T, p' = (force - p)/T: integral action as automatic reset, which cannot wind up (Astrom,
  Hagglund, PID Controllers, 1995, chapter 3). It comes to hold the drag of the air, wind included, whatever the mass
  and the density are, and is what makes the craft crab in a crosswind.
- Heading. The propeller pushes along the heading, so the bow goes where the force is wanted; the thrust is the force's
  part along the heading. Steering is proportional to the heading error and to the yaw rate. One thruster at a time.
  A force that is wanted behind the craft is left to the drag: the bow stays within 90 degrees of the way to go.

The start values of the gains are for the textbook craft (m = 100 kg, I = 500 kg.m2, k = 57.4 kg/m; steering moment
M = 0.5*20 m*3 N = 30 N.m):

- Heading: I*psi'' = M*(P*error - Q*psi') has the frequency w = 0.3 rad/s, critically damped without any air, for
  P = I*w^2/M = 1.5 1/rad and Q = 2*I*w/M = 10 s/rad. The air adds damping. Full steering from 38 degrees on.
- Velocity: abeam m*v' = F - k*U*v, where F follows the heading, w^2/(s + w)^2. With K = 20 kg/s and T = 30 s the loop
  K*(1 + 1/(T*s))/(m*s + k*U)*w^2/(s + w)^2 crosses 1 at 0.09 rad/s, a third of w, with 98 degrees of phase left.
- Line of sight: D = 20 m, one length, at U = 0.3 m/s is 0.015 rad/s, a sixth of that.
- U = 0.3 m/s is 7/10 of the top speed: what is left is for the wind.

Half or twice the mass moves that crossing to 0.11 or 0.06 rad/s, and leaves 103 or 92 degrees.

The native autopilot is the same functions in C, in the same order of operations, equal to the bit with libm. So the law
is made of + - * /, sqrt, sin, cos and atan2 alone (Python's hypot is none of libm's), and of `round` to the nearest.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

from ..model.dynamics import State

AHEAD = 0.2
"""Of the largest thrust: the least force ahead that the heading is chosen for, so that it does not turn round to
brake."""
TURN = 2.0 * math.pi
UNITS_OF_GAINS = {
    "acceptance_radius": "m",
    "cruise_speed": "m/s",
    "lookahead": "m",
    "velocity_gain": "kg/s",
    "integral_time": "s",
    "heading_gain": "1/rad",
    "yaw_rate_gain": "s/rad",
    "thrust_max": "N",
}


@dataclass(frozen=True)
class Gains:
    """The constants of the law. Raises ValueError, with the name, the value and the rule, where one is impossible."""

    acceptance_radius: float = 10.0
    """m: a waypoint this near is reached."""
    cruise_speed: float = 0.3
    """m/s, over ground."""
    lookahead: float = 20.0
    """m."""
    velocity_gain: float = 20.0
    """kg/s: force per error of the velocity."""
    integral_time: float = 30.0
    """s."""
    heading_gain: float = 1.5
    """1/rad: bow thruster per error of the heading."""
    yaw_rate_gain: float = 10.0
    """s/rad: bow thruster per yaw rate."""
    thrust_max: float = 10.0
    """N."""

    def __post_init__(self) -> None:
        for field in fields(self):
            check_gain(field.name, getattr(self, field.name))


def check_gain(name: str, value: float) -> None:
    """Raises ValueError unless it is a finite number greater than 0."""
    if not 0.0 < value < math.inf:
        raise ValueError(f"{name} = {value!r} {UNITS_OF_GAINS[name]}: must be a finite number greater than 0")


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
    reached: int = 0
    """How many waypoints; the one after these is the active one."""
    push_x: float = 0.0
    """N, the integral part of the force, world frame"""
    push_y: float = 0.0
    """N"""


class Commands(NamedTuple):
    """What the craft is told."""

    thrust: float = 0.0
    """N, 0 to the largest"""
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


def steer(
    pilot: Pilot, motion: State, course: Sequence[Waypoint], gains: Gains, duration: float
) -> tuple[Pilot, Commands, Sight]:
    """One sample of the law, which then holds for `duration` [s]; 0 remembers nothing but waypoints that are reached.

    Raises:
        ValueError: so far away that the distance is no finite number.
    """
    pilot = _look_ahead(pilot, motion, course, gains.acceptance_radius)
    if pilot.reached == len(course):
        return pilot, Commands(), Sight(0.0, _distance(motion, course[-1]))
    active = course[pilot.reached]
    cross_track, wanted = line_of_sight(pilot.origin, active, motion, gains)
    force_x, force_y = wanted_force(pilot, motion, wanted, gains)
    share = lag(duration / gains.integral_time)
    pilot = pilot._replace(
        push_x=pilot.push_x + share * (force_x - pilot.push_x), push_y=pilot.push_y + share * (force_y - pilot.push_y)
    )
    commands = helm((force_x, force_y), wanted, motion, gains)
    return pilot, commands, Sight(cross_track, _distance(motion, active))


def _look_ahead(pilot: Pilot, motion: State, course: Sequence[Waypoint], radius: float) -> Pilot:
    """Waypoints that are near enough are reached: the next leg begins there."""
    while pilot.reached < len(course) and _distance(motion, course[pilot.reached]) <= radius:
        pilot = pilot._replace(origin=course[pilot.reached], reached=pilot.reached + 1)
    return pilot


def line_of_sight(origin: Waypoint, active: Waypoint, motion: State, gains: Gains) -> tuple[float, Waypoint]:
    """The cross-track error [m], and the direction to go: a unit vector."""
    along_x, along_y, length = _unit(active.x - origin.x, active.y - origin.y)
    x, y = motion.x - origin.x, motion.y - origin.y
    cross_track = along_x * y - along_y * x
    ahead = min(gains.lookahead, length - (along_x * x + along_y * y))
    to_x, to_y, _ = _unit(ahead * along_x + cross_track * along_y, ahead * along_y - cross_track * along_x)
    return cross_track, Waypoint(to_x, to_y)


def wanted_force(pilot: Pilot, motion: State, wanted: Waypoint, gains: Gains) -> tuple[float, float]:
    """N, world frame: proportional and integral, cut to the largest thrust."""
    force_x = gains.velocity_gain * (gains.cruise_speed * wanted.x - motion.vx) + pilot.push_x
    force_y = gains.velocity_gain * (gains.cruise_speed * wanted.y - motion.vy) + pilot.push_y
    size = length_of(force_x, force_y)
    share = gains.thrust_max / size if size > gains.thrust_max else 1.0
    return share * force_x, share * force_y


def helm(force: tuple[float, float], wanted: Waypoint, motion: State, gains: Gains) -> Commands:
    """Thrust: the part of the force along the heading. Steering: toward the force, but never round to brake."""
    force_x, force_y = force
    ahead = max(force_x * wanted.x + force_y * wanted.y, AHEAD * gains.thrust_max)
    aside = force_y * wanted.x - force_x * wanted.y
    # which way round is decided by the direction to go alone: while the craft turns, the side force of the bow
    # thruster swings the force that is wanted, and with it the shorter way would swing to and fro
    turn = within_half_a_turn(math.atan2(wanted.y, wanted.x) - motion.heading)
    error = turn + math.atan2(aside, ahead)
    steering = _held(gains.heading_gain * error - gains.yaw_rate_gain * motion.yaw_rate, -1.0, 1.0)
    thrust = force_x * math.cos(motion.heading) + force_y * math.sin(motion.heading)
    return Commands(_held(thrust, 0.0, gains.thrust_max), max(steering, 0.0), max(-steering, 0.0))


def lag(z: float) -> float:
    """The share of the way that a lag goes in z time constants: 1 - exp(-z), by the Pade approximation (0,2) of the
    exponential; from 0 to 1 however long it is.
    """
    grown = z * (1.0 + 0.5 * z)
    return grown / (1.0 + grown) if grown < math.inf else 1.0


def length_of(x: float, y: float) -> float:
    """Of a vector; infinite where its square is."""
    return math.sqrt(x * x + y * y)


def within_half_a_turn(angle: float) -> float:
    """rad: the same direction, from -pi to pi."""
    return angle - TURN * round(angle / TURN)


def _unit(x: float, y: float) -> tuple[float, float, float]:
    """The unit vector, and the length [m]."""
    length = length_of(x, y)
    if not 0.0 < length < math.inf:
        raise ValueError(f"a leg of {length!r} m: must be a finite length greater than 0; the pose is out of range")
    return x / length, y / length, length


def _distance(motion: State, waypoint: Waypoint) -> float:
    return length_of(waypoint.x - motion.x, waypoint.y - motion.y)


def _held(value: float, low: float, high: float) -> float:
    """In this order a NaN stays one."""
    return min(max(value, low), high)
