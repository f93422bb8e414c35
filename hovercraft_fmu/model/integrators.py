"""The methods that carry a state over sub-steps: one function a method, one table of them."""

import math
from collections.abc import Callable
from typing import NamedTuple, TypeAlias

from .craft import Craft
from .dynamics import Controls, Namespace, State, actuation, load_function

MIN_STEP = 1e-12
"""s: below it the adaptive method gives up."""


class Stretch(NamedTuple):
    """What a method returns: where the craft is after the sub-steps, and what decides whether to trust that."""

    state: State
    substeps: int
    drag: float
    """kg: the largest h*k*q, wherever the loads were worked out and at the end"""
    rotation: float
    """rad: the largest |yaw rate|*h, there too"""
    proposed: float = 0.0
    """s: the step that the adaptive method would take next; 0 for the others"""


Integrate: TypeAlias = Callable[[State, Controls, Craft, float, int, Namespace], Stretch]
"""(state, controls, craft, sub-step h [s], number of sub-steps n, namespace) -> after n*h."""


def semi_implicit_euler(
    state: State, controls: Controls, craft: Craft, h: float, n: int, ns: Namespace = math
) -> Stretch:
    """Symplectic Euler: loads from the start of the sub-step, velocity first, then the pose from the new velocity.

    First order. The loop holds plain numbers: an object made at every sub-step would cost more than the physics.
    """
    loads_at = load_function(controls, craft, ns)
    mass, inertia, single = craft.mass, craft.inertia, ns is math
    x, y, heading, vx, vy, yaw_rate = state
    most, left, right = 0.0, yaw_rate, yaw_rate
    for _ in range(n):
        force_x, force_y, moment, kq = loads_at(heading, vx, vy, yaw_rate)
        # `a = a + b`, never `a += b`: that would write into the caller's arrays
        vx = vx + h * (force_x / mass)
        vy = vy + h * (force_y / mass)
        x = x + h * vx
        y = y + h * vy
        yaw_rate = yaw_rate + h * (moment / inertia)
        heading = heading + h * yaw_rate
        if single:
            if kq > most:
                most = kq
            if yaw_rate > right:
                right = yaw_rate
            elif yaw_rate < left:
                left = yaw_rate
        else:
            most, left, right = ns.fmax(most, kq), ns.fmin(left, yaw_rate), ns.fmax(right, yaw_rate)
    largest = max if single else ns.fmax
    most = largest(most, loads_at(heading, vx, vy, yaw_rate)[3])
    return Stretch(State(x, y, heading, vx, vy, yaw_rate), n, h * most, h * largest(right, -left))


def drag_implicit(state: State, controls: Controls, craft: Craft, h: float, n: int, ns: Namespace = math) -> Stretch:
    """Drag solved implicitly with its factor k*q from the start of the sub-step; the pose from the new velocity.

    First order, stable at any step. With g = h*k*q the implicit step in the body frame is

        (m + g) u' = m u + h T
        (m + g) v' + g x_d r' = m v + h side   =: a
        g x_d v' + (I + g x_d^2) r' = I r + h turn   =: b

    The last two have the determinant m I + g (I + m x_d^2) and, with e = x_d a - b, the solution
    v' = (I a + g x_d e)/det, r' = (m b - g e)/det (Cramer's rule; what cancels is taken out by hand, so nothing is
    lost where g is large). The matrix is the mass plus g times a square, so drag alone never adds kinetic energy;
    straight coasting gives v' = v/(1 + h kappa v), which is exact, and T = k*u*u stays where it is.
    """
    loads_at = load_function(controls, craft, ns)
    thrust, side, turn = actuation(controls, craft, ns)
    cos, sin, single = ns.cos, ns.sin, ns is math
    mass, inertia, x_d = craft.mass, craft.inertia, craft.drag_center
    spread = inertia + mass * x_d * x_d
    x, y, heading, vx, vy, yaw_rate = state
    most, left, right = 0.0, yaw_rate, yaw_rate
    for _ in range(n):
        kq = loads_at(heading, vx, vy, yaw_rate)[3]
        c = cos(heading)
        s = sin(heading)
        g = h * kq
        surge = (mass * (c * vx + s * vy) + h * thrust) / (mass + g)
        a = mass * (c * vy - s * vx) + h * side
        b = inertia * yaw_rate + h * turn
        e = x_d * a - b
        determinant = mass * inertia + g * spread
        sway = (inertia * a + g * x_d * e) / determinant
        yaw_rate = (mass * b - g * e) / determinant
        vx = c * surge - s * sway
        vy = s * surge + c * sway
        x = x + h * vx
        y = y + h * vy
        heading = heading + h * yaw_rate
        if single:
            if kq > most:
                most = kq
            if yaw_rate > right:
                right = yaw_rate
            elif yaw_rate < left:
                left = yaw_rate
        else:
            most, left, right = ns.fmax(most, kq), ns.fmin(left, yaw_rate), ns.fmax(right, yaw_rate)
    largest = max if single else ns.fmax
    most = largest(most, loads_at(heading, vx, vy, yaw_rate)[3])
    return Stretch(State(x, y, heading, vx, vy, yaw_rate), n, h * most, h * largest(right, -left))


def rk4(state: State, controls: Controls, craft: Craft, h: float, n: int, ns: Namespace = math) -> Stretch:
    """The classic Runge-Kutta method (Kutta 1901), fourth order.

    The derivative of the pose is the velocity, so the pose needs no stages of its own:
    h/6 (v1 + 2 v2 + 2 v3 + v4) = h v + h^2/6 (a1 + a2 + a3).
    """
    loads_at = load_function(controls, craft, ns)
    mass, inertia, single = craft.mass, craft.inertia, ns is math
    half, sixth, square = 0.5 * h, h / 6.0, h * h / 6.0
    x, y, heading, vx, vy, yaw_rate = state
    most, left, right = 0.0, yaw_rate, yaw_rate
    for _ in range(n):
        fx1, fy1, m1, kq1 = loads_at(heading, vx, vy, yaw_rate)
        fx1, fy1, m1 = fx1 / mass, fy1 / mass, m1 / inertia
        r2 = yaw_rate + half * m1
        fx2, fy2, m2, kq2 = loads_at(heading + half * yaw_rate, vx + half * fx1, vy + half * fy1, r2)
        fx2, fy2, m2 = fx2 / mass, fy2 / mass, m2 / inertia
        r3 = yaw_rate + half * m2
        fx3, fy3, m3, kq3 = loads_at(heading + half * r2, vx + half * fx2, vy + half * fy2, r3)
        fx3, fy3, m3 = fx3 / mass, fy3 / mass, m3 / inertia
        r4 = yaw_rate + h * m3
        fx4, fy4, m4, kq4 = loads_at(heading + h * r3, vx + h * fx3, vy + h * fy3, r4)
        x = x + h * vx + square * (fx1 + fx2 + fx3)
        y = y + h * vy + square * (fy1 + fy2 + fy3)
        heading = heading + h * yaw_rate + square * (m1 + m2 + m3)
        vx = vx + sixth * (fx1 + 2.0 * fx2 + 2.0 * fx3 + fx4 / mass)
        vy = vy + sixth * (fy1 + 2.0 * fy2 + 2.0 * fy3 + fy4 / mass)
        yaw_rate = yaw_rate + sixth * (m1 + 2.0 * m2 + 2.0 * m3 + m4 / inertia)
        if single:
            if not (kq1 <= most and kq2 <= most and kq3 <= most and kq4 <= most):
                most = max(most, kq1, kq2, kq3, kq4)
            if not (left <= r2 <= right and left <= r3 <= right and left <= r4 <= right and left <= yaw_rate <= right):
                left, right = min(left, r2, r3, r4, yaw_rate), max(right, r2, r3, r4, yaw_rate)
        else:
            for kq in (kq1, kq2, kq3, kq4):
                most = ns.fmax(most, kq)
            for rate in (r2, r3, r4, yaw_rate):
                left, right = ns.fmin(left, rate), ns.fmax(right, rate)
    largest = max if single else ns.fmax
    most = largest(most, loads_at(heading, vx, vy, yaw_rate)[3])
    return Stretch(State(x, y, heading, vx, vy, yaw_rate), n, h * most, h * largest(right, -left))


# Dormand, Prince: A family of embedded Runge-Kutta formulae (1980), the pair 5(4) with 7 stages; the last is the fifth
# order step itself, and the first of the next.
STAGES = (
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    (35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
ERROR = (71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40)
"""Fifth order minus fourth order."""


class StepTooSmallError(ArithmeticError):
    """The adaptive method cannot meet its tolerance with any step."""

    def __init__(self, step: float, tolerance: float) -> None:
        self.step = step
        super().__init__(
            f"step = {step!r} s: must not fall below {MIN_STEP} s to meet tolerance = {tolerance!r}; "
            "set a larger tolerance"
        )


def adaptive(
    state: State, controls: Controls, craft: Craft, duration: float, tolerance: float, proposed: float
) -> Stretch:
    """Dormand-Prince 5(4) with error control, from now to exactly `duration` later; one craft only.

    A step is taken where its error estimate, the largest of the six components in SI units, is at most the tolerance:
    a fixed scale, which does not depend on where the craft is. The next step is 0.9*(tolerance/error)^(1/4) times as
    long (at least 1/5, at most 5 times): two square roots, which every platform rounds alike, instead of a fifth root.

    Raises:
        StepTooSmallError: no step down to 1e-12 s meets the tolerance.
    """
    rates_at = _rate_function(controls, craft)
    y = tuple(state)
    first, kq = rates_at(y)
    time, count, most, fastest = 0.0, 0, 0.0, 0.0
    while time < duration:
        last = proposed >= duration - time
        h = duration - time if last else proposed
        try:
            new, rates, error = _dormand_prince(y, first, h, rates_at)
        except (ValueError, OverflowError):  # what math.sin says of an infinite angle
            error = math.inf
        if not error <= tolerance:
            proposed = h * max(0.2, 0.9 * math.sqrt(math.sqrt(tolerance / error))) if error < math.inf else 0.2 * h
            if proposed < MIN_STEP:
                raise StepTooSmallError(proposed, tolerance)
            continue
        most, fastest = max(most, h * kq), max(fastest, h * abs(y[5]))
        time = duration if last else time + h
        y, (first, kq), count = new, rates, count + 1
        most, fastest = max(most, h * kq), max(fastest, h * abs(y[5]))
        if not last:  # a step cut short by the end says nothing against the one proposed
            proposed = h * min(5.0, 0.9 * math.sqrt(math.sqrt(tolerance / error)) if error else 5.0)
    return Stretch(State(*y), count, most, fastest, proposed)


Vector: TypeAlias = tuple[float, ...]
"""Six numbers, in the order of State."""
Rates: TypeAlias = tuple[Vector, float]
"""The derivative of the state, and k*q there."""


def _rate_function(controls: Controls, craft: Craft) -> Callable[[Vector], Rates]:
    loads_at = load_function(controls, craft)
    mass, inertia = craft.mass, craft.inertia

    def rates_at(y: Vector) -> Rates:
        _, _, heading, vx, vy, yaw_rate = y
        force_x, force_y, moment, kq = loads_at(heading, vx, vy, yaw_rate)
        return (vx, vy, yaw_rate, force_x / mass, force_y / mass, moment / inertia), kq

    return rates_at


def _dormand_prince(
    y: Vector, first: Vector, h: float, rates_at: Callable[[Vector], Rates]
) -> tuple[Vector, Rates, float]:
    """One step: the new state, the rates there, and the largest component of the error estimate."""
    stages = [first]
    for row in STAGES:
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
    stability_limit: float
    """1: the largest sub-step times the fastest linearized drag rate up to which answers can be trusted."""
    rotation_limit: float
    """rad: the largest turn in a sub-step up to which they can. Both are measured: hovercraft-fmu stability."""


INTEGRATORS = (
    Integrator(
        "semi_implicit_euler",
        "Semi-implicit (symplectic) Euler: first order; the pose from the new velocity",
        semi_implicit_euler,
        2.0,
        0.5,
    ),
    Integrator(
        "drag_implicit",
        "Drag solved implicitly with its factor from the start of the sub-step: first order, stable at any step",
        drag_implicit,
        2.0,  # it never diverges, but under thrust it overshoots above
        0.5,
    ),
    Integrator("rk4", "The classic Runge-Kutta method: fourth order", rk4, 2.785, 0.5),
    Integrator(
        "adaptive",
        "Dormand-Prince 5(4) with steps that meet the tolerance; step_size is the first one",
        None,
        math.inf,
        math.inf,
    ),
)


def integrator_number(name: str) -> int:
    """The number of a method in the table, from 1. Raises ValueError with the names there are."""
    names = [method.name for method in INTEGRATORS]
    if name not in names:
        raise ValueError(f"integrator = {name!r}: must be one of {', '.join(names)}")
    return names.index(name) + 1


def integrator(number: int) -> Integrator:
    """The method with this number. Raises ValueError with the numbers there are."""
    if not 1 <= number <= len(INTEGRATORS):
        known = ", ".join(f"{i} ({method.name})" for i, method in enumerate(INTEGRATORS, 1))
        raise ValueError(f"integrator = {number!r}: must be one of {known}")
    return INTEGRATORS[number - 1]
