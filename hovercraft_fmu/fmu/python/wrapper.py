"""What it takes to live behind pythonfmu's wrapper: its defects, and what is done about each."""

import atexit
import ctypes
import functools
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Concatenate, ParamSpec, TypeVar, cast
from weakref import WeakSet

try:  # inside the FMU: a copy under a name that no other module of the host's process has
    from ...pythonfmu.enums import Fmi2Status
    from ...pythonfmu.fmi2slave import Fmi2Slave
except ImportError:  # while the FMU is built
    from pythonfmu.enums import Fmi2Status
    from pythonfmu.fmi2slave import Fmi2Slave

__all__ = ["Fmi2Slave", "Fmi2Status", "WrappedSlave", "called_by_wrapper"]

P = ParamSpec("P")
R = TypeVar("R")
S = TypeVar("S", bound="WrappedSlave")

ALIVE: "WeakSet[WrappedSlave]" = WeakSet()
LIBRARIES: set[str] = set()


class WrappedSlave(Fmi2Slave):  # type: ignore[misc]  # pythonfmu has no types
    """A slave whose exceptions the wrapper survives."""

    def __init__(self, **kwargs: object) -> None:
        super().__init__(**kwargs)
        ALIVE.add(self)
        if self.resources:
            _release_at_exit(Path(self.resources).parent / "binaries" / "linux64" / f"{type(self).__name__}.so")

    def outlive_exception(self) -> None:
        """To be called before an exception leaves for the wrapper.

        On every exception the wrapper gives up its references to the class, the instance and the log queue, and again
        when the instance is freed: one reference more to each of them balances that. And a message that is still
        queued would turn the text of the exception into 'unknown error'.
        """
        self.log_queue.clear()
        for kept in (type(self), self, self.log_queue):
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(kept))

    @classmethod
    def outlive_exception_of_class(cls) -> None:
        """The same for a method of the class. The wrapper makes a new class for every instance: this is the one."""
        for slave in list(ALIVE):
            if type(slave) is cls:
                slave.outlive_exception()


def called_by_wrapper(method: Callable[Concatenate[S, P], R]) -> Callable[Concatenate[S, P], R]:
    """A method that the wrapper calls; what is called at every communication point does the same without this call."""

    @functools.wraps(method)
    def call(self: S, *args: P.args, **kwargs: P.kwargs) -> R:
        try:
            return method(self, *args, **kwargs)
        except Exception:
            self.outlive_exception()
            raise

    return cast(Callable[Concatenate[S, P], R], call)


def _release_at_exit(library: Path) -> None:
    """Have the library let go of the interpreter before the process ends.

    Where it is still loaded then, it does so twice, the second time in freed memory: now and then the process dies
    of a corrupted heap after all its work is done. Asked to do it earlier, there is nothing left for it to release.
    Only where Python is the host: elsewhere letting go would end the interpreter.
    """
    path = "/" + str(library).lstrip("/")  # hosts write file:/, file:/// and file://// before it
    if sys.platform == "linux" and sys.orig_argv and path not in LIBRARIES and library.exists():
        LIBRARIES.add(path)
        atexit.register(_release, path)


def _release(path: str) -> None:
    try:
        library = ctypes.CDLL(path, mode=os.RTLD_NOLOAD | os.RTLD_LAZY)
    except OSError:
        return  # the host has unloaded it
    library.finalizePythonInterpreter()
