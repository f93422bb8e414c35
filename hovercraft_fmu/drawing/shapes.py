"""What pictures of the craft are made of."""

from collections.abc import Mapping
from math import cos, sin

from ..model.craft import Craft

Shape = list[tuple[float, float]]
"""Corners [m]."""


def placed(points: Shape, x: float, y: float, heading: float, scale: float = 1.0) -> Shape:
    """Points of the body frame, turned by the heading [rad] and moved to x, y; scale: units of x and y a metre."""
    c, s = scale * cos(heading), scale * sin(heading)
    return [(x + c * ahead - s * across, y + s * ahead + c * across) for ahead, across in points]


def jets(craft: Craft, thrust: float, port: float, starboard: float) -> Mapping[str, Shape]:
    """The air that is blown out, as triangles in the body frame; the stronger the push [N; 1; 1], the longer.

    Reverse thrust blows forward; what is off is left out.
    """
    stern, bow, side = -0.5 * craft.length, 0.5 * craft.length, 0.5 * craft.width
    full = max(abs(craft.thrust_min), abs(craft.thrust_max)) or 1.0
    root, wide, reach = 0.06 * craft.length, 0.5 * side, 0.9 * craft.width
    triangles = {
        "thrust": [(stern, -wide), (stern, wide), (stern - 0.7 * craft.length * thrust / full, 0.0)],
        "port": [(bow - root, -side), (bow + root, -side), (bow, -side - reach * port)],
        "starboard": [(bow - root, side), (bow + root, side), (bow, side + reach * starboard)],
    }
    return {name: triangles[name] for name, push in zip(triangles, (thrust, port, starboard), strict=True) if push}


def outline(craft: Craft) -> Shape:
    """The craft as five lines, around the centre of gravity, bow to the right.

    The closed outline in the body frame [m]: the box with a bow tip ahead of it; the first point is the last one, too.
    """
    length, width = craft.length, craft.width
    return [
        (0.75 * length, 0.0),
        (0.5 * length, 0.5 * width),
        (-0.5 * length, 0.5 * width),
        (-0.5 * length, -0.5 * width),
        (0.5 * length, -0.5 * width),
        (0.75 * length, 0.0),
    ]
