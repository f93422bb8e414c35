"""Two builds of one tree give the same bytes; a build that fails leaves what was there."""

import errno
import hashlib
import os
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest

from hovercraft_fmu.fmu.archive import write_archive
from hovercraft_fmu.fmu.machine_code import COMPILED, LEAVE_OUT
from hovercraft_fmu.fmu.python_package import build_fmu
from tests.conftest import FMI_2, ROOT, Fresh

BUILD = (
    "import sys, os; os.umask(int(sys.argv[1], 8)); import hovercraft_fmu as h; print(h.build('python'), h.__file__)"
)

BUILD_NATIVE = "import hovercraft_fmu as h; h.build()"


def digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.mark.parametrize(("umask", "zone"), [("022", "UTC"), ("077", "Pacific/Auckland")])
def test_the_same_bytes_elsewhere(fmu: Path, fresh: Fresh, tmp_path: Path, umask: str, zone: str) -> None:
    assert fresh(BUILD, umask, env={"TZ": zone}).split()[0] == str(Path("build/Hovercraft.fmu"))
    assert digest(tmp_path / "build" / "Hovercraft.fmu") == digest(fmu)


def archives(kind: str, place: Path, out: Path) -> Path:
    """What the build front end makes of a folder, with the tools of this environment."""
    command = [sys.executable, "-m", "build", f"--{kind}", "--no-isolation", "--outdir", str(out), str(place)]
    subprocess.run(command, check=True, capture_output=True)
    (made,) = out.iterdir()
    return made


COMPILED_AGAIN = (
    "x86_64-windows/HovercraftNative.dll",
    "aarch64-darwin/HovercraftNative3.dylib",
    "x86_64-linux/HovercraftFleet.so",
    "wasm32/HovercraftNative3.wasm",
)
"""One file of each kind of library: all of them would take as long as an install."""


@pytest.mark.once
@FMI_2
def test_the_wheel_of_a_checkout_and_of_the_sdist_and_their_fmus(
    fmu: Path, complete_native_fmu: Path, fresh: Fresh, tmp_path: Path
) -> None:
    """The same bytes, machine code that is compiled again and all, for any Python, at most 4 MB; nothing in the sdist
    that only looks like its files.
    """
    wheel, sdist = (archives(kind, ROOT, tmp_path / kind) for kind in ("wheel", "sdist"))
    assert wheel.name.endswith("-py3-none-any.whl")
    assert wheel.stat().st_size <= 4_000_000
    with tarfile.open(sdist) as archive:
        top = {name.split("/")[1] for name in archive.getnames()}
        assert not [name for name in archive.getnames() if "/compiled/" in name or "site-packages" in name]
        archive.extractall(tmp_path / "unpacked", filter="data")
    assert top == {
        ".gitignore", ".readme", "CHANGELOG.md", "CITATION.cff", "LICENSE", "PKG-INFO", "README.md", "SECURITY.md",
        "hatch_build.py", "hovercraft_fmu", "licenses", "pyproject.toml", "tests",
    }  # fmt: skip
    (unpacked,) = (tmp_path / "unpacked").iterdir()
    machine_code = shutil.copytree(COMPILED, unpacked / COMPILED.relative_to(ROOT))
    for name in COMPILED_AGAIN:
        (once_made,) = machine_code.glob(f"*/{name}")
        once_made.unlink()
    assert archives("wheel", unpacked, tmp_path / "again").read_bytes() == wheel.read_bytes()
    installed = tmp_path / "installed"
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet"]
    subprocess.run([*pip, "install", "--no-deps", "--target", str(installed), str(wheel)], check=True)
    printed = fresh(BUILD, "022", env={"PYTHONPATH": str(installed)})
    assert printed.split()[1].startswith(str(installed))
    assert digest(tmp_path / "build" / "Hovercraft.fmu") == digest(fmu)
    fresh(BUILD_NATIVE, env={"PYTHONPATH": str(installed)})
    assert digest(tmp_path / "build" / "HovercraftNative.fmu") == digest(complete_native_fmu)


@pytest.mark.once
def test_a_wheel_without_a_compiler_says_what_is_missing(fresh: Fresh, tmp_path: Path) -> None:
    """The install succeeds, and shows nothing of what the hook printed."""
    apart, installed = tmp_path / "apart", tmp_path / "installed"
    shutil.copytree(ROOT, apart, ignore=shutil.ignore_patterns("compiled", ".venv*", ".git", "build", "dist", "tests"))
    pip = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--quiet", "install", "--no-deps"]
    environment = {**os.environ, LEAVE_OUT: "1"}
    command = [*pip, "--no-build-isolation", "--target", str(installed), str(apart)]
    subprocess.run(command, check=True, env=environment)
    code = """
import hovercraft_fmu as h
print(h.build("python"))
try:
    h.build()
except OSError as error:
    print(error)
"""
    python, missing = fresh(code, env={"PYTHONPATH": str(installed)}).splitlines()
    assert python == str(Path("build/Hovercraft.fmu"))
    assert missing.startswith(f"no machine code: {LEAVE_OUT} was set when the package was installed; install it ")


def test_a_build_leaves_the_process_as_it_was(tmp_path: Path) -> None:
    path, modules = list(sys.path), {name for name in sys.modules if name.startswith("hovercraft")}
    build_fmu(tmp_path / "A.fmu")
    assert sys.path == path
    assert {name for name in sys.modules if name.startswith("hovercraft")} == modules


def test_build_run_and_build_again_in_one_process(fresh: Fresh) -> None:
    code = """
import hovercraft_fmu as h
one = h.build("python", "One.fmu").read_bytes()
first = h.simulate("turn", "One.fmu")
assert h.build("python", "Two.fmu").read_bytes() == one
assert (h.simulate("turn", "Two.fmu").data == first.data).all()
print("ok")
"""
    assert fresh(code).strip() == "ok"


def test_bad_paths(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"x\.zip': must end in \.fmu"):
        build_fmu(tmp_path / "x.zip")
    folder = tmp_path / "folder.fmu"
    folder.mkdir()
    with pytest.raises(IsADirectoryError, match="must be a file, and is a folder"):
        build_fmu(folder)
    assert list(tmp_path.iterdir()) == [folder]


@pytest.mark.parametrize("code", [errno.EROFS, errno.ENOSPC])
def test_where_nothing_can_be_written_the_target_is_named(
    code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file system says no: a place for reading alone, or a full one."""

    def refuse(path: Path, _: bytes) -> int:
        raise OSError(code, os.strerror(code), str(path))

    target = tmp_path / "X.fmu"
    target.write_text("before")
    monkeypatch.setattr(Path, "write_bytes", refuse)
    with pytest.raises(OSError, match=r"must be in a folder that can be written to, with room for it") as error:
        write_archive(target, lambda: b"after")
    assert error.value.filename == str(target)
    assert str(error.value.strerror).endswith(f" ({os.strerror(code)})")
    assert target.read_text() == "before"


def test_one_licence() -> None:
    shipped = ROOT / "hovercraft_fmu" / "fmu" / "documentation" / "licenses" / "license.txt"
    assert shipped.read_bytes() == (ROOT / "LICENSE").read_bytes()
