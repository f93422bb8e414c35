"""How many runs are in a chunk: some seconds of work, counted and not timed.

So the chunks of a study are the same on every machine, whoever makes which of them, and whenever.
"""

from collections.abc import Iterator
from itertools import product
from statistics import fmean
from typing import NamedTuple

import numpy as np

from ..model.error_estimate import ON
from ..model.subcycling import Settings
from ..simulation.cost import counted
from .engines import SETTINGS, Plan, settings_of
from .sampling import Sampling
from .timeline import merged

SECONDS = 2.5
"""Of work in a chunk, by the costs below: one to five where a processor, or a craft, takes half or twice of them."""
MOST_BYTES = 60e6
"""That a process holds for a chunk, beside the 80 MB that a worker is, or 170 MB where it starts the sweep, too."""
BYTES, BYTES_READ, BYTES_KEPT = 600, 17, 50
"""Of a run: its craft and row; of each value that is read, and of each one of a trajectory, with the file of them."""
SHARE = 12
"""Values of a swept setting that are looked at, evenly chosen."""


class Costs(NamedTuple):
    """ns, of a run on one core. Measured, as they have to be known within a factor of two only."""

    run: float
    """Its start and its row."""
    leg: float
    """A stretch with the same controls, or to a point that is kept."""
    ramp: float
    """What is added where they change along it."""
    load: float
    """An evaluation of the loads; see `counted`."""
    single: float
    """The same of the methods in ALONE."""


ALONE = ("drag_implicit", "splitting", "adaptive")
"""Methods that step craft by craft where others step some at once, or that call functions between."""
BATCH_COSTS = Costs(1.5e3, 350.0, 0.0, 7.0, 45.0)
NATIVE_COSTS = Costs(30e3, 2.5e3, 7e3, 35.0, 50.0)
PYTHON_COSTS = Costs(400e3, 35e3, 0.0, 1000.0, 2500.0)
ADAPTIVE = 2.0
"""Steps of the adaptive method a leg, as it is with the tolerance that it has by itself."""
SECOND = 3.0
"""With the estimate of the error a second craft goes beside the first in half the sub-step."""


def chunk_size(plan: Plan, sampling: Sampling, costs: Costs, least: int) -> int:
    """Runs in a chunk of a study; `least` chunks, or more, so that there is work for some workers."""
    by_time = SECONDS / mean_seconds(plan, sampling, costs)
    by_memory = MOST_BYTES / _bytes(plan)
    return max(1, int(min(by_time, by_memory, -(-sampling.runs // least))))


def mean_seconds(plan: Plan, sampling: Sampling, costs: Costs) -> float:
    """Of a run of the study."""
    return fmean(seconds(plan, settings, costs) for settings in _settings(plan, sampling))


def _settings(plan: Plan, sampling: Sampling) -> Iterator[Settings]:
    """The ones that are swept, evenly; of what changes nothing here one value."""
    parts = (np.arange(SHARE) + 0.5) / SHARE
    values = {name: [plan.run.value(name)] for name in SETTINGS}
    for factor in sampling.factors:
        if factor.name in ("step_size", "integrator"):
            values[factor.name] = [value for value in factor.at(parts).tolist() if value > 0] or values[factor.name]
    for chosen in product(*values.values()):
        yield settings_of(dict(zip(values, chosen, strict=True)))


def seconds(plan: Plan, settings: Settings, costs: Costs) -> float:
    """Of a run."""
    legs = merged(plan.timeline.legs, plan.run.start_time, settings)
    method = settings.integrator
    substeps = (plan.run.stop_time - plan.run.start_time) / settings.step_size
    loads = counted(method, substeps if method.integrate else ADAPTIVE * len(legs))
    if plan.run.value("error_estimate") == ON:
        loads *= SECOND
    ramps = sum(leg.first != leg.last for leg in legs)
    load = costs.single if method.name in ALONE else costs.load
    return 1e-9 * (costs.run + costs.leg * len(legs) + costs.ramp * ramps + load * loads)


def _bytes(plan: Plan) -> float:
    """Of a run."""
    read = len(plan.timeline.times) * len(plan.keep.read)
    kept = int(np.count_nonzero(plan.timeline.sampled)) * len(plan.keep.trajectory)
    return BYTES + BYTES_READ * read + BYTES_KEPT * kept
