"""Model exchange of the native FMU, as the tests of it share: phases, states, all that is known and unknown."""

from collections.abc import Callable
from ctypes import c_double
from dataclasses import fields
from typing import Any

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray

from hovercraft_fmu.fmu.interface import BY_NAME, DERIVATIVES, INPUTS, MOTION, STATES
from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.dynamics import Controls, State
from tests.lowlevel import reference, start
from tests.strategies import numbers

UNKNOWNS = (*STATES, *MOTION, *DERIVATIVES[3:])
KNOWNS = (*STATES, *INPUTS)
PARAMETERS = tuple(field.name for field in fields(Craft) if BY_NAME[field.name].kind == "Real")
INITIAL_UNKNOWNS = (*MOTION, *DERIVATIVES[3:], "projected_area")
INITIAL_KNOWNS = (*KNOWNS, *PARAMETERS)


def go(instance: Any, **values: float) -> None:
    """To continuous-time mode."""
    start(instance, **values)
    assert instance.newDiscreteStates() == (False, False, False, False, False, 0.0)
    instance.enterContinuousTimeMode()


def put_states(instance: Any, values: Any) -> None:
    instance.setContinuousStates((c_double * len(values))(*values), len(values))


def get_vector(call: Callable[[Any, int], object], n: int = 6) -> list[float]:
    values = (c_double * n)()
    call(values, n)
    return list(values)


def put_craft(instance: Any, craft: Craft) -> None:
    for field in fields(Craft):
        setter = instance.setReal if BY_NAME[field.name].kind == "Real" else instance.setInteger
        setter([reference(field.name)], [getattr(craft, field.name)])


def put_all(instance: Any, craft: Craft, state: State, held: Controls) -> None:
    """Anew, in continuous-time mode."""
    instance.reset()
    put_craft(instance, craft)
    go(instance)
    put_states(instance, state)
    instance.setReal([reference(name) for name in INPUTS], list(held))


def jacobian(
    instance: Any, unknowns: tuple[str, ...] = UNKNOWNS, knowns: tuple[str, ...] = KNOWNS
) -> NDArray[np.float64]:
    rows = [reference(name) for name in unknowns]
    return np.array([instance.getDirectionalDerivative(rows, [reference(name)], [1.0]) for name in knowns]).T


def to_phase(instance: Any, phase: str) -> None:
    """Anew, to one of `EVERYWHERE`."""
    instance.reset()
    if phase == "instantiated":
        return
    instance.setupExperiment()
    instance.enterInitializationMode()
    if phase == "initialization mode":
        return
    instance.exitInitializationMode()
    if phase == "continuous-time mode":
        instance.enterContinuousTimeMode()
    elif phase == "terminated":
        instance.terminate()


EVERYWHERE = ("instantiated", "initialization mode", "event mode", "continuous-time mode", "terminated")
MOST = {"x": 1e3, "y": 1e3, "heading": 10.0, "vx": 20.0, "vy": 20.0, "yaw_rate": 2.0}
ROUNDED = {name: numbers(-most, most).map(lambda x: round(x, 6)) for name, most in MOST.items()}
rounded_states = st.builds(State, **ROUNDED)
"""Nowhere nearer to a kink than that, unless on it."""
rounded_controls = st.builds(
    Controls,
    numbers(-200.0, 200.0).map(lambda x: round(x, 6)),
    *[st.one_of(st.sampled_from([0.0, 1.0]), numbers(-0.5, 1.5).map(lambda x: round(x, 6)))] * 2,
    *[st.one_of(st.just(0.0), numbers(-10.0, 10.0).map(lambda x: round(x, 6)))] * 5,
)
