"""The communication points of a run, and the inputs there, as fmpy's master has them."""

from collections.abc import Iterator
from math import isclose

import fmpy
import fmpy.simulation
import fmpy.util
import numpy as np

from ..fmu.interface import INPUTS
from ..model.dynamics import Controls
from .planning import Run


def controls_at(run: Run, time: float, after_event: bool) -> Controls:
    """The inputs at a time [s], as fmpy's master interpolates them; at a jump, those before it or after it."""
    times = run.signals["time"]
    table = np.stack([run.signals[name] for name in INPUTS])
    values, _ = fmpy.simulation.Input.interpolate(time, times, table, after_event=after_event)
    return Controls(*(float(value) for value in np.ravel(values)))


def schedule(run: Run) -> Iterator[tuple[float, float, Controls]]:
    """(start, end) [s] of every communication step, and the controls that hold in it, as fmpy's master sets them."""
    for time, end in communication_points(run):
        yield time, end, controls_at(run, time, after_event=True)


def communication_points(run: Run) -> Iterator[tuple[float, float]]:
    """(start, end) [s] of every communication step, as fmpy's master takes them: a jump in the inputs is one, too."""
    times = run.signals["time"]
    jumps = times[np.flatnonzero(np.diff(times) == 0.0)]
    time, regular = run.start_time, 0
    while not (time > run.stop_time or isclose(time, run.stop_time)):
        next_regular = run.start_time + (regular + 1) * run.communication_step
        ahead = [float(jump) for jump in jumps if jump > time and not isclose(jump, time)]
        end = next_regular
        if ahead and end > ahead[0] and not isclose(end, ahead[0]):
            end = ahead[0]
        if end > run.stop_time and not isclose(end, run.stop_time):
            end = run.stop_time
        yield time, end
        time = end
        regular += isclose(time, next_regular)
