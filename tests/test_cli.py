"""The command as its user meets it, in an empty folder; as a program of its own it is in test_readme.py."""

import csv
import json
import os
import re
import subprocess
import sys
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from click.shell_completion import ShellComplete
from click.testing import CliRunner
from PIL import Image
from rich.console import Group
from rich.table import Table

from hovercraft_fmu.cli import OUTPUT, commands
from hovercraft_fmu.fmu.archive import zipped
from hovercraft_fmu.scenes import SCENES
from hovercraft_fmu.studies import MEASUREMENTS
from tests.conftest import FMI_2
from tests.shell import PROGRESS, Shell


def test_hints_are_printed_as_they_stand() -> None:
    """rich takes [plot] for markup where it may."""
    hint = "pip install 'hovercraft-fmu[plot]'"
    table = Table(hint, title=hint, box=None)
    table.add_row(hint)
    with OUTPUT.capture() as printed:
        OUTPUT.print(Group(hint, table))
    assert printed.get().count(hint) == 4


def test_a_command_is_heard_after_a_quiet_one(tmp_path: Path) -> None:
    """In one process, as tests and notebooks have it."""
    build = ["build", "python", "--output", str(tmp_path)]
    before, after = (CliRunner().invoke(commands, [*build, *quiet]).output for quiet in (("--quiet",), ()))
    assert (before, after != "") == ("", True)


def test_bare_command_helps(shell: Shell) -> None:
    printed = shell.ok()
    assert "hovercraft-fmu demo" in printed
    assert all(command in printed for command in ("build", "simulate", "validate", "demo", "measure"))


@pytest.mark.once
@pytest.mark.usefixtures("complete_native_fmu")
@FMI_2
def test_demo(shell: Shell) -> None:
    """The README's first command, as a program; what it says comes next, here."""
    program = Path(sys.executable).parent / "hovercraft-fmu"
    done = subprocess.run([program, "demo"], cwd=shell.folder, capture_output=True, text=True, timeout=600)
    assert (done.returncode, PROGRESS.sub("", done.stderr)) == (0, "")
    printed = done.stdout
    assert printed.count("  ok    ") == 4 + 3
    agree = re.search(r"HovercraftNative.fmu and Hovercraft.fmu agree .* the largest difference is (\S+), of", printed)
    assert agree
    assert float(agree[1]) < 1e-12
    assert "FAILED" not in printed
    assert "51.1 craft lengths" in printed
    commands = [line.strip() for line in printed.splitlines() if line.startswith("  hovercraft-fmu ")]
    assert len(commands) == 3
    assert {path.name for path in (shell.folder / "build").glob("*.fmu")} == {"HovercraftNative.fmu", "Hovercraft.fmu"}
    assert (shell.folder / "build" / "demo" / "ice.csv").read_text().startswith('"time","thrust"')
    with Image.open(shell.folder / "build" / "demo" / "ice.png") as picture:
        assert picture.size == (1440, 810)
    for command in commands:
        shell.ok(*command.split()[1:])


def test_a_control_log_is_read_once(shell: Shell, fmu: Path) -> None:
    """So it may come through a pipe."""
    pipe = shell.folder / "piped.csv"
    os.mkfifo(pipe)
    with ThreadPoolExecutor(1) as pool:
        pool.submit(pipe.write_text, "time,thrust\n0,5\n1,5\n")
        printed = shell.ok("simulate", str(fmu), "--input", "piped.csv", "--set", "step_size=0.01")
    assert "1 s, 100 communication steps" in printed


@pytest.mark.usefixtures("native_at_hand")
def test_build_and_validate(shell: Shell) -> None:
    assert shell.ok("validate").startswith("checking build/HovercraftNative.fmu")
    printed, built = shell.ok("build", "python"), shell.folder / "build" / "Hovercraft.fmu"
    assert printed.startswith(f"build/Hovercraft.fmu: {built.stat().st_size / 1000:.0f} kB, ")
    assert shell.ok("validate", "build/Hovercraft.fmu", "build/HovercraftNative.fmu").count("checking") == 2
    checked = [line for line in shell.ok("validate").splitlines() if line.startswith("checking")]
    assert checked == ["checking build/HovercraftNative.fmu", "checking build/Hovercraft.fmu"]


def test_an_ssp_file_is_named_as_such_and_checked(shell: Shell) -> None:
    shell.ok("build", "python_loop")
    done = shell.run("simulate", "build/HovercraftLoop.ssp")
    assert (done.status, done.out) == (1, "")
    assert done.err.startswith("hovercraft-fmu: build/HovercraftLoop.ssp: is an SSP file, a loop of FMUs: must be")
    assert "'hovercraft-fmu demo --loop'" in done.err
    printed = shell.ok("validate", "build/HovercraftLoop.ssp")
    assert printed.count("  ok    ") == 2 + 2 * 3
    assert "resources/Autopilot.fmu: load, initialize, 5 steps" in printed
    assert printed.endswith("valid: 1 file, every check passed\n")


def test_what_an_ssp_file_lacks_is_found(shell: Shell) -> None:
    """A schema, a member, a connector, the end of a connection."""
    shell.ok("build", "python_loop")
    path = shell.folder / "build" / "HovercraftLoop.ssp"
    with zipfile.ZipFile(path) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    structure = files["SystemStructure.ssd"].replace(b'name="pose.x"', b'name="pose.z"', 1)
    files["SystemStructure.ssd"] = structure.replace(b"Autopilot.fmu", b"Pilot.fmu").replace(b'version="1.0"', b"")
    del files["resources/Hovercraft.fmu"]
    path.write_bytes(zipped(files))
    done = shell.run("validate", str(path), "--json")
    assert done.status == 1
    checks = json.loads(done.out)["files"][0]["checks"]
    assert [check["result"] for check in checks[:2]] == ["FAILED", "FAILED"]
    assert "attribute 'version' is required" in checks[0]["problems"][0]
    problems = "\n".join(checks[1]["problems"])
    assert "source = 'resources/Pilot.fmu': must be in the archive" in problems
    assert "source = 'resources/Hovercraft.fmu': must be in the archive" in problems
    assert re.search(r"connection (start|end) = '\w+\.pose\.x': must be a connector", problems)


@pytest.mark.usefixtures("native_at_hand")
def test_validate_goes_on_and_ends_with_one_verdict(shell: Shell) -> None:
    (shell.folder / "bad.ssp").write_bytes(zipped({"SystemStructure.ssd": b"no XML"}))
    names = ("nix.fmu", "bad.ssp", "build/HovercraftNative.fmu")
    done = shell.run("validate", *names, "--junit", "a/report.xml")
    assert done.status == 1
    assert [line for line in done.out.splitlines() if line.startswith("checking")] == [f"checking {n}" for n in names]
    assert done.err == "hovercraft-fmu: not valid: 2 of 3 files, 2 problems found\n"
    suites = ET.parse(shell.folder / "a" / "report.xml").getroot()
    assert [(each.get("name"), each.get("failures")) for each in suites] == list(zip(names, "110", strict=True))
    assert int(suites[2].get("tests", "")) == len(suites[2].findall("testcase")) == 4
    assert "nix.fmu: no such FMU" in suites[0][0][0].get("message", "")


@pytest.mark.usefixtures("native_at_hand")
@pytest.mark.parametrize(
    "option", ["--output=file/a.csv", "--plot=file/b/a.png", "--animate=file/a.gif", "--output=d.csv"]
)
def test_what_cannot_be_written_is_said_before_the_run(option: str, shell: Shell) -> None:
    (shell.folder / "file").touch()
    (shell.folder / "d.csv").mkdir()
    done = shell.run("simulate", option)
    assert (done.status, done.out) == (1, "")
    assert re.fullmatch(
        r"hovercraft-fmu: (file/.*: must be in a folder, and file is a file|d\.csv: must be a file, and is a folder)\n",
        done.err,
    )


def test_no_fmu_is_refused_before_it_is_said_to_run(shell: Shell) -> None:
    (shell.folder / "a.fmu").write_bytes(b"no archive")
    for name in ("a.fmu", "nix.fmu"):
        assert shell.run("simulate", name).out == ""


def test_validate_fails_loudly(fmu: Path, shell: Shell) -> None:
    """An FMU whose binary cannot be loaded, and whose description has an unknown unit."""
    with zipfile.ZipFile(fmu) as good, zipfile.ZipFile(shell.folder / "bad.fmu", "w") as bad:
        for name in good.namelist():
            content = good.read(name)
            if name == "modelDescription.xml":
                content = content.replace(b'unit="kg.m2"', b'unit="stone"')
            bad.writestr(name, b"no library" if name.startswith("binaries") else content)
    done = shell.run("validate", "bad.fmu")
    assert done.status == 1
    assert done.out.count("FAILED") == 2
    assert 'The unit "stone"' in done.out
    assert "problems found" in done.err


@pytest.mark.usefixtures("native_at_hand")
def test_the_native_fmu_is_run_where_none_is_named(shell: Shell, fmu: Path) -> None:
    short = ("simulate", "--stop-time", "1", "--set", "step_size=0.1")
    native, python = shell.folder / "build" / "HovercraftNative.fmu", shell.folder / "build" / "Hovercraft.fmu"
    printed = shell.ok(*short)
    assert printed.startswith("running build/HovercraftNative.fmu\n")
    assert not python.exists()
    other = shell.ok(*short, "--fmu", "python")
    assert other.startswith("running build/Hovercraft.fmu\n")
    assert other.splitlines()[1:] == printed.splitlines()[1:]
    assert python.read_bytes() == fmu.read_bytes()
    assert "must not be given together" in shell.refused(*short, "--fmu", "python", "build/Hovercraft.fmu", status=2)
    _edit(native, b' version="', b' version="0.0.')
    assert "is of version 0.0.0.1.0 of hovercraft-fmu, which is 0.1.0 now; 'hovercraft-fmu build native' writes" in (
        shell.refused(*short)
    )
    _edit(python, b' guid="{', b' guid="{f')
    assert "was built of other code than there is now" in shell.refused(*short, "--fmu", "python")
    native.write_bytes(b"no archive")
    assert "must be an FMU with a model description" in shell.refused(*short)


def _edit(fmu: Path, old: bytes, new: bytes) -> None:
    """In the model description."""
    with zipfile.ZipFile(fmu) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    files["modelDescription.xml"] = files["modelDescription.xml"].replace(old, new, 1)
    assert old in files["modelDescription.xml"]
    fmu.write_bytes(zipped(files))


@pytest.mark.usefixtures("native_at_hand")
def test_simulate_writes_what_is_asked_for(shell: Shell) -> None:
    printed = shell.ok(
        "simulate", "--scene", "turn", "--set", "mass=200", "--stop-time", "20", "--output", "a/turn.csv", "--plot",
        "a/turn.png", "--communication-step", "0.5",
    )  # fmt: skip
    assert "20 s, 40 communication steps" in printed
    assert len((shell.folder / "a" / "turn.csv").read_text().splitlines()) == 42 + 3  # jumps
    assert (shell.folder / "a" / "turn.png").stat().st_size > 10000


@pytest.mark.usefixtures("native_at_hand")
def test_simulate_a_control_log(shell: Shell) -> None:
    (shell.folder / "log.csv").write_text("time,thrust\n0,5\n3,5\n")
    assert "3 s, 300 communication steps" in shell.ok("simulate", "--input", "log.csv", "--preset", "ice")


@pytest.mark.usefixtures("native_at_hand")
def test_what_is_written_is_read_and_gives_the_same_motion(shell: Shell) -> None:
    options = ("--preset", "ice", "--communication-step", "0.5", "--set", "integrator=rk4")
    (shell.folder / "log.csv").write_text("time,thrust,port_thruster\n0,5,0\n3.3,8,1\n3.3,2,1\n7.2,2,0\n")
    first = shell.ok("simulate", "--input", "log.csv", *options, "--output", "result.csv")
    again = shell.ok("simulate", "--input", "result.csv", *options, "--output", "again.csv")
    assert "result.csv is a result: its inputs are used, not its outputs" in again
    assert "warning" not in again
    found, expected = (each.partition("duration")[2].partition("wrote")[0] for each in (again, first))
    assert found == expected != ""
    assert (shell.folder / "result.csv").read_bytes() == (shell.folder / "again.csv").read_bytes()


@pytest.mark.usefixtures("native_at_hand")
def test_columns_that_are_not_used_are_named(shell: Shell) -> None:
    (shell.folder / "log.csv").write_text("time,thrust,pose.x,pose.y,speed\n0,5,7,0,0\n1,5,8,0,1\n")
    printed = shell.ok("simulate", "--input", "log.csv")
    assert "log.csv: columns not used: pose.x, pose.y, speed\n" in printed
    assert "warning: log.csv begins elsewhere than the run: pose.x = 7, not 0 (--set)" in printed
    assert "warning" not in shell.ok("simulate", "--input", "log.csv", "--set", "pose.x=7")
    assert shell.ok("simulate", "--input", "log.csv", "-q") == ""


@pytest.mark.usefixtures("native_at_hand")
def test_one_row_holds_and_says_so(shell: Shell) -> None:
    (shell.folder / "log.csv").write_text("time,thrust\n5,10\n")
    printed = shell.ok("simulate", "--input", "log.csv", "--communication-step", "1")
    assert "log.csv has one row: it holds for the default duration, 60 s" in printed
    assert "60 s, 60 communication steps" in printed
    assert "one row" not in shell.ok("simulate", "--input", "log.csv", "--stop-time", "6")


def test_list_scenes(shell: Shell) -> None:
    printed = shell.ok("simulate", "--list-scenes")
    assert all(f"\n{name} " in printed for name in SCENES)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("simulate", "--scene", "trun"), "scene = 'trun': must be one of launch, .*; did you mean 'turn'?"),
        (("simulate", "--output", "a.txt"), "output = 'a.txt': must end in .csv or .parquet"),
        (("simulate", "--reference", "nix.csv"), "nix.csv: No such file or directory"),
        (("simulate", "--set", "mass=1e400"), "mass = 1e400: must be a finite number"),
        (("simulate", "--set", "mass=-4"), "mass = -4.0: must be greater than 0"),
        (("simulate", "--set", "mas=4"), "mas = 4: must be a variable that can be set.*; did you mean 'mass'?"),
        (("simulate", "--input", "nix.csv"), "nix.csv: No such file or directory"),
        (("simulate", "nix.fmu"), "nix.fmu: no such FMU"),
        (("simulate", "nowhere/nix.fmu"), "nix.fmu: no such FMU"),
        (("simulate", "--plot", "a.txt"), "plot = 'a.txt': must end in .png, .svg or .pdf"),
        (("sweep", "turning_circle", "--plot", "a.txt"), "plot = 'a.txt': must end in .png"),
        (("sweep", "turning_circl"), "did you mean 'turning_circle'?"),
        (("measure", "trad"), "measurement = 'trad': must be one of trade, .*; did you mean 'trade'?"),
        (("simulate", "--preset", "moon"), "preset = 'moon': must be one of textbook, ice"),
        (("validate", "nix.fmu", "--quiet"), "not valid: 1 of 1 file, 1 problem found"),
    ],
)  # fmt: skip
@pytest.mark.usefixtures("native_at_hand")
def test_what_is_wrong_is_one_clear_line(shell: Shell, arguments: tuple[str, ...], message: str) -> None:
    assert re.search(re.escape(message).replace(r"\.\*", ".*"), shell.refused(*arguments))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("simulate", "--set", "mass"), "--set mass: must be NAME=VALUE"),
        (("simulate", "--set", "mass=1", "--set", "mass=2"), "--set mass=2: must be given once, and is mass=1 already"),
        (("drive", "--integrator", "rk4", "--set", "integrator=heun"), "--set integrator=rk4: must be given once"),
        (("simulate", "--output", ""), "'': must be a path"),
        (("simulate", "--input", "nix.csv", "--scene", "turn"), "must not be given together"),
        (("simulate", "--stop-time", "soon"), "'soon' is not a valid float"),
        (("simulate", "--frob",), "No such option"),
        (("frob",), "No such command 'frob'"),
    ],
)  # fmt: skip
def test_a_wrong_use_ends_with_2(shell: Shell, arguments: tuple[str, ...], message: str) -> None:
    assert message in shell.refused(*arguments, status=2)


@pytest.mark.usefixtures("native_at_hand")
def test_how_much_is_said(shell: Shell) -> None:
    short = ("simulate", "--scene", "turn", "--stop-time", "1", "--set", "step_size=0.1")
    assert shell.ok(*short, "-q") == ""
    assert re.search(r"took \d+\.\d s\n", shell.run(*short, "-v").err)
    assert "Traceback" in shell.run("simulate", "--scene", "nix", "-v").err
    assert shell.ok(*short).startswith("running ")  # it is not kept


@pytest.mark.usefixtures("native_at_hand")
def test_results_as_json(shell: Shell) -> None:
    result = json.loads(shell.ok("simulate", "--scene", "turn", "--stop-time", "1", "--output", "a.csv", "--json"))
    with (shell.folder / "a.csv").open() as file:
        *_, last = csv.DictReader(file)
    assert result["end"]["pose.x"] == float(last["pose.x"])
    assert (result["scene"], result["communication_steps"], result["warnings"]) == ("turn", 10, [])
    built = json.loads(shell.ok("build", "python", "--json"))
    assert built[0]["bytes"] == (shell.folder / built[0]["file"]).stat().st_size
    advice = json.loads(shell.ok("advise", "--scene", "launch", "--within", "0.1", "--json"))
    assert advice["is_met"]
    assert advice["best"]["true"] <= 0.1
    assert advice["command"].startswith("hovercraft-fmu simulate --scene launch")


@pytest.mark.usefixtures("native_at_hand")
@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_a_run_is_compared_with_a_stored_one(shell: Shell, ending: str) -> None:
    short = ("simulate", "--scene", "turn", "--stop-time", "8", "--set", "step_size=0.1")
    shell.ok(*short, "--output", f"a/stored.{ending}")
    same = ("--reference", f"a/stored.{ending}")
    assert "31 columns are those of" in shell.ok(*short, *same, "--within", "0")
    other = shell.run(*short, *same, "--set", "mass=100.001")
    assert other.status == 1
    assert re.search(r"^pose.x +\d\S+ +[\d.]+ s +FAILED$", other.out, re.MULTILINE)
    assert re.search(r"columns differ from a/stored\.\w+, most \S+ by \S+ at [\d.]+ s", other.err)
    shell.ok(*short, *same, "--set", "mass=100.001", "--within", "0.01")
    assert "must be a communication point" in shell.refused(*short, *same, "--stop-time", "4")


@pytest.mark.usefixtures("native_at_hand")
def test_a_stored_result_of_another_host(shell: Shell) -> None:
    """With fewer columns and rows; a value that is no number is off."""
    short = ("simulate", "--scene", "launch", "--stop-time", "1", "--set", "step_size=0.1", "--output", "a.csv")
    shell.ok(*short)
    with (shell.folder / "a.csv").open() as file:
        rows = list(csv.DictReader(file))
    for name, value in (("good", rows[5]["pose.x"]), ("bad", "nan")):
        (shell.folder / f"{name}.csv").write_text(f"time,pose.x\n0,0\n{rows[5]['time']},{value}\n")
    assert "1 column is that of good.csv" in shell.ok(*short, "--reference", "good.csv", "--within", "0")
    assert "pose.x by inf at" in shell.run(*short, "--reference", "bad.csv").err


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("time,pose.x\n0,0\n1,0\n0.5,0\n", "time = 0.5 in row 3: must not go back; before it is 1.0"),
        ("time,pose.x\n0,0\nnan,0\n", "time = nan in row 2: must be a finite number"),
        ("time,pose.x,pose.x\n0,0,0\n", "column 'pose.x': must stand there once"),
        ("time,height\n0,0\n", "must have a column of a result beside the time; it has time, height"),
    ],
)
def test_a_reference_that_is_none_is_refused_before_the_run(text: str, why: str, shell: Shell) -> None:
    (shell.folder / "stored.csv").write_text(text)
    assert f"stored.csv: {why}" in shell.refused("simulate", "--reference", "stored.csv")
    assert not (shell.folder / "build").exists()


@pytest.mark.parametrize("within", ["nan", "inf", "-1"])
def test_a_tolerance_must_be_one(within: str, shell: Shell) -> None:
    refused = shell.refused("simulate", "--reference", "nix.csv", "--within", within, status=2)
    assert f"--within {float(within)}: must be a finite number, at least 0" in refused
    assert "--within: must be given together with --reference" in shell.refused("simulate", "--within", "3", status=2)


@pytest.mark.parametrize("width", [40, 80, 160])
def test_nothing_is_cut(width: int, shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(OUTPUT, "width", width)
    printed = shell.ok("simulate", "--list-scenes")
    assert max(map(len, printed.splitlines())) <= width
    for scene in SCENES.values():
        assert set(scene.description.split()) <= set(printed.split())


@pytest.mark.parametrize(
    ("typed", "expected"),
    [("simulate --scene tu", "turn"), ("simulate --set mas", "mass="), ("sweep tu", "turning_circle"),
     ("simulate --preset i", "ice"), ("sim", "simulate")],
)  # fmt: skip
def test_a_shell_completes(typed: str, expected: str) -> None:
    words = ["hovercraft-fmu", *typed.split()]
    done = ShellComplete(commands, {}, "hovercraft-fmu", "_HOVERCRAFT_FMU_COMPLETE").get_completions(
        words[1:-1], words[-1]
    )
    assert expected in [each.value for each in done]


HIDDEN = {
    "matplotlib": (("simulate", "--stop-time", "1", "--plot", "a.png"), "[plot]"),
    "matplotlib of an animation": (("simulate", "--stop-time", "1", "--animate", "a.gif"), "[plot]"),
    "matplotlib of a measurement": (("measure", "stability"), "[studies]"),
    "matplotlib of the demo": (("demo",), "[plot]"),
    "pyarrow": (("sweep", "turning_circle"), "[sweep]"),
    "polars": (("measure", "coupling"), "[studies]"),
    "scipy": (("measure", "trade"), "[studies]"),
}
"""Library, the command that needs it, and the extra that has it."""


@pytest.mark.parametrize("name", HIDDEN)
def test_what_is_not_installed_is_named(name: str, tmp_path: Path) -> None:
    """Before anything is run. An empty module hides the real one, so this needs a process of its own."""
    arguments, extra = HIDDEN[name]
    library = name.split()[0]
    (tmp_path / f"{library}.py").write_text(f"raise ModuleNotFoundError('hidden', name={library!r})")
    command = [sys.executable, "-W", "error", "-c", "from hovercraft_fmu.cli import main; main()", *arguments]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout) == (1, "")
    assert f"pip install 'hovercraft-fmu{extra}', in a checkout '.{extra}'" in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_the_measurements_are_listed_with_what_they_take(shell: Shell) -> None:
    printed = " ".join(shell.ok("measure", "--help").split())
    for name, each in MEASUREMENTS.items():
        assert f" {name} {each.what} ({each.takes})" in printed


@pytest.mark.parametrize("width", [40, 80])
@pytest.mark.parametrize("name", ["", *commands.commands])
def test_help_fits_the_terminal(name: str, width: int, shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    printed = shell.ok(*filter(None, [name]), "--help")
    assert max(map(len, printed.splitlines())) <= width


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="/dev/full: not on this system")
@pytest.mark.usefixtures("native_at_hand")
def test_what_is_full_is_named(shell: Shell) -> None:
    (shell.folder / "full.csv").symlink_to("/dev/full")
    refused = shell.refused("simulate", "--stop-time", "1", "--output", "full.csv")
    assert refused == "hovercraft-fmu: full.csv: No space left on device\n"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="/dev/full: not on this system")
@pytest.mark.parametrize("what", ["--help", "--version", "simulate --help", "simulate --list-scenes"])
def test_standard_output_that_is_full_is_named(what: str) -> None:
    """With Python's buffer, which has it until the end."""
    env = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    with open("/dev/full", "w") as full:
        command = [sys.executable, "-m", "hovercraft_fmu", *what.split()]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, env=env)
    assert (done.returncode, done.stderr) == (1, "hovercraft-fmu: standard output: No space left on device\n")
