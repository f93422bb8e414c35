"""A run on the bare model."""

import numpy as np

from ..fmu.interface import ACTION, INPUTS, MOTION, STATES, SUBSTEPS_MAX, WATCHED
from ..host.ramps import parts
from ..model.dynamics import Controls
from ..model.observation import observe_action, observe_motion
from ..model.subcycling import advance, meant_step
from .planning import Run
from .points import Piece, ends
from .recording import recorded
from .result import Result

NAMES = (*INPUTS, *STATES, *MOTION, *ACTION, *WATCHED)


def run_model(run: Run) -> Result:
    """Run on the bare model, with the steps and the inputs that the Python FMU is given.

    Raises:
        ValueError, NonFiniteError: as the model does.
    """
    bare = _Bare(run)
    columns = [*((name, np.float64) for name in NAMES), ("substeps", np.int32)]
    return recorded(run, columns, bare.go, bare.see)


class _Bare:
    """The model on its way."""

    def __init__(self, run: Run) -> None:
        self._craft, self._settings, self._state = run.craft, run.settings, run.start
        self._controls, self._start_time = ends(run)[0], run.start_time
        self._count, self._stability, self._rotation, self._proposed = 0, 0.0, 0.0, 0.0

    def go(self, piece: Piece) -> None:
        for begin, until, middle in parts(*piece[:4]):
            self._controls = Controls(*middle)
            self._advance(meant_step(begin, until - begin, self._start_time, self._settings.step_size))

    def _advance(self, step: float) -> None:
        stretch = advance(self._state, self._controls, self._craft, step, self._settings, proposed=self._proposed)
        self._state, self._proposed = stretch.state, stretch.proposed
        self._stability = max(self._stability, stretch.stability)
        self._rotation = max(self._rotation, stretch.rotation)
        self._count = min(self._count + stretch.substeps, SUBSTEPS_MAX)

    def see(self) -> tuple[float, ...]:
        seen = (*observe_motion(self._state), *observe_action(self._state, self._controls, self._craft))
        return *self._controls, *self._state, *seen, self._stability, self._rotation, self._count
