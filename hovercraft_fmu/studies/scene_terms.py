"""What a scene may ask for: the price of each term, and what leaving it out costs in accuracy."""

import csv
import itertools
import math
import statistics
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np
from rich.console import Group
from rich.table import Table

from ..model.craft import DIRECTIONAL
from ..model.dynamics import State
from ..model.integrators import Integrator
from ..model.subcycling import advance
from ..scenes import SCENES, Row, Scene
from ..simulation import Value, plan, schedule
from ..view.plots import new_figure
from ..view.tables import markdown
from .plain import PLAIN
from .trade import machine

Tell = Callable[[float], None]
"""Called with the part of the work that is done, 0 to 1."""

REPEATS = 5
OFF_REPEATS = 30
WIND = 0.15
"""m/s, abeam, down the screen: a third of the textbook craft's top speed."""
FRICTION = 0.002
"""1: holds 2 N of the textbook craft's 10 N of thrust."""
COARSE: Mapping[str, Value] = {"integrator": "rk4", "step_size": 0.1}


class Term(NamedTuple):
    """One thing that a scene may ask for, or do without."""

    name: str
    what: str
    needed: str
    """When a scene needs it, in words."""
    on: Callable[[Scene], Scene]
    off: Callable[[Scene], Scene]
    settings: Mapping[str, Value] = {}
    """Of the run with it."""


def _with(**parameters: Any) -> Callable[[Scene], Scene]:
    """A scene with these parameters, unless it sets them itself."""
    return lambda scene: replace(scene, parameters={**parameters, **scene.parameters})


def _without(name: str) -> Callable[[Scene], Scene]:
    return lambda scene: replace(scene, parameters={k: v for k, v in scene.parameters.items() if k != name})


def _blown(scene: Scene) -> Scene:
    """A scene in the wind, unless it has its own."""
    if any(any(row[4:]) for row in scene.rows):
        return scene
    return replace(scene, rows=tuple((*row[:4], 0.0, WIND) for row in scene.rows))


def _calm(scene: Scene) -> Scene:
    rows: tuple[Row, ...] = tuple(row[:4] for row in scene.rows)
    return replace(scene, rows=rows)


def _same(scene: Scene) -> Scene:
    return scene


TERMS = (
    Term(
        "wind",
        f"wind.y = {WIND:g} m/s, or the scene's own",
        "air that moves a tenth as fast as the craft, or faster",
        _blown,
        _calm,
    ),
    Term(
        "directional area",
        "drag_area = directional",
        "a long craft that slides abeam or turns in dense air",
        _with(drag_area=DIRECTIONAL),
        _without("drag_area"),
    ),
    Term(
        "skirt friction",
        f"skirt_friction = {FRICTION:g}, or the scene's own",
        "a craft that must stand still, stop, or wait for a push",
        _with(skirt_friction=FRICTION),
        _without("skirt_friction"),
    ),
    Term(
        "rotational drag",
        "rotational_drag = 1",
        "spins and hard turns, whose end it decides",
        _with(rotational_drag=1.0),
        _without("rotational_drag"),
    ),
    Term(
        "no drag",
        "drag_coefficient = 0",
        "(less than the default) seconds on ice; never a minute",
        _with(drag_coefficient=0.0),
        _same,
    ),
    Term(
        "coarse step",
        ", ".join(f"{name} = {value}" for name, value in COARSE.items()),
        "(less than the default) a distant craft, and most near ones",
        _same,
        _same,
        COARSE,
    ),
)


class TermRow(NamedTuple):
    """One term in one scene, at the default method and sub-step."""

    term: str
    scene: str
    cost_ratio: float
    """1: the bare model's time with the term over that without"""
    position_difference: float
    """m, at the end"""
    heading_difference: float
    """rad, at the end"""
    path: float
    """m: how far the scene's craft goes, to hold the difference against"""


Walk = Callable[[], list[State]]
"""A run of the bare model, ready to be timed: the states at its communication points."""


def walk(scene: Scene, settings: Mapping[str, Value], method: Integrator | None = None) -> Walk:
    """The whole scene on the bare model, at its own communication points; with a method from outside the table."""
    run = plan(scene, start_values=settings)
    craft, chosen = run.craft, run.settings
    if method:
        chosen = chosen._replace(integrator=method)
    steps = [(end - time, controls) for time, end, controls in schedule(run)]

    def go() -> list[State]:
        states = [run.start]
        for duration, controls in steps:
            states.append(advance(states[-1], controls, craft, duration, chosen).state)
        return states

    return go


def measure(tell: Tell) -> list[TermRow]:
    """Every term in every scene, with and without, interleaved; medians of the ratios."""
    rows, pairs = [], list(itertools.product(TERMS, SCENES.values()))
    for done, (term, scene) in enumerate(pairs, 1):
        rows.append(_term_row(term, scene))
        tell(done / len(pairs))
    return rows


def _term_row(term: Term, scene: Scene) -> TermRow:
    without, with_it = walk(term.off(scene), {}), walk(term.on(scene), term.settings)
    ratio, states, ends = _interleaved(without, with_it, REPEATS)
    path = sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in itertools.pairwise(states))
    a, b = states[-1], ends[-1]
    return TermRow(term.name, scene.name, ratio, math.hypot(b.x - a.x, b.y - a.y), abs(b.heading - a.heading), path)


def _interleaved(first: Walk, second: Walk, repeats: int) -> tuple[float, list[State], list[State]]:
    """The median of the second's time over the first's, and where both went."""
    ratios = []
    for _ in range(repeats):
        start = perf_counter()
        states = first()
        middle = perf_counter()
        others = second()
        ratios.append((perf_counter() - middle) / (middle - start))
    return statistics.median(ratios), states, others


def off_ratio() -> float:
    """What the terms cost where all are off: the default's time on `turn` over that of a copy from before them."""
    ratio, _, _ = _interleaved(walk(SCENES["turn"], {}, PLAIN), walk(SCENES["turn"], {}), OFF_REPEATS)
    return ratio


# ---- the study


def run(folder: Path, tell: Tell = lambda _: None) -> Group:
    """Measure, write scene_terms.csv, .md and .png into the folder, and return what is to be printed."""
    folder.mkdir(parents=True, exist_ok=True)
    rows, off = measure(tell), off_ratio()
    with (folder / "scene_terms.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(TermRow._fields)
        writer.writerows(rows)
    (folder / "scene_terms.md").write_text(markdown(_titles(rows), _cells(rows)) + "\n", encoding="utf-8")
    draw(rows, folder / "scene_terms.png")
    return Group(
        "Each term: its price, and how far the end of each scene moves with it", _table(rows),
        f"\nall terms off: {off:.3f} of the cost of the default step before there were terms "
        f"(median of {OFF_REPEATS})",
        f"\n{machine()}", f"\nwrote {folder}/",
    )  # fmt: skip


SHOWN = ("turn", "ice", "drift_to_rest")
"""Scenes in the short table."""


def price(rows: Sequence[TermRow], term: str) -> float:
    """The median of the cost ratios over the scenes."""
    return statistics.median(row.cost_ratio for row in rows if row.term == term)


def _titles(rows: Sequence[TermRow]) -> tuple[str, ...]:
    path = {row.scene: row.path for row in rows if row.term == "coarse step"}
    return (
        "term",
        "set to",
        "cost",
        *(f"end of `{name}` ({path[name]:.0f} m) moves by" for name in SHOWN),
        "needed by",
    )


def _cells(rows: Sequence[TermRow]) -> list[tuple[str, ...]]:
    table = []
    for term in TERMS:
        moved = {row.scene: _length(row.position_difference) for row in rows if row.term == term.name}
        cost = f"{price(rows, term.name):.2f} x"
        table.append((term.name, term.what, cost, *(moved[name] for name in SHOWN), term.needed))
    return table


def _length(metres: float) -> str:
    return "0" if metres == 0.0 else f"{metres:.3g} m" if metres >= 1e-4 else f"{metres:.0e} m"


def _table(rows: Sequence[TermRow]) -> Table:
    table = Table(box=None, pad_edge=False)
    for title in ("term", "cost", *SCENES):
        table.add_column(title)
    for term in TERMS:
        moved = {row.scene: _length(row.position_difference) for row in rows if row.term == term.name}
        table.add_row(term.name, f"{price(rows, term.name):.2f} x", *(moved[name] for name in SCENES))
    return table


def draw(rows: Sequence[TermRow], path: Path) -> None:
    """Term by scene: the difference in the end position as colour and number; beside it, the price."""
    scenes, terms = list(SCENES), [term.name for term in TERMS]
    moved = {(row.term, row.scene): row.position_difference for row in rows}
    figure = new_figure(figsize=(13.0, 4.6), dpi=110, layout="constrained")
    map_axes, bar_axes = figure.subplots(1, 2, width_ratios=(4.0, 1.0), sharey=True)
    grid = np.array([[math.log10(max(moved[term, scene], 1e-6)) for scene in scenes] for term in terms])
    image = map_axes.imshow(grid, cmap="YlGnBu", vmin=-6.0, vmax=3.0, aspect="auto")
    for (i, term), (j, scene) in itertools.product(enumerate(terms), enumerate(scenes)):
        dark = grid[i, j] > -0.2
        map_axes.text(j, i, _length(moved[term, scene]), ha="center", va="center", fontsize="small",
                      color="white" if dark else "black")  # fmt: skip
    map_axes.set_xticks(range(len(scenes)), scenes)
    map_axes.set_yticks(range(len(terms)), terms)
    map_axes.set_title("How far the end of the scene moves", loc="left")
    figure.colorbar(image, ax=map_axes, label="log10 of it [m]", pad=0.01)
    costs = [price(rows, term) for term in terms]
    bar_axes.barh(range(len(terms)), costs, color="#0b4f6c")
    for i, cost in enumerate(costs):
        bar_axes.text(cost, i, f" {cost:.2f} x", va="center", fontsize="small")
    bar_axes.axvline(1.0, color="grey", linewidth=1.0)
    bar_axes.set_xlim(0.0, 1.25 * max(costs))
    bar_axes.set_title("Cost, to the default", loc="left")
    bar_axes.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, format="png", metadata={"Software": None})
