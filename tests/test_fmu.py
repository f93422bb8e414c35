"""The FMU as a host sees it, in processes of its own."""

import io
import json
import re
import sysconfig
import zipfile
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import fmpy
import numpy as np
import pytest
from fmpy.model_description import read_model_description

from hovercraft_fmu.fmu.archive import zipped
from hovercraft_fmu.fmu.document import FOLDER
from hovercraft_fmu.fmu.interface import ACTION, BY_NAME, INPUTS, MOTION, STATES, WATCHED
from hovercraft_fmu.host import SimulationError
from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.dynamics import Controls, State
from hovercraft_fmu.scenes import SCENES
from hovercraft_fmu.simulation import Run, holding, plan, run_fmu, run_model
from tests.conftest import Fresh
from tests.lowlevel import get, one, reference, start

COLUMNS = (*INPUTS, *STATES, *MOTION, *ACTION, *WATCHED, "substeps")
SIMULATE_ALL = """
import json, sys, fmpy, numpy as np
fmu, folder = sys.argv[1:]
runs = json.load(open(folder + "/runs.json"))
assert not [name for name in sys.modules if name.startswith("hovercraft_fmu")]
for name, run in runs.items():
    result = fmpy.simulate_fmu(fmu, input=np.load(f"{folder}/{name}.npy"), output=run.pop("output"), **run)
    np.save(f"{folder}/{name}.result.npy", np.asarray(result))
assert not [name for name in sys.modules if name.startswith("hovercraft_fmu")]
print("absent" if __import__("importlib.util").util.find_spec("hovercraft_fmu") is None else "installed")
"""


SETTINGS: dict[str, dict[str, Any]] = {
    "semi_implicit_euler": {"step_size": 0.01},
    "drag_implicit": {"step_size": 0.02},
    "rk4": {"step_size": 0.1},
    "adaptive": {"step_size": 0.05, "tolerance": 1e-7},
}


EVERY_TERM: dict[str, Any] = {
    "drag_area": "directional",
    "rotational_drag": 0.5,
    "skirt_friction": 0.002,
    "gravity": 9.5,
}


def planned() -> dict[str, Run]:
    """Half of every scene with every method; and the one with wind once more, with every other term."""
    runs = {
        f"{name} {method}": plan(
            name, stop_time=0.5 * SCENES[name].stop_time, start_values={**values, "integrator": method}
        )
        for name in SCENES
        for method, values in SETTINGS.items()
    }
    for method, values in SETTINGS.items():
        runs[f"every term {method}"] = plan("crosswind", start_values={**values, **EVERY_TERM, "integrator": method})
    return runs


def write_runs(folder: Path, scene: str) -> None:
    """What a script needs to simulate that scene, or every one, with fmpy alone."""
    runs = {}
    for name, run in planned().items():
        if not name.startswith(scene):
            continue
        np.save(folder / f"{name}.npy", run.signals)
        runs[name] = {
            "start_values": dict(run.start_values),
            "start_time": run.start_time,
            "stop_time": run.stop_time,
            "output_interval": run.communication_step,
            "output": COLUMNS,
        }
    (folder / "runs.json").write_text(json.dumps(runs))


def assert_equal_to_the_model(folder: Path) -> None:
    runs = planned()
    for path in folder.glob("*.result.npy"):
        result, bare = np.load(path), run_model(holding(runs[path.name.removesuffix(".result.npy")]))
        assert set(result.dtype.names) == set(bare.names)
        for column in bare.names:
            assert np.array_equal(result[column], bare[column]), (path.name, column)


def test_it_runs_its_own_code_where_this_package_is_installed(fmu: Path, fresh: Fresh, tmp_path: Path) -> None:
    """To the bit as the bare model."""
    write_runs(tmp_path, "every term")
    assert fresh(SIMULATE_ALL, fmu, tmp_path).split() == ["installed"]
    assert_equal_to_the_model(tmp_path)


def test_every_scene_and_method_equals_the_bare_model_where_it_is_not_installed(
    fmu: Path, fresh: Fresh, tmp_path: Path
) -> None:
    """To the bit; nor is pythonfmu installed: all of this environment's packages but those two are linked into a folder
    of their own, and there are no site-packages."""
    packages = tmp_path / "packages"
    packages.mkdir()
    for folder in {sysconfig.get_path("purelib"), sysconfig.get_path("platlib")}:
        for entry in Path(folder).iterdir():
            if entry.is_dir() and not entry.name.startswith(("hovercraft_fmu", "pythonfmu")):
                (packages / entry.name).symlink_to(entry)
    write_runs(tmp_path, "")
    env = {"PYTHONPATH": str(packages)}
    assert fresh(SIMULATE_ALL, fmu, tmp_path, flags=("-S",), env=env).split() == ["absent"]
    assert_equal_to_the_model(tmp_path)


def test_the_slave_needs_the_standard_library_alone(fmu: Path, fresh: Fresh, tmp_path: Path) -> None:
    with zipfile.ZipFile(fmu) as archive:
        archive.extractall(tmp_path)
    code = """
import sys
sys.path.insert(0, sys.argv[1])
module = __import__(open(sys.argv[1] + "/slavemodule.txt").read())
slave = module.Hovercraft(instance_name="alone", resources=sys.argv[1])
slave.setup_experiment(0.0, None, None)
slave.enter_initialization_mode()
slave.exit_initialization_mode()
slave.set_real([0, 1], [8.0, 1.0])
assert slave.do_step(0.0, 0.5)
print(repr(slave.get_real([3, 4, 5, 6, 7, 8])))
assert "numpy" not in sys.modules
"""
    printed = fresh(code, tmp_path / "resources", flags=("-I", "-S"))
    from hovercraft_fmu.model.craft import Craft
    from hovercraft_fmu.model.subcycling import advance

    expected = advance(State(), Controls(8.0, 1.0, 0.0), Craft(), 0.5).state
    assert printed.strip() == repr(list(expected))


def test_two_builds_and_an_imported_package_run_their_own_code_in_one_process(fmu: Path, fresh: Fresh) -> None:
    """A second FMU whose drag is doubled in its source, the first one, and this package, side by side."""
    code = """
import shutil, sys, tempfile
from pathlib import Path
import fmpy
import hovercraft_fmu
from hovercraft_fmu.fmu import python_package as package
from hovercraft_fmu.simulation import plan, run_model

changed = Path("changed")
shutil.copytree(package.PACKAGE, changed)
source = changed / "model" / "craft.py"
source.write_text(source.read_text().replace("return 0.5 * self.air_density", "return 1.0 * self.air_density"))
package.PACKAGE = changed
second = package.build_fmu("Second.fmu")
options = {"stop_time": 60.0, "output_interval": 0.1, "output": ["velocity.x"]}
for _ in range(2):
    one = fmpy.simulate_fmu(sys.argv[1], **options)["velocity.x"][-1]
    two = fmpy.simulate_fmu(str(second), **options)["velocity.x"][-1]
    bare = run_model(plan("launch"))["velocity.x"][-1]
    assert one == bare
    assert abs(two - bare / 2**0.5) < 1e-6, (two, bare)
print("ok")
"""
    assert fresh(code, fmu).strip() == "ok"


def test_what_is_inside(fmu: Path) -> None:
    with zipfile.ZipFile(fmu) as archive:
        names = set(archive.namelist())
        page = archive.read("documentation/index.html").decode()
        icon = archive.read("model.png")
        modes = {(each.create_system, each.external_attr >> 16) for each in archive.infolist()}
    assert modes == {(3, 0o644)}  # Unix's, wherever it was built
    assert {
        "modelDescription.xml",
        "documentation/externalDependencies.txt",
        "documentation/licenses/license.txt",
        "documentation/licenses/pythonfmu.txt",
        "binaries/linux64/Hovercraft.so",
        "binaries/win64/Hovercraft.dll",
    } <= names
    assert icon.startswith(b"\x89PNG")
    assert all(f"<code>{name}</code>" in page for name in BY_NAME)
    assert "LD_PRELOAD" in page
    rows = (FOLDER / "checked.md").read_text(encoding="utf-8").splitlines()[2:]
    assert len(rows) > 5
    assert all(f"<td>{row.split('|')[1].strip()}</td>" in page for row in rows)
    assert not [name for name in names if "__pycache__" in name or name.startswith("/")]


def test_an_archive_is_unix_s_where_it_is_built_on_windows_too(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(zipfile, "sys", SimpleNamespace(platform="win32"))
    assert zipfile.ZipInfo("of zipfile").create_system == 0
    with zipfile.ZipFile(io.BytesIO(zipped({"one": b"1"}))) as archive:
        assert [each.create_system for each in archive.infolist()] == [3]


def test_variables_stand_on_the_page_beside_those_that_people_look_for_with_them(each_fmu: Path) -> None:
    """By what stands before the dot, as terminals have them; without one by what they are for."""
    with zipfile.ZipFile(each_fmu) as archive:
        page = archive.read("documentation/index.html").decode()
    found = {}
    for part in page.split('<tr><th colspan="8">')[1:]:
        heading, rest = part.split("</th>", 1)
        for name in re.findall(r"<tr><td><code>(.*?)</code></td>", rest):
            assert name not in found
            found[name] = heading

    def expected(name: str, causality: str) -> str:
        before, dot, _ = name.rpartition(".")
        if dot:
            return "load" if before.startswith("external") else before
        groups = {
            "input": "actuators",
            "output": "outputs",
            "parameter": "craft" if name in vars(Craft()) else "settings",
        }
        return groups.get(causality, "watched")

    variables = read_model_description(str(each_fmu)).modelVariables
    assert found == {
        each.name: expected(each.name, each.causality) for each in variables if each.causality != "independent"
    }


# ---- communication points, through the low-level interface


@pytest.fixture
def instance(fmu: Path) -> Iterator[Any]:
    with one(fmu) as (made, _):
        yield made


def test_outputs_belong_to_the_communication_point(instance: Any) -> None:
    seen = ("applied.thrust", "applied.steering", "force.x", "moment", "acceleration.yaw")
    start(instance)
    # right after initialization: the start inputs
    assert get(instance, *seen) == [5.0, 0.0, 5.0, 0.0, 0.0]
    instance.setReal([reference("thrust"), reference("port_thruster")], [8.0, 1.0])
    assert get(instance, *seen) == [5.0, 0.0, 5.0, 0.0, 0.0]
    assert get(instance, "thrust", "port_thruster") == [8.0, 1.0]
    instance.doStep(0.0, 0.1)
    after = get(instance, *seen, *STATES)
    assert after[:2] == [8.0, 3.0]
    instance.setReal([reference("thrust"), reference("port_thruster")], [0.0, 0.0])
    assert get(instance, *seen, *STATES) == after
    instance.doStep(0.1, 0.1)
    assert get(instance, *seen[:2]) == [0.0, 0.0]


def test_start_values_are_seen_before_the_first_step(instance: Any) -> None:
    instance.setReal([reference("length"), reference("velocity.x")], [30.0, 0.25])
    instance.setupExperiment()
    instance.enterInitializationMode()
    instance.setReal([reference("pose.heading")], [np.pi / 2])
    instance.exitInitializationMode()
    assert get(instance, "projected_area", "speed") == [100.0, 0.25]
    assert get(instance, "body.surge", "body.sway") == pytest.approx([0.0, -0.25], abs=1e-16)


def test_substeps_are_counted(instance: Any) -> None:
    start(instance)
    assert instance.getInteger([reference("substeps")]) == [0]
    instance.doStep(0.0, 0.25)
    instance.doStep(0.25, 1e-13)
    assert instance.getInteger([reference("substeps")]) == [251]


def test_a_step_of_no_time_is_an_error(instance: Any) -> None:
    start(instance)
    with pytest.raises(fmpy.fmi1.FMICallException, match="fmi2DoStep failed"):
        instance.doStep(0.0, 0.0)


@pytest.mark.parametrize(
    ("start_values", "message"),
    [
        ({"mass": -1.0}, "mass = -1.0: must be greater than 0"),
        ({"air_density": float("nan")}, "air_density = nan: must be a finite number"),
        ({"step_size": 0.0}, "step_size = 0.0 s: must be a finite number greater than 0"),
        ({"integrator": 99}, "integrator = 99: must be one of 1 (semi_implicit_euler)"),
        ({"thrust_min": 20.0}, "thrust_min = 20.0 N: must not be above thrust_max = 10.0 N"),
        ({"wind.x": float("inf")}, "wind.x = inf: must be a finite number"),
        ({"velocity.x": 1e200}, "speed = inf: must be a finite number; the motion is out of range"),
        ({"velocity.x": 1e150}, "velocity.x = nan after 0.0 s: must stay a finite number"),
        ({"step_size": 1e-12}, "must not need more than 10^9 sub-steps of step_size = 1e-12 s"),
    ],
)
def test_a_fault_raises_and_says_what_is_wrong(fmu: Path, start_values: dict[str, float], message: str) -> None:
    with pytest.raises(SimulationError) as caught:
        run_fmu(plan("launch", start_values=start_values), fmu)
    assert message in str(caught.value)
