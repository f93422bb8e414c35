"""Files that are not what they should be, and places that are hard to live in: one line or none, no crash."""

import os
import re
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

import pytest

from hovercraft_fmu.host import Fmu, SimulationError
from hovercraft_fmu.validation import check_file

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="paths and shells of POSIX")

Files = dict[str, bytes]


def without(part: str) -> Callable[[Files], Files]:
    return lambda files: {name: content for name, content in files.items() if not name.startswith(part)}


def with_file(name: str, content: bytes) -> Callable[[Files], Files]:
    return lambda files: {**files, name: content}


EXCHANGE = b'<ModelExchange modelIdentifier="Hovercraft"/>'
DESCRIPTION, MODULE = "modelDescription.xml", "resources/slavemodule.txt"
FORGED: Mapping[str, tuple[Callable[[Files], Files], str]] = {
    "absolute path": (with_file("/etc/evil", b""), "must be an archive that can be extracted; Illegal path"),
    "no description": (without(DESCRIPTION), "must be an FMU with a valid model description"),
    "foreign description": (with_file(DESCRIPTION, b"<other/>"), "must be an FMU with a valid model description"),
    "no text": (with_file(DESCRIPTION, bytes(range(256))), "must be an FMU with a valid model description"),
    "for solvers alone": (
        lambda files: {
            **files,
            DESCRIPTION: re.sub(
                rb"<CoSimulation .*?(/>|</CoSimulation>)", EXCHANGE, files[DESCRIPTION], flags=re.DOTALL
            ),
        },
        "must be an FMU for co-simulation, FMI 2.0 or 3.0",
    ),
    "no binary": (without("binaries"), "Cannot find shared library"),
    "no Python": (without("resources"), "must have resources/slavemodule.txt, which its binary asks for"),
    "another module": (with_file(MODULE, b"nix"), "must have resources/nix.py, which"),
}


@pytest.mark.parametrize("how", FORGED)
def test_a_forged_fmu_is_refused(how: str, fmu: Path, tmp_path: Path) -> None:
    """Of these some ended the process."""
    forge, message = FORGED[how]
    with zipfile.ZipFile(fmu) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    forged = tmp_path / "forged.fmu"
    with zipfile.ZipFile(forged, "w") as archive:
        for name, content in forge(files).items():
            archive.writestr(name, content)
    with pytest.raises((ValueError, SimulationError), match=message), Fmu(forged) as opened, opened.instance():
        pass


@pytest.mark.parametrize("name", ["umläut", "a#b", "a%b", "a+b", "a,b", "a b"])
def test_a_temporary_folder_that_a_python_fmu_does_not_survive(
    name: str, fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The process ended with a segmentation fault: another folder is taken, or it is refused."""
    (tmp_path / name).mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / name))
    with Fmu(fmu) as opened, opened.instance() as craft:
        craft.start()
    if name != "a b":
        monkeypatch.setattr(os, "access", lambda *_: False)  # nor can the usual ones be written to
        with pytest.raises(OSError, match="set TMPDIR to another one, or take a native FMU"):
            Fmu(fmu)


HARD: Mapping[str, tuple[str, str]] = {
    "no output": ("exec >&-", ""),
    "no stream at all": ("exec >&- 2>&- <&-", ""),
    "a backend of matplotlib that is not there": ("export MPLBACKEND=module://matplotlib_inline.backend_inline", ""),
    "no home": ("unset HOME", ""),
    "the folder is gone": ("mkdir gone && cd gone && rmdir ../gone", "the folder that this is called in is gone"),
}


@pytest.mark.parametrize("where", HARD)
def test_where_it_is_hard_to_live(where: str, fmu: Path, tmp_path: Path) -> None:
    """One line or none."""
    shell, message = HARD[where]
    line = f'{shell}; "$0" -W error -m hovercraft_fmu simulate "$1" --set step_size=0.1 --stop-time 1 --plot a.png'
    done = subprocess.run(["sh", "-c", line, sys.executable, str(fmu)], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == (1 if message else 0), done.stderr
    assert message in done.stderr
    assert len(done.stderr.splitlines()) == bool(message)
    assert (tmp_path / "a.png").exists() == (not message)


def test_an_ssp_file_whose_member_is_spoiled_fails_its_first_check(tmp_path: Path) -> None:
    """A stream that cannot be unpacked, as found by `python -m tests.fuzz files`."""
    path = tmp_path / "Spoiled.ssp"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("SystemStructure.ssd", b"structure" * 100)
    content = bytearray(path.read_bytes())
    content[30 + len("SystemStructure.ssd")] = 0xFF  # the first byte after the local header: no kind of block
    path.write_bytes(content)
    (check,) = check_file(path)
    assert check.problems[0].startswith(f"{path}: must be an archive that can be extracted; ")
