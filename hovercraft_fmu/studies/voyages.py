"""Sixty voyages of all kinds: each arrives, or the autopilot says why not."""

import math
from collections.abc import Iterator

import polars as pl

from ..autopilot.guidance import ARRIVED
from ..autopilot.pilot_interface import STATUS
from ..coupling import JACOBI, sail_bare
from ..model.craft import preset
from ..model.integrators import integrator
from ..model.subcycling import Settings
from ..scenes import Voyage
from .laboratory import Findings, Shown, Tell

MASSES = (10.0, 30.0, 100.0, 300.0, 1000.0)
"""kg, with an inertia of 5 m2 times that"""
STEPS = (0.1, 0.5, 1.0, 2.0, 4.0)
"""s"""
AIRS = {"textbook": (0.3, (0.1, 0.2, 0.45)), "ice": (1.0, (0.25, 0.5, 8.0))}
"""m/s: the cruise speed, and winds; the last one stops the textbook craft."""
SIDES = 8
NUMBER = 60
SETTINGS = Settings(0.1, integrator(3))
STOP = 6000.0
"""s"""


def voyages() -> Iterator[tuple[Voyage, str, float, int]]:
    """With the name of the air, the wind's speed [m/s], and the side that it blows to, in eighths of a turn.

    A fixed sample: every mass, step and side comes with either air, and the strongest wind every sixth time.
    """
    for number in range(NUMBER):
        pair, air = number // 2, tuple(AIRS)[number % 2]
        mass, step = MASSES[pair % 5], STEPS[(pair + pair // 5) % 5]
        side = 3 * pair % SIDES
        speed, winds = AIRS[air]
        wind = winds[2] if pair % 6 == 5 else winds[pair % 2]
        angle = 2.0 * math.pi * side / SIDES
        craft = {
            "mass": mass,
            "inertia": 5.0 * mass,
            "air_density": preset(air).air_density,
            "wind.x": wind * math.cos(angle),
            "wind.y": wind * math.sin(angle),
        }
        yield Voyage(f"{number}", "", craft, {"cruise_speed": speed}, step, STOP), air, wind, side


def measure(quick: bool, tell: Tell) -> Findings:
    """The table; quick: every eleventh of them."""
    chosen = [each for number, each in enumerate(voyages()) if not quick or number % 11 == 5]
    rows = []
    for done, (voyage, air, wind, side) in enumerate(chosen, 1):
        passage = sail_bare(voyage, scheme=JACOBI, settings=SETTINGS)
        arrived = f"{passage['time'][-1]:g} s" if passage.arrived else "no"
        told = "; ".join(text.split(":")[0] for text in passage.told if text != STATUS[ARRIVED]) or "-"
        off = float((passage["cross_track_error"] ** 2).mean() ** 0.5)
        rows.append(
            (int(voyage.name), air, voyage.craft["mass"], wind, 360 * side // SIDES, voyage.communication_step, arrived,
             int(passage["missed"][-1]), told, off)
        )  # fmt: skip
        tell(done / len(chosen))
    columns = (
        "voyage",
        "air",
        "mass",
        "wind",
        "wind_to",
        "communication_step",
        "arrived",
        "missed",
        "told",
        "off_the_legs",
    )
    found = pl.DataFrame(rows, columns, orient="row")
    there = found.filter(pl.col("arrived") != "no")
    silent = found.filter((pl.col("arrived") == "no") & (pl.col("told") == "-")).height
    note = (
        f"{there.height} of {found.height} voyages arrived, {there.filter(missed=0).height} of them without missing a "
        f"waypoint; {silent} of the others did not say why"
    )
    return Findings({"coupling_voyages": found}, [Shown("Voyages of all kinds", found)], {}, [note])
