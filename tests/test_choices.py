"""The Integers beside the Enumerations, for hosts that set no Enumerations."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from fmpy.fmi1 import FMICallException

from hovercraft_fmu.elsewhere import COMMUNICATION_STEP, CONTROLS, HOSTS, INPUT_REFERENCES, hosts_of
from hovercraft_fmu.fmu.interface import HOVERCRAFT, OUTPUTS, VARIABLES
from hovercraft_fmu.model.error_estimate import ON
from hovercraft_fmu.model.integrators import integrator_number
from hovercraft_fmu.simulation import plan
from hovercraft_fmu.sweeps.study import read_study
from tests.conftest import Fresh
from tests.lowlevel import everything, get, one, reference

RK4, DIRECTIONAL = integrator_number("rk4"), 2
BY_NUMBER = {"integrator_number": RK4, "drag_area_number": DIRECTIONAL, "error_estimate_number": ON}
BY_ITEM = {"integrator": RK4, "drag_area": DIRECTIONAL, "error_estimate": ON}
FRACTIONS = {"step_size": 0.1, "rotational_drag": 0.5}
"""With steps this long every method gives other bits."""


def test_every_enumeration_that_can_be_set_has_one() -> None:
    assert set(HOVERCRAFT.choices) == {v.name for v in VARIABLES if v.kind == "Enumeration" and v.start is not None}


def begin(instance: Any, choices: dict[str, int]) -> None:
    instance.setReal([reference(name) for name in FRACTIONS], list(FRACTIONS.values()))
    instance.setInteger([reference(name) for name in choices], list(choices.values()))
    instance.setupExperiment(startTime=0.0)
    instance.enterInitializationMode()


def driven(fmu: Path, choices: dict[str, int]) -> list[list[float]]:
    with one(fmu) as (instance, _):
        begin(instance, choices)
        instance.exitInitializationMode()
        rows = []
        for k, controls in enumerate(CONTROLS):
            instance.setReal(INPUT_REFERENCES, controls)
            instance.doStep(k * COMMUNICATION_STEP, COMMUNICATION_STEP)
            rows.append(get(instance, *OUTPUTS))
        return rows


@pytest.fixture(scope="module")
def by_item(each_fmu: Path) -> list[list[float]]:
    """The run with the choices set as Enumerations."""
    return driven(each_fmu, BY_ITEM)


def test_a_number_does_what_the_item_does(each_fmu: Path, by_item: list[list[float]]) -> None:
    assert driven(each_fmu, BY_NUMBER) == by_item
    assert driven(each_fmu, {**BY_NUMBER, **BY_ITEM}) == by_item
    for name in HOVERCRAFT.choices:  # each of the two makes a difference
        assert driven(each_fmu, {name: BY_ITEM[name]}) != by_item
    assert driven(each_fmu, dict.fromkeys(BY_NUMBER, 0)) == driven(each_fmu, {})


@pytest.mark.parametrize(
    ("choices", "message"),
    [
        (
            {"integrator": 2, "integrator_number": RK4},
            "integrator = 2 and integrator_number = 3: must be the same where both are set",
        ),
        (
            {"drag_area": DIRECTIONAL, "drag_area_number": 1},
            "drag_area = 2 and drag_area_number = 1: must be the same where both are set",
        ),
        (
            {"error_estimate": ON, "error_estimate_number": 1},
            "error_estimate = 2 and error_estimate_number = 1: must be the same where both are set",
        ),
    ],
)
def test_two_that_differ_are_refused(each_fmu: Path, choices: dict[str, int], message: str) -> None:
    with one(each_fmu) as (instance, messages):
        begin(instance, choices)
        state = instance.getFMUstate()
        with pytest.raises(FMICallException):
            instance.exitInitializationMode()
        assert messages == [message]
        with pytest.raises(FMICallException):
            get(instance, "speed")
        name, number = choices
        instance.setFMUstate(state)  # a state may have them, too: it is the start that is refused
        with pytest.raises(FMICallException):
            instance.exitInitializationMode()
        assert messages == [message] * 3
        instance.setInteger([reference(number)], [choices[name]])
        instance.exitInitializationMode()
        assert everything(instance)[name] == choices[name]


@pytest.mark.parametrize("value", [-1, 9])
def test_a_number_of_no_item_is_refused(each_fmu: Path, value: int) -> None:
    with one(each_fmu) as (instance, messages):
        for number in BY_NUMBER:
            with pytest.raises(FMICallException):
                instance.setInteger([reference(number)], [value])
        assert messages == [
            f"integrator_number = {value}: must be 0 (as integrator says) or one of 1 (semi_implicit_euler), "
            "2 (drag_implicit), 3 (rk4), 4 (adaptive), 5 (splitting)",
            f"drag_area_number = {value}: must be 0 (as drag_area says) or one of 1 (constant), 2 (directional)",
            f"error_estimate_number = {value}: must be 0 (as error_estimate says) or one of 1 (off), 2 (on)",
        ]


LIBCOSIM = """
import json, sys
from libcosimpy.CosimExecution import CosimExecution
from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
from libcosimpy.CosimManipulator import CosimManipulator
from libcosimpy.CosimObserver import CosimObserver
from libcosimpy.CosimSlave import CosimLocalSlave
from hovercraft_fmu.elsewhere import COMMUNICATION_STEP, CONTROLS, INPUT_REFERENCES, OUTPUT_REFERENCES

fmu, integers, reals = sys.argv[1], json.loads(sys.argv[2]), json.loads(sys.argv[3])
log_output_level(CosimLogLevel.ERROR)
execution = CosimExecution.from_step_size(round(COMMUNICATION_STEP * 1e9))
craft = execution.add_local_slave(CosimLocalSlave(fmu_path=fmu, instance_name="craft"))
references = {variable.name.decode(): variable.reference for variable in execution.slave_variables(craft)}
assert "integrator" not in references  # libcosim lists no Enumerations
for name, value in integers.items():
    assert execution.integer_initial_value(craft, references[name], value)
for name, value in reals.items():
    assert execution.real_initial_value(craft, references[name], value)
manipulator, observer = CosimManipulator.create_override(), CosimObserver.create_last_value()
assert execution.add_manipulator(manipulator) and execution.add_observer(observer)
rows = []
for controls in CONTROLS:
    manipulator.slave_real_values(craft, INPUT_REFERENCES, list(controls))
    execution.step()
    rows.append(list(observer.last_real_values(craft, OUTPUT_REFERENCES)))
print("\\n" + json.dumps(rows))
"""
ECOS = """
import json, sys
from hovercraft_fmu.elsewhere import COMMUNICATION_STEP, CONTROLS, load_tbb
from hovercraft_fmu.fmu.interface import INPUTS, OUTPUTS

load_tbb()
from ecospy import EcosSimulation, EcosSimulationStructure

fmu, integers, reals = sys.argv[1], json.loads(sys.argv[2]), json.loads(sys.argv[3])
structure = EcosSimulationStructure()
structure.add_model("craft", fmu)
structure.add_parameter_set("chosen", {f"craft::{name}": value for name, value in {**integers, **reals}.items()})
rows = []
with EcosSimulation(structure=structure, step_size=COMMUNICATION_STEP) as simulation:
    simulation.init(parameter_set="chosen")
    for controls in CONTROLS:
        for name, value in zip(INPUTS, controls, strict=True):
            simulation.set_real(f"craft::{name}", value)
        simulation.step()
        rows.append([simulation.get_real(f"craft::{name}") for name in OUTPUTS])
print("\\n" + json.dumps(rows))
"""


def test_hosts_without_enumerations_choose_by_name(each_fmu: Path, by_item: list[list[float]], fresh: Fresh) -> None:
    for host, code in {"libcosimpy": LIBCOSIM, "ecospy": ECOS}.items():
        if host not in hosts_of(each_fmu):  # of FMI 3.0 libcosimpy knows nothing
            continue
        if missing := HOSTS[host].missing():
            pytest.skip(f"{host}: {missing}")
        printed = fresh(code, each_fmu, json.dumps(BY_NUMBER), json.dumps(FRACTIONS))
        assert json.loads(next(line for line in printed.splitlines() if line.startswith("[["))) == by_item


def test_here_the_enumeration_says_it_all() -> None:
    """`simulate`, `drive` and sweeps: what draws, compares and batches looks at one of the two."""
    run = plan("turn", start_values={"integrator_number": "3", "drag_area": "directional", "drag_area_number": 2})
    assert (run.value("integrator"), run.value("drag_area")) == (RK4, DIRECTIONAL)
    assert not BY_NUMBER.keys() & run.start_values.keys()
    refused: list[tuple[Callable[[], object], str]] = [
        (
            lambda: plan(start_values={"integrator": "drag_implicit", "integrator_number": 3}),
            "integrator = 2 and integrator_number = 3: must be the same where both are set",
        ),
        (lambda: plan(start_values={"integrator_number": 9}), "integrator_number = 9: must be 0 (as integrator says)"),
        (
            lambda: read_study({"scene": "turn", "sweep": {"integrator_number": [1, 3]}}),
            "sweep.integrator_number = [1, 3]: must be given as sweep.integrator, which it stands beside",
        ),
    ]
    for call, message in refused:
        with pytest.raises(ValueError) as error:  # noqa: PT011 - the message is looked at
            call()
        assert str(error.value).startswith(message)
