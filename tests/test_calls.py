"""What the standards ask of the calls, rule by rule; in brackets the sections of FMI 2.0.5 and FMI 3.0.2."""

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from fmpy.fmi1 import FMICallException

from tests.conftest import FMI_2
from tests.exchange import get_vector, go, put_states
from tests.lowlevel import everything, get, one, put, reference, start


@pytest.fixture(scope="module")
def shared(each_native_fmu: Path) -> Iterator[tuple[Any, list[str]]]:
    """For co-simulation."""
    with one(each_native_fmu) as made:
        yield made


@pytest.fixture
def exchanged(each_native_fmu: Path) -> Iterator[Any]:
    """For model exchange."""
    with one(each_native_fmu, exchange=True) as (made, _):
        yield made


# ---- model exchange [2.0: 3.2.3; 3.0: 3.2.1, 2.3.5]


def test_a_state_is_set_as_a_variable_or_with_the_others(exchanged: Any) -> None:
    """In continuous-time mode it is the same."""
    go(exchanged, thrust=3.0)
    exchanged.setReal([reference("pose.heading"), reference("velocity.x")], [0.5, 2.0])
    assert get_vector(exchanged.getContinuousStates) == [0.0, 0.0, 0.5, 2.0, 0.0, 0.0]
    found = everything(exchanged)
    put_states(exchanged, [0.0] * 6)
    assert everything(exchanged) != found
    put_states(exchanged, [0.0, 0.0, 0.5, 2.0, 0.0, 0.0])
    assert everything(exchanged) == found


def test_a_state_is_set_as_a_variable_in_event_mode_of_fmi_3_alone(exchanged: Any, standard: int) -> None:
    start(exchanged)
    if standard == 3:
        exchanged.setReal([reference("velocity.y")], [0.25])
        assert get(exchanged, "velocity.y", "speed") == [0.25, 0.25]
    else:
        with pytest.raises(FMICallException):
            exchanged.setReal([reference("velocity.y")], [0.25])
    with pytest.raises(FMICallException):
        exchanged.setReal([reference("speed")], [0.25])


def test_the_time_is_not_set_before_the_start(exchanged: Any) -> None:
    """[2.0: 3.2.1; 3.0: 3.2.1]"""
    start(exchanged, 5.0)
    exchanged.setTime(5.0)
    with pytest.raises(FMICallException):
        exchanged.setTime(4.9)


# ---- linearization in step mode [2.0: 2.1.9; 3.0: 2.2.12]


def slope(instance: Any) -> float:
    """Of the acceleration over the thrust."""
    return float(instance.getDirectionalDerivative([reference("acceleration.x")], [reference("thrust")], [1.0])[0])


def test_a_controller_sets_linearizes_and_steps(instance: Any) -> None:
    """At the communication point with the inputs and the parameters that are set there: thrust over its limit has no
    effect any more, at once.
    """
    start(instance)
    instance.doStep(0.0, 0.1)
    assert slope(instance) == 0.01
    put(instance, thrust=99.0)
    assert slope(instance) == 0.0
    put(instance, thrust_max=100.0)
    assert slope(instance) == 0.01
    instance.doStep(0.1, 0.1)
    assert slope(instance) == 0.01


# ---- derivatives of inputs and outputs [2.0: 4.2.1]


@FMI_2
def test_the_order_of_an_input_and_its_derivative_does_not_matter(instance: Any) -> None:
    ends = []
    for value_first in (True, False):
        instance.reset()
        start(instance)
        instance.doStep(0.0, 0.5)
        calls: list[Callable[[], object]] = [
            lambda: put(instance, thrust=1.0),
            lambda: instance.setRealInputDerivatives([reference("thrust")], [1], [2.0]),
        ]
        for call in calls if value_first else calls[::-1]:
            call()
        instance.doStep(0.5, 1.0)
        ends.append(everything(instance))
        assert get(instance, "applied.thrust") == [3.0]
    assert ends[0] == ends[1]


@FMI_2
def test_a_ramp_does_not_change_what_the_input_reads_back(instance: Any) -> None:
    start(instance)
    put(instance, thrust=1.0)
    instance.setRealInputDerivatives([reference("thrust")], [1], [2.0])
    instance.doStep(0.0, 1.0)
    assert get(instance, "thrust") == [1.0]


@FMI_2
def test_derivatives_of_a_higher_order_are_0(instance: Any) -> None:
    start(instance)
    put(instance, thrust=1.0)
    thrust = reference("thrust")
    instance.setRealInputDerivatives([thrust, thrust, thrust], [1, 2, 3], [2.0, 0.0, -0.0])
    instance.doStep(0.0, 1.0)
    assert get(instance, "applied.thrust") == [3.0]
    with pytest.raises(FMICallException):
        instance.setRealInputDerivatives([thrust], [2], [1.0])
    found = instance.getRealOutputDerivatives([reference("velocity.x")] * 3, [1, 2, 7])
    assert found[0] > 0.0
    assert [math.copysign(1.0, value) * value for value in found[1:]] == [0.0, 0.0]
