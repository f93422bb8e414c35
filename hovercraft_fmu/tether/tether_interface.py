"""The tether's table of variables. Inputs and outputs are named as in the hovercraft, after the craft's own name."""

from ..fmu.interface import BY_NAME, EXTERNAL, STATES
from ..fmu.variable import Model, Variable
from .line import Line

CRAFT = ("first", "second")
INPUTS = tuple(f"{craft}.{name}" for craft in CRAFT for name in STATES)
"""In the order of two States."""
LOADS = tuple(f"{craft}.{name}" for craft in CRAFT for name in EXTERNAL)
"""In the order of two Loads."""
OUTPUTS = (*LOADS, "tension", "distance")
"""In the order of Pull."""
PARAMETERS = {
    "stiffness": ("N/m", "Of the line, not negative"),
    "damping": ("N.s/m", "Of the line while it pulls, not negative"),
    "slack_length": ("m", "Below it the line hangs loose, not negative"),
    "first.attachment.x": ("m", "Where it is made fast to the first craft, body frame, forward"),
    "first.attachment.y": ("m", "Where it is made fast to the first craft, body frame, to starboard"),
    "second.attachment.x": ("m", "Where it is made fast to the second craft, body frame, forward"),
    "second.attachment.y": ("m", "Where it is made fast to the second craft, body frame, to starboard"),
}
"""In the order of Line."""


def _input(reference: int, name: str) -> Variable:
    craft, of = name.split(".", 1)
    own = BY_NAME[of]
    return Variable(reference, name, "input", "continuous", own.unit, 0.0, f"Of the {craft} craft: {own.description}",
                    nominal=own.nominal)  # fmt: skip


def _load(reference: int, name: str) -> Variable:
    craft, of = name.split(".", 1)
    text = "Moment about its centre of gravity" if of.endswith("moment") else "Force, world frame"
    return Variable(reference, name, "output", "discrete", BY_NAME[of].unit, None, f"On the {craft} craft: {text}",
                    depends_on=(*INPUTS, *PARAMETERS))  # fmt: skip


def _parameter(reference: int, name: str, start: float) -> Variable:
    unit, text = PARAMETERS[name]
    minimum = None if "attachment" in name else 0.0
    return Variable(reference, name, "parameter", "tunable", unit, start, text, minimum=minimum)


_FIRST_OUTPUT, _FIRST_PARAMETER = len(INPUTS), len(INPUTS) + len(OUTPUTS)
VARIABLES: tuple[Variable, ...] = (
    *(_input(reference, name) for reference, name in enumerate(INPUTS)),
    *(_load(_FIRST_OUTPUT + i, name) for i, name in enumerate(LOADS)),
    Variable(_FIRST_PARAMETER - 2, "tension", "output", "discrete", "N", None, "Force in the line; it never pushes",
             minimum=0.0, depends_on=(*INPUTS, *PARAMETERS)),
    Variable(_FIRST_PARAMETER - 1, "distance", "output", "discrete", "m", None, "Of the two ends of the line",
             minimum=0.0, depends_on=(*INPUTS, *(name for name in PARAMETERS if "attachment" in name))),
    *(_parameter(_FIRST_PARAMETER + i, name, start)
      for i, (name, start) in enumerate(zip(PARAMETERS, Line(), strict=True))),
)  # fmt: skip
TETHER_MODEL = Model(
    "Tether",
    "A line between two hovercraft: a spring and a dashpot that pull, and never push",
    VARIABLES,
    stop_time=60.0,
    communication_step=0.01,
)
