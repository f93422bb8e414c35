"""Sweeps: many runs of one FMU, from a study file to Parquet."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .forecast import Estimate, estimate
    from .reading import load
    from .runner import Outcome, sweep
    from .study import STUDIES, Study, read_study

_HOMES = {
    "STUDIES": "study",
    "Estimate": "forecast",
    "Outcome": "runner",
    "Study": "study",
    "estimate": "forecast",
    "load": "reading",
    "read_study": "study",
    "sweep": "runner",
}
"""Where each name is from: a worker needs less than the one who starts it."""

__all__ = ["STUDIES", "Estimate", "Outcome", "Study", "estimate", "load", "read_study", "sweep"]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        return getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"sweeps need {error.name}, which is not installed: "
            "pip install 'hovercraft-fmu[sweep]', in a checkout '.[sweep]'"
        ) from error
