"""Partial derivatives of the native FMU, in both of its uses, against complex steps through the model; dependencies."""

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest.mock import patch

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hovercraft_fmu.fmu.interface import BY_NAME, DERIVATIVES, ERRORS, INPUTS, STATES
from hovercraft_fmu.host import read_description
from hovercraft_fmu.model import dynamics
from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.dynamics import (
    Controls,
    State,
    body_velocity,
    load_function,
    sliding_load_function,
)
from tests.exchange import (
    INITIAL_KNOWNS,
    INITIAL_UNKNOWNS,
    KNOWNS,
    PARAMETERS,
    UNKNOWNS,
    go,
    jacobian,
    put_all,
    put_craft,
    put_states,
    rounded_controls,
    rounded_states,
    to_phase,
)
from tests.lowlevel import get, one, put, reference, start, worded
from tests.strategies import crafts, numbers, rubbing_crafts


@pytest.fixture(scope="module")
def shared(each_native_fmu: Path) -> Iterator[tuple[Any, list[str]]]:
    with one(each_native_fmu, exchange=True) as made:
        yield made


# ---- by complex steps


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


COMPLEX: dict[str, Any] = {
    "math": SimpleNamespace(cos=np.cos, sin=np.sin, sqrt=np.sqrt, log=np.log),
    "_clip": _clip,
    "max": lambda a, b: a if a.real > b else b,
}
"""What the model's functions take these numbers with."""
STEP = 1e-200  # its square is 0


def _model(values: dict[str, Any], drag_area: int) -> dict[str, Any]:
    """All that can be an unknown, by name, through the bare model; of states, inputs and parameters, by name."""
    craft = object.__new__(Craft)  # complex numbers would not come through its door
    vars(craft).update({name: values[name] for name in PARAMETERS}, drag_area=drag_area)
    state, held = State(*(values[name] for name in STATES)), Controls(*(values[name] for name in INPUTS))
    with patch.dict(vars(dynamics), COMPLEX):
        loads_at = (sliding_load_function if craft.rubs else load_function)(held, craft)
        x, y, moment, _ = loads_at(*state[2:])
        motion = (*body_velocity(state), np.sqrt(state.vx * state.vx + state.vy * state.vy))
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


def assert_close(found: NDArray[np.float64], expected: NDArray[np.float64]) -> None:
    scale = max(1.0, float(np.abs(expected).max()))
    assert np.abs(found - expected).max() <= 1e-11 * scale


@settings(max_examples=80)
@given(craft=crafts, state=rounded_states, held=rounded_controls)
def test_partial_derivatives_are_those_of_the_model(
    craft: Craft, state: State, held: Controls, shared: tuple[Any, list[str]]
) -> None:
    instance, _ = shared
    put_all(instance, craft, state, held)
    assert_close(jacobian(instance), by_complex_steps(state, held, craft))


@settings(max_examples=50)
@given(craft=st.one_of(crafts, rubbing_crafts), state=rounded_states, held=rounded_controls)
def test_partial_derivatives_in_co_simulation(craft: Craft, state: State, held: Controls, stepped: Any) -> None:
    """At a communication point, with the inputs that are set there: those of the step to come."""
    state = state._replace(vx=state.vx or 0.5)
    stepped.reset()
    put_craft(stepped, craft)
    values = {name.replace(".", "__"): value for name, value in zip(KNOWNS, (*state, *held), strict=True)}
    start(stepped, **values)
    put(stepped, thrust=3.0, port_thruster=0.25)
    assert_close(jacobian(stepped), by_complex_steps(state, held._replace(thrust=3.0, port=0.25), craft))


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


@settings(max_examples=50)
@given(craft=crafts, state=rounded_states, held=rounded_controls)
def test_partial_derivatives_in_initialization_mode(
    craft: Craft, state: State, held: Controls, shared: tuple[Any, list[str]]
) -> None:
    """Of parameters, too; friction, which is none here, can begin."""
    state = state._replace(vx=state.vx or 0.5)
    instance, _ = shared
    initialize(instance, state, held, craft)
    assert_initially_close(instance, state, held, craft)


@settings(max_examples=50)
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
    to_phase(instance, "initialization mode")
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
    with pytest.raises(FMICallException):
        instance.getDirectionalDerivative([reference("speed")], [999], [1.0])
    assert "known with value reference 999: must be a state, an input or" in messages[-1]
    assert partial(instance, "error.position", "mass") == 0.0  # nothing acts on it at once


def test_a_derivative_that_is_no_number_is_refused(instance: Any, messages: list[str]) -> None:
    """The acceleration is a number, F/m; its derivative, -F/m^2, is none."""
    put(instance, mass=1e-200, thrust=5.0)
    instance.setupExperiment()
    instance.enterInitializationMode()
    assert get(instance, "acceleration.x") == pytest.approx([5e200], rel=1e-15)
    with pytest.raises(FMICallException):
        partial(instance, "acceleration.x", "mass")
    message = "derivative of acceleration.x with respect to mass = -inf: must be a finite number; the motion is out of"
    assert messages[-1].startswith(message)


def test_parameters_that_contradict_one_another_have_none(stepped: Any) -> None:
    """In step mode they act from there on."""
    stepped.reset()
    start(stepped, thrust=5.0)
    put(stepped, thrust_min=20.0)
    with pytest.raises(FMICallException):
        partial(stepped, "acceleration.x", "thrust")
    put(stepped, thrust_min=0.0)
    assert partial(stepped, "acceleration.x", "thrust") == pytest.approx(1.0 / 100.0)


def test_partial_derivatives_after_a_step(stepped: Any) -> None:
    stepped.reset()
    start(stepped, thrust_min=-10.0)
    put(stepped, thrust=7.0, port_thruster=0.5, wind__x=0.3)
    stepped.doStep(0.0, 2.0)
    put(stepped, thrust=-20.0, wind__x=0.0)
    held = Controls(-20.0, 0.5, 0.0, 0.0)
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
    to_phase(instance, "initialization mode")
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
    held |= {"external__force__x": 2.0, "external__force__y": -3.0, "external__moment": 20.0}
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
        unknowns = [reference(name) for name in ("pose.x", "acceleration.yaw", "speed")]
        with pytest.raises(FMICallException):  # wherever it stands
            stepping.getDirectionalDerivative(unknowns, [reference("velocity.x")], [1.0])
        message = (
            "fmi2GetDirectionalDerivative: the craft is at rest on ground that rubs: it must slide to have partial "
            "derivatives"
        )
        assert said == [worded(stepping, message)] * 2
        assert partial(stepping, "speed", "velocity.x") == 0.0  # what friction does not act on has them
        for motion in ("velocity__x", "velocity__y", "velocity__yaw_rate"):  # it slides
            stepping.reset()
            start(stepping, skirt_friction=0.1, **{motion: 0.5})
            assert partial(stepping, "acceleration.x", "thrust") == pytest.approx(1.0 / 100.0)
        stepping.reset()
        put(stepping, skirt_friction=0.1)
        stepping.setupExperiment()
        stepping.enterInitializationMode()
        area, length = get(stepping, "projected_area", "length")
        assert partial(stepping, "projected_area", "length") == pytest.approx(
            area / (length + get(stepping, "width")[0])
        )


# ---- dependencies of the description


@pytest.fixture(scope="module")
def description(each_native_fmu: Path) -> Any:
    return read_description(each_native_fmu)


@pytest.mark.parametrize("use", ["outputs", "derivatives"])
def test_dependencies_are_where_partial_derivatives_are_not_zero(use: str, description: Any, instance: Any) -> None:
    """Over random motions: what is listed acts, what is not never does."""
    instance.setInteger([reference("drag_area")], [2])
    go(instance)
    dice = np.random.default_rng(1)
    unknowns = (*UNKNOWNS, *ERRORS)
    acts = np.zeros((len(unknowns), len(KNOWNS)), dtype=bool)
    for _ in range(20):
        put_states(instance, dice.normal(size=6))
        instance.setReal([reference(name) for name in INPUTS], [5.0, 0.5, 0.5, *dice.normal(size=5)])
        acts |= jacobian(instance, unknowns) != 0.0
    for unknown in getattr(description, use):
        listed = {variable.name for variable in unknown.dependencies} - set(TUNABLE)
        row = unknowns.index(unknown.variable.name)
        assert listed == {name for name, each in zip(KNOWNS, acts[row], strict=True) if each}, unknown.variable.name


TUNABLE = tuple(name for name in PARAMETERS if BY_NAME[name].variability == "tunable")


@pytest.mark.parametrize("standard", [3], indirect=True)
def test_the_tunable_parameters_are_knowns_of_fmi_3(description: Any, instance: Any, stepped: Any) -> None:
    """3.0, 2.2.12 and 2.4.8: in event mode and in step mode; their slopes are those of what is read, by central
    differences (errors of h^2 and of rounding), and listed is what acts.
    """
    rows = [reference(name) for name in DERIVATIVES[3:]]
    start(instance, wind__x=0.3, rotational_drag=0.5)
    dice = np.random.default_rng(2)
    acts: dict[str, set[str]] = {name: set() for name in DERIVATIVES}
    for thrust in (5.0, 99.0, -99.0):
        instance.setReal([reference(name) for name in STATES], dice.normal(size=6).tolist())
        put(instance, thrust=thrust, port_thruster=0.8)
        for known in TUNABLE:
            slopes = instance.getDirectionalDerivative(rows, [reference(known)], [1.0])
            acts = {
                name: acts[name] | ({known} if slope else set())
                for name, slope in zip(acts, [0.0] * 3 + slopes, strict=True)
            }
            if known == "skirt_friction":
                continue  # cannot be anything but 0 here
            (value,), ends = get(instance, known), []
            for h in (-1e-5, 1e-5):
                put(instance, **{known: value + h})
                ends.append(np.array(get(instance, *DERIVATIVES[3:])))
            put(instance, **{known: value})
            assert slopes == pytest.approx(list((ends[1] - ends[0]) / 2e-5), rel=1e-6, abs=1e-8)
    listed = {u.variable.name: {v.name for v in u.dependencies} & set(TUNABLE) for u in description.derivatives}
    assert listed == acts
    stepped.reset()
    start(stepped, velocity__x=2.0)
    stepped.doStep(0.0, 0.1)
    assert partial(stepped, "acceleration.x", "drag_coefficient") < -0.1
    with pytest.raises(FMICallException):
        partial(stepped, "acceleration.x", "mass")


def initially_read(instance: Any, values: dict[str, float], drag_area: int) -> list[float]:
    instance.reset()
    instance.setInteger([reference("drag_area")], [drag_area])
    instance.setReal([reference(name) for name in values], list(values.values()))
    instance.setupExperiment()
    instance.enterInitializationMode()
    return get(instance, *INITIAL_UNKNOWNS)


def test_initial_dependencies_are_where_partial_derivatives_are_not_zero(description: Any, stepped: Any) -> None:
    """Over random craft that slide; and, which has no derivatives, where one at rest begins to."""
    dice = np.random.default_rng(2)
    acts = {(unknown, known): False for unknown in INITIAL_UNKNOWNS for known in (*INITIAL_KNOWNS, "drag_area")}
    for i in range(20):
        varied = {name: getattr(Craft(), name) * dice.uniform(0.5, 1.0) for name in PARAMETERS}
        varied |= {"skirt_friction": 1e-4, "rotational_drag": dice.uniform(0.1, 0.8), "thrust_min": 1.0}
        craft = Craft(**varied, drag_area=1 + i % 2)
        state, held = State(*dice.normal(size=6)), Controls((0.0, 3.0, 20.0)[i % 3], 0.5, 0.3, *dice.normal(size=5))
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
        for unknown in (*INITIAL_UNKNOWNS, *ERRORS)
    }
