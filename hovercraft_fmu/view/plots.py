"""Pictures of a run."""

import os
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..coupling import Passage
from ..drawing.figures import check_plot, new_figure, save
from ..drawing.palette import QUIET, SEA, SWAY
from ..drawing.run_picture import draw_controls, draw_track, draw_wind
from ..simulation import Result
from ..whole import write_whole
from .film import BLOWN, MOTION, Moving, film

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def plot_run(result: Result, path: str | os.PathLike[str]) -> Path:
    """Draw a run, as `Result.plot` does, as a PNG, SVG or PDF.

    Raises:
        ValueError, ModuleNotFoundError: see `check_plot`.
        OSError: the file cannot be written.
    """
    path = check_plot(path)
    return save(result.plot(), path)


def plot_passage(passage: Passage, path: str | os.PathLike[str]) -> Path:
    """Draw the course, the path with the craft along it, commands and cross-track error over time: a PNG, SVG or PDF.

    Raises as `plot_run` does.
    """
    path = check_plot(path)
    figure = new_figure(figsize=(12.0, 6.75), dpi=120, layout="constrained")
    grid = figure.add_gridspec(3, 2, width_ratios=(1.25, 1.0))
    voyage, time = passage.voyage, passage["time"]
    end = f"arrived after {time[-1]:g} s" if passage.arrived else f"not arrived within {time[-1]:g} s"
    figure.suptitle(f"{voyage.name}: {voyage.description}; {end}")
    axes = figure.add_subplot(grid[:, 0])
    _draw_course(axes, passage)
    draw_track(axes, passage, passage.craft)
    wind_x, wind_y = (np.array([passage.voyage.craft.get(name, 0.0)]) for name in ("wind.x", "wind.y"))
    draw_wind(axes, wind_x, wind_y, at=(0.3, 0.65))
    controls = figure.add_subplot(grid[0, 1])
    draw_controls(controls, time, passage["thrust"], (passage["port_thruster"], passage["starboard_thruster"]))
    off = figure.add_subplot(grid[1, 1], sharex=controls)
    off.plot(time, passage["cross_track_error"], color=SEA)
    off.set_ylabel("[m], to starboard")
    off.set_title("Cross-track error", loc="left")
    off.grid(alpha=0.3)
    course = figure.add_subplot(grid[2, 1], sharex=controls)
    over_ground = np.unwrap(np.arctan2(passage["velocity.y"][1:], passage["velocity.x"][1:]))
    course.plot(time, np.degrees(passage["pose.heading"]), color=SEA, label="heading")
    course.plot(time[1:], np.degrees(over_ground), color=SWAY, linewidth=1.0, label="course over ground")
    course.set_ylabel("[deg], to starboard")
    course.set_xlabel("time [s]")
    course.set_title("Heading", loc="left")
    course.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, fontsize="small", frameon=False,
                  borderaxespad=0.2)  # fmt: skip
    course.grid(alpha=0.3)
    return save(figure, path)


def animate_passage(passage: Passage, path: str | os.PathLike[str]) -> Path:
    """Write the craft on its voyage, with the waypoints, as a page that needs no network. Raises OSError: it cannot be
    written.
    """
    path, voyage = Path(path), passage.voyage
    motion, blown = ([passage[name] for name in names] for names in (MOTION, BLOWN))
    craft = Moving("hovercraft", passage.craft, motion, blown)
    title = f"{voyage.name}: {voyage.description}"
    write_whole(path, film(title, passage["time"], [craft], marks=passage.waypoints))
    return path


def _draw_course(axes: "Axes", passage: Passage) -> None:
    """The legs, and the circles in which a waypoint is reached."""
    start = (passage["pose.x"][0], passage["pose.y"][0])
    x, y = np.array([start, *passage.waypoints]).T
    axes.plot(x, y, color=QUIET, linestyle="--", linewidth=1.0)
    angle = np.linspace(0.0, 2.0 * np.pi, 60)
    for number, point in enumerate(passage.waypoints, 1):
        circle_x = point[0] + passage.acceptance_radius * np.cos(angle)
        circle_y = point[1] + passage.acceptance_radius * np.sin(angle)
        axes.plot(circle_x, circle_y, color=QUIET, linewidth=1.0)
        axes.annotate(f"{number}", point, ha="center", va="center", zorder=4)
