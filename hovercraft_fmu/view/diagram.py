"""The diagram of the model: axes, signs, and where propeller, bow thrusters and drag act."""

import math
from typing import TYPE_CHECKING

from ..drawing.figures import new_figure
from ..drawing.palette import INK, JETS, QUIET, SEA
from ..drawing.shapes import outline
from ..model.craft import Craft

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HEADING = math.radians(25.0)
CENTRE = (21.0, 15.0)
"""m: where the craft is drawn, world frame."""


def draw_diagram() -> "Figure":
    """The craft at a heading, seen from above, y down the screen."""
    figure = new_figure(figsize=(7.2, 4.8), dpi=100, layout="constrained")
    axes = figure.add_subplot()
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_xlim(-2.0, 50.0)
    axes.set_ylim(33.0, -2.0)
    craft = Craft()
    axes.fill(*zip(*(_world(x, y) for x, y in outline(craft)), strict=True), facecolor="#eef4f7", edgecolor=SEA)
    _frames(axes)
    _actuators(axes, craft)
    _drag(axes, craft)
    return figure


def _world(x: float, y: float) -> tuple[float, float]:
    """From the body frame [m] to the world."""
    c, s = math.cos(HEADING), math.sin(HEADING)
    return CENTRE[0] + c * x - s * y, CENTRE[1] + s * x + c * y


def _arrow(axes: "Axes", begin: tuple[float, float], end: tuple[float, float], text: str, color: str) -> None:
    """An arrow in the world, its text beyond its tip."""
    axes.annotate("", end, begin, arrowprops={"arrowstyle": "-|>", "color": color, "linewidth": 1.6})
    beyond = 1.0 + 2.2 / math.dist(begin, end)
    place = [tail + beyond * (tip - tail) for tail, tip in zip(begin, end, strict=True)]
    axes.text(place[0], place[1], text, color=color, ha="center", va="center", fontsize=9)


def _frames(axes: "Axes") -> None:
    _arrow(axes, (0.0, 0.0), (8.0, 0.0), "x", INK)
    _arrow(axes, (0.0, 0.0), (0.0, 8.0), "y", INK)
    axes.text(1.2, 1.6, "world", fontsize=9)
    _arrow(axes, _world(0.0, 0.0), _world(21.0, 0.0), "surge u", INK)
    _arrow(axes, _world(0.0, 0.0), _world(0.0, 9.5), "sway v", INK)
    axes.plot((CENTRE[0], CENTRE[0] + 24.0), (CENTRE[1], CENTRE[1]), color=QUIET, linewidth=0.8, linestyle="--")
    turns = [HEADING * i / 20.0 for i in range(21)]
    axes.plot(
        [CENTRE[0] + 18.0 * math.cos(a) for a in turns], [CENTRE[1] + 18.0 * math.sin(a) for a in turns], color=INK
    )
    axes.text(CENTRE[0] + 18.8, CENTRE[1] + 3.6, "heading: to starboard\nis positive, as is yaw", fontsize=9)
    axes.plot(*CENTRE, marker="o", color=INK, markersize=5)
    axes.text(CENTRE[0] - 0.6, CENTRE[1] - 1.4, "centre of\ngravity", fontsize=8, ha="center", va="bottom")


def _actuators(axes: "Axes", craft: Craft) -> None:
    bow, side = 0.5 * craft.length, 0.5 * craft.width
    _arrow(axes, _world(-bow - 5.5, 0.0), _world(-bow, 0.0), "", JETS["thrust"])
    axes.text(*_world(-bow - 6.5, 0.0), "thrust", fontsize=9, ha="right", va="center")
    _arrow(axes, _world(bow, -side - 5.0), _world(bow, -side), "", JETS["port"])
    axes.text(*_world(bow, -side - 6.0), "port thruster:\nbow to starboard", fontsize=9, ha="center", va="bottom")
    _arrow(axes, _world(bow, side + 5.0), _world(bow, side), "", JETS["starboard"])
    axes.text(*_world(bow, side + 5.6), "starboard thruster:\nbow to port", fontsize=9, ha="center", va="top")


def _drag(axes: "Axes", craft: Craft) -> None:
    point = _world(craft.drag_center_fraction * craft.length, 0.0)
    axes.plot(*point, marker="X", color=INK, markersize=8)
    axes.annotate(
        "centre of drag:\ndrag_center_fraction * length\nahead of the centre of gravity", point,
        (0.0, 30.0), fontsize=9, arrowprops={"arrowstyle": "-", "color": QUIET},
    )  # fmt: skip
