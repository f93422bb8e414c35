"""variables.h: the table of variables, and what else C and Python must share, for the C compiler."""

import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import fields

from ..model.craft import DERIVED, NOT_NEGATIVE, POSITIVE, Craft
from ..model.dynamics import Controls, State
from ..model.integrators import INTEGRATORS
from .block import MARK, Block
from .interface import (
    ACTION,
    BY_NAME,
    COUNTER_STOPPED,
    CRAFT_PARAMETERS,
    DERIVATIVES,
    ENUMERATIONS,
    ERROR_LOST,
    ERRORS,
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
from .variable import Enumeration, Phase, Variable, may_be_set

HEADER = """\
/* Made from hovercraft_fmu/fmu/interface.py. */

#ifndef HOVERCRAFT_VARIABLES_H
#define HOVERCRAFT_VARIABLES_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "kernel.h"

#define CODE "{code}" /* a digest of code, table, compiler and options */

/* Value references; `reals` and `integers` of an instance are indexed by them. */
enum {{
{references}
    VARIABLE_COUNT
}};
enum {{ V_TIME = {time} }}; /* of FMI 3.0 alone; not in `reals` */

enum {{ {counts} }};
/* What derivatives are taken with respect to: states and inputs, and, at the start, the numbers of struct craft. */
enum {{ KNOWN_COUNT = STATE_COUNT + INPUT_COUNT, INITIAL_KNOWN_COUNT = KNOWN_COUNT + CRAFT_REAL_COUNT }};
enum known {{ {known} }};
/* And what they are taken of. */
enum row {{ {row}, ROW_COUNT }};
enum {{ SUBSTEPS_MAX = {substeps_max} }};
enum {{ {warnings} }};
#define COUNTER_STOPPED_TEXT {counter_text}
{lists}
#define HELD {held}

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
}};

struct variant {{
    char mark[16];          /* by which it is found in a library */
    uint64_t size;          /* bytes */
    char code[40];          /* that it belongs to */
    char build[40];         /* what a saved state must be of */
    char guid[40];
    double starts[VARIABLE_COUNT];
    uint64_t checksum;
}};

struct method {{
    const char *name;
    int order;              /* of the error, as a power of the sub-step */
    int rubbing_order;      /* what the estimate takes it for where skirt and ground rub */
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
static const struct variant VARIANT = {{
    "{mark}", {size}, "{code}", "{build}", "{guid}",
    {{
{starts}
    }},
    UINT64_C({checksum:#x})
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
static const unsigned KNOWNS[] = {{{knowns}}};
static const unsigned ROWS[] = {{{rows}}};
static const unsigned ERRORS[] = {{{errors}}};
static const unsigned MOTION[] = {{{motion}}};
static const unsigned ACTION[] = {{{action}}};
static const unsigned WATCHED[] = {{{watched}}};
/* Where in struct craft the known with number KNOWN_COUNT + i is. */
static const size_t CRAFT_REALS[] = {{
{craft_reals}
}};

/* The structures of kernel.h are in the order of the table: as numbers they are copied as a whole. */
{agreed}

#endif
"""
PHASES = (
    *((phase.name, phase.value) for phase in Phase),
    ("EVENT_MODE", "event mode"),
    ("CONTINUOUS_TIME", "continuous-time mode"),
    ("INTERMEDIATE_UPDATE", "intermediate update mode"),
)
"""Name, the words of the standard; those that are not in every FMU are the last: two of model exchange, and one of
FMI 3.0, inside a step."""
OF_A_KIND = {
    "drag_center_fraction": "FRACTION",
    "rotational_drag": "SHARE",
    "step_size": "STEP_SIZE_RULE",
    "tolerance": "TOLERANCE_RULE",
    "integrator": "INTEGRATOR_RULE",
    "drag_area": "DRAG_AREA_RULE",
    "integrator_number": "INTEGRATOR_NUMBER_RULE",
    "drag_area_number": "DRAG_AREA_NUMBER_RULE",
    "error_estimate": "ERROR_ESTIMATE_RULE",
    "error_estimate_number": "ERROR_ESTIMATE_NUMBER_RULE",
}
RULES = ("ANY", "POSITIVE", "NOT_NEGATIVE", *OF_A_KIND.values())


def variables_header(block: Block) -> str:
    """The text of variables.h for the FMU whose block of start values that is."""
    warnings = {
        "INPUT_HELD": INPUT_HELD,
        "COUNTER_STOPPED": COUNTER_STOPPED,
        "STEP_UNSTABLE": STEP_UNSTABLE,
        "STEP_TURNS": STEP_TURNS,
        "ERROR_LOST": ERROR_LOST,
    }
    craft_reals = [name for name in CRAFT_PARAMETERS if BY_NAME[name].kind == "Real"]
    counts = {
        "INPUT_COUNT": len(INPUTS),
        "STATE_COUNT": len(STATES),
        "ERROR_COUNT": len(ERRORS),
        "MOTION_COUNT": len(MOTION),
        "ACTION_COUNT": len(ACTION),
        "WATCHED_COUNT": len(WATCHED),
        "CRAFT_COUNT": len(CRAFT_PARAMETERS),
        "CRAFT_REAL_COUNT": len(craft_reals),
        "GIVEN_REAL_COUNT": sum(v.kind == "Real" and v.start is not None for v in VARIABLES),
    }
    rows = (*MOTION, *DERIVATIVES[len(STATES) // 2 :], "projected_area")
    return HEADER.format(
        mark=MARK.decode(),
        code=block.code,
        build=block.build,
        guid=block.guid,
        size=block.size,
        checksum=block.checksum,
        starts="\n".join(
            f"        [{constant(v.name)}] = {block.starts[v.reference]!r}," for v in VARIABLES if v.start is not None
        ),
        references="\n".join(f"    {constant(v.name)} = {v.reference}," for v in VARIABLES),
        time=TIME.reference,
        counts=_assigned(counts),
        substeps_max=SUBSTEPS_MAX,
        warnings=_assigned(warnings),
        counter_text=_quoted(WARNINGS[COUNTER_STOPPED]),
        lists="\n".join(_list(each) for each in ENUMERATIONS),
        held=repr(HELD),
        phases=", ".join(name for name, _ in PHASES),
        rules=", ".join(RULES),
        phase_names=", ".join(_quoted(words) for _, words in PHASES),
        variables="\n".join(f"    [{constant(v.name)}] = {_row(v)}," for v in VARIABLES),
        methods="\n".join(
            f"    {{{_quoted(m.name)}, {m.order}, {m.rubbing_order}, {_number(m.stability_limit)}, "
            f"{_number(m.rotation_limit)}}},"
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
        known=_constants((*STATES, *INPUTS), "KNOWN_"),
        row=_constants(rows, "ROW_"),
        knowns=_constants((*STATES, *INPUTS, *craft_reals)),
        rows=_constants(rows),
        errors=_constants(ERRORS),
        motion=_constants(MOTION),
        action=_constants(ACTION),
        watched=_constants(WATCHED),
        craft_reals="\n".join(f"    offsetof(struct craft, {name})," for name in craft_reals),
        agreed="\n".join((*_in_order("state", State._fields), *_in_order("controls", Controls._fields), *_numbered())),
    )


def constant(name: str, prefix: str = "V_") -> str:
    """The C name of a variable's value reference."""
    return prefix + name.upper().replace(".", "_")


def _constants(names: Iterable[str], prefix: str = "V_") -> str:
    return ", ".join(constant(name, prefix) for name in names)


def _in_order(structure: str, members: tuple[str, ...]) -> Iterator[str]:
    """Of doubles alone, in this order."""
    for i, member in enumerate(members):
        yield _assertion(f"offsetof(struct {structure}, {member}) == {i} * sizeof(double)", f"{structure}.{member}")
    yield _assertion(f"sizeof(struct {structure}) == {len(members)} * sizeof(double)", structure)


def _numbered() -> Iterator[str]:
    """The enumerators of kernel.h, by the names of the items."""
    for each in ENUMERATIONS:
        for number, (item, _) in enumerate(each.items, 1):
            yield _assertion(f"{item.upper()} == {number}", f"{each.type_name}.{item}")


def _assertion(condition: str, what: str) -> str:
    return f'_Static_assert({condition}, "{what} as in the table");'


def _row(variable: Variable) -> str:
    settable = [may_be_set(variable, phase) for phase in Phase]
    is_input = variable.causality == "input"
    settable += [may_be_set(variable, Phase.STEPPING), is_input, is_input]
    phases = sum(1 << i for i, each in enumerate(settable) if each)
    role = _quoted(f"{variable.variability} {variable.causality}")
    given = "true" if variable.start is not None else "false"
    kind = variable.kind.upper()
    return f"{{{_quoted(variable.name)}, {role}, {kind}, {_rule(variable.name)}, {phases}u, {given}}}"


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
