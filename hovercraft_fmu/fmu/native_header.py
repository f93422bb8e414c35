"""variables.h: the table of variables, and what else C and Python must share, whatever the model."""

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from .block import MARK, Block
from .interface import TIME
from .variable import Enumeration, Model, Phase, Variable, may_be_set

HEADER = """\
/* Made from the table of variables of {model}. */

#ifndef HOVERCRAFT_VARIABLES_H
#define HOVERCRAFT_VARIABLES_H

#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "{folder}.h"

#define CODE "{code}" /* a digest of code, table, compiler and options */

/* Value references; `reals` and `integers` of an instance are indexed by them. */
enum {{
{references}
    VARIABLE_COUNT
}};
enum {{ V_TIME = {time} }}; /* of FMI 3.0 alone; not in `reals` */

enum {{ {counts} }};

enum kind {{ REAL, INTEGER, ENUMERATION, BOOLEAN }};
enum phase {{ {phases}, PHASE_COUNT }};

struct rule {{
    double low, high;
    bool open;              /* `low` itself is outside */
    const char *why;        /* what is said of a value outside; NULL: there is no rule */
    const char *unit;       /* and behind the value */
}};

struct variable {{
    const char *name;
    const char *role;       /* variability and causality, for messages */
    enum kind kind;
    unsigned settable;      /* bit n: in phase n */
    bool start_given;       /* it is kept as the host set it */
    bool on_demand;         /* it is worked out only where it is asked for */
    struct rule rule;       /* of its value, beyond being finite */
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

struct choice {{
    unsigned enumeration;
    unsigned number;        /* of the integer beside it */
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
/* A list of none has one element, which is not counted. */
static const struct choice CHOICES[] = {{
{choices}
}};
static const unsigned INPUTS[] = {{{inputs}}};
static const unsigned STATES[] = {{{states}}};
static const unsigned DERIVATIVES[] = {{{derivatives}}}; /* of STATES */
static const double NOMINALS[] = {{{nominals}}};         /* of STATES, in their units */
{partials}
/* ---- what the C of {model} alone wants to know */

{own}
#endif
"""
PARTIALS = """
/* What derivatives are taken with respect to: states and inputs, and, at the start, parameters; what they are taken of;
   outputs; and what follows nothing at once. */
enum {{ KNOWN_COUNT = STATE_COUNT + INPUT_COUNT, INITIAL_KNOWN_COUNT = KNOWN_COUNT + {parameters} }};
enum {{ {counts} }};
enum known {{ {known} }};
enum row {{ {row}, ROW_COUNT }};
static const unsigned KNOWNS[] = {{{knowns}}};
static const unsigned ROWS[] = {{{rows}}};
static const unsigned OUTPUTS[] = {{{outputs}}};
static const unsigned FLAT[] = {{{flat}}};
"""
PHASES = (
    *((phase.name, phase.value) for phase in Phase),
    ("EVENT_MODE", "event mode"),
    ("CONTINUOUS_TIME", "continuous-time mode"),
    ("INTERMEDIATE_UPDATE", "intermediate update mode"),
)
"""Name, the words of the standard; those that are not in every FMU are the last: two of model exchange, and one of
FMI 3.0, inside a step."""


class Rule(NamedTuple):
    """Which finite values a variable can have, and what is said of the others, as Python says it."""

    low: float
    high: float
    why: str
    open: bool = False
    """`low` itself is outside."""
    unit: str = ""
    """What stands behind the value."""


class Partials(NamedTuple):
    """What has partial derivatives, by name."""

    parameters: tuple[str, ...]
    """In the order of struct linearization."""
    rows: tuple[str, ...]
    flat: tuple[str, ...]
    """What is an output and follows nothing at once."""


@dataclass(frozen=True)
class Native:
    """The C of a model, and what of its table that wants to have in order. How to add one: native/room/model.h."""

    folder: str
    """Of native/; the header in it is named after it."""
    parts: tuple[str, ...]
    """Its files of C, with those of arithmetic/ and of the room that not every model needs."""
    inputs: tuple[str, ...]
    rules: Mapping[str, Rule]
    """Of variables that can be set and have one."""
    states: tuple[str, ...] = ()
    on_demand: frozenset[str] = frozenset()
    """What is worked out only where it is asked for."""
    partials: Partials | None = None
    own: Callable[[], str] = str
    """Declarations that its C alone wants to have."""


def variables_header(model: Model, native: Native, block: Block) -> str:
    """The text of variables.h for the FMU whose block of start values that is."""
    derivatives = [v.name for state in native.states for v in model.variables if v.derivative_of == state]
    return HEADER.format(
        model=model.name,
        folder=native.folder,
        mark=MARK.decode(),
        code=block.code,
        build=block.build,
        guid=block.guid,
        size=block.size,
        checksum=block.checksum,
        starts="\n".join(
            f"        [{constant(v.name)}] = {block.starts[v.reference]!r},"
            for v in model.variables
            if v.start is not None
        ),
        references="\n".join(f"    {constant(v.name)} = {v.reference}," for v in model.variables),
        time=TIME.reference,
        counts=assigned({"INPUT_COUNT": len(native.inputs), "STATE_COUNT": len(native.states)}),
        phases=", ".join(name for name, _ in PHASES),
        phase_names=", ".join(quoted(words) for _, words in PHASES),
        variables="\n".join(f"    [{constant(v.name)}] = {_row(v, native)}," for v in model.variables),
        choices="\n".join(
            f"    {{{constant(name)}, {constant(number.name)}}}," for name, number in model.choices.items()
        )
        or "    {0, 0}",
        inputs=constants(native.inputs),
        states=constants(native.states),
        derivatives=constants(derivatives),
        nominals=", ".join(number(model.by_name[name].nominal or 1.0) for name in native.states) or "0",
        partials=_partials(model, native) if native.partials else "",
        own=native.own(),
    )


def _partials(model: Model, native: Native) -> str:
    assert native.partials
    parameters, rows, flat = native.partials
    knowns = (*native.states, *native.inputs)
    outputs = [
        v.name
        for v in model.variables
        if v.causality == "output" and v.kind == "Real" and v.name not in (*native.states, *flat)
    ]
    return PARTIALS.format(
        parameters=len(parameters),
        counts=assigned({"OUTPUT_COUNT": len(outputs), "FLAT_COUNT": len(flat)}),
        known=constants(knowns, "KNOWN_"),
        row=constants(rows, "ROW_"),
        knowns=constants((*knowns, *parameters)),
        rows=constants(rows),
        outputs=constants(outputs),
        flat=constants(flat),
    )


def constant(name: str, prefix: str = "V_") -> str:
    """The C name of a variable's value reference."""
    return prefix + re.sub(r"\W+", "_", name).strip("_").upper()


def constants(names: Iterable[str], prefix: str = "V_") -> str:
    """A list of them; 0 for none."""
    return ", ".join(constant(name, prefix) for name in names) or "0"


def doubles_in_order(structure: str, members: Sequence[str]) -> Iterator[str]:
    """Assertions: a structure is doubles alone, in this order."""
    for i, member in enumerate(members):
        yield assertion(f"offsetof(struct {structure}, {member}) == {i} * sizeof(double)", f"{structure}.{member}")
    yield assertion(f"sizeof(struct {structure}) == {len(members)} * sizeof(double)", structure)


def items_in_order(enumerations: Iterable[Enumeration]) -> Iterator[str]:
    """Assertions: enumerators of the model's own headers have the numbers of the items of that name."""
    for each in enumerations:
        for value, (item, _) in enumerate(each.items, 1):
            yield assertion(f"{item.upper()} == {value}", f"{each.type_name}.{item}")


def assertion(condition: str, what: str) -> str:
    """What is found out by the compiler."""
    return f'_Static_assert({condition}, "{what} as in the table");'


def _row(variable: Variable, native: Native) -> str:
    settable = [may_be_set(variable, phase) for phase in Phase]
    is_input = variable.causality == "input"
    settable += [may_be_set(variable, Phase.STEPPING), is_input, is_input]
    phases = sum(1 << i for i, each in enumerate(settable) if each)
    role = quoted(f"{variable.variability} {variable.causality}")
    given, late = (_truth(each) for each in (variable.start is not None, variable.name in native.on_demand))
    found = native.rules.get(variable.name)
    low, high, why, is_open, unit = found or Rule(-math.inf, math.inf, "")
    rule = f"{{{number(low)}, {number(high)}, {_truth(is_open)}, {quoted(why) if found else 'NULL'}, {quoted(unit)}}}"
    return f"{{{quoted(variable.name)}, {role}, {variable.kind.upper()}, {phases}u, {given}, {late}, {rule}}}"


def _truth(value: bool) -> str:
    return "true" if value else "false"


def assigned(values: Mapping[str, int]) -> str:
    """Of enumerators."""
    return ", ".join(f"{name} = {value}" for name, value in values.items())


def quoted(text: str) -> str:
    """As a string of C."""
    return f'"{text}"'


def number(value: float) -> str:
    """As a double of C."""
    return repr(value).replace("inf", "INFINITY")
