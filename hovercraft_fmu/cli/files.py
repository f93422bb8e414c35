"""The commands that write and check files: build, play, validate, cross-check."""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from ..model.craft import PRESETS
from ..view.tables import markdown
from .options import FOLDER, PathOf, settings_of
from .output import OUTPUT

if TYPE_CHECKING:
    from ..building import Product
    from ..validation import Check


@click.command("build")
@click.argument("kinds", nargs=-1, metavar="[KIND ...]")
@click.option(
    "--output", type=PathOf(path_type=Path, file_okay=False), metavar="DIR", default=FOLDER, show_default=True
)
@click.option("--name", metavar="NAME", help="Write one FMU under this name, with start values of its own.")
@click.option("--preset", metavar="NAME", help=f"With --name: those of a craft: {', '.join(PRESETS)}.")
@click.option("--set", "settings", multiple=True, metavar="NAME=VALUE", help="With --name: a start value; repeatable.")
def build(
    kinds: tuple[str, ...], output: Path, name: str | None, preset: str | None, settings: tuple[str, ...]
) -> None:
    """Write the FMUs and the SSP files of the closed loop.

    KIND is native, native3, python, autopilot, native_loop, native3_loop or python_loop; without it all are written,
    and with --name the native FMU alone.
    """
    from ..building import PRODUCTS, product, variant_product
    from ..fmu.archive import check_target

    kinds = tuple(dict.fromkeys(kinds))
    if name is not None:
        if len(kinds) > 1:
            raise click.UsageError("--name: must be given with one KIND: it is the name of one file")
        wanted = [variant_product(kinds[0] if kinds else "native", name, preset, settings_of(settings))]
    elif preset is not None or settings:
        raise click.UsageError("--preset and --set: must be given with --name, the name of an FMU with those values")
    else:
        wanted = [product(kind) for kind in kinds] or list(PRODUCTS.values())
    for each in wanted:
        check_target(output / each.name, Path(each.name).suffix)
    reasons = {each.name: _written(each, output / each.name) for each in wanted}
    if missing := [name for name, reason in reasons.items() if reason]:
        raise click.ClickException(f"not written: {', '.join(missing)}; {reasons[missing[0]]}")


@click.command()
@click.option(
    "--output", type=PathOf(path_type=Path), metavar="FILE.html", default=FOLDER / "play.html", show_default=True
)
@click.option("--no-open", is_flag=True, help="Write the page, and leave the browser alone.")
def play(output: Path, no_open: bool) -> None:
    """Drive the FMU in the browser: write the page that carries it, and open it.

    It is one file that needs no network; the native FMUs have it in documentation/play.html.
    """
    import webbrowser

    from ..fmu.archive import write_archive
    from ..view.page import page

    path = write_archive(output, page, ".html")
    OUTPUT.print(f"{path}: {path.stat().st_size / 1000:.0f} kB, to be opened in any browser")
    if not no_open and not webbrowser.open(path.resolve().as_uri()):
        OUTPUT.print("no browser could be started here")


def _written(chosen: "Product", path: Path) -> str:
    """Write a file and say what it is for; returns why there is no machine code where that is missing."""
    from ..fmu.machine_code import NotCompiledError

    try:
        chosen.write(path)
    except NotCompiledError as error:
        return str(error)
    OUTPUT.print(f"{path}: {path.stat().st_size / 1000:.0f} kB, {chosen.purpose}")
    return ""


@click.command("validate")
@click.argument("fmus", nargs=-1, metavar="[FMU ...]", type=PathOf(path_type=Path))
@click.option("--table", is_flag=True, help="Ask other checkers and hosts, too, and print a table (Markdown).")
def validate(fmus: tuple[Path, ...], table: bool) -> int:
    """Check FMUs: the schema, fmpy's validation, and a real run.

    Without FMU: those that 'hovercraft-fmu build' wrote into build/; where there is none, build/HovercraftNative.fmu,
    which is built. (One with --name is named.) With --table hosts run FMUs of the hovercraft alone.
    """
    from ..building import built_fmus

    chosen = fmus or built_fmus()
    if table:
        problems = sum(_tabled(fmu, f"\n{fmu}:\n\n" if len(chosen) > 1 else "") for fmu in chosen)
    else:
        problems = sum(validated(fmu) for fmu in chosen)
    if problems:
        raise click.ClickException(f"{problems} problem{'s' if problems > 1 else ''} found")
    return 0


def validated(fmu: Path) -> int:
    """Check one FMU, print what was checked, and return the number of problems."""
    from ..validation import validate

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
    from ..validation import validate, validate_elsewhere

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


@click.command("cross-check")
@click.argument("folder", metavar="DIR", type=PathOf(path_type=Path, file_okay=False))
def cross_check(folder: Path) -> None:
    """Write what the FMI cross-check asks for: the native FMU, inputs, options, a reference result."""
    from ..cross_check import write_cross_check

    for place in write_cross_check(folder):
        OUTPUT.print(f"wrote {place}")
