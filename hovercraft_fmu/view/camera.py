"""Where metres lie on the screen. A view that stands still wraps at its edges, one that follows does not."""

import itertools
from collections.abc import Iterator, Sequence
from typing import NamedTuple, TypeAlias

from ..drawing.shapes import Shape, placed

Point: TypeAlias = tuple[float, float]
START = (0.1, 0.5)
"""Where the origin lies: a tenth of the way across, half way down."""


def wrapped(value: float, size: float) -> float:
    """In [0, size): the same place on a view of that size."""
    rest = value % size
    return rest if rest < size else 0.0  # -1e-20 % size is size


class Camera(NamedTuple):
    """A view that stands still, or one that follows the craft."""

    width: int
    """pixels"""
    height: int
    """pixels"""
    scale: float
    """pixels a metre, both ways"""
    followed: Point | None = None
    """m: the place in its middle, of one that follows"""

    def place(self, x: float, y: float) -> Point:
        """Where a point [m] is drawn [pixels]; inside the view, where it stands still."""
        if self.followed:
            return (
                0.5 * self.width + self.scale * (x - self.followed[0]),
                0.5 * self.height + self.scale * (y - self.followed[1]),
            )
        return (
            wrapped(START[0] * self.width + self.scale * x, self.width),
            wrapped(START[1] * self.height + self.scale * y, self.height),
        )

    def body(self, pose: Sequence[float], points: Shape) -> Shape:
        """Points of the body frame [m] around the place of a pose (x, y [m], heading [rad]); some may lie outside."""
        return placed(points, *self.place(pose[0], pose[1]), pose[2], self.scale)

    def copies(self, points: Sequence[Point]) -> Iterator[list[Point]]:
        """The points, and again on the far side where they reach over an edge: whatever of it can be seen."""
        xs, ys = zip(*points, strict=True)
        moves = (((0, 0),) if self.followed else
                 itertools.product((0, -self.width, self.width), (0, -self.height, self.height)))  # fmt: skip
        for right, down in moves:
            in_x = max(xs) + right >= 0.0 and min(xs) + right < self.width
            in_y = max(ys) + down >= 0.0 and min(ys) + down < self.height
            if in_x and in_y:
                yield [(x + right, y + down) for x, y in points]
