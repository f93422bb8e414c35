"""What a name that is not known may have meant."""

from collections.abc import Callable, Iterable
from difflib import get_close_matches
from functools import wraps
from inspect import signature
from pathlib import Path
from typing import ParamSpec, TypeVar

from .interface import BY_NAME

NEAR = 0.75
"""difflib's measure from 0 to 1: what is less alike was hardly meant."""
P = ParamSpec("P")
R = TypeVar("R")


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """'; did you mean "mass"?', or nothing where no name is near."""
    known = tuple(known)
    near = get_close_matches(str(name).lower(), {each.lower(): each for each in known}, n=1, cutoff=NEAR)
    found = next((each for each in known if near and each.lower() == near[0]), None)
    return f"; did you mean {found!r}?" if found else ""


def must_be_one_of(what: str, name: object, known: Iterable[str]) -> str:
    """The message where a name is none of those that there are."""
    known = tuple(known)
    return f"{what} = {name!r}: must be one of {', '.join(known)}{did_you_mean(name, known)}"


def beside(path: Path) -> str:
    """What a file that is not there may have meant: a file of its folder that has nearly its name."""
    try:
        names = [each.name for each in path.parent.iterdir() if each.name != path.name]
    except OSError:
        return ""
    return did_you_mean(path.name, names)


def explains_keywords(function: Callable[P, R]) -> Callable[P, R]:
    """The function, which says what a keyword that it has not got may have meant. (Python 3.13 does so by itself.)"""
    names = tuple(signature(function).parameters)

    @wraps(function)
    def called(*arguments: P.args, **keywords: P.kwargs) -> R:
        for name in keywords:
            if name not in names:
                is_start = name in BY_NAME and "start_values" in names
                hint = f"; did you mean start_values={{{name!r}: ...}}?" if is_start else did_you_mean(name, names)
                raise TypeError(f"{function.__name__}({name}=...): must be one of {', '.join(names)}{hint}")
        return function(*arguments, **keywords)

    return called
