"""Pictures of a run."""

import importlib
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..coupling import Passage
from ..fmu.icon import outline
from ..model.craft import Craft
from ..simulation import Result
from .palette import CRAFT, INK, PORT, QUIET, SEA, STARBOARD, SWAY, WIND
from .shapes import placed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CRAFT_COUNT = 25
"""Outlines along the path."""


def plot_run(result: Result, path: str | os.PathLike[str]) -> Path:
    """Draw the path with the craft along it, the controls, the speeds and the heading over time, as a PNG; and where
    the FMU tells it how far it is off.

    Raises:
        ValueError, ModuleNotFoundError: see `check_plot`.
        OSError: the file cannot be written.
    """
    path = check_plot(path)
    figure = new_figure(figsize=(12.0, 6.75), dpi=120, layout="constrained")
    grid = figure.add_gridspec(3 + result.is_estimated, 2, width_ratios=(1.25, 1.0))
    told = f"; {result.error_in_words}" if result.is_estimated else ""
    title = f"{result.run.title}: {result.distance:.0f} m in {result['time'][-1] - result['time'][0]:g} s"
    figure.suptitle(title + told)
    _draw_path(figure.add_subplot(grid[:, 0]), result)
    controls = figure.add_subplot(grid[0, 1])
    speed = figure.add_subplot(grid[1, 1], sharex=controls)
    heading = figure.add_subplot(grid[2, 1], sharex=controls)
    thrusters = result["port_thruster"], result["starboard_thruster"]
    _draw_controls(controls, result["time"], result["applied.thrust"], thrusters)
    _draw_speed(speed, result)
    _draw_heading(heading, result)
    if result.is_estimated:
        heading.set_xlabel("")
        _draw_error(figure.add_subplot(grid[3, 1], sharex=controls), result)
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, format="png", metadata={"Software": None})
    return path


def check_plot(path: str | os.PathLike[str]) -> Path:
    """The path; so that a run need not be made to learn that it cannot be drawn.

    Raises:
        ValueError: the name does not end in .png.
        ModuleNotFoundError: matplotlib is not installed; says how to install it.
    """
    path = Path(path)
    if path.suffix != ".png":
        raise ValueError(f"plot = {str(path)!r}: must end in .png")
    new_figure()
    return path


def new_figure(**options: Any) -> "Figure":
    """matplotlib's Figure, without a window. Raises ModuleNotFoundError, which says how to install it."""
    try:
        module = importlib.import_module("matplotlib.figure")
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            "pictures need matplotlib, which is not installed: pip install 'hovercraft-fmu[plot]'"
        ) from error
    figure: Figure = module.Figure(**options)
    return figure


def plot_passage(passage: Passage, path: str | os.PathLike[str]) -> Path:
    """Draw the course, the path with the craft along it, the commands and the cross-track error over time, as a PNG.

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
    _draw_track(axes, passage, passage.craft)
    wind_x, wind_y = (np.array([passage.voyage.craft.get(name, 0.0)]) for name in ("wind.x", "wind.y"))
    _draw_wind(axes, wind_x, wind_y, at=(0.3, 0.65))
    controls = figure.add_subplot(grid[0, 1])
    _draw_controls(controls, time, passage["thrust"], (passage["port_thruster"], passage["starboard_thruster"]))
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
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, format="png", metadata={"Software": None})
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


def _draw_path(axes: "Axes", result: Result) -> None:
    _draw_track(axes, result, result.run.craft)
    _draw_wind(axes, result["wind.x"], result["wind.y"])


def _draw_track(axes: "Axes", result: Result | Passage, craft: Craft) -> None:
    x, y = result["pose.x"], result["pose.y"]
    axes.plot(x, y, color=SEA, linewidth=1.0)
    hull = outline(craft)
    # evenly in time: where the craft is fast they stand apart
    for i in np.linspace(0, len(x) - 1, CRAFT_COUNT).astype(int):
        corners = placed(hull, x[i], y[i], result["pose.heading"][i])
        axes.fill(*np.transpose(corners), facecolor=CRAFT, edgecolor=SEA, linewidth=0.9, zorder=3)
    axes.set_aspect("equal", adjustable="datalim")
    axes.invert_yaxis()
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m], downward")
    axes.set_title(f"Path; the craft every {(result['time'][-1] - result['time'][0]) / (CRAFT_COUNT - 1):.3g} s")
    axes.grid(alpha=0.3)


def _draw_wind(
    axes: "Axes", wind_x: NDArray[np.float64], wind_y: NDArray[np.float64], at: tuple[float, float] = (0.1, 0.9)
) -> None:
    """Where there is any: an arrow for its mean, and its strength."""
    strength = np.hypot(wind_x, wind_y)
    if not strength.any():
        return
    x, y = wind_x.mean(), wind_y.mean()
    size = 0.06 / max(np.hypot(x, y), 1e-12)
    axes.annotate(
        "", (at[0] + size * x, at[1] - size * y), (at[0] - size * x, at[1] + size * y), xycoords="axes fraction",
        arrowprops={"arrowstyle": "-|>", "color": WIND, "linewidth": 2.0},
    )  # fmt: skip
    low, high = strength.min(), strength.max()
    text = f"{high:.3g}" if low == high else f"{low:.3g} ... {high:.3g}"
    axes.text(at[0] + 0.09, at[1], f"wind {text} m/s", transform=axes.transAxes, color=WIND, va="center")


def _draw_controls(
    axes: "Axes",
    time: NDArray[np.float64],
    applied: NDArray[np.float64],
    thrusters: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> None:
    thrust = axes.plot(time, applied, color=SEA, label="thrust")
    axes.set_ylabel("thrust [N]")
    right = axes.twinx()
    port = right.fill_between(
        time, thrusters[0], step="pre", color=PORT, alpha=0.55, linewidth=0, label="port thruster"
    )
    starboard = right.fill_between(
        time, -thrusters[1], step="pre", color=STARBOARD, alpha=0.55, linewidth=0,
        label="starboard thruster",
    )  # fmt: skip
    right.set_ylim(-1.1, 1.1)
    right.set_yticks((-1.0, 0.0, 1.0), ("stbd", "off", "port"))
    low, high = axes.get_ylim()
    size = 1.1 * max(abs(low), abs(high), 1.0)
    axes.set_ylim(-size, size)
    axes.legend(handles=[*thrust, port, starboard], loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3,
                fontsize="small", frameon=False, borderaxespad=0.2)  # fmt: skip
    axes.set_title("Controls", loc="left")
    axes.grid(alpha=0.3)


def _draw_speed(axes: "Axes", result: Result) -> None:
    time = result["time"]
    axes.plot(time, result["speed"], color=INK, linewidth=1.6, label="speed")
    axes.plot(time, result["body.surge"], color=SEA, label="surge")
    axes.plot(time, result["body.sway"], color=SWAY, label="sway")
    axes.set_ylabel("[m/s]")
    axes.set_title("Speed", loc="left")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, fontsize="small", frameon=False,
                borderaxespad=0.2)  # fmt: skip
    axes.grid(alpha=0.3)


def _draw_heading(axes: "Axes", result: Result) -> None:
    axes.plot(result["time"], np.degrees(result["pose.heading"]), color=SEA)
    axes.set_ylabel("[deg], to starboard")
    axes.set_xlabel("time [s]")
    axes.set_title("Heading", loc="left")
    axes.grid(alpha=0.3)


def _draw_error(axes: "Axes", result: Result) -> None:
    """On a scale of decades; 0, as at the start, is not on it."""
    off = result["error.position"]
    axes.plot(result["time"], np.where(off > 0.0, off, np.nan), color=SEA)
    if off.any():
        axes.set_yscale("log")
    axes.set_ylabel("[m]")
    axes.set_xlabel("time [s]")
    axes.set_title("Off the exact solution, as the FMU tells it", loc="left")
    axes.grid(alpha=0.3)
