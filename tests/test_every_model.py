"""The life cycle of every native model but the hovercraft, whose is in test_lifecycle.py: the room is the same."""

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from fmpy.fmi1 import FMICallException

from hovercraft_fmu.autopilot.pilot_native import AUTOPILOT_NATIVE, AUTOPILOT_NATIVE3
from hovercraft_fmu.fmu.description import Flavour
from hovercraft_fmu.fmu.variable import Model
from hovercraft_fmu.tether.tether_native import TETHER_NATIVE3
from tests.lowlevel import another, one, with_any_other_word
from tests.test_native_platforms import inputs_of, wandering

FLAVOURS = (AUTOPILOT_NATIVE, AUTOPILOT_NATIVE3, TETHER_NATIVE3)
Rows = list[tuple[float, ...]]


@pytest.fixture(scope="module", params=FLAVOURS, ids=lambda flavour: flavour.identifier)
def flavour(request: pytest.FixtureRequest) -> Flavour:
    made: Flavour = request.param
    return made


@pytest.fixture
def model(flavour: Flavour) -> Model:
    return flavour.model


@pytest.fixture(scope="module")
def shared(flavour: Flavour, here: Callable[[Flavour], Path]) -> Iterator[tuple[Any, list[str]]]:
    with one(here(flavour)) as made:
        yield made


def start(instance: Any, time: float = 0.0) -> None:
    instance.setupExperiment(startTime=time, stopTime=time + 1e6)
    instance.enterInitializationMode()
    instance.exitInitializationMode()


def driven(instance: Any, model: Model, rows: Rows, time: float = 0.0) -> list[list[float]]:
    """All Reals after each row."""
    seen = []
    reals = [v.reference for v in model.variables if v.kind == "Real"]
    for point, step, *inputs in rows:
        instance.setReal(inputs_of(model), inputs)
        instance.doStep(time + point, step)
        seen.append(list(instance.getReal(reals)))
    return seen


def saved(instance: Any) -> bytes:
    return bytes(instance.serializeFMUstate(instance.getFMUstate()))


def test_a_run_that_is_rolled_back_repeats_to_the_bit(instance: Any, model: Model) -> None:
    """By a state, by its bytes, after a reset, and in an instance that has not begun."""
    rows = wandering(model)
    start(instance)
    driven(instance, model, rows[:50])
    state, content = instance.getFMUstate(), saved(instance)
    expected = driven(instance, model, rows[50:100])
    assert len({tuple(row) for row in expected}) == 50
    instance.setFMUstate(state)
    assert driven(instance, model, rows[50:100]) == expected
    instance.reset()
    other = another(instance)
    for each in (instance, other):
        each.setFMUstate(each.deSerializeFMUstate(content))
        assert driven(each, model, rows[50:100]) == expected
    other.fmi2FreeInstance(other.component) if hasattr(other, "component") else other.freeInstance()


def test_a_reset_instance_is_a_new_one(instance: Any, model: Model) -> None:
    new = saved(instance)
    start(instance)
    expected = driven(instance, model, wandering(model)[:20])
    instance.reset()
    assert saved(instance) == new
    start(instance)
    assert driven(instance, model, wandering(model)[:20]) == expected


def test_another_start_time_changes_no_bit(instance: Any, model: Model) -> None:
    rows = [(k * 0.5, 0.5, *inputs) for k, (_, _, *inputs) in enumerate(wandering(model)[:40])]
    ends = []
    for time in (0.0, -5.0, 86_400.0):
        instance.reset()
        start(instance, time)
        ends.append(driven(instance, model, rows, time))
    assert ends == [ends[0]] * 3


CALLS: dict[str, tuple[Callable[[Any], object], str]] = {
    "input nan": (lambda i: i.setReal([1], [math.nan]), " = nan: must be a finite number"),
    "one bad of two": (lambda i: i.setReal([0, 1], [3.0, math.inf]), " = inf: must be a finite number"),
    "no such variable": (lambda i: i.getReal([999]), "value reference 999: must be that of a variable of type "),
    "point behind": (lambda i: i.doStep(0.0, 0.5), "currentCommunicationPoint = 0.0 s: must be where the last step"),
    "point nan": (lambda i: i.doStep(math.nan, 0.5), "currentCommunicationPoint = nan s: must be where the last step"),
    "step zero": (lambda i: i.doStep(0.5, 0.0), "communicationStepSize = 0.0 s: must be a finite number greater than"),
    "step back": (lambda i: i.doStep(0.5, -0.5), "communicationStepSize = -0.5 s: must be a finite number greater"),
    "past the end": (lambda i: i.doStep(0.5, 1e7), "must not lead past stopTime"),
    "begun twice": (lambda i: i.enterInitializationMode(), "EnterInitializationMode in state 'step mode'"),
    "half a state": (lambda i: i.deSerializeFMUstate(saved(i)[:-1]), "must be complete and unchanged"),
    "a changed state": (lambda i: i.deSerializeFMUstate(saved(i)[:-9] + bytes(9)), "must be complete and unchanged"),
}


@pytest.mark.parametrize("name", CALLS)
def test_a_refused_call_says_why_and_changes_nothing(
    name: str, instance: Any, messages: list[str], model: Model
) -> None:
    call, words = CALLS[name]
    rows = [(k * 0.5, 0.5, *inputs) for k, (_, _, *inputs) in enumerate(wandering(model)[:3])]
    start(instance)
    driven(instance, model, rows[:1])
    before = saved(instance)
    for times in (1, 2):
        with pytest.raises(FMICallException):
            call(instance)
        assert len(messages) == times
        assert words in messages[-1]
        assert saved(instance) == before
    driven(instance, model, rows[1:])


def test_a_list_reads_as_one_value_after_the_other(instance: Any, flavour: Flavour, model: Model) -> None:
    """Of each type, in either order, and where one stands in it twice."""
    start(instance)
    integers = "getInteger" if flavour.fmi == 2 else "getInt32"
    getters = {"Real": "getReal", "Integer": integers, "Boolean": "getBoolean"}
    for kind, getter in getters.items():
        references = [v.reference for v in model.variables if v.kind == kind]
        get = getattr(instance, getter)
        one_by_one = [get([each])[0] for each in references]
        assert list(get(references)) == one_by_one
        assert list(get([*references[::-1], *references])) == one_by_one[::-1] + one_by_one


@pytest.mark.parametrize("flavour", FLAVOURS[:2], indirect=True, ids=lambda flavour: flavour.identifier)
def test_a_boolean_that_is_asked_for_twice_is_told_twice(instance: Any, flavour: Flavour, model: Model) -> None:
    count, x, y, arrived = (
        [model.by_name[name].reference] for name in ("waypoint_count", "waypoint[1].x", "waypoint[1].y", "arrived")
    )
    getattr(instance, "setInteger" if flavour.fmi == 2 else "setInt32")(count, [1])
    instance.setReal(x + y, [0.0, 0.0])
    start(instance)
    instance.doStep(0.0, 0.5)
    assert list(instance.getBoolean(arrived * 2)) == [True, True]


def test_what_the_model_works_out_is_refused_by_name_and_value(
    instance: Any, messages: list[str], flavour: Flavour, model: Model
) -> None:
    start(instance)
    integers = "setInteger" if flavour.fmi == 2 else "setInt32"
    values = {"Real": ("setReal", 1.5), "Integer": (integers, 3), "Boolean": ("setBoolean", True)}
    refused = [v for v in model.variables if v.kind in values and v.causality not in ("input", "parameter")]
    for variable in refused:
        setter, value = values[variable.kind]
        with pytest.raises(FMICallException):
            getattr(instance, setter)([variable.reference], [value])
        assert messages[-1].startswith(f"{variable.name} = {value!r}: must not be set in state 'step mode' (")
    assert len(messages) == len(refused) > 2


@pytest.mark.parametrize("phase", ["before", "after"])
def test_there_is_no_step_before_the_start_and_after_the_end(phase: str, instance: Any, messages: list[str]) -> None:
    if phase == "after":
        start(instance)
        instance.terminate()
    with pytest.raises(FMICallException):
        instance.doStep(0.0, 0.5)
    assert f"DoStep in state '{'instantiated' if phase == 'before' else 'terminated'}': must be" in messages[-1]


def test_a_state_with_any_other_word_is_refused_or_is_what_it_says(instance: Any) -> None:
    """Signed anew: whoever can do that may write numbers that cannot be. What is taken is written as it was taken."""
    start(instance)
    with_any_other_word(instance)
