"""Sweeps: many runs of one FMU, from a study file to Parquet."""

try:
    from .runner import Outcome, sweep
    from .store import load
    from .study import STUDIES, Study, read_study
except ModuleNotFoundError as error:
    raise ModuleNotFoundError(
        f"sweeps need {error.name}, which is not installed: pip install 'hovercraft-fmu[sweep]'"
    ) from error

__all__ = ["STUDIES", "Outcome", "Study", "load", "read_study", "sweep"]
