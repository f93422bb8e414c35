"""The command as a program: `hovercraft-fmu`, or `python -m hovercraft_fmu`. It can be stopped before all is loaded."""

import _signal  # type: ignore[import-not-found]  # what `signal` is made of: that takes some time to load
import os
import sys


def main() -> None:
    """Run the command and leave the process."""
    for each in (_signal.SIGINT, _signal.SIGTERM):
        if _signal.getsignal(each) != _signal.SIG_IGN:
            _signal.signal(each, _leave)
    _open_streams()  # before anything else gets their numbers
    os.environ["MPLBACKEND"] = "agg"  # pictures go to files: what a terminal of Jupyter asks for may not be here
    from . import stopping

    stopping.watch()
    try:
        from .cli import main as command

        command()
    except KeyboardInterrupt:
        stopping.end()
    finally:
        stopping.over()


def _leave(signum: int, _frame: object) -> None:
    """While nothing is begun."""
    os.write(2, b"hovercraft-fmu: stopped\n")
    os._exit(128 + signum)


def _open_streams() -> None:
    """A shell may have closed them: what is written there is for nobody, and no other file is to get their numbers."""
    for number, name in enumerate(("stdin", "stdout", "stderr")):
        if getattr(sys, name) is None:
            nowhere = os.open(os.devnull, os.O_RDWR)
            if nowhere != number:
                os.dup2(nowhere, number)
            setattr(sys, name, open(number, "r" if name == "stdin" else "w", closefd=False))  # noqa: SIM115 - it stays


if __name__ == "__main__":
    main()
