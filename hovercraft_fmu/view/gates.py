"""A course of gates, and the clock of whoever passes them in their order: that of the page to play (page/course.js)."""

from math import cos, sin
from typing import TypeAlias

from ..drawing.shapes import Shape, placed

Pose: TypeAlias = tuple[float, float, float]
"""x, y [m], heading [rad]"""
WIDTH = 60.0
"""m"""
SPACING = 110.0
"""m"""
GATES: Shape = [(SPACING * x, SPACING * y) for x, y in ((1, 0), (2, 0.16), (3, -0.16), (4, 0.16), (5, 0))]
"""To starboard and to port in turn, in the frame of the pose where the course begins."""


class Course:
    """It lies ahead of a craft; the first gate starts the clock."""

    def __init__(self, start: Pose) -> None:
        self._heading, self._last, self._began, self._took = start[2], start, 0.0, 0.0
        self.gates = placed(GATES, *start)
        """m: their middles."""
        self.next = 0

    @property
    def is_finished(self) -> bool:
        """Whether all are passed."""
        return self.next == len(self.gates)

    @property
    def words(self) -> str:
        """What comes next."""
        return "all gates" if self.is_finished else f"gate {self.next + 1} of {len(self.gates)}"

    @property
    def posts(self) -> list[tuple[Shape, bool]]:
        """Port and starboard post [m] of each gate, and whether it is still to be passed."""
        ends = [(0.0, -0.5 * WIDTH), (0.0, 0.5 * WIDTH)]
        return [(placed(ends, x, y, self._heading), i >= self.next) for i, (x, y) in enumerate(self.gates)]

    def go(self, pose: Pose, time: float) -> None:
        """The craft is there, at that time [s]."""
        before, self._last = self._last, pose
        if self.is_finished or not self._crosses(before, pose):
            return
        self._began = time if self.next == 0 else self._began
        self.next += 1
        self._took = time - self._began

    def clock(self, time: float) -> float:
        """s: since the first gate, until the last."""
        return self._took if self.is_finished or self.next == 0 else time - self._began

    def _crosses(self, a: Pose, b: Pose) -> bool:
        """Whether a way leads through the next gate, between its posts."""
        x, y = self.gates[self.next]
        c, s = cos(self._heading), sin(self._heading)
        (along_a, across_a), (along_b, across_b) = (
            (c * (each[0] - x) + s * (each[1] - y), c * (each[1] - y) - s * (each[0] - x)) for each in (a, b)
        )
        if not along_a < 0.0 <= along_b:
            return False
        share = -along_a / (along_b - along_a)
        return abs(across_a + share * (across_b - across_a)) <= 0.5 * WIDTH
