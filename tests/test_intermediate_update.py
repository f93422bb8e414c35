"""Inputs inside a step, of FMI 3.0: where the FMU asks for them, what it makes of them, what else may be called there.

In brackets the sections of FMI 3.0.2.
"""

import itertools
import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import fmpy
import pytest
from fmpy import fmi3
from fmpy.fmi1 import FMICallException

from hovercraft_fmu.fmu.description import NATIVE3
from hovercraft_fmu.fmu.interface import BY_NAME, INPUTS, STATES
from hovercraft_fmu.host import Fmu, Intermediate, SimulationError
from tests.test_fmi3 import TERMS
from tests.test_native import METHODS

Inputs = Callable[[float], Sequence[float]]
STEP = 0.5
"""s, of communication"""
STEERED = ("thrust", "port_thruster", "wind.y", "external.force.x")


def steered(time: float) -> list[float]:
    helm = [5.0 + 2.0 * math.sin(time), 0.5 + 0.5 * math.sin(0.7 * time)]
    return [*helm, 0.3 * math.cos(0.3 * time), math.cos(time)]


def sailed(opened: Fmu, start: dict[str, Any], asked: Inputs | None, held: Inputs | None, step: float) -> list[float]:
    """The state after 4 s, with STEERED as they are when the FMU asks, or as they are when a step begins."""
    with opened.instance(intermediate=Intermediate(STEERED, asked) if asked else None) as craft:
        craft.start(start)
        inputs = craft.port(*STEERED)
        for k in range(round(4.0 / step)):
            if held:
                inputs.set(held(k * step))
            craft.step(k * step, step)
        return craft.port(*STATES).get()


@pytest.fixture(scope="module")
def opened(native3_fmu: Path) -> Any:
    with Fmu(native3_fmu) as fmu:
        yield fmu


def test_a_sine_on_the_thrust_is_followed(opened: Fmu) -> None:
    """RK4, 60 s: held over steps of 0.5 and 0.1 s it is 9.9e-3 and 1.7e-3 m off, asked for at most 1e-5 m."""
    ends: dict[tuple[float, bool], float] = {}
    for step, is_asked in ((0.01, True), (0.5, False), (0.1, False), (0.5, True), (0.1, True)):
        asked = Intermediate(["thrust"], lambda t: steered(t)[:1]) if is_asked else None
        with opened.instance(intermediate=asked) as craft:
            craft.start({"integrator": "rk4", "step_size": min(step, 0.05)})
            thrust = craft.port("thrust")
            for k in range(round(60.0 / step)):
                if not is_asked:
                    thrust.set(steered(k * step)[:1])
                craft.step(k * step, step)
            ends[step, is_asked] = craft.port("pose.x").get()[0]
    error = {key: abs(end - ends[0.01, True]) for key, end in ends.items()}
    print({key: f"{value:.1e} m" for key, value in error.items()})
    assert 8e-3 < error[0.5, False] < 12e-3
    assert 1e-3 < error[0.1, False] < 2e-3
    assert max(error[0.5, True], error[0.1, True]) < 1e-5


@pytest.mark.parametrize("term", TERMS)
def test_first_order_methods_have_the_bits_of_many_small_steps(term: str, opened: Fmu) -> None:
    """They ask at the start of each sub-step: to the bit as if the inputs were set there between two steps."""
    for method in ("semi_implicit_euler", "drag_implicit"):
        start = {"integrator": method, "step_size": 0.125, **TERMS[term]}
        assert sailed(opened, start, steered, None, STEP) == sailed(opened, start, None, steered, 0.125), method


@pytest.mark.parametrize("term", TERMS)
def test_methods_of_higher_order_follow_the_inputs(term: str, opened: Fmu) -> None:
    """Against RK4 with a tenth of the sub-step: held, they are some 1e-2 off. Near rest friction is of first order."""
    fine = sailed(opened, {"integrator": "rk4", "step_size": 0.005, **TERMS[term]}, steered, None, STEP)
    for method in ("rk4", "adaptive"):
        start = {"integrator": method, "step_size": 0.05, "tolerance": 1e-9, **TERMS[term]}
        followed, held = sailed(opened, start, steered, None, STEP), sailed(opened, start, None, steered, STEP)
        assert followed == pytest.approx(fine, abs=1e-3 if term == "friction" else 1e-6)
        assert held != pytest.approx(fine, abs=5e-3)


@pytest.mark.parametrize("term", TERMS)
def test_a_host_that_sets_nothing_changes_no_bit(term: str, opened: Fmu) -> None:
    for method in METHODS:
        start = {"integrator": method, "step_size": 0.05, **TERMS[term]}
        expected = sailed(opened, start, None, lambda _: [8.0, 0.3, 0.0, 0.0], STEP)
        with opened.instance(intermediate=Intermediate((), lambda _: ())) as craft:
            craft.start(start | {"thrust": 8.0, "port_thruster": 0.3, "wind.y": 0.0, "external.force.x": 0.0})
            for k in range(8):
                craft.step(k * STEP, STEP)
            assert craft.port(*STATES).get() == expected, method


def test_an_error_estimate_follows_the_inputs_too(opened: Fmu) -> None:
    """Its companion asks for itself: not a bit of the path changes, and with right inputs RK4 is told to be right."""
    start: dict[str, float | str] = {"integrator": "rk4", "step_size": 0.125}
    expected = sailed(opened, start, steered, None, STEP)
    with opened.instance(intermediate=Intermediate(STEERED, steered)) as craft:
        craft.start(start | {"error_estimate": "on"})
        for k in range(round(4.0 / STEP)):
            craft.step(k * STEP, STEP)
        assert craft.port(*STATES).get() == expected
        assert 0.0 < craft.port("error.position").get()[0] < 1e-5


def times_asked(opened: Fmu, method: str, yaw_rate: float = 0.0) -> list[float]:
    """In a step of STEP from 100 s."""
    times: list[float] = []

    def values(time: float) -> Sequence[float]:
        times.append(time)
        return steered(time)

    with opened.instance(intermediate=Intermediate(STEERED, values)) as craft:
        craft.start({"integrator": method, "step_size": 0.125, "velocity.yaw_rate": yaw_rate}, 100.0)
        craft.step(100.0, STEP)
    return times


def test_it_asks_where_it_works_out_the_loads(opened: Fmu) -> None:
    """At the start of each sub-step, in RK4 in its middle too, each time once; and at the communication point."""
    quarters = [100.0 + k * 0.125 for k in range(5)]
    assert times_asked(opened, "semi_implicit_euler") == quarters
    assert times_asked(opened, "drag_implicit") == quarters
    assert times_asked(opened, "rk4") == [100.0 + k * 0.0625 for k in range(9)]


def test_an_adaptive_step_that_is_tried_again_asks_again(opened: Fmu) -> None:
    """[2.2.10] As long as no intermediate step is told to be finished it may go back in time; never out of the step."""
    times = times_asked(opened, "adaptive", 20.0)
    assert min(times) == times[0] == 100.0
    assert max(times) == times[-1] == 100.0 + STEP
    assert any(later < before for before, later in itertools.pairwise(times))


def test_it_asks_of_no_time_after_the_end_where_a_double_hardly_tells_them(opened: Fmu) -> None:
    """Doubles are 0.24 us apart there, and sub-steps 0.1 us: the last of them end where the step does."""
    begin, step = 1.7e9, 1e-6
    times: list[float] = []

    def values(time: float) -> Sequence[float]:
        times.append(time)
        return [5.0]

    with opened.instance(intermediate=Intermediate(["thrust"], values)) as craft:
        craft.start({"integrator": "rk4", "step_size": 1e-7}, start_time=begin)
        craft.step(begin, step)
    assert begin == times[0] < begin + step == times[-1] == times[-2]
    assert times == sorted(times)


def test_what_is_read_at_the_communication_point_follows_the_last_answer(opened: Fmu) -> None:
    with opened.instance(intermediate=Intermediate(STEERED, steered)) as craft:
        craft.start()
        craft.step(0.0, STEP)
        assert craft.port("applied.thrust", *STEERED).get() == [steered(STEP)[0], *steered(STEP)]
        assert craft.messages == []


def test_an_input_that_is_out_of_its_limits_inside_a_step_is_told(opened: Fmu) -> None:
    with opened.instance(intermediate=Intermediate(["thrust"], lambda t: [11.0 if 0.2 < t < 0.3 else 5.0])) as craft:
        craft.start({"integrator": "rk4", "step_size": 0.1})
        craft.step(0.0, STEP)
        assert craft.messages == ["thrust = 11.0: is outside its limits and is held at 10.0 (said once)"]


def test_a_refused_value_refuses_the_step_and_nothing_is_lost(opened: Fmu) -> None:
    wrong = {"from": 0.7}
    with opened.instance(
        intermediate=Intermediate(["thrust"], lambda t: [math.nan if t > wrong["from"] else 5.0 + t])
    ) as craft:
        craft.start({"integrator": "rk4", "step_size": 0.1})
        craft.step(0.0, STEP)
        before = craft.save()
        with pytest.raises(SimulationError, match="thrust = nan: must be a finite number"):
            craft.step(STEP, STEP)
        assert any("a call inside it was refused; the state of 0.5 s stands" in each for each in craft.messages)
        after = craft.save()
        assert craft.bytes_of(after) == craft.bytes_of(before)
        wrong["from"] = math.inf
        craft.step(STEP, STEP)
        for state in (before, after):
            craft.forget(state)


def test_a_step_that_was_discarded_may_be_tried_again_as_it_was(opened: Fmu) -> None:
    """The host may answer otherwise."""
    force = [1e308]
    with opened.instance(intermediate=Intermediate(["external.force.x"], lambda _: force)) as craft:
        craft.start()
        for _ in range(2):
            with pytest.raises(SimulationError, match="must not drive the craft so fast"):
                craft.step(0.0, STEP)
        force[0] = 0.0
        craft.step(0.0, STEP)


def test_what_the_host_raises_the_step_raises(opened: Fmu) -> None:
    def values(time: float) -> Sequence[float]:
        raise LookupError(f"nothing is known of {time} s")

    with opened.instance(intermediate=Intermediate(["thrust"], values)) as craft:
        craft.start()
        with pytest.raises(LookupError, match=r"nothing is known of 0\.0 s"):
            craft.step(0.0, STEP)


@pytest.mark.parametrize("name", ["mass", "speed", "substeps", "integrator"])
def test_other_variables_are_refused(name: str, opened: Fmu) -> None:
    with pytest.raises(SimulationError, match="requiredIntermediateVariables must be inputs"):
        opened.instance(intermediate=Intermediate([name], lambda _: [1.0]))


def test_no_other_fmu_takes_them(opened: Fmu, native_fmu: Path) -> None:
    given, refused = Intermediate(["thrust"], lambda _: [1.0]), r"must be an FMU of FMI 3\.0 for co-simulation"
    with pytest.raises(ValueError, match=refused):
        opened.instance(exchange=True, intermediate=given)
    with Fmu(native_fmu) as fmu, pytest.raises(ValueError, match=refused):
        fmu.instance(intermediate=given)


def through_fmpy(native3_fmu: Path, folder: Path, update: Callable[..., None]) -> fmi3.FMU3Slave:
    """Stepped once."""
    fmpy.extract(native3_fmu, unzipdir=folder)
    slave = fmi3.FMU3Slave(
        guid=fmpy.read_model_description(native3_fmu).guid,
        unzipDirectory=str(folder),
        modelIdentifier=NATIVE3.identifier,
        instanceName="craft",
    )
    slave.instantiate(
        logMessage=lambda *_: None,
        intermediateUpdate=lambda *args: update(slave, *args),
        requiredIntermediateVariables=[BY_NAME[name].reference for name in INPUTS],
    )
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    return slave


def test_the_flags_of_the_callback(native3_fmu: Path, tmp_path: Path) -> None:
    """[4.2.2] Inputs are requested; nothing is to be read, no step is told to be finished, none returns early."""
    flags = set()

    def update(slave: Any, _environment: Any, time: float, *others: Any) -> None:
        flags.add(others[:4])
        slave.setFloat64([BY_NAME["thrust"].reference], [1.0 + time])

    slave = through_fmpy(native3_fmu, tmp_path, update)
    try:
        slave.doStep(0.0, STEP)
        assert slave.getFloat64([BY_NAME["applied.thrust"].reference]) == [1.0 + STEP]
    finally:
        slave.freeInstance()
    assert flags == {(True, False, False, False)}


FORBIDDEN: dict[str, Callable[[Any], object]] = {
    "fmi3GetFloat64": lambda slave: slave.getFloat64([BY_NAME["pose.x"].reference]),
    "fmi3DoStep": lambda slave: slave.doStep(0.0, 0.1),
    "fmi3Terminate": lambda slave: slave.terminate(),
    "fmi3Reset": lambda slave: slave.reset(),
    "fmi3GetFMUState": lambda slave: slave.getFMUState(),
    "fmi3GetDirectionalDerivative": lambda slave: slave.getDirectionalDerivative([6], [0], [1.0]),
    "mass = 200.0": lambda slave: slave.setFloat64([BY_NAME["mass"].reference], [200.0]),
    "air_density = 1.0": lambda slave: slave.setFloat64([BY_NAME["air_density"].reference], [1.0]),
}


@pytest.mark.parametrize("call", FORBIDDEN)
def test_what_must_not_be_called_inside_a_step(call: str, native3_fmu: Path, tmp_path: Path) -> None:
    """[4.2.2] Intermediate Update Mode has neither these calls nor parameters; an error inside is one of the step."""
    raised: list[BaseException] = []

    def update(slave: Any, *_others: Any) -> None:
        try:
            FORBIDDEN[call](slave)
        except FMICallException as error:
            raised.append(error)

    slave = through_fmpy(native3_fmu, tmp_path, update)
    try:
        with pytest.raises(FMICallException):
            slave.doStep(0.0, STEP)
        assert slave.getFloat64([BY_NAME["pose.x"].reference]) == [0.0]
    finally:
        slave.freeInstance()
    assert {error.status for error in raised} == {fmi3.fmi3Error}  # type: ignore[attr-defined]
