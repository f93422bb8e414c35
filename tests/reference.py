"""The model's page written down a second time, on purpose in another way: vectors, points and forces at points."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]


def cross(a: Vector, b: Vector) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


def reference_loads(
    state: tuple[float, ...], controls: tuple[float, ...], craft: Mapping[str, float]
) -> tuple[Vector, float, float, float]:
    """World force, moment, and the sizes that rounding is measured by: of the forces and of the moments.

    Without the friction between skirt and ground.
    """
    _, _, heading, vx, vy, yaw_rate = state
    ahead = np.array([np.cos(heading), np.sin(heading)])
    starboard = np.array([-np.sin(heading), np.cos(heading)])

    def at(x: float, y: float) -> Vector:
        return x * ahead + y * starboard

    pressure = 0.5 * craft["air_density"] * craft["drag_coefficient"]
    fin = at(craft["drag_center_fraction"] * craft["length"], 0.0)
    air = np.array([vx, vy]) - np.array(controls[3:5]) + yaw_rate * np.array([-fin[1], fin[0]])
    speed = np.sqrt(air @ air)
    drag = np.zeros(2)
    if speed > 0.0:
        drag = -pressure * seen_area(craft, air / speed, at) * speed**2 * (air / speed)
    thrust = min(max(controls[0], craft["thrust_min"]), craft["thrust_max"]) * ahead
    port = min(max(controls[1], 0.0), 1.0) * craft["steering_force"] * starboard
    star = min(max(controls[2], 0.0), 1.0) * craft["steering_force"] * -starboard
    bow_port = at(0.5 * craft["length"], -0.5 * craft["width"])
    bow_star = at(0.5 * craft["length"], 0.5 * craft["width"])
    # every force at its point; the side force of a bow thruster has the same lever arm on either side
    moment = cross(fin, drag) + cross(bow_port, port) + cross(bow_star, star)
    # the air on the rotating box: strips of its side, two points of Gauss a half, exact for the cube of the distance
    half = 0.5 * craft["length"]
    for point, weight in zip(*np.polynomial.legendre.leggauss(2), strict=True):
        distance = 0.5 * half * (point + 1.0)
        strip = pressure * craft["height"] * (yaw_rate * distance) * abs(yaw_rate * distance)
        moment -= craft["rotational_drag"] * 2.0 * distance * strip * 0.5 * half * weight
    outside, turn = np.array(controls[5:7]), controls[7]
    parts = drag, thrust, port, star, outside
    force_size = float(sum(np.linalg.norm(part) for part in parts))
    lever = craft["length"] + craft["width"]
    spin_size = pressure * craft["height"] * craft["length"] ** 4 * yaw_rate**2
    return sum(parts, np.zeros(2)), moment + turn, force_size, lever * force_size + spin_size + abs(turn)


def seen_area(craft: Mapping[str, float], direction: Vector, at: Callable[[float, float], Vector]) -> float:
    """m2: the shadow of the box on a wall that stands square to the air; or the mean area."""
    if craft["drag_area"] == 1:
        return 0.5 * (craft["length"] + craft["width"]) * craft["height"]
    corners = [at(a * craft["length"], b * craft["width"]) for a in (-0.5, 0.5) for b in (-0.5, 0.5)]
    across = [cross(direction, corner) for corner in corners]
    return (max(across) - min(across)) * craft["height"]


def reference_step(
    state: tuple[float, ...], controls: tuple[float, ...], craft: Mapping[str, float], h: float
) -> tuple[float, ...]:
    """One semi-implicit Euler step: velocity first, then the pose from the new velocity."""
    force, moment, _, _ = reference_loads(state, controls, craft)
    velocity = np.array(state[3:5]) + h * force / craft["mass"]
    position = np.array(state[:2]) + h * velocity
    yaw_rate = state[5] + h * moment / craft["inertia"]
    return (*position.tolist(), state[2] + h * yaw_rate, *velocity.tolist(), yaw_rate)
