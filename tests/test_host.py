"""The way in which the package drives an FMU: the same calls for both standards, co-simulation and model exchange."""

import errno
from collections.abc import Iterator
from ctypes import ArgumentError
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hovercraft_fmu.fmu.interface import STATES
from hovercraft_fmu.host import Fmu, Instance, SimulationError
from hovercraft_fmu.host.messages import CALLBACKS_2
from hovercraft_fmu.host.ramps import Ramps
from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.dynamics import Controls, State, derivatives
from hovercraft_fmu.model.integrators import integrator
from hovercraft_fmu.model.subcycling import Settings, advance
from tests.conftest import FMI_2

CONTROLS = Controls(8.0, 0.5)


@pytest.fixture(scope="module")
def opened(each_fmu: Path) -> Iterator[Fmu]:
    with Fmu(each_fmu, "Hovercraft") as fmu:
        yield fmu


@pytest.fixture
def craft(opened: Fmu) -> Iterator[Instance]:
    with opened.instance() as instance:
        yield instance


def driven(craft: Instance) -> list[float]:
    controls, states = craft.port("thrust", "port_thruster"), craft.port(*STATES)
    for k in range(20):
        controls.set(CONTROLS[:2])
        craft.step(0.1 * k, 0.1)
    return states.get()


def test_start_values_by_name_and_type(craft: Instance) -> None:
    """Real, Integer and Enumeration, the last by name, too; the state is that of the bare model."""
    craft.start({"mass": 200.0, "integrator": "rk4", "step_size": 0.05, "drag_area": 1})
    mixed = craft.port("substeps", "mass", "integrator", "pose.x", "drag_area")
    assert mixed.get() == [0, 200.0, 3, 0.0, 1]
    expected = State()
    for _ in range(20):
        expected = advance(expected, CONTROLS, Craft(mass=200.0), 0.1, Settings(0.05, integrator(3))).state
    assert driven(craft) == pytest.approx(expected, rel=1e-12)
    assert mixed.get()[0] == 40


def test_a_group_of_several_types_is_set_together(craft: Instance) -> None:
    group = craft.port("integrator", "mass", "drag_area", "step_size")
    craft.enter_initialization()
    group.set([2, 50.0, 2, 0.01])
    assert group.get() == [2, 50.0, 2, 0.01]


def test_in_initialization_a_port_is_set_and_read(craft: Instance) -> None:
    controls = craft.port("thrust")
    craft.set({"mass": 200.0})
    craft.enter_initialization(start_time=10.0)
    controls.set([7.0])
    craft.exit_initialization()
    assert controls.get() == [7.0]
    craft.step(10.0, 0.1)


def test_memory_of_numpys_is_read_into(craft: Instance) -> None:
    record = np.zeros((2, 2))
    states = craft.port("pose.x", "velocity.x")
    row = states.over(record[1])
    craft.start({"pose.x": 3.0, "velocity.x": -1.0})
    states.get_into(row)
    assert record.tolist() == [[0.0, 0.0], [3.0, -1.0]]
    for wrong in (np.zeros(3), np.zeros(2, np.float32)):
        with pytest.raises(ValueError, match=r"must have 2 values of the type of pose\.x, velocity\.x"):
            states.over(wrong)
    with pytest.raises(ValueError, match=r"pose\.x, substeps: must be of one type"):
        craft.port("pose.x", "substeps").over(record[1])


def test_a_refusal_says_what_the_fmu_says_and_reset_leads_back(craft: Instance) -> None:
    """Also where the refusal was fatal, as each of the Python FMU's is; what was warned of is no part of it."""
    craft.start({"thrust": 99.0})
    craft.step(0.0, 0.1)
    with pytest.raises(SimulationError, match=r"^communicationStepSize = -0\.1 s: must be a finite number greater"):
        craft.step(0.1, -0.1)
    assert [message.partition(":")[0] for message in craft.messages] == [
        "thrust = 99.0",
        "communicationStepSize = -0.1 s",
    ]
    craft.reset()
    with pytest.raises(SimulationError, match=r"^mass = -1.0: must be greater than 0$"):
        craft.start({"mass": -1.0})
    craft.reset()
    craft.start()
    again = driven(craft)
    craft.reset()
    craft.start()
    assert driven(craft) == again


def test_what_is_no_variable_and_no_item(craft: Instance) -> None:
    with pytest.raises(ValueError, match="nix: must be a variable of Hovercraft"):
        craft.port("nix")
    with pytest.raises(ValueError, match="integrator = 'nix': must be one of semi_implicit_euler, "):
        craft.set({"integrator": "nix"})
    with pytest.raises(ValueError, match="mass = 'heavy': must be a number"):
        craft.set({"mass": "heavy"})


def test_a_state_is_kept_and_given_back(craft: Instance) -> None:
    craft.start()
    driven(craft)
    states = craft.port(*STATES)
    there = states.get()
    kept = craft.save()
    content = craft.bytes_of(kept)
    craft.step(2.0, 0.1)
    craft.restore(kept)
    craft.forget(kept)
    assert states.get() == there
    craft.step(2.0, 0.1)
    ahead = states.get()
    assert ahead != there
    again = craft.state_of(content)
    craft.restore(again)
    craft.forget(again)
    craft.step(2.0, 0.1)
    assert states.get() == ahead


def test_model_exchange(each_native_fmu: Path) -> None:
    start = State(1.0, 2.0, 0.3, 0.4, 0.5, 0.06)
    with Fmu(each_native_fmu) as fmu, fmu.instance(exchange=True) as craft:
        craft.start(dict(zip(STATES, start, strict=True)))
        assert not craft.update_discrete_states().again
        craft.enter_continuous_time_mode()
        x, rates = craft.state_array(), craft.state_array()
        craft.get_states(x, len(x))
        assert tuple(x) == start
        x[2] = 1.0
        craft.set_time(0.5)
        craft.set_states(x, len(x))
        craft.get_derivatives(rates, len(rates))
        assert list(rates) == pytest.approx(derivatives(start._replace(heading=1.0), Controls(), Craft()), rel=1e-12)
        assert not craft.complete_step()
        craft.get_nominals(x, len(x))
        assert min(x) > 0.0
        craft.enter_event_mode()


def test_an_fmu_that_asks_to_end_is_heard(native3_fmu: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """As one of another maker may: in a step, and to a solver."""

    def done_and_ends(*arguments: Any) -> int:
        _, ends, _, last = (argument._obj for argument in arguments[-4:])
        ends.value, last.value = True, 0.25
        return 0

    with Fmu(native3_fmu) as opened, opened.instance() as craft:
        monkeypatch.setattr(craft, "_do_step", done_and_ends)
        with pytest.raises(SimulationError, match=r"the FMU asks to end at 0\.25 s"):
            craft.step(0.0, 0.5)
    with Fmu(native3_fmu) as opened, opened.instance(exchange=True) as craft:
        monkeypatch.setattr(craft.fmpy, "completedIntegratorStep", lambda: (False, True))
        with pytest.raises(SimulationError, match="the FMU asks to end"):
            craft.complete_step()


def test_what_is_wrong_before_the_fmu_is_called_is_no_refusal_of_it(craft: Instance) -> None:
    with pytest.raises(ArgumentError):
        craft.enter_initialization(start_time="now")  # type: ignore[arg-type]


def test_a_text_is_no_number(craft: Instance, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(craft._variable("thrust"), "type", "String")
    with pytest.raises(ValueError, match="thrust: must be a number; it is of the type String"):
        craft.port("thrust")


def test_what_is_no_file_or_has_no_room(tmp_path: Path, fmu: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(IsADirectoryError, match="must be an FMU, and is a folder"):
        Fmu(tmp_path)

    def full(*_: object, **__: object) -> None:
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr("fmpy.extract", full)
    with pytest.raises(OSError, match="No space left on device"):
        Fmu(fmu)


def test_what_one_of_fmpys_masters_raises_is_a_refusal(craft: Instance) -> None:
    with pytest.raises(SimulationError, match=r"^mass = -1\.0: must be greater than 0$"), craft.driven_by_fmpy():
        (craft.fmpy.setFloat64 if craft.is_fmi_3 else craft.fmpy.setReal)(
            [craft._variable("mass").valueReference], [-1.0]
        )
    with pytest.raises(SimulationError, match="no solver"), craft.driven_by_fmpy():
        raise RuntimeError("no solver")


def test_closed_twice_is_closed_once(opened: Fmu) -> None:
    craft = opened.instance()
    craft.close()
    craft.close()


def test_who_is_gone_hears_nothing() -> None:
    """The logger is the process's; a name that no instance has any more is nobody's."""
    CALLBACKS_2.logger(None, b"gone", 3, b"logStatusError", b"what")


def test_an_fmu_without_model_exchange(fmu: Path) -> None:
    with Fmu(fmu) as opened, pytest.raises(SimulationError, match="Hovercraft: must be an FMU for model exchange"):
        opened.instance(exchange=True)


@FMI_2
def test_slopes_of_inputs(each_native_fmu: Path) -> None:
    """A ramp of thrust over one long step is that ramp in many short ones, held at their middles, to the square."""
    ends = []
    for parts in (1, 200):
        with Fmu(each_native_fmu) as fmu, fmu.instance() as craft:
            thrust, states = craft.port("thrust"), craft.port(*STATES)
            craft.start({"integrator": "rk4", "step_size": 0.01})
            for k in range(parts):
                thrust.set([(0.0 if parts == 1 else (k + 0.5) / parts) * 10.0])
                if parts == 1:
                    thrust.set_slopes([5.0])
                craft.step(2.0 * k / parts, 2.0 / parts)
            ends.append(states.get())
    assert ends[0] == pytest.approx(ends[1], abs=1e-6)


def test_fmi_3_has_no_slopes_to_set(native3_fmu: Path) -> None:
    refused = pytest.raises(ValueError, match=r"slopes: must be of inputs of FMI 2\.0")
    with Fmu(native3_fmu) as fmu, fmu.instance() as craft, refused:
        craft.port("thrust").set_slopes([1.0])


LEGS = [(0.0, 0.1, [5.0], [5.0], True), (0.1, 0.2, [5.0], [9.0], True), (0.2, 0.3, [9.0], [9.0], False),
        (0.3, 0.4, [2.0], [2.0], True)]  # fmt: skip
"""Held, on a ramp, held at another value, not looked at, and held at a third one."""


def test_many_steps_in_one_call_are_the_steps_one_by_one(opened: Fmu) -> None:
    rows = np.zeros((3, 3))
    with Ramps.on(opened, ["thrust"], ramped=True) as ramps:
        seen = ramps.craft.port("pose.x", "velocity.x", "thrust")
        ramps.craft.start()
        ramps.follow(LEGS, seen, [seen.over(row) for row in rows])
    one_by_one = []
    with Ramps.on(opened, ["thrust"], ramped=True) as ramps:
        seen = ramps.craft.port("pose.x", "velocity.x", "thrust")
        ramps.craft.start()
        for *leg, kept in LEGS:
            ramps.step(*leg)  # type: ignore[arg-type]
            one_by_one += [seen.get()] if kept else []
    assert rows.tolist() == one_by_one


@pytest.mark.parametrize(
    ("start", "says"),
    [
        ({"velocity.x": 1e200}, "must stay a finite number"),  # the step
        ({"velocity.x": 1.3e308, "velocity.y": 1.3e308, "drag_coefficient": 0.0, "step_size": 0.1}, "^speed = inf"),
    ],
)
def test_many_steps_in_one_call_end_where_one_is_refused_or_cannot_be_read(
    start: dict[str, float], says: str, opened: Fmu
) -> None:
    with Ramps.on(opened, ["thrust"], ramped=False) as ramps:
        seen = ramps.craft.port("speed")
        ramps.craft.start(start)
        with pytest.raises(SimulationError, match=says):
            ramps.follow(LEGS[:1], seen, [seen.over(np.zeros(1))])
