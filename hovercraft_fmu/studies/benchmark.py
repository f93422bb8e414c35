"""What a step costs: cases side by side in one run, interleaved, as medians and ratios. Never asserted on a clock."""

import platform
import statistics
import tempfile
from collections.abc import Callable, Mapping
from math import cos, sin, sqrt
from pathlib import Path
from time import perf_counter
from typing import Any

import fmpy
from rich.console import Group
from rich.table import Table

from ..fmu.interface import BY_NAME, INPUTS, VARIABLES
from ..fmu.python_package import build_fmu
from ..model.craft import Craft
from ..model.dynamics import Controls, State
from ..model.subcycling import Settings, advance
from ..simulation import instantiated, read_description

COMMUNICATION_STEP = 0.1
"""s"""
SUBSTEP = 0.001
"""s"""
STEPS = 100
"""Communication steps in one sample."""
SAMPLES = 31
CONTROLS = Controls(5.0, 0.5, 0.2)
REFERENCE, BARE, FMU, FMU_LISTS = (
    "reference loop, inline",
    "bare model",
    "FMU through fmpy, arrays made once",
    "FMU through fmpy, arrays made every step",
)


def measure() -> Group:
    """Time all cases and return what is to be printed: a table, and the machine it was measured on."""
    with tempfile.TemporaryDirectory() as folder:
        path = build_fmu(Path(folder) / "Hovercraft.fmu")
        description = read_description(path)
        with instantiated(path, description, []) as (_, instance):
            instance.setupExperiment()
            instance.enterInitializationMode()
            instance.exitInitializationMode()
            samples = _interleaved(_cases(instance))
    medians = {name: statistics.median(times) for name, times in samples.items()}
    table = Table(box=None, pad_edge=False)
    for title in ("case", "us a communication step", "to the reference", "to the bare model"):
        table.add_column(title)
    for name, median in medians.items():
        table.add_row(
            name, f"{median * 1e6:.1f}", f"{median / medians[REFERENCE]:.2f}", f"{median / medians[BARE]:.2f}"
        )
    return Group(
        f"communication steps of {COMMUNICATION_STEP} s, sub-steps of {SUBSTEP} s; medians of {SAMPLES} samples",
        table,
        f"Python {platform.python_version()}, fmpy {fmpy.__version__}, {platform.system()} {platform.machine()}",
    )


def _cases(instance: Any) -> Mapping[str, Callable[[], None]]:
    """Functions that make one communication step each."""
    craft, settings = Craft(), Settings(SUBSTEP)
    reference_state = bare_state = State()
    time = 0.0
    inputs = [BY_NAME[name].reference for name in INPUTS[:3]]  # what is not driven is not set
    outputs = [variable.reference for variable in VARIABLES if variable.causality == "output"]
    input_array = (fmpy.fmi2.fmi2ValueReference * len(inputs))(*inputs)
    output_array = (fmpy.fmi2.fmi2ValueReference * len(outputs))(*outputs)
    input_values = (fmpy.fmi2.fmi2Real * len(inputs))(*CONTROLS[:3])
    output_values = (fmpy.fmi2.fmi2Real * len(outputs))()

    def reference() -> None:
        nonlocal reference_state
        reference_state = reference_loop(reference_state, CONTROLS, craft, round(COMMUNICATION_STEP / SUBSTEP))

    def bare() -> None:
        nonlocal bare_state
        bare_state = advance(bare_state, CONTROLS, craft, COMMUNICATION_STEP, settings).state

    def fmu() -> None:
        nonlocal time
        instance.fmi2SetReal(instance.component, input_array, len(inputs), input_values)
        instance.fmi2DoStep(instance.component, time, COMMUNICATION_STEP, fmpy.fmi2.fmi2True)
        instance.fmi2GetReal(instance.component, output_array, len(outputs), output_values)
        time += COMMUNICATION_STEP

    def fmu_lists() -> None:
        nonlocal time
        instance.setReal(inputs, CONTROLS[:3])
        instance.doStep(time, COMMUNICATION_STEP)
        instance.getReal(outputs)
        time += COMMUNICATION_STEP

    return {REFERENCE: reference, BARE: bare, FMU: fmu, FMU_LISTS: fmu_lists}


def reference_loop(state: State, controls: Controls, craft: Craft, n: int) -> State:
    """The model written out in one loop, as fast as plain Python goes: what the bare model is measured against."""
    x, y, heading, vx, vy, yaw_rate = state
    thrust, port, starboard, _, _ = controls
    h, mass, inertia, k, x_d = SUBSTEP, craft.mass, craft.inertia, craft.drag_factor, craft.drag_center
    side = craft.steering_force * (port - starboard)
    turn = craft.thruster_moment * (port - starboard)
    for _ in range(n):
        c = cos(heading)
        s = sin(heading)
        u = c * vx + s * vy
        w = c * vy - s * vx + yaw_rate * x_d
        kq = k * sqrt(u * u + w * w)
        force_x = thrust - kq * u
        drag_y = -kq * w
        force_y = drag_y + side
        vx += h * ((c * force_x - s * force_y) / mass)
        vy += h * ((s * force_x + c * force_y) / mass)
        x += h * vx
        y += h * vy
        yaw_rate += h * ((x_d * drag_y + turn) / inertia)
        heading += h * yaw_rate
    return State(x, y, heading, vx, vy, yaw_rate)


def _interleaved(cases: Mapping[str, Callable[[], None]]) -> dict[str, list[float]]:
    """Seconds a communication step, SAMPLES of each case, in turn: a slow moment of the machine hits all alike."""
    samples: dict[str, list[float]] = {name: [] for name in cases}
    for _ in range(SAMPLES):
        for name, case in cases.items():
            start = perf_counter()
            for _ in range(STEPS):
                case()
            samples[name].append((perf_counter() - start) / STEPS)
    return samples
