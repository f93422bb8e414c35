"""A hovercraft as an FMU: build it, run it, drive it, draw it.

from hovercraft_fmu import simulate

result = simulate("turn", start_values={"mass": 120.0})
print(result)
result.plot().savefig("turn.png")
"""

from importlib import import_module

from ._version import __version__

TYPE_CHECKING = False  # as typing has it, which takes some time to load: a command is to be stopped from the start on
if TYPE_CHECKING:
    from typing import Any

    from .building import build
    from .building import build as build_fmu
    from .host import SimulationError
    from .host.fleet import Crafts, Fleet, advance_fleet
    from .model.craft import PRESETS, Craft
    from .scenes import SCENES, Scene
    from .simulation import Advice, Result, Run, advise, plan, simulate
    from .sweeps import load, sweep
    from .view.animation import animate
    from .view.drive import drive, plan_drive

_HOMES = {
    "PRESETS": "model.craft",
    "SCENES": "scenes",
    "Advice": "simulation",
    "Craft": "model.craft",
    "Crafts": "host.fleet",
    "Fleet": "host.fleet",
    "Result": "simulation",
    "Run": "simulation",
    "Scene": "scenes",
    "SimulationError": "host",
    "advance_fleet": "host.fleet",
    "advise": "simulation",
    "animate": "view.animation",
    "build": "building",
    "build_fmu": "building",
    "drive": "view.drive",
    "load": "sweeps",
    "plan": "simulation",
    "plan_drive": "view.drive",
    "simulate": "simulation",
    "sweep": "sweeps",
}
"""Where each name is from: a module is loaded when something of it is asked for, as most take others with them."""

__all__ = [
    "PRESETS",
    "SCENES",
    "Advice",
    "Craft",
    "Crafts",
    "Fleet",
    "Result",
    "Run",
    "Scene",
    "SimulationError",
    "__version__",
    "advance_fleet",
    "advise",
    "animate",
    "build",
    "build_fmu",
    "drive",
    "load",
    "plan",
    "plan_drive",
    "simulate",
    "sweep",
]


def __getattr__(name: str) -> "Any":
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOMES[name]}"), "build" if name == "build_fmu" else name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
