"""The trade: what speed costs and what accuracy costs, with the FMU's own methods and with a solver of the host's.

What is ranked is counted; the time stands beside it.
"""

from collections.abc import Callable
from pathlib import Path

import polars as pl

from ..fmu.description import NATIVE
from ..fmu.interface import INPUTS, OUTPUTS
from ..fmu.machine_code import library
from ..fmu.native_package import build_native_fmu
from ..fmu.python_package import build_fmu
from ..fmu.start_values import Value
from ..host import Fmu, Instance
from ..model.integrators import INTEGRATORS
from ..scenes import SCENES
from ..simulation import ROOT, SINE, Run, held_steps, method_in_words, plan
from ..whole import temporary_folder
from . import owners, work_precision
from .laboratory import Findings, Ready, Shown, Tell, interleaved, part, spread
from .model_exchange import SMOOTH, exchanged
from .step_costs import Loops, Points

TIMED_SCENE, TIMED_STEP = "turn", 0.5
"""Its inputs jump at whole seconds and hold between: three are set, nine outputs read at communication points."""
TIMED = {
    "semi_implicit_euler": (0.5, 0.1, 0.001), "drag_implicit": (0.5,), "rk4": (0.5, 0.1), "adaptive": (1e-4, 1e-8),
    "splitting": (0.5, 0.1),
}  # fmt: skip
"""Method -> sub-steps [s], or tolerances; the last of Euler's is the default."""
ROUNDS = 15
SEED = 1
"""Of the random craft."""
WAYS = ("C host", "fmpy", "Python FMU")
"""Native FMU called by C, by Python; and the Python FMU, called by Python."""


def through(instance: Instance, points: Points) -> Callable[[], int]:
    """The whole run by Python: three inputs, a step, the outputs at every communication point."""
    inputs, outputs = instance.port(*INPUTS[:3]), instance.port(*OUTPUTS)
    steps = [(time, end - time, controls[:3]) for time, end, controls in points]

    def go() -> int:
        for time, duration, values in steps:
            inputs.set(values)
            instance.step(time, duration)
            outputs.get()
        return len(steps)

    return go


def _started(instance: Instance, run: Run, go: Callable[[], int]) -> Ready[int]:
    def ready() -> Callable[[], int]:
        instance.reset()
        instance.start(run.start_values)
        return go

    return ready


def times(native: Instance, python: Instance, folder: Path, runs: pl.DataFrame, quick: bool, tell: Tell) -> Findings:
    """Some settings on TIMED_SCENE: loads a simulated second and error, and beside them us a simulated second."""
    scene, notes = SCENES[TIMED_SCENE], []
    try:
        loops = Loops(folder)
    except OSError as error:
        loops, notes = None, [f"No calls by C were timed: {error}"]
    cases: dict[tuple[str, float, str], Ready[int]] = {}
    for method in INTEGRATORS:
        for setting in TIMED.get(method.name, ()):
            values: dict[str, Value] = {
                "integrator": method.name,
                "step_size" if method.integrate else "tolerance": setting,
            }
            run = plan(scene, start_values=values, communication_step=TIMED_STEP)
            points = list(held_steps(run))
            if loops:
                cases[method.name, setting, "C host"] = _started(native, run, loops.steps(native, points))
            cases[method.name, setting, "fmpy"] = _started(native, run, through(native, points))
            cases[method.name, setting, "Python FMU"] = _started(python, run, through(python, points))
    timed = interleaved(cases, 2 if quick else ROUNDS, tell)
    known = runs.filter(scene=TIMED_SCENE, communication_step=1.0)
    rows = []
    for name, setting in dict.fromkeys(key[:2] for key in cases):
        row = known.row(by_predicate=(pl.col("method") == name) & (pl.col("setting") == setting), named=True)
        own = {way: timed[name, setting, way] for way in WAYS if (name, setting, way) in timed}
        rows.append({
            "method": name, "setting": method_in_words(name, setting, setting), "loads": row["loads"],
            "largest_error": row["largest_error"],
            **{way: 1e6 * each.least / scene.stop_time for way, each in own.items()},
            "spread": max(each.spread for each in own.values()),
        })  # fmt: skip
    found = pl.DataFrame(rows).sort("loads", maintain_order=True)
    notes.append(spread(timed.values()))
    title = f"Scene {TIMED_SCENE}, communication step {TIMED_STEP} s: loads and, beside them, us a simulated second"
    return Findings({"times": found}, [Shown(title, found.drop("method"))], notes=notes)


def ownership(runs: pl.DataFrame, tell: Tell) -> Findings:
    """The map, and what it says of methods that own nothing."""
    found = owners.map_of([*owners.of_scenes(runs), *owners.of_random_craft(SEED, tell)])
    idle = owners.superseded(found)
    notes = [
        f"A load: {SINE:g} of it a sine with its cosine, {ROOT:g} a square root. Within {owners.TIE:g} times: a tie.",
        f"Superseded, as the cheapest nowhere on the map: {', '.join(idle) or 'none'}",
    ]
    return Findings({"owners": found}, [Shown("The cheapest method by count, region by region", found)], notes=notes)


def measure(quick: bool, tell: Tell) -> Findings:
    """Every scene with every setting; quick: one scene."""
    scenes = [SCENES[TIMED_SCENE]] if quick else list(SCENES.values())
    runs = work_precision.measured(scenes, part(tell, 0.0, 0.3))
    found = Findings({"work_precision": runs.with_columns(pl.col(pl.Float64).round_sig_figs(4))})
    choices = owners.choices(runs, [scene.name for scene in scenes if scene.craft.rubs])
    found.tables.append(Shown("What to set, and how far it is off on any of the scenes", choices, "advice"))
    found.records["advice"] = choices
    found.add(ownership(runs, part(tell, 0.3, 0.4)))
    found.add(work_precision.accuracy(quick))
    found.pictures["work_precision"] = work_precision.draw_work_precision(runs, found.records["holding"])
    if missing := library(NATIVE).missing:
        found.notes.append(f"Times and model exchange were not measured: {missing}")
        return found
    with temporary_folder() as place:
        folder = Path(place)
        paths = build_native_fmu(folder / "Native.fmu"), build_fmu(folder / "Python.fmu")
        with (
            Fmu(paths[0]) as native, Fmu(paths[1]) as python, native.instance() as one, python.instance() as other,
            native.instance(exchange=True) as solving,
        ):  # fmt: skip
            found.add(times(one, other, folder, runs, quick, part(tell, 0.6, 0.8)))
            found.add(exchanged(solving, scenes if quick else SMOOTH, runs, part(tell, 0.8, 1.0)))
    return found
