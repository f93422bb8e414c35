"""What is seen of a craft beside its state: pure functions."""

import math

from .craft import Craft
from .dynamics import Controls, State, actuation, body_velocity, loads


def observe_motion(state: State) -> tuple[float, float, float]:
    """The calculated variables that follow from the state alone: surge, sway, speed [m/s]."""
    surge, sway = body_velocity(state)
    return surge, sway, math.sqrt(state.vx * state.vx + state.vy * state.vy)


def observe_action(state: State, controls: Controls, craft: Craft) -> tuple[float, ...]:
    """What acts on the craft at a state, with the controls of the step that led to it:

    force [N] and moment [N.m], world frame, acceleration [m/s2, rad/s2], thrust and side force that are applied [N].
    """
    force_x, force_y, moment = loads(state, controls, craft)
    acceleration = (force_x / craft.mass, force_y / craft.mass, moment / craft.inertia)
    return force_x, force_y, moment, *acceleration, *actuation(controls, craft)[:2]
