"""Packs the native FMUs: machine code that was compiled before (machine_code.py), its sources, description, pages."""

import os
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import NamedTuple

from .archive import write_archive, zipped
from .block import patched
from .description import NATIVE, Flavour, model_description, xml
from .document import documents, licenses
from .extras import ICON, build_description, reference_result, terminals_and_icons
from .mach_o import universal
from .machine_code import OPTIONS, PLATFORMS, block_of, c_file, identity, library, sources

FMI_2_FOLDERS = {"x86_64-linux": "linux64", "x86_64-windows": "win64", "x86_64-darwin": "darwin64"}


def build_native_fmu(
    path: str | os.PathLike[str] | None = None,
    flavour: Flavour = NATIVE,
    platforms: Iterable[str] = tuple(PLATFORMS),
    more: Mapping[str, bytes] = {},
) -> Path:
    """Write the native FMU of a flavour to `path` (its folder is made) and return the path.

    Args:
        path: the file; without it the identifier of the flavour as a name, in build/.
        flavour: NATIVE or NATIVE3, FMI 2.0 or FMI 3.0, or a variant of one.
        platforms: keys of PLATFORMS that it is to run on.
        more: what else goes into its documentation, by name.

    Raises:
        NotCompiledError: there is no machine code of the C that is here.
        ValueError: the name does not end in .fmu.
        OSError: the file cannot be written; one that stood there before still does.
    """
    papers = Papers(
        lambda: documents(flavour, more), "Sine, cosine and logarithm are", lambda: reference_result(flavour)
    )
    return write_native_fmu(path or f"build/{flavour.identifier}.fmu", flavour, papers, platforms)


class Papers(NamedTuple):
    """What a native FMU has beside machine code, sources and what follows from its table."""

    documents: Callable[[], Mapping[str, bytes]]
    """Files of documentation/ but licences, by path."""
    of_fdlibm: str
    """'Sine and cosine are': what of its code is fdlibm's."""
    extra: Callable[[], Mapping[str, bytes]] = dict
    """Files of extra/, by path in the FMU."""


def write_native_fmu(
    path: str | os.PathLike[str], flavour: Flavour, papers: Papers, platforms: Iterable[str] = tuple(PLATFORMS)
) -> Path:
    """Write the native FMU of any model to `path` and return the path. Raises as `build_native_fmu` does."""
    return write_archive(path, lambda: _archive(flavour, papers, platforms))


def _archive(flavour: Flavour, papers: Papers, platforms: Iterable[str]) -> bytes:
    notices = licenses(f"{papers.of_fdlibm} fdlibm's", "fdlibm.txt", _sun_notice())
    files = {
        **{f"documentation/{name}": each for name, each in {**papers.documents(), **notices}.items()},
        **papers.extra(),
        "sources/buildDescription.xml": xml(build_description(flavour, OPTIONS)),
    }
    if flavour.fmi == 2:
        files["model.png"] = ICON.read_bytes()
    else:
        files["terminalsAndIcons/icon.png"] = ICON.read_bytes()
        files["terminalsAndIcons/terminalsAndIcons.xml"] = xml(terminals_and_icons(flavour.model))
    build = identity(flavour)
    return zipped(
        {
            **files,
            **{f"sources/{name}": content for name, content in sources(build, flavour).items()},
            "modelDescription.xml": xml(model_description(build, flavour)),
            **_binaries(flavour, platforms),
        }
    )


def _sun_notice() -> bytes:
    """The notice of sine, cosine and logarithm, which their sources carry."""
    text = c_file("trig.h").read_text(encoding="utf-8")
    lines = text[text.index("   ====") : text.index("   The reduction of medium")].splitlines()
    return "".join(line.removeprefix("   ") + "\n" for line in lines).encode()


def _binaries(flavour: Flavour, platforms: Iterable[str]) -> dict[str, bytes]:
    code = library(flavour.variant_of or flavour)
    built = {platform: code.path(platform).read_bytes() for platform in platforms}
    if flavour.variant_of:
        own = block_of(flavour, identity(flavour))
        built = {each: patched(content, own, Path(binary(each, flavour)).name) for each, content in built.items()}
    files = {binary(platform, flavour): content for platform, content in built.items()}
    if flavour.fmi == 2 and "x86_64-darwin" in built:
        files[binary("x86_64-darwin", flavour)] = universal([built["x86_64-darwin"], built["aarch64-darwin"]])
    return {f"binaries/{name}": content for name, content in files.items()}


def binary(platform: str, flavour: Flavour) -> str:
    """Where in binaries/ the library for a platform is: FMI 2.0 has folders of its own for three of them."""
    folder = FMI_2_FOLDERS.get(platform, platform) if flavour.fmi == 2 else platform
    return f"{folder}/{flavour.identifier}{PLATFORMS[platform].suffix}"
