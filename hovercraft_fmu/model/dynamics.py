"""State, controls, loads, derivatives, energy: pure functions of plain floats.

The order of operations decides the last bits and is the same in every language.
"""

import math
from collections.abc import Callable
from typing import NamedTuple, TypeAlias

from .craft import DIRECTIONAL, Craft


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
    external_force_x: float = 0.0
    """N, world frame: of what else a scene has, through the centre of gravity"""
    external_force_y: float = 0.0
    """N, world frame"""
    external_moment: float = 0.0
    """N.m, about the centre of gravity"""


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


def saturate(controls: Controls, craft: Craft) -> Controls:
    """The controls held inside their limits: thrust in the craft's, thruster commands from 0 to 1."""
    return Controls(
        _clip(controls.thrust, craft.thrust_min, craft.thrust_max),
        _clip(controls.port, 0.0, 1.0),
        _clip(controls.starboard, 0.0, 1.0),
        *controls[3:],
    )


def _clip(value: float, low: float, high: float) -> float:
    return low if value < low else high if value > high else value


def actuation(controls: Controls, craft: Craft) -> tuple[float, float, float]:
    """Thrust [N], side force of both bow thrusters [N, to starboard] and their moment [N.m], after saturation."""
    thrust, port, starboard = saturate(controls, craft)[:3]
    return thrust, craft.steering_force * (port - starboard), craft.thruster_moment * (port - starboard)


def windy(controls: Controls) -> bool:
    """Whether the air moves."""
    return controls.wind_x != 0.0 or controls.wind_y != 0.0


def pushed(controls: Controls) -> bool:
    """Whether there are loads from outside."""
    return controls.external_force_x != 0.0 or controls.external_force_y != 0.0 or controls.external_moment != 0.0


def load_function(controls: Controls, craft: Craft, per_mass: float = 1.0, per_inertia: float = 1.0) -> LoadFunction:
    """The loads on the craft, but for the friction of its skirt, as a function of its motion alone.

    Forces are times `per_mass`, moments times `per_inertia`: 1/m and 1/I for the accelerations; h/m and h/I for what
    they add to the velocities in the time h.

    For controls that hold. All that does not change from sub-step to sub-step is worked out here, once, so that no
    division stands in a loop; a function that closes over the constants costs half of one that unpacks them each time.
    What the scene does not ask for costs nothing: the default's drag, and none at all, have functions of their own,
    with the bits of the general one.
    """
    if craft.drag_factor == 0.0:
        own = _without_drag(controls, craft, per_mass, per_inertia)
    elif craft.plain_drag and not windy(controls):
        own = _with_plain_drag(controls, craft, per_mass, per_inertia)
    else:
        own = _with_any_drag(controls, craft, per_mass, per_inertia)
    return _with_external_loads(own, controls, per_mass, per_inertia) if pushed(controls) else own


def _with_external_loads(own: LoadFunction, controls: Controls, per_mass: float, per_inertia: float) -> LoadFunction:
    """And those from outside, which are in the world frame already."""
    force_x, force_y = controls.external_force_x * per_mass, controls.external_force_y * per_mass
    external_moment = controls.external_moment * per_inertia

    def loads_at(heading: float, vx: float, vy: float, yaw_rate: float) -> tuple[float, float, float, float]:
        x, y, moment, kq = own(heading, vx, vy, yaw_rate)
        return x + force_x, y + force_y, moment + external_moment, kq

    return loads_at


def _pushes(controls: Controls, craft: Craft, per_mass: float, per_inertia: float) -> tuple[float, float, float]:
    """`actuation` times the factors."""
    thrust, side, turn = actuation(controls, craft)
    return thrust * per_mass, side * per_mass, turn * per_inertia


def _with_plain_drag(controls: Controls, craft: Craft, per_mass: float, per_inertia: float) -> LoadFunction:
    cos, sin, sqrt = math.cos, math.sin, math.sqrt
    k, x_d = craft.drag_factor, craft.drag_center
    drag, turning_drag = k * per_mass, k * x_d * per_inertia
    thrust, side, turn = _pushes(controls, craft, per_mass, per_inertia)

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


def drag_function(craft: Craft) -> Callable[[float, float], float]:
    """(u, w), velocity of the centre of drag through the air, body frame [m/s] -> k*q, drag per air speed [kg/s]."""
    sqrt, k = math.sqrt, craft.drag_factor
    factor_ahead, factor_abeam = craft.drag_factor_ahead, craft.drag_factor_abeam
    if k == 0.0:
        return lambda _u, _w: 0.0
    if craft.drag_area == DIRECTIONAL:
        return lambda u, w: factor_ahead * abs(u) + factor_abeam * abs(w)
    return lambda u, w: k * sqrt(u * u + w * w)


def _without_drag(controls: Controls, craft: Craft, per_mass: float, per_inertia: float) -> LoadFunction:
    cos, sin = math.cos, math.sin
    thrust, side, turn = _pushes(controls, craft, per_mass, per_inertia)

    def loads_at(heading: float, _vx: float, _vy: float, _yaw_rate: float) -> tuple[float, float, float, float]:
        c = cos(heading)
        s = sin(heading)
        return c * thrust - s * side, s * thrust + c * side, turn, 0.0

    return loads_at


def _with_any_drag(controls: Controls, craft: Craft, per_mass: float, per_inertia: float) -> LoadFunction:
    """Drag in wind, of constant or directional area, and with a moment of its own.

    Air that comes from the direction (u, w)/q sees the box with the area H*(W*|u| + L*|w|)/q: its walls stand square,
    and each shows the cosine of its angle to the air. Times q, that is the drag per air speed, without a square root:
    it takes the place of q, and k is 1.
    """
    cos, sin, sqrt = math.cos, math.sin, math.sqrt
    directional = craft.drag_area == DIRECTIONAL
    factor_ahead, factor_abeam = craft.drag_factor_ahead, craft.drag_factor_abeam
    x_d, spin = craft.drag_center, craft.spin_drag_factor * per_inertia
    wind_x, wind_y = controls.wind_x, controls.wind_y
    k = 1.0 if directional else craft.drag_factor
    drag, turning_drag = k * per_mass, k * x_d * per_inertia
    thrust, side, turn = _pushes(controls, craft, per_mass, per_inertia)

    def loads_at(heading: float, vx: float, vy: float, yaw_rate: float) -> tuple[float, float, float, float]:
        c = cos(heading)
        s = sin(heading)
        air_x = vx - wind_x
        air_y = vy - wind_y
        u = c * air_x + s * air_y
        w = c * air_y - s * air_x + yaw_rate * x_d
        q = factor_ahead * abs(u) + factor_abeam * abs(w) if directional else sqrt(u * u + w * w)
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


def friction_radius(craft: Craft) -> float:
    """m: rho, the mean distance of the points of the L x W rectangle from its centre.

    With the diagonal d: d/6 + (L^2/W*ln((W + d)/L) + W^2/L*ln((L + d)/W))/12, the integral of the distance over the
    rectangle, cut into eight right triangles with a corner in the centre.
    """
    length, width = craft.length, craft.width
    d = math.sqrt(length * length + width * width)
    along = length * length / width * math.log((width + d) / length)
    across = width * width / length * math.log((length + d) / width)
    return d / 6 + (along + across) / 12


def slip_speed(vx: float, vy: float, turning: float) -> float:
    """m/s: q, from the velocity and rho*r."""
    return math.sqrt(vx * vx + vy * vy + turning * turning)


LEAST_SLIP = 1e-150
"""m/s: so that at rest nothing is divided by zero."""


def sliding_load_function(
    controls: Controls, craft: Craft, per_mass: float = 1.0, per_inertia: float = 1.0
) -> LoadFunction:
    """All loads on a craft that slides: those of `load_function`, and friction."""
    free = load_function(controls, craft, per_mass, per_inertia)
    radius = friction_radius(craft)
    grip, turning_grip = craft.friction_force * per_mass, craft.friction_force * radius * per_inertia

    def loads_at(heading: float, vx: float, vy: float, yaw_rate: float) -> tuple[float, float, float, float]:
        x, y, moment, kq = free(heading, vx, vy, yaw_rate)
        turning = radius * yaw_rate
        slowness = 1.0 / max(slip_speed(vx, vy, turning), LEAST_SLIP)
        return (
            x - grip * slowness * vx,
            y - grip * slowness * vy,
            moment - turning_grip * slowness * turning,
            kq,
        )

    return loads_at


def over_zero(value: float) -> float:
    """value/0 as C has it, where a divisor that is greater than 0 is too small for a double: Python raises."""
    return math.nan if value == 0.0 or value != value else math.copysign(math.inf, value)


def friction_gains(craft: Craft, h: float) -> tuple[float, float]:
    """m/s: how much of v, and of rho*r, friction can take away in the time h [s]: F_max*h/m and F_max*rho^2*h/I."""
    radius = friction_radius(craft)
    force = craft.friction_force
    return h * (force / craft.mass), h * (force * radius * radius / craft.inertia)


NEWTON = 30
"""The most iterations; three or four are made."""


def friction_function(craft: Craft, h: float) -> Friction:
    """What friction makes, in the time h [s], of velocities that were reached without it: an implicit step.

    With a and b of `friction_gains`, and q the slip speed at the end, v' = v - a*v'/q and r' = r - b*r'/q, so
    v' = v*q/(q + a), r' = r*q/(q + b), where q solves (v/(q + a))^2 + (rho*r/(q + b))^2 = 1. Where the left side is at
    most 1 at q = 0, friction holds: the craft is at rest, exactly, whatever h is. Else Newton's method on the left
    side's reciprocal square root, nearly a straight line: from the left of the root it climbs to it and never beyond
    (More, Sorensen, Computing a trust region step, 1983). It never adds energy, and never turns a motion round.
    """
    a, b = friction_gains(craft, h)
    radius = friction_radius(craft)
    sqrt, slowest = math.sqrt, max(a, b)

    def rubbed(vx: float, vy: float, yaw_rate: float) -> tuple[float, float, float]:
        turning = radius * yaw_rate
        straight, turned = vx * vx + vy * vy, turning * turning
        if straight * (b * b) + turned * (a * a) <= (a * a) * (b * b):  # it holds
            return 0.0, 0.0, 0.0
        q = sqrt(straight + turned) - slowest
        if q < 0.0:  # max() would cost a tenth of the loop
            q = 0.0
        for _ in range(NEWTON):
            of_v, of_r = q + a, q + b
            square_v, square_r = of_v * of_v, of_r * of_r
            part_v = straight / square_v if square_v else over_zero(straight)
            part_r = turned / square_r if square_r else over_zero(turned)
            size = part_v + part_r
            beyond = size * (sqrt(size) - 1.0)
            slope = (part_v / of_v if of_v else over_zero(part_v)) + (part_r / of_r if of_r else over_zero(part_r))
            new = q + (beyond / slope if slope else over_zero(beyond))
            if not new > q:
                break
            q = new
        of_v, of_r = q + a, q + b
        of_v, of_r = q / of_v if of_v else over_zero(q), q / of_r if of_r else over_zero(q)
        return vx * of_v, vy * of_v, yaw_rate * of_r

    return rubbed


def loads(state: State, controls: Controls, craft: Craft) -> Loads:
    """Force [N, world frame] and moment [N.m] on the craft: thrusters, air drag, what is outside, friction."""
    if not craft.rubs:
        return Loads(*load_function(controls, craft)(*state[2:])[:3])
    if state.vx == 0.0 and state.vy == 0.0 and state.yaw_rate == 0.0:
        return _loads_at_rest(state, controls, craft)
    return Loads(*sliding_load_function(controls, craft)(*state[2:])[:3])


def _loads_at_rest(state: State, controls: Controls, craft: Craft) -> Loads:
    """What friction leaves of a push on a craft at rest: its implicit step from rest, over any time, gives the rate."""
    force_x, force_y, moment, _ = load_function(controls, craft)(*state[2:])
    rate = friction_function(craft, 1.0)
    ax, ay, turning = rate(force_x / craft.mass, force_y / craft.mass, moment / craft.inertia)
    return Loads(craft.mass * ax, craft.mass * ay, craft.inertia * turning)


def derivatives(state: State, controls: Controls, craft: Craft) -> Derivatives:
    """The equations of motion: m*dv/dt = force, I*dr/dt = moment, d(pose)/dt = velocity (Newton, Euler)."""
    force_x, force_y, moment = loads(state, controls, craft)
    return Derivatives(
        state.vx, state.vy, state.yaw_rate, force_x / craft.mass, force_y / craft.mass, moment / craft.inertia
    )


def body_velocity(state: State) -> tuple[float, float]:
    """Surge and sway [m/s]: the velocity of the centre of gravity in the body frame."""
    _, _, heading, vx, vy, _ = state
    c = math.cos(heading)
    s = math.sin(heading)
    return c * vx + s * vy, c * vy - s * vx


def kinetic_energy(state: State, craft: Craft) -> float:
    """J: of translation and rotation."""
    speed_squared = state.vx * state.vx + state.vy * state.vy
    return 0.5 * craft.mass * speed_squared + 0.5 * craft.inertia * state.yaw_rate * state.yaw_rate
