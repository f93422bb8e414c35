"""State, controls, loads, derivatives, energy: pure functions.

Every function takes plain floats, or numpy arrays for a batch of craft; `ns` is where sine, cosine and square root
come from: `math` or `numpy`. The order of operations decides the last bits and is the same in every language.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias, cast

from .craft import DIRECTIONAL, Craft, any_of

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
    wind_x: float = 0.0
    """m/s, world frame: the velocity of the air"""
    wind_y: float = 0.0
    """m/s, world frame"""


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
"""(heading, vx, vy, yaw rate) -> (x, y, moment, k*q): loads, times two factors, and the drag per air speed [kg/s]."""
Friction: TypeAlias = Callable[[float, float, float], tuple[float, float, float]]
"""(vx, vy, yaw rate) as they would be without friction -> with it."""


def saturate(controls: Controls, craft: Craft, ns: Namespace = math) -> Controls:
    """The controls held inside their limits: thrust in the craft's, thruster commands from 0 to 1."""
    clip = _clip if ns is math else ns.clip
    return Controls(
        clip(controls.thrust, craft.thrust_min, craft.thrust_max),
        clip(controls.port, 0.0, 1.0),
        clip(controls.starboard, 0.0, 1.0),
        controls.wind_x,
        controls.wind_y,
    )


def _clip(value: float, low: float, high: float) -> float:
    """numpy.clip for one float."""
    return low if value < low else high if value > high else value


def actuation(controls: Controls, craft: Craft, ns: Namespace = math) -> tuple[float, float, float]:
    """Thrust [N], side force of both bow thrusters [N, to starboard] and their moment [N.m], after saturation."""
    thrust, port, starboard, _, _ = saturate(controls, craft, ns)
    return thrust, craft.steering_force * (port - starboard), craft.thruster_moment * (port - starboard)


def windy(controls: Controls) -> bool:
    """Whether the air moves, for any of the craft."""
    return any_of(controls.wind_x) or any_of(controls.wind_y)


def load_function(
    controls: Controls, craft: Craft, per_mass: float = 1.0, per_inertia: float = 1.0, ns: Namespace = math
) -> LoadFunction:
    """The loads on the craft, but for the friction of its skirt, as a function of its motion alone.

    Forces are times `per_mass`, moments times `per_inertia`: 1/m and 1/I for the accelerations; h/m and h/I for what
    they add to the velocities in the time h.

    For controls that hold. All that does not change from sub-step to sub-step is worked out here, once, so that no
    division stands in a loop; a function that closes over the constants costs half of one that unpacks them each time.
    What the scene does not ask for costs nothing: the default's drag, and none at all, have functions of their own,
    with the bits of the general one.
    """
    if ns is math and craft.drag_factor == 0.0:
        return _without_drag(controls, craft, per_mass, per_inertia)
    if craft.plain_drag and not windy(controls):
        return _with_plain_drag(controls, craft, per_mass, per_inertia, ns)
    return _with_any_drag(controls, craft, per_mass, per_inertia, ns)


def _pushes(
    controls: Controls, craft: Craft, per_mass: float, per_inertia: float, ns: Namespace
) -> tuple[float, float, float]:
    """`actuation` times the factors."""
    thrust, side, turn = actuation(controls, craft, ns)
    return thrust * per_mass, side * per_mass, turn * per_inertia


def _with_plain_drag(
    controls: Controls, craft: Craft, per_mass: float, per_inertia: float, ns: Namespace
) -> LoadFunction:
    cos, sin, sqrt = ns.cos, ns.sin, ns.sqrt
    k, x_d = craft.drag_factor, craft.drag_center
    drag, turning_drag = k * per_mass, k * x_d * per_inertia
    thrust, side, turn = _pushes(controls, craft, per_mass, per_inertia, ns)

    def loads_at(heading: float, vx: float, vy: float, yaw_rate: float) -> tuple[float, float, float, float]:
        c = cos(heading)
        s = sin(heading)
        # (u, w): velocity of the centre of drag through the air, body frame. Its size q times the velocity itself
        # is the drag's direction and square law at once: no division, and exactly zero at rest.
        u = c * vx + s * vy
        w = c * vy - s * vx + yaw_rate * x_d
        q = sqrt(u * u + w * w)
        ahead = thrust - drag * u * q
        abeam = side - drag * w * q
        return c * ahead - s * abeam, s * ahead + c * abeam, turn - turning_drag * w * q, k * q

    return loads_at


def air_speed(heading: float, vx: float, vy: float, yaw_rate: float, x_d: float) -> float:
    """m/s: of the centre of drag, in air at rest."""
    c = math.cos(heading)
    s = math.sin(heading)
    u = c * vx + s * vy
    w = c * vy - s * vx + yaw_rate * x_d
    return math.sqrt(u * u + w * w)


def _without_drag(controls: Controls, craft: Craft, per_mass: float, per_inertia: float) -> LoadFunction:
    """One craft only."""
    cos, sin = math.cos, math.sin
    thrust, side, turn = _pushes(controls, craft, per_mass, per_inertia, math)

    def loads_at(heading: float, _vx: float, _vy: float, _yaw_rate: float) -> tuple[float, float, float, float]:
        c = cos(heading)
        s = sin(heading)
        return c * thrust - s * side, s * thrust + c * side, turn, 0.0

    return loads_at


def _with_any_drag(
    controls: Controls, craft: Craft, per_mass: float, per_inertia: float, ns: Namespace
) -> LoadFunction:
    """Drag in wind, of constant or directional area, and with a moment of its own.

    Air that comes from the direction (u, w)/q sees the box with the area H*(W*|u| + L*|w|)/q: its walls stand square,
    and each shows the cosine of its angle to the air. Times q, that is the drag per air speed, without a square root:
    it takes the place of q, and k is 1.
    """
    cos, sin, sqrt = ns.cos, ns.sin, ns.sqrt
    directional = craft.drag_area == DIRECTIONAL
    factor_ahead, factor_abeam = craft.drag_factor_ahead, craft.drag_factor_abeam
    x_d, spin = craft.drag_center, craft.spin_drag_factor * per_inertia
    single, wind_x, wind_y = ns is math, controls.wind_x, controls.wind_y
    k = (1.0 if directional else craft.drag_factor) if single else ns.where(directional, 1.0, craft.drag_factor)
    drag, turning_drag = k * per_mass, k * x_d * per_inertia
    thrust, side, turn = _pushes(controls, craft, per_mass, per_inertia, ns)

    def loads_at(heading: float, vx: float, vy: float, yaw_rate: float) -> tuple[float, float, float, float]:
        c = cos(heading)
        s = sin(heading)
        air_x = vx - wind_x
        air_y = vy - wind_y
        u = c * air_x + s * air_y
        w = c * air_y - s * air_x + yaw_rate * x_d
        if not single:
            q = ns.where(directional, factor_ahead * abs(u) + factor_abeam * abs(w), sqrt(u * u + w * w))
        elif directional:
            q = factor_ahead * abs(u) + factor_abeam * abs(w)
        else:
            q = sqrt(u * u + w * w)
        ahead = thrust - drag * u * q
        abeam = side - drag * w * q
        moment = turn - turning_drag * w * q - spin * yaw_rate * abs(yaw_rate)
        return c * ahead - s * abeam, s * ahead + c * abeam, moment, k * q

    return loads_at


# ---- friction between skirt and ground
#
# The skirt presses evenly on its L x W rectangle. Sliding, ground and skirt oppose every motion as much as they can: of
# all forces and moments (F, M) that friction can give, the one that takes away the most energy (maximum dissipation:
# Goyal, Ruina, Papadopoulos, Planar sliding with dry friction, Wear 143, 1991). The set of all that it can give is
# taken as the ellipsoid (F/F_max)^2 + (M/M_max)^2 <= 1 (Howe, Cutkosky, Practical force-motion models for sliding
# manipulation, IJRR 15, 1996), with the two exact axes: F_max = mu*m*g, of sliding straight, and M_max = F_max*rho,
# of spinning on the spot, where rho is the mean distance of the rectangle's points from its centre. So with the slip
# speed q = sqrt(v^2 + (rho*r)^2):  F = -F_max*v/q,  M = -F_max*rho^2*r/q.


def friction_radius(craft: Craft, ns: Namespace = math) -> float:
    """m: rho, the mean distance of the points of the L x W rectangle from its centre.

    With the diagonal d: d/6 + (L^2/W*ln((W + d)/L) + W^2/L*ln((L + d)/W))/12, the integral of the distance over the
    rectangle, cut into eight right triangles with a corner in the centre.
    """
    length, width = craft.length, craft.width
    d = ns.sqrt(length * length + width * width)
    along = length * length / width * ns.log((width + d) / length)
    across = width * width / length * ns.log((length + d) / width)
    return cast(float, d / 6 + (along + across) / 12)


def slip_speed(vx: float, vy: float, turning: float, ns: Namespace = math) -> float:
    """m/s: q, from the velocity and rho*r."""
    return cast(float, ns.sqrt(vx * vx + vy * vy + turning * turning))


LEAST_SLIP = 1e-150
"""m/s: so that at rest nothing is divided by zero."""


def sliding_load_function(
    controls: Controls, craft: Craft, per_mass: float = 1.0, per_inertia: float = 1.0, ns: Namespace = math
) -> LoadFunction:
    """All loads on a craft that slides: those of `load_function`, and friction."""
    free = load_function(controls, craft, per_mass, per_inertia, ns)
    radius = friction_radius(craft, ns)
    grip, turning_grip = craft.friction_force * per_mass, craft.friction_force * radius * per_inertia
    larger = max if ns is math else ns.fmax

    def loads_at(heading: float, vx: float, vy: float, yaw_rate: float) -> tuple[float, float, float, float]:
        x, y, moment, kq = free(heading, vx, vy, yaw_rate)
        turning = radius * yaw_rate
        slowness = 1.0 / larger(slip_speed(vx, vy, turning, ns), LEAST_SLIP)
        return (
            x - grip * slowness * vx,
            y - grip * slowness * vy,
            moment - turning_grip * slowness * turning,
            kq,
        )

    return loads_at


def friction_gains(craft: Craft, h: float, ns: Namespace = math) -> tuple[float, float]:
    """m/s: how much of v, and of rho*r, friction can take away in the time h [s]: F_max*h/m and F_max*rho^2*h/I."""
    radius = friction_radius(craft, ns)
    force = craft.friction_force
    return h * (force / craft.mass), h * (force * radius * radius / craft.inertia)


NEWTON = 30
"""The most iterations; three or four are made."""


def friction_function(craft: Craft, h: float, ns: Namespace = math) -> Friction:
    """What friction makes, in the time h [s], of velocities that were reached without it: an implicit step.

    With a and b of `friction_gains`, and q the slip speed at the end, v' = v - a*v'/q and r' = r - b*r'/q, so
    v' = v*q/(q + a), r' = r*q/(q + b), where q solves (v/(q + a))^2 + (rho*r/(q + b))^2 = 1. Where the left side is at
    most 1 at q = 0, friction holds: the craft is at rest, exactly, whatever h is. Else Newton's method on the left
    side's reciprocal square root, nearly a straight line: from the left of the root it climbs to it and never beyond
    (More, Sorensen, Computing a trust region step, 1983). It never adds energy, and never turns a motion round.
    """
    a, b = friction_gains(craft, h, ns)
    radius = friction_radius(craft, ns)
    single = ns is math
    larger, sqrt, slowest = max if single else ns.fmax, ns.sqrt, (max if single else ns.fmax)(a, b)

    def rubbed(vx: float, vy: float, yaw_rate: float) -> tuple[float, float, float]:
        turning = radius * yaw_rate
        straight, turned = vx * vx + vy * vy, turning * turning
        holds = straight * (b * b) + turned * (a * a) <= (a * a) * (b * b)
        if single and holds:
            return 0.0, 0.0, 0.0
        if not single:  # of those at rest, or without friction, nothing is left to solve
            straight, turned = ns.where(holds, 1.0, straight), ns.where(holds, 1.0, turned)
        q = larger(sqrt(straight + turned) - slowest, 0.0)
        for _ in range(NEWTON):
            of_v, of_r = q + a, q + b
            part_v, part_r = straight / (of_v * of_v), turned / (of_r * of_r)
            size = part_v + part_r
            new = q + size * (sqrt(size) - 1.0) / (part_v / of_v + part_r / of_r)
            if not (new > q if single else ns.any(new > q)):
                break
            q = larger(q, new)
        of_v, of_r = q / (q + a), q / (q + b)
        if not single:
            left = ns.where(a > 0.0, 0.0, 1.0)
            of_v, of_r = ns.where(holds, left, of_v), ns.where(holds, left, of_r)
        return vx * of_v, vy * of_v, yaw_rate * of_r

    return rubbed


def loads(state: State, controls: Controls, craft: Craft, ns: Namespace = math) -> Loads:
    """Force [N, world frame] and moment [N.m] on the craft: thrust, bow thrusters, air drag and friction."""
    if not craft.rubs:
        return Loads(*load_function(controls, craft, ns=ns)(*state[2:])[:3])
    sliding = Loads(*sliding_load_function(controls, craft, ns=ns)(*state[2:])[:3])
    at_rest = (state.vx == 0.0) & (state.vy == 0.0) & (state.yaw_rate == 0.0)
    if ns is math:
        return _loads_at_rest(state, controls, craft, ns) if at_rest else sliding
    held = _loads_at_rest(state, controls, craft, ns)
    return Loads(*(ns.where(at_rest, still, moving) for still, moving in zip(held, sliding, strict=True)))


def _loads_at_rest(state: State, controls: Controls, craft: Craft, ns: Namespace) -> Loads:
    """What friction leaves of a push on a craft at rest: its implicit step from rest, over any time, gives the rate."""
    force_x, force_y, moment, _ = load_function(controls, craft, ns=ns)(*state[2:])
    rate = friction_function(craft, 1.0, ns)
    ax, ay, turning = rate(force_x / craft.mass, force_y / craft.mass, moment / craft.inertia)
    return Loads(craft.mass * ax, craft.mass * ay, craft.inertia * turning)


def drag_per_speed(state: State, controls: Controls, craft: Craft, ns: Namespace = math) -> float:
    """k*q [kg/s]: the drag per air speed of the centre of drag."""
    return load_function(controls, craft, ns=ns)(*state[2:])[3]


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
