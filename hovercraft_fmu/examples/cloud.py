"""Ten thousand craft for a minute, each with a mass of its own and controls drawn anew every second: their cloud."""

import sys
from pathlib import Path

import numpy as np

from hovercraft_fmu import Crafts, advance_fleet
from hovercraft_fmu.drawing.figures import check_plot, new_figure, save
from hovercraft_fmu.drawing.palette import SHADES
from hovercraft_fmu.model.dynamics import Controls, State
from hovercraft_fmu.model.integrators import INTEGRATORS, integrator_number
from hovercraft_fmu.model.subcycling import Settings
from hovercraft_fmu.whole import check_writable

COUNT, SECONDS = 10_000, 60
RK4 = Settings(step_size=0.1, integrator=INTEGRATORS[integrator_number("rk4") - 1])


def main(path: Path) -> None:
    """Write the picture."""
    check_plot(path)
    check_writable(path)
    dice = np.random.default_rng(1)
    crafts = Crafts(mass=dice.normal(100.0, 10.0, COUNT), air_density=0.0023769)
    states = np.zeros((len(State._fields), COUNT))
    for _ in range(SECONDS):
        controls = np.zeros((len(Controls._fields), COUNT))
        controls[:3] = dice.uniform(0.0, 10.0, COUNT), *dice.integers(0, 2, (2, COUNT))
        fleet = advance_fleet(states, controls, crafts, 1.0, RK4)
        states = fleet.states
        for number, why in fleet.refused.items():
            print(f"craft {number}: {why}")
    figure = new_figure(figsize=(6.0, 6.0), dpi=110, layout="constrained")
    axes = figure.subplots()
    axes.scatter(states[0], states[1], c=np.hypot(states[3], states[4]), s=1.0, cmap=SHADES)
    axes.set(title=f"{COUNT} craft after {SECONDS} s", xlabel="x [m]", ylabel="y [m], down", aspect="equal")
    axes.invert_yaxis()
    save(figure, path)
    print(f"wrote {path}: {COUNT} craft, {np.hypot(*states[:2]).mean():.1f} m from the start in the mean")


if __name__ == "__main__":
    try:
        main(Path(sys.argv[1] if len(sys.argv) > 1 else "cloud.png"))
    except (ValueError, OSError, ModuleNotFoundError) as error:  # another name, no compiled library, no matplotlib
        sys.exit(str(error))
