"""The hovercraft as a native model: its C, its rules, and what of its table that C wants to have by name."""

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import fields

from ..model.craft import DERIVED, NOT_NEGATIVE, POSITIVE, Craft
from ..model.dynamics import Controls, State
from ..model.integrators import INTEGRATORS
from .interface import (
    ACTION,
    BY_NAME,
    COUNTER_STOPPED,
    CRAFT_PARAMETERS,
    DERIVATIVES,
    DRAG_AREA,
    ENUMERATIONS,
    ERROR_ESTIMATE,
    ERROR_LOST,
    ERRORS,
    HELD,
    INPUT_HELD,
    INPUTS,
    INTEGRATOR,
    MOTION,
    STATES,
    STEP_TURNS,
    STEP_UNSTABLE,
    SUBSTEPS_MAX,
    VARIABLES,
    WARNINGS,
    WATCHED,
)
from .native_header import (
    Native,
    Partials,
    Rule,
    assertion,
    assigned,
    constant,
    constants,
    doubles_in_order,
    items_in_order,
    number,
    quoted,
)
from .variable import Enumeration

OWN = """\
enum {{ {counts} }};
enum {{ SUBSTEPS_MAX = {substeps_max} }};
enum {{ {warnings} }};
#define COUNTER_STOPPED_TEXT {counter_text}
#define INTEGRATOR_COUNT {integrator_count}
#define HELD {held}

struct method {{
    const char *name;
    int order;              /* of the error, as a power of the sub-step */
    int rubbing_order;      /* what the estimate takes it for where skirt and ground rub */
    double stability_limit; /* 1 */
    double rotation_limit;  /* rad */
}};

struct craft_field {{
    unsigned reference;
    size_t offset;          /* in struct craft */
}};

struct derived_value {{
    const char *name;
    const char *unit;
    const char *parts;      /* what it is worked out of */
    size_t offset;          /* in struct derived */
}};

static const struct method METHODS[] = {{
{methods}
}};
static const struct craft_field CRAFT_FIELDS[] = {{
{craft_fields}
}};
static const struct derived_value DERIVED[] = {{
{derived}
}};
static const unsigned MOTION[] = {{{motion}}};
static const unsigned ACTION[] = {{{action}}};
/* Where in struct craft the known with number KNOWN_COUNT + i is. */
static const size_t CRAFT_REALS[] = {{
{craft_reals}
}};

/* The structures of kernel.h are in the order of the table: as numbers they are copied as a whole. */
{agreed}
"""
CRAFT_REALS = tuple(name for name in CRAFT_PARAMETERS if BY_NAME[name].kind == "Real")


def _own() -> str:
    counts = {
        "MOTION_COUNT": len(MOTION),
        "ACTION_COUNT": len(ACTION),
        "CRAFT_COUNT": len(CRAFT_PARAMETERS),
        "CRAFT_REAL_COUNT": len(CRAFT_REALS),
        "GIVEN_REAL_COUNT": sum(v.kind == "Real" and v.start is not None for v in VARIABLES),
    }
    warnings = {
        "INPUT_HELD": INPUT_HELD,
        "COUNTER_STOPPED": COUNTER_STOPPED,
        "STEP_UNSTABLE": STEP_UNSTABLE,
        "STEP_TURNS": STEP_TURNS,
        "ERROR_LOST": ERROR_LOST,
    }
    return OWN.format(
        counts=assigned(counts),
        substeps_max=SUBSTEPS_MAX,
        warnings=assigned(warnings),
        counter_text=quoted(WARNINGS[COUNTER_STOPPED]),
        integrator_count=len(INTEGRATORS),
        held=repr(HELD),
        methods="\n".join(
            f"    {{{quoted(m.name)}, {m.order}, {m.rubbing_order}, {number(m.stability_limit)}, "
            f"{number(m.rotation_limit)}}},"
            for m in INTEGRATORS
        ),
        craft_fields="\n".join(
            f"    {{{constant(field.name)}, offsetof(struct craft, {field.name})}}," for field in fields(Craft)
        ),
        derived="\n".join(
            f"    {{{quoted(name)}, {quoted(unit)}, {quoted(parts)}, offsetof(struct derived, {name})}},"
            for name, unit, parts in DERIVED
        ),
        motion=constants(MOTION),
        action=constants(ACTION),
        craft_reals="\n".join(f"    offsetof(struct craft, {name})," for name in CRAFT_REALS),
        agreed="\n".join(_agreed()),
    )


def _agreed() -> Iterator[str]:
    yield from doubles_in_order("state", State._fields)
    yield from doubles_in_order("controls", Controls._fields)
    yield assertion("offsetof(struct model, state) == 0", "states first")
    yield from items_in_order(ENUMERATIONS)


def _rules() -> Iterator[tuple[str, Rule]]:
    """As check_parameter and the slave's _check_value have them."""
    for name in POSITIVE:
        yield name, Rule(0.0, math.inf, "must be greater than 0", open=True)
    for name in NOT_NEGATIVE:
        yield name, Rule(0.0, math.inf, "must not be negative")
    yield "drag_center_fraction", Rule(-0.5, 0.5, "must be from -0.5 (stern) to 0.5 (bow)")
    yield "rotational_drag", Rule(0.0, 1.0, "must be from 0 (off) to 1 (the whole moment)")
    for name, unit in (("step_size", " s"), ("tolerance", "")):
        yield name, Rule(0.0, math.inf, "must be a finite number greater than 0", open=True, unit=unit)
    for enumeration in (INTEGRATOR, DRAG_AREA, ERROR_ESTIMATE):
        yield from _choice(enumeration)


def _choice(enumeration: Enumeration) -> Iterator[tuple[str, Rule]]:
    """Of an Enumeration, and of the Integer beside it."""
    name = re.sub("(?<=[a-z])(?=[A-Z])", "_", enumeration.type_name).lower()
    last, listed = float(len(enumeration.items)), f"one of {enumeration.listed}"
    yield name, Rule(1.0, last, f"must be {listed}")
    yield f"{name}_number", Rule(0.0, last, f"must be 0 (as {name} says) or {listed}")


RULES: Mapping[str, Rule] = dict(_rules())
CRAFT_NATIVE = Native(
    folder="hovercraft",
    parts=("hovercraft.c", "kernel.c", "linearization.c", "logarithm.c", "partials.c", "trig.c"),
    inputs=INPUTS,
    rules=RULES,
    states=STATES,
    on_demand=frozenset((*ACTION, *WATCHED)),
    partials=Partials(CRAFT_REALS, (*MOTION, *DERIVATIVES[len(STATES) // 2 :], "projected_area"), ERRORS),
    own=_own,
)
