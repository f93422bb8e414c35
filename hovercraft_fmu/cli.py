"""The command hovercraft-fmu: a thin layer over the functions of the package.

A command loads what it needs when it runs: `--help` is there at once.
"""

import math
import shlex
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread
from time import perf_counter
from typing import TYPE_CHECKING, Any

import click
from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    Task,
    TaskProgressColumn,
    TextColumn,
    TimeRemainingColumn,
)
from rich.table import Table
from rich.text import Text

from ._version import __version__
from .model.craft import PRESETS
from .studies import MEASUREMENTS, carry_out
from .view.operator import PRESET, TIME_SCALE
from .view.tables import markdown

if TYPE_CHECKING:
    from .building import Kind, Product
    from .coupling import Passage
    from .simulation import Advice, Inputs, Result, Run
    from .validation import Check

FOLDER = Path("build")
DEMO_FOLDER = FOLDER / "demo"
OUTPUT = Console(soft_wrap=True, highlight=False, markup=False, width=None if sys.stdout.isatty() else 160)
"""All that is printed is meant as it stands: pip install 'hovercraft-fmu[plot]' is no markup."""
LINE_EVERY = 10.0
"""s: of progress, where it is not shown on a terminal."""
EXPECTED = (ValueError, OSError, ArithmeticError, ModuleNotFoundError)
"""What a wrong name, file or value ends in, beside what an FMU refuses: one line, no traceback."""


class PathOf(click.Path):
    """A path that is not empty: pathlib takes '' for the current folder."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Raises click.BadParameter."""
        if value == "":
            self.fail("'': must be a path", param, ctx)
        return super().convert(value, param, ctx)


def main(arguments: list[str] | None = None) -> None:
    """Run the command and leave the process: status 0, or 1 after a line for each thing that is wrong."""
    try:
        status = commands.main(arguments, prog_name="hovercraft-fmu", standalone_mode=False)
    except click.exceptions.Abort:
        sys.exit("hovercraft-fmu: stopped")
    except click.ClickException as error:
        sys.exit(f"hovercraft-fmu: {error.format_message()}")
    except EXPECTED as error:
        sys.exit("\n".join(f"hovercraft-fmu: {line}" for line in getattr(error, "mistakes", (_one_line(error),))))
    except RuntimeError as error:
        from .host import SimulationError

        if not isinstance(error, SimulationError):
            raise
        sys.exit("hovercraft-fmu: " + _one_line(error))
    sys.exit(status if isinstance(status, int) else 0)


@click.group(invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, message="%(version)s")
@click.pass_context
def commands(context: click.Context) -> None:
    """Build, check, run and draw the hovercraft FMU.

    \b
    New here?
      hovercraft-fmu demo                          build, check and drive it; see build/demo/
      hovercraft-fmu demo --loop                   the same with an autopilot at the helm
      hovercraft-fmu build                         write the FMUs and the SSP files into build/
      hovercraft-fmu drive                         the arrow keys, in a window
      hovercraft-fmu simulate --scene turn --plot turn.png
      hovercraft-fmu simulate --help               what can be set
    """
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


@commands.command("build")
@click.argument("kinds", nargs=-1, metavar="[KIND ...]")
@click.option(
    "--output", type=PathOf(path_type=Path, file_okay=False), metavar="DIR", default=FOLDER, show_default=True
)
@click.option("--name", metavar="NAME", help="Write one FMU under this name, with start values of its own.")
@click.option("--preset", metavar="NAME", help=f"With --name: those of a craft: {', '.join(PRESETS)}.")
@click.option("--set", "settings", multiple=True, metavar="NAME=VALUE", help="With --name: a start value; repeatable.")
def build_command(
    kinds: tuple[str, ...], output: Path, name: str | None, preset: str | None, settings: tuple[str, ...]
) -> None:
    """Write the FMUs and the SSP files of the closed loop.

    KIND is native, native3, python, autopilot, native_loop, native3_loop or python_loop; without it all are written,
    and with --name the native FMU alone.
    """
    from .building import PRODUCTS, product, variant_product
    from .fmu.archive import check_target

    kinds = tuple(dict.fromkeys(kinds))
    if name is not None:
        if len(kinds) > 1:
            raise click.UsageError("--name: must be given with one KIND: it is the name of one file")
        wanted = [variant_product(kinds[0] if kinds else "native", name, preset, _settings(settings))]
    elif preset is not None or settings:
        raise click.UsageError("--preset and --set: must be given with --name, the name of an FMU with those values")
    else:
        wanted = [product(kind) for kind in kinds] or list(PRODUCTS.values())
    for each in wanted:
        check_target(output / each.name, Path(each.name).suffix)
    reasons = {each.name: _written(each, output / each.name) for each in wanted}
    if missing := [name for name, reason in reasons.items() if reason]:
        raise click.ClickException(f"not written: {', '.join(missing)}; {reasons[missing[0]]}")


def _written(chosen: "Product", path: Path) -> str:
    """Write a file and say what it is for; returns why there is no machine code where that is missing."""
    from .fmu.machine_code import NotCompiledError

    try:
        chosen.write(path)
    except NotCompiledError as error:
        return str(error)
    OUTPUT.print(f"{path}: {path.stat().st_size / 1000:.0f} kB, {chosen.purpose}")
    return ""


def of_an_fmu(command: Callable[..., None]) -> Callable[..., None]:
    """The argument FMU and the option --fmu of a command that runs one."""
    kinds = click.Choice(["native", "native3", "python"])
    option = click.option("--fmu", "kind", type=kinds, help="Instead of a file: the FMU of that kind in build/.")
    return click.argument("fmu", required=False, type=PathOf(path_type=Path))(option(command))


@commands.command("simulate")
@of_an_fmu
@click.option("--scene", metavar="NAME", help="A named scene (default: launch).")
@click.option(
    "--input", "log", metavar="FILE.csv", type=PathOf(path_type=Path),
    help="A control log: columns time, thrust, port_thruster, starboard_thruster, wind.x, wind.y (one left out holds "
    "its start value); linear between rows, two rows at one time are a jump.",
)  # fmt: skip
@click.option("--preset", metavar="NAME", help=f"A craft: {', '.join(PRESETS)}.")
@click.option("--start-time", type=float, metavar="S", help="Default: the first time of the inputs.")
@click.option("--stop-time", type=float, metavar="S", help="Default: the last time of the inputs.")
@click.option("--communication-step", type=float, metavar="S", help="Default: the scene's, or 0.01 s.")
@click.option("--set", "settings", multiple=True, metavar="NAME=VALUE", help="Start value of a variable; repeatable.")
@click.option(
    "--output", type=PathOf(path_type=Path), metavar="FILE.csv",
    help="Write all columns; as --input the file gives the same motion again.",
)  # fmt: skip
@click.option("--plot", type=PathOf(path_type=Path), metavar="FILE.png", help="Draw the run.")
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
@click.option("--list-scenes", is_flag=True, help="List the named scenes and stop.")
def simulate_command(
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
    list_scenes: bool,
    **options: Any,
) -> None:
    """Run the FMU over a named scene, or a control log; between communication points, too, inputs go as they are there.

    FMU is the file; without it build/HovercraftNative.fmu, which is built if it is not there.
    """
    from .simulation import plan

    if list_scenes:
        return _print_scenes()
    if scene and log:
        raise click.UsageError("--scene and --input: must not be given together")
    if against is not None and not animation:
        raise click.UsageError("--against: must be given together with --animate")
    start_values = _settings((*settings, "error_estimate=on") if error else settings)
    inputs: Inputs = log if log else scene or "launch"
    others = [{**start_values, **_settings(against.split(","), "--against")}] if against is not None else []
    if plot:
        from .view.plots import check_plot

        check_plot(plot)
    if animation:
        from .view.animation import check_animation

        check_animation(animation)
    _make_room(output, plot, animation)
    runs = [plan(inputs, start_values=each, **options) for each in (start_values, *others)]
    if len(runs[0].signals) == 1 and options["stop_time"] is None:
        duration = runs[0].stop_time - runs[0].start_time
        OUTPUT.print(f"{runs[0].title} has one row: it holds for the default duration, {duration:g} s (--stop-time)")
    path = _named(fmu, kind)
    results = [_simulated(run, path) for run in runs]
    for result in results:
        _print_result(result)
    _write(results[0], output, plot)
    if animation:
        _animate(results, animation)
    return None


@commands.command("advise")
@of_an_fmu
@click.option("--scene", metavar="NAME", help="A named scene (default: launch).")
@click.option("--input", "log", metavar="FILE.csv", type=PathOf(path_type=Path), help="A control log.")
@click.option("--within", type=float, metavar="M", default=0.01, show_default=True,
              help="How far the position may be off, in metres, at every communication point.")  # fmt: skip
@click.option("--preset", metavar="NAME", help=f"A craft: {', '.join(PRESETS)}.")
@click.option("--communication-step", type=float, metavar="S", help="Default: the scene's, or 0.01 s.")
@click.option("--set", "settings", multiple=True, metavar="NAME=VALUE", help="Start value of a variable; repeatable.")
def advise_command(
    fmu: Path | None,
    kind: "Kind | None",
    scene: str | None,
    log: Path | None,
    settings: tuple[str, ...],
    **options: Any,
) -> None:
    """Say which method and sub-step are the cheapest that keep a scene within a wanted error.

    FMU is the file; without it build/HovercraftNative.fmu, which is built if it is not there. Each setting is run with
    the FMU's own estimate of its error; what is advised is checked with one reference run.
    """
    from .simulation import advise

    if scene and log:
        raise click.UsageError("--scene and --input: must not be given together")
    path, inputs = _named(fmu, kind), log or scene or "launch"
    with _progress(1.0, "trying settings") as tell:
        advice = advise(inputs, path, start_values=_settings(settings), tell=tell, **options)
    _print_advice(advice)
    words = ["hovercraft-fmu", "simulate", *([str(path)] if fmu else [])]
    words += ["--input", str(log)] if log else ["--scene", str(inputs)]
    for name, value in options.items():
        words += [f"--{name.replace('_', '-')}", str(value)] if value is not None and name != "within" else []
    chosen = [*settings, *(f"{name}={value}" for name, value in advice.best.start_values.items())]
    OUTPUT.print(f"to run it:\n  {shlex.join([*words, *(word for each in chosen for word in ('--set', each))])}")
    if not advice.is_met:
        raise click.ClickException(f"no setting stays within {advice.within:g} m; that is the best there is")


@commands.command("drive")
@of_an_fmu
@click.option("--record", metavar="FILE.csv", type=PathOf(path_type=Path), help="Write what you do, to replay it.")
@click.option("--preset", metavar="NAME", default=PRESET, show_default=True, help=f"A craft: {', '.join(PRESETS)}.")
@click.option("--integrator", metavar="NAME", help="The method of a sub-step; as --set integrator=NAME.")
@click.option("--step-size", metavar="S", help="The sub-step; as --set step_size=S.")
@click.option("--set", "settings", multiple=True, metavar="NAME=VALUE", help="Start value of a variable; repeatable.")
@click.option("--communication-step", type=float, metavar="S", help="Default: 0.01 s.")
@click.option(
    "--time-scale", type=float, default=TIME_SCALE, show_default=True, metavar="N", help="Simulated seconds a second."
)
def drive_command(
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
    """Drive the FMU from the keyboard: the arrow keys, in a window, in real time.

    FMU is the file; without it build/HovercraftNative.fmu, which is built if it is not there. H shows the keys. What is
    recorded replays to the same bits, with the command that is printed at the end.
    """
    from .fmu.interface import INPUTS
    from .view.drive import drive, plan_drive
    from .view.window import check_display

    short = {"integrator": integrator, "step_size": step_size}
    start_values = _settings((*settings, *(f"{name}={value}" for name, value in short.items() if value is not None)))
    run = plan_drive(preset, start_values, communication_step)
    check_display()
    _make_room(record)
    path = _named(fmu, kind)

    def recorded(log: Path) -> None:
        words = ["hovercraft-fmu", "simulate", str(path), "--input", str(log), "--preset", preset]
        words += ["--communication-step", repr(run.communication_step)]
        kept = {name: value for name, value in start_values.items() if name not in INPUTS}  # the log drives the others
        words += [word for name, value in kept.items() for word in ("--set", f"{name}={value}")]
        OUTPUT.print(f"recorded {log}; to replay it:\n  {shlex.join(words)}")

    end = drive(run, path, record=record, recorded=recorded, time_scale=time_scale)
    OUTPUT.print(f"ended at ({end.x:.3f}, {end.y:.3f}) m, heading {math.degrees(end.heading):.2f} deg")


@commands.command("validate")
@click.argument("fmus", nargs=-1, metavar="[FMU ...]", type=PathOf(path_type=Path))
@click.option("--table", is_flag=True, help="Ask other checkers and hosts, too, and print a table (Markdown).")
def validate_command(fmus: tuple[Path, ...], table: bool) -> int:
    """Check FMUs: the schema, fmpy's validation, and a real run.

    Without FMU: those that 'hovercraft-fmu build' wrote into build/; where there is none, build/HovercraftNative.fmu,
    which is built. (One with --name is named.) With --table hosts run FMUs of the hovercraft alone.
    """
    from .building import built_fmus

    chosen = fmus or built_fmus()
    if table:
        problems = sum(_tabled(fmu, f"\n{fmu}:\n\n" if len(chosen) > 1 else "") for fmu in chosen)
    else:
        problems = sum(_validated(fmu) for fmu in chosen)
    if problems:
        raise click.ClickException(f"{problems} problem{'s' if problems > 1 else ''} found")
    return 0


@commands.command()
@click.option("--loop", is_flag=True, help="The closed loop: an autopilot FMU takes it round a course in a crosswind.")
def demo(loop: bool) -> None:
    """Build the FMUs, check them, and drive them over a recorded control log; see build/demo/."""
    from .building import default_kind
    from .scenes import CONTROL_LOGS, SCENES
    from .simulation import holding, plan
    from .view.plots import check_plot

    picture = check_plot(DEMO_FOLDER / ("loop.png" if loop else "ice.png"))
    native = _built_and_valid(default_kind())
    if loop:
        return _demo_of_the_loop(native, _built_and_valid("autopilot"), picture)
    python = _built_and_valid("python")
    run = plan(CONTROL_LOGS / "ice.csv", preset="ice", communication_step=SCENES["ice"].communication_step)
    result, one, other = (_simulated(*each) for each in ((run, native), (holding(run), native), (holding(run), python)))
    _print_result(result)
    largest, column = max((float(abs(one[name] - other[name]).max()), name) for name in one.names)
    OUTPUT.print(
        f"{native.name} and {python.name} agree where inputs hold over each communication step: of {len(one.names)} "
        f"columns and {len(one['time'])} rows the largest difference is {largest:.2g}, of {column}"
    )
    _write(result, DEMO_FOLDER / "ice.csv", picture)
    OUTPUT.print(
        "\nWorth trying next:\n"
        "  hovercraft-fmu simulate --scene turn --plot build/turn.png\n"
        "  hovercraft-fmu simulate --scene ice --set mass=200 --plot build/heavy.png\n"
        "  hovercraft-fmu simulate --list-scenes"
    )
    return None


def _built_and_valid(kind: "Kind") -> Path:
    from .building import build

    fmu = build(kind)
    OUTPUT.print(f"built {fmu}")
    if _validated(fmu):
        raise click.ClickException("the FMU is not valid")
    return fmu


def _demo_of_the_loop(fmu: Path, autopilot: Path, picture: Path) -> None:
    from .coupling import sail
    from .scenes import VOYAGES
    from .view.plots import plot_passage

    voyage = VOYAGES["crosswind"]
    with _progress(voyage.stop_time) as progress:
        passage = sail(voyage, fmu, autopilot, progress=progress)
    _print_passage(passage)
    OUTPUT.print(f"wrote {passage.write_csv(DEMO_FOLDER / 'loop.csv')}")
    OUTPUT.print(f"wrote {plot_passage(passage, picture)}")


MEASURE = """Measure the product: what speed costs, what accuracy costs, where the methods break.

NAME is one of these; what each takes is on a machine with nothing else to do:

\b
"""
MEASURE += "\n".join(f"  {name:12} {each.what} ({each.takes})" for name, each in MEASUREMENTS.items())


@commands.command(help=MEASURE)
@click.argument("name", metavar="NAME", type=click.Choice(list(MEASUREMENTS)))
@click.option("--quick", is_flag=True, help="Fewer cases: below half a minute.")
@click.option(
    "--output", type=PathOf(path_type=Path, file_okay=False), metavar="DIR", help="Default: build/measure/NAME."
)
def measure(name: str, quick: bool, output: Path | None) -> None:  # noqa: D103 - MEASURE
    folder = output or FOLDER / "measure" / name
    with _progress(1.0, f"measuring {name}") as tell:
        report = carry_out(name, quick, folder, tell)
    OUTPUT.print(f"{report}\n\nwrote {folder}/")


@commands.command("sweep")
@click.argument("study")
@of_an_fmu
@click.option("--engine", metavar="NAME", default="fmu", show_default=True,
              help="fmu, or batch: the compiled kernel, all craft at once, with the native FMU's bits.")  # fmt: skip
@click.option("--workers", type=int, metavar="N", help="Processes on this machine. Default: one a processor.")
@click.option("--scheduler", metavar="ADDRESS", help="A dask.distributed scheduler, as tcp://10.0.0.1:8786.")
@click.option(
    "--output", type=PathOf(path_type=Path, file_okay=False), metavar="DIR",
    help="Default: build/sweep/ and the study.",
)  # fmt: skip
@click.option("--plot", type=PathOf(path_type=Path), metavar="FILE.png", help="Draw the results.")
def sweep_command(
    study: str,
    fmu: Path | None,
    kind: "Kind | None",
    output: Path | None,
    plot: Path | None,
    engine: str,
    **options: Any,
) -> None:
    """Make many runs of one FMU, in parallel, into Parquet files.

    STUDY is a TOML file, or the name of a study of the package: turning_circle. FMU is the file; without it
    build/HovercraftNative.fmu, which is built if it is not there. A sweep that was ended goes on where it was with the
    same command.
    """
    from .sweep import read_study, sweep

    chosen = read_study(study)
    if plot:
        from .view.plots import check_plot

        check_plot(plot)
    _make_room(plot)
    path = _named(fmu, kind) if engine == "fmu" or kind else fmu
    begun = perf_counter()
    with _progress(chosen.runs, "sweeping", MofNCompleteColumn(), _Rate()) as tell:
        outcome = sweep(chosen, path, engine=engine, output=output, tell=tell, **options)
    seconds = perf_counter() - begun
    OUTPUT.print(f"{outcome.folder}: {outcome.runs} runs, {outcome.new} of them made now in {seconds:.1f} s")
    if outcome.error:
        OUTPUT.print(f"{outcome.failed} failed; the first is {outcome.error}")
    if outcome.warned:
        OUTPUT.print(f"{outcome.warned} with warnings of the FMU; see their column")
    _print_extremes(outcome.folder)
    if plot:
        from .sweep.charts import plot_sweep

        OUTPUT.print(f"wrote {plot_sweep(outcome.folder, plot)}")


@commands.command("cross-check")
@click.argument("folder", metavar="DIR", type=PathOf(path_type=Path, file_okay=False))
def cross_check_command(folder: Path) -> None:
    """Write what the FMI cross-check asks for: the native FMU, inputs, options, a reference result."""
    from .cross_check import write_cross_check

    for place in write_cross_check(folder):
        OUTPUT.print(f"wrote {place}")


# ---- what the commands share


def _one_line(error: Exception) -> str:
    if isinstance(error, OSError) and error.filename:
        return f"{error.filename}: {error.strerror}"
    return " ".join(str(error).split())


def _settings(texts: Iterable[str], option: str = "--set") -> dict[str, str]:
    settings: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        name = name.strip()
        if not (equals and name):
            raise click.UsageError(f"{option} {text}: must be NAME=VALUE")
        if name in settings:
            raise click.UsageError(f"{option} {text}: must be given once, and is {name}={settings[name]} already")
        settings[name] = value.strip()
    return settings


class _Rate(ProgressColumn):
    """Runs a second."""

    def render(self, task: Task) -> Text:
        return Text(f"{task.speed:.3g} runs/s" if task.speed else "")


@contextmanager
def _progress(total: float, doing: str = "simulating", *more: ProgressColumn) -> Iterator[Callable[[float], None]]:
    """A bar with the time left, on a terminal; it goes away when the run has ended. Else a line every ten seconds."""
    columns = (TextColumn(doing), BarColumn(), TaskProgressColumn(), *more, TimeRemainingColumn())
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as progress:
        number, ended = progress.add_task("", total=total), Event()
        if not console.is_terminal:
            Thread(target=_tell_lines, args=(doing, progress.tasks[number], ended), daemon=True).start()
        try:
            yield lambda time: progress.update(number, completed=time)
        finally:
            ended.set()


def _tell_lines(doing: str, task: Task, ended: Event) -> None:
    begun = perf_counter()
    while not ended.wait(LINE_EVERY):
        click.echo(f"{doing}: {task.percentage:.0f} %, {perf_counter() - begun:.0f} s", err=True)


def _named(fmu: Path | None, kind: "Kind | None") -> Path:
    """The file that is to be run, and say which it is. Raises as `read_description` does."""
    from .building import default_fmu
    from .fmu.interface import HOVERCRAFT
    from .host import read_description

    if fmu and kind:
        raise click.UsageError(f"--fmu {kind}: must not be given together with the file {fmu}")
    path = fmu or default_fmu(kind)
    read_description(path, model=HOVERCRAFT.name)
    OUTPUT.print(f"running {path}")
    return path


def _make_room(*files: Path | None) -> None:
    """Make the folders of files that are written after a run: what cannot be is said before it."""
    for file in filter(None, files):
        try:
            file.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            why = f"{error.filename}: {error.strerror}"
            raise click.ClickException(f"{file}: must be in a folder that can be made; {why}") from error
        if file.is_dir():
            raise click.ClickException(f"{file}: is a folder: must be the name of a file")


def _simulated(run: "Run", fmu: Path) -> "Result":
    from .simulation import run_fmu

    with _progress(run.stop_time) as progress:
        return run_fmu(run, fmu, progress)


def _validated(fmu: Path) -> int:
    """Check one FMU, print what was checked, and return the number of problems."""
    from .validation import validate

    checks = validate(fmu)  # refuses what is no FMU
    OUTPUT.print(f"checking {fmu}")
    problems = 0
    for check in checks:
        OUTPUT.print(f"  {check.result:6} {check.what} ({check.checker} {check.version})")
        for problem in check.problems:
            OUTPUT.print(f"         {problem}")
        problems += len(check.problems)
    return problems


def _tabled(fmu: Path, title: str) -> int:
    """The same in a table, with the checks of others."""
    from .validation import validate, validate_elsewhere

    checks = [*validate(fmu), *validate_elsewhere(fmu)]
    click.echo(title + _checked_table(checks))
    return sum(len(check.problems) for check in checks)


def _checked_table(checks: "list[Check]") -> str:
    rows = [
        (
            check.checker,
            check.version,
            check.what,
            "; ".join([check.result, *check.problems, check.missing]).rstrip("; "),
        )
        for check in checks
    ]
    return markdown(("checker or host", "version", "what was run", "result"), rows)


def _print_scenes() -> None:
    from .scenes import SCENES

    table = Table(box=None, pad_edge=False)
    for title in ("scene", "what happens", "craft", "duration", "exact solution"):
        table.add_column(title)
    for scene in SCENES.values():
        exact = "yes" if scene.exact else ""
        table.add_row(scene.name, scene.description, scene.preset, f"{scene.stop_time:g} s", exact)
    OUTPUT.print(table)


def _print_extremes(folder: Path) -> None:
    from .sweep.store import extremes

    table = Table(box=None, pad_edge=False)
    for title in ("column", "least", "of the run with", "greatest", "of the run with"):
        table.add_column(title)
    for each in extremes(folder):
        cells = [each.column]
        for value, run in ((each.least, each.least_run), (each.greatest, each.greatest_run)):
            cells += [f"{value:.4g} {each.unit}", ", ".join(f"{name} = {part:.4g}" for name, part in run.items())]
        table.add_row(*cells)
    if table.row_count:
        OUTPUT.print(table)


def _print_passage(passage: "Passage") -> None:
    off = abs(passage["cross_track_error"])
    arrived = f"after {passage['time'][-1]:g} s" if passage.arrived else "no"
    distance = passage.distance
    _print_rows(
        f"{passage.voyage.name}: {passage.voyage.description}",
        {
            "waypoints reached": f"{int(passage['waypoint'][-1]) - (not passage.arrived)} of {len(passage.waypoints)}",
            "arrived": arrived,
            "distance": f"{distance:.2f} m, {distance / passage.craft.length:.1f} craft lengths",
            "off the legs": f"{off.mean():.2f} m in the mean, {off.max():.2f} m where a leg begins",
        },
    )


def _print_rows(title: str, rows: dict[str, str]) -> None:
    table = Table(title=title, title_justify="left", show_header=False, box=None, pad_edge=False)
    for name, text in rows.items():
        table.add_row(name, text)
    OUTPUT.print(table)


def _print_result(result: "Result") -> None:
    run = result.run
    rows = {
        "duration": f"{result['time'][-1] - run.start_time:g} s, {len(result['time']) - 1} communication steps",
        "sub-steps": f"{result['substeps'][-1]}",
        "distance": f"{result.distance:.2f} m, {result.distance / run.craft.length:.1f} craft lengths",
        "largest speed": f"{result['speed'].max():.3f} m/s",
        "headings": f"{math.degrees(result['pose.heading'].min()):.1f} ... "
        f"{math.degrees(result['pose.heading'].max()):.1f} deg",
        "end position": f"({result['pose.x'][-1]:.3f}, {result['pose.y'][-1]:.3f}) m",
        "end heading": f"{math.degrees(result['pose.heading'][-1]):.2f} deg",
        "end speed": f"{result['speed'][-1]:.4f} m/s",
    }
    if result.is_estimated:
        rows["error, as told"] = result.error_in_words
    _print_rows(f"{run.title}: {run.method}", rows)
    for warning in result.warnings:
        OUTPUT.print(f"warning: {warning}")


def _print_advice(advice: "Advice") -> None:
    from .simulation import metres

    table = Table(box=None, pad_edge=False)
    for title in ("", "setting", "sub-steps", "loads", "time", "off, as told", "off a reference run"):
        table.add_column(title)
    for what, tried in (("best", advice.best), ("runner-up", advice.runner_up)):
        if tried:
            table.add_row(what, tried.words, f"{tried.substeps}", f"{tried.loads}", f"{1e3 * tried.seconds:.3g} ms",
                          metres(tried.told), metres(tried.true))  # fmt: skip
    run = advice.run
    OUTPUT.print(f"{run.title}, {run.stop_time - run.start_time:g} s: at most {metres(advice.within)} off")
    OUTPUT.print(table)
    OUTPUT.print(
        f"a host that holds the inputs over communication steps of {run.communication_step:g} s is "
        f"{metres(advice.held)} off, whatever the method"
    )


def _write(result: "Result", output: Path | None, plot: Path | None) -> None:
    if output:
        OUTPUT.print(f"wrote {result.write_csv(output)}")
    if plot:
        from .view.plots import plot_run

        OUTPUT.print(f"wrote {plot_run(result, plot)}")


def _animate(results: "Sequence[Result]", animation: Path) -> None:
    from .view.animation import animate

    with _progress(1.0, "drawing") as tell:
        path = animate(results, animation, tell)
    OUTPUT.print(f"wrote {path}: {path.stat().st_size / 1000:.0f} kB")
