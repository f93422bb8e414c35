"""The pictures of the trade."""

from collections.abc import Sequence
from pathlib import Path

from ..view.plots import new_figure
from .rows import Holding, Row

STYLES = {
    "semi_implicit_euler": ("#0b4f6c", "o"),
    "drag_implicit": ("#f08a24", "s"),
    "rk4": ("#2a9d4b", "^"),
    "adaptive": ("#8e44ad", "D"),
}
"""Colour and marker of each method."""


def draw_work_precision(rows: Sequence[Row], path: Path) -> None:
    """Position error against cost: a panel a scene, at the longest communication step; bare and through fmpy."""
    scenes = list(dict.fromkeys(row.scene for row in rows))
    longest = max(row.communication_step for row in rows)
    columns = min(3, len(scenes))
    lines = -(-len(scenes) // columns)
    figure = new_figure(figsize=(3.6 * columns + 0.6, 3.4 * lines + 0.9), dpi=110, layout="constrained")
    grid = figure.subplots(lines, columns, squeeze=False)
    for axes, scene in zip(grid.flat, scenes, strict=False):
        for name, (color, marker) in STYLES.items():
            own = [r for r in rows if (r.scene, r.integrator, r.communication_step) == (scene, name, longest)]
            errors = [max(row.position_error, 1e-13) for row in own]
            axes.loglog([row.bare_cost for row in own], errors, color=color, marker=marker, markersize=4, label=name)
            axes.loglog(
                [row.fmu_cost for row in own], errors, color=color, marker=marker, markersize=4, linestyle=":",
                markerfacecolor="white",
            )  # fmt: skip
        axes.set_title(scene)
        axes.grid(which="major", alpha=0.3)
    for axes in list(grid.flat)[len(scenes) :]:
        axes.set_axis_off()
    figure.supxlabel("cost [us a simulated second]; solid: bare model, dotted: through fmpy")
    figure.supylabel("position error after 60 s [m]")
    handles, labels = grid.flat[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False)
    figure.savefig(path, format="png", metadata={"Software": None})


def draw_holding(holding: Sequence[Holding], path: Path) -> None:
    """Position error against the communication step, log-log."""
    figure = new_figure(figsize=(6.0, 4.2), dpi=110, layout="constrained")
    axes = figure.add_subplot()
    steps = [each.communication_step for each in holding]
    errors = [each.position_error for each in holding]
    axes.loglog(steps, errors, color="#0b4f6c", marker="o", label="slalom, rk4 at 0.01 s")
    axes.loglog(
        steps, [errors[0] * step / steps[0] for step in steps], color="grey", linestyle="--", label="first order"
    )
    axes.set_xlabel("communication step [s]")
    axes.set_ylabel("position error after 60 s [m]")
    axes.set_title("What holding the inputs costs")
    axes.grid(which="both", alpha=0.25)
    axes.legend(frameon=False)
    figure.savefig(path, format="png", metadata={"Software": None})
