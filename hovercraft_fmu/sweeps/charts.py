"""Pictures of a sweep: curves, heat maps, or a cloud of paths."""

import json
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from ..drawing.figures import check_plot, new_figure, save
from ..drawing.palette import SEA, SHADES
from .quantities import display
from .reading import load
from .store import KEY, TRAJECTORIES
from .study import GRID

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PATHS = 1000
"""More of them are only ink."""
PANEL = (4.4, 3.6)
"""Inches."""
MOST_TICKS = 5
"""Of a panel, across: with more their numbers touch."""
FEW = 200
"""Points up to which each has a marker of its own."""


def plot_sweep(folder: str | os.PathLike[str], path: str | os.PathLike[str]) -> Path:
    """Draw a finished sweep as a PNG: what it kept against what it swept.

    With trajectories that have pose.x and pose.y: the paths. Else a panel for each column: a curve over one parameter;
    a heat map over the grid of two; points in the plane of two parameters of a Latin hypercube; with more parameters,
    points over each.

    Raises:
        ValueError: see `load` and `check_plot`.
        ModuleNotFoundError: see `check_plot`.
        OSError: the file cannot be written.
    """
    path = check_plot(path)
    return save(draw_sweep(folder), path)


def draw_sweep(folder: str | os.PathLike[str]) -> "Figure":
    """The picture of `plot_sweep`. Raises as it does."""
    runs = load(folder).to_table()
    about = json.loads(runs.schema.metadata[KEY])
    study = json.loads(about["study"])
    swept, kept = about["swept"], about["kept"]
    table = {name: _shown(runs, name) for name in (*swept, *kept)}
    if {"pose.x", "pose.y"} <= set(study["keep"].get("trajectory", {}).get("of", ())):
        figure = _paths(load(folder, TRAJECTORIES).to_table(), table, swept[0])
    elif len(swept) > 2:
        figure = _panels(table, [(name, (each,)) for name in kept for each in swept], len(swept), _points)
    elif len(swept) == 1:
        figure = _panels(table, [(name, (swept[0],)) for name in kept], 2, _curve)
    else:
        way = _heat_map if study.get("sampling", {}).get("method", GRID) == GRID else _cloud
        figure = _panels(table, [(name, tuple(swept)) for name in kept], 2, way)
    failed = runs.num_rows - runs["error"].null_count
    figure.suptitle(f"{about['name']}: {runs.num_rows} runs" + (f", {failed} failed" if failed else ""))
    return figure


def _shown(table: pa.Table, name: str) -> NDArray[np.float64]:
    """A column in its display unit; NaN where there is nothing."""
    values: NDArray[np.float64] = table[name].to_numpy().astype(np.float64)
    return values * display(name)[1]


def _label(name: str) -> str:
    shown = display(name)[0]
    return f"{name} [{shown}]" if shown else name


def _panels(
    table: Mapping[str, NDArray[np.float64]],
    panels: Sequence[tuple[str, tuple[str, ...]]],
    most: int,
    draw: Callable[..., None],
) -> "Figure":
    """A panel for each: the column and the parameters that it is drawn over; at most so many in a line."""
    columns = min(most, len(panels))
    lines = -(-len(panels) // columns)
    size = (PANEL[0] * columns + 0.6, PANEL[1] * lines + 0.5)
    figure = new_figure(figsize=size, dpi=110, layout="constrained")
    grid = figure.subplots(lines, columns, squeeze=False)
    for axes, (name, over) in zip(grid.flat, panels, strict=False):
        axes.set_xlabel(_label(over[0]))
        draw(axes, table[name], *(table[each] for each in over))
        axes.locator_params(axis="x", nbins=MOST_TICKS)
        if len(over) > 1:
            axes.set_ylabel(_label(over[1]))
            axes.set_title(_label(name))
        else:
            axes.set_ylabel(_label(name))
            axes.grid(alpha=0.3)
    for axes in list(grid.flat)[len(panels) :]:
        axes.set_axis_off()
    return figure


def _curve(axes: "Axes", values: NDArray[np.float64], over: NDArray[np.float64]) -> None:
    order = np.argsort(over, kind="stable")
    axes.plot(over[order], values[order], color=SEA, marker="." if len(over) <= FEW else "")


def _points(axes: "Axes", values: NDArray[np.float64], over: NDArray[np.float64]) -> None:
    axes.plot(over, values, color=SEA, marker=".", linestyle="", markersize=4 if len(over) <= FEW else 1)


def _heat_map(axes: "Axes", values: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64]) -> None:
    columns, rows = np.unique(x), np.unique(y)
    grid = np.full((len(rows), len(columns)), np.nan)
    grid[np.searchsorted(rows, y), np.searchsorted(columns, x)] = values
    image = axes.pcolormesh(columns, rows, grid, cmap=SHADES, shading="nearest", rasterized=True)
    figure: Figure = axes.figure  # type: ignore[assignment]
    figure.colorbar(image, ax=axes)
    finite = grid[np.isfinite(grid)]
    if min(grid.shape) > 1 and finite.size and finite.min() < finite.max():
        lines = axes.contour(columns, rows, grid, colors="white", linewidths=0.8)
        axes.clabel(lines, fontsize="small")


def _cloud(axes: "Axes", values: NDArray[np.float64], x: NDArray[np.float64], y: NDArray[np.float64]) -> None:
    dots = axes.scatter(x, y, c=values, cmap=SHADES, s=16 if len(x) <= FEW else 3)
    figure: Figure = axes.figure  # type: ignore[assignment]
    figure.colorbar(dots, ax=axes)


def _paths(trajectories: pa.Table, table: Mapping[str, NDArray[np.float64]], by: str) -> "Figure":
    """Every path, its colour the first parameter that was swept."""
    from matplotlib.collections import LineCollection

    numbers = trajectories["run"].to_numpy()
    where = np.stack([trajectories[name].to_numpy() for name in ("pose.x", "pose.y")], axis=1)
    starts = np.flatnonzero(np.diff(numbers, prepend=-1))
    lines, runs = np.split(where, starts[1:]), numbers[starts]
    chosen = np.unique(np.linspace(0, len(runs) - 1, min(PATHS, len(runs))).astype(int))
    figure = new_figure(figsize=(8.0, 6.0), dpi=110, layout="constrained")
    axes = figure.add_subplot()
    paths = LineCollection([lines[i] for i in chosen], cmap=SHADES, linewidths=0.8, alpha=0.8)
    paths.set_array(table[by][runs[chosen]])
    axes.add_collection(paths)
    axes.autoscale_view()
    axes.set_aspect("equal", adjustable="datalim")
    axes.invert_yaxis()
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m], downward")
    if len(chosen) < len(runs):
        axes.set_title(f"{len(chosen)} of the paths, evenly chosen")
    axes.grid(alpha=0.3)
    figure.colorbar(paths, ax=axes, label=_label(by))
    return figure
