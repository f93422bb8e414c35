"""Random craft, states, controls."""

from hypothesis import strategies as st

from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.dynamics import Controls, State


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False, allow_infinity=False, allow_subnormal=False)


crafts = st.builds(
    Craft,
    mass=numbers(1.0, 1e5),
    inertia=numbers(1.0, 1e6),
    length=numbers(0.5, 50.0),
    width=numbers(0.5, 50.0),
    height=numbers(0.5, 20.0),
    drag_coefficient=numbers(0.0, 3.0),
    air_density=numbers(0.0, 2.0),
    drag_center_fraction=numbers(-0.5, 0.5),
    steering_force=numbers(0.0, 100.0),
    thrust_min=numbers(-100.0, 0.0),
    thrust_max=numbers(0.0, 100.0),
)
calm_crafts = st.builds(
    Craft,
    mass=numbers(100.0, 1e5),
    inertia=numbers(1000.0, 1e6),
    length=numbers(0.5, 20.0),
    width=numbers(0.5, 20.0),
    height=numbers(0.5, 5.0),
    drag_coefficient=numbers(0.0, 1.5),
    air_density=numbers(0.0, 1.3),
    drag_center_fraction=numbers(-0.5, 0.5),
    steering_force=numbers(0.0, 100.0),
    thrust_min=numbers(-100.0, 0.0),
    thrust_max=numbers(0.0, 100.0),
)
"""With `states`: k <= 98 kg/m, q <= 49 m/s, and h*k*q*(1/m + x_d^2/I) <= 0.53 at 1 ms: stable."""
states = st.builds(
    State,
    x=numbers(-1e3, 1e3),
    y=numbers(-1e3, 1e3),
    heading=numbers(-10.0, 10.0),
    vx=numbers(-20.0, 20.0),
    vy=numbers(-20.0, 20.0),
    yaw_rate=numbers(-2.0, 2.0),
)
controls = st.builds(Controls, thrust=numbers(-200.0, 200.0), port=numbers(-0.5, 1.5), starboard=numbers(-0.5, 1.5))
