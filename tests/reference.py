"""The model's page written down a second time, on purpose in another way: vectors, points and forces at points."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


def cross(a: Vector, b: Vector) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def reference_loads(
    state: tuple[float, ...], controls: tuple[float, float, float], craft: Mapping[str, float]
) -> tuple[Vector, float, float, float]:
    """World force, moment, and the sizes that rounding is measured by: of the forces and of the moments."""
    _, _, heading, vx, vy, yaw_rate = state
    ahead = np.array([np.cos(heading), np.sin(heading)])
    starboard = np.array([-np.sin(heading), np.cos(heading)])

    def at(x: float, y: float) -> Vector:
        return x * ahead + y * starboard

    area = 0.5 * (craft["length"] + craft["width"]) * craft["height"]
    fin = at(craft["drag_center_fraction"] * craft["length"], 0.0)
    air = np.array([vx, vy]) + yaw_rate * np.array([-fin[1], fin[0]])
    speed = np.sqrt(air @ air)
    drag = np.zeros(2)
    if speed > 0.0:
        drag = -0.5 * craft["air_density"] * area * craft["drag_coefficient"] * speed**2 * (air / speed)
    thrust = min(max(controls[0], craft["thrust_min"]), craft["thrust_max"]) * ahead
    port = min(max(controls[1], 0.0), 1.0) * craft["steering_force"] * starboard
    star = min(max(controls[2], 0.0), 1.0) * craft["steering_force"] * -starboard
    bow_port = at(0.5 * craft["length"], -0.5 * craft["width"])
    bow_star = at(0.5 * craft["length"], 0.5 * craft["width"])
    # every force at its point; the side force of a bow thruster has the same lever arm on either side
    moment = cross(fin, drag) + cross(bow_port, port) + cross(bow_star, star)
    force_size = float(np.linalg.norm(drag) + np.linalg.norm(thrust) + np.linalg.norm(port) + np.linalg.norm(star))
    lever = craft["length"] + craft["width"]
    return drag + thrust + port + star, moment, force_size, lever * force_size


def reference_step(
    state: tuple[float, ...], controls: tuple[float, float, float], craft: Mapping[str, float], h: float
) -> tuple[float, ...]:
    """One semi-implicit Euler step: velocity first, then the pose from the new velocity."""
    force, moment, _, _ = reference_loads(state, controls, craft)
    velocity = np.array(state[3:5]) + h * force / craft["mass"]
    position = np.array(state[:2]) + h * velocity
    yaw_rate = state[5] + h * moment / craft["inertia"]
    return (*position.tolist(), state[2] + h * yaw_rate, *velocity.tolist(), yaw_rate)
