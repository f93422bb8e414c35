"""The colours of every picture and animation: one for each meaning, told apart in greyscale and by the colour-blind.

What stands side by side differs in lightness, too; lines of methods have a marker each. tests/test_palette.py measures
it. (The icon of the FMU is a file; the sea and the hull are as there.)
"""

from types import MappingProxyType
from typing import NamedTuple

from ..model.integrators import INTEGRATORS


class Style(NamedTuple):
    """How the lines of one of several things that are compared are drawn."""

    color: str
    marker: str


SERIES = (
    Style("#d55e00", "o"),
    Style("#f0b34a", "s"),
    Style("#0b4f8c", "^"),
    Style("#30104d", "D"),
    Style("#4fae94", "v"),
)
METHODS = MappingProxyType({method.name: style for method, style in zip(INTEGRATORS, SERIES, strict=False)})
"""A method is drawn the same way in every picture."""
OTHER = SERIES[-1].color
"""Of a second run with the method of the first."""

SEA, HULL = "#0b4f6c", "#fbfbff"
CRAFT, WIND, SWAY, INK = "#d3e7f0b0", "#5b7f95", "#f08a24", "#000000"
QUIET, FAINT_LINE = "#606060", "#b0b0b0"
"""What is there for comparison; lines on the ground."""
PORT, STARBOARD = "#b3001b", "#2bb673"
"""Port is red, starboard is green, as at sea; the one is dark, the other light."""
JETS = MappingProxyType({"thrust": "#f0b429", "port": PORT, "starboard": STARBOARD})
SHADES = "viridis"
"""matplotlib's name of the colours of a quantity, whose lightness grows evenly."""

GROUND, GRID, PANEL = "#0a3a50", "#114a64", "#06222f"
"""Of the window of the drive, which is dark."""
TRAIL, TEXT, FAINT, WARNING = "#7fc8e8", "#e8f4fa", "#7fa6b8", "#f6ae2d"
WINDOW_JETS = MappingProxyType({"thrust": WARNING, "port": "#ff5050", "starboard": "#8ff0b4"})
