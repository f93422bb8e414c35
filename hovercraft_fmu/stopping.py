"""How a run is stopped, by Ctrl-C or by who asks the process to end: at any moment, but never inside an FMU.

An exception that comes up in Python code that an FMU runs, or calls back, is taken for the FMU's own; pythonfmu's
wrapper loses its references over it, and the process dies.
"""

import _thread
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import CodeType, FrameType
from typing import Any, NoReturn, TypeVar

from .whole import PREFIX, clear

SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
AGAIN = 0.01
"""s: until it is tried again, where it cannot be now."""
FLUSHING = 0.1
"""s"""
PATIENCE = 1.2
"""s: what is not at its end by then, as it is in a long step of machine code, is ended where it is."""
DRIVES = tuple(os.path.join("fmpy", name) for name in ("fmi1.py", "fmi2.py", "fmi3.py", "sundials"))
"""Files whose functions call an FMU, or are called by a solver: what is between is not to be interrupted."""

STOPPED = "hovercraft-fmu: stopped"
SHOW_CURSOR = "\x1b[?25h\n"
"""A progress bar hides it."""

_called_back: set[CodeType] = set()
_held = 0
_stop: list[int] = []
"""The signal that ends this process, once there was one."""
Function = TypeVar("Function", bound=Callable[..., Any])


def called_back(function: Function) -> Function:
    """A function that C calls: what comes up in it would be lost."""
    _called_back.add(function.__code__)
    return function


@contextmanager
def held() -> Iterator[None]:
    """What is in here is done before one stops."""
    global _held
    _held += 1
    try:
        yield
    finally:
        _held -= 1


def _is_inside(frame: FrameType | None) -> bool:
    while frame:
        file = frame.f_code.co_filename
        if frame.f_code in _called_back or PREFIX in file or any(name in file for name in DRIVES):
            return True
        frame = frame.f_back
    return False


def _is_now(signum: int, frame: FrameType | None) -> bool:
    """Whether one can stop here; else it is tried again."""
    if not (_held or _is_inside(frame)):
        return True
    later = threading.Timer(AGAIN, _thread.interrupt_main, [signum])
    later.daemon = True
    later.start()
    return False


def _interrupt(signum: int, frame: FrameType | None) -> None:
    if _is_now(signum, frame):
        raise KeyboardInterrupt


class Interruptible:
    """Ctrl-C waits until an FMU is left, from here to `close`; where the program has no way of its own for it."""

    def __init__(self) -> None:
        self._mine = (
            threading.current_thread() is threading.main_thread()
            and signal.getsignal(signal.SIGINT) is signal.default_int_handler
        )
        if self._mine:
            signal.signal(signal.SIGINT, _interrupt)

    def close(self) -> None:
        """As it was before."""
        if self._mine and signal.getsignal(signal.SIGINT) is _interrupt:
            signal.signal(signal.SIGINT, signal.default_int_handler)


# ---- of the command


def watch() -> None:
    """Have the signals that ask this process to end do so, in an orderly way or, after a moment, where it is.

    One that is ignored when the process starts, as in the background of a shell, stays ignored.
    """
    here, there = socket.socketpair()
    there.setblocking(False)
    signal.set_wakeup_fd(there.fileno(), warn_on_full_buffer=False)
    threading.Thread(target=_end_after, args=(here, there), daemon=True).start()
    sys.unraisablehook = _report
    for each in SIGNALS:
        if signal.getsignal(each) != signal.SIG_IGN:
            signal.signal(each, _stopped)


def _stopped(signum: int, frame: FrameType | None) -> None:
    """Once: what is done then is not interrupted."""
    if not _stop and _is_now(signum, frame):
        _stop.append(signum)
        raise KeyboardInterrupt


def _report(lost: "sys.UnraisableHookArgs") -> None:
    """Where the exception is lost the process ends a moment later."""
    if lost.exc_type is not KeyboardInterrupt:
        sys.__unraisablehook__(lost)


def over() -> None:
    """The command is at its end: what is left is not interrupted."""
    for each in SIGNALS:
        if signal.getsignal(each) is _stopped:
            signal.signal(each, signal.SIG_IGN)


def end() -> NoReturn:
    """Leave after a KeyboardInterrupt."""
    over()
    _leave(next(iter(_stop), signal.SIGINT))


def _end_after(signals: socket.socket, _other_end: socket.socket) -> None:
    signum = next(each for each in iter(lambda: signals.recv(1)[0], None) if each in SIGNALS)
    time.sleep(PATIENCE)
    _leave(signum)


def _leave(signum: int) -> NoReturn:
    """Clear away what was begun, and go at once: the interpreter may be in the middle of anything."""
    with suppress(Exception):
        _kill_children()
    clear()
    flushing = threading.Thread(target=sys.stdout.flush, daemon=True)  # another one may be at it, and not come back
    flushing.start()
    flushing.join(FLUSHING)
    with suppress(OSError):
        os.write(2, (SHOW_CURSOR if os.isatty(2) else "").encode() + f"{STOPPED}\n".encode())
    os._exit(128 + signum)


def _kill_children() -> None:
    from psutil import Process

    for child in Process().children(recursive=True):
        child.kill()
