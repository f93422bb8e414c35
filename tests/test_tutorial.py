"""The tutorial page inside the FMU promises nothing that does not run."""

import html
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from hovercraft_fmu.building.ssp import build_ssp
from hovercraft_fmu.elsewhere import HOSTS
from hovercraft_fmu.fmu.description import NATIVE
from hovercraft_fmu.fmu.document import pages
from tests.conftest import Fresh

PAGE = pages()["tutorial.html"]
BLOCKS = [html.unescape(text) for text in re.findall(r'<pre class="python">\n(.*?)</pre>', PAGE, re.DOTALL)]
SECTIONS = re.findall(r'<p>((?:(?!<p>).)*?)<pre class="python">', PAGE, re.DOTALL)
"""What stands before each."""
PRINTED = (
    r"end: \(.*\) m",
    r"200 kg: .* in a minute",
    r"^\d\.\d+ m at most; 0 were refused",
    r"^bounced off at -0\.\d+ m/s and .* rad/s: (49|50|51)\.\d J of 50 J",
    r"arrived: True",
    r"after 500 s: .* off the leg",
    r"after 120 s",
)


def test_the_parts_are_found() -> None:
    assert len(BLOCKS) == len(PRINTED)
    assert 'href="tutorial.html"' in pages()["index.html"]
    assert 'href="tutorial.html"' in pages(NATIVE)["index.html"]


@pytest.mark.once
@pytest.mark.parametrize("number", range(len(PRINTED)))
def test_its_code_runs(number: int, native_fmu: Path, autopilot: Path, fresh: Fresh, tmp_path: Path) -> None:
    code = BLOCKS[number]
    if "libcosimpy" in code and (missing := HOSTS["libcosimpy"].missing()):
        pytest.skip(missing)
    (tmp_path / "build").mkdir()
    for path in (native_fmu, autopilot):
        shutil.copy(path, tmp_path / "build" / path.name)
    build_ssp(tmp_path / "build" / "HovercraftNativeLoop.ssp", native_fmu, autopilot)
    printed = fresh(code)
    assert re.search(PRINTED[number], printed)
    assert "libcosimpy" in code or "warning" not in printed.lower()  # fmpy prints it of an input without a column
    assert "this package" in SECTIONS[number] or "hovercraft_fmu" not in code


@pytest.mark.once
@pytest.mark.parametrize("number", [0, 1])
def test_its_first_sections_run_with_fmi_3(number: int, native3_fmu: Path, fresh: Fresh, tmp_path: Path) -> None:
    (tmp_path / "build").mkdir()
    shutil.copy(native3_fmu, tmp_path / "build" / native3_fmu.name)
    assert re.search(PRINTED[number], fresh(BLOCKS[number].replace("HovercraftNative.fmu", native3_fmu.name)))


@pytest.mark.once
def test_the_wall_warns_of_a_step_that_is_too_long_for_it(native_fmu: Path, fresh: Fresh, tmp_path: Path) -> None:
    (tmp_path / "build").mkdir()
    shutil.copy(native_fmu, tmp_path / "build")
    (code,) = [block for block in BLOCKS if "wall" in block]
    assert "the step of 0.1 s is too long for this wall" in fresh(code.replace("50.0, 0.01", "50.0, 0.1"))


TOOLS = pages(NATIVE)["tools.html"]
IN_PYTHON = [html.unescape(text) for text in re.findall(r'<pre class="python">\n(.*?)</pre>', TOOLS, re.DOTALL)]


@pytest.mark.once
@pytest.mark.parametrize(("host", "printed"), [("libcosimpy", r"^300\.0 s$"), ("ecospy", r"^1[0-9]\.\d+$")])
def test_what_is_said_to_have_run_in_a_tool_runs(
    host: str, printed: str, native_fmu: Path, autopilot: Path, fresh: Fresh, tmp_path: Path
) -> None:
    if missing := HOSTS[host].missing():
        pytest.skip(missing)
    if host == "ecospy" and not Path(sys.prefix, "lib", "libtbb.so.12").exists():
        pytest.skip("the package tbb is not in this environment's own folder")
    shutil.copy(native_fmu, tmp_path)
    build_ssp(tmp_path / "HovercraftNativeLoop.ssp", native_fmu, autopilot)
    (code,) = [block for block in IN_PYTHON if host in block]
    assert re.search(printed, fresh(code), re.MULTILINE)


def test_the_command_of_fmpy_runs(native_fmu: Path, tmp_path: Path) -> None:
    (command,) = re.findall(r'<pre class="command">\npython (.*)\n</pre>', TOOLS)
    shutil.copy(native_fmu, tmp_path)
    subprocess.run([sys.executable, *command.split()], cwd=tmp_path, check=True, capture_output=True)
    assert (tmp_path / "out.csv").read_text().startswith('"time"')
