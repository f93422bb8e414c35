"""The systems that are written as SSP files: the closed loop of hovercraft and autopilot, and the tow of two craft."""

import os
from pathlib import Path

from ..autopilot.pilot_interface import AUTOPILOT_MODEL, COMMANDS, ORDERS
from ..fmu.interface import CRAFT_PARAMETERS, EXTERNAL, HOVERCRAFT, STATES, WIND
from ..model.craft import preset
from ..scenes import VOYAGES, Voyage
from ..tether.line import Line
from ..tether.tether_interface import CRAFT as TOWED
from ..tether.tether_interface import PARAMETERS as OF_LINE
from ..tether.tether_interface import TETHER_MODEL
from .structure import Component, ParameterSet, System, write_ssp

CRAFT, PILOT, TETHER, TOW = "hovercraft", "autopilot", "tether", "tow"
"""The names of components, and of the tow."""
SHOWN = tuple(v.name for v in AUTOPILOT_MODEL.variables if v.causality == "output" and v.name not in COMMANDS)
"""Outputs of the autopilot that nothing in the loop takes."""
PARAMETERS = f"resources/{CRAFT}.ssv"
TOWING_THRUST = 10.0
"""N"""


def build_ssp(
    path: str | os.PathLike[str], craft: Path, autopilot: Path, voyage: Voyage = VOYAGES["crosswind"]
) -> Path:
    """Write the loop of two FMUs on a voyage to `path` and return the path; raises as `write_ssp` does."""
    return write_ssp(path, loop(craft, autopilot, voyage))


def build_tow_ssp(path: str | os.PathLike[str], craft: Path, tether: Path) -> Path:
    """Write the tow of two craft of one FMU by a tether's to `path` and return the path; raises as `write_ssp` does."""
    return write_ssp(path, tow(craft, tether))


def loop(craft: Path, autopilot: Path, voyage: Voyage) -> System:
    """A hovercraft and its autopilot, which is told the craft."""
    given = {**dict.fromkeys(WIND, 0.0), **preset_values("textbook"), **voyage.craft}
    orders = {name: AUTOPILOT_MODEL.by_name[name].start for name in ("acceptance_radius", "cruise_speed")}
    told = {name: given[name] for name in ORDERS if name in CRAFT_PARAMETERS and name in given}
    ordered = {**{name: float(start or 0.0) for name, start in orders.items()}, **told, **voyage.autopilot}
    return System(
        f"{craft.stem}Loop",
        "loop",
        f"A hovercraft and its autopilot; {voyage.description}",
        (
            Component(CRAFT, craft, HOVERCRAFT, ParameterSet(CRAFT, CRAFT, given)),
            Component(PILOT, autopilot, AUTOPILOT_MODEL, ParameterSet(PILOT, PILOT, ordered), SHOWN),
        ),
        (*((CRAFT, name, PILOT, name) for name in STATES), *((PILOT, name, CRAFT, name) for name in COMMANDS)),
        voyage.communication_step,
        voyage.stop_time,
        {CRAFT: ParameterSet("ice", "ice", {**given, **preset_values("ice")})},
    )


def tow(craft: Path, tether: Path) -> System:
    """Two craft on ice, one of which tows the other. Both begin at the origin, as not every master sets outputs: the
    first one leaves, and then the line is taut.
    """
    given = {
        TOWED[0]: {"thrust": TOWING_THRUST, **preset_values("ice")},
        TOWED[1]: {"thrust": 0.0, **preset_values("ice")},
        TETHER: dict(zip(OF_LINE, Line(), strict=True)),
    }
    sets = {name: ParameterSet(name, TOW, values) for name, values in given.items()}
    return System(
        f"{craft.stem}Tow",
        TOW,
        "Two hovercraft on ice and a line: both begin at the origin, the first leaves and tows the second",
        (
            *(Component(name, craft, HOVERCRAFT, sets[name]) for name in TOWED),
            Component(TETHER, tether, TETHER_MODEL, sets[TETHER], ("tension", "distance")),
        ),
        (
            *((name, each, TETHER, f"{name}.{each}") for name in TOWED for each in STATES),
            *((TETHER, f"{name}.{each}", name, each) for name in TOWED for each in EXTERNAL),
        ),
        communication_step=0.1,
        stop_time=120.0,
    )


def preset_values(name: str) -> dict[str, float]:
    """What of a craft the sets give: what the autopilot is told, and the air."""
    craft = preset(name)
    return {each: getattr(craft, each) for each in ("mass", "inertia", "length", "steering_force", "air_density")}
