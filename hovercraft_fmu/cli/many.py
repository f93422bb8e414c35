"""The commands that make many runs: measure, sweep."""

from collections.abc import Iterable
from contextlib import ExitStack
from datetime import timedelta
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Any

import click
from rich.filesize import decimal
from rich.progress import MofNCompleteColumn, ProgressColumn, Task
from rich.text import Text

from ..studies import MEASUREMENTS, carry_out, ready
from .helping import write_rows
from .options import FOLDER, NameOf, PathOf, make_room, named_fmu, of_an_fmu
from .output import OUTPUT, json_option, print_json, print_table, progress_of

if TYPE_CHECKING:
    from ..building import Kind
    from ..sweeps.reading import Extreme
    from ..sweeps.study import Study


class _Measure(click.Command):
    """Its help lists what there is to be measured."""

    def format_help_text(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        super().format_help_text(ctx, formatter)
        rows = [(name, f"{each.what} ({each.takes})") for name, each in MEASUREMENTS.items()]
        write_rows(formatter, "NAME", rows)


@click.command(cls=_Measure)
@click.argument("name", metavar="NAME", type=NameOf(lambda: MEASUREMENTS))
@click.option("--quick", is_flag=True, help="Fewer cases: below half a minute.")
@click.option(
    "--output", type=PathOf(path_type=Path, file_okay=False), metavar="DIR", help="Default: build/measure/NAME."
)
def measure(name: str, quick: bool, output: Path | None) -> None:
    """Measure the product: what speed costs, what accuracy costs, where the methods break.

    What each takes is on a machine with nothing else to do.
    """
    folder = output or FOLDER / "measure" / name
    ready(name)
    takes = "less than half a minute" if quick else MEASUREMENTS[name].takes
    click.echo(f"measuring {name} takes {takes} on a machine with nothing else to do", err=True)
    with progress_of(1.0, f"measuring {name}") as tell:
        report = carry_out(name, quick, folder, tell)
    OUTPUT.print(f"{report}\n\nwrote {folder}/")


def _studies() -> Iterable[str]:
    from ..sweeps import STUDIES

    return STUDIES


@click.command("sweep")
@click.argument("study", type=NameOf(_studies))
@of_an_fmu
@click.option("--engine", metavar="NAME", default="fmu", show_default=True,
              help="fmu, or batch: the compiled kernel, all craft at once, with the native FMU's bits.")  # fmt: skip
@click.option("--workers", type=int, metavar="N", help="Processes on this machine. Default: one a processor.")
@click.option("--scheduler", metavar="ADDRESS", help="A dask.distributed scheduler, as tls://10.0.0.1:8786.")
@click.option(
    "--tls-ca", type=PathOf(path_type=Path), metavar="FILE.pem", help="Who signed the scheduler's certificate."
)
@click.option("--tls-cert", type=PathOf(path_type=Path), metavar="FILE.pem", help="Your certificate.")
@click.option("--tls-key", type=PathOf(path_type=Path), metavar="FILE.pem", help="Its key.")
@click.option(
    "--output", type=PathOf(file_okay=False), metavar="DIR|ADDRESS",
    help="A folder, or s3://bucket/folder and the like. Default: build/sweep/ and the study.",
)  # fmt: skip
@click.option("--part", metavar="K/N", help="Make the K-th of N parts alone, as 2/8; together they are the sweep.")
@click.option("--dry-run", is_flag=True, help="Say what it would come to: runs, chunks, bytes, time. Nothing is made.")
@click.option("--overwrite", is_flag=True, help="Delete the results that are there, of this or another sweep, before.")
@click.option("--plot", type=PathOf(path_type=Path), metavar="FILE.png|.svg|.pdf", help="Draw the results.")
@json_option
def sweep(
    study: str,
    fmu: Path | None,
    kind: "Kind | None",
    output: str | None,
    plot: Path | None,
    engine: str,
    tls_ca: Path | None,
    tls_cert: Path | None,
    tls_key: Path | None,
    dry_run: bool,
    as_json: bool,
    **options: Any,
) -> None:
    """Make many runs of one FMU, in parallel, into Parquet files.

    STUDY is a TOML file, or the name of a study of the package: turning_circle. FMU is the file; without it
    build/HovercraftNative.fmu, which is built if it is not there. A sweep that was ended goes on where it was with the
    same command.
    """
    from ..sweeps import read_study, sweep
    from ..sweeps.reading import overview

    chosen = read_study(study)
    if dry_run:
        _tell_estimate(chosen, fmu, kind, as_json, engine=engine, output=output, **options)
        return
    if plot:
        from ..drawing.figures import check_plot

        check_plot(plot)
    make_room(plot)
    path = named_fmu(fmu, kind) if engine == "fmu" or kind else fmu
    begun = perf_counter()
    with progress_of(chosen.runs, "sweeping", MofNCompleteColumn(), _Rate()) as tell:
        tls = tls_ca, tls_cert, tls_key
        outcome = sweep(chosen, path, engine=engine, output=output, tell=tell, tls=tls, **options)
    seconds = perf_counter() - begun
    OUTPUT.print(f"{outcome.folder}: {outcome.runs} runs, {outcome.new} of them made now in {seconds:.1f} s")
    for line in outcome.spoiled:
        OUTPUT.print(f"set aside, made anew: {line}")
    if outcome.error:
        OUTPUT.print(f"{outcome.failed} failed; the first is {outcome.error}")
    if outcome.warned:
        OUTPUT.print(f"{outcome.warned} with warnings of the FMU; see their column")
    if outcome.missing:
        undrawn = f"; {plot} is drawn when all are there" if plot else ""
        OUTPUT.print(
            f"{outcome.missing} of the {chosen.runs} runs of the study, of other parts, are missing yet{undrawn}"
        )
        if as_json:
            print_json({**outcome._asdict(), "seconds": seconds})
        return
    found = overview(outcome.folder)
    _print_extremes(found.extremes)
    for event, count, runs in found.unreached:
        numbers = ", ".join(map(str, runs)) + (", ..." if count > len(runs) else "")
        OUTPUT.print(f"{event}: {count} of {chosen.runs} runs never reached it: run {numbers}")
    if as_json:
        extremes, unreached = ([each._asdict() for each in part] for part in found)
        print_json({**outcome._asdict(), "seconds": seconds, "extremes": extremes, "never_reached": unreached})
    if plot:
        from ..sweeps.charts import plot_sweep

        OUTPUT.print(f"wrote {plot_sweep(outcome.folder, plot)}")


def _tell_estimate(study: "Study", fmu: Path | None, kind: "Kind | None", as_json: bool, **options: Any) -> None:
    from ..building import fmu_to_try
    from ..sweeps import estimate

    if options.pop("scheduler"):
        raise click.UsageError("--scheduler: must not be given with --dry-run, which asks none: give --workers")
    del options["overwrite"]  # it is as if there were nothing
    with ExitStack() as stack:
        if kind and not fmu:
            fmu = stack.enter_context(fmu_to_try(kind))
        found = estimate(study, fmu, **options)
    OUTPUT.print(f"{study.name}: {found.runs} runs in {found.chunks} chunks, {decimal(found.bytes)}")
    some = f", {_duration(found.seconds)} by {found.workers}" if found.workers > 1 else ""
    OUTPUT.print(
        f"{_duration(found.seconds_of_one)} by one worker{some}, each as fast as this machine now "
        f"(measured on {found.measured} runs; their start is not counted)"
    )
    if as_json:
        print_json(found._asdict())


def _duration(seconds: float) -> str:
    return f"{seconds:.2g} s" if seconds < 60.0 else str(timedelta(seconds=round(seconds)))


class _Rate(ProgressColumn):
    """Runs a second."""

    def render(self, task: Task) -> Text:
        """Of a sweep on its way."""
        return Text(f"{task.speed:.3g} runs/s" if task.speed else "")


def _print_extremes(extremes: "list[Extreme]") -> None:
    rows = []
    for each in extremes:
        cells = [each.column]
        for value, run in ((each.least, each.least_run), (each.greatest, each.greatest_run)):
            cells += [f"{value:.4g} {each.unit}", ", ".join(f"{name} = {part:.4g}" for name, part in run.items())]
        rows.append(cells)
    if rows:
        print_table(("column", "least", "of the run with", "greatest", "of the run with"), rows)
