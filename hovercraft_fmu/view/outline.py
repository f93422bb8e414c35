"""The craft as it is drawn: five lines, around the centre of gravity, bow to the right."""

from ..model.craft import Craft


def outline(craft: Craft) -> list[tuple[float, float]]:
    """The closed outline in the body frame [m]: the box with a bow tip ahead of it; first point = last point."""
    length, width = craft.length, craft.width
    return [
        (0.75 * length, 0.0),
        (0.5 * length, 0.5 * width),
        (-0.5 * length, 0.5 * width),
        (-0.5 * length, -0.5 * width),
        (0.5 * length, -0.5 * width),
        (0.75 * length, 0.0),
    ]
