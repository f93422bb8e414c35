"""A communication step is cut into sub-steps."""

import math
from typing import NamedTuple

from .craft import Craft
from .dynamics import Controls, State
from .integrators import INTEGRATORS, MIN_STEP, UNIT, Integrate, Integrator, Stretch, adaptive

MAX_SUBSTEPS = 10**9
"""Of one communication step: half an hour of computing, or a slip of the decimal point."""
PIECE = 1 << 16
"""Sub-steps after which it is seen whether the motion is still finite: what is not ends then."""


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


def rounding(largest: float, step: float, steps: float = 0.0) -> float:
    """s: what two times that mean the same may differ by, or a step from the one that is meant. The one rule for that.

    A host works a time out as start + n*step, as a whole number of nanoseconds, or as a sum. Start, product and sum
    round by half a unit of the largest number at hand each, and a step that is the difference of two such times by
    three units at most. A sum of n steps is off by n/2 units. And however large the time is, the steps are kept apart.

    Args:
        largest: s, the largest of the times at hand, the start among them, by size.
        step: s, between them.
        steps: how many steps the host may have added up.
    """
    return min((4.0 + steps) * UNIT * largest, 0.1 * step)


def meant_step(time: float, step: float, start_time: float, step_size: float) -> float:
    """s: the whole number of sub-steps that a communication step means, or else the communication step itself.

    Hosts pass differences of times, 0.009999999999999787 for 0.01. What is meant does not depend on where the time
    starts, nor do then the bits.

    Args:
        time: s, where the step begins.
        step: s, as the host has it, greater than 0.
        start_time: s, of the whole run.
        step_size: s, the sub-step.
    """
    ratio = step / step_size
    if not ratio <= MAX_SUBSTEPS + 1:
        return step
    whole = (round(ratio) or 1) * step_size
    if whole == step:
        return step
    largest = max(abs(time), abs(time + step), abs(start_time))
    return whole if abs(whole - step) <= rounding(largest, step) else step


def substeps(communication_step: float, step_size: float) -> tuple[int, float]:
    """Number and size [s] of the sub-steps that make up a communication step [s].

    Where it is a whole number of sub-steps, but for the rounding of its own, the sub-step is `step_size` itself, and
    the bits do not depend on how the time is cut. Elsewhere n equal sub-steps, none longer than `step_size`, end
    exactly on time.

    Raises:
        ValueError: a step that is negative or not finite, or would need more than 10^9 sub-steps.
    """
    check_communication_step(communication_step)
    check_step_size(step_size)
    ratio = communication_step / step_size
    if ratio > MAX_SUBSTEPS + 1:
        raise too_many_substeps(communication_step, step_size)
    whole = round(ratio) or 1
    if abs(whole * step_size - communication_step) <= rounding(communication_step, communication_step):
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
        ValueError: see `substeps`; the adaptive method needs more than 10^8 of them.
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
    stretch = _made(method, state, controls, craft, h, min(n, PIECE))
    while stretch.substeps < n:
        further = _made(method, stretch.state, controls, craft, h, min(n - stretch.substeps, PIECE))
        stability, rotation = max(stretch.stability, further.stability), max(stretch.rotation, further.rotation)
        stretch = Stretch(further.state, stretch.substeps + further.substeps, stability, rotation)
    return stretch


def _made(method: Integrate, state: State, controls: Controls, craft: Craft, h: float, n: int) -> Stretch:
    try:
        stretch = method(state, controls, craft, h, n)
    except (ValueError, OverflowError):  # what math.sin says of an infinite angle
        stretch = Stretch(State(*[math.nan] * 6), n, 0.0, 0.0)
    if not math.isfinite(sum(stretch.state)):
        _refuse_non_finite(State(*[math.nan] * 6) if math.isinf(stretch.state.heading) else stretch.state, h)
    return stretch


def _refuse_non_finite(state: State, h: float) -> None:
    for name in ("vx", "vy", "yaw_rate", "x", "y", "heading"):  # it is a velocity that runs away first
        value = getattr(state, name)
        if not math.isfinite(value):
            raise NonFiniteError(name, value, h)


def too_strong(controls: Controls, craft: Craft) -> str | None:
    """The first input without limits that no step helps, as it drives the craft too fast; None where there is none.

    A force F leads to the air speed q = sqrt(F/k), a moment to that of a force at the craft's length. Where drag there
    is faster than the shortest step, h*k*q*`drag_rate` > 1, no method follows. (Without drag k is taken as 1: there a
    step helps even less.)
    """
    k = craft.drag_factor or 1.0
    rate = MIN_STEP * craft.drag_rate * k
    speeds = {
        "wind_x": abs(controls.wind_x),
        "wind_y": abs(controls.wind_y),
        "external_force_x": math.sqrt(abs(controls.external_force_x) / k),
        "external_force_y": math.sqrt(abs(controls.external_force_y) / k),
        "external_moment": math.sqrt(abs(controls.external_moment) / craft.length / k),
    }
    return next((name for name, speed in speeds.items() if rate * speed > 1.0), None)
