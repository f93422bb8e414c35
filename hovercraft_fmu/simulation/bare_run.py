"""A run on the bare model."""

import numpy as np

from ..fmu.interface import ACTION, INPUTS, MOTION, STATES, SUBSTEPS_MAX, WATCHED
from ..model.observation import observe_action, observe_motion
from ..model.subcycling import advance, meant_step
from .planning import Run
from .points import controls_at, schedule
from .result import Result


def run_model(run: Run) -> Result:
    """Run on the bare model, with the communication points and the inputs that fmpy would give the FMU.

    Raises:
        ValueError, NonFiniteError: as the model does.
    """
    craft, settings, state = run.craft, run.settings, run.start
    controls = controls_at(run, run.start_time, after_event=False)
    count, stability, rotation, proposed = 0, 0.0, 0.0, 0.0

    def row(time: float) -> tuple[float, ...]:
        seen = (*observe_motion(state), *observe_action(state, controls, craft))
        return time, *controls, *state, *seen, stability, rotation, count

    rows = [row(run.start_time)]
    for time, end, controls in schedule(run):
        step = meant_step(time, end - time, run.start_time, settings.step_size)
        stretch = advance(state, controls, craft, step, settings, proposed=proposed)
        state, proposed = stretch.state, stretch.proposed
        stability = max(stability, stretch.stability)
        rotation = max(rotation, stretch.rotation)
        count = min(count + stretch.substeps, SUBSTEPS_MAX)
        rows.append(row(end))
    names = ("time", *INPUTS, *STATES, *MOTION, *ACTION, *WATCHED)
    return Result(np.array(rows, dtype=[*((name, np.float64) for name in names), ("substeps", np.int32)]), run)
