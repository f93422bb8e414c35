"""The icon of the FMU: the craft from above; and the outline that every picture draws it with."""

import io
import math

from PIL import Image, ImageDraw

from ..model.craft import Craft

SIZE = 128
FINE = 8
"""Drawn so many times larger, and then made smaller: smooth edges."""
HEADING = math.radians(-35.0)
SEA, WAKE, HULL, EDGE, JET = "#0b4f6c", "#4fa3c7", "#fbfbff", "#01161e", "#f6ae2d"


def outline(craft: Craft) -> list[tuple[float, float]]:
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


def icon_png() -> bytes:
    """A PNG image, 128 x 128, the same bytes at every call."""
    image = Image.new("RGBA", (SIZE * FINE, SIZE * FINE), (0, 0, 0, 0))
    draw = ImageDraw.Draw(image)
    draw.rounded_rectangle((0, 0, SIZE * FINE - 1, SIZE * FINE - 1), radius=20 * FINE, fill=SEA)
    for side in (-4.0, 0.0, 4.0):
        draw.line([_pixel(-10.5, side), _pixel(-22.0 + abs(side), side)], fill=WAKE, width=3 * FINE)
    hull = [_pixel(x, y) for x, y in outline(Craft())]
    draw.polygon(hull, fill=HULL)
    draw.line(hull, fill=EDGE, width=3 * FINE, joint="curve")
    draw.line([_pixel(-7.5, -3.0), _pixel(-7.5, 3.0)], fill=EDGE, width=4 * FINE)
    for side in (-1.0, 1.0):
        draw.line([_pixel(9.0, 2.5 * side), _pixel(9.0, 4.5 * side)], fill=JET, width=4 * FINE)
    buffer = io.BytesIO()
    image.resize((SIZE, SIZE), Image.Resampling.LANCZOS).save(buffer, "PNG", optimize=True)
    return buffer.getvalue()


def _pixel(x: float, y: float) -> tuple[float, float]:
    """From the body frame [m] to the picture."""
    scale = SIZE * FINE / 44.0
    c, s = math.cos(HEADING), math.sin(HEADING)
    return SIZE * FINE * 0.5 + scale * (c * x - s * y), SIZE * FINE * 0.5 + scale * (s * x + c * y)
