"""Runs from a script: what goes in is checked, what comes out is whole."""

import math
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import psutil
import pytest

import hovercraft_fmu
from hovercraft_fmu.coupling import sail_bare
from hovercraft_fmu.host.messages import plain
from hovercraft_fmu.scenes import SCENES, signals
from hovercraft_fmu.simulation import plan, run_fmu, run_model
from tests.conftest import FMI_2


def write(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


@pytest.mark.once
@pytest.mark.usefixtures("complete_native_fmu")
@FMI_2
def test_three_lines_in_an_empty_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    result = hovercraft_fmu.simulate("launch")
    assert (tmp_path / "build" / "HovercraftNative.fmu").exists()
    assert result["time"][-1] == pytest.approx(60.0)
    assert result["velocity.x"][-1] == pytest.approx(0.29508, abs=5e-6)


def test_inputs_of_ones_own(fmu: Path, tmp_path: Path) -> None:
    log = write(tmp_path / "log.csv", "time,thrust\n0,2\n4,2\n4,6\n10,6\n")
    result = hovercraft_fmu.simulate(log, fmu)
    assert result["time"][[0, -1]] == pytest.approx([0.0, 10.0])
    assert len(result["time"]) == 1001
    assert result["thrust"][result["time"] < 3.99] == pytest.approx(2.0)
    assert result["thrust"][result["time"] > 4.01] == pytest.approx(6.0)
    assert not result["port_thruster"].any()
    array = signals([(0.0, 2.0, 0.0, 0.0), (4.0, 2.0, 0.0, 0.0), (4.0, 6.0, 0.0, 0.0), (10.0, 6.0, 0.0, 0.0)])
    assert np.array_equal(hovercraft_fmu.simulate(array, fmu).data, result.data)


def test_what_is_set_comes_after_the_preset(fmu: Path) -> None:
    run = plan("ice", start_values={"air_density": "0.5", "integrator": "semi_implicit_euler"})
    assert (run.craft.air_density, run.settings.integrator.name) == (0.5, "semi_implicit_euler")
    assert plan("launch", preset="ice").craft.air_density == 0.0023769
    result = hovercraft_fmu.simulate("launch", fmu, start_values={"pose.x": 7.0}, stop_time=0.5)
    assert result["pose.x"][0] == 7.0


def test_the_start_need_not_be_zero(fmu: Path) -> None:
    late = hovercraft_fmu.simulate("launch", fmu, start_time=1000.0, stop_time=1005.0)
    early = hovercraft_fmu.simulate("launch", fmu, stop_time=5.0)
    assert late["time"][0] == 1000.0
    assert late["velocity.x"] == pytest.approx(early["velocity.x"], rel=1e-12)


def test_progress_is_told(fmu: Path) -> None:
    times: list[float] = []
    hovercraft_fmu.simulate("launch", fmu, stop_time=1.0, progress=times.append)
    assert times == pytest.approx(np.arange(0.1, 1.05, 0.1))


def test_a_csv_file_holds_every_bit(fmu: Path, tmp_path: Path) -> None:
    import fmpy.util

    result = hovercraft_fmu.simulate("turn", fmu, stop_time=15.0)
    back = fmpy.util.read_csv(result.write_csv(tmp_path / "new" / "turn.csv"))
    assert back.dtype.names == result.names
    assert result.whole is not None
    assert all(np.array_equal(back[name], result.whole[name]) for name in result.names)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"preset": "moon"}, "preset = 'moon'"),
        ({"start_values": {"foo": 1.0}}, "foo = 1.0: must be a variable that can be set"),
        ({"start_values": {"speed": 1.0}}, "speed = 1.0: must be a variable that can be set"),
        ({"start_values": {"mass": "heavy"}}, "mass = 'heavy': must be a number"),
        ({"start_values": {"integrator": "magic"}}, "integrator = 'magic': must be one of"),
        ({"start_values": {"integrator": 2.7}}, "integrator = 2.7: must be a whole number or a name"),
        ({"start_values": {"integrator": True}}, "integrator = True: must be a number"),
        ({"start_values": {"integrator_number": "1.5"}}, "integrator_number = '1.5': must be a whole number"),
        ({"start_values": {"mass": True}}, "mass = True: must be a number"),
        ({"communication_step": 1e-9}, "communication_step = 1e-09 s: must not make more than 10^8 steps"),
        ({"stop_time": 1e300}, "must not make more than 10^8 steps from 0.0 s to 1e+300 s; it makes 1e+301"),
        (
            {"stop_time": math.inf, "communication_step": -1.0},
            "stop_time = inf s: must be a finite number\ncommunication_",
        ),
        ({"stop_time": True}, "stop_time = True s: must be a finite number"),
        ({"start_time": 1e15, "stop_time": 1e15 + 10.0}, "0.1 s: must not be less than what a double can tell at"),
        (
            {"start_values": {"thrust": 1}},
            "thrust = 1.0: must be an input that launch leaves alone: its start value has no effect",
        ),
        ({"start_values": {"drag_area": "round"}}, "drag_area = 'round': must be one of constant, directional"),
        ({"stop_time": 0.0}, "stop_time = 0.0 s: must be after start_time = 0.0 s"),
        ({"stop_time": math.nan}, "stop_time = nan s: must be a finite number"),
        ({"communication_step": 0.0}, "communication_step = 0.0 s: must be greater than 0"),
    ],
)
def test_bad_options(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError) as caught:  # noqa: PT011 - the message is compared below
        plan("launch", **options)
    assert message in str(caught.value)


def test_a_result_that_does_not_fit_into_the_memory_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Before the run; by what is free now."""
    monkeypatch.setattr(psutil, "virtual_memory", lambda: SimpleNamespace(available=1e6))
    rule = r"the result of 60000 steps, \d+ numbers of 24 bytes each, must fit into the memory that is free; .* GB"
    with pytest.raises(ValueError, match=f"communication_step = 0.001 s: {rule} of 0.001 GB"):
        plan("launch", communication_step=0.001)
    plan("launch", communication_step=0.1)
    with pytest.raises(ValueError, match=r"communication_step = 0.05 s: the result of 80000 steps"):
        sail_bare(communication_step=0.05)


def test_a_loop_that_cannot_be_meant_is_refused() -> None:
    with pytest.raises(ValueError, match=r"communication_step = 1e-06 s: must not make more than 10\^8 steps"):
        sail_bare(communication_step=1e-6)
    with pytest.raises(ValueError, match=r"must not make more than 10\^8 steps from 0.0 s to 1e\+300 s"):
        sail_bare(stop_time=1e300)


def test_inputs_that_a_log_drives_take_no_start_value() -> None:
    log = signals([(0.0, 5.0), (1.0, 8.0)])
    with pytest.raises(ValueError, match=r"thrust = 2.0: must be an input that inputs leaves alone"):
        plan(log, start_values={"thrust": 2, "wind.x": 3})
    assert plan(log, start_values={"wind.x": 3}).signals["wind.x"].tolist() == [3.0, 3.0]


def test_bad_files(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match="no such FMU"):
        run_fmu(plan("launch"), tmp_path / "nix.fmu")
    with pytest.raises(ValueError, match="must be an FMU"):
        run_fmu(plan("launch"), write(tmp_path / "text.fmu", "not an archive"))
    with pytest.raises(FileNotFoundError):
        plan(tmp_path / "nix.csv")
    with pytest.raises(ValueError, match="column = 'nix': must be one of time, thrust"):
        hovercraft_fmu.Result(np.zeros(1, dtype=[("time", float), ("thrust", float)]), plan("launch"))["nix"]


def test_the_wrappers_messages_read_plainly() -> None:
    assert plain("Fatal py exception\nValueError('mass = -1.0: must be \\'x\\'')") == "mass = -1.0: must be 'x'"
    assert plain("something else") == "something else"


def test_every_scene_can_be_planned() -> None:
    for name, scene in SCENES.items():
        run = plan(name)
        assert (run.title, run.stop_time, run.craft, run.start) == (name, scene.stop_time, scene.craft, scene.start)


def test_a_scene_without_wind_takes_the_start_value_of_the_wind() -> None:
    run = plan("launch", start_values={"wind.y": 0.2, "drag_area": "directional"}, stop_time=1.0)
    assert set(run.signals["wind.y"]) == {0.2}
    assert run_model(run)["velocity.y"][-1] > 0.0
    with pytest.raises(ValueError, match=r"wind.y = 9.0: must be an input that crosswind leaves alone"):
        plan("crosswind", start_values={"wind.y": 9.0})
