"""Model exchange of the native FMU: phases, states, what is read; and the partial derivatives of both uses."""

import math
from collections.abc import Callable, Iterator
from copy import copy
from ctypes import c_double
from dataclasses import fields, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hovercraft_fmu.fmu.interface import BY_NAME, DERIVATIVES, INPUT_HELD, INPUTS, MOTION, STATES, WATCHED
from hovercraft_fmu.host import SimulationError
from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.dynamics import (
    Controls,
    State,
    body_velocity,
    derivatives,
    load_function,
    sliding_load_function,
)
from hovercraft_fmu.model.observation import observe_action, observe_motion
from hovercraft_fmu.scenes import SCENES, Scene, held
from hovercraft_fmu.simulation import plan, read_description
from hovercraft_fmu.studies.model_exchange import SMOOTH, TOLERANCES, Calls, solved
from hovercraft_fmu.studies.reference_end import reference_end
from hovercraft_fmu.studies.trade import STOP_TIME
from tests.conftest import FMI_2
from tests.lowlevel import CONTINUOUS, Instance3, count, everything, get, kept, one, put, reference, start, worded
from tests.strategies import crafts, numbers, rubbing_crafts
from tests.test_lifecycle import FAULTS

ERROR = 3
UNKNOWNS = (*STATES, *MOTION, *DERIVATIVES[3:])
KNOWNS = (*STATES, *INPUTS)
PARAMETERS = tuple(field.name for field in fields(Craft) if BY_NAME[field.name].kind == "Real")
INITIAL_UNKNOWNS = (*MOTION, *DERIVATIVES[3:], "projected_area")
INITIAL_KNOWNS = (*KNOWNS, *PARAMETERS)


@pytest.fixture(scope="module")
def shared(each_native_fmu: Path) -> Iterator[tuple[Any, list[str]]]:
    with one(each_native_fmu, exchange=True) as made:
        yield made


@pytest.fixture(scope="module")
def stepped(each_native_fmu: Path) -> Iterator[Any]:
    """One for co-simulation."""
    with one(each_native_fmu) as (made, _):
        yield made


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


# ---- phases


def _to(instance: Any, phase: str) -> None:
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
ALLOWED: dict[str, tuple[Callable[[Any], object], tuple[str, ...]]] = {
    "fmi2SetupExperiment": (lambda i: i.setupExperiment(), ("instantiated",)),
    "fmi2EnterInitializationMode": (lambda i: i.enterInitializationMode(), ("instantiated",)),
    "fmi2ExitInitializationMode": (lambda i: i.exitInitializationMode(), ("initialization mode",)),
    "fmi2EnterEventMode": (lambda i: i.enterEventMode(), ("event mode", "continuous-time mode")),
    "fmi2NewDiscreteStates": (lambda i: i.newDiscreteStates(), ("event mode",)),
    "fmi2EnterContinuousTimeMode": (lambda i: i.enterContinuousTimeMode(), ("event mode",)),
    "fmi2CompletedIntegratorStep": (lambda i: i.completedIntegratorStep(), ("continuous-time mode",)),
    "fmi2SetTime": (lambda i: i.setTime(1.0), ("event mode", "continuous-time mode")),
    "fmi2SetContinuousStates": (lambda i: put_states(i, [0.0] * 6), ("continuous-time mode",)),
    "fmi2GetContinuousStates": (lambda i: get_vector(i.getContinuousStates), EVERYWHERE[1:]),
    "fmi2GetDerivatives": (lambda i: get_vector(i.getDerivatives), EVERYWHERE[1:]),
    "fmi2GetNominalsOfContinuousStates": (lambda i: get_vector(i.getNominalsOfContinuousStates), EVERYWHERE),
    "fmi2GetEventIndicators": (lambda i: get_vector(i.getEventIndicators, 0), EVERYWHERE),
    "fmi2GetDirectionalDerivative": (lambda i: i.getDirectionalDerivative([15], [6], [1.0]), EVERYWHERE[1:]),
    "fmi2Terminate": (lambda i: i.terminate(), ("event mode", "continuous-time mode")),
}
"""Each call, and where the standard's state machine has it (sections 3.2.3 and 2.1.9 of FMI 2.0)."""


@pytest.mark.parametrize("phase", EVERYWHERE)
@pytest.mark.parametrize("name", ALLOWED)
def test_each_call_has_its_phases(name: str, phase: str, instance: Any, messages: list[str]) -> None:
    call, phases = ALLOWED[name]
    _to(instance, phase)
    if phase in phases:
        call(instance)
        assert messages == []
    else:
        before = everything(instance)
        with pytest.raises(FMICallException) as caught:
            call(instance)
        assert caught.value.status == ERROR
        expected = f"{name} in state '{phase}': must be called in state '"
        assert messages[0].startswith(worded(instance, expected))
        assert everything(instance) == before


def in_the_hands_of(host: Any, instance: Any) -> Any:
    """The instance behind fmpy's functions for the other use."""
    borrowed = copy(host.made if isinstance(host, Instance3) else host)
    borrowed.component = instance.component
    return Instance3(borrowed) if isinstance(host, Instance3) else borrowed


def test_calls_of_the_other_use_are_refused(
    each_native_fmu: Path, standard: int, instance: Any, messages: list[str]
) -> None:
    with one(each_native_fmu) as (stepping, said):
        start(stepping)
        go(instance)
        exchanging, stepped = in_the_hands_of(stepping, instance), in_the_hands_of(instance, stepping)
        of_steps: list[tuple[Callable[[], object], str]] = [
            (lambda: exchanging.getRealOutputDerivatives([3], [1]), "co-simulation"),
            (lambda: exchanging.doStep(0.0, 0.1), "'step mode'"),
        ]
        if standard == 2:
            of_steps.append((lambda: exchanging.setRealInputDerivatives([0], [1], [1.0]), "co-simulation"))
        of_exchange: list[tuple[Callable[[], object], str]] = [
            (lambda: get_vector(stepped.getDerivatives), "model exchange"),
            (lambda: get_vector(stepped.getContinuousStates), "model exchange"),
            (lambda: get_vector(stepped.getNominalsOfContinuousStates), "model exchange"),
            (lambda: get_vector(stepped.getEventIndicators, 0), "model exchange"),
            (lambda: put_states(stepped, [0.0] * 6), "'continuous-time mode'"),
            (lambda: stepped.setTime(1.0), "'event mode' or 'continuous-time mode'"),
            (lambda: stepped.enterEventMode(), "'event mode' or 'continuous-time mode'"),
        ]
        for calls, heard in ((of_steps, messages), (of_exchange, said)):
            for call, words in calls:
                with pytest.raises(FMICallException):
                    call()
                assert words in heard[-1]
            assert len(heard) == len(calls)


STEPPING_FAULTS = [name for name in FAULTS if any(word in name for word in ("step", "point", "tunables", "non-finite"))]


@pytest.mark.parametrize("mode", ["event mode", "continuous-time mode"])
@pytest.mark.parametrize("name", [name for name in FAULTS if name not in STEPPING_FAULTS])
def test_a_fault_is_loud_and_loses_nothing(name: str, mode: str, instance: Any, messages: list[str]) -> None:
    """Those of co-simulation that are not about steps; tunable parameters are fixed in continuous-time mode."""
    fault, message = FAULTS[name]
    _to(instance, mode)
    put(instance, thrust=7.0, port_thruster=0.5)
    before = everything(instance)
    with pytest.raises(FMICallException) as caught:
        fault(instance)
    assert caught.value.status == ERROR
    tunable = name.startswith("tunable") and mode == "continuous-time mode"
    expected = "must not be set in state" if tunable else worded(instance, message.replace("step mode", mode))
    assert expected in messages[-1]
    assert everything(instance) == before


OWN_FAULTS: dict[str, tuple[Callable[[Any], object], str]] = {
    "state nan": (
        lambda i: put_states(i, [1.0, 1.0, 1.0, 1.0, math.nan, 1.0]),
        "velocity.y = nan: must be a finite number",
    ),
    "state inf": (lambda i: put_states(i, [math.inf, *[0.0] * 5]), "pose.x = inf: must be a finite number"),
    "five states": (lambda i: put_states(i, [0.0] * 5), "fmi2SetContinuousStates: 5 values: must be 6, one for each"),
    "seven derivatives": (lambda i: get_vector(i.getDerivatives, 7), "fmi2GetDerivatives: 7 values: must be 6"),
    "no states": (lambda i: get_vector(i.getContinuousStates, 0), "fmi2GetContinuousStates: 0 values: must be 6"),
    "one nominal": (
        lambda i: get_vector(i.getNominalsOfContinuousStates, 1),
        "fmi2GetNominalsOfContinuousStates: 1 values: must be 6",
    ),
    "an indicator": (
        lambda i: get_vector(i.getEventIndicators, 1),
        "fmi2GetEventIndicators: 1 values: must be 0; there are no event indicators",
    ),
    "time nan": (lambda i: i.setTime(math.nan), "time = nan s: must be a finite number"),
    "unknown input": (
        lambda i: i.getDirectionalDerivative([0], [3], [1.0]),
        "fmi2GetDirectionalDerivative: unknown thrust: must be an output or the derivative of a state",
    ),
    "unknown local": (lambda i: i.getDirectionalDerivative([3, 12], [3], [1.0]), "unknown force.x: must be an output"),
    "unknown parameter": (lambda i: i.getDirectionalDerivative([29], [23], [1.0]), "unknown projected_area: must be"),
    "unknown of none": (
        lambda i: i.getDirectionalDerivative([999], [3], [1.0]),
        "unknown with value reference 999: must be an output or the derivative of a state",
    ),
    "known parameter": (
        lambda i: i.getDirectionalDerivative([15], [3, 21], [1.0, 1.0]),
        "known mass: must be a state or an input",
    ),
    "known output": (lambda i: i.getDirectionalDerivative([15], [9], [1.0]), "known body.surge: must be a state or"),
    "known of none": (
        lambda i: i.getDirectionalDerivative([15], [2**32 - 1], [1.0]),
        "known with value reference 4294967295: must be a state or an input",
    ),
    "seed nan": (
        lambda i: i.getDirectionalDerivative([15], [6], [math.nan]),
        "directional derivative of acceleration.x = nan: must be a finite number",
    ),
    "seed inf": (lambda i: i.getDirectionalDerivative([3], [3], [math.inf]), "directional derivative of pose.x = inf"),
}


@pytest.mark.parametrize("name", OWN_FAULTS)
def test_faults_of_model_exchange(name: str, instance: Any, messages: list[str]) -> None:
    fault, message = OWN_FAULTS[name]
    go(instance)
    put_states(instance, [1.0, 2.0, 0.5, 0.3, -0.1, 0.05])
    before = everything(instance)
    with pytest.raises(FMICallException) as caught:
        fault(instance)
    assert caught.value.status == ERROR
    assert worded(instance, message) in messages[-1]
    assert everything(instance) == before


def test_motion_out_of_range_is_refused_and_the_solver_may_come_back(instance: Any, messages: list[str]) -> None:
    go(instance)
    good = [1.0, 2.0, 0.5, 0.3, -0.1, 0.05]
    put_states(instance, good)
    rates = get_vector(instance.getDerivatives)
    put_states(instance, [0.0, 0.0, 0.0, 1e120, 0.0, 1e120])
    for call in (lambda: get_vector(instance.getDerivatives), lambda: jacobian(instance)):
        put_states(instance, [0.0, 0.0, 0.0, 1e200, 0.0, 0.0])
        with pytest.raises(FMICallException):
            call()
        assert messages[-1] == "speed = inf: must be a finite number; the motion is out of range"
    put_states(instance, good)
    assert get_vector(instance.getDerivatives) == rates


def test_parameters_that_contradict_one_another_are_refused_before_the_solver_goes_on(
    instance: Any, messages: list[str]
) -> None:
    go(instance)
    instance.enterEventMode()
    put(instance, thrust_min=20.0)
    for call in (
        instance.newDiscreteStates,
        instance.enterContinuousTimeMode,
        lambda: get_vector(instance.getDerivatives),
    ):
        with pytest.raises(FMICallException):
            call()
        assert messages[-1] == "thrust_min = 20.0 N: must not be above thrust_max = 10.0 N"
    put(instance, thrust_max=30.0)
    instance.enterContinuousTimeMode()
    assert get(instance, "applied.thrust", "acceleration.x") == [20.0, 0.2]


def test_friction_is_refused_wherever_it_is_set(instance: Any, messages: list[str]) -> None:
    text = "skirt_friction = 0.008: must be 0 in model exchange: a craft that friction stops, holds and lets go is not "
    for phase in EVERYWHERE[:3]:
        _to(instance, phase)
        with pytest.raises(FMICallException):
            put(instance, skirt_friction=0.008)
        assert messages[-1] == text + "smooth; use co-simulation"
        put(instance, skirt_friction=0.0)
        assert get(instance, "skirt_friction") == [0.0]


def test_no_completed_step_leads_past_the_stop_time(instance: Any, messages: list[str]) -> None:
    """A solver may look ahead of it."""
    instance.setupExperiment(stopTime=1.0)
    instance.enterInitializationMode()
    instance.exitInitializationMode()
    instance.enterContinuousTimeMode()
    instance.setTime(1.5)
    get_vector(instance.getDerivatives)
    with pytest.raises(FMICallException):
        instance.completedIntegratorStep()
    message = "fmi2CompletedIntegratorStep at 1.5 s: must not lead past stopTime = 1.0 s"
    assert messages == [worded(instance, message)]
    instance.setTime(1.0)
    assert instance.completedIntegratorStep() == (False, False)


def test_an_input_outside_its_limits_is_told_once(instance: Any, messages: list[str]) -> None:
    go(instance)
    put(instance, thrust=99.0)
    assert get(instance, "applied.thrust", "acceleration.x") == [10.0, 0.1]
    assert (count(instance, "warnings"), messages) == (0, [])
    assert instance.completedIntegratorStep() == (True, False)
    assert (count(instance, "warnings"), messages) == (0, [])  # it is discrete: it changes in event mode alone
    instance.enterEventMode()
    instance.newDiscreteStates()
    instance.enterContinuousTimeMode()
    assert instance.completedIntegratorStep() == (False, False)
    instance.enterEventMode()
    instance.newDiscreteStates()
    assert messages == ["thrust = 99.0: is outside its limits and is held at 10.0 (said once)"]
    assert count(instance, "warnings") == INPUT_HELD
    assert (count(instance), get(instance, *WATCHED)) == (0, [0.0, 0.0])


# ---- what is read


MOST = {"x": 1e3, "y": 1e3, "heading": 10.0, "vx": 20.0, "vy": 20.0, "yaw_rate": 2.0}
ROUNDED = {name: numbers(-most, most).map(lambda x: round(x, 6)) for name, most in MOST.items()}
rounded_states = st.builds(State, **ROUNDED)
"""Nowhere nearer to a kink than that, unless on it."""
rounded_controls = st.builds(
    Controls,
    numbers(-200.0, 200.0).map(lambda x: round(x, 6)),
    *[st.one_of(st.sampled_from([0.0, 1.0]), numbers(-0.5, 1.5).map(lambda x: round(x, 6)))] * 2,
    *[st.one_of(st.just(0.0), numbers(-10.0, 10.0).map(lambda x: round(x, 6)))] * 2,
)


@settings(max_examples=200)
@given(craft=crafts, state=rounded_states, held=rounded_controls)
def test_all_that_is_read_follows_states_and_inputs_at_once(
    craft: Craft, state: State, held: Controls, shared: tuple[Any, list[str]]
) -> None:
    """As the bare model has it; the FMU brings its own sine and cosine."""
    instance, _ = shared
    put_all(instance, craft, state, held)
    instance.setTime(3.0)
    expected = derivatives(state, held, craft)
    scale = 1.0 + max(map(abs, expected))
    assert get_vector(instance.getDerivatives) == pytest.approx(expected, rel=1e-11, abs=1e-11 * scale)
    assert get_vector(instance.getContinuousStates) == list(state)
    seen = [*held, *state, *observe_motion(state), *observe_action(state, held, craft)]
    scale = 1.0 + max(map(abs, seen))
    assert get(instance, *CONTINUOUS) == pytest.approx(seen, rel=1e-11, abs=1e-11 * scale)


def test_tunable_parameters_act_from_event_mode_on(instance: Any) -> None:
    go(instance, velocity__x=1.0)
    instance.enterEventMode()
    put(instance, air_density=0.0, steering_force=6.0, port_thruster=1.0)
    expected = derivatives(State(vx=1.0), Controls(5.0, 1.0), replace(Craft(), air_density=0.0, steering_force=6.0))
    assert get_vector(instance.getDerivatives) == list(expected)
    instance.enterContinuousTimeMode()
    assert get_vector(instance.getDerivatives) == list(expected)


def test_nominals_are_those_of_the_description(instance: Any) -> None:
    assert get_vector(instance.getNominalsOfContinuousStates) == [BY_NAME[name].nominal for name in STATES]


def test_both_uses_read_the_same_at_the_start(instance: Any, stepped: Any) -> None:
    values = {"pose__heading": 0.7, "velocity__x": 1.5, "velocity__yaw_rate": -0.2, "wind__y": 0.3, "thrust": 8.0}
    stepped.reset()
    start(stepped, **values)
    go(instance, **values)
    assert everything(instance) == everything(stepped)


# ---- state


OPERATIONS = st.one_of(
    st.tuples(st.just("states"), rounded_states),
    st.tuples(st.just("inputs"), rounded_controls),
    st.tuples(st.just("tune"), numbers(0.0, 2.0)),
    st.tuples(st.just("save"), st.booleans()),
    st.tuples(st.just("restore"), st.integers(0, 9)),
    st.tuples(st.just("fault"), st.sampled_from(sorted(OWN_FAULTS))),
)


@settings(max_examples=100)
@given(operations=st.lists(OPERATIONS, min_size=4, max_size=30))
def test_any_sequence_of_states_inputs_saves_and_restores(
    operations: list[tuple[str, Any]], shared: tuple[Any, list[str]]
) -> None:
    instance, _ = shared
    instance.reset()
    go(instance)
    now: tuple[State, Controls, float] = (State(), Controls(), 1.225)
    saved: list[tuple[Any, tuple[State, Controls, float]]] = []
    for name, value in operations:
        state, held, density = now
        if name == "states":
            put_states(instance, value)
            now = (value, held, density)
        elif name == "inputs":
            instance.setReal([reference(each) for each in INPUTS], list(value))
            now = (state, value, density)
        elif name == "tune":
            instance.enterEventMode()
            put(instance, air_density=value)
            instance.enterContinuousTimeMode()
            now = (state, held, value)
        elif name == "save":
            saved.append((kept(instance, through_bytes=value), now))
        elif name == "restore" and saved:
            before, now = saved[value % len(saved)]
            instance.setFMUstate(before)
        elif name == "fault":
            with pytest.raises(FMICallException):
                OWN_FAULTS[value][0](instance)
        state, held, density = now
        expected = derivatives(state, held, Craft(air_density=density))
        assert get_vector(instance.getContinuousStates) == list(state)
        assert get_vector(instance.getDerivatives) == pytest.approx(expected, rel=1e-11, abs=1e-9)
    for state, _ in saved:
        instance.freeFMUstate(state)


@pytest.mark.parametrize("phase", EVERYWHERE)
def test_a_state_restores_the_phase_too(phase: str, instance: Any) -> None:
    _to(instance, phase)
    before, content = everything(instance), instance.serializeFMUstate(instance.getFMUstate())
    _to(instance, "continuous-time mode")
    put_states(instance, [1.0] * 6)
    instance.setFMUstate(instance.deSerializeFMUstate(content))
    assert everything(instance) == before
    refused = [name for name, (_, phases) in ALLOWED.items() if phase not in phases]
    for name in refused:
        with pytest.raises(FMICallException):
            ALLOWED[name][0](instance)
    assert bytes(instance.serializeFMUstate(instance.getFMUstate())) == bytes(content)


def test_a_state_of_the_other_use_is_refused(instance: Any, messages: list[str], stepped: Any) -> None:
    stepped.reset()
    content = stepped.serializeFMUstate(stepped.getFMUstate())
    before = everything(instance)
    with pytest.raises(FMICallException):
        instance.setFMUstate(instance.deSerializeFMUstate(content))
    assert messages == ["FMU state of an instance for co-simulation: must be that of one for model exchange"]
    assert everything(instance) == before
    with pytest.raises(FMICallException):
        stepped.setFMUstate(stepped.deSerializeFMUstate(instance.serializeFMUstate(instance.getFMUstate())))


# ---- partial derivatives


class Analytic(np.ndarray[Any, np.dtype[Any]]):  # not NDArray, which newer numpy has as an alias
    """A complex number whose absolute value is that of the real function: continued, with the slope 0 at 0."""

    def __abs__(self) -> "Analytic":
        return analytic(self * np.sign(self.real))


def analytic(value: Any) -> Analytic:
    return np.asarray(value, dtype=complex).view(Analytic)


def _clip(value: Any, low: Any, high: Any) -> Any:
    """A limit is inside, where there is an inside."""
    x, least, most = (float(np.real(each)) for each in (value, low, high))
    if least <= x <= most:
        return value if least < most else analytic(least)
    return analytic(low if x < least else high)


COMPLEX = SimpleNamespace(
    cos=np.cos,
    sin=np.sin,
    sqrt=np.sqrt,
    log=np.log,
    where=np.where,
    clip=_clip,
    fmax=lambda a, b: a if a.real > b else b,
)
STEP = 1e-200  # its square is 0


def _model(values: dict[str, Any], drag_area: int) -> dict[str, Any]:
    """All that can be an unknown, by name, through the bare model; of states, inputs and parameters, by name."""
    craft = object.__new__(Craft)  # complex numbers would not come through its door
    vars(craft).update({name: values[name] for name in PARAMETERS}, drag_area=drag_area)
    state, held = State(*(values[name] for name in STATES)), Controls(*(values[name] for name in INPUTS))
    loads_at = (sliding_load_function if craft.rubs else load_function)(held, craft, COMPLEX)
    x, y, moment, _ = loads_at(*state[2:])
    motion = (*body_velocity(state, COMPLEX), np.sqrt(state.vx * state.vx + state.vy * state.vy))
    accelerations = (x / craft.mass, y / craft.mass, moment / craft.inertia)
    found = (*state, *motion, *accelerations, craft.projected_area)
    return dict(zip((*UNKNOWNS, "projected_area"), found, strict=True))


def by_complex_steps(
    state: State,
    held: Controls,
    craft: Craft,
    unknowns: tuple[str, ...] = UNKNOWNS,
    knowns: tuple[str, ...] = KNOWNS,
) -> NDArray[np.float64]:
    """The Jacobian through the bare model (Squire, Trapp, Using complex variables to estimate derivatives, 1998)."""
    at = dict(zip(KNOWNS, map(analytic, (*state, *held)), strict=True)) | {n: getattr(craft, n) for n in PARAMETERS}
    columns = []
    for known in knowns:
        found = _model(at | {known: analytic(at[known] + STEP * 1j)}, craft.drag_area)
        columns.append([float(np.imag(found[name])) / STEP for name in unknowns])
    return np.array(columns).T


def jacobian(
    instance: Any, unknowns: tuple[str, ...] = UNKNOWNS, knowns: tuple[str, ...] = KNOWNS
) -> NDArray[np.float64]:
    rows = [reference(name) for name in unknowns]
    return np.array([instance.getDirectionalDerivative(rows, [reference(name)], [1.0]) for name in knowns]).T


def assert_close(found: NDArray[np.float64], expected: NDArray[np.float64]) -> None:
    scale = max(1.0, float(np.abs(expected).max()))
    assert np.abs(found - expected).max() <= 1e-11 * scale


@settings(max_examples=150)
@given(craft=crafts, state=rounded_states, held=rounded_controls)
def test_partial_derivatives_are_those_of_the_model(
    craft: Craft, state: State, held: Controls, shared: tuple[Any, list[str]]
) -> None:
    instance, _ = shared
    put_all(instance, craft, state, held)
    assert_close(jacobian(instance), by_complex_steps(state, held, craft))


@settings(max_examples=100)
@given(craft=st.one_of(crafts, rubbing_crafts), state=rounded_states, held=rounded_controls)
def test_partial_derivatives_in_co_simulation(craft: Craft, state: State, held: Controls, stepped: Any) -> None:
    """At a communication point: of what is read there, so with the inputs of the step that led to it."""
    state = state._replace(vx=state.vx or 0.5)
    stepped.reset()
    put_craft(stepped, craft)
    values = {name.replace(".", "__"): value for name, value in zip(KNOWNS, (*state, *held), strict=True)}
    start(stepped, **values)
    put(stepped, thrust=3.0, port_thruster=0.25)  # for the next step
    assert_close(jacobian(stepped), by_complex_steps(state, held, craft))


def initialize(instance: Any, state: State, held: Controls, craft: Craft) -> None:
    """To initialization mode."""
    instance.reset()
    put_craft(instance, craft)
    instance.setReal([reference(name) for name in KNOWNS], [*state, *held])
    instance.setupExperiment()
    instance.enterInitializationMode()


def assert_initially_close(instance: Any, state: State, held: Controls, craft: Craft) -> None:
    """Of parameters the change by a whole of each is compared: so that columns are of one size."""
    expected = by_complex_steps(state, held, craft, INITIAL_UNKNOWNS, INITIAL_KNOWNS)
    wholes = np.array([1.0] * len(KNOWNS) + [abs(getattr(craft, name)) or 1.0 for name in PARAMETERS])
    assert_close(jacobian(instance, INITIAL_UNKNOWNS, INITIAL_KNOWNS) * wholes, expected * wholes)


@settings(max_examples=100)
@given(craft=crafts, state=rounded_states, held=rounded_controls)
def test_partial_derivatives_in_initialization_mode(
    craft: Craft, state: State, held: Controls, shared: tuple[Any, list[str]]
) -> None:
    """Of parameters, too; friction, which is none here, can begin."""
    state = state._replace(vx=state.vx or 0.5)
    instance, _ = shared
    initialize(instance, state, held, craft)
    assert_initially_close(instance, state, held, craft)


@settings(max_examples=100)
@given(craft=st.one_of(crafts, rubbing_crafts), state=rounded_states, held=rounded_controls)
def test_partial_derivatives_in_initialization_mode_of_co_simulation(
    craft: Craft, state: State, held: Controls, stepped: Any
) -> None:
    state = state._replace(vx=state.vx or 0.5)
    initialize(stepped, state, held, craft)
    assert_initially_close(stepped, state, held, craft)


def test_only_initialization_mode_has_parameters_as_knowns(instance: Any, messages: list[str]) -> None:
    """And the projected area as an unknown, but no state: it is given."""
    rows, columns = [reference(name) for name in INITIAL_UNKNOWNS], [reference(name) for name in INITIAL_KNOWNS]
    seeds = list(np.linspace(-1.0, 1.0, len(columns)))
    _to(instance, "initialization mode")
    for name in ("step_size", "tolerance"):  # they act on nothing that is read
        assert instance.getDirectionalDerivative(rows, [reference(name)], [1.0]) == [0.0] * len(rows)
    found = instance.getDirectionalDerivative(rows, columns, seeds)
    expected = jacobian(instance, INITIAL_UNKNOWNS, INITIAL_KNOWNS) @ np.array(seeds)
    assert found == pytest.approx(expected, rel=1e-13, abs=1e-13)
    for unknown, known, said in (
        ("pose.x", "mass", "unknown pose.x: must be one of the initial unknowns in initialization mode"),
        ("force.x", "mass", "unknown force.x: must be one of the initial"),
        ("mass", "mass", "unknown mass: must be one of the initial"),
        ("speed", "speed", "known speed: must be a state, an input or a real parameter in initialization mode"),
        ("speed", "drag_area", "known drag_area: must be a state, an input or"),
        ("speed", "projected_area", "known projected_area: must be a state, an input or"),
    ):
        with pytest.raises(FMICallException):
            partial(instance, unknown, known)
        assert messages[-1].startswith(worded(instance, f"fmi2GetDirectionalDerivative: {said}"))


def test_partial_derivatives_after_a_step(stepped: Any) -> None:
    stepped.reset()
    start(stepped, thrust_min=-10.0)
    put(stepped, thrust=7.0, port_thruster=0.5, wind__x=0.3)
    stepped.doStep(0.0, 2.0)
    put(stepped, thrust=-20.0, wind__x=0.0)
    held = Controls(7.0, 0.5, 0.0, 0.3)
    expected = by_complex_steps(State(*get(stepped, *STATES)), held, Craft(thrust_min=-10.0))
    assert_close(jacobian(stepped), expected)


@given(seeds=st.lists(numbers(-3.0, 3.0), min_size=len(KNOWNS), max_size=len(KNOWNS)))
def test_a_directional_derivative_is_the_jacobian_times_the_seeds(
    seeds: list[float], shared: tuple[Any, list[str]]
) -> None:
    instance, _ = shared
    instance.reset()
    go(instance)
    put_states(instance, [1.0, 2.0, 0.5, 0.3, -0.1, 0.05])
    matrix = jacobian(instance)
    unknowns, knowns = ([reference(name) for name in names] for names in (UNKNOWNS, KNOWNS))
    found = instance.getDirectionalDerivative(unknowns, knowns, seeds)
    assert found == pytest.approx(matrix @ np.array(seeds), rel=1e-13, abs=1e-13)
    backwards = instance.getDirectionalDerivative(unknowns[::-1], knowns[::-1], seeds[::-1])
    assert backwards[::-1] == pytest.approx(found, rel=1e-13, abs=1e-13)
    assert instance.getDirectionalDerivative([], knowns, seeds) == []
    assert instance.getDirectionalDerivative([3], [], []) == [0.0]


def partial(instance: Any, unknown: str, known: str) -> float:
    return float(instance.getDirectionalDerivative([reference(unknown)], [reference(known)], [1.0])[0])


def test_the_side_that_is_taken_at_a_kink(instance: Any) -> None:
    """As the documentation has it: a limit of an input is inside; of an absolute value and of the speed the mean."""
    instance.setInteger([reference("drag_area")], [2])
    go(instance)
    for thrust, slope in ((0.0, 0.01), (10.0, 0.01), (5.0, 0.01), (-1e-9, 0.0), (10.1, 0.0)):
        put(instance, thrust=thrust)
        assert partial(instance, "acceleration.x", "thrust") == slope
    for port, slope in ((0.0, 0.03), (1.0, 0.03), (-0.1, 0.0), (1.1, 0.0)):
        put(instance, port_thruster=port)
        assert partial(instance, "acceleration.y", "port_thruster") == slope
    assert [partial(instance, "speed", f"velocity.{axis}") for axis in "xy"] == [0.0, 0.0]  # at rest
    put_states(instance, [0.0, 0.0, 0.0, 2.0, 0.0, 0.0])  # air from right ahead: |w| has a kink in the surge force
    ahead, abeam = Craft().drag_factor_ahead, Craft().drag_factor_abeam
    assert partial(instance, "acceleration.x", "velocity.y") == 0.0
    assert partial(instance, "acceleration.x", "velocity.x") == pytest.approx(-2.0 * ahead * 2.0 / 100.0, rel=1e-14)
    for side in (1.0, -1.0):
        put_states(instance, [0.0, 0.0, 0.0, 2.0, side * 1e-12, 0.0])
        slope = partial(instance, "acceleration.x", "velocity.y")
        assert slope == pytest.approx(-side * abeam * 2.0 / 100.0, rel=1e-9)
    instance.enterEventMode()
    put(instance, thrust_min=5.0, thrust_max=5.0, thrust=5.0)  # nothing is inside
    assert partial(instance, "acceleration.x", "thrust") == 0.0


def test_the_side_that_is_taken_at_a_kink_of_a_parameter(instance: Any) -> None:
    """A limit that the thrust is at does not act; friction begins from none, at rest against the push."""
    _to(instance, "initialization mode")
    for thrust, low, high in ((0.0, 0.0, 0.0), (10.0, 0.0, 0.0), (-1e-9, 0.01, 0.0), (10.1, 0.0, 0.01)):
        put(instance, thrust=thrust)
        slopes = [partial(instance, "acceleration.x", f"thrust_{limit}") for limit in ("min", "max")]
        assert slopes == [low, high]
    put(instance, thrust=5.0, thrust_min=5.0, thrust_max=5.0)  # nothing is inside
    assert [partial(instance, "acceleration.x", f"thrust_{limit}") for limit in ("min", "max")] == [0.0, 0.0]
    assert partial(instance, "acceleration.x", "skirt_friction") == pytest.approx(-Craft().gravity, rel=1e-14)
    put(instance, velocity__x=-0.1)
    assert partial(instance, "acceleration.x", "skirt_friction") == pytest.approx(Craft().gravity, rel=1e-14)
    put(instance, velocity__x=0.0, thrust_min=0.0, thrust=0.0)  # nothing pushes, nothing rubs
    assert partial(instance, "acceleration.x", "skirt_friction") == 0.0


def test_friction_that_begins_at_rest(stepped: Any) -> None:
    """Its slope is that of what is read with a very little of it: linear in it, to a relative error of its size."""
    held = {"thrust": 5.0, "port_thruster": 0.7, "wind__x": 0.4, "wind__y": -0.2, "pose__heading": 0.3}
    little = 1e-7
    rows = INITIAL_UNKNOWNS[3:6]
    read = []
    for friction in (0.0, little):
        stepped.reset()
        put(stepped, **held, skirt_friction=friction)
        stepped.setupExperiment()
        stepped.enterInitializationMode()
        read.append(np.array(get(stepped, *rows)))
    put(stepped, skirt_friction=0.0)
    slopes = jacobian(stepped, rows, ("skirt_friction",))[:, 0]
    assert slopes == pytest.approx((read[1] - read[0]) / little, rel=1e-4)


def test_a_craft_that_friction_holds_has_no_partial_derivatives(each_native_fmu: Path) -> None:
    with one(each_native_fmu) as (stepping, said):
        start(stepping, skirt_friction=0.1)
        with pytest.raises(FMICallException):
            partial(stepping, "acceleration.x", "thrust")
        message = (
            "fmi2GetDirectionalDerivative: the craft is at rest on ground that rubs: it must slide to have partial "
            "derivatives"
        )
        assert said == [worded(stepping, message)]
        assert partial(stepping, "speed", "velocity.x") == 0.0  # what friction does not act on has them


# ---- the description


@pytest.fixture(scope="module")
def description(each_native_fmu: Path) -> Any:
    return read_description(each_native_fmu)


@FMI_2
def test_the_model_structure(description: Any) -> None:
    assert [unknown.variable.name for unknown in description.derivatives] == list(DERIVATIVES)
    assert [unknown.variable.derivative.name for unknown in description.derivatives] == list(STATES)
    assert (description.numberOfContinuousStates, description.numberOfEventIndicators) == (6, 0)
    assert description.modelExchange.modelIdentifier == description.coSimulation.modelIdentifier
    assert description.modelExchange.providesDirectionalDerivative
    assert description.modelExchange.canGetAndSetFMUstate
    assert description.modelExchange.canSerializeFMUstate
    initial = {unknown.variable.name for unknown in description.initialUnknowns}
    assert initial == {*MOTION, *DERIVATIVES[3:], "projected_area"}


@pytest.mark.parametrize("use", ["outputs", "derivatives"])
def test_dependencies_are_where_partial_derivatives_are_not_zero(use: str, description: Any, instance: Any) -> None:
    """Over random motions: what is listed acts, what is not never does."""
    instance.setInteger([reference("drag_area")], [2])
    go(instance)
    dice = np.random.default_rng(1)
    acts = np.zeros((len(UNKNOWNS), len(KNOWNS)), dtype=bool)
    for _ in range(20):
        put_states(instance, dice.normal(size=6))
        instance.setReal([reference(name) for name in INPUTS], [5.0, 0.5, 0.5, *dice.normal(size=2)])
        acts |= jacobian(instance) != 0.0
    for unknown in getattr(description, use):
        listed = {variable.name for variable in unknown.dependencies}
        row = UNKNOWNS.index(unknown.variable.name)
        assert listed == {name for name, each in zip(KNOWNS, acts[row], strict=True) if each}, unknown.variable.name


def initially_read(instance: Any, values: dict[str, float], drag_area: int) -> list[float]:
    instance.reset()
    instance.setInteger([reference("drag_area")], [drag_area])
    instance.setReal([reference(name) for name in values], list(values.values()))
    return get(instance, *INITIAL_UNKNOWNS)


def test_initial_dependencies_are_where_partial_derivatives_are_not_zero(description: Any, stepped: Any) -> None:
    """Over random craft that slide; and, which has no derivatives, where one at rest begins to."""
    dice = np.random.default_rng(2)
    acts = {(unknown, known): False for unknown in INITIAL_UNKNOWNS for known in (*INITIAL_KNOWNS, "drag_area")}
    for i in range(20):
        varied = {name: getattr(Craft(), name) * dice.uniform(0.5, 1.0) for name in PARAMETERS}
        varied |= {"skirt_friction": 1e-4, "rotational_drag": dice.uniform(0.1, 0.8), "thrust_min": 1.0}
        craft = Craft(**varied, drag_area=1 + i % 2)
        state, held = State(*dice.normal(size=6)), Controls((0.0, 3.0, 20.0)[i % 3], 0.5, 0.3, *dice.normal(size=2))
        initialize(stepped, state, held, craft)
        matrix = jacobian(stepped, INITIAL_UNKNOWNS, INITIAL_KNOWNS)
        for row, unknown in zip(matrix, INITIAL_UNKNOWNS, strict=True):
            for value, known in zip(row, INITIAL_KNOWNS, strict=True):
                acts[unknown, known] |= bool(value != 0.0)
        resting = state._replace(vx=0.0, vy=0.0, yaw_rate=0.0)
        values = dict(zip(KNOWNS, (*resting, *held), strict=True)) | varied
        before = initially_read(stepped, values, 1)
        for known in (*INITIAL_KNOWNS, "drag_area"):
            moved = values | ({} if known == "drag_area" else {known: values[known] * 1.1 + 0.01})
            after = initially_read(stepped, moved, 2 if known == "drag_area" else 1)
            for unknown, old, new in zip(INITIAL_UNKNOWNS, before, after, strict=True):
                acts[unknown, known] |= bool(old != new)
    listed = {u.variable.name: {v.name for v in u.dependencies} for u in description.initialUnknowns}
    assert listed == {
        unknown: {known for (each, known), does in acts.items() if does and each == unknown}
        for unknown in INITIAL_UNKNOWNS
    }


def test_fmpy_takes_co_simulation_unless_asked(native_fmu: Path) -> None:
    options = {"stop_time": 1.0, "output_interval": 0.5, "output": ["pose.x", "substeps"]}
    stepped, solved = (fmpy.simulate_fmu(str(native_fmu), fmi_type=kind, **options) for kind in (None, "ModelExchange"))
    assert list(stepped["substeps"]) == [0, 500, 1000]
    assert list(solved["substeps"]) == [0, 0, 0]
    assert solved["pose.x"][-1] == pytest.approx(stepped["pose.x"][-1], abs=1e-4)


@FMI_2
@pytest.mark.once
@pytest.mark.parametrize("scene", SMOOTH, ids=lambda scene: scene.name)
def test_cvode_meets_the_reference_and_its_error_follows_the_tolerance(
    scene: Scene, shared: tuple[Any, list[str]]
) -> None:
    """Over seven decades. CVode bounds the error of a step, relative to the states and their nominals; they add up."""
    exact, uncertainty = reference_end(scene, STOP_TIME)
    errors = []
    for tolerance in TOLERANCES:
        _, end, _ = solved(Calls(shared[0], scene, shared[1]), tolerance)
        errors.append(max(abs(a - b) for a, b in zip(end, exact, strict=True)))
        assert errors[-1] <= 500.0 * tolerance * max(1.0, *map(abs, exact)) + uncertainty
    slope = np.polyfit(np.log(TOLERANCES), np.log(errors), 1)[0]
    assert slope == pytest.approx(0.9, abs=0.2)


@pytest.mark.parametrize("name", [scene.name for scene in SMOOTH if scene.name not in ("slalom", "ice")])
def test_fmpy_alone_meets_the_reference_where_inputs_hold(name: str, native_fmu: Path) -> None:
    exact, _ = reference_end(SCENES[name], STOP_TIME)
    run = plan(name)
    result = fmpy.simulate_fmu(
        str(native_fmu), fmi_type="ModelExchange", stop_time=STOP_TIME, output_interval=0.5, relative_tolerance=1e-8,
        input=run.signals, start_values=dict(run.start_values), output=list(STATES),
    )  # fmt: skip
    end = [result[name][-1] for name in STATES]
    assert end == pytest.approx(exact, abs=500.0 * 1e-8 * max(1.0, *map(abs, exact)))


def test_fmpy_alone_holds_ramps_over_an_output_interval(native_fmu: Path) -> None:
    """As documented: of first order in it."""
    exact, _ = reference_end(SCENES["slalom"], STOP_TIME)
    run = plan("slalom")
    errors = []
    for interval in (0.5, 0.05):
        result = fmpy.simulate_fmu(
            str(native_fmu), fmi_type="ModelExchange", stop_time=STOP_TIME, output_interval=interval,
            relative_tolerance=1e-6, input=run.signals, output=["pose.x", "pose.y"],
        )  # fmt: skip
        errors.append(math.hypot(result["pose.x"][-1] - exact.x, result["pose.y"][-1] - exact.y))
    assert math.log10(errors[0] / errors[1]) == pytest.approx(1.0, abs=0.1)


@FMI_2
def test_what_the_fmu_says_to_the_solver_is_told(shared: tuple[Any, list[str]]) -> None:
    """CVode is C: an exception of fmpy's does not come through it."""
    scene = replace(SCENES["launch"], rows=held(STOP_TIME, (0.0, 99.0, 0.0, 0.0)))
    with pytest.raises(SimulationError, match=r"thrust = 99\.0: is outside its limits"):
        solved(Calls(shared[0], scene, shared[1]), 1e-6)


def test_fmpy_refuses_the_scene_with_friction(native_fmu: Path) -> None:
    values = dict(plan("drift_to_rest").start_values)
    assert values["skirt_friction"] == SCENES["drift_to_rest"].parameters["skirt_friction"]
    with pytest.raises(FMICallException):
        fmpy.simulate_fmu(str(native_fmu), fmi_type="ModelExchange", stop_time=1.0, start_values=values)
