"""What a scene may ask for: the price of each term, and what leaving it out costs in accuracy."""

import itertools
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import polars as pl

from ..drawing.figures import new_figure
from ..drawing.palette import INK, SHADES
from ..fmu.interface import INPUTS
from ..fmu.native_package import build_native_fmu
from ..fmu.start_values import Value
from ..host import Fmu, Instance
from ..model.craft import DIRECTIONAL
from ..scenes import SCENES, Scene
from ..simulation import plan, schedule
from ..whole import temporary_folder
from .laboratory import Findings, Ready, Shown, Tell, interleaved, part, spread
from .work_precision import Went, go

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROUNDS = 5
WIND = 0.15
"""m/s, abeam, down the screen: a third of the textbook craft's top speed."""
FRICTION = 0.002
"""1: holds 2 N of the textbook craft's 10 N of thrust."""
COARSE: Mapping[str, Value] = {"integrator": "rk4", "step_size": 0.1}


class Term(NamedTuple):
    """One thing that a scene may ask for, or do without."""

    name: str
    set_to: str
    needed: str
    """When a scene needs it, in words."""
    parameters: Mapping[str, Any] = {}
    """With it on, unless the scene has its own."""
    settings: Mapping[str, Value] = {}
    """Of the run with it."""
    wind: bool = False
    opt_in: bool = True
    """A scene's own is left out where the term is off."""

    def on(self, scene: Scene) -> Scene:
        """The scene with it."""
        rows = scene.rows
        if self.wind and not any(any(row[4:]) for row in rows):
            rows = tuple((*row[:4], 0.0, WIND) for row in rows)
        return replace(scene, rows=rows, parameters={**self.parameters, **scene.parameters})

    def off(self, scene: Scene) -> Scene:
        """The scene without it."""
        rows = tuple(row[:4] if self.wind else row for row in scene.rows)
        left = {k: v for k, v in scene.parameters.items() if not (self.opt_in and k in self.parameters)}
        return replace(scene, rows=rows, parameters=left)


TERMS = (
    Term("wind", f"wind.y = {WIND:g} m/s, or the scene's own", "air that moves a tenth as fast as the craft, or faster",
         wind=True),
    Term("directional area", "drag_area = directional", "a long craft that slides abeam or turns in dense air",
         {"drag_area": DIRECTIONAL}),
    Term("skirt friction", f"skirt_friction = {FRICTION:g}, or the scene's own",
         "a craft that must stand still, stop, or wait for a push", {"skirt_friction": FRICTION}),
    Term("rotational drag", "rotational_drag = 1", "spins and hard turns, whose end it decides",
         {"rotational_drag": 1.0}),
    Term("no drag", "drag_coefficient = 0", "(less than the default) seconds on ice; never a minute",
         {"drag_coefficient": 0.0}, opt_in=False),
    Term("coarse step", "integrator = rk4, step_size = 0.1",
         "(less than the default) a distant craft, and most near ones", settings=COARSE),
)  # fmt: skip


PRICED = 20.0
"""s: of one communication step, so that what a call costs is out of sight."""


def walked(scene: Scene, settings: Mapping[str, Value]) -> Went:
    """The whole scene, with its inputs as they go."""
    run = plan(scene, start_values=settings, communication_step=1.0)
    return go(run, run.settings.integrator, [run.settings.step_size])


def price(instance: Instance, scene: Scene, settings: Mapping[str, Value]) -> Ready[None]:
    """The native FMU for PRICED seconds from the start of a scene, with the inputs of its middle."""
    run, inputs = plan(scene, start_values=settings), instance.port(*INPUTS)
    pieces = list(schedule(run))
    controls = pieces[len(pieces) // 2].first

    def ready() -> Callable[[], None]:
        instance.reset()
        instance.start(run.start_values)
        inputs.set(controls)
        return lambda: instance.step(0.0, PRICED)

    return ready


SHOWN = ("turn", "ice", "drift_to_rest")
"""Scenes in the short table."""


def measure(quick: bool, tell: Tell) -> Findings:
    """Every term in every scene, with and without, at the default method; quick: three scenes.

    How far the end moves [m, rad], by which terms are ranked; the length of the path; and beside it the time of the
    native FMU with the term over that without.
    """
    scenes = [SCENES[name] for name in SHOWN] if quick else list(SCENES.values())
    cases = list(itertools.product(TERMS, scenes))
    with temporary_folder() as folder, Fmu(build_native_fmu(Path(folder) / "N.fmu")) as fmu, fmu.instance() as instance:
        prices = {}
        for term, scene in cases:
            prices[term.name, scene.name, False] = price(instance, term.off(scene), {})
            prices[term.name, scene.name, True] = price(instance, term.on(scene), term.settings)
        timed = interleaved(prices, ROUNDS, part(tell, 0.0, 0.3))
    rows = []
    for done, (term, scene) in enumerate(cases, 1):
        off, on = walked(term.off(scene), {}), walked(term.on(scene), term.settings)
        (x, y, heading), before = on.ends[:3, 0].tolist(), off.ends[:3, 0].tolist()
        dear, cheap = (timed[term.name, scene.name, whether].least for whether in (True, False))
        rows.append({
            "term": term.name, "scene": scene.name, "cost_ratio": dear / cheap,
            "position_difference": math.dist((x, y), before[:2]), "heading_difference": abs(heading - before[2]),
            "path": off.way.item(),
        })  # fmt: skip
        tell(0.3 + 0.7 * done / len(cases))
    found = pl.DataFrame(rows)
    moved = found.group_by("term", maintain_order=True).agg((pl.col("position_difference") / pl.col("path")).median())
    ranked = ", ".join(moved.sort("position_difference", descending=True, maintain_order=True)["term"])
    short = [
        Shown("Each term: its price, and how far the end of a scene moves with it", _short(found), "scene_terms"),
        Shown("How far the end of each scene moves", _moved(found)),
    ]
    return Findings(
        {"scene_terms": found},
        short,
        {"scene_terms": draw(found)},
        [f"By how far the end moves, over the path, in the median of the scenes: {ranked}", spread(timed.values())],
    )


def prices(found: pl.DataFrame) -> dict[str, float]:
    """Term -> the median of its cost ratios over the scenes."""
    medians = found.group_by("term", maintain_order=True).agg(pl.col("cost_ratio").median())
    return dict(medians.iter_rows())


def _moved(found: pl.DataFrame) -> pl.DataFrame:
    """A row a term, a column a scene."""
    moved = found.with_columns(pl.col("position_difference").map_elements(_length, pl.String))
    return moved.pivot("scene", index="term", values="position_difference")


def _short(found: pl.DataFrame) -> pl.DataFrame:
    path = {row["scene"]: row["path"] for row in found.filter(term="coarse step").iter_rows(named=True)}
    price, ends = prices(found), _moved(found)
    names = {name: f"end of `{name}` ({path[name]:.0f} m) moves by" for name in SHOWN}
    return pl.DataFrame({
        "term": [term.name for term in TERMS], "set to": [term.set_to for term in TERMS],
        "cost": [f"{price[term.name]:.2f} x" for term in TERMS], **{title: ends[name] for name, title in names.items()},
        "needed by": [term.needed for term in TERMS],
    })  # fmt: skip


def _length(metres: float) -> str:
    return "0" if metres == 0.0 else f"{metres:.3g} m" if metres >= 1e-4 else f"{metres:.0e} m"


def draw(found: pl.DataFrame) -> "Figure":
    """Term, with its price, by scene: the difference in the end position as colour and number."""
    moved = found.pivot("scene", index="term", values="position_difference")
    scenes, lengths = moved.columns[1:], moved.drop("term").to_numpy()
    figure = new_figure(figsize=(10.5, 4.2), dpi=110, layout="constrained")
    axes, grid = figure.add_subplot(), np.log10(np.maximum(lengths, 1e-6))
    image = axes.imshow(grid, cmap=f"{SHADES}_r", vmin=-6.0, vmax=3.0, aspect="auto")
    for (i, j), metres in np.ndenumerate(lengths):
        color = "white" if grid[i, j] > -1.0 else INK
        axes.text(j, i, _length(metres), ha="center", va="center", fontsize="small", color=color)
    axes.set_xticks(range(len(scenes)), scenes)
    axes.set_yticks(range(len(moved)), [f"{term}: {cost:.2f} x the cost" for term, cost in prices(found).items()])
    axes.set_title("How far the end of the scene moves", loc="left")
    figure.colorbar(image, ax=axes, label="log10 of it [m]", pad=0.01)
    return figure
