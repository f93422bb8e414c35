"""The autopilot as native FMUs: its C, its rules, what of its table that C wants to have by name; a flavour each."""

import math
from collections.abc import Iterator
from dataclasses import fields, replace
from itertools import pairwise

from ..fmu.description import CAPABILITIES, CAPABILITIES_3, NATIVE, NATIVE3, PYTHON
from ..fmu.interface import STATES
from ..fmu.native_header import Native, Rule, assertion, assigned, constant, constants, doubles_in_order, quoted
from .guidance import CHOICES, POSITIVE, UNITS_OF_ORDERS, Orders, Pilot
from .pilot_interface import AUTOPILOT_MODEL, ORDERS, SHOWN, STATUS, WAYPOINT_NAMES, WAYPOINTS_MAX

OWN = """\
enum {{ {counts} }};

struct order_field {{
    unsigned reference;
    size_t offset; /* in struct orders */
}};

static const struct order_field ORDER_FIELDS[] = {{
{orders}
}};
static const char *const STATUS[] = {{
{status}
}};
static const unsigned SHOWN[] = {{{shown}}};
static const unsigned COURSE[] = {{{course}}}; /* x and y of each waypoint */

{agreed}
"""


def _own() -> str:
    counts = {"ORDER_COUNT": len(ORDERS), "STATUS_COUNT": len(STATUS), "SHOWN_COUNT": len(SHOWN)}
    return OWN.format(
        counts=assigned(counts),
        orders="\n".join(f"    {{{constant(name)}, offsetof(struct orders, {name})}}," for name in ORDERS),
        status="\n".join(f"    {quoted(text)}," for text in STATUS.values()),
        shown=constants(SHOWN),
        course=constants(WAYPOINT_NAMES),
        agreed="\n".join(_agreed()),
    )


def _agreed() -> Iterator[str]:
    yield from doubles_in_order("motion", ("x", "y", "heading", "vx", "vy", "yaw_rate"))
    yield from doubles_in_order("waypoint", ("x", "y"))
    yield assertion(f"COURSE_MAX == {WAYPOINTS_MAX}", "the number of waypoints")
    assert [*STATUS] == [1 << bit for bit in range(len(STATUS))]
    for structure, members in (("orders", [field.name for field in fields(Orders)]), ("pilot", Pilot._fields)):
        for before, after in pairwise(members):
            order = f"offsetof(struct {structure}, {before}) < offsetof(struct {structure}, {after})"
            yield assertion(order, f"{structure}.{after}")


def _rules() -> Iterator[tuple[str, Rule]]:
    """As check_order and the slave's _check_value have them."""
    for name in ORDERS:
        if name in CHOICES:
            yield name, Rule(0.0, 1.0, "must be 0 or 1")
            continue
        unit = f" {UNITS_OF_ORDERS[name]}"
        if name in POSITIVE:
            yield name, Rule(0.0, math.inf, "must be a finite number greater than 0", open=True, unit=unit)
        elif name == "thrust_min":
            yield name, Rule(-math.inf, 0.0, "must be a finite number, 0 or less", unit=unit)
        else:
            yield name, Rule(0.0, math.inf, "must be a finite number, 0 or greater", unit=unit)
    yield "waypoint_count", Rule(1.0, WAYPOINTS_MAX, f"must be from 1 to {WAYPOINTS_MAX}")


PILOT_NATIVE = Native(
    folder="autopilot",
    parts=("arctangent.c", "autopilot.c", "guidance.c", "trig.c"),
    inputs=STATES,
    rules=dict(_rules()),
    own=_own,
)
AUTOPILOT = PYTHON.of(AUTOPILOT_MODEL)
AUTOPILOT_NATIVE = replace(
    NATIVE,
    model=AUTOPILOT_MODEL,
    identifier=f"{AUTOPILOT_MODEL.name}Native",
    capabilities=CAPABILITIES,
    exchange={},
    native=PILOT_NATIVE,
)
AUTOPILOT_NATIVE3 = replace(
    NATIVE3,
    model=AUTOPILOT_MODEL,
    identifier=f"{AUTOPILOT_MODEL.name}Native3",
    capabilities={
        "canHandleVariableCommunicationStepSize": "true",
        "maxOutputDerivativeOrder": "0",
        "providesIntermediateUpdate": "false",
        "mightReturnEarlyFromDoStep": "false",
        "canReturnEarlyAfterIntermediateUpdate": "false",
        "hasEventMode": "false",
        **CAPABILITIES_3,
        "providesDirectionalDerivatives": "false",
        "providesAdjointDerivatives": "false",
    },
    exchange={},
    native=PILOT_NATIVE,
    in_browsers=False,
)
