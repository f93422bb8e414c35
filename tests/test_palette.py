"""The colours can be told apart: in greyscale, and by people who see fewer of them."""

import itertools
import re

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import ImageColor

from hovercraft_fmu.drawing.palette import (
    FAINT,
    GRID,
    GROUND,
    JETS,
    METHODS,
    PANEL,
    PORT,
    SERIES,
    STARBOARD,
    TEXT,
    TRAIL,
    WARNING,
    WINDOW_JETS,
)
from hovercraft_fmu.model.integrators import INTEGRATORS
from hovercraft_fmu.view.page import FOLDER

Color = NDArray[np.float64]
XYZ = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
"""IEC 61966-2-1 (sRGB), of linear red, green and blue; the white is D65."""
WHITE = XYZ.sum(axis=1)
# Brettel, Vienot and Mollon (1997) in the linear form of Vienot, Brettel and Mollon (1999): protanopia, deuteranopia
SEEN = {
    "all": np.eye(3),
    "protanopia": np.array([[0.11238, 0.88762, 0.0], [0.11238, 0.88762, 0.0], [0.00401, -0.00401, 1.0]]),
    "deuteranopia": np.array([[0.29275, 0.70725, 0.0], [0.29275, 0.70725, 0.0], [-0.02234, 0.02234, 1.0]]),
    "greyscale": np.tile(XYZ[1], (3, 1)),
}
LEAST = {"all": 25.0, "protanopia": 12.0, "deuteranopia": 12.0, "greyscale": 10.0}
"""CIE 1976: 2.3 can just be seen, side by side; 10 at a glance."""


def lab(color: str, kind: str) -> Color:
    """CIE 1976 L*, a*, b* of a colour as it is seen."""
    parts = np.array(ImageColor.getrgb(color)[:3]) / 255.0
    linear = np.where(parts <= 0.04045, parts / 12.92, ((parts + 0.055) / 1.055) ** 2.4)
    ratios = XYZ @ np.clip(SEEN[kind] @ linear, 0.0, 1.0) / WHITE
    x, y, z = np.where(ratios > (6 / 29) ** 3, np.cbrt(ratios), ratios * (29 / 6) ** 2 / 3 + 4 / 29)
    return np.array([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)])


@pytest.mark.parametrize("kind", SEEN)
@pytest.mark.parametrize(
    "colors",
    [[style.color for style in SERIES], [PORT, STARBOARD], [WINDOW_JETS["port"], WINDOW_JETS["starboard"]]],
    ids=("methods", "sides", "sides in the window"),
)
def test_what_stands_side_by_side_can_be_told_apart(colors: list[str], kind: str) -> None:
    for a, b in itertools.combinations(colors, 2):
        assert np.linalg.norm(lab(a, kind) - lab(b, kind)) >= LEAST[kind], (a, b)


WINDOW = {"ground": GROUND, "grid": GRID, "paper": PANEL, "wake": TRAIL, "ink": TEXT, "faint": FAINT, "thrust": WARNING}


def test_the_page_in_the_dark_has_the_colours_of_the_window() -> None:
    """In light, the sides are those of the pictures."""
    style = (FOLDER / "page.css").read_text(encoding="utf-8")
    light, dark = (dict(re.findall(r"--([a-z]+): (#[0-9a-f]+);", block)) for block in style.split("dark) {")[:2])
    jets = {name: WINDOW_JETS[name] for name in ("port", "starboard")}
    assert {name: dark[name] for name in (*WINDOW, *jets)} == {**WINDOW, **jets}
    assert light["port"] == PORT
    for sides in (light, dark):
        assert np.linalg.norm(lab(sides["port"], "all") - lab(sides["starboard"], "all")) >= LEAST["all"]


def test_every_method_has_a_colour_and_a_marker_of_its_own() -> None:
    assert list(METHODS) == [method.name for method in INTEGRATORS]
    for part in zip(*METHODS.values(), strict=True):
        assert len(set(part)) == len(INTEGRATORS)


def test_the_jets_are_red_and_green_as_at_sea() -> None:
    for jets in (JETS, WINDOW_JETS):
        assert lab(jets["port"], "all")[1] > 40.0  # a*: red
        assert lab(jets["starboard"], "all")[1] < -30.0  # green
