"""The C of the native FMU as this machine's compiler builds it, through ctypes."""

import itertools
import shutil
import subprocess
from collections.abc import Iterable, Sequence
from ctypes import (
    CDLL,
    Structure,
    byref,
    c_bool,
    c_char_p,
    c_double,
    c_int32,
    c_int64,
    c_void_p,
    create_string_buffer,
)
from dataclasses import astuple, fields
from pathlib import Path
from typing import Any

import fmpy
import pytest

from hovercraft_fmu import elsewhere
from hovercraft_fmu.elsewhere import compiler
from hovercraft_fmu.fmu.description import NATIVE, Flavour
from hovercraft_fmu.fmu.machine_code import OPTIONS, c_file, c_folders, headers, sources
from hovercraft_fmu.fmu.native_package import binary
from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.dynamics import Controls, State
from hovercraft_fmu.model.error_estimate import Companion
from hovercraft_fmu.model.integrators import INTEGRATORS, Integrator, Stretch
from hovercraft_fmu.model.subcycling import Settings
from hovercraft_fmu.scenes import SCENES

C_TESTS = Path(__file__).parent / "c"
C_FOLDERS = tuple(f"-I{folder}" for folder in c_folders())
KERNEL_FILES = (*(c_file(f"{name}.c") for name in ("kernel", "trig", "logarithm")), C_TESTS / "rounding_of.c")
C_INCLUDES = ("-I", str(Path(elsewhere.__file__).parent))
"""Of the calls of both standards."""
OUTCOMES = ("advanced", "too many sub-steps", "not finite", "step too small")
NO_RAMP = Controls(0.0)
STEPS = {"semi_implicit_euler": 0.01, "drag_implicit": 0.02, "rk4": 0.1, "adaptive": 0.05, "splitting": 0.05}
"""s: a sub-step for each method, with which none of the scenes warns"""
IN_TURN = dict(zip(SCENES, itertools.cycle(STEPS), strict=False))
"""A method for every scene."""
WITH_EVERY = ("turn", "crosswind", "drift_to_rest")
"""A plain scene, and those that have what costs a method code of its own: wind, and friction."""
SCENES_AND_METHODS = [
    (scene, method) for scene in SCENES for method in STEPS if scene in WITH_EVERY or method == IN_TURN[scene]
]


def c_compiler() -> str:
    """The C compiler of this machine, or the test is skipped."""
    name = compiler()
    if name is None:
        pytest.skip("no C compiler (cc, gcc, clang)")
    return name


def written_sources(folder: Path, flavour: Flavour = NATIVE) -> Path:
    """The sources of a native FMU, generated header and all, in `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, content in {**sources("0" * 32, flavour), **headers(flavour)}.items():
        (folder / name).write_bytes(content)
    return folder


def compile_c(output: Path, files: Iterable[Path | str], *options: str) -> Path:
    """Compile with this machine's compiler and the options of the FMU, warnings as errors."""
    command = [c_compiler(), *OPTIONS, "-Wall", "-Wextra", "-Werror", *C_FOLDERS, "-o", str(output)]
    done = subprocess.run([*command, *map(str, files), *options], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return output


class CCraft(Structure):
    _fields_ = [(field.name, c_int32 if field.name == "drag_area" else c_double) for field in fields(Craft)]


class CState(Structure):
    _fields_ = [(name, c_double) for name in State._fields]


class CControls(Structure):
    _fields_ = [(name, c_double) for name in Controls._fields]


class CDrive(Structure):
    _fields_ = [("start", CControls), ("rate", CControls), ("varies", c_bool), ("ask", c_void_p), ("asked", c_void_p)]


class CSettings(Structure):
    _fields_ = [("step_size", c_double), ("integrator", c_int32), ("tolerance", c_double)]


class CStretch(Structure):
    _fields_ = [
        ("state", CState),
        ("substeps", c_int64),
        ("stability", c_double),
        ("rotation", c_double),
        ("proposed", c_double),
        ("substep", c_double),
    ]


class CCompanion(Structure):
    _fields_ = [("state", CState), ("proposed", c_double)]


class CError(Structure):
    _fields_ = [("position", c_double), ("heading", c_double)]


class CLoads(Structure):
    _fields_ = [(name, c_double) for name in ("x", "y", "moment", "kq")]


def numbers_of(structure: Structure, names: Sequence[str]) -> tuple[float, ...]:
    return tuple(getattr(structure, name) for name in names)


def _drive(controls: Controls, rate: Controls) -> CDrive:
    return CDrive(CControls(*controls), CControls(*rate), any(rate))


def _chosen(settings: Settings) -> CSettings:
    return CSettings(settings.step_size, INTEGRATORS.index(settings.integrator) + 1, settings.tolerance)


class Kernel:
    """kernel.c in a shared library."""

    def __init__(self, library: Path) -> None:
        self.library: Any = CDLL(str(library))
        self.library.kernel_loads_on.restype = CLoads
        self.library.kernel_estimated_error.restype = CError
        for function, arguments in ((self.library.rounding_of, 3), (self.library.kernel_meant_step, 4)):
            function.restype, function.argtypes = c_double, (c_double,) * arguments

    def advance(
        self,
        state: State,
        controls: Controls,
        craft: Craft,
        communication_step: float,
        settings: Settings = Settings(),  # noqa: B008 - immutable
        proposed: float = 0.0,
        rate: Controls = NO_RAMP,
    ) -> tuple[str, Stretch]:
        """What came of it (see OUTCOMES), and the stretch."""
        drive, chosen, made = _drive(controls, rate), _chosen(settings), CStretch()
        outcome = self.library.kernel_advance(
            byref(CState(*state)), byref(drive), byref(CCraft(*astuple(craft))), c_double(communication_step),
            byref(chosen), c_double(proposed), byref(made),
        )  # fmt: skip
        reached = State(*numbers_of(made.state, State._fields))
        return OUTCOMES[outcome], Stretch(reached, made.substeps, made.stability, made.rotation, made.proposed)

    def accompany(
        self,
        companion: Companion,
        controls: Controls,
        craft: Craft,
        communication_step: float,
        settings: Settings,
        made: tuple[int, float],
        rate: Controls = NO_RAMP,
    ) -> Companion:
        """Beside a craft that made so many sub-steps of a size [s]."""
        beside = CCompanion(CState(*companion.state), companion.proposed)
        drive, chosen = _drive(controls, rate), _chosen(settings)
        self.library.kernel_accompany(
            byref(beside), byref(drive), byref(CCraft(*astuple(craft))), c_double(communication_step), byref(chosen),
            byref(CStretch(substeps=made[0], substep=made[1])),
        )  # fmt: skip
        return Companion(State(*numbers_of(beside.state, State._fields)), beside.proposed)

    def estimated_error(
        self, state: State, companion: Companion, craft: Craft, method: Integrator
    ) -> tuple[float, ...]:
        beside = CCompanion(CState(*companion.state), companion.proposed)
        arguments = byref(CState(*state)), byref(beside), method.rubbing_order if craft.rubs else method.order
        return numbers_of(self.library.kernel_estimated_error(*arguments), ("position", "heading"))

    def rounding(self, *arguments: float) -> float:
        """As in subcycling.py."""
        return float(self.library.rounding_of(*arguments))

    def meant_step(self, *arguments: float) -> float:
        """As in subcycling.py."""
        return float(self.library.kernel_meant_step(*arguments))

    def too_strong(self, controls: Controls, craft: Craft) -> str | None:
        """As in subcycling.py."""
        place = int(self.library.kernel_too_strong(byref(CControls(*controls)), byref(CCraft(*astuple(craft)))))
        return (*Controls._fields, None)[place]

    def loads(self, state: State, controls: Controls, craft: Craft) -> tuple[float, ...]:
        arguments = byref(CState(*state)), byref(CControls(*controls)), byref(CCraft(*astuple(craft)))
        return numbers_of(self.library.kernel_loads_on(*arguments), ("x", "y", "moment", "kq"))


class Text:
    """text.c in a shared library."""

    def __init__(self, library: Path) -> None:
        self.library: Any = CDLL(str(library))
        self.buffer = create_string_buffer(640)

    def real(self, form: str, value: float) -> str:
        self.library.text_of_real(self.buffer, c_char_p(form.encode()), c_double(value))
        return self.buffer.value.decode()

    def integer(self, form: str, value: int) -> str:
        self.library.text_of_integer(self.buffer, c_char_p(form.encode()), c_int64(value))
        return self.buffer.value.decode()

    def string(self, form: str, value: str) -> str:
        self.library.text_of_string(self.buffer, c_char_p(form.encode()), c_char_p(value.encode()))
        return self.buffer.value.decode()


def compiled_with_libm(fmu: Path, flavour: Flavour, folder: Path) -> Path:
    """The native FMU, its sources compiled with the platform's sine, cosine and arctangent, which Python uses, too."""
    fmpy.extract(str(fmu), unzipdir=str(folder))
    for name, content in headers(flavour).items():
        (folder / "sources" / name).write_bytes(content)
    library = folder / "binaries" / binary("x86_64-linux", flavour)
    command = [c_compiler(), *OPTIONS, "-shared", "-fPIC", "-DHOVERCRAFT_LIBM", "-o", str(library), flavour.unit,
               f"-DFMI{flavour.fmi}_OVERRIDE_FUNCTION_PREFIX", "-lm"]  # fmt: skip
    subprocess.run(command, cwd=folder / "sources", check=True)
    return Path(shutil.make_archive(str(folder / "libm"), "zip", folder)).rename(folder / "libm.fmu")
