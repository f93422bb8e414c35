"""What an FMU says: the logger that every instance is given, and its words without a wrapper's around them."""

import ast
import itertools
import re
from collections.abc import Callable
from functools import partial
from typing import Any
from weakref import WeakValueDictionary

import fmpy
from fmpy import fmi2

from ..stopping import called_back

WARNING = 1
"""Of FMI's status: what is above it was refused."""


class Log:
    """What one instance has said."""

    def __init__(self, model: str) -> None:
        self.name = f"{model} {next(INSTANCES)}"
        """Of the instance: no other one in this process has it."""
        self.messages: list[str] = []
        """All, warnings and refusals, in their order; who reads them may clear it."""
        self._refusals: list[str] = []
        LOGS[self.name.encode()] = self

    def add(self, status: int, message: str) -> None:
        """Called by the FMU."""
        if status:
            self.messages.append(message)
        if status > WARNING:
            self._refusals.append(message)

    def refusal(self) -> str:
        """Why a call was refused, '' where the FMU did not say."""
        said, self._refusals = "; ".join(self._refusals), []
        return said

    def callback_3(self) -> Callable[..., None]:
        """The logger of FMI 3.0; fmpy hands no environment on, so it knows the name itself."""
        return partial(_log_3, self.name.encode())


LOGS: WeakValueDictionary[bytes, Log] = WeakValueDictionary()
"""Instance name -> where its messages go."""
INSTANCES = itertools.count(1)


@called_back
def _log(_environment: object, name: bytes, status: int, _category: bytes, message: bytes) -> None:
    log = LOGS.get(name)
    if log is not None:
        log.add(status, plain(message.decode(errors="replace")))


@called_back
def _log_3(name: bytes, environment: object, status: int, category: bytes, message: bytes) -> None:
    _log(environment, name, status, category, message)


def _callbacks() -> Any:
    callbacks = fmi2.fmi2CallbackFunctions()
    callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(_log)
    callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
    callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
    return callbacks


CALLBACKS_2 = _callbacks()
"""Of all instances of FMI 2.0. fmpy's own way to a logger keeps one for the process, and calls it when it is gone."""


def plain(message: str) -> str:
    """What a message of pythonfmu's wrapper says, without the call and the kind of exception around it."""
    last = message.strip().splitlines()[-1] if message.strip() else message
    match = re.fullmatch(r"\w+\((?P<text>['\"].*['\"]),?\)", last)
    return str(ast.literal_eval(match["text"])) if match else message.strip()
