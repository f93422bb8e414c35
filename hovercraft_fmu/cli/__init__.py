"""The command hovercraft-fmu: a thin layer over the functions of the package.

A command loads what it needs when it runs: `--help` is there at once.
"""

import sys
import traceback
from time import perf_counter
from typing import Any, NoReturn

import click

from .. import stopping
from .._version import __version__
from . import demos, files, many, running
from .helping import HelpContext, write_rows
from .output import OUTPUT, QUIET_OPTION, VERBOSE_OPTION, VOICE, let_go_of_output, one_line

__all__ = ["OUTPUT", "commands", "main"]

EXPECTED = (ValueError, OSError, ArithmeticError, ModuleNotFoundError)
"""What a wrong name, file or value ends in, beside what an FMU refuses: one line, no traceback."""


def main(arguments: list[str] | None = None) -> None:
    """Run the command and leave the process: status 0; 1 after a line for each thing that is wrong, 2 where it is in
    how the command was used; 130 where it was stopped by Ctrl-C, 143 where it was asked to end."""
    begun = perf_counter()
    try:
        status = commands.main(arguments, prog_name="hovercraft-fmu", standalone_mode=False)
    except click.exceptions.Abort:
        stopping.end()
    except click.ClickException as error:
        _say(error.format_message())
        sys.exit(error.exit_code)
    except EXPECTED as error:
        _fail(error)
    except RuntimeError as error:
        from ..host import SimulationError

        if not isinstance(error, SimulationError):
            raise
        _fail(error)
    if VOICE.is_verbose:
        click.echo(f"took {perf_counter() - begun:.1f} s", err=True)
    sys.exit(status if isinstance(status, int) else 0)


def _fail(error: Exception) -> NoReturn:
    if VOICE.is_verbose:
        traceback.print_exception(error)
    error = let_go_of_output(error)
    for line in getattr(error, "mistakes", (one_line(error),)):
        _say(line)
    sys.exit(1)


def _say(what: str) -> None:
    click.echo(f"hovercraft-fmu: {what}", err=True)


class _Front(click.Group):
    """Its help says what to begin with; a command is not quiet because an earlier one of the same process was."""

    def make_context(self, *arguments: Any, **options: Any) -> click.Context:
        OUTPUT.quiet = VOICE.is_verbose = False
        return super().make_context(*arguments, **options)

    def format_help_text(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        super().format_help_text(ctx, formatter)
        write_rows(formatter, "New here", [(f"{ctx.info_name} {words}", what) for words, what in FIRST.items()])


FIRST = {
    "demo": "build, check and drive it; see build/demo/",
    "demo --loop": "the same with an autopilot at the helm",
    "build": "write the FMUs and the SSP files into build/",
    "play": "the arrow keys, in a browser",
    "drive": "the arrow keys, in a window",
    "simulate --plot a.png": "a run, and its picture",
    "simulate --help": "what can be set",
}


@click.group(cls=_Front, invoke_without_command=True, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(__version__, message="%(version)s")
@click.pass_context
def commands(context: click.Context) -> None:
    """Build, check, run and draw the hovercraft FMU."""
    if context.invoked_subcommand is None:
        click.echo(context.get_help())


for each in (
    files.build,
    files.play,
    running.simulate,
    running.advise,
    running.drive,
    files.validate,
    demos.demo,
    many.measure,
    many.sweep,
    files.docs,
    files.cross_check,
):
    each.params += [QUIET_OPTION, VERBOSE_OPTION]
    each.context_class = HelpContext
    commands.add_command(each)
commands.context_class = HelpContext
