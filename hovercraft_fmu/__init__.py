"""A hovercraft as an FMU: build it, run it."""

from importlib import import_module

from ._version import __version__

TYPE_CHECKING = False  # as typing has it, which takes some time to load: a command is to be stopped from the start on
if TYPE_CHECKING:
    from typing import Any

    from .building import build
    from .host import SimulationError
    from .host.fleet import Crafts, advance_fleet
    from .simulation import Advice, Result, advise, simulate

_HOMES = {
    "Advice": "simulation",
    "Crafts": "host.fleet",
    "Result": "simulation",
    "SimulationError": "host",
    "advance_fleet": "host.fleet",
    "advise": "simulation",
    "build": "building",
    "simulate": "simulation",
}
"""Where each name is from: a module is loaded when something of it is asked for, as most take others with them."""

__all__ = [
    "Advice",
    "Crafts",
    "Result",
    "SimulationError",
    "__version__",
    "advance_fleet",
    "advise",
    "build",
    "simulate",
]


def __getattr__(name: str) -> "Any":
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
