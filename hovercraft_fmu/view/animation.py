"""Pictures that move: the craft with its jets along its path; one setting, or two against each other."""

import importlib
import os
from collections.abc import Callable, Sequence
from math import ceil, cos, floor, hypot, nan, pi, sin
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageColor

from ..drawing.figures import new_figure
from ..drawing.palette import FAINT_LINE, INK, JETS, METHODS, OTHER, QUIET, SERIES
from ..drawing.shapes import Shape, jets, outline, placed
from ..fmu.near_names import explains_keywords
from ..simulation import Result, metres
from ..whole import written
from .film import MOTION, Moving, film

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

FRAMES = 80
"""At most; fewer where there are fewer communication points."""
FRAME_TIME = 75
"""ms"""
LAST_FRAME_TIME = 2000
"""ms"""
LEGEND_LINE = 100
"""characters"""
STRENGTHS = 8
"""Of a colour, in a GIF."""
ROUND = 49
"""Points of a circle."""
DECADES = 1e-5
"""Of the largest distance: what the logarithmic axis begins at."""
SUFFIXES = (".gif", ".html")

Corner = NDArray[np.float64]
"""x, y [m]"""
Tell = Callable[[float], None]
"""Called with the part of the work that is done, 0 to 1."""


class Track(NamedTuple):
    """One run, as it is drawn."""

    result: Result
    name: str
    color: str

    @property
    def x(self) -> NDArray[np.float64]:
        """m, shape (n,)."""
        return self.result["pose.x"]

    @property
    def y(self) -> NDArray[np.float64]:
        """m, shape (n,)."""
        return self.result["pose.y"]

    def hull(self, i: int) -> Shape:
        """The outline at a communication point, world frame [m]."""
        return self._placed(i, outline(self.result.run.craft))

    def jets(self, i: int) -> dict[str, Shape]:
        """What blows at a communication point, world frame [m]."""
        row = self.result
        controls = (row["applied.thrust"][i], *np.clip([row["port_thruster"][i], row["starboard_thruster"][i]], 0, 1))
        return {name: self._placed(i, each) for name, each in jets(row.run.craft, *controls).items()}

    def doubt(self, i: int) -> Shape:
        """A circle around the craft, as wide as it may be off [m]; nothing where that is not told."""
        if not self.result.is_estimated or self.result.is_lost:
            return []
        radius, x, y = self.result["error.position"][i], self.x[i], self.y[i]
        return [(x + radius * cos(angle), y + radius * sin(angle)) for angle in np.linspace(0.0, 2.0 * pi, ROUND)]

    def _placed(self, i: int, points: Shape) -> Shape:
        return placed(points, *(float(self.result[name][i]) for name in ("pose.x", "pose.y", "pose.heading")))


def check_animation(path: str | os.PathLike[str]) -> Path:
    """The path; so that a run need not be made to learn that it cannot be drawn.

    Raises:
        ValueError: the name ends in neither .gif nor .html.
        ModuleNotFoundError: matplotlib, for a GIF, is not installed; says how to install it.
    """
    path = Path(path)
    if path.suffix not in SUFFIXES:
        raise ValueError(f"animation = {str(path)!r}: must end in .gif (a moving picture) or .html (a page)")
    if path.suffix == ".gif":
        new_figure()
    return path


@explains_keywords
def animate(results: Result | Sequence[Result], path: str | os.PathLike[str], tell: Tell = lambda _: None) -> Path:
    """Write one run, or two over the same communication points, as a GIF or as a page that needs no network.

    Args:
        results: the run, or both.
        path: ends in .gif or .html; its folder is made.
        tell: called with the part of the work that is done, 0 to 1.

    Raises:
        ValueError: see `check_animation`; more than two runs, or runs over different times.
        ModuleNotFoundError: see `check_animation`.
        OSError: the file cannot be written.
    """
    path = check_animation(path)
    results = [results] if isinstance(results, Result) else results
    if not 1 <= len(results) <= 2:
        raise ValueError(f"results = {len(results)} runs: must be one or two")
    if not np.array_equal(results[0]["time"], results[-1]["time"]):
        raise ValueError("results: must have the same communication points")
    tracks = [Track(*each) for each in zip(results, _names(results), _colors(results), strict=True)]
    with written(path) as unfinished:
        (_write_gif if path.suffix == ".gif" else _write_page)(tracks, unfinished, tell)
    return path


def _names(results: Sequence[Result]) -> list[str]:
    """The method, what else differs, and what it cost."""
    runs = [result.run for result in results]
    other = {name for run in runs for name in run.start_values} - {"integrator", "step_size", "tolerance"}
    differ = [name for name in sorted(other) if len({run.value(name) for run in runs}) > 1]
    names = []
    for run, result in zip(runs, results, strict=True):
        setting = ", ".join([run.method, *(f"{name} {run.value(name):g}" for name in differ)])
        substeps = f"{result['substeps'][-1]:,} sub-steps".replace(",", " ")
        stages = run.settings.integrator.stages
        told = f"; {result.error_in_words}" if result.is_estimated else ""
        names.append(f"{setting}: {substeps}{f' of {stages} stages' if stages > 1 else ''}{told}")
    return names


def _colors(results: Sequence[Result]) -> list[str]:
    """Of the methods; where both are the same, the second has another."""
    first, *rest = (METHODS[result.run.settings.integrator.name].color for result in results)
    return [first, *(OTHER if color == first else color for color in rest)]


def apart(tracks: Sequence[Track]) -> NDArray[np.float64]:
    """m, shape (n,): the distance between two runs at every communication point."""
    distance: NDArray[np.float64] = np.hypot(tracks[1].x - tracks[0].x, tracks[1].y - tracks[0].y)
    return distance


def _title(tracks: Sequence[Track]) -> str:
    result = tracks[0].result
    title = f"{result.run.title}: {result.distance:.0f} m in {result['time'][-1] - result['time'][0]:g} s"
    return title if len(tracks) == 1 else f"{title}; at the end {metres(apart(tracks)[-1])} apart"


def _frames(tracks: Sequence[Track]) -> NDArray[np.int_]:
    """The communication points that are drawn, evenly in time."""
    time = tracks[0].result["time"]
    wanted = np.linspace(time[0], time[-1], min(FRAMES, len(time)))
    chosen: NDArray[np.int_] = np.unique(np.searchsorted(time, wanted - 1e-9 * (time[-1] - time[0])))
    return chosen


def _corners(tracks: Sequence[Track]) -> tuple[Corner, Corner]:
    """Low and high x and y [m] of what the paths and the craft along them cover."""
    room = max(hypot(track.result.run.craft.length, track.result.run.craft.width) for track in tracks)
    places = np.concatenate([np.column_stack([track.x, track.y]) for track in tracks])
    return places.min(axis=0) - room, places.max(axis=0) + room


# ---- as a GIF


def _write_gif(tracks: Sequence[Track], path: Path, tell: Tell) -> None:
    chosen, moving_picture = _frames(tracks), MovingPicture(tracks)
    images = []
    for done, i in enumerate(chosen, 1):
        images.append(moving_picture.frame(i))
        tell(done / len(chosen))
    # one palette for all: what does not move does not change its colour, and costs no bytes
    palette = _palette()
    first, *rest = (image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images)
    times = [FRAME_TIME] * len(rest) + [LAST_FRAME_TIME]
    first.save(path, "GIF", save_all=True, append_images=rest, duration=times, loop=0, optimize=True)


def _palette() -> Image.Image:
    """Every colour, from white to full: smooth edges need what is between."""
    full = np.array([ImageColor.getrgb(color) for color in (INK, *(style.color for style in SERIES), *JETS.values())])
    shares = np.arange(STRENGTHS + 1)[:, None, None] / STRENGTHS
    image = Image.new("P", (1, 1))
    image.putpalette(np.rint(255 + shares * (full - 255)).astype(int).ravel().tolist())
    return image


class MovingPicture:
    """The whole path, a close-up that goes with the craft, and how far two runs are apart.

    What stands still is drawn once.
    """

    def __init__(self, tracks: Sequence[Track]) -> None:
        self._tracks, two = tracks, len(tracks) == 2
        figure = new_figure(figsize=(9.0, 4.8), dpi=80, layout="constrained")
        self._canvas = importlib.import_module("matplotlib.backends.backend_agg").FigureCanvasAgg(figure)
        grid = figure.add_gridspec(2 if two else 1, 2, width_ratios=(1.7, 1.0), height_ratios=(1.5, 1.0)[: 1 + two])
        self.path, self.close_up = figure.add_subplot(grid[:, 0]), figure.add_subplot(grid[0, 1])
        figure.suptitle(_title(tracks), fontsize="medium")
        self._prepare_path()
        self._ground = self._prepare_close_up()
        places = (self.path, self.close_up)
        self._movers = [_Mover(axes, track, filled=track is tracks[0]) for axes in places for track in tracks]
        self._apart = figure.add_subplot(grid[1, 1]) if two else None
        self._mark = _draw_apart(self._apart, tracks) if self._apart else None
        self._clock = self.path.text(0.02, 0.97, "", transform=self.path.transAxes, va="top", animated=True)
        handles, names = self.path.get_legend_handles_labels()
        figure.legend(handles, names, loc="outside lower center", ncols=2 if len("".join(names)) < LEGEND_LINE else 1,
                      fontsize="small", frameon=False)  # fmt: skip
        self._canvas.draw()
        figure.set_layout_engine("none")  # once more, in the places that it found
        _cover(self.path, *_corners(tracks))
        self._canvas.draw()
        self._still = self._canvas.copy_from_bbox(figure.bbox)

    def _prepare_path(self) -> None:
        axes = self.path
        axes.set_xlabel("x [m]", fontsize="small")
        axes.set_ylabel("y [m], downward", fontsize="small")
        axes.tick_params(labelsize="small")
        axes.grid(alpha=0.3)
        _cover(axes, *_corners(self._tracks))

    def _prepare_close_up(self) -> "Line2D":
        """Lines on the ground, a craft length apart, so that one sees it pass by."""
        axes, length = self.close_up, self._tracks[0].result.run.craft.length
        axes.set_title(f"close up; lines every {length:g} m", fontsize="small", loc="left")
        axes.set_xticks([])
        axes.set_yticks([])
        (ground,) = axes.plot([], [], color=FAINT_LINE, linewidth=0.6, animated=True)
        return ground

    def frame(self, i: int) -> Image.Image:
        """The picture of a communication point."""
        self._canvas.restore_region(self._still)
        self._look_closely(i)
        for mover in self._movers:
            mover.draw(i)
        time = self._tracks[0].result["time"][i]
        self._clock.set_text(f"{time:.0f} s")
        self.path.draw_artist(self._clock)
        if self._apart and self._mark:
            self._mark.set_data([time], [apart(self._tracks)[i]])
            self._apart.draw_artist(self._mark)
        return Image.fromarray(np.array(self._canvas.buffer_rgba())).convert("RGB")

    def _look_closely(self, i: int) -> None:
        """All craft and some ground around them."""
        axes, length = self.close_up, self._tracks[0].result.run.craft.length
        room = 1.2 * max(max(track.result.run.craft.length, track.result.run.craft.width) for track in self._tracks)
        places = np.array([(track.x[i], track.y[i]) for track in self._tracks])
        _cover(axes, places.min(axis=0) - room, places.max(axis=0) + room)
        (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
        across = [(each, each, nan) for each in _multiples(left, right, length)]
        down = [(each, each, nan) for each in _multiples(top, bottom, length)]
        xs = [*across, *[(left, right, nan)] * len(down)]
        ys = [*[(top, bottom, nan)] * len(across), *down]
        self._ground.set_data(np.ravel(xs), np.ravel(ys))
        axes.draw_artist(self._ground)


def _cover(axes: "Axes", low: Corner, high: Corner) -> None:
    """Axes that show all from a corner to the other [m]: y down, and a metre as long down as across.

    (matplotlib's own equal aspect is equal to half a per cent.)
    """
    box = axes.get_window_extent()
    half = 0.5 * max((high[0] - low[0]) / box.width, (high[1] - low[1]) / box.height)
    x, y = 0.5 * (low[0] + high[0]), 0.5 * (low[1] + high[1])
    axes.set_xlim(x - half * box.width, x + half * box.width)
    axes.set_ylim(y + half * box.height, y - half * box.height)


def _multiples(low: float, high: float, size: float) -> list[float]:
    return [n * size for n in range(ceil(low / size), floor(high / size) + 1)]


class _Mover:
    """One run in one place: its whole path, faint, and what moves along it."""

    def __init__(self, axes: "Axes", track: Track, filled: bool) -> None:
        self._axes, self._track = axes, track
        color, dash = track.color, "-" if filled else (0, (4, 2))
        (self._whole,) = axes.plot(track.x, track.y, color=color, linewidth=0.8, alpha=0.35, animated=True)
        axes.plot([], [], color=color, linewidth=1.8, linestyle=dash, label=track.name)
        (self._trail,) = axes.plot([], [], color=color, linewidth=1.8, linestyle=dash, animated=True)
        face = f"{color}80" if filled else "none"
        (self._hull,) = axes.fill([0.0], [0.0], facecolor=face, edgecolor=color, linewidth=1.6, animated=True)
        (self._doubt,) = axes.fill([0.0], [0.0], facecolor=f"{color}30", edgecolor=color, linewidth=0.8, animated=True)
        self._jets = {name: axes.fill([0.0], [0.0], facecolor=each, animated=True)[0] for name, each in JETS.items()}

    def draw(self, i: int) -> None:
        """At a communication point."""
        track = self._track
        self._trail.set_data(track.x[: i + 1], track.y[: i + 1])
        self._axes.draw_artist(self._whole)
        self._axes.draw_artist(self._trail)
        if circle := track.doubt(i):
            self._doubt.set_xy(np.array(circle))
            self._axes.draw_artist(self._doubt)
        for name, corners in track.jets(i).items():
            self._jets[name].set_xy(np.array(corners))
            self._axes.draw_artist(self._jets[name])
        self._hull.set_xy(np.array(track.hull(i)))
        self._axes.draw_artist(self._hull)


def _draw_apart(axes: "Axes", tracks: Sequence[Track]) -> "Line2D":
    """The distance over time, where there is any; returns the mark that moves along it."""
    distance = apart(tracks)
    axes.plot(tracks[0].result["time"], distance, color=QUIET, linewidth=1.2)
    if distance.any():
        axes.set_yscale("log")
        axes.set_ylim(max(distance[distance > 0.0].min(), DECADES * distance.max()), 2.0 * distance.max())
    (mark,) = axes.plot([], [], color=INK, marker="o", markersize=5, animated=True)
    axes.set_title("apart [m]", fontsize="small", loc="left")
    axes.set_xlabel("time [s]", fontsize="small")
    axes.tick_params(labelsize="small")
    axes.grid(alpha=0.3)
    return mark


# ---- as a page


def _write_page(tracks: Sequence[Track], path: Path, tell: Tell) -> None:
    moving = [_moving(track, is_ghost=track is not tracks[0]) for track in tracks]
    distance = apart(tracks) if len(tracks) == 2 else None
    path.write_bytes(film(_title(tracks), tracks[0].result["time"], moving, apart=distance))
    tell(1.0)


def _moving(track: Track, is_ghost: bool) -> Moving:
    result = track.result
    blown = (result["applied.thrust"], *(result[name].clip(0, 1) for name in ("port_thruster", "starboard_thruster")))
    doubt = result["error.position"] if result.is_estimated and not result.is_lost else None
    return Moving(track.name, result.run.craft, [result[name] for name in MOTION], blown, doubt, is_ghost)
