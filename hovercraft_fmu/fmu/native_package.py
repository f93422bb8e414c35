"""Builds the native FMU: the C of native/ for five platforms, on one machine; two builds give the same bytes."""

import importlib.resources
import importlib.util
import os
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

import fmpy

from .description import NATIVE, model_description
from .extras import build_description, terminals_and_icons, xml
from .icon import icon_png
from .mach_o import universal
from .native_header import variables_header
from .package import digest, documents, write_fmu, zipped

C_FOLDER = Path(__file__).parent / "native"
FMI_HEADERS = tuple(
    Path(fmpy.__file__).parent / "c-code" / name
    for name in ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h")
)
"""The standard's, with their licence in them, as fmpy has them: it took the prefix of names out."""
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
MAC = (f"-Wl,-install_name,@rpath/{NATIVE.identifier}.dylib",)
PLATFORMS: Mapping[str, Platform] = {
    "x86_64-linux": Platform("x86_64-linux-gnu.2.17", ".so"),
    "aarch64-linux": Platform("aarch64-linux-gnu.2.17", ".so"),
    # without a C runtime: nothing to install, and nothing to build for a minute
    "x86_64-windows": Platform(
        "x86_64-windows-gnu",
        ".dll",
        ("-s", "-nostdlib", "-Wl,--entry=DllMain", "-DHOVERCRAFT_NO_LIBC", "-lkernel32"),
    ),
    "x86_64-darwin": Platform("x86_64-macos.11.0", ".dylib", MAC),
    "aarch64-darwin": Platform("aarch64-macos.11.0", ".dylib", MAC),
}


def has_compiler() -> bool:
    """Whether the compiler of the native FMU is installed."""
    return importlib.util.find_spec("ziglang") is not None


def build_native_fmu(path: str | os.PathLike[str] = f"build/{NATIVE.identifier}.fmu") -> Path:
    """Write the native FMU to `path` (its folder is made) and return the path.

    Raises:
        ModuleNotFoundError: no compiler.
        ValueError: the name does not end in .fmu.
        OSError: the file cannot be written; one that stood there before still does.
    """
    if not has_compiler():
        raise ModuleNotFoundError("the native FMU needs a C compiler: pip install 'hovercraft-fmu[native]'")
    return write_fmu(path, _archive)


def sources(build: str) -> dict[str, bytes]:
    """All that a C compiler needs, by name; `build` is a hexadecimal digest of 32 digits."""
    files = {file.name: file.read_bytes() for file in (*sorted(C_FOLDER.glob("*.[ch]")), *FMI_HEADERS)}
    functions = files["fmi2Functions.h"].replace(NO_PREFIX.encode(), PREFIX.encode())
    return {**files, "fmi2Functions.h": functions, "variables.h": variables_header(build).encode()}


def _archive() -> bytes:
    files = {
        **{f"documentation/{name}": content for name, content in documents(native=True).items()},
        "documentation/licenses/fdlibm.txt": _sun_notice(),
        "sources/buildDescription.xml": xml(build_description(NATIVE, OPTIONS)),
        "terminalsAndIcons/icon.png": icon_png(),
        "terminalsAndIcons/terminalsAndIcons.xml": xml(terminals_and_icons()),
        "model.png": icon_png(),
    }
    made_by = {"compiler": f"{metadata.version('ziglang')} {OPTIONS} {LIBRARY} {PLATFORMS}".encode()}
    description = {"modelDescription.xml": xml(model_description("0" * 32, NATIVE))}
    build = digest({**files, **sources("0" * 32), **description, **made_by})
    c_files = sources(build)
    return zipped(
        {
            **files,
            **{f"sources/{name}": content for name, content in c_files.items()},
            "modelDescription.xml": xml(model_description(build, NATIVE)),
            **_binaries(c_files),
        }
    )


def _sun_notice() -> bytes:
    """The notice of sine, cosine and logarithm, which their sources carry."""
    text = (C_FOLDER / "trig.h").read_text(encoding="utf-8")
    lines = text[text.index("   ====") : text.index("   The reduction of medium")].splitlines()
    return "".join(line.removeprefix("   ") + "\n" for line in lines).encode()


def _binaries(c_files: Mapping[str, bytes]) -> dict[str, bytes]:
    """FMI 2.0's own folders, and FMI 3.0's for the platforms that FMI 2.0 has none for."""
    with tempfile.TemporaryDirectory(prefix="hovercraft_native_") as folder:
        for name, content in c_files.items():
            (Path(folder) / name).write_bytes(content)
        built = {name: compiled(Path(folder), platform) for name, platform in PLATFORMS.items()}
    folders = {
        "linux64/{}.so": built["x86_64-linux"],
        "win64/{}.dll": built["x86_64-windows"],
        "darwin64/{}.dylib": universal((built["x86_64-darwin"], built["aarch64-darwin"])),
        "aarch64-linux/{}.so": built["aarch64-linux"],
        "aarch64-darwin/{}.dylib": built["aarch64-darwin"],
    }
    return {f"binaries/{name.format(NATIVE.identifier)}": content for name, content in folders.items()}


def compiled(folder: Path, platform: Platform) -> bytes:
    """The library of the sources in `folder`. Raises OSError with what the compiler said."""
    output = f"{NATIVE.identifier}{platform.suffix}"
    command = [*compiler(platform), *LIBRARY, *NATIVE.sources, *platform.options, "-o", output]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise OSError(f"compiling for {platform.target} failed: {done.stderr.strip()}")
    content = (folder / output).read_bytes()
    (folder / output).unlink()
    return content


def compiler(platform: Platform) -> list[str]:
    """The compiler for a platform, with the options of every compilation."""
    command = [sys.executable, "-m", "ziglang", "cc", "-target", platform.target, *OPTIONS, "-I."]
    if "-nostdlib" in platform.options:  # which takes the headers away, too
        command += ["-isystem", str(_zig_headers() / "any-windows-any")]
    return command


def _zig_headers() -> Path:
    files = importlib.resources.files("ziglang")
    return Path(str(files)) / "lib" / "libc" / "include"
