"""Pictures of a tow: both craft and the line between them, still and moving."""

import importlib
import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from ..drawing.figures import check_plot, new_figure, save
from ..drawing.palette import CRAFT, INK, QUIET, SEA, SWAY
from ..drawing.shapes import outline, placed
from ..towing import Towed
from ..whole import write_whole, written
from .animation import Tell, check_animation
from .film import MOTION, Moving, Towline, film

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLORS = {"first": SEA, "second": SWAY}
PLACES = 8
"""Where the craft are drawn along their way, at most; they are a length of the craft apart at least."""
FRAMES = 80
"""At most."""
FRAME_TIME, LAST_FRAME_TIME = 75, 2000
"""ms"""


def plot_tow(towed: Towed, path: str | os.PathLike[str]) -> Path:
    """Draw the paths with both craft and the line along them, tension and distance and speeds over time: a PNG, SVG or
    PDF.

    Raises:
        ValueError, ModuleNotFoundError: see `check_plot`.
        OSError: the file cannot be written.
    """
    path = check_plot(path)
    figure = new_figure(figsize=(12.0, 6.75), dpi=120, layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=(1.25, 1.0))
    time, pulls = towed["time"], int((towed["tension"] > 0.0).sum())
    figure.suptitle(f"A tow on ice, {time[-1]:g} s: the line pulls at {towed['tension'].max():.1f} N at most, and at "
                    f"{pulls} of {len(time)} communication points")  # fmt: skip
    axes = figure.add_subplot(grid[:, 0])
    x, y = towed["first.pose.x"], towed["first.pose.y"]
    along = np.append(0.0, np.hypot(np.diff(x), np.diff(y)).cumsum())
    apart = max(towed.tow.craft.length, float(along[-1]) / PLACES)
    between = np.searchsorted(along, np.arange(apart, along[-1] - 0.999 * apart, apart))
    _draw_paths(axes, towed)
    for i in (0, *between, len(time) - 1):
        _draw_craft(axes, towed, int(i))
    axes.set_aspect("equal", adjustable="datalim")
    axes.invert_yaxis()
    axes.set_title(f"Paths; craft and line every {apart:.3g} m of the first")
    axes.legend(loc="lower left")
    tension = figure.add_subplot(grid[0, 1])
    tension.plot(time, towed["tension"], color=INK, linewidth=1.2)
    _label(tension, "Tension of the line", "[N]")
    distance = figure.add_subplot(grid[1, 1], sharex=tension)
    distance.plot(time, towed["distance"], color=INK, linewidth=1.2)
    distance.axhline(towed.tow.line.slack_length, color=QUIET, linestyle="--", linewidth=1.0)
    _label(distance, "Distance of its ends; dashed: below it hangs loose", "[m]")
    speed = figure.add_subplot(grid[2, 1], sharex=tension)
    for craft, color in COLORS.items():
        speed.plot(time, np.hypot(towed[f"{craft}.velocity.x"], towed[f"{craft}.velocity.y"]), color=color,
                   label=craft)  # fmt: skip
    speed.legend()
    _label(speed, "Speeds", "[m/s]")
    speed.set_xlabel("time [s]")
    return save(figure, path)


def _label(axes: "Axes", title: str, unit: str) -> None:
    axes.set_title(title, loc="left")
    axes.set_ylabel(unit)
    axes.grid(alpha=0.3)


def _draw_paths(axes: "Axes", towed: Towed) -> None:
    for craft, color in COLORS.items():
        axes.plot(towed[f"{craft}.pose.x"], towed[f"{craft}.pose.y"], color=color, linewidth=1.2, label=craft)
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m], downward")
    axes.grid(alpha=0.3)


def _draw_craft(axes: "Axes", towed: Towed, i: int) -> None:
    """Both craft, and the line: drawn out where it is taut, dotted where it hangs loose."""
    for craft, color in COLORS.items():
        pose = (float(towed[f"{craft}.pose.{name}"][i]) for name in ("x", "y", "heading"))
        corners = placed(outline(towed.tow.craft), *pose)
        axes.fill(*np.transpose(corners), facecolor=CRAFT, edgecolor=color, linewidth=1.0, zorder=3)
    taut = towed["tension"][i] > 0.0
    axes.plot(*towed.ends()[i].T, color=INK, linewidth=1.0, linestyle="-" if taut else ":", zorder=4)


def animate_tow(towed: Towed, path: str | os.PathLike[str], tell: Tell = lambda _: None) -> Path:
    """Write both craft on their way, and the line, as a GIF or as a page that needs no network.

    `tell` is called with the part of the work that is done, 0 to 1.

    Raises:
        ValueError, ModuleNotFoundError: see `check_animation`.
        OSError: the file cannot be written.
    """
    path = check_animation(path)
    if path.suffix == ".html":
        write_whole(path, _film(towed))
        return path
    time = towed["time"]
    chosen = np.unique(np.searchsorted(time, np.linspace(time[0], time[-1], FRAMES) - 1e-6).clip(0, len(time) - 1))
    room = 1.2 * towed.tow.craft.length
    low, high = (
        [bound(bound(towed[f"{craft}.pose.{name}"]) for craft in COLORS) for name in "xy"] for bound in (min, max)
    )
    corners = ((low[0] - room, high[0] + room), (high[1] + room, low[1] - room))
    images = []
    for done, i in enumerate(chosen, 1):
        images.append(_frame(towed, int(i), corners))
        tell(done / len(chosen))
    first, *rest = images
    palette = first.quantize(colors=64, dither=Image.Dither.NONE)
    still, *moving = (image.quantize(palette=palette, dither=Image.Dither.NONE) for image in (first, *rest))
    times = [FRAME_TIME] * len(moving) + [LAST_FRAME_TIME]
    with written(path) as unfinished:
        still.save(unfinished, "GIF", save_all=True, append_images=moving, duration=times, loop=0, optimize=True)
    return path


def _film(towed: Towed) -> bytes:
    time, tow = towed["time"], towed.tow
    helm = np.array(tow.helm)
    now = helm[np.searchsorted(helm[:, 0], time * (1.0 + 1e-12), "right") - 1]
    first, second = ([towed[f"{craft}.{name}"] for name in MOTION] for craft in COLORS)
    crafts = (Moving("first", tow.craft, first, list(now.T[1:])), Moving("second", tow.craft, second))
    ends = Towline(np.reshape(tow.line[3:], (2, 2)).tolist(), towed["tension"])
    return film(f"A tow on ice: {time[-1]:g} s", time, crafts, towline=ends)


def _frame(towed: Towed, i: int, corners: tuple[tuple[float, float], tuple[float, float]]) -> Image.Image:
    """The view stands still: its left and right, its bottom and top [m]."""
    figure: Figure = new_figure(figsize=(7.0, 5.0), dpi=80, layout="constrained")
    canvas = importlib.import_module("matplotlib.backends.backend_agg").FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    _draw_paths(axes, towed)
    _draw_craft(axes, towed, i)
    axes.set_xlim(*corners[0])
    axes.set_ylim(*corners[1])
    axes.set_aspect("equal", adjustable="box")
    axes.set_title(f"{towed['time'][i]:.0f} s; the line pulls at {towed['tension'][i]:.1f} N")
    canvas.draw()
    return Image.fromarray(np.array(canvas.buffer_rgba())).convert("RGB")
