"""Which communication step is too long for the loop of the heading: what theory says, and what the thrusters do.

Theory. On a straight leg at the speed U the air damps sway v and yaw rate r at the drag point, c = k*U at x_d, and the
autopilot steers with u = -P*psi - Q*r, which is held over the communication step h:

    m*(v' + U*r) = -c*(v + x_d*r) + f*u ,  I*r' = -c*x_d*(v + x_d*r) + M*u ,  psi' = r .

Over a step that is x_next = A*x + B*u exactly, with (A, B) from the exponential of the matrix. Where the craft gets
what the autopilot says of the same communication point (Gauss-Seidel) u is of x; where both step side by side (Jacobi),
of the x one step before. The loop is stable while all eigenvalues are inside the unit circle. Without any air,
critically damped (P = M*Q^2/(4*I)), that is a matter of q = h*M*Q/I alone. The polynomials are, in a Gauss-Seidel loop,
z^2 - (2 - q - q^2/8)*z + 1 - q + q^2/8, stable up to q = 2, and in a Jacobi loop
z^3 - 2*z^2 + (1 + q + q^2/8)*z - q + q^2/8, stable up to q = 0.852.

Measurement. The same leg in the same loop with the law and the craft as they are, from a heading that is a little off;
the loops around that of the heading are opened, and the thrust holds the speed. The least h with which the thrusters do
more at the end than before. What the loops around it take of that limit is seen in the table of whole courses.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import polars as pl
from scipy.linalg import expm

from ..autopilot.guidance import STEP_LIMIT, Commands, Orders, Waypoint, beginning, steer
from ..coupling import JACOBI, SCHEMES
from ..drawing.figures import new_figure
from ..drawing.palette import QUIET, SERIES
from ..model.craft import Craft, preset
from ..model.dynamics import Controls, State
from ..model.integrators import integrator
from ..model.subcycling import Settings, advance
from .laboratory import Findings, Shown, Tell

if TYPE_CHECKING:
    from matplotlib.figure import Figure

AIR = ("textbook", "ice")
SPEEDS = {"textbook": 0.3, "ice": 2.0}
"""m/s"""
MASSES = (25.0, 50.0, 100.0, 200.0, 400.0)
"""kg, with an inertia of 5 m2 times that"""
INERTIAS = (125.0, 250.0, 500.0, 1000.0, 2000.0)
"""kg.m2, at 100 kg"""
GAINS = (5.0, 7.0, 10.0, 14.0, 20.0)
"""s/rad, of the yaw rate; that of the heading critically damped without any air"""
TICKS = (0.5, 1.0, 2.0, 5.0, 10.0, 20.0)
"""s, on the axis of the chart"""
SAMPLES = 90
"""Communication steps of a leg."""
LONGEST, SHORTEST, FINEST = 64.0, 0.02, 1.03
"""s, and the factor down to which a limit is sought."""
OFF = 1e-6
"""rad: so little that the drag, which grows with the square, holds back no swing."""
GROWN = 1e-3
"""1: a swing of the thrusters that has grown so large may be at its limit by now."""
SUBSTEP = 6e-4
"""s per kg.m2: a quarter of the time in which the air damps the yaw rate at 0.3 m/s."""


def cases() -> Iterator[tuple[str, float, Craft, Orders]]:
    """What is varied, its value, the craft without its air, and what the autopilot is told."""
    for mass in MASSES:
        yield "mass", mass, Craft(mass=mass, inertia=5.0 * mass), Orders(mass=mass, inertia=5.0 * mass)
    for inertia in INERTIAS:
        yield "inertia", inertia, Craft(inertia=inertia), Orders(inertia=inertia)
    for gain in GAINS:
        yield "yaw_rate_gain", gain, Craft(), Orders(yaw_rate_gain=gain)


def with_gains(orders: Orders, speed: float) -> Orders:
    """Both gains of the heading given, so that they do not follow the communication step; the other loops opened."""
    share = orders.steering_moment / orders.inertia
    yaw_rate = orders.yaw_rate_gain or 10.0
    return replace(
        orders, yaw_rate_gain=yaw_rate, heading_gain=share * yaw_rate * yaw_rate / 4.0, cruise_speed=speed,
        lookahead=1e12, velocity_gain=1e-12, integral_time=1e12, turn_rate=1e3,
    )  # fmt: skip


# ---- theory


def growth(craft: Craft, orders: Orders, scheme: str, h: float) -> float:
    """The largest of the eigenvalues of a step: the loop is stable below 1."""
    m, inertia, arm, drag = craft.mass, craft.inertia, craft.drag_center, craft.drag_factor * orders.cruise_speed
    rates = np.zeros((4, 4))  # of v, r, psi, and the held u
    rates[0] = [-drag / m, -drag * arm / m - orders.cruise_speed, 0.0, craft.steering_force / m]
    rates[1] = [-drag * arm / inertia, -drag * arm * arm / inertia, 0.0, craft.thruster_moment / inertia]
    rates[2, 1] = 1.0
    over = expm(rates * h)
    gain = np.array([0.0, orders.yaw_rate_gain, orders.heading_gain])
    step = over[:3, :3] - np.outer(over[:3, 3], gain)
    if scheme == JACOBI:
        step = np.block([[over[:3, :3], over[:3, 3:]], [-gain[np.newaxis], np.zeros((1, 1))]])
    return float(np.abs(np.linalg.eigvals(step)).max())


def theory(craft: Craft, orders: Orders, scheme: str) -> float:
    """s: the longest communication step of a stable loop."""
    return sought(lambda h: growth(craft, orders, scheme, h) < 1.0)


def sought(is_stable: Callable[[float], bool], low: float = SHORTEST, high: float = LONGEST) -> float:
    """The step where it stops being so, by halving the ratio of what it lies between."""
    while high > FINEST * low:
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if is_stable(middle) else (low, middle)
    return float(np.sqrt(low * high))


# ---- measurement


def steering(craft: Craft, orders: Orders, scheme: str, h: float) -> list[float]:
    """The thrusters, port minus starboard, on a straight leg at the cruise speed."""
    state, course = State(heading=OFF, vx=orders.cruise_speed), (Waypoint(1e9, 0.0),)
    hold = craft.drag_factor * orders.cruise_speed * orders.cruise_speed
    pilot = beginning(state)._replace(heading=0.0, push_x=hold)
    fine = Settings(SUBSTEP * craft.inertia, integrator(3))
    commands, shown = Commands(), []
    for _ in range(SAMPLES):
        before = commands
        pilot, commands, _ = steer(pilot, state, course, orders, h)
        shown.append(commands.port - commands.starboard)
        acting = before if scheme == JACOBI else commands
        state = advance(state, Controls(*acting), craft, h, fine).state
    return shown


def measured(craft: Craft, orders: Orders, scheme: str, near: float) -> float:
    """s: the same of the whole loop, sought around what is expected."""

    def is_stable(h: float) -> bool:
        swings = np.abs(np.diff(steering(craft, orders, scheme, h)))
        third = SAMPLES // 3
        return bool(swings[-third:].max() < min(swings[third:-third].max(), GROWN))

    return sought(is_stable, near / 2.0, 2.0 * near)


def limits(quick: bool, tell: Tell) -> pl.DataFrame:
    """Both for every case; quick: some of them."""
    chosen = [case for i, case in enumerate(cases()) if not quick or i % 8 == 0]
    rows = []
    for done, (varied, value, vacuum, told) in enumerate(chosen, 1):
        for air in AIR:
            craft = replace(vacuum, air_density=preset(air).air_density)
            orders = with_gains(told, SPEEDS[air])
            number = orders.yaw_rate_gain * orders.steering_moment / orders.inertia
            for scheme in SCHEMES:
                expected = theory(craft, orders, scheme)
                found = measured(craft, orders, scheme, expected)
                rows.append((varied, value, air, scheme, STEP_LIMIT / number, expected, found))
        tell(done / len(chosen))
    columns = ("varied", "value", "air", "scheme", "warned_of", "theory", "measured")
    return pl.DataFrame(rows, columns, orient="row")


def measure(quick: bool, tell: Tell) -> Findings:
    """The limits, and their chart."""
    found = limits(quick, tell)
    share = (found["measured"] / found["theory"]).to_numpy()
    note = f"limit of the communication step: measured is {share.min():.2f} to {share.max():.2f} of the theory's"
    return Findings(
        {"coupling_limit": found},
        [Shown("The longest communication step [s] of a stable loop of the heading", found)],
        {"coupling_limit": draw(found)},
        [note],
    )


def draw(found: pl.DataFrame) -> "Figure":
    """A panel for what is varied: lines are theory, markers are measured."""
    figure = new_figure(figsize=(9.6, 4.0), dpi=110, layout="constrained")
    panels = figure.subplots(1, 3, sharey=True)
    labels = {
        "mass": "mass [kg], inertia with it",
        "inertia": "inertia [kg.m2]",
        "yaw_rate_gain": "yaw_rate_gain [s/rad]",
    }
    for axes, (varied, label) in zip(panels, labels.items(), strict=True):
        for (air, scheme), style in zip(((a, s) for a in AIR for s in SCHEMES), SERIES, strict=False):
            own = found.filter(varied=varied, air=air, scheme=scheme).sort("value")
            axes.loglog(own["value"], own["theory"], color=style.color, linewidth=1.2)
            axes.loglog(own["value"], own["measured"], color=style.color, marker=style.marker, markersize=5,
                        linestyle="", label=f"{air}, {scheme}")  # fmt: skip
        own = found.filter(varied=varied, air="ice", scheme=JACOBI).sort("value")
        axes.fill_between(own["value"], own["warned_of"], LONGEST, color=QUIET, alpha=0.12, linewidth=0.0,
                          label="warned of")  # fmt: skip
        axes.set_xlabel(label)
        axes.set_xticks(own["value"], [f"{value:g}" for value in own["value"]])
        axes.set_xticks([], minor=True)
        axes.grid(which="both", alpha=0.2)
    panels[0].set_ylim(0.25, 40.0)
    panels[0].set_yticks(TICKS, [f"{value:g}" for value in TICKS])
    panels[0].set_yticks([], minor=True)
    panels[0].set_ylabel("longest stable communication step [s]")
    panels[0].legend(frameon=False, fontsize="small")
    figure.suptitle("The limit of the communication step: theory (lines) and law and craft in the loop (markers)")
    return figure
