"""What the communication step of the closed loop costs in accuracy, beside what the integrator costs."""

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import polars as pl
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from ..autopilot.guidance import Orders, along, gains_for, helm, leg_to, pushed, wanted_force, wanted_turn
from ..coupling import GAUSS_SEIDEL, JACOBI, SCHEMES, BareAutopilot, BareCraft, sail_bare
from ..drawing.figures import new_figure
from ..drawing.palette import INK, METHODS, OTHER, QUIET
from ..model.dynamics import Controls, State, derivatives
from ..model.integrators import integrator
from ..model.subcycling import Settings
from ..scenes import VOYAGES
from . import step_limit, tow, voyages
from .laboratory import Findings, Shown, Tell, part
from .reference_end import TOLERANCES
from .work_precision import fitted

if TYPE_CHECKING:
    from matplotlib.figure import Figure

VOYAGE = VOYAGES["crosswind"]
FREE = replace(VOYAGE, autopilot={"turn_rate": 1.0})
"""The same without the limit of the turn, which holds for the first tenth of a second: it then has smooth equations."""
STRETCH = 120.0
"""s, from rest: the craft speeds up, turns into the wind, and comes to the leg; before the first waypoint."""
EVERY = 4.0
"""s: there the positions are compared; a multiple of every communication step."""
STEPS = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 4.0)
"""s"""
WHOLE_STEPS = (0.1, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
"""s, for the whole course"""
COURSES = (VOYAGE.name, "ice")
COURSE = ("voyage", "scheme", "communication_step", "arrived", "missed", "at_limit", "cross_track_error")
"""at_limit: % of the communication points with a thruster full on; cross_track_error: m, root mean square"""
EXACT = Settings(0.05, integrator(3))
"""RK4: what is left is the coupling's error."""
COMPARED = {
    "semi_implicit_euler, 0.001 s": Settings(0.001, integrator(1)),
    "semi_implicit_euler, 0.02 s": Settings(0.02, integrator(1)),
    "rk4, 0.1 s": Settings(0.1, integrator(3)),
}
Path2 = NDArray[np.float64]
"""Positions [m] every EVERY s, shape (n, 2)."""


def continuous() -> tuple[Path2, float]:
    """The loop without any communication step, and how far it may be off: the difference between two tolerances [m]."""
    fine, coarse = (_solved(tolerance) for tolerance in TOLERANCES)
    return fine, _apart(fine, coarse)


def _solved(tolerance: float) -> Path2:
    craft = BareCraft(FREE, EXACT)
    pilot = BareAutopilot(craft.state, Orders(**FREE.autopilot))  # type: ignore[arg-type]
    origin, active, orders, gains = pilot.pilot.origin, pilot.course[0], pilot.orders, gains_for(pilot.orders, 0.0)
    rate = orders.mass / gains.lag

    def rates(_time: float, y: NDArray[np.float64]) -> list[float]:
        motion, carried = State(*y[:6]), y[6:]
        way = along(leg_to(origin, active, motion), orders.cruise_speed, gains)
        lasting = carried[0] - rate * motion.vx, carried[1] - rate * motion.vy
        force = wanted_force(way, motion, lasting, orders, gains)
        _, commands = helm(pilot.pilot, motion, force, wanted_turn(0, motion, way, force, orders), orders, gains, 1e9)
        made = pushed(motion, commands, orders)
        kept = [(made[0] - lasting[0]) / gains.lag, (made[1] - lasting[1]) / gains.lag]
        return [*derivatives(motion, Controls(*commands, *craft.wind), craft.craft), *kept]

    times = np.arange(0.0, STRETCH + EVERY / 2, EVERY)
    start = [*craft.state, 0.0, 0.0]
    made = solve_ivp(rates, (0.0, STRETCH), start, "DOP853", t_eval=times, rtol=tolerance, atol=tolerance, max_step=0.5)
    return np.asarray(made.y[:2].T)


def sampled(scheme: str, communication_step: float, settings: Settings = EXACT) -> Path2:
    """The same stretch with a communication step [s]."""
    passage = sail_bare(
        FREE, scheme=scheme, communication_step=communication_step, stop_time=STRETCH, settings=settings
    )
    every = round(EVERY / communication_step)
    return np.column_stack((passage["pose.x"], passage["pose.y"]))[::every]


def _apart(a: Path2, b: Path2) -> float:
    return float(np.hypot(*(a - b).T).max())


def errors(steps: Sequence[float], exact: Path2, tell: Tell) -> pl.DataFrame:
    """The largest [m]: both schemes against the continuous loop; integrators against EXACT, in the Jacobi loop."""
    rows = []
    for done, step in enumerate(steps, 1):
        paths = {scheme: sampled(scheme, step) for scheme in SCHEMES}
        rows += [(scheme, step, _apart(path, exact)) for scheme, path in paths.items()]
        for name, settings in COMPARED.items():
            if settings.step_size <= step:  # else it is the sub-step of EXACT, or another's
                rows.append((name, step, _apart(sampled(JACOBI, step, settings), paths[JACOBI])))
        tell(done / len(steps))
    return pl.DataFrame(rows, ("error_of", "communication_step", "position_error"), orient="row")


def courses(steps: Sequence[float], tell: Tell) -> pl.DataFrame:
    """Whether the craft still comes to the end of the course, and how: columns COURSE."""
    sailed = [(name, scheme, step) for name in COURSES for step in steps for scheme in SCHEMES]
    rows = []
    for done, (name, scheme, step) in enumerate(sailed, 1):
        passage = sail_bare(name, scheme=scheme, communication_step=step, settings=EXACT)
        arrived = f"{passage['time'][-1]:g} s" if passage.arrived else "never"
        off = float(np.sqrt(np.mean(passage["cross_track_error"] ** 2)))
        full = np.maximum(passage["port_thruster"], passage["starboard_thruster"]) >= 1.0
        rows.append((name, scheme, step, arrived, int(passage["missed"][-1]), 100.0 * float(full.mean()), off))
        tell(done / len(sailed))
    return pl.DataFrame(rows, COURSE, orient="row")


def order(found: pl.DataFrame, error_of: str) -> float:
    """The order that is observed: of the error over the communication step, fitted up to 1 s."""
    own = found.filter((pl.col("error_of") == error_of) & (pl.col("communication_step") <= 1.0))
    return fitted(own["communication_step"], own["position_error"])


def measure(quick: bool, tell: Tell) -> Findings:
    """The errors of a stretch and the whole course; quick: fewer communication steps."""
    exact, off = continuous()
    steps, whole = (STEPS[3:], WHOLE_STEPS[2:4]) if quick else (STEPS, WHOLE_STEPS)
    found = errors(steps, exact, part(tell, 0.0, 0.2))
    course = courses(whole, part(tell, 0.2, 0.5))
    half = {error_of: error for error_of, step, error in found.iter_rows() if step == VOYAGE.communication_step}
    schemes = ", ".join(f"{scheme} {order(found, scheme):.2f}" for scheme in SCHEMES)
    wide = found.pivot("error_of", index="communication_step", values="position_error")
    findings = Findings(
        {"coupling": found, "coupling_course": course},
        [
            Shown(f"The largest position error [m] in the first {STRETCH:g} s of '{VOYAGE.name}'", wide),
            Shown("Whole courses: thrusters at their limit [%], off the legs [m, root mean square]", course),
        ],
        {"coupling": draw(found)},
        [
            f"order in the communication step: {schemes}; at {VOYAGE.communication_step:g} s jacobi errs "
            f"{half[JACOBI] / half[GAUSS_SEIDEL]:.2f} times as much; the continuous loop is known to {off:.1g} m"
        ],
    )
    findings.add(step_limit.measure(quick, part(tell, 0.5, 0.6)))
    findings.add(voyages.measure(quick, part(tell, 0.6, 0.95)))
    findings.add(tow.measure(quick, part(tell, 0.95, 1.0)))
    return findings


def draw(found: pl.DataFrame) -> "Figure":
    """Position error against the communication step, log-log."""
    figure = new_figure(figsize=(7.6, 4.8), dpi=110, layout="constrained")
    axes = figure.add_subplot()
    styles = {JACOBI: (INK, "P", "-"), GAUSS_SEIDEL: (OTHER, "v", "-")}
    for (name, settings), line in zip(COMPARED.items(), (":", "--", ":"), strict=True):
        styles[name] = (*METHODS[settings.integrator.name], line)
    for name, (color, marker, line) in styles.items():
        own = found.filter(error_of=name)
        label = name if name in SCHEMES else f"the integrator's error: {name}"
        axes.loglog(own["communication_step"], own["position_error"], color=color, marker=marker, markersize=5,
                    linestyle=line, label=label)  # fmt: skip
    first = found.filter(error_of=JACOBI)
    steps = first["communication_step"]
    axes.loglog(steps, first["position_error"][0] * steps / steps[0], color=QUIET, linestyle="-.", linewidth=1.0,
                label="first order")  # fmt: skip
    axes.set_xlabel("communication step [s]")
    axes.set_ylabel(f"largest position error in {STRETCH:g} s [m]")
    axes.set_title("What the communication step of the loop costs")
    axes.grid(which="major", alpha=0.3)
    axes.legend(frameon=False, fontsize="small")
    return figure
