"""Options and arguments that several commands have, and what is made of them."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.shell_completion import CompletionItem

from ..model.craft import PRESETS
from ..whole import check_writable
from .output import OUTPUT

if TYPE_CHECKING:
    from ..building import Kind

FOLDER = Path("build")


class PathOf(click.Path):
    """A path that is not empty: pathlib takes '' for the current folder."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Raises click.BadParameter."""
        if value == "":
            self.fail("'': must be a path", param, ctx)
        return super().convert(value, param, ctx)


class NameOf(click.types.StringParamType):
    """A name, which a shell completes; whether it is one is for the function to say that takes it."""

    def __init__(self, names: Callable[[], Iterable[str]]) -> None:
        self._names = names

    def shell_complete(self, _context: click.Context, _param: click.Parameter, incomplete: str) -> list[CompletionItem]:
        """Those that begin so."""
        return [CompletionItem(name) for name in self._names() if name.startswith(incomplete)]


def _scenes() -> Iterable[str]:
    from ..scenes import SCENES

    return SCENES


def _settable() -> Iterable[str]:
    from ..fmu.interface import VARIABLES

    return (f"{each.name}=" for each in VARIABLES if each.start is not None)


scene_option = click.option("--scene", metavar="NAME", type=NameOf(_scenes), help="A named scene (default: launch).")
set_option = click.option("--set", "settings", multiple=True, metavar="NAME=VALUE", type=NameOf(_settable),
                          help="Start value of a variable; repeatable.")  # fmt: skip
PRESET_NAME = NameOf(lambda: PRESETS)


def of_an_fmu(command: Callable[..., None]) -> Callable[..., None]:
    """The argument FMU and the option --fmu of a command that runs one."""
    kinds = click.Choice(["native", "native3", "python"])
    option = click.option("--fmu", "kind", type=kinds, help="Instead of a file: the FMU of that kind in build/.")
    return click.argument("fmu", required=False, type=PathOf(path_type=Path))(option(command))


def settings_of(texts: Iterable[str], option: str = "--set") -> dict[str, str]:
    """Name -> value of texts NAME=VALUE. Raises click.UsageError."""
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


def named_fmu(fmu: Path | None, kind: "Kind | None") -> Path:
    """The file that is to be run, and say which it is. Raises as `read_description` does."""
    from ..building import default_fmu
    from ..fmu.interface import HOVERCRAFT
    from ..host import read_description

    if fmu and kind:
        raise click.UsageError(f"--fmu {kind}: must not be given together with the file {fmu}")
    path = fmu or default_fmu(kind)
    read_description(path, model=HOVERCRAFT.name)
    OUTPUT.print(f"running {path}")
    return path


def make_room(*files: Path | None) -> None:
    """What cannot be written after a run is said before it. Raises OSError."""
    for file in filter(None, files):
        check_writable(file)
