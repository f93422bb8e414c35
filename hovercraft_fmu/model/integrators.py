"""The methods that carry a state over sub-steps: one function a method, one table of them."""

import math
from collections.abc import Callable
from typing import NamedTuple, TypeAlias

from .craft import Craft
from .dynamics import (
    Controls,
    LoadFunction,
    State,
    actuation,
    air_speed,
    drag_function,
    friction_function,
    friction_gains,
    friction_radius,
    load_function,
    over_zero,
    pushed,
    sliding_load_function,
    slip_speed,
    windy,
)

MIN_STEP = 1e-12
"""s: below it the adaptive method gives up."""
MAX_TRIED = 10**8
"""Steps of the adaptive method in one communication step, taken or tried: some seconds of machine code."""
MAX_TURN = 1.0
"""rad, in a step of it: a heading that turns on by whole turns between the stages would be taken for one that rests."""
UNIT = 2.0**-52
"""Relative: one or two units in the last place of a double."""


class Stretch(NamedTuple):
    """What a method returns: where the craft is after the sub-steps, and what decides whether to trust that."""

    state: State
    substeps: int
    """Of the adaptive method those that it tried and refused, too: they cost the same."""
    stability: float
    """1: the largest stability number of a sub-step, wherever the loads were worked out and at the end: h times the
    fastest linearized drag rate.

    Drag k*q*(u, w) at a steady q along the motion changes by 2*k*q along it and by k*q across; a push at the drag
    point moves the craft by 1/m and turns the point by x_d^2/I. So no rate is above 2*k*q*(1/m + x_d^2/I), k*q times
    the craft's `drag_rate`. (With the directional area the two rates are the same.) The rotational drag d*r*|r| adds
    2*d*|r|/I, |r| times `spin_rate`.
    """
    rotation: float
    """rad: the largest |yaw rate|*h, there too"""
    proposed: float = 0.0
    """s: the step that the adaptive method would take next; 0 for the others"""


Integrate: TypeAlias = Callable[[State, Controls, Craft, float, int], Stretch]
"""(state, controls, craft, sub-step h [s], number of sub-steps n) -> after n*h."""


def semi_implicit_euler(state: State, controls: Controls, craft: Craft, h: float, n: int) -> Stretch:
    """Symplectic Euler: loads from the start of the sub-step, velocity first, then the pose from the new velocity.

    First order; friction is an implicit step of its own, between the two. The loop holds plain numbers: an object made
    at every sub-step would cost more than the physics.
    """
    if craft.drag_factor and craft.plain_drag and not (craft.rubs or windy(controls) or pushed(controls)):
        return _plain_euler(state, controls, craft, h, n)
    push_at = load_function(controls, craft, h / craft.mass, h / craft.inertia)
    rubbed = friction_function(craft, h) if craft.rubs else None
    drag_rate, spin_rate = craft.drag_rate, craft.spin_rate
    x, y, heading, vx, vy, yaw_rate = state
    most, left, right = 0.0, yaw_rate, yaw_rate
    for _ in range(n):
        push_x, push_y, turn, kq = push_at(heading, vx, vy, yaw_rate)
        rate = kq * drag_rate + abs(yaw_rate) * spin_rate
        if rate > most:
            most = rate
        vx = vx + push_x
        vy = vy + push_y
        yaw_rate = yaw_rate + turn
        if rubbed:
            vx, vy, yaw_rate = rubbed(vx, vy, yaw_rate)
        x = x + h * vx
        y = y + h * vy
        heading = heading + h * yaw_rate
        if yaw_rate > right:
            right = yaw_rate
        elif yaw_rate < left:
            left = yaw_rate
    most = max(most, push_at(heading, vx, vy, yaw_rate)[3] * drag_rate + abs(yaw_rate) * spin_rate)
    return Stretch(State(x, y, heading, vx, vy, yaw_rate), n, h * most, h * max(right, -left))


def _plain_euler(state: State, controls: Controls, craft: Craft, h: float, n: int) -> Stretch:
    """The default, which most runs are: the load function written into the loop, as a call costs a quarter of it."""
    cos, sin, sqrt = math.cos, math.sin, math.sqrt
    per_mass, per_inertia = h / craft.mass, h / craft.inertia
    k, x_d = craft.drag_factor, craft.drag_center
    drag, turning_drag = k * per_mass, k * x_d * per_inertia
    thrust, side, turn = actuation(controls, craft)
    thrust, side, turn = thrust * per_mass, side * per_mass, turn * per_inertia
    x, y, heading, vx, vy, yaw_rate = state
    fastest, left, right = 0.0, yaw_rate, yaw_rate
    for _ in range(n):
        c = cos(heading)
        s = sin(heading)
        u = c * vx + s * vy
        w = c * vy - s * vx + yaw_rate * x_d
        q = sqrt(u * u + w * w)
        ahead = thrust - drag * u * q
        abeam = side - drag * w * q
        yaw_rate = yaw_rate + (turn - turning_drag * w * q)
        vx = vx + (c * ahead - s * abeam)
        vy = vy + (s * ahead + c * abeam)
        x = x + h * vx
        y = y + h * vy
        heading = heading + h * yaw_rate
        if q > fastest:
            fastest = q
        if yaw_rate > right:
            right = yaw_rate
        elif yaw_rate < left:
            left = yaw_rate
    most = k * max(fastest, air_speed(heading, vx, vy, yaw_rate, x_d)) * craft.drag_rate
    return Stretch(State(x, y, heading, vx, vy, yaw_rate), n, h * most, h * max(right, -left))


def drag_implicit(state: State, controls: Controls, craft: Craft, h: float, n: int) -> Stretch:
    """Drag solved implicitly with its factor k*q from the start of the sub-step; the pose from the new velocity.

    First order, stable at any step. With g = h*k*q the implicit step in the body frame is

        (m + g) u' = m u + h T
        (m + g) v' + g x_d r' = m v + h side   =: a
        g x_d v' + (I + g x_d^2) r' = I r + h turn   =: b

    The last two have the determinant D = m I + g (I + m x_d^2) and, with e = x_d a - b, the solution
    v' = (I a + g x_d e)/D, r' = (m b - g e)/D (Cramer's rule; what cancels is taken out by hand, so nothing is lost
    where g is large). The matrix is the mass plus g times a square, so drag alone never adds kinetic energy; straight
    coasting gives v' = v/(1 + h kappa v), which is exact, and T = k*u*u stays where it is.

    Of u and v the share m/(m + g) is kept as it is, in the world frame: turned into the body frame and back at every
    sub-step, roundings would add up. What is added to it is h T/(m + g) ahead and, to starboard,
    v' - v m/(m + g) = ((I + g x_d^2) h side + g x_d (x_d g v m/(m + g) - b))/D.

    In wind the same holds of the velocity through the air, which is what drag takes away. A moment of the rotation
    itself, -d r |r|, adds h d |r| to I on the left side. A force from outside, turned into the body frame, is a part of
    T and of the side force, and a moment one of the turn. Friction is an implicit step of its own, after it.
    """
    loads_at = load_function(controls, craft)
    rubbed = friction_function(craft, h) if craft.rubs else None
    in_wind, spins = windy(controls), craft.rotational_drag != 0.0
    wind_x, wind_y, spin = controls.wind_x, controls.wind_y, craft.spin_drag_factor
    thrust, side, turn = actuation(controls, craft)
    loaded, force_x, force_y = pushed(controls), controls.external_force_x, controls.external_force_y
    turn = turn + controls.external_moment if loaded else turn
    ahead, abeam, scene = thrust, side, in_wind or spins or loaded
    cos, sin = math.cos, math.sin
    mass, inertia, x_d = craft.mass, craft.inertia, craft.drag_center
    damped, arm, square = inertia, mass * x_d * x_d, x_d * x_d
    drag_rate, spin_rate = craft.drag_rate, craft.spin_rate
    x, y, heading, vx, vy, yaw_rate = state
    most, left, right = 0.0, yaw_rate, yaw_rate
    for _ in range(n):
        kq = loads_at(heading, vx, vy, yaw_rate)[3]
        rate = kq * drag_rate + abs(yaw_rate) * spin_rate
        if rate > most:
            most = rate
        c = cos(heading)
        s = sin(heading)
        g = h * kq
        if scene:
            if in_wind:
                vx, vy = vx - wind_x, vy - wind_y
            if spins:
                damped = inertia + h * spin * abs(yaw_rate)
            if loaded:
                ahead, abeam = thrust + (c * force_x + s * force_y), side + (c * force_y - s * force_x)
        v = c * vy - s * vx
        b = inertia * yaw_rate + h * turn
        e = x_d * (mass * v + h * abeam) - b
        determinant = mass * damped + g * (damped + arm)
        kept = mass / (mass + g)
        surge = h * ahead / (mass + g)
        sway = (damped + g * square) * (h * abeam) + g * x_d * (x_d * (g * kept) * v - b)
        yaw_rate = mass * b - g * e
        if determinant:
            sway, yaw_rate = sway / determinant, yaw_rate / determinant
        else:
            sway, yaw_rate = over_zero(sway), over_zero(yaw_rate)
        vx = kept * vx + (c * surge - s * sway)
        vy = kept * vy + (s * surge + c * sway)
        if in_wind:
            vx, vy = vx + wind_x, vy + wind_y
        if rubbed:
            vx, vy, yaw_rate = rubbed(vx, vy, yaw_rate)
        if yaw_rate > right:
            right = yaw_rate
        elif yaw_rate < left:
            left = yaw_rate
        x = x + h * vx
        y = y + h * vy
        heading = heading + h * yaw_rate
    most = max(most, loads_at(heading, vx, vy, yaw_rate)[3] * drag_rate + abs(yaw_rate) * spin_rate)
    return Stretch(State(x, y, heading, vx, vy, yaw_rate), n, h * most, h * max(right, -left))


def rk4(state: State, controls: Controls, craft: Craft, h: float, n: int) -> Stretch:
    """The classic Runge-Kutta method (Kutta 1901), fourth order; where friction could stop the craft, Euler's."""
    if craft.rubs:
        return _rk4_with_friction(state, controls, craft, h, n)
    return _rk4(load_function(controls, craft, 1.0 / craft.mass, 1.0 / craft.inertia), craft, state, h, n)


NEAR_REST = 4.0
"""Sub-steps in which friction could stop the craft: nearer to rest, its force turns too far in a sub-step."""


def _rk4_with_friction(state: State, controls: Controls, craft: Craft, h: float, n: int) -> Stretch:
    """While it slides, friction is a load like others, and smooth. Near rest it is not: an implicit step of Euler's."""
    sliding = sliding_load_function(controls, craft, 1.0 / craft.mass, 1.0 / craft.inertia)
    radius = friction_radius(craft)
    near = NEAR_REST * max(friction_gains(craft, h))
    stability = rotation = 0.0
    for _ in range(n):
        if slip_speed(state.vx, state.vy, radius * state.yaw_rate) < near:
            stretch = semi_implicit_euler(state, controls, craft, h, 1)
        else:
            stretch = _rk4(sliding, craft, state, h, 1)
        state, stability = stretch.state, max(stability, stretch.stability)
        rotation = max(rotation, stretch.rotation)
    return Stretch(state, n, stability, rotation)


def _rk4(acceleration_at: LoadFunction, craft: Craft, state: State, h: float, n: int) -> Stretch:
    """The derivative of the pose is the velocity, so the pose needs no stages of its own:
    h/6 (v1 + 2 v2 + 2 v3 + v4) = h v + h^2/6 (a1 + a2 + a3).
    """
    half, sixth, square = 0.5 * h, h / 6.0, h * h / 6.0
    drag_rate, spin_rate = craft.drag_rate, craft.spin_rate
    x, y, heading, vx, vy, yaw_rate = state
    most, left, right = 0.0, yaw_rate, yaw_rate
    for _ in range(n):
        ax1, ay1, m1, kq1 = acceleration_at(heading, vx, vy, yaw_rate)
        r2 = yaw_rate + half * m1
        ax2, ay2, m2, kq2 = acceleration_at(heading + half * yaw_rate, vx + half * ax1, vy + half * ay1, r2)
        r3 = yaw_rate + half * m2
        ax3, ay3, m3, kq3 = acceleration_at(heading + half * r2, vx + half * ax2, vy + half * ay2, r3)
        r4 = yaw_rate + h * m3
        ax4, ay4, m4, kq4 = acceleration_at(heading + h * r3, vx + h * ax3, vy + h * ay3, r4)
        rate1, rate2 = kq1 * drag_rate + abs(yaw_rate) * spin_rate, kq2 * drag_rate + abs(r2) * spin_rate
        rate3, rate4 = kq3 * drag_rate + abs(r3) * spin_rate, kq4 * drag_rate + abs(r4) * spin_rate
        x = x + h * vx + square * (ax1 + ax2 + ax3)
        y = y + h * vy + square * (ay1 + ay2 + ay3)
        heading = heading + h * yaw_rate + square * (m1 + m2 + m3)
        vx = vx + sixth * (ax1 + 2.0 * ax2 + 2.0 * ax3 + ax4)
        vy = vy + sixth * (ay1 + 2.0 * ay2 + 2.0 * ay3 + ay4)
        yaw_rate = yaw_rate + sixth * (m1 + 2.0 * m2 + 2.0 * m3 + m4)
        if not (rate1 <= most and rate2 <= most and rate3 <= most and rate4 <= most):
            most = max(most, rate1, rate2, rate3, rate4)
        if not (left <= r2 <= right and left <= r3 <= right and left <= r4 <= right and left <= yaw_rate <= right):
            left, right = min(left, r2, r3, r4, yaw_rate), max(right, r2, r3, r4, yaw_rate)
    most = max(most, acceleration_at(heading, vx, vy, yaw_rate)[3] * drag_rate + abs(yaw_rate) * spin_rate)
    return Stretch(State(x, y, heading, vx, vy, yaw_rate), n, h * most, h * max(right, -left))


MOST = 1e100
"""1: h times a rate of drag is taken as no more, so that its square, and that of what is left, are numbers: beyond,
nothing is left anyway."""


def splitting(state: State, controls: Controls, craft: Craft, h: float, n: int) -> Stretch:
    """Half a sub-step of the pose; with the heading held, the velocities; the other half of the pose (Strang, 1968).

    Second order, and no limit of stability: of the parts each loses energy, or keeps it. With the heading held, surge u
    and sway w of the drag point through the air mix in nothing but q. With M = 1/m + x_d^2/I

        u' = T/m - (k*q/m)*u,    w' = side/m + x_d*turn/I - k*q*M*w

    where q is that of the middle. At a steady q each is solved by

        y_new = (y + a*h*(1 + z/2))/(1 + z*(1 + z/2)),    z = h*rate

    (a: the push; the Pade approximation (0,2) of the exponential): it has no sign change, goes to rest, or to a/rate,
    for long sub-steps, and the terminal speed stays where it is. The middle comes from half an implicit step,
    y_half = (y + a*h/2)/(1 + z/2) with the q of the start: coasting straight that is exact however long the step, where
    half a step by the approximation above would nearly stop, and the whole one see no drag. What drag takes of w is
    shared by the sway of the craft, 1/(m*M) of it, and its yaw rate, x_d/(I*M).

    A force from outside, turned into the body frame at the held heading, is a part of T and of the side force, a moment
    one of the turn. Rotational drag, -d*r*|r|, is r/(1 + h*d*|r|/(2*I)) before and after, which is exact; its
    rate is watched where each begins: the second may stop what the moment of this sub-step has driven. Friction is an
    implicit step after all that (and after the half one, so that a craft that it holds stays at rest): that lowers the
    order to 1.
    """
    drag_at = drag_function(craft)
    rubbed = friction_function(craft, h) if craft.rubs else None
    rubbed_half = friction_function(craft, 0.5 * h) if craft.rubs else None
    half, x_d, spins = 0.5 * h, craft.drag_center, craft.rotational_drag != 0.0
    per_mass, per_inertia = h / craft.mass, h / craft.inertia
    thrust, side, turn = actuation(controls, craft)
    thrust, side, turn = thrust * per_mass, side * per_mass, turn * per_inertia
    loaded, force_x, force_y = (
        pushed(controls),
        controls.external_force_x * per_mass,
        controls.external_force_y * per_mass,
    )
    turn = turn + controls.external_moment * per_inertia if loaded else turn
    ahead, aside, push = thrust, side, side + x_d * turn
    lever = 0.5 * craft.drag_rate
    abeam, of_sway, of_yaw = h * lever, 1.0 / (craft.mass * lever), x_d / craft.inertia / lever
    slowing = half * craft.spin_drag_factor / craft.inertia
    cos, sin, wind_x, wind_y, scene = math.cos, math.sin, controls.wind_x, controls.wind_y, spins or loaded
    drag_rate, spin_rate = craft.drag_rate, craft.spin_rate

    def gained(y: float, push: float, z: float) -> float:
        z = z if z < MOST else MOST
        g = 1.0 + 0.5 * z
        return (push - z * y) * (g / (1.0 + z * g))

    x, y, heading, vx, vy, yaw_rate = state
    most, left, right = 0.0, yaw_rate, yaw_rate
    for _ in range(n):
        x = x + half * vx
        y = y + half * vy
        heading = heading + half * yaw_rate
        c = cos(heading)
        s = sin(heading)
        air_x = vx - wind_x
        air_y = vy - wind_y
        begun = abs(yaw_rate)
        if scene:
            if loaded:
                ahead, aside = thrust + (c * force_x + s * force_y), side + (c * force_y - s * force_x)
                push = aside + x_d * turn
            if spins:
                yaw_rate = yaw_rate / (1.0 + slowing * abs(yaw_rate))
        u = c * air_x + s * air_y
        w = c * air_y - s * air_x + yaw_rate * x_d
        kq = drag_at(u, w)
        z_u, z_w = 0.5 * (kq * per_mass), 0.5 * (kq * abeam)
        half_u = (u + 0.5 * ahead) / (1.0 + (z_u if z_u < MOST else MOST))
        half_w = (w + 0.5 * push) / (1.0 + (z_w if z_w < MOST else MOST))
        if rubbed_half:
            lost = w + 0.5 * push - half_w
            surge = half_u + (c * wind_x + s * wind_y)
            sway = c * vy - s * vx + (0.5 * aside - lost * of_sway)
            yaw = yaw_rate + (0.5 * turn - lost * of_yaw)
            surge_left, sway_left, yaw_left = rubbed_half(surge, sway, yaw)
            half_u = half_u + (surge_left - surge)
            half_w = half_w + (sway_left - sway + (yaw_left - yaw) * x_d)
        middle = drag_at(half_u, half_w)
        gain_u, gain_v, gain_r = ahead, aside, turn
        if middle != 0.0:
            gain_u = gained(u, ahead, middle * per_mass)
            lost = push - gained(w, push, middle * abeam)
            gain_v = aside - lost * of_sway
            gain_r = turn - lost * of_yaw
        vx = vx + (c * gain_u - s * gain_v)
        vy = vy + (s * gain_u + c * gain_v)
        yaw_rate = yaw_rate + gain_r
        driven = abs(yaw_rate)
        if spins:
            yaw_rate = yaw_rate / (1.0 + slowing * driven)
        if rubbed:
            vx, vy, yaw_rate = rubbed(vx, vy, yaw_rate)
        x = x + half * vx
        y = y + half * vy
        heading = heading + half * yaw_rate
        rate = (middle if middle > kq else kq) * drag_rate + max(begun, driven) * spin_rate
        if rate > most:
            most = rate
        if yaw_rate > right:
            right = yaw_rate
        elif yaw_rate < left:
            left = yaw_rate
    return Stretch(State(x, y, heading, vx, vy, yaw_rate), n, h * most, h * max(right, -left))


# Dormand, Prince: A family of embedded Runge-Kutta formulae (1980), the pair 5(4) with 7 stages; the last is the fifth
# order step itself, and the first of the next.
TABLEAU = (
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
ERROR = (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40)
"""Fifth order minus fourth order."""


MAX_GROWTH = 5.0
"""1: of a step over the one before."""


class StepTooSmallError(ArithmeticError):
    """The adaptive method cannot meet its tolerance with any step."""

    def __init__(self, step: float, tolerance: float) -> None:
        self.step = step
        super().__init__(
            f"step = {step!r} s: must not fall below {MIN_STEP} s, nor below what a double can tell at its time, to "
            f"meet tolerance = {tolerance!r}; set a larger tolerance"
        )


def too_many_tried(communication_step: float, tolerance: float) -> ValueError:
    """What the adaptive method raises where it does not come to an end."""
    return ValueError(
        f"communication step = {communication_step!r} s: must not need more than 10^8 sub-steps to meet tolerance = "
        f"{tolerance!r}; set a larger tolerance, or take a shorter step"
    )


def adaptive(
    state: State, controls: Controls, craft: Craft, duration: float, tolerance: float, proposed: float
) -> Stretch:
    """Dormand-Prince 5(4) with error control, from now to exactly `duration` later; one craft only.

    A step is taken where its error estimate, the largest of the six components in SI units, is at most the tolerance:
    a fixed scale, which does not depend on where the craft is. The next step is 0.9*(tolerance/error)^(1/4) times as
    long (at least 1/5, at most 5 times, not at all right after one that was refused): two square roots, which every
    platform rounds alike, instead of a fifth root. No step turns the craft by more than 1 rad.

    With friction a step is no longer than a quarter of the time in which the craft would come to rest, so that the
    error estimate never looks across that point, nor than the time in which friction takes on the direction of the
    motion; slower than the tolerance, an implicit step of Euler's is taken.

    Raises:
        StepTooSmallError: no step down to 1e-12 s meets the tolerance.
        ValueError: more than MAX_TRIED steps.
    """
    rates_at = _rate_function(controls, craft)
    reach = _reach_function(craft, tolerance)
    y = tuple(state)
    drag_rate, spin_rate = craft.drag_rate, craft.spin_rate
    first, kq = rates_at(y)
    time, tried, most, fastest = 0.0, 0, 0.0, 0.0
    growth = MAX_GROWTH
    while time < duration:
        h = min(duration - time, proposed)
        slides, longest = reach(y, first)
        h = min(h, longest) if slides else h
        if h * abs(y[5]) > 0.9 * MAX_TURN:
            h = 0.9 * MAX_TURN / abs(y[5])
        last = h >= duration - time
        if not last and h < max(MIN_STEP, UNIT * time):
            raise StepTooSmallError(h, tolerance)
        tried += 1
        if tried > MAX_TRIED:
            raise too_many_tried(duration, tolerance)
        try:
            new, rates, error = (
                _dormand_prince(y, first, h, rates_at) if slides else _near_rest(y, controls, craft, h, rates_at)
            )
            turn = abs(new[2] - y[2])
        except (ValueError, OverflowError):  # what math.sin says of an infinite angle
            error = turn = math.inf
        if not (error <= tolerance and turn <= MAX_TURN):
            if error <= tolerance:
                proposed = h * max(0.2, 0.9 * MAX_TURN / turn)
            else:
                proposed = h * max(0.2, 0.9 * math.sqrt(math.sqrt(tolerance / error))) if error < math.inf else 0.2 * h
            if proposed < MIN_STEP:
                raise StepTooSmallError(proposed, tolerance)
            growth = 1.0
            continue
        most, fastest = max(most, h * (kq * drag_rate + abs(y[5]) * spin_rate)), max(fastest, h * abs(y[5]))
        time = duration if last else time + h
        y, (first, kq) = new, rates
        most, fastest = max(most, h * (kq * drag_rate + abs(y[5]) * spin_rate)), max(fastest, h * abs(y[5]))
        if not last:  # a step cut short by the end says nothing against the one proposed
            proposed = h * min(growth, 0.9 * math.sqrt(math.sqrt(tolerance / error)) if error else growth)
        growth = MAX_GROWTH
    return Stretch(State(*y), tried, most, fastest, proposed)


Vector: TypeAlias = tuple[float, ...]
"""Six numbers, in the order of State."""
Rates: TypeAlias = tuple[Vector, float]
"""The derivative of the state, and k*q there."""


def _reach_function(craft: Craft, tolerance: float) -> Callable[[Vector, Vector], tuple[bool, float]]:
    """(state, its rates) -> whether the craft slides, and the longest step [s]; without friction, any.

    It does not slide where it is slower than the tolerance (or a step would be too small): there the error of stopping
    it, or of letting it go, is below the tolerance, too.
    """
    if not craft.rubs:
        return lambda _y, _rates: (True, math.inf)
    radius, fastest = friction_radius(craft), max(friction_gains(craft, 1.0))

    def reach(y: Vector, rates: Vector) -> tuple[bool, float]:
        turning = radius * y[5]
        speed = slip_speed(y[3], y[4], turning)
        if not speed > tolerance:
            return False, math.inf
        gain = (y[3] * rates[3] + y[4] * rates[4] + radius * turning * rates[5]) / speed
        # its direction goes back to that of the motion at the rate `fastest / speed`: longer steps were not stable
        rate = max(fastest, NEAR_REST * -gain)
        longest = speed / rate if rate else over_zero(speed)
        return longest > MIN_STEP, longest

    return reach


def _near_rest(
    y: Vector, controls: Controls, craft: Craft, h: float, rates_at: Callable[[Vector], Rates]
) -> tuple[Vector, Rates, float]:
    """An implicit step of Euler's; its error is at most all that it changes of the velocity, and h times that."""
    new = semi_implicit_euler(State(*y), controls, craft, h, 1).state
    change = max(abs(after - before) for after, before in zip(new[3:], y[3:], strict=True))
    error = change * max(1.0, h)
    return tuple(new), rates_at(tuple(new)), error if all(map(math.isfinite, (error, *new))) else math.inf


def _rate_function(controls: Controls, craft: Craft) -> Callable[[Vector], Rates]:
    function = sliding_load_function if craft.rubs else load_function
    acceleration_at = function(controls, craft, 1.0 / craft.mass, 1.0 / craft.inertia)

    def rates_at(y: Vector) -> Rates:
        _, _, heading, vx, vy, yaw_rate = y
        ax, ay, turning, kq = acceleration_at(heading, vx, vy, yaw_rate)
        return (vx, vy, yaw_rate, ax, ay, turning), kq

    return rates_at


def _dormand_prince(
    y: Vector, first: Vector, h: float, rates_at: Callable[[Vector], Rates]
) -> tuple[Vector, Rates, float]:
    """One step: the new state, the rates there, and the largest component of the error estimate."""
    stages = [first]
    for row in TABLEAU:
        new = tuple([value + h * _combined(row, stages, i) for i, value in enumerate(y)])
        rates = rates_at(new)
        stages.append(rates[0])
    error = max([abs(h * _combined(ERROR, stages, i)) for i in range(6)])
    return new, rates, error if math.isfinite(sum(new)) else math.inf


def _combined(weights: Vector, stages: list[Vector], i: int) -> float:
    """Added from left to right: sum() adds otherwise in newer Pythons, and so would the last bits."""
    total = weights[0] * stages[0][i]
    for k in range(1, len(weights)):
        total += weights[k] * stages[k][i]
    return total


class Integrator(NamedTuple):
    """A row of the table; its number in the FMU is its place, counted from 1."""

    name: str
    description: str
    integrate: Integrate | None
    """None for the adaptive method, which cuts the time itself."""
    stages: int
    """How many times a sub-step works out the loads; of adaptive one that is refused, too."""
    order: int
    """Of the error, as a power of the sub-step."""
    rubbing_order: int
    """What the estimate of the error takes it for where skirt and ground rub: of RK4 between the four while it slides
    and the two where friction stops the craft or lets it go. Measured: hovercraft-fmu measure error-estimate."""
    stability_limit: float
    """1: the largest sub-step times the fastest linearized drag rate up to which answers can be trusted."""
    rotation_limit: float
    """rad: the largest turn in a sub-step up to which they can. Both are measured: hovercraft-fmu measure stability."""


INTEGRATORS = (
    Integrator(
        "semi_implicit_euler",
        "Semi-implicit (symplectic) Euler: first order; the pose from the new velocity",
        semi_implicit_euler,
        1,
        1,
        1,
        0.2,
        0.15,
    ),
    Integrator(
        "drag_implicit",
        "Drag solved implicitly with its factor from the start of the sub-step: first order, stable at any step",
        drag_implicit,
        1,
        1,
        1,
        2.0,
        0.2,
    ),
    Integrator("rk4", "The classic Runge-Kutta method: fourth order", rk4, 4, 4, 3, 2.0, 3.3),
    Integrator(
        "adaptive",
        "Dormand-Prince 5(4) with steps that meet the tolerance; step_size is the first one",
        None,
        6,
        5,
        3,
        math.inf,
        math.inf,
    ),
    Integrator(
        "splitting",
        "Pose and velocities in turn: second order, first with friction; stable at any step",
        splitting,
        2,
        2,
        1,
        1.0,
        1.5,
    ),
)


ADAPTIVE = next(method for method in INTEGRATORS if method.integrate is None)


def integrator_number(name: str) -> int:
    """The number of a method in the table, from 1. Raises ValueError with the names there are."""
    names = [method.name for method in INTEGRATORS]
    if name not in names:
        raise ValueError(f"integrator = {name!r}: must be one of {', '.join(names)}")
    return names.index(name) + 1


def integrator(number: int) -> Integrator:
    """The method with this number. Raises ValueError with the numbers there are."""
    if isinstance(number, bool) or number not in range(1, len(INTEGRATORS) + 1):
        known = ", ".join(f"{i} ({method.name})" for i, method in enumerate(INTEGRATORS, 1))
        raise ValueError(f"integrator = {number!r}: must be one of {known}")
    return INTEGRATORS[int(number) - 1]
