"""A communication step is cut into sub-steps."""

import math
from typing import NamedTuple

from .craft import Craft
from .dynamics import Controls, State
from .integrators import INTEGRATORS, Integrator, Stretch, adaptive

MAX_SUBSTEPS = 10**9
"""Of one communication step: half an hour of computing, or a slip of the decimal point."""
WHOLE = 1e-9
"""Relative: a communication step this close to a whole number of sub-steps is that number of sub-steps."""


class Settings(NamedTuple):
    """How the time is cut and the state carried over it."""

    step_size: float = 0.001
    """s, the sub-step; the first one of the adaptive method"""
    integrator: Integrator = INTEGRATORS[0]
    tolerance: float = 1e-6
    """SI units: of the largest component of the error of a step, for the adaptive method"""


class NonFiniteError(ArithmeticError):
    """A step that led to NaN or infinity; the state before it still stands."""

    def __init__(self, component: str, value: float, substep: float) -> None:
        self.component = component
        self.value = value
        self.substep = substep
        super().__init__(
            f"{component} = {value!r} after sub-steps of {substep!r} s: must stay a finite number; "
            "the motion is too fast for this sub-step: set a smaller step_size"
        )


def check_step_size(step_size: float) -> None:
    """Raises ValueError unless the sub-step is a positive finite number."""
    if not 0.0 < step_size < math.inf:
        raise ValueError(f"step_size = {step_size!r} s: must be a finite number greater than 0")


def check_tolerance(tolerance: float) -> None:
    """Raises ValueError unless the tolerance is a positive finite number."""
    if not 0.0 < tolerance < math.inf:
        raise ValueError(f"tolerance = {tolerance!r}: must be a finite number greater than 0")


def check_communication_step(communication_step: float) -> None:
    """Raises ValueError where the step is negative or not finite."""
    if not 0.0 <= communication_step < math.inf:
        raise ValueError(f"communication step = {communication_step!r} s: must be a finite number, not negative")


def substeps(communication_step: float, step_size: float) -> tuple[int, float]:
    """Number and size [s] of the sub-steps that make up a communication step [s].

    Hosts add up time in floating point and pass 0.009999999999999787 for 0.01. Where the communication step is that
    close to a whole number of sub-steps, the sub-step is `step_size` itself, and the bits do not depend on how the
    host cuts the time. Elsewhere n equal sub-steps, none longer than `step_size`, end exactly on time.

    Raises:
        ValueError: a step that is negative or not finite, or would need more than 10^9 sub-steps.
    """
    check_communication_step(communication_step)
    check_step_size(step_size)
    ratio = communication_step / step_size
    if ratio > MAX_SUBSTEPS + 1:
        raise too_many_substeps(communication_step, step_size)
    whole = round(ratio) or 1
    if abs(whole * step_size - communication_step) <= WHOLE * communication_step:
        n, h = whole, step_size
    else:
        n = math.ceil(ratio) or 1
        h = communication_step / n
    if n > MAX_SUBSTEPS:
        raise too_many_substeps(communication_step, step_size)
    return n, h


def too_many_substeps(communication_step: float, step_size: float) -> ValueError:
    """What is raised then."""
    return ValueError(
        f"communication step = {communication_step!r} s: must not need more than 10^9 sub-steps of "
        f"step_size = {step_size!r} s"
    )


def advance(
    state: State,
    controls: Controls,
    craft: Craft,
    communication_step: float,
    settings: Settings = Settings(),  # noqa: B008 - immutable
    proposed: float = 0.0,
) -> Stretch:
    """The state one communication step [s] later, with the controls held, and how it got there.

    A step of 0 changes no bit. `proposed` is what the last step of the adaptive method returned; 0 at the start.

    Raises:
        ValueError: see `substeps`.
        NonFiniteError: the motion left the range of numbers.
        StepTooSmallError: the adaptive method cannot meet its tolerance.
    """
    if communication_step == 0.0:
        return Stretch(state, 0, 0.0, 0.0, proposed)
    method = settings.integrator.integrate
    if method is None:
        check_communication_step(communication_step)
        return adaptive(state, controls, craft, communication_step, settings.tolerance, proposed or settings.step_size)
    n, h = substeps(communication_step, settings.step_size)
    try:
        stretch = method(state, controls, craft, h, n)
    except (ValueError, OverflowError):  # what math.sin says of an infinite angle
        stretch = Stretch(State(*[math.nan] * 6), n, 0.0, 0.0)
    if not math.isfinite(sum(stretch.state)):
        _refuse_non_finite(stretch.state, h)
    return stretch


def _refuse_non_finite(state: State, h: float) -> None:
    for name in ("vx", "vy", "yaw_rate", "x", "y", "heading"):  # it is a velocity that runs away first
        value = getattr(state, name)
        if not math.isfinite(value):
            raise NonFiniteError(name, value, h)
