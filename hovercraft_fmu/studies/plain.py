"""The default step as it was before scenes could ask for more: what the terms are held against where they are off."""

import math

from ..model.craft import Craft
from ..model.dynamics import Controls, LoadFunction, Namespace, State, actuation
from ..model.integrators import INTEGRATORS, Stretch


def plain_euler(state: State, controls: Controls, craft: Craft, h: float, n: int, ns: Namespace = math) -> Stretch:
    """n sub-steps of h [s] of semi-implicit Euler, with the default's drag and nothing else; one craft."""
    loads_at = _plain_loads(controls, craft)
    mass, inertia, single = craft.mass, craft.inertia, ns is math
    x, y, heading, vx, vy, yaw_rate = state
    most, left, right = 0.0, yaw_rate, yaw_rate
    for _ in range(n):
        force_x, force_y, moment, kq = loads_at(heading, vx, vy, yaw_rate)
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
    most = max(most, loads_at(heading, vx, vy, yaw_rate)[3])
    return Stretch(State(x, y, heading, vx, vy, yaw_rate), n, h * most, h * max(right, -left))


def _plain_loads(controls: Controls, craft: Craft) -> LoadFunction:
    cos, sin, sqrt = math.cos, math.sin, math.sqrt
    k, x_d = craft.drag_factor, craft.drag_center
    thrust, side, turn = actuation(controls, craft)

    def loads_at(heading: float, vx: float, vy: float, yaw_rate: float) -> tuple[float, float, float, float]:
        c = cos(heading)
        s = sin(heading)
        u = c * vx + s * vy
        w = c * vy - s * vx + yaw_rate * x_d
        kq = k * sqrt(u * u + w * w)
        drag_y = -kq * w
        force_x = thrust - kq * u
        force_y = drag_y + side
        return c * force_x - s * force_y, s * force_x + c * force_y, x_d * drag_y + turn, kq

    return loads_at


PLAIN = INTEGRATORS[0]._replace(name="plain_euler", integrate=plain_euler)
"""As a row of the table of methods."""
