"""Builds the native FMU: the C of native/ for five platforms, on one machine; two builds give the same bytes."""

import importlib.resources
import importlib.util
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

import fmpy

from .archive import digest, write_archive, zipped
from .description import NATIVE, Flavour, model_description, xml
from .document import documents
from .extras import build_description, terminals_and_icons
from .icon import icon_png
from .mach_o import universal
from .native_header import variables_header

C_FOLDER = Path(__file__).parent / "native"
FMI_HEADERS = {
    2: ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"),
    3: ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h"),
}
"""The standards', with their licence in them, as fmpy has them: it took the prefix of names out of FMI 2.0's."""
NO_PREFIX = "#define fmi2FullName(name) name\n"
PREFIX = """\
#if defined(FMI2_FUNCTION_PREFIX) && !defined(FMI2_OVERRIDE_FUNCTION_PREFIX)
    #define fmi2Paste(a, b) a ## b
    #define fmi2PasteB(a, b) fmi2Paste(a, b)
    #define fmi2FullName(name) fmi2PasteB(FMI2_FUNCTION_PREFIX, name)
#else
    #define fmi2FullName(name) name
#endif
"""
"""As in the standard: a host that links the sources into one program defines it, as HovercraftNative_."""
OPTIONS = ("-std=c11", "-O2", "-ffp-contract=off", "-fno-math-errno")
"""What keeps the bits, and keeps libm out."""
LIBRARY = ("-g0", "-shared", "-fPIC", "-fvisibility=hidden", "-fno-slp-vectorize")
"""A sub-step is one chain of operations: packing pairs of them into vectors costs a tenth of its time."""


@dataclass(frozen=True)
class Platform:
    """A target of the compiler, and the file that it becomes in binaries/."""

    target: str
    suffix: str
    options: tuple[str, ...] = ("-s",)


# glibc of 2012; macOS of 2020. Symbols of a Mach-O file stay: what strips them would break its signature.
PLATFORMS: Mapping[str, Platform] = {
    "x86_64-linux": Platform("x86_64-linux-gnu.2.17", ".so"),
    "aarch64-linux": Platform("aarch64-linux-gnu.2.17", ".so"),
    # without a C runtime: nothing to install, and nothing to build for a minute
    "x86_64-windows": Platform(
        "x86_64-windows-gnu",
        ".dll",
        ("-s", "-nostdlib", "-Wl,--entry=DllMain", "-DHOVERCRAFT_NO_LIBC", "-lkernel32"),
    ),
    "x86_64-darwin": Platform("x86_64-macos.11.0", ".dylib", ()),
    "aarch64-darwin": Platform("aarch64-macos.11.0", ".dylib", ()),
}
FMI_2_FOLDERS = {"x86_64-linux": "linux64", "x86_64-windows": "win64", "x86_64-darwin": "darwin64"}


def has_compiler() -> bool:
    """Whether the compiler of the native FMU is installed."""
    return importlib.util.find_spec("ziglang") is not None


def build_native_fmu(
    path: str | os.PathLike[str] | None = None, flavour: Flavour = NATIVE, platforms: Iterable[str] = tuple(PLATFORMS)
) -> Path:
    """Write the native FMU of a flavour to `path` (its folder is made) and return the path.

    Args:
        path: the file; without it build/HovercraftNative.fmu or build/HovercraftNative3.fmu.
        flavour: NATIVE or NATIVE3: FMI 2.0 or FMI 3.0.
        platforms: keys of PLATFORMS, to compile for.

    Raises:
        ModuleNotFoundError: no compiler.
        ValueError: the name does not end in .fmu.
        OSError: the file cannot be written; one that stood there before still does.
    """
    if not has_compiler():
        raise ModuleNotFoundError("the native FMU needs a C compiler: pip install 'hovercraft-fmu[native]'")
    return write_archive(path or f"build/{flavour.identifier}.fmu", lambda: _archive(flavour, platforms))


def sources(build: str, flavour: Flavour = NATIVE) -> dict[str, bytes]:
    """All that a C compiler needs, by name; `build` is a hexadecimal digest of 32 digits."""
    ours = [C_FOLDER / name for name in flavour.sources] + sorted(C_FOLDER.glob("*.h"))
    headers = [Path(fmpy.__file__).parent / "c-code" / name for name in FMI_HEADERS[flavour.fmi]]
    files = {file.name: file.read_bytes() for file in (*ours, *headers)}
    if flavour.fmi == 2:
        files["fmi2Functions.h"] = files["fmi2Functions.h"].replace(NO_PREFIX.encode(), PREFIX.encode())
    return {**files, "variables.h": variables_header(build).encode()}


def _archive(flavour: Flavour, platforms: Iterable[str]) -> bytes:
    files = {
        **{f"documentation/{name}": content for name, content in documents(flavour).items()},
        "documentation/licenses/fdlibm.txt": _sun_notice(),
        "sources/buildDescription.xml": xml(build_description(flavour, OPTIONS)),
        "terminalsAndIcons/icon.png": icon_png(),
        "terminalsAndIcons/terminalsAndIcons.xml": xml(terminals_and_icons()),
    }
    if flavour.fmi == 2:
        files["model.png"] = icon_png()
    build = native_build(flavour)
    c_files = sources(build, flavour)
    return zipped(
        {
            **files,
            **{f"sources/{name}": content for name, content in c_files.items()},
            "modelDescription.xml": xml(model_description(build, flavour)),
            **_binaries(c_files, flavour, platforms),
        }
    )


def native_build(flavour: Flavour) -> str:
    """What the FMU is: a digest of code, table, compiler and options, but of nothing that is written about it."""
    made_by = f"{metadata.version('ziglang')} {OPTIONS} {LIBRARY} {PLATFORMS}".encode()
    table = xml(model_description("0" * 32, flavour))
    return digest({**sources("0" * 32, flavour), "compiler": made_by, "table": table})


def _sun_notice() -> bytes:
    """The notice of sine, cosine and logarithm, which their sources carry."""
    text = (C_FOLDER / "trig.h").read_text(encoding="utf-8")
    lines = text[text.index("   ====") : text.index("   The reduction of medium")].splitlines()
    return "".join(line.removeprefix("   ") + "\n" for line in lines).encode()


def _binaries(c_files: Mapping[str, bytes], flavour: Flavour, platforms: Iterable[str]) -> dict[str, bytes]:
    names = list(platforms)
    with tempfile.TemporaryDirectory(prefix="hovercraft_native_") as folder, ThreadPoolExecutor() as side_by_side:
        for name, content in c_files.items():
            (Path(folder) / name).write_bytes(content)
        made = side_by_side.map(lambda name: compiled(Path(folder), PLATFORMS[name], flavour), names)
        built = dict(zip(names, made, strict=True))
    files = {library(name, flavour): content for name, content in built.items()}
    if flavour.fmi == 2 and {"x86_64-darwin", "aarch64-darwin"} <= built.keys():
        both = (built["x86_64-darwin"], built["aarch64-darwin"])
        files[library("x86_64-darwin", flavour)] = universal(both)
    return {f"binaries/{name}": content for name, content in files.items()}


def library(name: str, flavour: Flavour) -> str:
    """Where in binaries/ the library for a platform is: FMI 2.0 has folders of its own for three of them."""
    folder = FMI_2_FOLDERS.get(name, name) if flavour.fmi == 2 else name
    return f"{folder}/{flavour.identifier}{PLATFORMS[name].suffix}"


def compiled(folder: Path, platform: Platform, flavour: Flavour = NATIVE) -> bytes:
    """The library of the sources in `folder`. Raises OSError with what the compiler said."""
    name = f"{flavour.identifier}{platform.suffix}"
    with tempfile.TemporaryDirectory(dir=folder) as apart:
        output = Path(apart) / name
        command = [*compiler(platform), *LIBRARY, *flavour.sources, *platform.options, "-o", str(output)]
        if platform.suffix == ".dylib":
            command.append(f"-Wl,-install_name,@rpath/{name}")
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise OSError(f"compiling for {platform.target} failed: {done.stderr.strip()}")
        return output.read_bytes()


def compiler(platform: Platform) -> list[str]:
    """The compiler for a platform, with the options of every compilation."""
    command = [sys.executable, "-m", "ziglang", "cc", "-target", platform.target, *OPTIONS, "-I."]
    if "-nostdlib" in platform.options:  # which takes the headers away, too
        command += ["-isystem", str(_zig_headers() / "any-windows-any")]
    return command


def _zig_headers() -> Path:
    files = importlib.resources.files("ziglang")
    return Path(str(files)) / "lib" / "libc" / "include"
