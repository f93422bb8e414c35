"""The methods that carry a state over n equal sub-steps: one function a method, one table of them."""

import math
from collections.abc import Callable
from typing import NamedTuple, TypeAlias

from .craft import Craft
from .dynamics import Controls, Namespace, State, load_function

Integrate: TypeAlias = Callable[[State, Controls, Craft, float, int, Namespace], State]
"""(state, controls, craft, sub-step h [s], number of sub-steps n, namespace) -> state after n*h."""


def semi_implicit_euler(
    state: State, controls: Controls, craft: Craft, h: float, n: int, ns: Namespace = math
) -> State:
    """Symplectic Euler: loads from the start of the sub-step, velocity first, then the pose from the new velocity.

    First order. The loop holds plain numbers: an object made at every sub-step would cost more than the physics.
    """
    loads_at = load_function(controls, craft, ns)
    mass, inertia = craft.mass, craft.inertia
    x, y, heading, vx, vy, yaw_rate = state
    for _ in range(n):
        force_x, force_y, moment = loads_at(heading, vx, vy, yaw_rate)
        # `a = a + b`, never `a += b`: that would write into the caller's arrays
        vx = vx + h * (force_x / mass)
        vy = vy + h * (force_y / mass)
        x = x + h * vx
        y = y + h * vy
        yaw_rate = yaw_rate + h * (moment / inertia)
        heading = heading + h * yaw_rate
    return State(x, y, heading, vx, vy, yaw_rate)


class Integrator(NamedTuple):
    """A row of the table; its number in the FMU is its place, counted from 1."""

    name: str
    description: str
    integrate: Integrate


INTEGRATORS = (
    Integrator(
        "semi_implicit_euler",
        "Semi-implicit (symplectic) Euler: first order; the pose from the new velocity",
        semi_implicit_euler,
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
