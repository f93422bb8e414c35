"""Pictures of a sweep: curves, heat maps, or a cloud of paths."""

import json
import os
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset as ds
from numpy.typing import NDArray

from ..drawing.figures import check_plot, new_figure, save
from ..drawing.palette import SEA, SHADES
from .cells import Plane, cells_of
from .quantities import display
from .reading import about_of, batches, load, numbers_of
from .store import TRAJECTORIES
from .study import GRID

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_POINTS = 20_000
"""Runs that are drawn one by one; of more, cells are drawn, whose runs are counted or their mean is taken."""
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
    points over each. Of more than 20 000 runs a picture shows cells: how many runs are in each, or over two parameters
    their mean; of more than 1000 paths a thousand, evenly chosen. The picture says so.

    Raises:
        ValueError: see `load` and `check_plot`.
        ModuleNotFoundError: see `check_plot`.
        OSError: the file cannot be written.
    """
    path = check_plot(path)
    return save(draw_sweep(folder), path)


def draw_sweep(folder: str | os.PathLike[str]) -> "Figure":
    """The picture of `plot_sweep`. Raises as it does."""
    runs = load(folder)
    about = about_of(runs)
    made = sum(rows["error"].null_count for rows in batches(runs, ["error"]))
    drawn = ""
    if {"pose.x", "pose.y"} <= set(json.loads(about["study"])["keep"].get("trajectory", {}).get("of", ())):
        figure = _paths(runs, load(folder, TRAJECTORIES), made)
    elif about["runs"] > MOST_POINTS:
        figure, drawn = _in_cells(runs, about)
    else:
        figure = _one_by_one(runs.to_table(), about)
    failed = about["runs"] - made
    figure.suptitle(f"{about['name']}: {about['runs']} runs" + (f", {failed} failed" if failed else "") + drawn)
    return figure


def _one_by_one(rows: pa.Table, about: Mapping[str, Any]) -> "Figure":
    swept = about["swept"]
    ways: dict[int, Callable[..., None]] = {1: _curve, 2: _heat_map if _is_grid(about) else _cloud}
    way = ways.get(len(swept), _points)

    def draw(axes: "Axes", *columns: str) -> None:
        way(axes, *(numbers_of(rows, name).astype(np.float64) * display(name)[1] for name in columns))

    return _panels(_panel_names(about), len(swept), draw)


def _in_cells(runs: ds.Dataset, about: Mapping[str, Any]) -> tuple["Figure", str]:
    """And the rule that it is drawn by."""
    from matplotlib.colors import LogNorm

    panels, swept = _panel_names(about), about["swept"]
    planes = [Plane(over[0], over[1], name) if len(over) > 1 else Plane(over[0], name, None) for name, *over in panels]
    cells = dict(zip(panels, cells_of(runs, planes, swept if _is_grid(about) else ()), strict=True))
    means = len(swept) == 2

    def draw(axes: "Axes", *columns: str) -> None:
        x, y, values = cells[columns]
        scale = None if means else LogNorm(1.0, values[np.isfinite(values)].max(initial=10.0))
        image = axes.pcolormesh(x, y, values, cmap=SHADES, norm=scale, rasterized=True)
        figure: Figure = axes.figure  # type: ignore[assignment]
        figure.colorbar(image, ax=axes, label="" if means else "runs in a cell")

    by = "the mean of its runs" if means else "the number of its runs"
    return _panels(panels, len(swept), draw), f"\nmore than {MOST_POINTS}: drawn in cells, each coloured by {by}"


def _is_grid(about: Mapping[str, Any]) -> bool:
    return bool(json.loads(about["study"]).get("sampling", {}).get("method", GRID) == GRID)


def _panel_names(about: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Of each panel the column, and the parameters that it is drawn over."""
    swept, kept = about["swept"], about["kept"]
    return [(name, *swept) for name in kept] if len(swept) == 2 else [(name, each) for name in kept for each in swept]


def _label(name: str) -> str:
    shown = display(name)[0]
    return f"{name} [{shown}]" if shown else name


def _panels(panels: Sequence[tuple[str, ...]], swept: int, draw: Callable[..., None]) -> "Figure":
    """As many in a line as parameters are swept, two at least."""
    columns = min(max(2, swept), len(panels))
    lines = -(-len(panels) // columns)
    size = (PANEL[0] * columns + 0.6, PANEL[1] * lines + 0.5)
    figure = new_figure(figsize=size, dpi=110, layout="constrained")
    grid = figure.subplots(lines, columns, squeeze=False)
    for axes, (name, *over) in zip(grid.flat, panels, strict=False):
        axes.set_xlabel(_label(over[0]))
        draw(axes, name, *over)
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


def _paths(runs: ds.Dataset, trajectories: ds.Dataset, made: int) -> "Figure":
    """The paths of the runs that were made, or some of them; their colour the first parameter that was swept."""
    from matplotlib.collections import LineCollection

    by = about_of(runs)["swept"][0]
    chosen = _evenly(runs, made)
    rows, points = _of(chosen, runs, by), _of(chosen, trajectories, "pose.x", "pose.y")
    starts = np.flatnonzero(np.diff(numbers_of(points, "run"), prepend=-1))
    lines = np.split(np.stack([numbers_of(points, name) for name in ("pose.x", "pose.y")], axis=1), starts[1:])
    figure = new_figure(figsize=(8.0, 6.0), dpi=110, layout="constrained")
    axes = figure.add_subplot()
    paths = LineCollection(lines, cmap=SHADES, linewidths=0.8, alpha=0.8)
    paths.set_array(numbers_of(rows, by) * display(by)[1])
    axes.add_collection(paths)
    axes.autoscale_view()
    axes.set_aspect("equal", adjustable="datalim")
    axes.invert_yaxis()
    axes.set_xlabel("x [m]")
    axes.set_ylabel("y [m], downward")
    if len(chosen) < made:
        axes.set_title(f"{len(chosen)} of the paths, evenly chosen")
    axes.grid(alpha=0.3)
    figure.colorbar(paths, ax=axes, label=_label(by))
    return figure


def _of(chosen: NDArray[np.int64], rows: ds.Dataset, *columns: str) -> pa.Table:
    """Those columns of those runs."""
    wanted = pa.array(chosen)
    every = batches(rows, ["run", *columns])
    return pa.concat_tables(pa.Table.from_batches([each.filter(pc.is_in(each["run"], wanted))]) for each in every)


def _evenly(runs: ds.Dataset, made: int) -> NDArray[np.int64]:
    """The numbers of PATHS runs, of those that were made."""
    wanted = np.unique(np.linspace(0, made - 1, min(PATHS, made)).astype(int))
    found, before = [np.empty(0, np.int64)], 0
    for rows in batches(runs, ["run", "error"]):
        numbers = rows["run"].filter(rows["error"].is_null()).to_numpy()
        here = wanted[(before <= wanted) & (wanted < before + len(numbers))]
        found.append(numbers[here - before])
        before += len(numbers)
    return np.concatenate(found)
