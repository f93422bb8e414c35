"""The closed loop in masters that others wrote: each sails the voyage, and must give the bits of our own master.

What each gets is what its users give it: FMUs and connections through its functions, its own file of a system, or the
SSP file. A row is what both FMUs show at the end of a communication step: STATES of the hovercraft, COMMANDS of the
autopilot.
"""

import json
import shutil
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement

from hovercraft_fmu.autopilot.pilot_interface import AUTOPILOT_MODEL, COMMANDS
from hovercraft_fmu.building.ssp import CRAFT, PARAMETERS, PILOT, build_ssp
from hovercraft_fmu.elsewhere import HostError, load_tbb, make_container, rows_of_module
from hovercraft_fmu.fmu.description import xml
from hovercraft_fmu.fmu.interface import HOVERCRAFT, STATES
from hovercraft_fmu.fmu.variable import Model
from hovercraft_fmu.scenes import VOYAGES

VOYAGE = VOYAGES["crosswind"]
STEPS = 700
"""Past the first waypoint."""
STEP = VOYAGE.communication_step
SHOWN = (*((CRAFT, name) for name in STATES), *((PILOT, name) for name in COMMANDS))
CONNECTIONS = (*((CRAFT, name, PILOT, name) for name in STATES), *((PILOT, name, CRAFT, name) for name in COMMANDS))
MODELS: Mapping[str, Model] = {CRAFT: HOVERCRAFT, PILOT: AUTOPILOT_MODEL}
Rows = list[list[float]]


def loop_in(master: str, craft: Path, autopilot: Path, folder: Path) -> Rows:
    """Sail VOYAGE for STEPS in a process of its own, in an empty folder.

    Raises:
        HostError: the master failed; the last of what it printed.
    """
    fmus = [str(shutil.copy(path, folder)) for path in (craft, autopilot)]
    return rows_of_module("tests.masters", master, *fmus, cwd=folder)


# ---- what runs in the process of its own: in an empty folder, but for the two FMUs


def _reference(component: str, name: str) -> int:
    return MODELS[component].by_name[name].reference


def libcosimpy_functions(craft: Path, autopilot: Path) -> Rows:
    """FMUs and connections one by one."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimSlave import CosimLocalSlave

    execution = CosimExecution.from_step_size(round(STEP * 1e9))  # ns
    files = {CRAFT: craft, PILOT: autopilot}
    index = {
        name: execution.add_local_slave(CosimLocalSlave(fmu_path=str(path), instance_name=name))
        for name, path in files.items()
    }
    for start, output, end, taken in CONNECTIONS:
        ends = index[start], _reference(start, output), index[end], _reference(end, taken)
        if execution.connect_real_variables(*ends) != 0:
            raise HostError(f"libcosimpy: {start}.{output} does not connect to {end}.{taken}")
    for name, value in VOYAGE.craft.items():
        if not execution.real_initial_value(index[CRAFT], _reference(CRAFT, name), value):
            raise HostError(f"libcosimpy: {name} has no initial value")
    return _libcosimpy(execution)


def libcosimpy_osp(craft: Path, autopilot: Path) -> Rows:
    """From OspSystemStructure.xml."""
    from libcosimpy.CosimExecution import CosimExecution

    root = Element("OspSystemStructure", {"xmlns": "http://opensimulationplatform.com/MSMI/OSPSystemStructure",
                                          "version": "0.1"})  # fmt: skip
    SubElement(root, "BaseStepSize").text = repr(STEP)
    SubElement(root, "Algorithm").text = "fixedStep"
    simulators = SubElement(root, "Simulators")
    for name, path in ((CRAFT, craft), (PILOT, autopilot)):
        simulator = SubElement(simulators, "Simulator", {"name": name, "source": path.name, "stepSize": repr(STEP)})
        if name == CRAFT:
            values = SubElement(simulator, "InitialValues")
            for variable, value in VOYAGE.craft.items():
                initial = SubElement(values, "InitialValue", {"variable": variable})
                SubElement(initial, "Real", {"value": repr(value)})
    connections = SubElement(root, "Connections")
    for start, output, end, taken in CONNECTIONS:
        connection = SubElement(connections, "VariableConnection")
        SubElement(connection, "Variable", {"simulator": start, "name": output})
        SubElement(connection, "Variable", {"simulator": end, "name": taken})
    Path("OspSystemStructure.xml").write_bytes(xml(root))
    return _libcosimpy(CosimExecution.from_osp_config_file("OspSystemStructure.xml"))


def libcosimpy_ssp(craft: Path, autopilot: Path) -> Rows:
    """From the SSP file, whose annotation has the step size."""
    from libcosimpy.CosimExecution import CosimExecution

    return _libcosimpy(CosimExecution.from_ssp_file(str(_ssp(craft, autopilot))))


def _libcosimpy(execution: Any) -> Rows:
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver

    log_output_level(CosimLogLevel.ERROR)
    observer = CosimObserver.create_last_value()
    if not execution.add_observer(observer):
        raise HostError("libcosimpy: no observer")
    index = {name: execution.slave_index_from_instance_name(name) for name in MODELS}
    rows: Rows = []
    for _ in range(STEPS):
        execution.step()
        states = observer.last_real_values(index[CRAFT], [_reference(CRAFT, name) for name in STATES])
        commands = observer.last_real_values(index[PILOT], [_reference(PILOT, name) for name in COMMANDS])
        rows.append([*states, *commands])
    return rows


def ecospy_functions(craft: Path, autopilot: Path) -> Rows:
    """FMUs and connections one by one."""
    load_tbb()
    from ecospy import EcosSimulation, EcosSimulationStructure

    structure = EcosSimulationStructure()
    structure.add_model(CRAFT, str(craft))
    structure.add_model(PILOT, str(autopilot))
    for start, output, end, taken in CONNECTIONS:
        structure.make_real_connection(f"{start}::{output}", f"{end}::{taken}")
    structure.add_parameter_set(CRAFT, {f"{CRAFT}::{name}": value for name, value in VOYAGE.craft.items()})
    with EcosSimulation(structure=structure, step_size=STEP) as simulation:
        return _ecospy(simulation)


def ecospy_ssp(craft: Path, autopilot: Path) -> Rows:
    """From the SSP file; its parameter set has to be asked for by name."""
    load_tbb()
    from ecospy import EcosSimulation

    with EcosSimulation(ssp_path=str(_ssp(craft, autopilot)), step_size=STEP) as simulation:
        return _ecospy(simulation)


def _ecospy(simulation: Any) -> Rows:
    simulation.init(parameter_set=CRAFT)
    rows: Rows = []
    for _ in range(STEPS):
        simulation.step()
        rows.append([simulation.get_real(f"{component}::{name}") for component, name in SHOWN])
    return rows


def fmucontainer_json(craft: Path, autopilot: Path) -> Rows:
    """From fmucontainer's own file; the FMU that it makes is run by fmpy."""
    _fmucontainer_json(craft, autopilot, {})
    return _container(Path("Loop.fmu"))


def fmucontainer_sequential(craft: Path, autopilot: Path) -> Rows:
    """The same, one FMU after the other: the autopilot first."""
    _fmucontainer_json(craft, autopilot, {"sequential": True})
    return _container(Path("Loop.fmu"))


def _fmucontainer_json(craft: Path, autopilot: Path, options: Mapping[str, bool]) -> None:
    file_of = {CRAFT: craft.name, PILOT: autopilot.name}
    content: dict[str, object] = {
        "name": "Loop.fmu",
        "fmu": [autopilot.name, craft.name],
        "step_size": STEP,
        "auto_input": False,
        "auto_output": False,
        "link": [[file_of[start], output, file_of[end], taken] for start, output, end, taken in CONNECTIONS],
        "output": [[file_of[component], name, name] for component, name in SHOWN],
        "start": [[craft.name, name, value] for name, value in VOYAGE.craft.items()],
        **options,
    }
    make_container(Path(), content)


def fmucontainer_ssp(craft: Path, autopilot: Path) -> Rows:
    """From the SSP file. Its reader knows no parameter sets, and only outputs of the system: both are told it."""
    from fmu_manipulation_toolbox.assembly import Assembly

    _ssp(craft, autopilot)
    assembly = Assembly("Loop.ssp", default_step_size=STEP)
    root = assembly.root
    file_of = {CRAFT: f"Loop.dir/{craft.name}", PILOT: f"Loop.dir/{autopilot.name}"}
    for component, name in SHOWN:
        root.add_output(file_of[component], name, name)
    for name, value in VOYAGE.craft.items():
        root.add_start_value(file_of[CRAFT], name, value)
    assembly.make_fmu()
    return _container(Path("Loop.fmu"))


def fmpy_container(craft: Path, autopilot: Path) -> Rows:
    """fmpy's container FMU."""
    from fmpy import read_model_description
    from fmpy.container_fmu.cli import create_container_fmu
    from fmpy.container_fmu.config import Component, Configuration, Connection
    from fmpy.model_description import CoSimulation, DefaultExperiment, ModelDescription, ModelVariable, Unknown

    parts, variables = {}, {}
    for name, path in ((CRAFT, craft), (PILOT, autopilot)):
        description = read_model_description(path)
        parts[name] = Component(name, path, description)
        for variable in description.modelVariables:
            if variable.type == "Real":
                variable.type = (
                    "Float64"  # the configuration that fmpy writes knows the connections' types by this name
                )
        variables[name] = {variable.name: variable for variable in description.modelVariables}
    # the container's binary knows value reference 0 for the time
    outside = [ModelVariable(name="time", valueReference=0, type="Real", variability="continuous",
                             causality="independent")]  # fmt: skip
    mappings = {}
    for component, name, value in (*((*each, None) for each in SHOWN),
                                   *((CRAFT, name, value) for name, value in VOYAGE.craft.items())):  # fmt: skip
        inner = variables[component][name]
        made = ModelVariable(name=name, valueReference=len(outside), type="Real", variability="continuous",
                             causality="output" if value is None else "input", start=value and repr(value))  # fmt: skip
        outside.append(made)
        mappings[made] = [(parts[component], inner)]
    container = ModelDescription(
        fmiVersion="2.0", modelName="Loop", instantiationToken="{loop}", modelVariables=outside,
        coSimulation=CoSimulation(modelIdentifier="container_fmu", fixedInternalStepSize=STEP),
        defaultExperiment=DefaultExperiment(stepSize=STEP),
        outputs=[Unknown(variable=each) for each in outside if each.causality == "output"],
    )  # fmt: skip
    connections = [
        Connection(parts[start], [variables[start][output]], parts[end], [variables[end][taken]])
        for start, output, end, taken in CONNECTIONS
    ]
    Path("container").mkdir()
    create_container_fmu(
        Configuration(False, container, list(parts.values()), connections, mappings), Path("container").absolute(),
        Path("Loop.fmu").absolute(),
    )  # fmt: skip
    return _container(Path("Loop.fmu"))


def _container(fmu: Path) -> Rows:
    """An FMU that has the loop inside."""
    import fmpy

    result = fmpy.simulate_fmu(str(fmu), stop_time=STEPS * STEP, output_interval=STEP, step_size=STEP)
    return [[float(row[name]) for _, name in SHOWN] for row in result[1:]]


def fmpy_ssp(craft: Path, autopilot: Path) -> Rows:
    """From the SSP file. fmpy applies a parameter set only where it is given, with names of the whole system."""
    from fmpy.ssp.simulation import simulate_ssp
    from fmpy.ssp.ssd import read_ssv

    path = str(_ssp(craft, autopilot))
    values = read_ssv(path, resource=PARAMETERS)
    for parameter in values.parameters:
        parameter.name = f"{CRAFT}.{parameter.name}"
    result = simulate_ssp(path, stop_time=STEPS * STEP, step_size=STEP, parameter_set=values)
    return [[float(row[f"{component}.{name}"]) for component, name in SHOWN] for row in result]


def _ssp(craft: Path, autopilot: Path) -> Path:
    return build_ssp("Loop.ssp", craft, autopilot, VOYAGE)


LOOPS: Mapping[str, Callable[[Path, Path], Rows]] = {
    "libcosimpy, functions": libcosimpy_functions,
    "libcosimpy, OspSystemStructure.xml": libcosimpy_osp,
    "libcosimpy, SSP": libcosimpy_ssp,
    "ecospy, functions": ecospy_functions,
    "ecospy, SSP": ecospy_ssp,
    "fmucontainer, JSON": fmucontainer_json,
    "fmucontainer, SSP": fmucontainer_ssp,
    "fmpy.container_fmu": fmpy_container,
    "fmucontainer, JSON, sequential": fmucontainer_sequential,
    "fmpy.ssp": fmpy_ssp,
}

if __name__ == "__main__":
    name, *files = sys.argv[1:]
    print("\n" + json.dumps(LOOPS[name](*map(Path, files))))
