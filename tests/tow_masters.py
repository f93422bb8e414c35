"""python -m tests.tow_masters MASTER CRAFT TETHER: a straight tow in a master that others wrote, as rows of JSON.

It is that of the SSP file: the craft start at the origin, and the first one leaves until the line is taut.
"""

import json
import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias

from hovercraft_fmu.building.ssp import TOW, build_tow_ssp
from hovercraft_fmu.elsewhere import HostError, load_tbb, make_container
from hovercraft_fmu.fmu.interface import EXTERNAL, HOVERCRAFT, STATES
from hovercraft_fmu.fmu.variable import Model
from hovercraft_fmu.model.craft import preset
from hovercraft_fmu.model.dynamics import State
from hovercraft_fmu.tether.line import Line
from hovercraft_fmu.tether.tether_interface import CRAFT, PARAMETERS, TETHER_MODEL
from hovercraft_fmu.towing import Tow

STEP, STEPS = 0.1, 400
LINE = Line()
STRAIGHT = Tow(State(), State(), preset("ice"), LINE, communication_step=STEP, stop_time=STEPS * STEP)
SHOWN = (*((craft, name) for craft in CRAFT for name in STATES), ("tether", "tension"))
STARTS = {
    "first": {"thrust": 10.0, "air_density": STRAIGHT.craft.air_density},
    "second": {"thrust": 0.0, "air_density": STRAIGHT.craft.air_density},
    "tether": dict(zip(PARAMETERS, LINE, strict=True)),
}
CONNECTIONS = (
    *((craft, name, "tether", f"{craft}.{name}") for craft in CRAFT for name in STATES),
    *(("tether", f"{craft}.{name}", craft, name) for craft in CRAFT for name in EXTERNAL),
)


Rows: TypeAlias = list[list[float]]


def _model(part: str) -> Model:
    return TETHER_MODEL if part == "tether" else HOVERCRAFT


def _reference(part: str, name: str) -> int:
    return _model(part).by_name[name].reference


def _files(craft: Path, tether: Path) -> dict[str, Path]:
    return {"first": craft, "second": craft, "tether": tether}


def libcosimpy(craft: Path, tether: Path) -> Rows:
    """Side by side (Jacobi)."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimSlave import CosimLocalSlave

    execution = CosimExecution.from_step_size(round(STEP * 1e9))  # ns
    index = {
        part: execution.add_local_slave(CosimLocalSlave(fmu_path=str(path), instance_name=part))
        for part, path in _files(craft, tether).items()
    }
    for part, values in STARTS.items():
        for name, value in values.items():
            if not execution.real_initial_value(index[part], _reference(part, name), value):
                raise HostError(f"libcosimpy: {part}.{name} has no initial value")
    for start, output, end, taken in CONNECTIONS:
        ends = index[start], _reference(start, output), index[end], _reference(end, taken)
        if execution.connect_real_variables(*ends) != 0:
            raise HostError(f"libcosimpy: {start}.{output} does not connect to {end}.{taken}")
    return _libcosimpy(execution)


def libcosimpy_ssp(craft: Path, tether: Path) -> Rows:
    """From the SSP file, whose annotation has the step size."""
    from libcosimpy.CosimExecution import CosimExecution

    with tempfile.TemporaryDirectory() as place:
        return _libcosimpy(CosimExecution.from_ssp_file(str(_ssp(place, craft, tether))))


def _libcosimpy(execution: Any) -> Rows:
    from libcosimpy.CosimLogging import CosimLogLevel, log_output_level
    from libcosimpy.CosimObserver import CosimObserver

    log_output_level(CosimLogLevel.ERROR)
    observer = CosimObserver.create_last_value()
    if not execution.add_observer(observer):
        raise HostError("libcosimpy: no observer")
    index = {part: execution.slave_index_from_instance_name(part) for part in STARTS}
    rows = []
    for _ in range(STEPS):
        execution.step()
        rows.append([observer.last_real_values(index[part], [_reference(part, name)])[0] for part, name in SHOWN])
    return rows


def ecospy(craft: Path, tether: Path) -> Rows:
    """Side by side (Jacobi)."""
    load_tbb()
    from ecospy import EcosSimulation, EcosSimulationStructure

    structure = EcosSimulationStructure()
    for part, path in _files(craft, tether).items():
        structure.add_model(part, str(path))
    for start, output, end, taken in CONNECTIONS:
        structure.make_real_connection(f"{start}::{output}", f"{end}::{taken}")
    structure.add_parameter_set(
        TOW, {f"{part}::{name}": value for part, values in STARTS.items() for name, value in values.items()}
    )
    with EcosSimulation(structure=structure, step_size=STEP) as simulation:
        return _ecospy(simulation)


def ecospy_ssp(craft: Path, tether: Path) -> Rows:
    """From the SSP file; its parameter sets have one name, by which all are taken."""
    load_tbb()
    from ecospy import EcosSimulation

    with (
        tempfile.TemporaryDirectory() as place,
        EcosSimulation(ssp_path=str(_ssp(place, craft, tether)), step_size=STEP) as simulation,
    ):
        return _ecospy(simulation)


def _ecospy(simulation: Any) -> Rows:
    simulation.init(parameter_set=TOW)
    rows = []
    for _ in range(STEPS):
        simulation.step()
        rows.append([simulation.get_real(f"{part}::{name}") for part, name in SHOWN])
    return rows


def fmucontainer(craft: Path, tether: Path) -> Rows:
    """Side by side (Jacobi): an FMU that has all three inside, run by fmpy."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for part, path in _files(craft, tether).items():
            shutil.copy(path, folder / f"{part}.fmu")
        content = {
            "name": "Tow.fmu", "fmu": [f"{part}.fmu" for part in STARTS], "step_size": STEP, "auto_input": False,
            "auto_output": False,
            "link": [[f"{start}.fmu", output, f"{end}.fmu", taken] for start, output, end, taken in CONNECTIONS],
            "output": [[f"{part}.fmu", name, f"shown.{part}.{name}"] for part, name in SHOWN],
            "start": [[f"{part}.fmu", name, x] for part, values in STARTS.items() for name, x in values.items()],
        }  # fmt: skip
        make_container(folder, content)
        return _container(folder / "Tow.fmu")


def fmucontainer_ssp(craft: Path, tether: Path) -> Rows:
    """From the SSP file. Its reader knows no parameter sets, and only outputs of the system: both are told it.

    The second component of a file has a number behind its name.
    """
    from fmu_manipulation_toolbox.assembly import Assembly

    with tempfile.TemporaryDirectory() as place:
        _ssp(place, craft, tether)
        assembly = Assembly("Tow.ssp", default_step_size=STEP, fmu_directory=Path(place))
        names = dict(zip(STARTS, (craft.stem, f"{craft.stem}-1", tether.stem), strict=True))
        for part, name in SHOWN:
            assembly.root.add_output(f"Tow.dir/{names[part]}.fmu", name, f"shown.{part}.{name}")
        for part, values in STARTS.items():
            for name, value in values.items():
                assembly.root.add_start_value(f"Tow.dir/{names[part]}.fmu", name, value)
        assembly.make_fmu()
        return _container(Path(place) / "Tow.fmu")


def _container(path: Path) -> Rows:
    import fmpy

    result = fmpy.simulate_fmu(str(path), stop_time=STEPS * STEP, output_interval=STEP, step_size=STEP)
    return [[float(row[f"shown.{part}.{name}"]) for part, name in SHOWN] for row in result[1:]]


def _ssp(folder: str, craft: Path, tether: Path) -> Path:
    return build_tow_ssp(Path(folder) / "Tow.ssp", craft, tether)


MASTERS: dict[str, Callable[[Path, Path], Rows]] = {
    "libcosimpy": libcosimpy,
    "libcosimpy, SSP": libcosimpy_ssp,
    "ecospy": ecospy,
    "ecospy, SSP": ecospy_ssp,
    "fmucontainer": fmucontainer,
    "fmucontainer, SSP": fmucontainer_ssp,
}

if __name__ == "__main__":
    print(json.dumps(MASTERS[sys.argv[1]](Path(sys.argv[2]), Path(sys.argv[3]))))
