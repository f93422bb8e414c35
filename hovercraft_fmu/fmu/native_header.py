"""variables.h: the table of variables, and what else C and Python must share, for the C compiler."""

import math
import re
from collections.abc import Iterable
from dataclasses import fields

from ..model.craft import DERIVED, NOT_NEGATIVE, POSITIVE, Craft
from ..model.integrators import INTEGRATORS
from .description import guid
from .interface import (
    ACTION,
    BY_NAME,
    COUNTER_STOPPED,
    CRAFT_PARAMETERS,
    DERIVATIVES,
    ENUMERATIONS,
    HELD,
    HOVERCRAFT,
    INPUT_HELD,
    INPUTS,
    MOTION,
    STATES,
    STEP_TURNS,
    STEP_UNSTABLE,
    SUBSTEPS_MAX,
    TIME,
    VARIABLES,
    WARNINGS,
    WATCHED,
)
from .variable import SAME_TIME, Enumeration, Phase, Variable, may_be_set

HEADER = """\
/* Made from hovercraft_fmu/fmu/interface.py. */

#ifndef HOVERCRAFT_VARIABLES_H
#define HOVERCRAFT_VARIABLES_H

#include <math.h>
#include <stddef.h>

#include "linearization.h"

#define BUILD "{build}"
#define GUID "{guid}"

/* Value references; `reals` and `integers` of an instance are indexed by them. */
enum {{
{references}
    VARIABLE_COUNT
}};
enum {{ V_TIME = {time} }}; /* of FMI 3.0 alone; not in `reals` */

enum {{ {counts} }};
enum {{ SUBSTEPS_MAX = {substeps_max} }};
enum {{ {warnings} }};
#define COUNTER_STOPPED_TEXT {counter_text}
{lists}
#define HELD {held}
#define SAME_TIME {same_time}

enum kind {{ REAL, INTEGER, ENUMERATION }};
enum phase {{ {phases}, PHASE_COUNT }};
enum rule {{ {rules} }};

struct variable {{
    const char *name;
    const char *role;       /* variability and causality, for messages */
    enum kind kind;
    enum rule rule;         /* of its value, beyond being finite */
    unsigned settable;      /* bit n: in phase n */
    bool start_given;       /* it is kept as the host set it */
    double start;
}};

struct method {{
    const char *name;
    double stability_limit; /* 1 */
    double rotation_limit;  /* rad */
}};

struct choice {{
    unsigned enumeration;
    unsigned number;        /* of the integer beside it */
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

static const char *const PHASE_NAMES[] = {{{phase_names}}};
static const struct variable VARIABLES[] = {{
{variables}
}};
static const struct method METHODS[] = {{
{methods}
}};
static const struct choice CHOICES[] = {{
{choices}
}};
static const struct craft_field CRAFT_FIELDS[] = {{
{craft_fields}
}};
static const struct derived_value DERIVED[] = {{
{derived}
}};
static const unsigned INPUTS[] = {{{inputs}}};
static const unsigned STATES[] = {{{states}}};
static const unsigned DERIVATIVES[] = {{{derivatives}}}; /* of STATES */
static const double NOMINALS[] = {{{nominals}}};         /* of STATES, in their units */
static const unsigned KNOWNS[] = {{{knowns}}};           /* of linearization.h */
static const unsigned ROWS[] = {{{rows}}};               /* there, too */
static const unsigned MOTION[] = {{{motion}}};
static const unsigned ACTION[] = {{{action}}};
static const unsigned WATCHED[] = {{{watched}}};

#endif
"""
PHASES = (
    *((phase.name, phase.value) for phase in Phase),
    ("EVENT_MODE", "event mode"),
    ("CONTINUOUS_TIME", "continuous-time mode"),
)
"""Name, the words of the standard; the last two are model exchange's."""
OF_A_KIND = {
    "drag_center_fraction": "FRACTION",
    "rotational_drag": "SHARE",
    "step_size": "STEP_SIZE_RULE",
    "tolerance": "TOLERANCE_RULE",
    "integrator": "INTEGRATOR_RULE",
    "drag_area": "DRAG_AREA_RULE",
    "integrator_number": "INTEGRATOR_NUMBER_RULE",
    "drag_area_number": "DRAG_AREA_NUMBER_RULE",
}
RULES = ("ANY", "POSITIVE", "NOT_NEGATIVE", *OF_A_KIND.values())


def variables_header(build: str) -> str:
    """The text of variables.h for the FMU whose content has the hexadecimal digest `build`."""
    warnings = {
        "INPUT_HELD": INPUT_HELD,
        "COUNTER_STOPPED": COUNTER_STOPPED,
        "STEP_UNSTABLE": STEP_UNSTABLE,
        "STEP_TURNS": STEP_TURNS,
    }
    counts = {
        "INPUT_COUNT": len(INPUTS),
        "STATE_COUNT": len(STATES),
        "MOTION_COUNT": len(MOTION),
        "CRAFT_COUNT": len(CRAFT_PARAMETERS),
    }
    return HEADER.format(
        build=build,
        guid=guid(build),
        references="\n".join(f"    {constant(v.name)} = {v.reference}," for v in VARIABLES),
        time=TIME.reference,
        counts=_assigned(counts),
        substeps_max=SUBSTEPS_MAX,
        warnings=_assigned(warnings),
        counter_text=_quoted(WARNINGS[COUNTER_STOPPED]),
        lists="\n".join(_list(each) for each in ENUMERATIONS),
        held=repr(HELD),
        same_time=repr(SAME_TIME),
        phases=", ".join(name for name, _ in PHASES),
        rules=", ".join(RULES),
        phase_names=", ".join(_quoted(words) for _, words in PHASES),
        variables="\n".join(f"    [{constant(v.name)}] = {_row(v)}," for v in VARIABLES),
        methods="\n".join(
            f"    {{{_quoted(m.name)}, {_number(m.stability_limit)}, {_number(m.rotation_limit)}}},"
            for m in INTEGRATORS
        ),
        choices="\n".join(
            f"    {{{constant(name)}, {constant(number.name)}}}," for name, number in HOVERCRAFT.choices.items()
        ),
        craft_fields="\n".join(
            f"    {{{constant(field.name)}, offsetof(struct craft, {field.name})}}," for field in fields(Craft)
        ),
        derived="\n".join(
            f"    {{{_quoted(name)}, {_quoted(unit)}, {_quoted(parts)}, offsetof(struct derived, {name})}},"
            for name, unit, parts in DERIVED
        ),
        inputs=_constants(INPUTS),
        states=_constants(STATES),
        derivatives=_constants(DERIVATIVES),
        nominals=", ".join(_number(BY_NAME[name].nominal or 1.0) for name in STATES),
        knowns=_constants((*STATES, *INPUTS, *(name for name in CRAFT_PARAMETERS if BY_NAME[name].kind == "Real"))),
        rows=_constants((*MOTION, *DERIVATIVES[3:], "projected_area")),
        motion=_constants(MOTION),
        action=_constants(ACTION),
        watched=_constants(WATCHED),
    )


def constant(name: str) -> str:
    """The C name of a variable's value reference."""
    return "V_" + name.upper().replace(".", "_")


def _constants(names: Iterable[str]) -> str:
    return ", ".join(constant(name) for name in names)


def _row(variable: Variable) -> str:
    settable = [may_be_set(variable, phase) for phase in Phase]
    settable += [may_be_set(variable, Phase.STEPPING), variable.causality == "input"]
    phases = sum(1 << i for i, each in enumerate(settable) if each)
    role = _quoted(f"{variable.variability} {variable.causality}")
    given = "true" if variable.start is not None else "false"
    start = _number(float(variable.start or 0.0))
    kind = variable.kind.upper()
    return f"{{{_quoted(variable.name)}, {role}, {kind}, {_rule(variable.name)}, {phases}u, {given}, {start}}}"


def _rule(name: str) -> str:
    """As check_parameter and the slave's _check_set have it."""
    if name in POSITIVE:
        return "POSITIVE"
    if name in NOT_NEGATIVE:
        return "NOT_NEGATIVE"
    return OF_A_KIND.get(name, "ANY")


def _list(enumeration: Enumeration) -> str:
    """How many items it has, and how a message lists them."""
    name = re.sub("(?<=[a-z])(?=[A-Z])", "_", enumeration.type_name).upper()
    return f"#define {name}_COUNT {len(enumeration.items)}\n#define {name}_LIST {_quoted(enumeration.listed)}"


def _assigned(values: dict[str, int]) -> str:
    return ", ".join(f"{name} = {value}" for name, value in values.items())


def _quoted(text: str) -> str:
    return f'"{text}"'


def _number(value: float) -> str:
    return "INFINITY" if value == math.inf else repr(value)
