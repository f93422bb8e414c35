"""Start values by name, as people give them; and an FMU that has some of its own."""

import keyword
import math
import sys
from collections.abc import Mapping
from typing import TypeAlias

import numpy as np

from ..model.craft import preset
from .description import Flavour
from .interface import BY_NAME, CRAFT_PARAMETERS, HOVERCRAFT
from .near_names import did_you_mean, must_be_one_of
from .python.slave import HovercraftSlave
from .variable import Enumeration

Value: TypeAlias = float | int | str
"""Of a variable; an item of an enumeration may be given by its name."""


def start_values(given: Mapping[str, Value]) -> dict[str, float | int]:
    """The values as numbers. What an Integer beside an Enumeration says, the Enumeration says in what comes back.

    Raises:
        ValueError: see `start_value`; or such an Integer says another item than the Enumeration.
    """
    values = {name: start_value(name, value) for name, value in given.items()}
    for name, beside in HOVERCRAFT.choices.items():
        if beside.name in values:
            number = int(values.pop(beside.name))
            HOVERCRAFT.check_choice(name, number)
            values[name] = HOVERCRAFT.chosen(name, int(values.get(name, BY_NAME[name].start or 0)), number)
    return values


def start_value(name: str, value: Value) -> float | int:
    """The value as a number of the variable's type; an item of an enumeration may be given by name.

    Raises:
        ValueError: no such variable, one that cannot be set, not a number, or no whole one where it must be.
    """
    variable = BY_NAME.get(name)
    if variable is None or variable.start is None:
        settable = [each.name for each in BY_NAME.values() if each.start is not None]
        meant = did_you_mean(name, settable)
        raise ValueError(f"{name} = {value}: must be a variable that can be set: {', '.join(settable)}{meant}")
    if variable.enumeration and isinstance(value, str) and not value.isdigit():
        return _item(name, value, variable.enumeration)
    try:
        number = float(value)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name} = {value!r}: must be a number") from error
    if isinstance(value, bool | np.bool_):
        raise ValueError(f"{name} = {value!r}: must be a number")
    if isinstance(value, str) and not math.isfinite(number):  # 1e400 is said as it was typed
        raise ValueError(f"{name} = {value}: must be a finite number, of at most {sys.float_info.max:.4g}")
    if variable.kind == "Real":
        return number
    if not number.is_integer():
        raise ValueError(f"{name} = {value!r}: must be a whole number" + (" or a name" if variable.enumeration else ""))
    return int(number)


def _item(name: str, value: str, enumeration: Enumeration) -> int:
    number = enumeration.number(value)
    if number is None:
        raise ValueError(must_be_one_of(name, value, [item for item, _ in enumeration.items]))
    return number


def variant(
    flavour: Flavour, name: str, own: Mapping[str, Value] | None = None, preset_name: str | None = None
) -> Flavour:
    """The FMU of the hovercraft under another name, with start values of its own.

    Args:
        flavour: PYTHON, NATIVE or NATIVE3.
        name: its model identifier: the name of the model, of its binaries and of its file.
        own: start values by name; they come after those of the preset.
        preset_name: a craft.

    Raises:
        ValueError: the name is no C identifier; there is no such preset; a start value that the FMU would refuse.
    """
    if not (name.isidentifier() and name.isascii()) or keyword.iskeyword(name):
        raise ValueError(f"name = {name!r}: must be a C identifier: letters, digits and _, no digit first")
    craft = preset("textbook" if preset_name is None else preset_name)
    starts: dict[str, float | int] = {each: getattr(craft, each) for each in CRAFT_PARAMETERS}
    starts |= start_values(own or {})
    _check(starts)
    return flavour.variant(name, {each: value for each, value in starts.items() if value != BY_NAME[each].start})


def _check(starts: Mapping[str, float | int]) -> None:
    """Raises ValueError as the FMU does, where it is set up with these start values."""
    craft = HovercraftSlave(instance_name="check")
    for name, value in starts.items():
        reference = [BY_NAME[name].reference]
        if BY_NAME[name].kind == "Real":
            craft.set_real(reference, [value])
        else:
            craft.set_integer(reference, [int(value)])
    craft.enter_initialization_mode()
    craft.exit_initialization_mode()
