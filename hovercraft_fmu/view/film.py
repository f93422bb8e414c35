"""A page that plays what was recorded of some craft: one file, that needs no network."""

from collections.abc import Iterable, Mapping, Sequence
from math import floor, log10
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..model.craft import Craft
from .page import assembled

Column = NDArray[np.float64]
"""One value a point in time, shape (n,)."""
MOTION = ("pose.x", "pose.y", "pose.heading", "velocity.x", "velocity.y")
"""What is needed of a craft, in this order [m, m, rad, m/s, m/s]."""
BLOWN = ("thrust", "port_thruster", "starboard_thruster")
POINTS = 2000
"""In time, at most: between them, a craft goes straight on."""
FINE = 1e-3
"""Of a craft's length, of a radian, of full thrust, of the time between two points: a tenth of a pixel, or less."""
FARTHEST = 1e9
"""m, of a circle of doubt."""


class Moving(NamedTuple):
    """One craft on its way."""

    name: str
    craft: Craft
    motion: Sequence[Column]
    """As MOTION says."""
    blown: Sequence[Column] = ()
    """Thrust, port and starboard thruster [N, 1, 1], where they are known."""
    doubt: Column | None = None
    """m: how far off it may be."""
    is_ghost: bool = False
    """Whether it is what the first one is compared with: drawn as an outline."""


class Towline(NamedTuple):
    """Between the first two craft."""

    ends: Sequence[Sequence[float]]
    """m, each in the frame of its craft: x, y."""
    tension: Column
    """N; where it is 0, the line is drawn loose."""


def film(
    title: str,
    time: Column,
    crafts: Sequence[Moving],
    *,
    marks: Iterable[Sequence[float]] = (),
    towline: Towline | None = None,
    apart: Column | None = None,
) -> bytes:
    """The page.

    Args:
        title: what it is of.
        time: s, rising.
        crafts: one or two.
        marks: m: x, y of what lies on the way.
        towline: see there.
        apart: m: the distance of the craft, drawn over the time.
    """
    kept = np.unique(np.linspace(0, len(time) - 1, min(len(time), POINTS)).astype(int))
    data: dict[str, Any] = {
        "title": title,
        "time": _rounded(time[kept], FINE * float(np.diff(time).min())),
        "crafts": [_craft(each, kept) for each in crafts],
        "marks": [[float(x), float(y)] for x, y in marks],
    }
    if towline:
        ends = [[float(x), float(y)] for x, y in towline.ends]
        data["line"] = {"ends": ends, "tension": _rounded(towline.tension[kept], 0.01)}
    if apart is not None:
        data["apart"] = [float(f"{each:.3g}") for each in apart[kept]]
    return assembled("animation.html", "animation", data)


def _craft(moving: Moving, kept: NDArray[np.int_]) -> Mapping[str, Any]:
    """As animation.js says it."""
    craft, (x, y, heading, velocity_x, velocity_y) = moving.craft, moving.motion
    full = max(abs(craft.thrust_min), abs(craft.thrust_max)) or 1.0
    near = FINE * craft.length
    columns = {"x": (x, near), "y": (y, near), "heading": (heading, FINE)}
    columns["speed"] = np.hypot(velocity_x, velocity_y), 0.01
    blown = zip(moving.blown, (FINE * full, 0.01, 0.01), strict=False)
    columns |= zip(BLOWN, blown, strict=False)
    if moving.doubt is not None:
        columns["doubt"] = (np.fmin(moving.doubt, FARTHEST), near)
    return {
        "name": moving.name,
        "ghost": moving.is_ghost,
        "size": {"length": craft.length, "width": craft.width, "thrust": full},
        **{name: _rounded(column[kept], unit) for name, (column, unit) in columns.items()},
    }


def _rounded(column: Column, unit: float) -> list[float]:
    """To the power of ten that is not above the unit; whole numbers without a point."""
    rounded = np.round(column, -floor(log10(unit))).tolist()
    return [int(each) if each.is_integer() else each for each in rounded]
