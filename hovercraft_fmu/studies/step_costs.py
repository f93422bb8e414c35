"""What a step costs: the native FMU beside the Python FMU, the bare model, and plain C; called by Python and by C."""

import ctypes
import subprocess
from collections.abc import Callable, Iterator, Mapping, Sequence
from ctypes import c_double, c_int, c_size_t, c_uint, c_void_p
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import polars as pl

from ..elsewhere import COMPILERS, compiler
from ..fmu.description import NATIVE
from ..fmu.interface import INPUTS, OUTPUTS
from ..fmu.machine_code import headers, sources
from ..fmu.native_package import build_native_fmu
from ..fmu.python_package import build_fmu
from ..host import Fmu, Instance
from ..host.messages import WARNING
from ..model.craft import Craft
from ..model.dynamics import Controls, State, actuation
from ..model.integrators import INTEGRATORS
from ..model.subcycling import Settings, advance
from ..whole import temporary_folder
from .laboratory import Findings, Ready, Shown, Tell, Timed, interleaved, spread

STEP_SIZE = 0.001
"""s"""
TOLERANCE = 1e-12
"""SI units, of the adaptive method: thousands of its own steps in the time of a sample."""
SUBSTEPS = 20_000
"""Of a sample."""
COMMUNICATION_STEPS = {0.01: 100, 0.1: 20, 1.0: 4}
"""s -> how many are in a sample."""
ROUNDS = 21
CONTROLS = Controls(5.0, 0.5, 0.2)
DRIVEN = INPUTS[:3]
SOURCE = Path(__file__).parent / "step_costs.c"
OPTIONS = ("-std=gnu11", "-O3", "-ffp-contract=off", "-fno-math-errno", "-shared", "-fPIC")
OURS, PYTHON, BARE, PLAIN = "native FMU", "Python FMU", "bare model, in Python", "plain C loop with libm, -O3"
Points: TypeAlias = Sequence[tuple[float, float, Controls]]
"""(start, end) [s] of every communication step, and the controls that hold in it."""
SHARES = {"a sine with its cosine": ("sine_loop", 0.3), "a square root": ("root_loop", 1.3)}
"""Parts of a sub-step, the loop that makes them, and where it starts; the weights in simulation/cost.py are these."""
Cases: TypeAlias = Iterator[tuple[tuple[str, str], Ready[int]]]
"""(what, whose) -> what returns how many of it were made."""


class Loops:
    """The loops of step_costs.c.

    Raises:
        OSError: no C compiler, or it failed.
    """

    def __init__(self, folder: Path) -> None:
        name = compiler()
        if name is None:
            raise OSError(f"no C compiler ({', '.join(COMPILERS)})")
        for file, content in {**sources("0" * 32, NATIVE), **headers(NATIVE)}.items():
            (folder / file).write_bytes(content)
        path = folder / "step_costs.so"
        command = [name, *OPTIONS, "-I", str(folder), str(SOURCE), "-o", str(path), "-lm"]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise OSError(f"compiling {SOURCE.name} failed: {done.stderr.strip()}")
        self._library = ctypes.CDLL(str(path))

    def plain(self, state: State, controls: Controls, craft: Craft, h: float, n: int) -> State:
        """n sub-steps of h [s] of semi-implicit Euler with plain drag, in one loop."""
        constants = craft.mass, craft.inertia, craft.drag_factor, craft.drag_center, *actuation(controls, craft), h
        values = (c_double * 6)(*state)
        self._library.plain_loop(*map(c_double, constants), c_int(n), values)
        return State(*values)

    def chain(self, loop: str, start: float, n: int) -> float:
        """n operations of one kind, each of which waits for the one before."""
        function = getattr(self._library, loop)
        function.restype = c_double
        end: float = function(c_double(start), c_int(n))
        return end

    def steps(self, instance: Instance, points: Points) -> Callable[[], int]:
        """Communication steps that a host in C makes: inputs set, a step, outputs read."""
        known = {variable.name: variable.valueReference for variable in instance.description.modelVariables}
        driven, read = ((c_uint * len(names))(*(known[each] for each in names)) for names in (DRIVEN, OUTPUTS))
        times = (c_double * (2 * len(points)))(*(value for start, end, _ in points for value in (start, end - start)))
        given = (c_double * (len(DRIVEN) * len(points)))(
            *(value for point in points for value in point[2][: len(DRIVEN)])
        )
        values, sizes = (c_double * len(OUTPUTS))(), (c_size_t(len(DRIVEN)), c_size_t(len(OUTPUTS)))

        def go() -> int:
            self.on(instance, "step_loop", ("SetReal", "DoStep", "GetReal"), driven, sizes[0], given, read, sizes[1],
                    values, times, c_int(len(points)))  # fmt: skip
            return len(points)

        return go

    def on(self, instance: Instance, loop: str, functions: tuple[str, ...], *arguments: Any) -> None:
        """Have a loop call functions of an instance's library."""
        pointers = [ctypes.cast(instance.function(name), c_void_p) for name in functions]
        status = getattr(self._library, loop)(*pointers, c_void_p(instance.component), *arguments)
        if status > WARNING:
            raise OSError(f"{loop}: the FMU returned {status}")


# ---- the cases


def _started(instance: Instance, go: Callable[[], int], values: Mapping[str, float | str]) -> Ready[int]:
    def ready() -> Callable[[], int]:
        instance.reset()
        instance.start(values)
        return go

    return ready


def substep_cases(native: Instance, loops: Loops | None) -> Cases:
    """Each method in one long step, of the FMU and of the bare model; of the default the plain loop, too."""
    duration, controls, count = SUBSTEPS * STEP_SIZE, native.port(*DRIVEN), native.port("substeps")

    def step() -> int:
        controls.set(CONTROLS[:3])
        native.step(0.0, duration)
        return int(count.get()[0])

    def bare(way: Settings) -> int:
        return advance(State(), CONTROLS, Craft(), duration, way).substeps

    def plain(loops: Loops) -> int:
        loops.plain(State(), CONTROLS, Craft(), STEP_SIZE, SUBSTEPS)
        return SUBSTEPS

    for method in INTEGRATORS:
        what = f"{method.name}: a sub-step"
        if loops and method is INTEGRATORS[0]:
            yield (what, PLAIN), partial(partial, plain, loops)
        own = ("integrator", method.name), ("step_size", STEP_SIZE), ("tolerance", TOLERANCE)
        yield (what, OURS), _started(native, step, dict(own))
        yield (what, BARE), partial(partial, bare, Settings(STEP_SIZE, method, TOLERANCE))


def call_cases(name: str, instance: Instance, loops: Loops | None) -> Cases:
    """Communication steps called by Python and, where there are loops, by C."""
    inputs, outputs = instance.port(*DRIVEN), instance.port(*OUTPUTS)

    def by_python(step: float, n: int) -> int:
        for k in range(n):
            inputs.set(CONTROLS[:3])
            instance.step(k * step, step)
            outputs.get()
        return n

    for step, n in COMMUNICATION_STEPS.items():
        what = f"set, doStep of {step:g} s, get"
        yield (f"fmpy: {what}", name), _started(instance, partial(by_python, step, n), {})
        if loops:
            points = [(k * step, (k + 1) * step, CONTROLS) for k in range(n)]
            yield (f"C host: {what}", name), _started(instance, loops.steps(instance, points), {})


def share_cases(loops: Loops) -> Cases:
    """What a sub-step is made of, operation by operation."""
    for what, (loop, start) in SHARES.items():
        yield (what, OURS), partial(partial, _chained, loops, loop, start)


def _chained(loops: Loops, loop: str, start: float) -> int:
    loops.chain(loop, start, SUBSTEPS)
    return SUBSTEPS


def evaluation_case(solving: Instance, loops: Loops) -> Cases:
    """Model exchange: time, states, derivatives, as a solver asks for them."""

    def go() -> int:
        solving.update_discrete_states()
        solving.enter_continuous_time_mode()
        names = "SetTime", "SetContinuousStates", "GetDerivatives"
        loops.on(solving, "evaluation_loop", names, c_double(STEP_SIZE), SUBSTEPS)
        return SUBSTEPS

    yield ("C host: set time and states, get derivatives", OURS), _started(solving, go, {})


def load_and_free(path: Path) -> int:
    """A file opened, one instance, and both closed."""
    with Fmu(path) as fmu, fmu.instance():
        return 1


# ---- the measurement


def measure(quick: bool, tell: Tell) -> Findings:
    """All cases; quick: a quarter of the rounds. Without a C compiler those called by Python alone."""
    notes, loops = [], None
    with temporary_folder() as place:
        folder = Path(place)
        try:
            loops = Loops(folder)
        except OSError as error:
            notes.append(f"Calls by C were not measured: {error}")
        paths = build_native_fmu(folder / "Native.fmu"), build_fmu(folder / "Python.fmu")
        with (
            Fmu(paths[0]) as native, Fmu(paths[1]) as python, native.instance() as one, python.instance() as other,
            native.instance(exchange=True) as solving,
        ):  # fmt: skip
            cases = [*substep_cases(one, loops), *call_cases(OURS, one, loops), *call_cases(PYTHON, other, loops)]
            for whose, path in zip((OURS, PYTHON), paths, strict=True):
                cases.append((("fmpy: extract, load, instantiate, free", whose), partial(partial, load_and_free, path)))
            cases += [*evaluation_case(solving, loops), *share_cases(loops)] if loops else []
            timed = interleaved(dict(cases), 5 if quick else ROUNDS, tell)
    found = compared(timed)
    notes.append(spread(timed.values()))
    return Findings({"native": found}, [Shown(f"What {NATIVE.identifier} costs", found, "native")], notes=notes)


def compared(timed: Mapping[tuple[str, str], Timed[int]]) -> pl.DataFrame:
    """The native FMU's costs beside those of others, in a unit; ratio [1]: above 1 the native FMU is cheaper."""
    rows = []
    for (what, whose), other in timed.items():
        own, factor, label = timed[what, OURS], 1.0, whose
        if what.endswith("derivatives"):
            other, factor, label = timed["rk4: a sub-step", OURS], 0.25, "a quarter of a sub-step of rk4"
        elif what in SHARES:
            other, label = timed[f"{INTEGRATORS[0].name}: a sub-step", OURS], f"a sub-step of {INTEGRATORS[0].name}"
        elif whose == OURS:
            continue
        unit, scale = ("us", 1e6) if "doStep" in what or "load" in what else ("ns", 1e9)
        native, that = scale * own.least / own.found, factor * scale * other.least / other.found
        rows.append({"what": what, "unit": unit, "native": native, "compared_with": label, "other": that,
                     "ratio": that / native, "spread": max(own.spread, other.spread)})  # fmt: skip
    return pl.DataFrame(rows)
