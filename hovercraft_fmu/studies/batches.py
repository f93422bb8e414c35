"""Many craft at once: motions as arrays, and the one place where their sub-steps are made."""

from collections.abc import Callable
from dataclasses import fields
from typing import Any, NamedTuple, TypeAlias, cast

import numpy as np

from ..model.craft import Craft
from ..model.dynamics import Controls, State
from ..model.integrators import INTEGRATORS, Integrate, Integrator, Stretch

Array: TypeAlias = Any
"""One number a run, shape (runs,), float64; the model's functions are annotated for one craft and take these, too."""
Mask: TypeAlias = Any
"""Shape (runs,), bool."""

FIXED = tuple(method for method in INTEGRATORS if method.integrate)
"""The methods with a fixed step."""
ADAPTIVE = next(method for method in INTEGRATORS if not method.integrate)


class Batch(NamedTuple):
    """Runs to be made: every number is an array of shape (runs,)."""

    craft: Craft
    controls: Controls
    start: State
    h: Array
    """s, the sub-step"""
    substeps: int
    """of each run"""


def mapped(batch: Batch, function: Callable[[Array], Any]) -> Batch:
    """The batch with a function applied to every array."""
    craft: Any = {field.name: function(getattr(batch.craft, field.name)) for field in fields(Craft)}
    controls, start = Controls(*map(function, batch.controls)), State(*map(function, batch.start))
    return Batch(Craft(**craft), controls, start, function(batch.h), batch.substeps)


def made(craft: Craft, controls: Controls, start: State, h: Array, substeps: int = 1) -> Batch:
    """A batch in which everything has the shape of h: plain floats serve all runs alike."""
    return mapped(Batch(craft, controls, start, h, substeps), lambda value: np.broadcast_to(value, h.shape))


def chosen(batch: Batch, which: Any) -> Batch:
    """Some of the runs: a mask, a slice, or indices."""
    return mapped(batch, lambda value: value[which])


def single(batch: Batch, i: int) -> Batch:
    """One of the runs, in plain numbers."""
    return mapped(batch, lambda value: value[i].item())


def advanced(batch: Batch, method: Integrator, state: State, n: int, refined: int = 1) -> Stretch:
    """Every craft of the batch n sub-steps after a state, each cut into so many; motions may leave the numbers."""
    with np.errstate(all="ignore"):
        integrate = cast(Integrate, method.integrate)
        return integrate(state, batch.controls, batch.craft, batch.h / refined, n * refined, np)
