"""What an FMU is: code, table, compiler and options. What is written about it is not part of it.

FMI 2.0.5, 2.2.1 (guid), and FMI 3.0.2, 2.4.1 (instantiationToken): it ties the description to the code.
"""

import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import fmpy
import pytest

from hovercraft_fmu.fmu import document, machine_code, python_package
from hovercraft_fmu.fmu.description import NATIVE, NATIVE3, Flavour
from hovercraft_fmu.fmu.machine_code import identity
from hovercraft_fmu.fmu.native_package import build_native_fmu
from hovercraft_fmu.fmu.python_package import build_fmu
from tests.conftest import HERE
from tests.lowlevel import everything, one, put, start

Copied = Callable[[ModuleType, str], Path]


@pytest.fixture
def copied(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Copied:
    """A folder of the package that a module reads is a copy now, to be changed."""

    def copy(module: ModuleType, name: str) -> Path:
        folder = Path(shutil.copytree(getattr(module, name), tmp_path / "copy"))
        monkeypatch.setattr(module, name, folder)
        return folder

    return copy


def guid(fmu: Path) -> str:
    return str(fmpy.read_model_description(fmu).guid)


def change(path: Path, old: str, new: str) -> None:
    text = path.read_text(encoding="utf-8")
    assert old in text
    path.write_text(text.replace(old, new, 1), encoding="utf-8")


def test_with_other_pages_it_is_the_same_fmu_and_takes_the_saved_state(
    each_fmu: Path, flavour: str, copied: Copied, tmp_path: Path
) -> None:
    change(copied(document, "FOLDER") / "index.html.jinja", "<h2>Frames</h2>", "<h2>Frames and signs</h2>")
    path = tmp_path / each_fmu.name
    if flavour == "python":
        rewritten = build_fmu(path)
    else:
        rewritten = build_native_fmu(path, {"native": NATIVE, "native3": NATIVE3}[flavour], HERE[sys.platform])
    assert rewritten.read_bytes() != each_fmu.read_bytes()
    assert guid(rewritten) == guid(each_fmu)
    with one(each_fmu) as (saved, _), one(rewritten) as (restored, _):
        start(saved, velocity__x=0.25)
        put(saved, thrust=9.0)
        saved.doStep(0.0, 0.5)
        restored.setFMUstate(restored.deSerializeFMUstate(saved.serializeFMUstate(saved.getFMUstate())))
        assert everything(restored) == everything(saved)


def test_with_another_constant_in_the_model_it_is_another_python_fmu(fmu: Path, copied: Copied, tmp_path: Path) -> None:
    change(copied(python_package, "PACKAGE") / "model" / "craft.py", "return 0.5 * self", "return 0.25 * self")
    assert guid(build_fmu(tmp_path / "Other.fmu")) != guid(fmu)


@pytest.mark.parametrize("flavour", [NATIVE, NATIVE3], ids=lambda flavour: flavour.identifier)
def test_with_another_constant_in_the_kernel_it_is_another_native_fmu(flavour: Flavour, copied: Copied) -> None:
    before = identity(flavour)
    change(
        copied(machine_code, "C_FOLDER") / "hovercraft" / "kernel.c",
        "0.5 * craft->air_density",
        "0.25 * craft->air_density",
    )
    assert identity(flavour) != before


@pytest.mark.parametrize("flavour", [NATIVE, NATIVE3], ids=lambda flavour: flavour.identifier)
def test_with_another_option_of_the_compiler_it_is_another_native_fmu(
    flavour: Flavour, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = identity(flavour)
    monkeypatch.setattr(machine_code, "OPTIONS", (*machine_code.OPTIONS, "-O3"))
    assert identity(flavour) != before
