"""The picture of one run: the path with the craft along it, and what happened over time."""

from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..model.craft import Craft
from .figures import new_figure
from .palette import CRAFT, INK, PORT, SEA, STARBOARD, SWAY, WIND
from .shapes import outline, placed

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

CRAFT_COUNT = 25
"""Outlines along the path, at most; they are a length of the craft apart at least, so that they do not hide it."""


class Columns(Protocol):
    """What is drawn: columns by name, shape (n,) each."""

    def __getitem__(self, name: str) -> NDArray[Any]: ...


def draw_run(run: Columns, craft: Craft, title: str, is_estimated: bool) -> "Figure":
    """The path with the craft along it, the controls, the speeds and the heading over time; and where the FMU tells it
    how far it is off.

    Raises ModuleNotFoundError as `new_figure` does.
    """
    figure = new_figure(figsize=(12.0, 6.75), dpi=120, layout="constrained")
    grid = figure.add_gridspec(3 + is_estimated, 2, width_ratios=(1.25, 1.0))
    figure.suptitle(title)
    path = figure.add_subplot(grid[:, 0])
    draw_track(path, run, craft)
    draw_wind(path, run["wind.x"], run["wind.y"])
    controls = figure.add_subplot(grid[0, 1])
    speed = figure.add_subplot(grid[1, 1], sharex=controls)
    heading = figure.add_subplot(grid[2, 1], sharex=controls)
    draw_controls(controls, run["time"], run["applied.thrust"], (run["port_thruster"], run["starboard_thruster"]))
    _draw_speed(speed, run)
    _draw_heading(heading, run)
    if is_estimated:
        heading.set_xlabel("")
        _draw_error(figure.add_subplot(grid[3, 1], sharex=controls), run)
    return figure


def path_svg(x: NDArray[np.float64], y: NDArray[np.float64], width: int = 320, points: int = 400) -> str:
    """A small picture of a path [m], without matplotlib: an SVG, y down; its start is a ring, its end a dot."""
    chosen = np.unique(np.linspace(0, len(x) - 1, points).astype(int))
    low, span = np.array([x.min(), y.min()]), max(float(np.ptp(x)), float(np.ptp(y)), 1e-9)
    places = (np.column_stack([x[chosen], y[chosen]]) - low) * ((width - 20) / span) + 10
    height = round(float(places[:, 1].max())) + 10
    line = " ".join(f"{across:.1f},{down:.1f}" for across, down in places)
    ring, dot = (f'cx="{across:.1f}" cy="{down:.1f}" r="5" stroke="{SEA}"' for across, down in places[[0, -1]])
    return (
        f'<svg width="{width}" height="{height}" role="img" aria-label="path"><polyline points="{line}" fill="none" '
        f'stroke="{SEA}" stroke-width="2"/><circle {ring} fill="white"/><circle {dot} fill="{SEA}"/></svg>'
    )


def draw_track(axes: "Axes", run: Columns, craft: Craft) -> None:
    """The path on top of the craft along it: outlines, the first and the last filled."""
    x, y = run["pose.x"], run["pose.y"]
    hull, along = outline(craft), np.append(0.0, np.hypot(np.diff(x), np.diff(y)).cumsum())
    apart = max(craft.length, float(along[-1]) / CRAFT_COUNT)
    between = np.searchsorted(along, np.arange(apart, along[-1] - 0.999 * apart, apart))
    for i in (0, *between, len(x) - 1):
        corners = placed(hull, x[i], y[i], run["pose.heading"][i])
        face = CRAFT if i in (0, len(x) - 1) else "none"
        axes.fill(*np.transpose(corners), facecolor=face, edgecolor=SEA, linewidth=0.7, zorder=2)
    axes.plot(x, y, color=SEA, linewidth=1.8, zorder=3)
    axes.set_aspect("equal", adjustable="datalim")
    axes.invert_yaxis()
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m], downward")
    axes.set_title(f"Path; the craft every {apart:.3g} m, filled at start and end")
    axes.grid(alpha=0.3)


def draw_wind(
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


def draw_controls(
    axes: "Axes",
    time: NDArray[np.float64],
    applied: NDArray[np.float64],
    thrusters: tuple[NDArray[np.float64], NDArray[np.float64]],
) -> None:
    """Thrust [N], as it was applied, and port and starboard thruster [1] over time [s]."""
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


def _draw_speed(axes: "Axes", run: Columns) -> None:
    time = run["time"]
    axes.plot(time, run["speed"], color=INK, linewidth=1.6, label="speed")
    axes.plot(time, run["body.surge"], color=SEA, label="surge")
    axes.plot(time, run["body.sway"], color=SWAY, label="sway")
    axes.set_ylabel("[m/s]")
    axes.set_title("Speed", loc="left")
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, fontsize="small", frameon=False,
                borderaxespad=0.2)  # fmt: skip
    axes.grid(alpha=0.3)


def _draw_heading(axes: "Axes", run: Columns) -> None:
    axes.plot(run["time"], np.degrees(run["pose.heading"]), color=SEA)
    axes.set_ylabel("[deg], to starboard")
    axes.set_xlabel("time [s]")
    axes.set_title("Heading", loc="left")
    axes.grid(alpha=0.3)


def _draw_error(axes: "Axes", run: Columns) -> None:
    """On a scale of decades; 0, as at the start, is not on it."""
    off = run["error.position"]
    axes.plot(run["time"], np.where(off > 0.0, off, np.nan), color=SEA)
    if off.any():
        axes.set_yscale("log")
    axes.set_ylabel("[m]")
    axes.set_xlabel("time [s]")
    axes.set_title("Off the exact solution, as the FMU tells it", loc="left")
    axes.grid(alpha=0.3)
