"""State, controls, loads, derivatives, energy: pure functions.

Every function takes plain floats, or numpy arrays for a batch of craft; `ns` is where sine, cosine and square root
come from: `math` or `numpy`. The order of operations decides the last bits and is the same in every language.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

from .craft import Craft

Namespace: TypeAlias = Any
"""`math` for floats; for arrays `numpy`, or a module with its sin, cos, sqrt and clip."""


class State(NamedTuple):
    """Where the craft is and how it moves. World frame: x right, y down, heading from +x toward +y."""

    x: float = 0.0
    """m"""
    y: float = 0.0
    """m"""
    heading: float = 0.0
    """rad, unwrapped"""
    vx: float = 0.0
    """m/s, world frame"""
    vy: float = 0.0
    """m/s, world frame"""
    yaw_rate: float = 0.0
    """rad/s"""


class Controls(NamedTuple):
    """What the operator asks for; the loads saturate it."""

    thrust: float = 5.0
    """N"""
    port: float = 0.0
    """1, from 0 (off) to 1 (full); pushes the bow to starboard"""
    starboard: float = 0.0
    """1, from 0 (off) to 1 (full); pushes the bow to port"""


class Loads(NamedTuple):
    """Force in the world frame and moment about the centre of gravity."""

    x: float
    """N"""
    y: float
    """N"""
    moment: float
    """N.m"""


class Derivatives(NamedTuple):
    """The rate of change of every component of the state, in its order."""

    x: float
    """m/s"""
    y: float
    """m/s"""
    heading: float
    """rad/s"""
    vx: float
    """m/s2"""
    vy: float
    """m/s2"""
    yaw_rate: float
    """rad/s2"""


LoadFunction: TypeAlias = Callable[[float, float, float, float], tuple[float, float, float, float]]
"""(heading, vx, vy, yaw rate) -> (force x, force y, moment, k*q): the loads, and the drag per air speed [kg/s]."""


def saturate(controls: Controls, craft: Craft, ns: Namespace = math) -> Controls:
    """The controls held inside their limits: thrust in the craft's, thruster commands from 0 to 1."""
    clip = _clip if ns is math else ns.clip
    return Controls(
        clip(controls.thrust, craft.thrust_min, craft.thrust_max),
        clip(controls.port, 0.0, 1.0),
        clip(controls.starboard, 0.0, 1.0),
    )


def _clip(value: float, low: float, high: float) -> float:
    """numpy.clip for one float."""
    return low if value < low else high if value > high else value


def actuation(controls: Controls, craft: Craft, ns: Namespace = math) -> tuple[float, float, float]:
    """Thrust [N], side force of both bow thrusters [N, to starboard] and their moment [N.m], after saturation."""
    thrust, port, starboard = saturate(controls, craft, ns)
    return thrust, craft.steering_force * (port - starboard), craft.thruster_moment * (port - starboard)


def load_function(controls: Controls, craft: Craft, ns: Namespace = math) -> LoadFunction:
    """The loads on the craft as a function of its motion alone, for controls that hold.

    All that does not change from sub-step to sub-step is worked out here, once; a function that closes over the
    constants costs half of one that unpacks them each time.
    """
    cos, sin, sqrt = ns.cos, ns.sin, ns.sqrt
    k, x_d = craft.drag_factor, craft.drag_center
    thrust, side, turn = actuation(controls, craft, ns)

    def loads_at(heading: float, vx: float, vy: float, yaw_rate: float) -> tuple[float, float, float, float]:
        c = cos(heading)
        s = sin(heading)
        # (u, w): velocity of the centre of drag through the air, body frame. Its size q times the velocity itself
        # is the drag's direction and square law at once: no division, and exactly zero at rest.
        u = c * vx + s * vy
        w = c * vy - s * vx + yaw_rate * x_d
        kq = k * sqrt(u * u + w * w)
        drag_y = -kq * w
        force_x = thrust - kq * u
        force_y = drag_y + side
        return c * force_x - s * force_y, s * force_x + c * force_y, x_d * drag_y + turn, kq

    return loads_at


def loads(state: State, controls: Controls, craft: Craft, ns: Namespace = math) -> Loads:
    """Force [N, world frame] and moment [N.m] on the craft: thrust, bow thrusters and air drag."""
    return Loads(*load_function(controls, craft, ns)(*state[2:])[:3])


def drag_per_speed(state: State, craft: Craft, ns: Namespace = math) -> float:
    """k*q [kg/s]: the drag per air speed of the centre of drag."""
    return load_function(Controls(), craft, ns)(*state[2:])[3]


def derivatives(state: State, controls: Controls, craft: Craft, ns: Namespace = math) -> Derivatives:
    """The equations of motion: m*dv/dt = force, I*dr/dt = moment, d(pose)/dt = velocity (Newton, Euler)."""
    force_x, force_y, moment = loads(state, controls, craft, ns)
    return Derivatives(
        state.vx, state.vy, state.yaw_rate, force_x / craft.mass, force_y / craft.mass, moment / craft.inertia
    )


def body_velocity(state: State, ns: Namespace = math) -> tuple[float, float]:
    """Surge and sway [m/s]: the velocity of the centre of gravity in the body frame."""
    _, _, heading, vx, vy, _ = state
    c = ns.cos(heading)
    s = ns.sin(heading)
    return c * vx + s * vy, c * vy - s * vx


def kinetic_energy(state: State, craft: Craft) -> float:
    """J: of translation and rotation."""
    speed_squared = state.vx * state.vx + state.vy * state.vy
    return 0.5 * craft.mass * speed_squared + 0.5 * craft.inertia * state.yaw_rate * state.yaw_rate
