"""The tether as a native model: its C, its rules, and what of its table that C wants to have by name; its flavours."""

import math
from collections.abc import Iterator
from dataclasses import replace

from ..autopilot.pilot_native import AUTOPILOT_NATIVE, AUTOPILOT_NATIVE3
from ..fmu.description import PYTHON
from ..fmu.native_header import Native, Rule, assigned, constants, doubles_in_order
from .line import NOT_NEGATIVE, Line
from .tether_interface import INPUTS, OUTPUTS, PARAMETERS, TETHER_MODEL

OWN = """\
enum {{ {counts} }};

static const unsigned LINE[] = {{{line}}};   /* in the order of struct line */
static const unsigned SHOWN[] = {{{shown}}}; /* in the order of struct model */

{agreed}
"""


def _own() -> str:
    counts = {"LINE_COUNT": len(PARAMETERS), "SHOWN_COUNT": len(OUTPUTS)}
    return OWN.format(
        counts=assigned(counts), line=constants(PARAMETERS), shown=constants(OUTPUTS), agreed="\n".join(_agreed())
    )


def _agreed() -> Iterator[str]:
    yield from doubles_in_order("motion", ("x", "y", "heading", "vx", "vy", "yaw_rate"))
    yield from doubles_in_order("line", Line._fields)
    yield from doubles_in_order("load", ("x", "y", "moment"))


TETHER_C = Native(
    folder="tether",
    parts=("tether.c", "trig.c"),
    inputs=INPUTS,
    rules={name: Rule(0.0, math.inf, "must not be negative") for name in NOT_NEGATIVE},
    own=_own,
)
TETHER = PYTHON.of(TETHER_MODEL)
TETHER_NATIVE = replace(AUTOPILOT_NATIVE, model=TETHER_MODEL, identifier="TetherNative", native=TETHER_C)
TETHER_NATIVE3 = replace(AUTOPILOT_NATIVE3, model=TETHER_MODEL, identifier="TetherNative3", native=TETHER_C)
