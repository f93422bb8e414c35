"""The commands that write and check files: build, play, validate, cross-check."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..model.craft import PRESETS
from ..view.tables import markdown
from .options import FOLDER, PathOf, settings_of
from .output import OUTPUT, json_option, print_json, progress_of

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
@json_option
def build(
    kinds: tuple[str, ...], output: Path, name: str | None, preset: str | None, settings: tuple[str, ...], as_json: bool
) -> None:
    """Write the FMUs, and the SSP files of the closed loop and of a tow.

    KIND is native, native3 or python; native_autopilot, native3_autopilot or autopilot; native_tether, native3_tether
    or tether; native_loop, native3_loop or python_loop; native_tow or native3_tow. Without it all are written, and
    with --name the native FMU alone.
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
    if as_json:
        made = [(output / each.name, each.purpose) for each in wanted if not reasons[each.name]]
        print_json([{"file": file, "bytes": file.stat().st_size, "purpose": purpose} for file, purpose in made])
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

    if output.suffix != ".html":
        raise click.UsageError(f"--output {output}: must end in .html")
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
@click.argument("files", nargs=-1, metavar="[FILE ...]", type=PathOf(path_type=Path))
@click.option("--table", is_flag=True, help="Ask other checkers and hosts, too, and print a table (Markdown).")
@click.option("--junit", type=PathOf(path_type=Path, dir_okay=False), metavar="FILE.xml", help="Write a JUnit report.")
@json_option
def validate(files: tuple[Path, ...], table: bool, junit: Path | None, as_json: bool) -> None:
    """Check FMUs and SSP files: the schema, fmpy's validation, and a real run; of an SSP what it names, and its FMUs.

    Without FILE: the FMUs that 'hovercraft-fmu build' wrote into build/; where there is none,
    build/HovercraftNative.fmu, which is built. (One with --name is named.) With --table hosts run FMUs of
    the hovercraft alone.
    """
    from ..building import built_fmus
    from ..validation import junit_report
    from ..whole import check_writable, write_whole

    if junit:
        check_writable(junit)
    chosen = files or built_fmus()
    found = {
        file: _tabled(file, f"\n{file}:\n\n" if len(chosen) > 1 else "") if table else checked(file)
        for file in dict.fromkeys(chosen)
    }
    problems = {file: sum(len(check.problems) for check in checks) for file, checks in found.items()}
    bad, many = sum(map(bool, problems.values())), sum(problems.values())
    if junit:
        write_whole(junit, junit_report(found))
        OUTPUT.print(f"wrote {junit}")
    if as_json:
        print_json(
            {
                "valid": not bad,
                "files": [
                    {"file": file, "valid": not problems[file], "checks": [_as_json(each) for each in checks]}
                    for file, checks in found.items()
                ],
            }
        )
    if bad:
        kinds = f"{bad} of {len(found)} file{'s' if len(found) > 1 else ''}"
        raise click.ClickException(f"not valid: {kinds}, {many} problem{'s' if many > 1 else ''} found")
    if not table:
        OUTPUT.print(f"valid: {len(found)} file{'s' if len(found) > 1 else ''}, every check passed")


def _as_json(check: "Check") -> dict[str, Any]:
    return {**check._asdict(), "result": check.result}


def checked(file: Path) -> "list[Check]":
    """Check one file, print what was checked as it is done, and return it."""
    from ..validation import check_file

    OUTPUT.print(f"checking {file}")
    checks = []
    for check in check_file(file):
        OUTPUT.print(f"  {check.result:6} {check.what} ({check.checker} {check.version})")
        for problem in check.problems:
            OUTPUT.print(f"         {problem}")
        checks.append(check)
    return checks


def _tabled(file: Path, title: str) -> "list[Check]":
    """The same in a table, with the checks of others."""
    from ..validation import check_file, validate_elsewhere

    checks = []
    with progress_of(1.0, f"checking {file}"):
        checks = list(check_file(file))
        if file.suffix == ".fmu" and checks[0].what != "read the file":
            checks += validate_elsewhere(file)
    OUTPUT.print(title + _checked_table(checks))
    return checks


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


@click.command("docs")
@click.option("--output", type=PathOf(path_type=Path, file_okay=False), metavar="DIR", default=FOLDER / "docs",
              show_default=True)  # fmt: skip
def docs(output: Path) -> None:
    """Write the pages of every FMU and SSP file as a site, for a browser or a web server."""
    from ..building.site import build_site

    with progress_of(1.0, "writing pages") as tell:
        page = build_site(output, tell)
    OUTPUT.print(f"wrote {page}: open it in a browser")


@click.command("cross-check")
@click.argument("folder", metavar="DIR", type=PathOf(path_type=Path, file_okay=False))
def cross_check(folder: Path) -> None:
    """Write what the FMI cross-check asks for: the native FMU, inputs, options, a reference result."""
    from ..cross_check import write_cross_check

    for place in write_cross_check(folder):
        OUTPUT.print(f"wrote {place}")
