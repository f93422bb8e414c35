"""Two builds of one tree give the same bytes; a build that fails leaves what was there."""

import hashlib
import subprocess
import sys
from pathlib import Path

import pytest

from hovercraft_fmu import build_fmu
from tests.conftest import HERE, ROOT, Fresh

BUILD = "import sys, os; os.umask(int(sys.argv[1], 8)); import hovercraft_fmu as h; print(h.build_fmu(), h.__file__)"

BUILD_NATIVE = """
import sys
from hovercraft_fmu.fmu.native_package import build_native_fmu
build_native_fmu(platforms=sys.argv[1:])
"""


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize(("umask", "zone"), [("022", "UTC"), ("077", "Pacific/Auckland")])
def test_the_same_bytes_elsewhere(fmu: Path, fresh: Fresh, tmp_path: Path, umask: str, zone: str) -> None:
    assert fresh(BUILD, umask, env={"TZ": zone}).split()[0] == str(Path("build/Hovercraft.fmu"))
    assert digest(tmp_path / "build" / "Hovercraft.fmu") == digest(fmu)


def test_the_same_bytes_from_an_installed_wheel(fmu: Path, native_fmu: Path, fresh: Fresh, tmp_path: Path) -> None:
    wheels, installed = tmp_path / "wheels", tmp_path / "installed"
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet"]
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(wheels), str(ROOT)]
    subprocess.run(build, check=True, capture_output=True)
    (wheel,) = wheels.glob("*.whl")
    subprocess.run([*pip, "install", "--no-deps", "--target", str(installed), str(wheel)], check=True)
    printed = fresh(BUILD, "022", env={"PYTHONPATH": str(installed)})
    assert printed.split()[1].startswith(str(installed))
    assert digest(tmp_path / "build" / "Hovercraft.fmu") == digest(fmu)
    fresh(BUILD_NATIVE, *HERE[sys.platform], env={"PYTHONPATH": str(installed)})
    assert digest(tmp_path / "build" / "HovercraftNative.fmu") == digest(native_fmu)


def test_a_build_leaves_the_process_as_it_was(tmp_path: Path) -> None:
    path, modules = list(sys.path), {name for name in sys.modules if name.startswith("hovercraft")}
    build_fmu(tmp_path / "A.fmu")
    assert sys.path == path
    assert {name for name in sys.modules if name.startswith("hovercraft")} == modules


def test_build_run_and_build_again_in_one_process(fresh: Fresh) -> None:
    code = """
import hovercraft_fmu as h
one = h.build_fmu("One.fmu").read_bytes()
first = h.simulate("turn", "One.fmu")
assert h.build_fmu("Two.fmu").read_bytes() == one
assert (h.simulate("turn", "Two.fmu").data == first.data).all()
print("ok")
"""
    assert fresh(code).strip() == "ok"


def test_bad_paths(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"x\.zip': must end in \.fmu"):
        build_fmu(tmp_path / "x.zip")
    folder = tmp_path / "folder.fmu"
    folder.mkdir()
    with pytest.raises(OSError, match="folder"):
        build_fmu(folder)
    assert list(tmp_path.iterdir()) == [folder]


def test_one_licence() -> None:
    shipped = ROOT / "hovercraft_fmu" / "fmu" / "documentation" / "licenses" / "license.txt"
    assert shipped.read_bytes() == (ROOT / "LICENSE").read_bytes()
