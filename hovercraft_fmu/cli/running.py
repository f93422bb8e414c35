"""The commands that run one craft: simulate, advise, drive."""

import math
import shlex
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..model.craft import PRESETS
from ..view.operator import PRESET, TIME_SCALE
from .options import PRESET_NAME, PathOf, make_room, named_fmu, of_an_fmu, scene_option, set_option, settings_of
from .output import OUTPUT, json_option, print_json, print_rows, print_table, progress_of

if TYPE_CHECKING:
    from ..building import Kind
    from ..simulation import Advice, Difference, Inputs, Result, Run

WITHIN = 1e-9
"""Of a stored result, where nothing else is asked for."""


@click.command("simulate")
@of_an_fmu
@scene_option
@click.option(
    "--input", "log", metavar="FILE.csv", type=PathOf(path_type=Path),
    help="A control log: columns time, thrust, port_thruster, starboard_thruster, wind.x, wind.y, external.force.x, "
    "external.force.y, external.moment (one left out holds its start value); linear between rows, two rows at one time "
    "are a jump.",
)  # fmt: skip
@click.option("--preset", metavar="NAME", type=PRESET_NAME, help=f"A craft: {', '.join(PRESETS)}.")
@click.option("--start-time", type=float, metavar="S", help="Default: the first time of the inputs.")
@click.option("--stop-time", type=float, metavar="S", help="Default: the last time of the inputs.")
@click.option("--communication-step", type=float, metavar="S", help="Default: the scene's, or 0.01 s.")
@set_option
@click.option(
    "--output", type=PathOf(path_type=Path), metavar="FILE.csv|FILE.parquet",
    help="Write all columns. As --input a CSV file gives the same inputs again; preset, start values and communication "
    "step are to be given again.",
)  # fmt: skip
@click.option("--plot", type=PathOf(path_type=Path), metavar="FILE.png|.svg|.pdf", help="Draw the run.")
@click.option(
    "--animate", "animation", type=PathOf(path_type=Path), metavar="FILE.gif|FILE.html",
    help="Draw the run as a moving picture, or as a page to play, zoom and point at.",
)  # fmt: skip
@click.option(
    "--against", metavar="NAME=VALUE,...",
    help="Animate a second run with these start values beside it: integrator=rk4,step_size=0.1. (--output and --plot "
    "are of the first.)",
)  # fmt: skip
@click.option("--error", is_flag=True, help="Have the FMU tell how far it is off; three times the cost.")
@click.option("--reference", type=PathOf(path_type=Path), metavar="FILE.csv|.parquet",
              help="Compare the run with a stored result, column by column; fails where one is off.")  # fmt: skip
@click.option(
    "--within", type=float, metavar="X",
    help=f"With --reference: how far off a value may be (default {WITHIN:g}); relative where it is above 1.",
)  # fmt: skip
@json_option
@click.option("--list-scenes", is_flag=True, help="List the named scenes and stop.")
def simulate(
    fmu: Path | None,
    kind: "Kind | None",
    scene: str | None,
    log: Path | None,
    settings: tuple[str, ...],
    output: Path | None,
    plot: Path | None,
    animation: Path | None,
    against: str | None,
    error: bool,
    reference: Path | None,
    within: float | None,
    as_json: bool,
    list_scenes: bool,
    **options: Any,
) -> None:
    """Run the FMU over a named scene, or a control log; between communication points, too, inputs go as they are there.

    FMU is the file; without it build/HovercraftNative.fmu, which is built if it is not there.
    """
    from ..simulation import differences, plan, read_columns

    if list_scenes:
        return _print_scenes()
    if scene and log:
        raise click.UsageError("--scene and --input: must not be given together")
    if against is not None and not animation:
        raise click.UsageError("--against: must be given together with --animate")
    if within is not None and not reference:
        raise click.UsageError("--within: must be given together with --reference")
    if within is not None and not 0.0 <= within < math.inf:
        raise click.UsageError(f"--within {within}: must be a finite number, at least 0")
    start_values = settings_of((*settings, "error_estimate=on") if error else settings)
    inputs: Inputs = log if log else scene or "launch"
    others = [{**start_values, **settings_of(against.split(","), "--against")}] if against is not None else []
    _check_files(output, plot, animation)
    stored = read_columns(reference) if reference else None
    runs = [plan(inputs, start_values=each, **options) for each in (start_values, *others)]
    if len(runs[0].signals) == 1 and options["stop_time"] is None:
        duration = runs[0].stop_time - runs[0].start_time
        OUTPUT.print(f"{runs[0].title} has one row: it holds for the default duration, {duration:g} s (--stop-time)")
    if runs[0].cut:
        OUTPUT.print(f"{runs[0].title}: the record was cut, it does not say how it ended: at most a second is missing")
    _say_unused(runs[0])
    path = named_fmu(fmu, kind)
    results = [simulated(run, path) for run in runs]
    for result in results:
        print_result(result)
    _compare_starts(results[0])
    write(results[0], output, plot)
    if animation:
        _animate(results, animation)
    off = [] if stored is None else differences(results[0], stored)
    if as_json:
        print_json({**results[0].summary, "fmu": path, "reference": [each._asdict() for each in off]})
    if stored is not None:
        _judge(off, str(reference), WITHIN if within is None else within)
    return None


@click.command("advise")
@of_an_fmu
@scene_option
@click.option("--input", "log", metavar="FILE.csv", type=PathOf(path_type=Path), help="A control log.")
@click.option("--within", type=float, metavar="M", default=0.01, show_default=True,
              help="How far the position may be off, in metres, at every communication point.")  # fmt: skip
@click.option("--preset", metavar="NAME", type=PRESET_NAME, help=f"A craft: {', '.join(PRESETS)}.")
@click.option("--communication-step", type=float, metavar="S", help="Default: the scene's, or 0.01 s.")
@set_option
@json_option
def advise(
    fmu: Path | None,
    kind: "Kind | None",
    scene: str | None,
    log: Path | None,
    settings: tuple[str, ...],
    as_json: bool,
    **options: Any,
) -> None:
    """Say which method and sub-step are the cheapest that keep a scene within a wanted error.

    FMU is the file; without it build/HovercraftNative.fmu, which is built if it is not there. Each setting is run with
    the FMU's own estimate of its error; what is advised is checked with one reference run.
    """
    from ..simulation import advise

    if scene and log:
        raise click.UsageError("--scene and --input: must not be given together")
    path, inputs = named_fmu(fmu, kind), log or scene or "launch"
    with progress_of(1.0, "trying settings") as tell:
        advice = advise(inputs, path, start_values=settings_of(settings), tell=tell, **options)
    _print_advice(advice)
    words = ["hovercraft-fmu", "simulate", *([str(path)] if fmu else [])]
    words += ["--input", str(log)] if log else ["--scene", str(inputs)]
    for name, value in options.items():
        words += [f"--{name.replace('_', '-')}", str(value)] if value is not None and name != "within" else []
    chosen = [*settings, *(f"{name}={value}" for name, value in advice.best.start_values.items())]
    command = shlex.join([*words, *(word for each in chosen for word in ("--set", each))])
    OUTPUT.print(f"to run it:\n  {command}")
    if as_json:
        tried = {"best": advice.best, "runner_up": advice.runner_up}
        found = {name: each and asdict(each) for name, each in tried.items()}
        print_json({**found, "within": advice.within, "is_met": advice.is_met, "held": advice.held, "command": command})
    if not advice.is_met:
        raise click.ClickException(f"no setting stays within {advice.within:g} m; that is the best there is")


@click.command("drive")
@of_an_fmu
@click.option("--record", metavar="FILE.csv", type=PathOf(path_type=Path), help="Write what you do, to replay it.")
@click.option(
    "--preset",
    metavar="NAME",
    type=PRESET_NAME,
    default=PRESET,
    show_default=True,
    help=f"A craft: {', '.join(PRESETS)}.",
)
@click.option("--integrator", metavar="NAME", help="The method of a sub-step; as --set integrator=NAME.")
@click.option("--step-size", metavar="S", help="The sub-step; as --set step_size=S.")
@set_option
@click.option("--communication-step", type=float, metavar="S", help="Default: 0.01 s.")
@click.option(
    "--time-scale", type=float, default=TIME_SCALE, show_default=True, metavar="N", help="Simulated seconds a second."
)
def drive(
    fmu: Path | None,
    kind: "Kind | None",
    record: Path | None,
    preset: str,
    integrator: str | None,
    step_size: str | None,
    settings: tuple[str, ...],
    communication_step: float | None,
    time_scale: float,
) -> None:
    """Drive the FMU from the keyboard: arrows or WASD, in a window, in real time; G lays a course of gates.

    FMU is the file; without it build/HovercraftNative.fmu, which is built if it is not there. H shows the keys. What is
    recorded replays to the same bits, with the command that is printed at the end.
    """
    from ..fmu.interface import INPUTS
    from ..view.drive import drive, plan_drive
    from ..view.window import check_display

    short = {"integrator": integrator, "step_size": step_size}
    start_values = settings_of((*settings, *(f"{name}={value}" for name, value in short.items() if value is not None)))
    run = plan_drive(preset, start_values, communication_step)
    check_display()
    make_room(record)
    path = named_fmu(fmu, kind)

    def recorded(log: Path) -> None:
        words = ["hovercraft-fmu", "simulate", str(path), "--input", str(log), "--preset", preset]
        words += ["--communication-step", repr(run.communication_step)]
        kept = {name: value for name, value in start_values.items() if name not in INPUTS}  # the log drives the others
        words += [word for name, value in kept.items() for word in ("--set", f"{name}={value}")]
        OUTPUT.print(f"recorded {log}; to replay it:\n  {shlex.join(words)}")

    end = drive(run, path, record=record, recorded=recorded, time_scale=time_scale)
    OUTPUT.print(f"ended at ({end.x:.3f}, {end.y:.3f}) m, heading {math.degrees(end.heading):.2f} deg")


def _say_unused(run: "Run") -> None:
    """What is in the inputs' file and not used: of a result all but the inputs."""
    from ..fmu.interface import OUTPUTS

    if set(OUTPUTS) <= set(run.unused):
        OUTPUT.print(
            f"{run.title} is a result: its inputs are used, not its outputs and the settings that it was made with"
        )
    elif run.unused:
        OUTPUT.print(f"{run.title}: columns not used: {', '.join(run.unused)}")


def _compare_starts(result: "Result") -> None:
    """Say where the states in the first row of the inputs' file are not those that the run began with."""
    begun = {name: float(result[name][0]) for name, _ in result.run.begins}
    off = [
        f"{name} = {value:g}, not {begun[name]:g}"
        for name, value in result.run.begins
        if not math.isclose(value, begun[name], rel_tol=1e-9, abs_tol=1e-9)
    ]
    if off:
        OUTPUT.print(f"warning: {result.run.title} begins elsewhere than the run: {', '.join(off)} (--set)")


def simulated(run: "Run", fmu: Path) -> "Result":
    """Run it, and tell how far it is."""
    from ..simulation import run_fmu

    with progress_of(run.stop_time) as progress:
        return run_fmu(run, fmu, progress)


def _print_scenes() -> None:
    from ..scenes import SCENES

    rows = [
        (scene.name, scene.description, scene.preset, f"{scene.stop_time:g} s", "yes" if scene.exact else "")
        for scene in SCENES.values()
    ]
    print_table(("scene", "what happens", "craft", "duration", "exact solution"), rows)


def _check_files(output: Path | None, plot: Path | None, animation: Path | None) -> None:
    """What cannot be written is said before the run."""
    if output:
        from ..simulation import check_output

        check_output(output)
    if plot:
        from ..drawing.figures import check_plot

        check_plot(plot)
    if animation:
        from ..view.animation import check_animation

        check_animation(animation)
    make_room(output, plot, animation)


def _judge(found: "Sequence[Difference]", reference: str, within: float) -> None:
    """Say how far each column is off. Raises click.ClickException where one is too far."""
    wrong = [each for each in found if not each.largest <= within]
    rows = [
        (each.column, f"{each.largest:.3g}", f"{each.time:g} s", "FAILED" if each in wrong else "ok") for each in found
    ]
    print_table(("column", "largest difference", "at", f"within {within:g}"), rows)
    if wrong:
        worst = f"{wrong[0].column} by {wrong[0].largest:.3g} at {wrong[0].time:g} s"
        raise click.ClickException(f"{len(wrong)} of {len(found)} columns differ from {reference}, most {worst}")
    OUTPUT.print(f"{len(found)} column{'s are those' if len(found) > 1 else ' is that'} of {reference}")


def print_result(result: "Result") -> None:
    """What came of a run, in a few lines."""
    print_rows(f"{result.run.title}: {result.run.method}", result.in_words)
    for warning in result.warnings:
        OUTPUT.print(f"warning: {warning}")


def _print_advice(advice: "Advice") -> None:
    from ..simulation import metres

    rows = [
        (what, tried.words, f"{tried.substeps}", f"{tried.loads}", f"{1e3 * tried.seconds:.3g} ms", metres(tried.told),
         metres(tried.true))
        for what, tried in (("best", advice.best), ("runner-up", advice.runner_up)) if tried
    ]  # fmt: skip
    run = advice.run
    OUTPUT.print(f"{run.title}, {run.stop_time - run.start_time:g} s: at most {metres(advice.within)} off")
    print_table(("", "setting", "sub-steps", "loads", "time", "off, as told", "off a reference run"), rows)
    OUTPUT.print("ranked by the loads that are worked out, the same on every machine; times are of this one")
    OUTPUT.print(
        f"a host that holds the inputs over communication steps of {run.communication_step:g} s is "
        f"{metres(advice.held)} off, whatever the method"
    )


def write(result: "Result", output: Path | None, plot: Path | None) -> None:
    """Write the files that were asked for."""
    if output:
        OUTPUT.print(f"wrote {result.write(output)}")
    if plot:
        from ..view.plots import plot_run

        OUTPUT.print(f"wrote {plot_run(result, plot)}")


def _animate(results: "Sequence[Result]", animation: Path) -> None:
    from ..view.animation import animate

    with progress_of(1.0, "drawing") as tell:
        path = animate(results, animation, tell)
    OUTPUT.print(f"wrote {path}: {path.stat().st_size / 1000:.0f} kB")
