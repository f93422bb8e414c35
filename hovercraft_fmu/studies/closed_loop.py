"""What the communication step of the closed loop costs in accuracy, beside what the integrator costs."""

import csv
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.console import Group
from rich.table import Table

from ..autopilot.guidance import Pilot, Waypoint, helm, line_of_sight, wanted_force
from ..coupling import GAUSS_SEIDEL, JACOBI, SCHEMES, BareAutopilot, BareCraft, sail_bare
from ..model.dynamics import Controls, State, derivatives
from ..model.integrators import integrator
from ..model.subcycling import Settings
from ..scenes import VOYAGES
from ..view.plots import new_figure
from .reference_end import TOLERANCES, scipy_module
from .trade import machine

Tell = Callable[[float], None]
VOYAGE = VOYAGES["crosswind"]
STRETCH = 120.0
"""s, from rest: the craft speeds up, turns into the wind, and comes to the leg; before the first waypoint."""
EVERY = 4.0
"""s: there the positions are compared; a multiple of every communication step."""
STEPS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 4.0)
"""s"""
WHOLE_STEPS = (0.1, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
"""s, for the whole course"""
EXACT = Settings(0.05, integrator(3))
"""RK4: what is left is the coupling's error."""
INTEGRATORS = {
    "semi_implicit_euler, 0.001 s": Settings(0.001, integrator(1)),
    "semi_implicit_euler, 0.02 s": Settings(0.02, integrator(1)),
    "rk4, 0.1 s": Settings(0.1, integrator(3)),
}
Path2 = NDArray[np.float64]
"""Positions [m] every EVERY s, shape (n, 2)."""


class CouplingRow(NamedTuple):
    """A stretch of the voyage."""

    error_of: str
    """A scheme, or an integrator with its sub-step"""
    communication_step: float
    """s"""
    position_error: float
    """m, the largest"""


class CourseRow(NamedTuple):
    """The whole course."""

    scheme: str
    communication_step: float
    """s"""
    arrived: str
    """with its unit, or 'never'"""
    cross_track_error: float
    """m: its root mean square"""


def continuous() -> tuple[Path2, float]:
    """The loop without any communication step, and how far it may be off: the difference between two tolerances [m]."""
    fine, coarse = (_solved(tolerance) for tolerance in TOLERANCES)
    return fine, _apart(fine, coarse)


def _solved(tolerance: float) -> Path2:
    craft = BareCraft(VOYAGE, EXACT)
    gains, leg = BareAutopilot.gains, (Waypoint(craft.state.x, craft.state.y), BareAutopilot.course[0])

    def rates(_time: float, y: NDArray[np.float64]) -> list[float]:
        motion, pilot = State(*y[:6]), Pilot(leg[0], 0, y[6], y[7])
        _, wanted = line_of_sight(*leg, motion, gains)
        force_x, force_y = wanted_force(pilot, motion, wanted, gains)
        controls = Controls(*helm((force_x, force_y), wanted, motion, gains), *craft.wind)
        push = [(force_x - pilot.push_x) / gains.integral_time, (force_y - pilot.push_y) / gains.integral_time]
        return [*derivatives(motion, controls, craft.craft), *push]

    times = np.arange(0.0, STRETCH + EVERY / 2, EVERY)
    solve = scipy_module("integrate").solve_ivp
    start = [*craft.state, 0.0, 0.0]
    made = solve(rates, (0.0, STRETCH), start, "DOP853", t_eval=times, rtol=tolerance, atol=tolerance, max_step=0.5)
    return np.asarray(made.y[:2].T)


def sampled(scheme: str, communication_step: float, settings: Settings = EXACT) -> Path2:
    """The same stretch with a communication step [s]."""
    passage = sail_bare(
        VOYAGE, scheme=scheme, communication_step=communication_step, stop_time=STRETCH, settings=settings
    )
    every = round(EVERY / communication_step)
    return np.column_stack((passage["pose.x"], passage["pose.y"]))[::every]


def _apart(a: Path2, b: Path2) -> float:
    return float(np.hypot(*(a - b).T).max())


def measure(tell: Tell) -> list[CouplingRow]:
    """Both schemes against the continuous loop; each integrator against EXACT, in the Jacobi loop."""
    exact, _ = continuous()
    rows = []
    for done, step in enumerate(STEPS, 1):
        paths = {scheme: sampled(scheme, step) for scheme in SCHEMES}
        rows += [CouplingRow(scheme, step, _apart(path, exact)) for scheme, path in paths.items()]
        for name, settings in INTEGRATORS.items():
            if settings.step_size <= step:  # else it is the sub-step of EXACT, or another's
                rows.append(CouplingRow(name, step, _apart(sampled(JACOBI, step, settings), paths[JACOBI])))
        tell(0.7 * done / len(STEPS))
    return rows


def slope(rows: list[CouplingRow], error_of: str) -> float:
    """The order that is observed: of the error over the communication step, fitted up to 1 s."""
    own = [row for row in rows if row.error_of == error_of and row.communication_step <= 1.0]
    steps, errors = ([row[i] for row in own] for i in (1, 2))
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


def measure_course(tell: Tell) -> list[CourseRow]:
    """Whether the craft still reaches every waypoint, and how well it holds the legs."""
    rows = []
    for done, step in enumerate(WHOLE_STEPS, 1):
        for scheme in SCHEMES:
            passage = sail_bare(VOYAGE, scheme=scheme, communication_step=step, settings=EXACT)
            arrived = f"{passage['time'][-1]:g} s" if passage.arrived else "never"
            off = float(np.sqrt(np.mean(passage["cross_track_error"] ** 2)))
            rows.append(CourseRow(scheme, step, arrived, off))
        tell(0.7 + 0.3 * done / len(WHOLE_STEPS))
    return rows


# ---- the study


def run(folder: Path, tell: Tell = lambda _: None) -> Group:
    """Measure, write coupling.csv, coupling_course.csv and coupling.png, and return what is to be printed."""
    folder.mkdir(parents=True, exist_ok=True)
    rows = measure(tell)
    course = measure_course(tell)
    _write(folder / "coupling.csv", rows)
    _write(folder / "coupling_course.csv", course)
    draw(rows, folder / "coupling.png")
    _, off = continuous()
    schemes = ", ".join(f"{scheme} {slope(rows, scheme):.2f}" for scheme in SCHEMES)
    half = {row.error_of: row.position_error for row in rows if row.communication_step == VOYAGE.communication_step}
    return Group(
        _table(rows),
        f"\norder in the communication step: {schemes}; at {VOYAGE.communication_step:g} s jacobi errs "
        f"{half[JACOBI] / half[GAUSS_SEIDEL]:.2f} times as much; the continuous loop is known to {off:.1g} m",
        _course_table(course),
        f"\n{machine()}",
        f"\nwrote {folder}/",
    )


def _write(path: Path, rows: Sequence[CouplingRow] | Sequence[CourseRow]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(rows[0]._fields)
        writer.writerows(rows)


def _table(rows: list[CouplingRow]) -> Table:
    kinds = list(dict.fromkeys(row.error_of for row in rows))
    errors = {(row.communication_step, row.error_of): f"{row.position_error:.2g}" for row in rows}
    title = f"largest position error \\[m] in the first {STRETCH:g} s of '{VOYAGE.name}'"
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for column in ("communication step \\[s]", *kinds):
        table.add_column(column)
    for step in STEPS:
        table.add_row(f"{step:g}", *(errors.get((step, kind), "") for kind in kinds))
    return table


def _course_table(rows: list[CourseRow]) -> Table:
    title = f"\nthe whole course of '{VOYAGE.name}'"
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for title in ("scheme", "communication step \\[s]", "arrived after", "off the legs, rms \\[m]"):
        table.add_column(title)
    for row in rows:
        table.add_row(row.scheme, f"{row.communication_step:g}", row.arrived, f"{row.cross_track_error:.2f}")
    return table


def draw(rows: list[CouplingRow], path: Path) -> None:
    """Position error against the communication step, log-log."""
    figure = new_figure(figsize=(7.6, 4.8), dpi=110, layout="constrained")
    axes = figure.add_subplot()
    styles = {JACOBI: ("#0b4f6c", "o", "-"), GAUSS_SEIDEL: ("#f08a24", "s", "-")}
    integrators = zip(INTEGRATORS, ("#5b7f95", "#8e44ad", "#2a9d4b"), strict=True)
    styles |= {name: (color, "", ":") for name, color in integrators}
    for name, (color, marker, line) in styles.items():
        own = [row for row in rows if row.error_of == name]
        label = name if name in SCHEMES else f"the integrator's error: {name}"
        axes.loglog([row.communication_step for row in own], [row.position_error for row in own], color=color,
                    marker=marker, linestyle=line, label=label)  # fmt: skip
    first = next(row for row in rows if row.error_of == JACOBI)
    axes.loglog(STEPS, [first.position_error * step / STEPS[0] for step in STEPS], color="grey", linestyle="--",
                linewidth=1.0, label="first order")  # fmt: skip
    axes.set_xlabel("communication step [s]")
    axes.set_ylabel(f"largest position error in {STRETCH:g} s [m]")
    axes.set_title("What the communication step of the loop costs")
    axes.grid(which="major", alpha=0.3)
    axes.legend(frameon=False, fontsize="small")
    figure.savefig(path, format="png", metadata={"Software": None})
