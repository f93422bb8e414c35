"""The machine code: the C of native/ compiled for six platforms, and for browsers, on one machine, the same bytes
wherever that is done.

The build hook (hatch_build.py) does it when the package is built, before anything else is installed: this module needs
the standard library alone. What was compiled lies in compiled/, in folders that carry a digest of all that it was made
of, so C that was changed since finds no folder, and stale machine code is never run.
"""

import os
import re
import shutil
import subprocess
from collections.abc import Container, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from functools import cached_property
from importlib import metadata, resources
from pathlib import Path

from ..whole import temporary_folder
from .archive import digest, write_archive
from .block import Block, block
from .description import Flavour, model_description, xml
from .native_header import Native, variables_header

COMPILER = ("ziglang", "0.17.1")
"""The package that brings the C compiler; it makes the bytes, so the version is fixed."""
LEAVE_OUT = "HOVERCRAFT_FMU_NO_COMPILER"
"""The environment variable that keeps the build hook from asking for the compiler."""
C_FOLDER = Path(__file__).parent / "native"
FLEET = "fleet"
"""The folder there of many craft at once, which is no FMU."""
COMPILED = Path(__file__).parent / "compiled"
WHY_NOT = "why_not.txt"
"""In COMPILED: why the last attempt failed, for those who did not see it."""
OPTIONS = ("-std=c11", "-O2", "-ffp-contract=off", "-fno-math-errno")
"""What keeps the bits, and keeps libm out."""
LIBRARY_OPTIONS = (
    *("-g0", "-fvisibility=hidden", "-fno-slp-vectorize"),
    *("-DFMI2_OVERRIDE_FUNCTION_PREFIX", "-DFMI3_OVERRIDE_FUNCTION_PREFIX"),
)
"""In a library the FMI functions have no prefix.

A sub-step is one chain of operations: packing pairs of them into vectors costs a tenth of its time."""
TIME_LIMIT = 600.0
"""s, of one compilation: most take three."""


@dataclass(frozen=True)
class Platform:
    """A target of the compiler, and the file that it becomes in binaries/."""

    target: str
    suffix: str
    options: tuple[str, ...]


# Without the compiler's own runtime, which would take most of the time and of which nothing is needed; the C library is
# named, so that a loader finds it. glibc of 2012; macOS of 2020. What strips a Mach-O file would break its signature.
_SHARED = ("-shared", "-fPIC", "-nostdlib")
_OF_LINUX = (*_SHARED, "-s", "-lc")
_OF_MACOS = (*_SHARED, "-lSystem")
# without a C runtime: nothing to install, nothing to import
_OF_WINDOWS = (*_SHARED, "-s", "-Wl,--entry=DllMain", "-DHOVERCRAFT_NO_LIBC", "-lkernel32")
_OF_BROWSER = (
    *("-mexec-model=reactor", "-nostdlib", "-s", "-mbulk-memory", "-DHOVERCRAFT_NO_LIBC", "-Wl,--no-entry"),
    *("-Wl,--export-dynamic", "-Wl,--export-table", "-Wl,--growable-table"),  # for the callback of messages
)
PLATFORMS: Mapping[str, Platform] = {
    "x86_64-linux": Platform("x86_64-linux-gnu.2.17", ".so", _OF_LINUX),
    "aarch64-linux": Platform("aarch64-linux-gnu.2.17", ".so", _OF_LINUX),
    "x86_64-windows": Platform("x86_64-windows-gnu", ".dll", _OF_WINDOWS),
    "aarch64-windows": Platform("aarch64-windows-gnu", ".dll", _OF_WINDOWS),
    "x86_64-darwin": Platform("x86_64-macos.11.0", ".dylib", _OF_MACOS),
    "aarch64-darwin": Platform("aarch64-macos.11.0", ".dylib", _OF_MACOS),
}
"""By the names of FMI 3.0."""
BROWSER = "wasm32"
TARGETS: Mapping[str, Platform] = {**PLATFORMS, BROWSER: Platform("wasm32-wasi", ".wasm", _OF_BROWSER)}
"""And what is in no FMU's binaries/: the page has it."""


class NotCompiledError(FileNotFoundError):
    """There is no machine code of the C that is here; the message says how to get it."""


@dataclass(frozen=True)
class Library:
    """What is compiled into one library for each platform."""

    name: str
    sources: tuple[str, ...]
    """The files to compile."""
    files: Mapping[str, bytes] = field(repr=False)
    """All that the compiler reads, by path: these and what they include."""
    targets: tuple[str, ...] = tuple(PLATFORMS)
    """Keys of TARGETS."""

    @cached_property
    def folder(self) -> Path:
        """Where its machine code is, in a folder for each platform."""
        return COMPILED / f"{self.name}-{digest({**self.files, **_made_by(self.sources)})[:16]}"

    @property
    def missing(self) -> str:
        """Why there is no machine code of it, and how to get it; '' where there is."""
        return self._missing if any(not self.file(target).exists() for target in self.targets) else ""

    @property
    def _missing(self) -> str:
        reason = why_not()
        how = AGAIN if reason.startswith(LEAVE_OUT) else HOW
        return f"no machine code: {reason}; {how}; the Python FMU needs none: --fmu python, or build python"

    def path(self, platform: str) -> Path:
        """Of the library for a platform. Raises NotCompiledError."""
        path = self.file(platform)
        if not path.exists():
            raise NotCompiledError(self._missing)
        return path

    def file(self, platform: str) -> Path:
        """Where the library for a platform is, once it is compiled."""
        return self.folder / platform / f"{self.name}{TARGETS[platform].suffix}"


def library(flavour: Flavour) -> Library:
    """Of a native FMU."""
    own = {**sources(identity(flavour), flavour), **headers(flavour)}
    shared = sources("0" * 32, flavour)
    del shared[flavour.parts[0]], shared[flavour.unit]
    files = {
        **{f"{_shared(flavour)}/{name}": content for name, content in shared.items()},
        **{f"{flavour.identifier}/{name}": content for name, content in own.items()},
        **_units(flavour),
    }
    targets = (*PLATFORMS, BROWSER) if flavour.in_browsers else tuple(PLATFORMS)
    return Library(flavour.identifier, tuple(_units(flavour)), files, targets)


def _native(flavour: Flavour) -> Native:
    assert flavour.native, f"{flavour.identifier} is no native FMU"
    return flavour.native


def _shared(flavour: Flavour) -> str:
    """The folder of what both standards have to the letter: the second time it is in the compiler's cache."""
    return f"shared_{_native(flavour).folder}"


def _units(flavour: Flavour) -> dict[str, bytes]:
    """What a library is compiled of, by path: what both standards share, and what they do not."""
    own = [flavour.parts[0], "variant.c"]
    shared = [name for name in flavour.parts if name not in own]
    return {
        f"{_shared(flavour)}/shared.c": (IN_LINE.format(_native(flavour).folder) + _includes(shared)).encode(),
        f"{flavour.identifier}/library.c": _includes(own).encode(),
    }


IN_LINE = """\
/* What nobody else can call a compiler puts into the call of a step, which is a tenth faster for it. */
#define HIDDEN static
#include "{}.h"
#undef HIDDEN

"""


def _includes(names: Iterable[str]) -> str:
    return "\n".join(f'#include "{name}"' for name in names)


UNIT = """\
/* The whole FMU as one translation unit: of all that is in it a linker sees the FMI functions alone. In a program they
   have a prefix; where a library is made of it, define FMI{fmi}_OVERRIDE_FUNCTION_PREFIX, which takes it away. */

#ifndef FMI{fmi}_FUNCTION_PREFIX
#define FMI{fmi}_FUNCTION_PREFIX {identifier}_
#endif
#define HIDDEN static
#ifdef __GNUC__
#pragma GCC diagnostic ignored "-Wunused-function" /* of what both standards share each leaves something out */
#endif

{includes}
"""


def fleet_library() -> Library:
    """Of many craft at once: host/fleet.py loads it."""
    own = {file.name: file.read_bytes() for file in sorted((C_FOLDER / FLEET).iterdir())}
    shared = _with_included(("kernel.c", "logarithm.c", "memory.c", "trig.c", "environment.h"))
    files = {f"{FLEET}/{name}": content for name, content in {**shared, **own}.items()}
    return Library("HovercraftFleet", ("fleet/fleet.c", "fleet/memory.c"), files)


def sources(build: str, flavour: Flavour) -> dict[str, bytes]:
    """The C of an FMU, by name, without the standard's headers; `build` is a hexadecimal digest of 32 digits."""
    unit = UNIT.format(fmi=flavour.fmi, identifier=flavour.identifier, includes=_includes(flavour.parts))
    header = variables_header(flavour.model, _native(flavour), block_of(flavour, build))
    files = _with_included((*flavour.parts, f"{_native(flavour).folder}.h"))
    return {**files, "variables.h": header.encode(), flavour.unit: unit.encode()}


def _with_included(names: Iterable[str]) -> dict[str, bytes]:
    """Files of C and all of this package's that they include, by name."""
    found: dict[str, bytes] = {}
    wanted = [*names]
    while wanted:
        name = wanted.pop()
        if name not in found and (path := _found(name)):
            found[name] = path.read_bytes()
            wanted += re.findall(r'^#include "(.+)"$', found[name].decode(), re.MULTILINE)
    return dict(sorted(found.items()))


def c_folders() -> list[Path]:
    """Where the C of native FMUs is: the room (model.h there), what models share, the models."""
    return sorted(path for path in C_FOLDER.iterdir() if path.name not in (FLEET, "fmi2", "fmi3"))


def c_file(name: str) -> Path:
    """A file of C, wherever it is. Raises FileNotFoundError."""
    path = _found(name)
    if path is None:
        raise FileNotFoundError(f"{C_FOLDER}: no {name} in it")
    return path


def _found(name: str) -> Path | None:
    """Each name is there once."""
    paths = [folder / name for folder in c_folders() if (folder / name).exists()]
    assert len(paths) <= 1, f"{name} is there more than once: {paths}"
    return paths[0] if paths else None


def headers(flavour: Flavour) -> dict[str, bytes]:
    """The standard's headers, by name: whoever compiles an FMU's sources has them."""
    return {file.name: file.read_bytes() for file in sorted((C_FOLDER / f"fmi{flavour.fmi}").glob("*.h"))}


def block_of(flavour: Flavour, build: str) -> Block:
    """What its library says of itself; a variant says whose code it has."""
    return block(flavour.model, build, identity(flavour.variant_of) if flavour.variant_of else build)


def identity(flavour: Flavour) -> str:
    """What the FMU is: a digest of code, table, compiler and options, but of nothing that is written about it."""
    table = xml(model_description("0" * 32, flavour))
    units = _units(flavour)
    return digest({**sources("0" * 32, flavour), **headers(flavour), **units, **_made_by(tuple(units)), "table": table})


def _made_by(compiled: Sequence[str]) -> dict[str, bytes]:
    return {"compiler": f"{COMPILER} {OPTIONS} {LIBRARY_OPTIONS} {TARGETS} {compiled}".encode()}


# ---- where there is none


HOW = (
    "compile it: pip install -e . (which brings the compiler, where there is one for this machine)"
    if (Path(__file__).parents[2] / "hatch_build.py").exists()
    else "install a wheel that has it: pip install --force-reinstall --only-binary :all: hovercraft-fmu"
)
AGAIN = "install it again without that variable (from a checkout: pip install .)"
"""What helps where LEAVE_OUT was set."""


def why_not() -> str:
    """Why there is no machine code of the C that is here."""
    try:
        return (COMPILED / WHY_NOT).read_text(encoding="utf-8")
    except OSError:
        return "it was never compiled, or the C was changed since"


# ---- compiling


def compile_all(wanted: Sequence[Library], platforms: Iterable[str] | None = None) -> str:
    """Compile what is not compiled yet, and then forget what is stale; where that fails, all stays.

    Args:
        wanted: all that there is to be; see libraries.py.
        platforms: keys of TARGETS; without them all.

    Returns:
        Why that failed; '' where it did not.
    """
    COMPILED.mkdir(exist_ok=True)
    try:
        _compile(wanted, TARGETS if platforms is None else tuple(platforms))
    except (OSError, subprocess.SubprocessError) as error:
        reason = " ".join(str(error).split())
        (COMPILED / WHY_NOT).write_text(reason, encoding="utf-8")
        return reason
    (COMPILED / WHY_NOT).unlink(missing_ok=True)
    _forget({each.folder for each in wanted})
    return ""


def _forget(keep: set[Path]) -> None:
    """All folders but these."""
    for path in COMPILED.iterdir():
        if path.is_dir() and path not in keep:
            shutil.rmtree(path, ignore_errors=True)  # on Windows one that is loaded stays


def _compile(wanted: Sequence[Library], platforms: Container[str]) -> None:
    """All of them and all platforms side by side; each file is written at once or not at all."""
    jobs = [(each, target) for each in wanted for target in each.targets if target in platforms]
    jobs = [(each, target) for each, target in jobs if not each.file(target).exists()]
    if not jobs:
        return
    _require_compiler()
    with temporary_folder() as place, ThreadPoolExecutor(os.cpu_count()) as pool:
        folder = Path(place)
        for name, content in {name: content for each, _ in jobs for name, content in each.files.items()}.items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_bytes(content)
        for outcome in [pool.submit(_compile_one, each, platform, folder) for each, platform in jobs]:
            outcome.result()


def _compile_one(each: Library, name: str, folder: Path) -> None:
    platform, path = TARGETS[name], each.file(name)
    made = folder / f"{each.name}-{name}"  # a folder, for what else the linker leaves beside it
    made.mkdir()
    command = [*compiler(platform), *LIBRARY_OPTIONS, *each.sources, *platform.options]
    if platform.suffix == ".dylib":
        command.append(f"-Wl,-install_name,@rpath/{path.name}")
    done = subprocess.run(
        [*command, "-o", f"{made.name}/{path.name}"], cwd=folder,
        env={**os.environ, **caches(folder / "cache")}, capture_output=True, text=True, check=False, timeout=TIME_LIMIT,
    )  # fmt: skip
    if done.returncode != 0:
        raise OSError(f"compiling {each.name} for {platform.target} failed: {done.stderr.strip()}")
    write_archive(path, (made / path.name).read_bytes, path.suffix)


def compiler(platform: Platform) -> list[str]:
    """The compiler for a platform, with the options of every compilation."""
    home = resources.files(COMPILER[0])
    command = [str(home / ("zig.exe" if os.name == "nt" else "zig")), "cc", "-target", platform.target, *OPTIONS, "-I."]
    own_headers = {".dll": ["any-windows-any"], ".wasm": ["wasm-wasi-musl", "generic-musl"]}
    for folder in own_headers.get(platform.suffix, []):  # no C library: its headers are to be named
        command += ["-isystem", str(home / "lib" / "libc" / "include" / folder)]
    return command


def caches(folder: Path) -> dict[str, str]:
    """The environment in which the compiler keeps nothing but in that folder."""
    return {"ZIG_GLOBAL_CACHE_DIR": str(folder), "ZIG_LOCAL_CACHE_DIR": str(folder)}


def _require_compiler() -> None:
    package, version = COMPILER
    if os.environ.get(LEAVE_OUT):
        raise OSError(f"{LEAVE_OUT} was set when the package was installed")
    try:
        found = metadata.version(package)
    except metadata.PackageNotFoundError:
        raise OSError(f"the compiler, {package} {version}, was not installed") from None
    if found != version:
        raise OSError(f"{package} {found} was installed: must be {version}, which makes the bytes")
