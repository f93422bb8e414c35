"""Random craft, states, controls."""

from hypothesis import strategies as st

from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.dynamics import Controls, State


def numbers(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high, allow_nan=False, allow_infinity=False, allow_subnormal=False)


ANY_CRAFT = {
    "mass": numbers(1.0, 1e5),
    "inertia": numbers(1.0, 1e6),
    "length": numbers(0.5, 50.0),
    "width": numbers(0.5, 50.0),
    "height": numbers(0.5, 20.0),
    "drag_coefficient": numbers(0.0, 3.0),
    "air_density": numbers(0.0, 2.0),
    "drag_center_fraction": numbers(-0.5, 0.5),
    "steering_force": numbers(0.0, 100.0),
    "thrust_min": numbers(-100.0, 0.0),
    "thrust_max": numbers(0.0, 100.0),
}
DRAG_TERMS = {"drag_area": st.sampled_from([1, 2]), "rotational_drag": numbers(0.0, 1.0)}
crafts = st.one_of(st.builds(Craft, **ANY_CRAFT), st.builds(Craft, **ANY_CRAFT, **DRAG_TERMS))
"""Without friction, which is not a load like others."""
rubbing_crafts = st.builds(
    Craft, **ANY_CRAFT, **DRAG_TERMS, skirt_friction=numbers(1e-3, 0.5), gravity=numbers(0.0, 30.0)
)
"""With every term of a scene."""
CALM = {
    **ANY_CRAFT,
    "mass": numbers(100.0, 1e5),
    "inertia": numbers(1000.0, 1e6),
    "length": numbers(0.5, 20.0),
    "width": numbers(0.5, 20.0),
    "height": numbers(0.5, 5.0),
    "drag_coefficient": numbers(0.0, 1.5),
    "air_density": numbers(0.0, 1.3),
}
calm_crafts = st.one_of(
    st.builds(Craft, **CALM),
    st.builds(Craft, **CALM, **DRAG_TERMS, skirt_friction=st.one_of(st.just(0.0), numbers(1e-4, 1.0))),
)
"""With `states` and `controls`: k <= 98 kg/m, q <= 64 m/s, and h*k*q*(1/m + x_d^2/I) <= 0.7 at 1 ms: stable."""
states = st.builds(
    State,
    x=numbers(-1e3, 1e3),
    y=numbers(-1e3, 1e3),
    heading=numbers(-10.0, 10.0),
    vx=numbers(-20.0, 20.0),
    vy=numbers(-20.0, 20.0),
    yaw_rate=numbers(-2.0, 2.0),
)
COMMANDS = {"thrust": numbers(-200.0, 200.0), "port": numbers(-0.5, 1.5), "starboard": numbers(-0.5, 1.5)}
WIND = {"wind_x": numbers(-10.0, 10.0), "wind_y": numbers(-10.0, 10.0)}
LOAD = {
    "external_force_x": numbers(-200.0, 200.0),
    "external_force_y": numbers(-200.0, 200.0),
    "external_moment": numbers(-2000.0, 2000.0),
}
NO_WIND, NO_LOAD = dict.fromkeys(WIND, st.just(0.0)), dict.fromkeys(LOAD, st.just(0.0))
calm_controls = st.builds(Controls, **COMMANDS, **NO_WIND, **NO_LOAD)
"""In air at rest, and with no load from outside."""
controls = st.one_of(
    calm_controls,
    st.builds(Controls, **COMMANDS, **WIND, **NO_LOAD),
    st.builds(Controls, **COMMANDS, **WIND, **LOAD),
)
