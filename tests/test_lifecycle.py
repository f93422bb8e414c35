"""The FMU in anybody's hands: life cycle, state, faults, many at once, odd steps."""

import itertools
import math
import random
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from hypothesis import given, settings
from hypothesis import strategies as st

from hovercraft_fmu.fmu.description import NATIVE
from hovercraft_fmu.fmu.interface import (
    COUNTER_STOPPED,
    INPUT_HELD,
    INPUTS,
    MOTION,
    STATES,
    STEP_TURNS,
    STEP_UNSTABLE,
    SUBSTEPS_MAX,
    VARIABLES,
)
from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.dynamics import Controls, State
from hovercraft_fmu.model.integrators import integrator_number
from hovercraft_fmu.model.observation import observe_action, observe_motion
from hovercraft_fmu.model.subcycling import Settings, advance, rounding
from hovercraft_fmu.scenes import SCENES
from tests.blobs import with_build, with_substeps
from tests.conftest import ROOT, Fresh
from tests.lowlevel import (
    CONTINUOUS,
    another,
    count,
    everything,
    get,
    kept,
    one,
    put,
    reference,
    start,
    status_of_refusal,
    worded,
)
from tests.strategies import numbers

HELD = 1e-9  # what a host's interpolation may round by, as documented


@pytest.fixture(scope="module")
def shared(each_fmu: Path) -> Iterator[tuple[Any, list[str]]]:
    """One instance of each flavour for tests that reset it first."""
    with one(each_fmu) as made:
        yield made


@pytest.fixture(scope="module")
def pair(fmu: Path, each_native_fmu: Path) -> Iterator[list[tuple[Any, list[str]]]]:
    """An instance of the Python FMU and one of a native one."""
    with one(fmu) as python, one(each_native_fmu) as native:
        yield [python, native]


@pytest.fixture
def both(pair: list[tuple[Any, list[str]]]) -> list[tuple[Any, list[str]]]:
    """The `pair`, with what they say, as if they were new."""
    for instance, messages in pair:
        instance.reset()
        messages.clear()
    return pair


def assert_same(instance: Any, found: list[float], expected: list[float]) -> None:
    """Bit by bit; the native FMU brings its own sine and cosine, whose last bits may be others."""
    if instance.modelIdentifier.startswith(NATIVE.identifier):
        assert found == pytest.approx(expected, rel=1e-12, abs=1e-12)
    else:
        assert found == expected


# ---- faults: loud, and nothing is lost


def _tuned_to_the_impossible(instance: Any) -> None:
    put(instance, thrust_min=20.0)
    instance.doStep(0.1, 0.1)


def _tuned_out_of_range(instance: Any) -> None:
    put(instance, air_density=1e305)
    instance.doStep(0.1, 0.1)


def _thrown_out_of_range(instance: Any) -> None:
    put(instance, air_density=1e300)
    instance.doStep(0.1, 0.1)


FAULTS: dict[str, tuple[Callable[[Any], object], str]] = {
    "input nan": (lambda i: put(i, thrust=math.nan), "thrust = nan: must be a finite number"),
    "input inf": (lambda i: put(i, port_thruster=-math.inf), "port_thruster = -inf: must be a finite number"),
    "one bad of three": (
        lambda i: put(i, thrust=1.0, port_thruster=1.0, starboard_thruster=math.nan),
        "starboard_thruster = nan: must be a finite number",
    ),
    "tunable nan": (lambda i: put(i, air_density=math.nan), "air_density = nan: must be a finite number"),
    "tunable impossible": (lambda i: put(i, air_density=-1.0), "air_density = -1.0: must not be negative"),
    "tunables that contradict": (_tuned_to_the_impossible, "thrust_min = 20.0 N: must not be above thrust_max = 10.0"),
    "tunables out of range together": (
        _tuned_out_of_range,
        "spin_drag_factor = nan kg.m2: must be a finite number; it is made of air_density, drag_coefficient, height, ",
    ),
    "fixed": (lambda i: put(i, mass=50.0), "mass = 50.0: must not be set in state 'step mode' (fixed parameter)"),
    "fixed enumeration": (
        lambda i: i.setInteger([reference("integrator")], [1]),
        "integrator = 1: must not be set in state 'step mode' (fixed parameter)",
    ),
    "output": (lambda i: put(i, pose__x=1.0), "pose.x = 1.0: must not be set in state 'step mode' (continuous output)"),
    "calculated": (lambda i: put(i, speed=1.0), "speed = 1.0: must not be set"),
    "counter": (lambda i: i.setInteger([reference("substeps")], [0]), "substeps = 0: must not be set"),
    "step negative": (lambda i: i.doStep(0.1, -0.1), "communicationStepSize = -0.1 s: must be a finite number"),
    "step zero": (lambda i: i.doStep(0.1, 0.0), "communicationStepSize = 0.0 s: must be a finite number"),
    "step nan": (lambda i: i.doStep(0.1, math.nan), "communicationStepSize = nan s: must be a finite number"),
    "step inf": (lambda i: i.doStep(0.1, math.inf), "communicationStepSize = inf s: must be a finite number"),
    "step too long": (lambda i: i.doStep(0.1, 1e7), "must not need more than 10^9 sub-steps"),
    "point back": (
        lambda i: i.doStep(0.0, 0.1),
        "currentCommunicationPoint = 0.0 s: must be where the last step ended",
    ),
    "point ahead": (lambda i: i.doStep(0.2, 0.1), "currentCommunicationPoint = 0.2 s: must be where the last step"),
    "point nan": (lambda i: i.doStep(math.nan, 0.1), "currentCommunicationPoint = nan s: must be where the last step"),
    "non-finite": (_thrown_out_of_range, "after 0.1 s: must stay a finite number"),
    "no such real": (lambda i: i.getReal([99]), "value reference 99: must be that of a variable of type Real"),
    "no such real, large": (lambda i: i.setReal([2**32 - 1], [0.0]), "must be that of a variable of type Real"),
    "an integer as real": (lambda i: i.getReal([reference("substeps")]), "must be that of a variable of type Real"),
    "a real as integer": (
        lambda i: i.setInteger([0], [1]),
        "must be that of a variable of type Integer or Enumeration",
    ),
    "no booleans": (lambda i: i.getBoolean([0]), "must be that of a variable of type Boolean"),
    "no booleans to set": (lambda i: i.setBoolean([0], [True]), "must be that of a variable of type Boolean"),
    "no strings": (lambda i: i.getString([0]), "must be that of a variable of type String"),
    "no strings to set": (lambda i: i.setString([0], ["a"]), "must be that of a variable of type String"),
    "set up twice": (
        lambda i: i.setupExperiment(),
        "fmi2SetupExperiment in state 'step mode': must be called in state",
    ),
    "enter again": (lambda i: i.enterInitializationMode(), "fmi2EnterInitializationMode in state 'step mode'"),
    "exit again": (lambda i: i.exitInitializationMode(), "fmi2ExitInitializationMode in state 'step mode'"),
}


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_loud_and_loses_nothing(name: str, instance: Any, messages: list[str]) -> None:
    fault, message = FAULTS[name]
    start(instance)
    put(instance, thrust=7.0, port_thruster=0.5)
    instance.doStep(0.0, 0.1)
    before = everything(instance)
    with pytest.raises(FMICallException) as caught:
        fault(instance)
    assert worded(instance, message) in messages[-1]
    assert caught.value.status == status_of_refusal(instance, caught.value, messages[-1])
    after = everything(instance)
    for set_before_the_refused_step in ("thrust_min", "air_density"):
        del before[set_before_the_refused_step], after[set_before_the_refused_step]
    assert after == before


# pythonfmu takes a large value reference for a negative number
@pytest.mark.parametrize("name", [name for name in FAULTS if name != "no such real, large"])
def test_all_flavours_say_the_same(name: str, both: list[tuple[Any, list[str]]]) -> None:
    for instance, _ in both:
        start(instance)
        put(instance, thrust=7.0, port_thruster=0.5)
        instance.doStep(0.0, 0.1)
        with pytest.raises(FMICallException):
            FAULTS[name][0](instance)
    (_, ours), (native, said) = both
    assert [worded(native, message) for message in ours] == said
    assert len(said) == 1


@pytest.mark.parametrize("values", [{"velocity__x": 123.456}, {"velocity__yaw_rate": 20.0, "drag_coefficient": 1e-3}])
def test_all_flavours_warn_in_the_same_words(values: dict[str, float], both: list[tuple[Any, list[str]]]) -> None:
    for instance, _ in both:
        put(instance, step_size=0.03, thrust=11.1, **values)
        start(instance)
        instance.doStep(0.0, 0.03)
    (_, ours), (_, said) = both
    assert ours == said
    assert len(said) == 2


OUT_OF_RANGE: dict[str, tuple[dict[str, float], str]] = {
    "projected_area": (
        {"length": 1e200, "width": 1e200, "height": 1e200},
        "projected_area = inf m2: must be a finite number; it is made of length, width, height",
    ),
    "drag_rate": ({"mass": 1e-320}, "drag_rate = inf 1/kg: must be a finite number; it is made of mass, inertia,"),
    "friction_force": (
        {"mass": 1e200, "skirt_friction": 1e200},
        "friction_force = inf N: must be a finite number; it is made of skirt_friction, mass, gravity",
    ),
}


@pytest.mark.parametrize("name", OUT_OF_RANGE)
def test_all_flavours_refuse_a_craft_out_of_range_in_the_same_words(
    name: str, both: list[tuple[Any, list[str]]]
) -> None:
    """Each of its parameters is possible alone; together they are looked at when they are first used."""
    values, message = OUT_OF_RANGE[name]
    for instance, _ in both:
        put(instance, **values)
        instance.setupExperiment()
        instance.enterInitializationMode()
        with pytest.raises(FMICallException):
            instance.getReal([reference("speed")])
    (_, ours), (_, said) = both
    assert ours == said
    assert len(said) == 1
    assert message in said[0]


WATCHED_OUT_OF_RANGE: tuple[tuple[str, int, dict[str, float]], ...] = (
    ("stability_number", 2, {"mass": 1e-300, "inertia": 1e-300, "air_density": 1e10, "velocity.yaw_rate": 1.0}),
    ("rotation_per_substep", 2, {"step_size": 1e300, "air_density": 1e-100, "velocity.yaw_rate": 1e100,
                                 "mass": 1e-300, "inertia": 5e-300, "rotational_drag": 1.0}),
    ("rotation_per_substep", 5, {"step_size": 2.0, "drag_coefficient": 0.0, "pose.heading": -1.5e308,
                                 "velocity.yaw_rate": 1e308}),
)  # fmt: skip
"""Where drag_implicit, which never diverges, leaves the motion finite; and splitting, which turns by halves."""


@pytest.mark.parametrize(
    ("name", "method", "given"), WATCHED_OUT_OF_RANGE, ids=["stability_number", "rotation_per_substep", "by halves"]
)
def test_all_flavours_refuse_a_step_whose_watched_values_overflow(
    name: str, method: int, given: dict[str, float], both: list[tuple[Any, list[str]]]
) -> None:
    values = {key.replace(".", "__"): value for key, value in given.items()}
    step = values.get("step_size", 0.001)
    for instance, _ in both:
        instance.setInteger([reference("integrator")], [method])
        put(instance, **values)
        start(instance)
        before = get(instance, *STATES)
        with pytest.raises(FMICallException):
            instance.doStep(0.0, step)
        assert get(instance, *STATES) == before
    (_, ours), (_, said) = both
    assert ours == said
    assert said == [
        f"{name} = inf after 0.0 s: must stay a finite number; the step was refused and the state of 0.0 s stands; "
        f"the motion is too fast for sub-steps of {step!r} s: set a smaller step_size"
    ]


@pytest.mark.parametrize("axis", ["x", "y"])
def test_all_flavours_name_what_is_not_finite(axis: str, both: list[tuple[Any, list[str]]]) -> None:
    """Without drag the velocities last, while the position leaves all numbers."""
    values = {f"velocity.{axis}": 1e308, "drag_coefficient": 0.0, "step_size": 10.0}
    for instance, _ in both:
        instance.setReal([reference(each) for each in values], list(values.values()))
        start(instance)
        with pytest.raises(FMICallException):
            instance.doStep(0.0, 20.0)
    (_, ours), (_, said) = both
    assert ours == said
    assert said[-1].startswith(f"pose.{axis} = inf after 0.0 s: must stay a finite number")


@pytest.mark.parametrize("method", ["splitting", "adaptive"])
@pytest.mark.parametrize(
    ("name", "value", "beside"),
    [
        ("wind.y", -1e200, {"wind.x": 3.0}),
        ("external.force.x", 1e308, {}),
        ("external.force.y", -1e200, {"drag_coefficient": 0.0, "mass": 1e-200, "inertia": 1e-200}),
        ("external.moment", 1e308, {"external.force.x": 5.0}),
    ],
)
def test_all_flavours_name_an_input_that_no_step_helps(
    name: str, value: float, beside: dict[str, float], method: str, both: list[tuple[Any, list[str]]]
) -> None:
    """Drag at the speed that it drives the craft to is faster than 1e-12 s: to ask for shorter steps would be a lie."""
    for instance, _ in both:
        instance.setInteger([reference("integrator")], [integrator_number(method)])
        for each, number in (beside | {name: value}).items():
            instance.setReal([reference(each)], [number])
        start(instance)
        before = get(instance, *STATES)
        with pytest.raises(FMICallException):
            instance.doStep(0.0, 1.0)
        assert get(instance, *STATES) == before
    (_, ours), (_, said) = both
    assert ours == said
    assert said == [
        f"{name} = {value!r}: must not drive the craft so fast that even sub-steps of 1e-12 s are too long; the step "
        "was refused and the state of 0.0 s stands"
    ]


@pytest.mark.parametrize("value", [1e20, -1e20])
def test_an_input_that_a_shorter_step_would_follow_is_not_blamed(
    value: float, both: list[tuple[Any, list[str]]]
) -> None:
    for instance, _ in both:
        put(instance, external__force__x=value)
        start(instance)
        with pytest.raises(FMICallException):
            instance.doStep(0.0, 1.0)
    (_, ours), (_, said) = both
    assert ours == said
    assert said[-1].endswith("the motion is too fast for sub-steps of 0.001 s: set a smaller step_size")


@pytest.mark.parametrize(
    ("calls", "message"),
    [
        ((lambda i: i.doStep(0.0, 0.1),), "fmi2DoStep in state 'instantiated': must be called in state 'step mode'"),
        ((lambda i: i.terminate(),), "fmi2Terminate in state 'instantiated'"),
        ((lambda i: i.exitInitializationMode(),), "fmi2ExitInitializationMode in state 'instantiated'"),
        ((lambda i: i.setupExperiment(startTime=math.nan),), "startTime = nan s: must be a finite number"),
        (
            (lambda i: i.setupExperiment(startTime=2.0, stopTime=1.0),),
            "stopTime = 1.0 s: must not be before startTime = 2.0 s",
        ),
        ((lambda i: i.setupExperiment(stopTime=math.nan),), "stopTime = nan s: must not be before startTime"),
        ((lambda i: put(i, mass=0.0),), "mass = 0.0: must be greater than 0"),
        ((lambda i: put(i, step_size=-1.0),), "step_size = -1.0 s: must be a finite number greater than 0"),
        ((lambda i: put(i, velocity__x=math.nan),), "velocity.x = nan: must be a finite number"),
        ((lambda i: put(i, drag_center_fraction=0.6),), "drag_center_fraction = 0.6: must be from -0.5"),
        ((lambda i: i.setInteger([reference("integrator")], [99]),), "integrator = 99: must be one of 1 (semi_"),
        (
            (start, lambda i: i.terminate(), lambda i: put(i, thrust=1.0)),
            "thrust = 1.0: must not be set in state 'term",
        ),
        ((start, lambda i: i.terminate(), lambda i: i.doStep(0.0, 0.1)), "fmi2DoStep in state 'terminated'"),
    ],
)
def test_faults_before_and_after(
    calls: tuple[Callable[[Any], object], ...], message: str, instance: Any, messages: list[str]
) -> None:
    for call in calls[:-1]:
        call(instance)
    before = everything(instance)
    with pytest.raises(FMICallException):
        calls[-1](instance)
    assert worded(instance, message) in messages[-1]
    assert everything(instance) == before


def test_one_process_lives_through_a_hundred_instances_with_three_faults_each(each_fmu: Path, fresh: Fresh) -> None:
    code = """
import sys
from pathlib import Path
from hovercraft_fmu.host import Fmu, SimulationError
from hovercraft_fmu.fmu.interface import MOTION, STATES

with Fmu(Path(sys.argv[1])) as fmu:
    for _ in range(100):
        with fmu.instance() as craft:
            craft.start()
            craft.step(0.0, 0.1)
            seen, output = craft.port(*STATES, *MOTION, "mass", "substeps"), craft.port("speed")
            before = seen.get()
            faults = (craft.step, 5.0, 0.1), (craft.set, {"mass": 3.0}), (output.set, [1.0])
            for call, *arguments in faults:
                try:
                    call(*arguments)
                except SimulationError:
                    assert seen.get() == before
                else:
                    raise AssertionError
            assert len(craft.messages) == 3
print("alive")
"""
    assert fresh(code, each_fmu).strip() == "alive"


# ---- inputs outside their limits, and warnings


def test_inputs_outside_their_limits_saturate_and_are_told_once(instance: Any, messages: list[str]) -> None:
    start(instance)
    put(instance, thrust=1e6, port_thruster=-3.0, starboard_thruster=100.0)
    assert count(instance, "warnings") == 0
    instance.doStep(0.0, 0.1)
    assert get(instance, "applied.thrust", "applied.steering") == [10.0, -3.0]
    assert get(instance, *INPUTS) == [1e6, -3.0, 100.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    instance.doStep(0.1, 0.1)
    assert messages == ["thrust = 1000000.0: is outside its limits and is held at 10.0 (said once)"]
    assert count(instance, "warnings") == INPUT_HELD


@pytest.mark.parametrize("part", [1e-7, 0.999, 1.001])
@pytest.mark.parametrize(("name", "limit", "way"), [("thrust", 10.0, HELD), ("port_thruster", 0.0, -HELD)])
def test_a_rounding_of_the_host_is_no_warning(
    name: str, limit: float, way: float, part: float, instance: Any, messages: list[str]
) -> None:
    """Of a limit, or of 1 where that is less."""
    start(instance)
    put(instance, **{name: limit + part * way * max(1.0, limit)})
    instance.doStep(0.0, 0.1)
    assert (count(instance, "warnings"), len(messages)) == ((INPUT_HELD, 1) if part > 1.0 else (0, 0))


@pytest.mark.parametrize("name", SCENES)
def test_no_named_scene_warns(name: str, each_fmu: Path) -> None:
    from hovercraft_fmu import simulate

    result = simulate(name, each_fmu, communication_step=0.5)
    assert result.warnings == ()
    assert not result["warnings"].any()


def test_the_command_shows_warnings(each_fmu: Path) -> None:
    from hovercraft_fmu import simulate
    from hovercraft_fmu.scenes import signals

    result = simulate(signals([(0.0, 99.0, 0.0, 0.0), (1.0, 99.0, 0.0, 0.0)]), each_fmu)
    assert result.warnings == ("thrust = 99.0: is outside its limits and is held at 10.0 (said once)",)
    assert result["warnings"][-1] == INPUT_HELD


def test_the_counter_of_substeps_stops_at_its_end(instance: Any, messages: list[str]) -> None:
    """Its end is 2147483647, a fortnight of stepping: the state is written up to just before it."""
    start(instance)
    saved = bytes(instance.serializeFMUstate(instance.getFMUstate()))
    instance.setFMUstate(instance.deSerializeFMUstate(with_substeps(saved, SUBSTEPS_MAX - 50)))
    instance.doStep(0.0, 0.05)
    assert (count(instance), count(instance, "warnings")) == (SUBSTEPS_MAX, 0)
    instance.doStep(0.05, 0.05)
    assert (count(instance), count(instance, "warnings")) == (SUBSTEPS_MAX, COUNTER_STOPPED)
    instance.doStep(0.1, 0.05)
    assert (count(instance), count(instance, "warnings")) == (SUBSTEPS_MAX, COUNTER_STOPPED)
    assert len(messages) == 1  # said once
    assert "substeps = 2147483647" in messages[-1]


# ---- state


class Oracle(NamedTuple):
    """What the instance must show, kept by the bare model."""

    inputs: Controls = Controls()
    density: float = 1.225
    time: float = 0.0
    state: State = State()
    controls: Controls = Controls()
    craft: Craft = Craft()
    substeps: int = 0
    warnings: int = 0

    def stepped(self, h: float) -> "Oracle":
        craft = replace(self.craft, air_density=self.density)
        state, n, *_ = advance(self.state, self.inputs, craft, h)
        held = not (-HELD <= self.inputs.thrust <= 10.0 * (1.0 + HELD))
        return self._replace(
            time=self.time + h,
            state=state,
            controls=self.inputs,
            craft=craft,
            substeps=self.substeps + n,
            warnings=self.warnings | (INPUT_HELD if held else 0),
        )

    def check(self, instance: Any) -> None:
        seen = (*observe_motion(self.state), *observe_action(self.state, self.controls, self.craft))
        assert_same(instance, get(instance, *CONTINUOUS), [*self.inputs, *self.state, *seen])
        assert get(instance, "air_density") == [self.density]
        assert (count(instance), count(instance, "warnings")) == (self.substeps, self.warnings)


OPERATIONS = st.one_of(
    st.tuples(st.just("step"), numbers(1e-4, 0.05)),
    st.tuples(
        st.just("inputs"), st.builds(Controls, numbers(-2.0, 12.0), *[numbers(0.0, 1.0)] * 2, *[numbers(-0.3, 0.3)] * 5)
    ),
    st.tuples(st.just("tune"), numbers(0.0, 2.0)),
    st.tuples(st.just("save"), st.booleans()),
    st.tuples(st.just("restore"), st.integers(0, 9)),
    st.tuples(st.just("reset"), numbers(-100.0, 100.0)),
    st.tuples(st.just("fault"), st.sampled_from(["point", "input", "fixed", "blob"])),
)


def _fault(instance: Any, kind: str, time: float) -> None:
    if kind == "point":
        instance.doStep(time + 1.0, 0.1)
    elif kind == "input":
        put(instance, thrust=math.nan)
    elif kind == "fixed":
        put(instance, mass=1.0)
    else:
        instance.deSerializeFMUstate(b"damaged")


@settings(max_examples=60)
@given(operations=st.lists(OPERATIONS, min_size=4, max_size=40))
def test_any_sequence_of_steps_inputs_saves_and_restores(
    operations: list[tuple[str, Any]], shared: tuple[Any, list[str]]
) -> None:
    instance, _ = shared
    instance.reset()
    start(instance)
    oracle = Oracle()
    saved: list[tuple[Any, Oracle]] = []
    for name, value in operations:
        if name == "step":
            instance.doStep(oracle.time, value)
            oracle = oracle.stepped(value)
        elif name == "inputs":
            instance.setReal([reference(each) for each in INPUTS], list(value))
            oracle = oracle._replace(inputs=value)
        elif name == "tune":
            put(instance, air_density=value)
            oracle = oracle._replace(density=value)
        elif name == "save":
            saved.append((kept(instance, through_bytes=value), oracle))
        elif name == "restore" and saved:
            state, oracle = saved[value % len(saved)]
            instance.setFMUstate(state)
        elif name == "reset":
            instance.reset()
            start(instance, value)
            oracle = Oracle(time=value)
        elif name == "fault":
            with pytest.raises(FMICallException):
                _fault(instance, value, oracle.time)
        oracle.check(instance)
    for state, _ in saved:
        instance.freeFMUstate(state)


def test_a_state_restores_the_phase_too(instance: Any) -> None:
    put(instance, mass=200.0, velocity__x=1.0)
    before = instance.getFMUstate()
    start(instance, 3.0)
    instance.doStep(3.0, 0.5)
    stepping, there = instance.getFMUstate(), everything(instance)
    instance.setFMUstate(before)
    start(instance, 3.0)
    assert get(instance, "mass", "velocity.x") == [200.0, 1.0]
    instance.doStep(3.0, 0.5)
    assert everything(instance) == there
    instance.reset()
    instance.setFMUstate(stepping)
    assert everything(instance) == there
    instance.doStep(3.5, 0.5)


@settings(max_examples=60)
@given(data=st.data())
def test_a_damaged_state_is_refused(data: st.DataObject, shared: tuple[Any, list[str]]) -> None:
    instance, messages = shared
    instance.reset()
    start(instance)
    instance.doStep(0.0, 0.1)
    before = everything(instance)
    good = bytes(instance.serializeFMUstate(instance.getFMUstate()))
    i = data.draw(st.integers(0, len(good) - 1))
    flipped = good[:i] + bytes([good[i] ^ data.draw(st.integers(1, 255))]) + good[i + 1 :]
    bad = data.draw(st.sampled_from([flipped, good[:i], good + good[:1], b"", b"{}"]))
    beside = another(instance)
    with pytest.raises(FMICallException):
        instance.deSerializeFMUstate(bad)
    beside.freeInstance()
    assert messages[-1] == f"serialized FMU state of {len(bad)} bytes: must be complete and unchanged"
    assert everything(instance) == before
    instance.setFMUstate(instance.deSerializeFMUstate(good))
    assert everything(instance) == before


def test_a_state_of_another_build_is_refused(instance: Any, messages: list[str]) -> None:
    start(instance)
    saved = bytes(instance.serializeFMUstate(instance.getFMUstate()))
    with pytest.raises(FMICallException):
        instance.deSerializeFMUstate(with_build(saved, "0" * 32))
    assert f"FMU state of build {'0' * 32}: must be a state of this build" in messages[-1]


# ---- methods


def _adaptive(instance: Any, hosts: float | None = None, **values: float) -> None:
    instance.setupExperiment(tolerance=hosts)
    instance.setInteger([reference("integrator")], [4])
    put(instance, **values)
    instance.enterInitializationMode()
    instance.exitInitializationMode()
    put(instance, port_thruster=1.0)


def test_a_rolled_back_adaptive_run_repeats_to_the_bit(instance: Any) -> None:
    """The proposed step is part of the state."""
    _adaptive(instance)
    instance.doStep(0.0, 7.0)
    content = instance.serializeFMUstate(instance.getFMUstate())
    instance.doStep(7.0, 5.0)
    there = everything(instance)
    instance.setFMUstate(instance.deSerializeFMUstate(content))
    instance.doStep(7.0, 5.0)
    assert everything(instance) == there
    instance.reset()
    instance.setFMUstate(instance.deSerializeFMUstate(content))
    instance.doStep(7.0, 5.0)
    assert everything(instance) == there


def test_the_hosts_tolerance_wins_over_the_parameter(instance: Any, messages: list[str]) -> None:
    counts = []
    for tolerance, parameter in ((None, 1e-9), (1e-9, 1e-3), (None, 1e-3), (1e-3, 1e-9)):
        instance.reset()
        _adaptive(instance, tolerance, tolerance=parameter)
        instance.doStep(0.0, 60.0)
        counts.append(count(instance))
    assert counts[0] == counts[1] > 2 * counts[2]
    assert counts[2] == counts[3]
    instance.reset()
    with pytest.raises(FMICallException):
        instance.setupExperiment(tolerance=-1.0)
    assert messages[-1] == "tolerance = -1.0: must be a finite number greater than 0"


def test_where_the_adaptive_method_cannot_go_on_it_says_so(instance: Any, messages: list[str]) -> None:
    hard = {"mass": 1e-3, "inertia": 1e-3, "air_density": 1000.0, "velocity__x": 1e6, "tolerance": 1e-14}
    _adaptive(instance, **hard)
    before = everything(instance)
    with pytest.raises(FMICallException):
        instance.doStep(0.0, 1.0)
    assert "to meet tolerance = 1e-14; set a larger tolerance" in messages[-1]
    assert everything(instance) == before


@pytest.mark.parametrize(
    ("number", "values", "bit", "message"),
    [
        (1, {"velocity__x": 100.0, "step_size": 0.05}, STEP_UNSTABLE, "must not pass 0.2 with semi_implicit_euler"),
        (3, {"velocity__x": 100.0, "step_size": 0.05}, STEP_UNSTABLE, "must not pass 2.0 with rk4"),
        (2, {"velocity__x": 100.0, "step_size": 0.05}, STEP_UNSTABLE, "must not pass 2.0 with drag_implicit"),
        (
            2,
            {"velocity__yaw_rate": 20.0, "step_size": 0.05, "drag_coefficient": 0.0},
            STEP_TURNS,
            "rotation_per_substep = 1 rad: must not pass 0.2 rad",
        ),
    ],
)
def test_a_step_that_is_too_long_is_told_once(
    number: int, values: dict[str, float], bit: int, message: str, instance: Any, messages: list[str]
) -> None:
    instance.setupExperiment()
    instance.setInteger([reference("integrator")], [number])
    put(instance, **values)
    instance.enterInitializationMode()
    instance.exitInitializationMode()
    instance.doStep(0.0, 0.05)
    assert count(instance, "warnings") == bit
    assert len(messages) == 1
    assert message in messages[0]
    assert "set a step_size below" in messages[0]
    instance.doStep(0.05, 0.05)
    assert len(messages) == 1


# ---- communication points


def test_outputs_belong_to_the_point_after_set_state_and_reset(instance: Any) -> None:
    start(instance)
    put(instance, thrust=8.0, port_thruster=1.0)
    instance.doStep(0.0, 0.1)
    there = get(instance, *CONTINUOUS)
    state = instance.getFMUstate()
    put(instance, thrust=0.0, port_thruster=0.0)
    instance.doStep(0.1, 0.1)
    instance.setFMUstate(state)
    assert get(instance, *CONTINUOUS) == there
    instance.reset()
    start(instance)
    assert get(instance, "applied.thrust", "applied.steering", *MOTION) == [5.0, 0.0, 0.0, 0.0, 0.0]


def test_no_step_leads_past_the_stop_time(instance: Any, messages: list[str]) -> None:
    """As FMI 2.0 demands of `stopTime`; a rounding of the host's does not count, and a reset forgets it."""
    instance.setupExperiment(stopTime=1.0)
    instance.enterInitializationMode()
    instance.exitInitializationMode()
    instance.doStep(0.0, 0.9)
    content = instance.serializeFMUstate(instance.getFMUstate())
    for restored in (False, True):
        if restored:
            instance.reset()
            instance.setFMUstate(instance.deSerializeFMUstate(content))
        before = everything(instance)
        with pytest.raises(FMICallException):
            instance.doStep(0.9, 0.2)
        assert messages[-1] == ("communicationStepSize = 0.2 s from 0.9 s: must not lead past stopTime = 1.0 s")
        assert everything(instance) == before
    instance.doStep(0.9, 0.1 + 1e-16)
    instance.reset()
    start(instance)
    instance.doStep(0.0, 2.0)


def test_a_start_time_other_than_zero(instance: Any) -> None:
    """A host that passes differences of times: the bits are those of a start at 0, and so is the count."""
    ends = []
    for time in (0.0, -5.0, 86_400.0, 1.7e9):
        instance.reset()
        start(instance, time)
        for k in range(300):
            point = time + k * 0.001
            instance.doStep(point, time + (k + 1) * 0.001 - point)
        ends.append([*get(instance, *STATES), count(instance)])
    assert ends[0][-1] == 300
    assert ends == [ends[0]] * 4


@settings(max_examples=25)
@given(
    time=st.one_of(st.sampled_from([86_400.0, 1.7e9]), numbers(-1e9, 1e9)),
    size=st.one_of(st.sampled_from([0.001, 0.01]), numbers(5e-4, 0.1)),
    many=st.integers(1, 20),
)
def test_any_start_time_gives_the_bits_of_a_start_at_zero(
    time: float, size: float, many: int, shared: tuple[Any, list[str]]
) -> None:
    instance, _ = shared
    seen = []
    for begin in (0.0, time):
        instance.reset()
        start(instance, begin, step_size=size)
        points = [begin + k * (many * size) for k in range(4)]
        for point, end in itertools.pairwise(points):
            instance.doStep(point, end - point)
        seen.append([*get(instance, *STATES), count(instance)])
    assert seen[0] == seen[1]
    assert seen[0][-1] == 3 * many


@pytest.mark.parametrize("time", [0.0, 86_400.0, 1.7e9])
def test_another_time_is_refused_wherever_the_time_starts(time: float, instance: Any, messages: list[str]) -> None:
    instance.setupExperiment(startTime=time, stopTime=time + 1.0)
    instance.enterInitializationMode()
    instance.exitInitializationMode()
    instance.doStep(time, 0.5)
    for point in (time, time + 0.49, time + 0.501, time + 2.0, math.nan):
        with pytest.raises(FMICallException):
            instance.doStep(point, 0.1)
        assert (
            messages[-1]
            == f"currentCommunicationPoint = {point!r} s: must be where the last step ended, {time + 0.5!r} s"
        )
    for step in (0.501, 0.6, 2.0):
        with pytest.raises(FMICallException):
            instance.doStep(time + 0.5, step)
        assert "must not lead past stopTime" in messages[-1]
    instance.doStep(time + 0.5, 0.5)


def test_a_host_may_add_up_its_time(instance: Any) -> None:
    """10 000 steps of 0.1 s end 1.6e-10 s past the stop time."""
    put(instance, step_size=0.1)
    instance.setupExperiment(stopTime=1000.0)
    instance.enterInitializationMode()
    instance.exitInitializationMode()
    time = 0.0
    for _ in range(10_000):
        instance.doStep(time, 0.1)
        time += 0.1
    assert time > 1000.0
    with pytest.raises(FMICallException):
        instance.doStep(time, 0.1)


def test_a_step_that_the_time_cannot_tell_is_refused(instance: Any, messages: list[str]) -> None:
    start(instance, 1e15)
    with pytest.raises(FMICallException):
        instance.doStep(1e15, 0.1)
    rule = "must not be less than what a double can tell at 1000000000000000.0 s, 0.125 s"
    assert messages[-1] == f"communicationStepSize = 0.1 s: {rule}"
    instance.doStep(1e15, 0.125)
    instance.doStep(1e15 + 0.125, 1.0)
    instance.reset()
    start(instance, -1.0)
    instance.doStep(-1.0, math.ulp(0.5))  # the last step of a host that has added up its time


def test_tunable_parameters_change_between_steps(instance: Any) -> None:
    start(instance)
    instance.doStep(0.0, 1.0)
    put(instance, drag_coefficient=0.0, thrust_max=3.0)
    assert get(instance, "drag_coefficient", "thrust_max", "applied.thrust") == [0.0, 3.0, 5.0]
    instance.doStep(1.0, 1.0)
    middle = advance(State(), Controls(), Craft(), 1.0).state
    end = advance(middle, Controls(), Craft(drag_coefficient=0.0, thrust_max=3.0), 1.0).state
    assert_same(instance, get(instance, *STATES, "applied.thrust"), [*end, 3.0])


def test_a_parameter_that_is_set_to_what_it_is_changes_nothing(instance: Any) -> None:
    """Once it is taken up, by the initialization or the next step, the state is the same, byte by byte."""
    states: dict[bool, list[bytes]] = {False: [], True: []}
    for again, seen in states.items():
        instance.reset()
        values = {"air_density": Craft().air_density} if again else {}
        start(instance, velocity__x=1.0, **values)
        seen.append(bytes(instance.serializeFMUstate(instance.getFMUstate())))
        put(instance, **values)
        instance.doStep(0.0, 0.5)
        seen.append(bytes(instance.serializeFMUstate(instance.getFMUstate())))
    assert states[False] == states[True]


def test_the_watched_values_are_those_of_the_fastest_substep(instance: Any) -> None:
    """Coasting straight ahead the first: 2 h k |u| (1/m + x_d^2/I), k of (length + width)/2 height; spinning h |r|."""
    start(instance, velocity__x=2.0, thrust=0.0)
    instance.doStep(0.0, 0.1)
    expected = [2.0 * 0.001 * (0.5 * 1.225 * 1.25 * 15.0 * 5.0) * 2.0 * (1.0 / 100.0 + 25.0 / 500.0), 0.0]
    assert get(instance, "stability_number", "rotation_per_substep") == pytest.approx(expected, rel=1e-12)
    instance.reset()
    start(instance, velocity__yaw_rate=-0.3, thrust=0.0, drag_coefficient=0.0)
    instance.doStep(0.0, 0.1)
    assert get(instance, "stability_number", "rotation_per_substep") == pytest.approx([0.0, 0.0003], rel=1e-12)


def test_at_the_limit_itself_nothing_is_warned_of(instance: Any, messages: list[str]) -> None:
    """Half a second at 0.3 rad/s is 0.15 rad, the limit of rotation, without a rounding."""
    for rate, warned in ((0.3, 0), (math.nextafter(0.3, 1.0), STEP_TURNS)):
        instance.reset()
        start(instance, velocity__yaw_rate=rate, step_size=0.5, thrust=0.0, drag_coefficient=0.0)
        instance.doStep(0.0, 0.5)
        assert count(instance, "warnings") == warned
    assert len(messages) == 1


def test_ground_and_wind_change_between_steps_and_come_back_with_the_state(instance: Any) -> None:
    start(instance, velocity__x=1.0)
    put(instance, thrust=0.0, skirt_friction=0.1, rotational_drag=0.3, wind__y=0.2)
    instance.doStep(0.0, 0.5)
    state, there = instance.serializeFMUstate(instance.getFMUstate()), everything(instance)
    craft = Craft(skirt_friction=0.1, rotational_drag=0.3)
    assert get(instance, *STATES) == list(advance(State(vx=1.0), Controls(0.0, wind_y=0.2), craft, 0.5).state)
    instance.doStep(0.5, 5.0)  # to rest
    assert get(instance, *STATES[3:], "force.x", "force.y", "moment", "acceleration.yaw") == [0.0] * 7
    end = everything(instance)
    put(instance, skirt_friction=0.0, wind__y=0.0, thrust=5.0)
    instance.doStep(5.5, 1.0)
    assert get(instance, "velocity.x")[0] > 0.01
    instance.setFMUstate(instance.deSerializeFMUstate(state))
    assert everything(instance) == there
    instance.doStep(0.5, 5.0)
    assert everything(instance) == end


def test_the_default_time_may_be_off_by_a_rounding(instance: Any) -> None:
    start(instance)
    time = 0.0
    for _ in range(1000):
        instance.doStep(time, 0.1)
        time += 0.1
    assert count(instance) == 100 * 1000
    instance.doStep(100.0, 0.1)


def test_a_state_from_before_the_start_brings_its_start_values_back(instance: Any) -> None:
    """All of them, those of the motion, too: the start takes them up."""
    values = {"pose__x": 7.0, "velocity__yaw_rate": 0.25, "mass": 120.0, "thrust": 3.0}
    put(instance, **values)
    content = instance.serializeFMUstate(instance.getFMUstate())
    instance.reset()
    instance.setFMUstate(instance.deSerializeFMUstate(content))
    start(instance)
    assert get(instance, *(name.replace("__", ".") for name in values)) == list(values.values())


LIMITED = [(v.name, limit, way) for v in VARIABLES if v.causality == "parameter" and v.kind == "Real"
           for limit, way in ((v.minimum, -math.inf), (v.maximum, math.inf)) if limit is not None]  # fmt: skip
"""Of each parameter that has limits in the description the limit, and where it is left."""


@pytest.mark.parametrize(("name", "limit", "way"), LIMITED)
def test_a_parameter_may_be_at_its_limit_and_not_beyond(
    name: str, limit: float, way: float, instance: Any, messages: list[str]
) -> None:
    instance.setReal([reference(name)], [limit])
    instance.reset()
    with pytest.raises(FMICallException):
        instance.setReal([reference(name)], [math.nextafter(limit, way)])
    assert messages[-1].startswith(f"{name} = ")


def test_states_that_are_given_back_leave_nothing(each_native_fmu: Path, fresh: Fresh) -> None:
    """Forty thousand of some kilobytes each, in a process of its own."""
    code = """
import sys
from pathlib import Path
import psutil
from tests.lowlevel import one, start

with one(Path(sys.argv[1])) as (instance, _):
    start(instance)
    rss = psutil.Process().memory_info
    for k in range(40_000):
        if k == 4_000:
            early = rss().rss
        instance.freeFMUstate(instance.getFMUstate())
    print(rss().rss - early)
"""
    assert int(fresh(code, each_native_fmu, env={"PYTHONPATH": str(ROOT)})) < 10e6


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_time_may_be_off_by_the_whole_rounding_and_by_no_more(
    sign: float, instance: Any, messages: list[str]
) -> None:
    """Before 0 the start is the largest number at hand, so the sums are exact."""
    most = rounding(1.0, 0.25)
    start(instance, -1.0)
    instance.doStep(-1.0 + sign * most, 0.25)
    instance.reset()
    start(instance, -1.0)
    with pytest.raises(FMICallException):
        instance.doStep(-1.0 + sign * 1.5 * most, 0.25)
    assert "must be where the last step ended" in messages[-1]


def test_a_step_may_lead_past_the_stop_time_by_the_whole_rounding_and_by_no_more(instance: Any) -> None:
    for factor, fine in ((1.0, True), (1.5, False)):
        instance.reset()
        instance.setupExperiment(startTime=-1.0, stopTime=-0.75 - factor * rounding(1.0, 0.25))
        instance.enterInitializationMode()
        instance.exitInitializationMode()
        with nullcontext() if fine else pytest.raises(FMICallException):
            instance.doStep(-1.0, 0.25)


@settings(max_examples=25)
@given(seed=st.integers(0, 2**32 - 1), most=st.sampled_from([1e-3, 0.05, 10.0]))
def test_a_run_cut_into_odd_steps_ends_on_time_and_on_the_curve(
    seed: int, most: float, shared: tuple[Any, list[str]]
) -> None:
    """Steps from 1e-13 s to 10 s: the end is that of the exact launch, within the error of the method.

    The even run of 60 s at h = 1 ms errs by 2.4e-4 m and 7e-6 m/s; equal sub-steps are never longer.
    """
    instance, _ = shared
    instance.reset()
    start(instance)
    dice = random.Random(seed)
    time = 0.0
    for _ in range(40):
        step = math.exp(dice.uniform(math.log(1e-13), math.log(most)))
        instance.doStep(time, step)
        time += step
    exact = SCENES["launch"].exact
    assert exact
    x, _, _, vx, _, _ = (float(part[0]) for part in exact(np.array([time])))
    assert get(instance, "pose.x") == pytest.approx([x], abs=3e-4)
    assert get(instance, "velocity.x") == pytest.approx([vx], abs=3e-5)


# ---- many at once


def _lone(controls: Controls, steps: int, h: float) -> list[float]:
    state = State()
    for _ in range(steps):
        state = advance(state, controls, Craft(), h, Settings()).state
    return list(state)


def _controls(k: int) -> Controls:
    return Controls(k % 11, (k % 7) / 7.0, (k % 5) / 5.0)


def test_a_hundred_instances_interleaved(each_fmu: Path) -> None:
    with one(each_fmu) as (first, _):
        craft = [first, *(another(first) for _ in range(99))]
        for k, each in enumerate(craft):
            start(each)
            each.setReal([0, 1, 2], list(_controls(k)[:3]))
        for step in range(10):
            for each in craft:
                each.doStep(step * 0.05, 0.05)
        for k, each in enumerate(craft):
            assert_same(each, get(each, *STATES), _lone(_controls(k), 10, 0.05))
        for each in craft[1:]:
            each.fmi2FreeInstance(each.component)


def test_eight_threads(each_fmu: Path) -> None:
    """Loaded one after the other (fmpy changes the working directory meanwhile), driven all at once."""

    def drive(k: int) -> list[float]:
        made = craft[k]
        start(made)
        made.setReal([0, 1, 2], list(_controls(k)[:3]))
        for step in range(100):
            made.doStep(step * 0.02, 0.02)
            made.getReal([3, 12])
        end = get(made, *STATES)
        made.fmi2FreeInstance(made.component)
        return end

    with one(each_fmu) as (first, _):
        craft = [another(first) for _ in range(24)]
        with ThreadPoolExecutor(8) as pool:
            ends = list(pool.map(drive, range(24)))
    for k in range(24):
        assert_same(first, ends[k], _lone(_controls(k), 100, 0.02))


def test_a_host_that_imported_modules_of_the_same_names(fmu: Path, fresh: Fresh) -> None:
    """Empty modules under every name that the FMU carries in some form, pythonfmu among them."""
    code = """
import sys, types
import zipfile
with zipfile.ZipFile(sys.argv[1]) as archive:
    stems = {part.removesuffix(".py") for name in archive.namelist() for part in name.split("/")}
hidden = {stem for stem in stems if stem.isidentifier() and not stem.startswith("hovercraft_") and stem != "__init__"}
assert {"pythonfmu", "model", "fmu", "slave", "craft", "interface"} <= hidden
import fmpy
for name in (*hidden, "hovercraft_fmu", "hovercraft"):
    sys.modules[name] = types.ModuleType(name)
result = fmpy.simulate_fmu(sys.argv[1], stop_time=60.0, output_interval=0.1)
print(repr(float(result["pose.x"][-1])))
"""
    assert fresh(code, fmu).strip() == repr(_lone(Controls(), 600, 0.1)[0])
