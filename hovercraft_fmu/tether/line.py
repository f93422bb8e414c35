"""The law of the line: what it does to the two craft that it is made fast to. Plain floats, `math` alone.

Each end is fixed to a point of its craft, o = R(heading)*(x, y) away from the centre of gravity, and moves with
(vx - r*oy, vy + r*ox). With the distance d of the two ends and n, the direction from the first to the second,

    tension = stiffness*(d - slack_length) + damping*(d(d)/dt)    where d > slack_length, and never below 0

(Kelvin and Voigt's spring and dashpot, side by side): it pulls, and never pushes. The first craft feels tension*n, the
second -tension*n, each at its end of the line, so with the moment ox*Fy - oy*Fx about its centre of gravity. Momentum
is kept to the bit. Where the ends meet there is no direction, and no force.
"""

import math
from typing import NamedTuple

from ..model.dynamics import Loads, State


class Line(NamedTuple):
    """What it is made of, and where it is made fast."""

    stiffness: float = 10.0
    """N/m"""
    damping: float = 10.0
    """N.s/m"""
    slack_length: float = 30.0
    """m: below it the line hangs loose"""
    first_x: float = -2.0
    """m, body frame of the first craft: near its middle, as a tug has its hook, or the line would hold its heading"""
    first_y: float = 0.0
    """m"""
    second_x: float = 10.0
    """m, body frame of the second craft: the bow"""
    second_y: float = 0.0
    """m"""


NOT_NEGATIVE = ("stiffness", "damping", "slack_length")


class Pull(NamedTuple):
    """What it does."""

    first: Loads = Loads(0.0, 0.0, 0.0)
    """N, N, N.m: on the first craft"""
    second: Loads = Loads(0.0, 0.0, 0.0)
    """on the second"""
    tension: float = 0.0
    """N"""
    distance: float = 0.0
    """m: of the two ends"""


def check_line(name: str, value: float) -> None:
    """Raises ValueError, with the name, the value and the rule, where one parameter is impossible."""
    if not math.isfinite(value):
        raise ValueError(f"{name} = {value!r}: must be a finite number")
    if name in NOT_NEGATIVE and value < 0.0:
        raise ValueError(f"{name} = {value!r}: must not be negative")


def pull(first: State, second: State, line: Line) -> Pull:
    """What the line does to two craft."""
    near, far = _end(first, line.first_x, line.first_y), _end(second, line.second_x, line.second_y)
    dx, dy = far.x - near.x, far.y - near.y
    distance = math.sqrt(dx * dx + dy * dy)
    if not distance > line.slack_length:
        return Pull(distance=distance)
    along_x, along_y = dx / distance, dy / distance
    speed = (far.vx - near.vx) * along_x + (far.vy - near.vy) * along_y
    tension = line.stiffness * (distance - line.slack_length) + line.damping * speed
    if tension <= 0.0:
        return Pull(distance=distance)
    force_x, force_y = tension * along_x, tension * along_y
    return Pull(
        Loads(force_x, force_y, near.arm_x * force_y - near.arm_y * force_x),
        Loads(-force_x, -force_y, far.arm_y * force_x - far.arm_x * force_y),
        tension,
        distance,
    )


class _End(NamedTuple):
    """An end of the line, in the world frame."""

    x: float
    y: float
    vx: float
    vy: float
    arm_x: float
    """m: from the centre of gravity"""
    arm_y: float


def _end(craft: State, x: float, y: float) -> _End:
    c, s = math.cos(craft.heading), math.sin(craft.heading)
    arm_x, arm_y = c * x - s * y, s * x + c * y
    vx, vy = craft.vx - craft.yaw_rate * arm_y, craft.vy + craft.yaw_rate * arm_x
    return _End(craft.x + arm_x, craft.y + arm_y, vx, vy, arm_x, arm_y)
