"""Model exchange of the native FMU: what may be called when, what is refused, what is read, what a state keeps."""

import math
import struct
from collections.abc import Callable, Iterator
from contextlib import suppress
from copy import copy
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from fmpy.fmi1 import FMICallException
from hypothesis import given, settings
from hypothesis import strategies as st

from hovercraft_fmu.fmu.interface import BY_NAME, DERIVATIVES, ERRORS, INPUT_HELD, INPUTS, MOTION, STATES, WATCHED
from hovercraft_fmu.host import read_description
from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.dynamics import (
    Controls,
    State,
    derivatives,
)
from hovercraft_fmu.model.observation import observe_action, observe_motion
from tests.blobs import SUBSTEPS, signed, with_word
from tests.conftest import FMI_2
from tests.exchange import (
    EVERYWHERE,
    KNOWNS,
    get_vector,
    go,
    jacobian,
    put_all,
    put_states,
    rounded_controls,
    rounded_states,
    to_phase,
)
from tests.lowlevel import (
    CONTINUOUS,
    INTEGERS,
    Instance3,
    count,
    everything,
    get,
    kept,
    one,
    put,
    reference,
    start,
    status_of_refusal,
    with_any_other_word,
    worded,
)
from tests.strategies import crafts, numbers
from tests.test_lifecycle import FAULTS

ERROR = 3


@pytest.fixture(scope="module")
def shared(each_native_fmu: Path) -> Iterator[tuple[Any, list[str]]]:
    with one(each_native_fmu, exchange=True) as made:
        yield made


# ---- phases


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
    to_phase(instance, phase)
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
STEPPING_FAULTS.append("output")  # a state may be set


@pytest.mark.parametrize("mode", ["event mode", "continuous-time mode"])
@pytest.mark.parametrize("name", [name for name in FAULTS if name not in STEPPING_FAULTS])
def test_a_fault_is_loud_and_loses_nothing(name: str, mode: str, instance: Any, messages: list[str]) -> None:
    """Those of co-simulation that are not about steps; tunable parameters are fixed in continuous-time mode."""
    fault, message = FAULTS[name]
    to_phase(instance, mode)
    put(instance, thrust=7.0, port_thruster=0.5)
    before = everything(instance)
    with pytest.raises(FMICallException) as caught:
        fault(instance)
    assert caught.value.status == status_of_refusal(instance, caught.value, messages[-1], exchange=True)
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
    assert caught.value.status == status_of_refusal(instance, caught.value, messages[-1], exchange=True)
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
        to_phase(instance, phase)
        with pytest.raises(FMICallException):
            put(instance, skirt_friction=0.008)
        assert messages[-1] == text + "smooth; use co-simulation"
        put(instance, skirt_friction=0.0)
        if phase != "instantiated":
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


@pytest.mark.parametrize("begin", [0.0, 1.7e9])
def test_the_solvers_time_is_told_wherever_it_starts(begin: float, instance: Any, messages: list[str]) -> None:
    """The rounding of a solver that adds up its time is none; a hundredth of a second is another time."""
    instance.setupExperiment(startTime=begin, stopTime=begin + 100.0)
    instance.enterInitializationMode()
    instance.exitInitializationMode()
    instance.enterContinuousTimeMode()
    with pytest.raises(FMICallException):
        instance.setTime(begin - 0.01)
    assert messages[-1] == f"time = {begin - 0.01!r} s: must not be before startTime = {begin!r} s"
    time = begin
    for _ in range(300):
        time += 1.0 / 3.0
        instance.setTime(time)
        instance.completedIntegratorStep()
    assert abs(time - begin - 100.0) < 1e-4
    instance.setTime(begin + 100.01)
    with pytest.raises(FMICallException):
        instance.completedIntegratorStep()
    assert "must not lead past stopTime" in messages[-1]


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


@settings(max_examples=100)
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


@pytest.mark.parametrize("phase", ["initialization mode", "event mode"])
def test_a_parameter_that_is_set_to_what_it_is_changes_nothing(phase: str, instance: Any) -> None:
    """Once the solver goes on, the state is the same, byte by byte."""
    states = []
    for again in (False, True):
        to_phase(instance, phase)
        if again:
            put(instance, air_density=Craft().air_density)
        if phase == "initialization mode":
            instance.exitInitializationMode()
        instance.enterContinuousTimeMode()
        states.append(bytes(instance.serializeFMUstate(instance.getFMUstate())))
    assert states[0] == states[1]


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


@settings(max_examples=60)
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
    to_phase(instance, phase)
    before, content = everything(instance), instance.serializeFMUstate(instance.getFMUstate())
    to_phase(instance, "continuous-time mode")
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


def test_a_state_with_any_other_word_is_refused_or_is_what_it_says(instance: Any) -> None:
    """None has friction, or an error estimate."""
    go(instance)
    with_any_other_word(instance)


PHASE = SUBSTEPS + 4 * len(INTEGERS) + 4
"""Where a state has it: behind the integers, and the use."""


def test_a_forged_phase_is_one_of_its_use(instance: Any, stepped: Any) -> None:
    """By their numbers: instantiated, initialization mode, step mode, terminated, event mode, continuous-time mode."""
    for each, possible in ((instance, {0, 1, 3, 4, 5}), (stepped, {0, 1, 2, 3})):
        each.reset()
        start(each)
        content = bytes(each.serializeFMUstate(each.getFMUstate()))
        taken = set()
        for phase in range(-1, 9):
            with suppress(FMICallException):
                each.freeFMUstate(each.deSerializeFMUstate(with_word(content, PHASE, phase % 2**32)))
                taken.add(phase)
        assert taken == possible


def test_a_forged_state_for_solvers_has_no_error_estimate(instance: Any, messages: list[str]) -> None:
    """The last that a state has is whether there is one, and then it has nine numbers."""
    go(instance)
    content = bytes(instance.serializeFMUstate(instance.getFMUstate()))
    assert content[-12:-8] == bytes(4)
    forged = signed(content[:-12] + struct.pack("<i9d", 1, *[0.0] * 9) + content[-8:])
    with pytest.raises(FMICallException):
        instance.deSerializeFMUstate(forged)
    assert messages == [f"serialized FMU state of {len(forged)} bytes: must be one that this FMU wrote"]


def test_a_forged_state_whose_parameters_contradict_one_another_goes_nowhere(
    instance: Any, messages: list[str]
) -> None:
    """In continuous-time mode, where no host could have set them."""
    to_phase(instance, "event mode")
    put(instance, thrust_min=20.0)
    content = bytes(instance.serializeFMUstate(instance.getFMUstate()))
    instance.setFMUstate(instance.deSerializeFMUstate(with_word(content, PHASE, 5)))
    with pytest.raises(FMICallException):
        instance.completedIntegratorStep()
    assert messages == ["thrust_min = 20.0 N: must not be above thrust_max = 10.0 N"]


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
    assert initial == {*MOTION, *DERIVATIVES[3:], *ERRORS, "projected_area"}


def test_a_derivative_follows_what_the_description_says_and_nothing_else(description: Any, instance: Any) -> None:
    """Of states and inputs those for which its partial derivative is another number than 0 somewhere."""
    followed: dict[str, set[str]] = {name: set() for name in DERIVATIVES}
    state = State(3.0, -2.0, 0.7, 2.0, -0.5, 0.1)
    asked = Controls(5.0, 0.3, 0.6, 0.2, -0.3, 1.0, 2.0, 3.0)
    for craft in (Craft(), Craft(drag_area=2, rotational_drag=0.4)):
        put_all(instance, craft, state, asked)
        for name, row in zip(DERIVATIVES, jacobian(instance, DERIVATIVES, KNOWNS), strict=True):
            followed[name] |= {known for known, slope in zip(KNOWNS, row, strict=True) if slope != 0.0}
    said = {each.variable.name: {known.name for known in each.dependencies} for each in description.derivatives}
    said = {name: known & {*KNOWNS} for name, known in said.items()}  # FMI 3.0 has tunable parameters there, too
    assert followed == said
