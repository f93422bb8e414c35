"""How far a craft is off: a companion is carried along with half the sub-step, and the two are compared.

An error C*h^p of a method of order p is C*(h/2)^p of its companion, so the difference is C*h^p*(1 - 2^-p), and times
2^p/(2^p - 1) the error itself (Richardson, 1911). What the two have in common it does not see: inputs that were held.
"""

import math
from typing import NamedTuple

from .craft import Craft
from .dynamics import Controls, State, friction_gains, friction_radius, slip_speed
from .integrators import NEAR_REST, Integrator, StepTooSmallError, adaptive
from .subcycling import Settings, substeps

ERROR_ESTIMATES = (
    ("off", "No estimate, and no cost"),
    ("on", "A companion with half the sub-step is carried along: three times the cost"),
)
OFF, ON = 1, 2
"""Numbers of these."""
LARGEST = 1e300
"""m, rad: the estimate where there is none, as the companion has left the range of numbers."""
TIGHTER = 32.0
"""The adaptive companion's tolerance is smaller by this: with a method of fifth order that is half the step."""
NOT_SMALL = 0.25
"""Of the way that the craft has made: an estimate above it is none."""
FEW = 20
"""Sub-steps: before so many even a small error is not small beside the way; and where friction brings a craft to rest
in less, both may stop at once and be off alike. Measured, as are the numbers above: hovercraft-fmu measure
error-estimate."""


class Companion(NamedTuple):
    """Of one craft."""

    state: State
    """NaN: it has left the range of numbers, or found no step for its tolerance; so it stays."""
    proposed: float = 0.0
    """s: the step that the adaptive method would take next"""
    way: float = 0.0
    """m, of the craft itself so far, from communication point to communication point"""
    fastest: float = 0.0
    """m/s: its largest slip speed at one of them, where it rubs"""


LOST = State(*[math.nan] * 6)


def check_error_estimate(number: int) -> None:
    """Raises ValueError unless it is the number of one of ERROR_ESTIMATES."""
    if number not in (OFF, ON):
        known = ", ".join(f"{i} ({name})" for i, (name, _) in enumerate(ERROR_ESTIMATES, 1))
        raise ValueError(f"error_estimate = {number!r}: must be one of {known}")


def accompany(
    companion: Companion, controls: Controls, craft: Craft, communication_step: float, settings: Settings
) -> Companion:
    """The companion one communication step [s] later, which the craft itself makes with these settings."""
    if math.isnan(companion.state.x):
        return companion
    try:
        if settings.integrator.integrate is None:
            state, proposed = _in_two_halves(companion, controls, craft, communication_step, settings)
        else:
            n, h = substeps(communication_step, settings.step_size)
            state, proposed = settings.integrator.integrate(companion.state, controls, craft, 0.5 * h, 2 * n).state, 0.0
    except (ValueError, OverflowError, StepTooSmallError):  # what math.sin says of an infinite angle
        state, proposed = LOST, 0.0
    return companion._replace(state=state if all(map(math.isfinite, state)) else LOST, proposed=proposed)


def watched(companion: Companion, before: State, after: State, craft: Craft) -> Companion:
    """With what the craft itself did in that step."""
    dx, dy = after.x - before.x, after.y - before.y
    way, fastest = companion.way + math.sqrt(dx * dx + dy * dy), companion.fastest
    if craft.rubs:
        fastest = max(fastest or _slip(before, craft), _slip(after, craft))
    return companion._replace(way=way, fastest=fastest)


def _slip(state: State, craft: Craft) -> float:
    return slip_speed(state.vx, state.vy, friction_radius(craft) * state.yaw_rate)


def _in_two_halves(
    companion: Companion, controls: Controls, craft: Craft, communication_step: float, settings: Settings
) -> tuple[State, float]:
    """Of the adaptive method: where its steps are as long as the communication step, its companion takes half."""
    state, proposed = companion.state, companion.proposed
    for _ in range(2):
        start = proposed or settings.step_size
        made = adaptive(state, controls, craft, 0.5 * communication_step, settings.tolerance / TIGHTER, start)
        state, proposed = made.state, made.proposed
    return state, proposed


def error_factor(method: Integrator, rubs: bool) -> float:
    """1: what the difference is to be multiplied by."""
    gain = 2.0 ** (method.rubbing_order if rubs else method.order)
    return gain / (gain - 1.0)


def estimated_error(state: State, companion: Companion, craft: Craft, method: Integrator) -> tuple[float, float]:
    """How far the position [m] and the heading [rad] are off, by now; at most LARGEST."""
    other, factor = companion.state, error_factor(method, craft.rubs)
    dx, dy = other.x - state.x, other.y - state.y
    position = factor * math.sqrt(dx * dx + dy * dy)
    heading = factor * abs(other.heading - state.heading)
    return position if position <= LARGEST else LARGEST, heading if heading <= LARGEST else LARGEST


def is_lost(position: float, state: State, companion: Companion, craft: Craft, substep: float, count: int) -> bool:
    """Whether an estimate [m] can be trusted no more, after so many sub-steps of a size [s]; 0 of the adaptive method.

    Where friction has nearly stopped a craft (it could in NEAR_REST sub-steps) that it could have stopped in FEW from
    the fastest it ever was, the companion's stop is no measure of how far that of the craft is off.
    """
    if position >= LARGEST or (count >= FEW and position > NOT_SMALL * companion.way):
        return True
    if not craft.rubs:
        return False
    gain = max(friction_gains(craft, substep))
    if not companion.fastest < FEW * gain:
        return False
    slip = _slip(state, craft)
    return slip < NEAR_REST * gain and slip < companion.fastest
