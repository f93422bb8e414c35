"""Co-simulation beyond what the Python FMU can do: ramps, derivatives, status, pointers, refused instances.

What both flavours must do is in test_lifecycle.py, model exchange in test_exchange.py and its neighbours."""

import math
import os
import struct
import subprocess
import sys
import zipfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from ctypes import CDLL, byref, c_bool, c_double, c_int, c_size_t, c_uint, c_void_p
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import extract, fmi2
from fmpy.fmi1 import FMICallException
from hypothesis import given, settings
from hypothesis import strategies as st

from hovercraft_fmu.fmu.description import NATIVE, NATIVE3, Flavour
from hovercraft_fmu.fmu.interface import INPUT_HELD, INPUTS, MOTION, STATES, STEP_UNSTABLE
from hovercraft_fmu.fmu.machine_code import C_FOLDER
from hovercraft_fmu.fmu.native_package import binary
from hovercraft_fmu.host import read_description
from hovercraft_fmu.simulation import holding, plan, run_fmu, run_model
from tests.blobs import MAGIC, signed, with_word
from tests.conftest import FMI_2, ROOT, Built
from tests.lowlevel import (
    Instance3,
    count,
    everything,
    get,
    named,
    one,
    put,
    reference,
    start,
    with_any_other_word,
    worded,
)
from tests.native import IN_TURN, STEPS, c_compiler
from tests.test_native_platforms import SANITIZERS

OK, WARNING, DISCARD, ERROR = 0, 1, 2, 3
OUTPUTS = (*STATES, *MOTION)
METHODS = {"semi_implicit_euler": 1, "drag_implicit": 2, "rk4": 3, "adaptive": 4, "splitting": 5}


@pytest.fixture(scope="module")
def shared(each_native_fmu: Path) -> Iterator[tuple[Any, list[str]]]:
    with one(each_native_fmu) as made:
        yield made


def ramp(instance: Any, **rates: float) -> None:
    instance.setRealInputDerivatives([reference(name) for name in rates], [1] * len(rates), list(rates.values()))


# ---- the model


@pytest.mark.parametrize(("name", "method"), IN_TURN.items())
def test_every_scene_is_close_to_the_bare_model(name: str, method: str, native_fmu: Path) -> None:
    """With one of the methods; more of them are in test_native_kernel.py."""
    run = holding(plan(name, start_values={"integrator": method, "step_size": STEPS[method]}))
    found, expected = run_fmu(run, native_fmu), run_model(run)
    assert found.warnings == ()
    assert np.array_equal(found["substeps"], expected["substeps"])
    for column in (*INPUTS, *OUTPUTS):
        gap = np.abs(found[column] - expected[column])
        assert (gap <= 1e-12 * np.maximum(1.0, np.abs(expected[column]))).all(), column


# ---- ramps


@FMI_2
@pytest.mark.parametrize("method", ["semi_implicit_euler", "drag_implicit"])
def test_a_ramp_is_many_small_steps(method: str, instance: Any) -> None:
    """First-order methods: to the bit as if the inputs were set anew at every sub-step."""
    ends = []
    for together in (True, False):
        instance.reset()
        instance.setInteger([reference("integrator")], [METHODS[method]])
        start(instance)
        put(instance, thrust=9.0, port_thruster=0.25)
        if together:
            ramp(instance, thrust=2.0, port_thruster=0.5, starboard_thruster=-0.1)
            instance.doStep(0.0, 1.0)
        else:
            for i in range(1000):
                t = i * 0.001
                put(instance, thrust=9.0 + t * 2.0, port_thruster=0.25 + t * 0.5, starboard_thruster=0.0 - t * 0.1)
                instance.doStep(t, 0.001)
        ends.append(get(instance, *STATES))
    assert ends[0] == ends[1]


@FMI_2
@pytest.mark.parametrize("method", METHODS)
def test_a_ramp_follows_a_fine_staircase(method: str, instance: Any) -> None:
    """A staircase of half-way values at 1 ms: the first-order methods lag half a sub-step behind it, 5e-5."""
    ends = []
    for steps in (4, 4000):
        instance.reset()
        instance.setInteger([reference("integrator")], [METHODS[method]])
        start(instance)
        for i in range(steps):
            t, h = i * 4.0 / steps, 4.0 / steps
            middle = t if steps == 4 else t + 0.5 * h
            put(instance, thrust=2.0 + middle, port_thruster=0.1 + 0.2 * middle)
            if steps == 4:
                ramp(instance, thrust=1.0, port_thruster=0.2)
            instance.doStep(t, h)
        ends.append(get(instance, *STATES))
    assert ends[0] == pytest.approx(ends[1], abs=1e-4 if METHODS[method] < 3 else 1e-6)
    assert ends[0] != ends[1]


@FMI_2
def test_a_ramp_goes_on_until_the_input_is_set_again(instance: Any) -> None:
    start(instance)
    put(instance, thrust=1.0)
    ramp(instance, thrust=2.0, port_thruster=0.125)
    instance.doStep(0.0, 1.0)
    assert get(instance, "applied.thrust", "applied.steering") == [3.0, 3.0 * 0.125]
    instance.doStep(1.0, 0.5)
    assert get(instance, "applied.thrust", "applied.steering") == [4.0, 3.0 * 0.1875]
    put(instance, thrust=4.0)
    instance.doStep(1.5, 1.0)
    assert get(instance, "applied.thrust", "applied.steering") == [4.0, 3.0 * 0.3125]
    ramp(instance, port_thruster=0.0)
    instance.doStep(2.5, 1.0)
    assert get(instance, "applied.steering") == [3.0 * 0.3125]


@FMI_2
def test_a_ramp_saturates_and_warns(instance: Any, messages: list[str]) -> None:
    start(instance)
    put(instance, thrust=9.0, drag_coefficient=0.0)
    ramp(instance, thrust=1.0)
    instance.doStep(0.0, 5.0)
    assert get(instance, "thrust", "applied.thrust") == [9.0, 10.0]
    assert get(instance, "velocity.x") == pytest.approx([(9.5 + 4 * 10.0) / 100.0], abs=1e-5)
    assert count(instance, "warnings") == INPUT_HELD
    assert messages == ["thrust = 14.0: is outside its limits and is held at 10.0 (said once)"]


@FMI_2
def test_ramps_are_part_of_the_state(instance: Any) -> None:
    start(instance)
    ramp(instance, thrust=0.5, port_thruster=0.1)
    instance.doStep(0.0, 1.0)
    content = bytes(instance.serializeFMUstate(instance.getFMUstate()))
    instance.doStep(1.0, 1.0)
    there = everything(instance)
    instance.reset()
    instance.setFMUstate(instance.deSerializeFMUstate(content))
    instance.doStep(1.0, 1.0)
    assert everything(instance) == there
    instance.reset()
    start(instance)
    instance.doStep(0.0, 1.0)
    assert get(instance, "thrust", "port_thruster") == [5.0, 0.0]


@FMI_2
def test_a_ramp_of_zero_changes_no_bit(instance: Any) -> None:
    """Without a ramp the bits are those of a step that never heard of one."""
    ends = []
    for rates in ({}, {"thrust": 0.0, "port_thruster": 0.0, "starboard_thruster": -0.0}):
        instance.reset()
        start(instance)
        put(instance, thrust=7.0, port_thruster=1.0)
        ramp(instance, **rates)
        instance.doStep(0.0, 3.0)
        ends.append(everything(instance))
    assert ends[0] == ends[1]


RAMP_FAULTS: dict[str, tuple[Callable[[Any], object], str]] = {
    "order": (
        lambda i: i.setRealInputDerivatives([0], [2], [1.0]),
        "order = 2 of the derivative of thrust: must be 1",
    ),
    "nan": (lambda i: ramp(i, thrust=math.nan), "derivative of thrust = nan: must be a finite number"),
    "no input": (lambda i: i.setRealInputDerivatives([3], [1], [1.0]), "value reference 3: must be that of an input"),
    "unknown": (
        lambda i: i.setRealInputDerivatives([2**32 - 1], [1], [1.0]),
        "value reference 4294967295: must be that of an input",
    ),
    "one bad of two": (
        lambda i: i.setRealInputDerivatives([0, 1], [1, 0], [1.0, 1.0]),
        "order = 0 of the derivative of port_thruster: must be 1",
    ),
    "output order": (
        lambda i: i.getRealOutputDerivatives([3], [0]),
        "order = 0 of the derivative of pose.x: must be 1",
    ),
    "no output": (
        lambda i: i.getRealOutputDerivatives([0], [1]),
        "value reference 0: must be that of a continuous output to have a derivative",
    ),
}


@FMI_2
@pytest.mark.parametrize("name", RAMP_FAULTS)
def test_faults_of_derivatives(name: str, instance: Any, messages: list[str]) -> None:
    fault, message = RAMP_FAULTS[name]
    start(instance)
    instance.doStep(0.0, 0.1)
    before = bytes(instance.serializeFMUstate(instance.getFMUstate()))
    with pytest.raises(FMICallException) as caught:
        fault(instance)
    assert caught.value.status == ERROR
    assert message in messages[-1]
    assert bytes(instance.serializeFMUstate(instance.getFMUstate())) == before


@FMI_2
def test_no_ramp_begins_after_the_end(instance: Any, messages: list[str]) -> None:
    start(instance)
    instance.terminate()
    with pytest.raises(FMICallException):
        ramp(instance, thrust=1.0)
    assert messages == ["thrust = 1.0: must not be set in state 'terminated' (continuous input)"]


@FMI_2
def test_a_ramp_without_end_is_refused_by_the_step(instance: Any, messages: list[str]) -> None:
    start(instance)
    ramp(instance, thrust=1.7e308)
    with pytest.raises(FMICallException) as caught:
        instance.doStep(0.0, 10.0)
    assert caught.value.status == DISCARD
    assert messages == ["input derivatives over 10.0 s: must lead to finite inputs"]
    put(instance, thrust=5.0)
    instance.doStep(0.0, 0.1)


# ---- derivatives of the outputs


def derivatives(instance: Any) -> list[float]:
    found = instance.getRealOutputDerivatives([reference(name) for name in OUTPUTS], [1] * len(OUTPUTS))
    return [float(value) for value in found]


def test_output_derivatives_are_the_slopes_of_the_outputs(instance: Any) -> None:
    """Against central differences of a run with RK4; errors of h^2 and of rounding."""
    h = 1e-3
    instance.setInteger([reference("integrator")], [METHODS["rk4"]])
    start(instance)
    put(instance, thrust=8.0, port_thruster=1.0)
    instance.doStep(0.0, 20.0 - h)
    before = get(instance, *OUTPUTS)
    instance.doStep(20.0 - h, h)
    found = derivatives(instance)
    instance.doStep(20.0, h)
    after = get(instance, *OUTPUTS)
    slopes = [(b - a) / (2.0 * h) for a, b in zip(before, after, strict=True)]
    assert found == pytest.approx(slopes, abs=2e-7)
    assert all(abs(slope) > 1e-4 for slope in slopes)


def test_output_derivatives_at_rest(instance: Any) -> None:
    """Speed can only grow there: its slope is that of the launch."""
    start(instance)
    assert derivatives(instance) == [0.0, 0.0, 0.0, 0.05, 0.0, 0.0, 0.05, 0.0, 0.05]


def test_an_output_derivative_that_is_no_number_is_refused(instance: Any, messages: list[str]) -> None:
    """The outputs themselves are all finite."""
    start(instance, velocity__y=1e120, velocity__yaw_rate=1e200, air_density=0.0)
    assert all(map(math.isfinite, get(instance, *OUTPUTS)))
    with pytest.raises(FMICallException):
        derivatives(instance)
    assert messages == ["derivative of body.surge = inf: must be a finite number; the motion is out of range"]


@pytest.mark.parametrize(
    ("values", "message"),
    [({"velocity__x": 1e200}, "speed = inf: "), ({"velocity__x": 1e100, "air_density": 1e200}, "force.x = -inf: ")],
)
def test_what_is_out_of_range_has_no_derivative_and_is_not_read(
    values: dict[str, float], message: str, instance: Any, messages: list[str]
) -> None:
    start(instance, **values)
    calls: tuple[Callable[[], object], ...] = (lambda: derivatives(instance), lambda: get(instance, "force.x"))
    for call in calls:
        with pytest.raises(FMICallException):
            call()
        assert messages.pop() == message + "must be a finite number; the motion is out of range"


# ---- status


def function(instance: Any, name: str) -> Any:
    """A function of the library as it is: fmpy's own checks its arguments, and raises."""
    found = getattr(CDLL(instance.dll._name), named(instance, name))
    found.restype = c_int
    return found


@FMI_2
def test_status_and_the_last_successful_time(instance: Any, messages: list[str]) -> None:
    start(instance, 2.0)
    status, time, number, text = c_int(-1), c_double(), c_int(-1), c_void_p()
    component = c_void_p(instance.component)

    def ask(call: str, kind: int, into: Any) -> int:
        return int(function(instance, call)(component, kind, byref(into)))

    assert (ask("fmi2GetRealStatus", 2, time), time.value) == (OK, 2.0)
    instance.doStep(2.0, 0.5)
    assert (ask("fmi2GetRealStatus", 2, time), time.value) == (OK, 2.5)
    assert (ask("fmi2GetStatus", 0, status), status.value) == (OK, OK)
    with pytest.raises(FMICallException):
        instance.doStep(2.5, -1.0)
    assert (ask("fmi2GetStatus", 0, status), status.value) == (OK, ERROR)
    with pytest.raises(FMICallException):
        instance.doStep(2.5, 1e300)
    assert (ask("fmi2GetStatus", 0, status), status.value) == (OK, DISCARD)
    assert (ask("fmi2GetRealStatus", 2, time), time.value) == (OK, 2.5)
    assert (ask("fmi2GetBooleanStatus", 3, number), number.value) == (OK, 0)
    # what is asked for while a step is pending, and what is no status of that type
    refused = [("fmi2GetStatus", 1, status), ("fmi2GetRealStatus", 0, time), ("fmi2GetBooleanStatus", 0, number)]
    refused += [("fmi2GetIntegerStatus", kind, number) for kind in range(4)]
    refused += [("fmi2GetStringStatus", kind, text) for kind in range(4)]
    assert {ask(*each) for each in refused} == {DISCARD}
    assert function(instance, "fmi2CancelStep")(component) == ERROR
    assert messages[-1] == "fmi2CancelStep: must be called while a step is pending; none ever is"


def status_of_step(instance: Any, point: float, step: float) -> int:
    """Of the function itself: fmpy keeps a warning to itself."""
    more = (
        [byref(made) for made in (c_bool(), c_bool(), c_bool(), c_double())] if isinstance(instance, Instance3) else []
    )
    arguments = c_void_p(instance.component), c_double(point), c_double(step), c_bool(True)
    return int(function(instance, "fmi2DoStep")(*arguments, *more))


def test_a_step_that_warns_says_so_and_goes_on(instance: Any, messages: list[str]) -> None:
    put(instance, velocity__x=100.0, step_size=0.05)
    start(instance)
    assert status_of_step(instance, 0.0, 0.05) == WARNING
    assert count(instance, "warnings") == STEP_UNSTABLE
    assert len(messages) == 1
    assert status_of_step(instance, 0.05, 0.05) == OK


def test_after_an_error_a_reset_or_a_state_sets_the_run_right(instance: Any) -> None:
    start(instance)
    instance.doStep(0.0, 0.1)
    state = instance.getFMUstate()
    there = everything(instance)
    for recover in (lambda: instance.setFMUstate(state), instance.reset):
        put(instance, air_density=1e300)
        with pytest.raises(FMICallException) as caught:
            instance.doStep(5.0, 0.1)
        assert caught.value.status == ERROR
        recover()
    start(instance)
    instance.doStep(0.0, 0.1)
    assert everything(instance) == there


# ---- pointers


def test_a_saved_state_may_be_saved_into_again(instance: Any) -> None:
    start(instance)
    state = instance.getFMUstate()
    instance.doStep(0.0, 0.1)
    there = everything(instance)
    assert function(instance, "fmi2GetFMUstate")(c_void_p(instance.component), byref(state)) == OK
    instance.doStep(0.1, 0.1)
    instance.setFMUstate(state)
    assert everything(instance) == there
    instance.freeFMUstate(state)
    assert not state
    assert function(instance, "fmi2FreeFMUstate")(c_void_p(instance.component), byref(state)) == OK


def test_a_buffer_that_is_too_small_is_refused(instance: Any, messages: list[str]) -> None:
    start(instance)
    state = instance.getFMUstate()
    size = len(bytes(instance.serializeFMUstate(state)))
    buffer = (c_int * size)()
    serialize = function(instance, "fmi2SerializeFMUstate")
    assert serialize(c_void_p(instance.component), state, buffer, c_size_t(size - 1)) == ERROR
    assert messages[-1] == worded(instance, f"fmi2SerializeFMUstate: size = {size - 1}: must be {size} bytes")
    instance.freeFMUstate(state)


CALLS = {
    "fmi2GetReal": 4, "fmi2GetInteger": 4, "fmi2GetBoolean": 4, "fmi2GetString": 4,
    "fmi2SetReal": 4, "fmi2SetInteger": 4, "fmi2SetBoolean": 4, "fmi2SetString": 4,
    "fmi2GetFMUstate": 2, "fmi2SetFMUstate": 2, "fmi2SerializedFMUstateSize": 3, "fmi2SerializeFMUstate": 4,
    "fmi2DeSerializeFMUstate": 4, "fmi2SetRealInputDerivatives": 5, "fmi2GetRealOutputDerivatives": 5,
    "fmi2GetStatus": 3, "fmi2GetRealStatus": 3, "fmi2GetIntegerStatus": 3, "fmi2GetBooleanStatus": 3,
    "fmi2GetStringStatus": 3, "fmi2GetDirectionalDerivative": 7, "fmi2SetDebugLogging": 4,
    "fmi2NewDiscreteStates": 2, "fmi2CompletedIntegratorStep": 4, "fmi2SetContinuousStates": 3,
    "fmi2GetContinuousStates": 3, "fmi2GetDerivatives": 3, "fmi2GetNominalsOfContinuousStates": 3,
}  # fmt: skip
"""Number of arguments of every call that takes pointers."""
ONLY_AN_INSTANCE = ("fmi2EnterInitializationMode", "fmi2ExitInitializationMode", "fmi2Terminate", "fmi2Reset",
                    "fmi2CancelStep", "fmi2FreeFMUstate", "fmi2EnterEventMode",
                    "fmi2EnterContinuousTimeMode", "fmi2GetEventIndicators")  # fmt: skip


def test_a_state_with_any_other_word_is_refused_or_is_what_it_says(instance: Any) -> None:
    """Whoever can work out a checksum may write numbers that cannot be."""
    start(instance)
    with_any_other_word(instance)


def one_missing(arguments: list[Any]) -> Iterator[list[Any]]:
    """Those of a call that are NULL are there, but for one."""
    pointers = [i for i, each in enumerate(arguments) if isinstance(each, c_void_p)]
    for missing in pointers:
        yield [(c_double * 64)() if i in pointers and i != missing else each for i, each in enumerate(arguments)]


@FMI_2
@pytest.mark.parametrize("name", CALLS)
def test_null_arguments_are_refused(name: str, instance: Any, messages: list[str]) -> None:
    start(instance)
    before = everything(instance)
    call = function(instance, name)
    # a length of 1 where there is one: the third argument, or the third of the logging's
    rest: list[Any] = [c_size_t(1) if k == 1 else c_void_p(None) for k in range(CALLS[name] - 1)]
    if name.endswith("Status") or name in ("fmi2SerializedFMUstateSize",):
        rest = [c_int(0), c_void_p(None)]
    elif name == "fmi2SetDebugLogging":
        rest = [c_int(1), c_size_t(1), c_void_p(None)]
    elif name.endswith(("ContinuousStates", "Derivatives")) and CALLS[name] == 3:
        rest = [c_void_p(None), c_size_t(6)]
    elif name == "fmi2CompletedIntegratorStep":
        rest[:2] = [c_int(1), c_void_p(None)]
    elif name == "fmi2SerializeFMUstate":
        rest[1:] = [c_void_p(None), c_size_t(1)]
    elif name == "fmi2GetDirectionalDerivative":
        rest[3] = c_size_t(1)
    for arguments in (rest, *one_missing(rest)):
        assert call(c_void_p(instance.component), *arguments) == ERROR
        assert messages[-1].startswith((f"{name}: ", "value reference "))
    assert call(c_void_p(None), *rest) == ERROR
    assert everything(instance) == before


@FMI_2
def test_a_null_instance_is_refused(instance: Any) -> None:
    for name in ONLY_AN_INSTANCE:
        assert function(instance, name)(c_void_p(None), c_void_p(None)) == ERROR
    assert function(instance, "fmi2DoStep")(c_void_p(None), c_double(0.0), c_double(0.1), 1) == ERROR
    assert function(instance, "fmi2SetTime")(c_void_p(None), c_double(0.0)) == ERROR
    arguments = (0, c_double(0.0), c_double(0.0), 0, c_double(0.0))
    assert function(instance, "fmi2SetupExperiment")(c_void_p(None), *arguments) == ERROR
    instance.dll.fmi2FreeInstance(c_void_p(None))


@FMI_2
def test_empty_lists_are_fine(instance: Any) -> None:
    start(instance)
    for name in ("Real", "Integer", "Boolean", "String"):
        for call in (f"fmi2Get{name}", f"fmi2Set{name}"):
            assert function(instance, call)(c_void_p(instance.component), None, c_size_t(0), None) == OK


@settings(max_examples=200)
@given(offset=st.integers(44, 400), word=st.integers(0, 2**32 - 1))
def test_a_forged_state_cannot_break_the_instance(offset: int, word: int, shared: tuple[Any, list[str]]) -> None:
    """Any four bytes, with the right checksum: refused, or taken, and then the next calls answer."""
    instance, _ = shared
    instance.reset()
    start(instance)
    instance.doStep(0.0, 0.01)
    blob = bytes(instance.serializeFMUstate(instance.getFMUstate()))
    forged = with_word(blob, min(offset, len(blob) - 12), word)
    try:
        state = instance.deSerializeFMUstate(forged)
    except FMICallException:
        return
    instance.setFMUstate(state)
    instance.freeFMUstate(state)
    for call in (lambda: everything(instance), lambda: instance.doStep(0.01, 1e-3), lambda: derivatives(instance)):
        with suppress(FMICallException):
            call()
    instance.reset()
    start(instance)


def test_a_state_of_another_layout_is_refused(instance: Any, messages: list[str]) -> None:
    content = bytes(instance.serializeFMUstate(instance.getFMUstate()))
    with pytest.raises(FMICallException):
        instance.deSerializeFMUstate(with_word(content, len(MAGIC), 6))
    assert "must be a state of this build" in messages[-1]


@pytest.mark.parametrize("step_size", [-1e-300, -1.0, 0.0, math.nan])
def test_a_forged_sub_step_is_refused(step_size: float, instance: Any, messages: list[str]) -> None:
    """Their number would not be one that an integer holds: undefined in C."""
    start(instance)
    instance.doStep(0.0, 0.01)
    blob = bytes(instance.serializeFMUstate(instance.getFMUstate()))
    kept, forged = struct.pack("<d", 0.001), struct.pack("<d", step_size)
    places = [i for i in range(len(blob) - 8) if blob[i : i + 8] == kept]
    assert len(places) == 2  # the parameter, and what the run took up of it
    for place in places:
        with pytest.raises(FMICallException):
            instance.deSerializeFMUstate(signed(blob[:place] + forged + blob[place + 8 :]))
        assert messages[-1] == f"serialized FMU state of {len(blob)} bytes: must be one that this FMU wrote"


# ---- instances, logging


@pytest.fixture(scope="module")
def loaded(native_fmu: Path, tmp_path_factory: pytest.TempPathFactory) -> Any:
    """The library of the FMU, without fmpy around it."""
    if sys.platform != "linux" or os.uname().machine != "x86_64":
        pytest.skip("not x86-64 Linux")
    folder = tmp_path_factory.mktemp("library")
    extract(str(native_fmu), unzipdir=str(folder))
    found = CDLL(str(folder / "binaries" / binary("x86_64-linux", NATIVE)))
    found.fmi2Instantiate.restype = c_void_p
    return found


@pytest.fixture(scope="module")
def guid(native_fmu: Path) -> bytes:
    return str(read_description(native_fmu).guid).encode()


class Callbacks:
    """What an instance says, as (status, category, message)."""

    def __init__(self) -> None:
        self.said: list[tuple[int, str, str]] = []
        self.made = fmi2.fmi2CallbackFunctions()
        self.made.logger = fmi2.fmi2CallbackLoggerTYPE(self._log)

    def _log(self, _environment: Any, _name: bytes, status: int, category: bytes, message: bytes) -> None:
        self.said.append((status, category.decode(), message.decode()))


def test_an_instance_that_cannot_be_is_refused_with_a_word(loaded: Any, guid: bytes) -> None:
    callbacks = Callbacks()
    foreign = b"{%s%n%d\xff#r1#}"
    assert loaded.fmi2Instantiate(b"a", 1, foreign, b"", byref(callbacks.made), 0, 0) is None
    assert loaded.fmi2Instantiate(b"a", 1, None, b"", byref(callbacks.made), 0, 0) is None
    assert loaded.fmi2Instantiate(b"a", 2, guid, b"", byref(callbacks.made), 0, 0) is None
    text = f"must be '{guid.decode()}', as in modelDescription.xml"
    assert callbacks.said == [
        (ERROR, "logStatusError", f"fmuGUID = '{{?s?n?d??r1?}}': {text}"),
        (ERROR, "logStatusError", f"fmuGUID = 'NULL': {text}"),
        (ERROR, "logStatusError", "fmuType = 2: must be fmi2ModelExchange, 0, or fmi2CoSimulation, 1"),
    ]
    assert loaded.fmi2Instantiate(b"a", 1, foreign, b"", None, 0, 0) is None


def test_an_instance_lives_without_callbacks(loaded: Any, guid: bytes) -> None:
    for callbacks in (None, byref(fmi2.fmi2CallbackFunctions())):
        for name in (b"a", b"", None):
            made = c_void_p(loaded.fmi2Instantiate(name, 1, guid, None, callbacks, 0, 1))
            assert made
            assert loaded.fmi2SetupExperiment(made, 0, c_double(0.0), c_double(0.0), 0, c_double(0.0)) == OK
            assert loaded.fmi2EnterInitializationMode(made) == OK
            assert loaded.fmi2DoStep(made, c_double(0.0), c_double(0.1), 1) == ERROR
            assert loaded.fmi2ExitInitializationMode(made) == OK
            assert loaded.fmi2DoStep(made, c_double(0.0), c_double(0.1), 1) == OK
            loaded.fmi2FreeInstance(made)


def test_the_hosts_memory_is_not_asked_for(loaded: Any, guid: bytes) -> None:
    """canNotUseMemoryManagementFunctions: a host whose functions give nothing has an instance, and states."""
    callbacks = fmi2.fmi2CallbackFunctions()
    callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(lambda _n, _size: 0)
    callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(lambda _address: None)
    made = c_void_p(loaded.fmi2Instantiate(b"a", 1, guid, None, byref(callbacks), 0, 1))
    assert made
    state = c_void_p()
    assert loaded.fmi2GetFMUstate(made, byref(state)) == OK
    assert loaded.fmi2FreeFMUstate(made, byref(state)) == OK
    loaded.fmi2FreeInstance(made)


def test_what_is_logged(loaded: Any, guid: bytes) -> None:
    """Errors always, until the host says otherwise; warnings where logging is on; by category where it asks."""
    callbacks = Callbacks()
    made = c_void_p(loaded.fmi2Instantiate(b"a", 1, guid, None, byref(callbacks.made), 0, 0))

    def told() -> list[int]:
        """After a reset: a step that warns, and one that is refused."""
        callbacks.said.clear()
        assert loaded.fmi2Reset(made) == OK
        assert loaded.fmi2SetReal(made, byref(c_uint(0)), c_size_t(1), byref(c_double(99.0))) == OK
        assert loaded.fmi2EnterInitializationMode(made) == OK
        assert loaded.fmi2ExitInitializationMode(made) == OK
        assert loaded.fmi2DoStep(made, c_double(0.0), c_double(0.1), 1) == WARNING
        assert loaded.fmi2DoStep(made, c_double(5.0), c_double(0.1), 1) == ERROR
        return [status for status, _, _ in callbacks.said]

    def choose(on: int, *names: bytes) -> int:
        listed = (fmi2.fmi2String * max(1, len(names)))(*names)
        return int(loaded.fmi2SetDebugLogging(made, on, c_size_t(len(names)), listed))

    assert told() == [ERROR]
    assert choose(1) == OK
    assert told() == [WARNING, ERROR]
    assert choose(0, b"logStatusWarning") == OK
    assert told() == [ERROR]
    assert choose(0) == OK
    assert told() == []
    assert choose(1, b"logAll") == OK
    assert told() == [WARNING, ERROR]
    assert choose(1, b"logStatusError") == OK  # the standard: then only these
    assert told() == [ERROR]
    assert choose(1, b"logStatusWarning") == OK
    assert told() == [WARNING]
    assert choose(0, b"logStatusError") == OK
    assert told() == [WARNING]
    assert choose(1, b"logStatusWarning", b"logStatusError") == OK
    assert told() == [WARNING, ERROR]
    assert choose(1, b"logStatusWarning", b"log%s") == ERROR
    names = "logStatusWarning, logStatusDiscard, logStatusError, logAll"
    assert callbacks.said[-1][2] == f"log category 'log?s': must be one of {names}"
    loaded.fmi2FreeInstance(made)


def test_versions(loaded: Any) -> None:
    loaded.fmi2GetVersion.restype = loaded.fmi2GetTypesPlatform.restype = fmi2.fmi2String
    assert (loaded.fmi2GetVersion(), loaded.fmi2GetTypesPlatform()) == (b"2.0", b"default")


# ---- sanitized


def sanitized(path: Path, fmu: Path, flavour: Flavour, folder: Path) -> Path:
    """The FMU with a library for this machine that watches memory and undefined behaviour."""
    with zipfile.ZipFile(fmu) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    for name, content in files.items():
        if name.startswith("sources/"):
            (folder / Path(name).name).write_bytes(content)
    command = [c_compiler(), "-std=c11", "-ffp-contract=off", *SANITIZERS["address"], "-shared", "-fPIC"]
    headers = ("-I", str(C_FOLDER / f"fmi{flavour.fmi}"), f"-DFMI{flavour.fmi}_OVERRIDE_FUNCTION_PREFIX")
    subprocess.run([*command, *headers, flavour.unit, "-o", "x.so"], cwd=folder, check=True)
    files[f"binaries/{binary('x86_64-linux', flavour)}"] = (folder / "x.so").read_bytes()
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return path


@pytest.fixture(scope="module")
def sanitized_fmus(
    native_fmu: Path, native3_fmu: Path, built: Built, tmp_path_factory: pytest.TempPathFactory
) -> list[Path]:
    """Those of FMI 2.0 and of FMI 3.0."""
    makers = [
        partial(sanitized, fmu=fmu, flavour=flavour, folder=tmp_path_factory.mktemp("sanitized"))
        for fmu, flavour in ((native_fmu, NATIVE), (native3_fmu, NATIVE3))
    ]
    return [built(f"Sanitized{number}.fmu", make) for number, make in enumerate(makers)]


@pytest.mark.once
def test_clean_under_sanitizers_over_the_life_cycle(sanitized_fmus: list[Path]) -> None:
    """The tests of calls again, on the sanitized libraries. Random calls are the fuzzer's, scenes the other tests'."""
    if os.environ.get("NATIVE_FMU"):
        pytest.skip("this is that run")
    runtime = [
        subprocess.run(
            [c_compiler(), f"-print-file-name={name}"], capture_output=True, text=True, check=True
        ).stdout.strip()
        for name in ("libasan.so", "libubsan.so")
    ]
    two, three = map(str, sanitized_fmus)
    # a run of its own, which shares no folder with this one's workers
    alone = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_XDIST")}
    env = {**alone, "NATIVE_FMU": two, "NATIVE3_FMU": three, "LD_PRELOAD": ":".join(runtime), "CI": "",
           "PYTHONMALLOC": "malloc", "ASAN_OPTIONS": "detect_leaks=0:abort_on_error=0"}  # fmt: skip
    files = [f"tests/test_{each}.py" for each in ("lifecycle", "native", "exchange", "partial_derivatives", "fmi3")]
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--assert=plain", *files,
               "-k", "not python and not sanitize and not other_hosts and not bits_of_fmi_2 and not scene"
               " and not given_back",  # the sanitizer keeps it for a while, to see who uses it
               "-m", "not hypothesis"]  # fmt: skip
    done = subprocess.run(command, cwd=ROOT, env=env, capture_output=True, text=True, check=False, timeout=900)
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    assert " failed" not in done.stdout
    assert int(done.stdout.rsplit("\n", 2)[-2].split(" passed")[0].split()[-1]) > 300


def test_the_sanitized_library_would_tell(sanitized_fmus: list[Path], tmp_path: Path) -> None:
    """A test of the test: one byte read behind a state that is too short is found."""
    code = """
import ctypes, sys
library = ctypes.CDLL(sys.argv[1])
library.fmi2Instantiate.restype = ctypes.c_void_p
made = ctypes.c_void_p(library.fmi2Instantiate(b"a", 1, sys.argv[2].encode(), None, None, 0, 0))
libc = ctypes.CDLL(None)
libc.calloc.restype = ctypes.c_void_p
print(library.fmi2SetFMUstate(made, ctypes.c_void_p(libc.calloc(1, 16))))
"""
    extract(str(sanitized_fmus[0]), unzipdir=str(tmp_path))
    found = tmp_path / "binaries" / binary("x86_64-linux", NATIVE)
    runtime = subprocess.run([c_compiler(), "-print-file-name=libasan.so"], capture_output=True, text=True, check=True)
    env = {**os.environ, "LD_PRELOAD": runtime.stdout.strip(), "ASAN_OPTIONS": "detect_leaks=0"}
    command = [sys.executable, "-c", code, str(found), str(read_description(sanitized_fmus[0]).guid)]
    done = subprocess.run(command, env=env, capture_output=True, text=True, check=False)
    assert done.returncode != 0
    assert "ERROR: AddressSanitizer" in done.stderr
    assert "fmi2SetFMUstate" in done.stderr
