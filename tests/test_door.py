"""What a person imports, and how a result reads."""

import inspect
import math
import re
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import polars as pl
import pytest

import hovercraft_fmu
from hovercraft_fmu import Result, plan, simulate
from hovercraft_fmu.simulation import run_model

ROWS = {"time": [0.0, 4.0, 4.0, 10.0], "thrust": [5.0, 8.0, 2.0, 2.0], "port_thruster": [0.0, 1.0, 0.0, 0.0]}
"""Linear, with a jump."""
DOOR: Any = hovercraft_fmu
"""Without types, so that it can be called wrongly."""


@pytest.fixture(scope="module")
def result() -> Result:
    return run_model(plan(ROWS, communication_step=0.5))


def test_a_result_is_told_in_a_few_lines(result: Result) -> None:
    lines = repr(result).splitlines()
    assert lines[0] == "Result of inputs: semi_implicit_euler, 0.001 s"
    assert len(lines) <= 10
    assert f"{result['pose.x'][-1]:.3f}" in repr(result)
    assert f"{math.degrees(result['pose.heading'][-1]):.2f} deg" in repr(result)


def test_a_warning_is_told(native_fmu: Path) -> None:
    warned = simulate({"time": [0.0, 1.0], "thrust": [50.0, 50.0]}, native_fmu)
    assert warned.warnings
    assert all(f"warning        {each}" in repr(warned) for each in warned.warnings)


def test_a_result_is_a_table_by_name(result: Result) -> None:
    assert len(result) == len(result["time"]) == 21
    assert list(result) == list(result.keys()) == list(result.names)
    assert "pose.x" in result
    assert "pose.z" not in result
    assert dict(result)["speed"] is not None
    with pytest.raises(ValueError, match=r"column = 'pose\.X': must be one of time, .*; did you mean 'pose\.x'\?"):
        _ = result["pose.X"]


def test_a_notebook_shows_its_path(result: Result) -> None:
    page = result._repr_html_()
    svg = ET.fromstring(re.search("<svg.*</svg>", page)[0])  # type: ignore[index]
    points = np.array([each.split(",") for each in svg[0].attrib["points"].split()], float)
    scale = (points[-1] - points[0]) / (result["pose.x"][-1], result["pose.y"][-1])  # it starts at the origin
    assert scale[0] == pytest.approx(scale[1], rel=0.02)  # a metre is as long down as across, to a tenth of a pixel
    assert float(svg.attrib["height"]) >= points[:, 1].max()


def test_a_result_draws_itself(result: Result) -> None:
    figure = result.plot()
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert titles[1:4] == ["Controls", "Speed", "Heading"]
    line, hulls = figure.axes[0].lines[0], list[Any](figure.axes[0].patches)
    assert np.array_equal(line.get_xydata(), np.column_stack([result["pose.x"], result["pose.y"]]))
    assert [bool(hull.get_facecolor()[3]) for hull in hulls] == [True] + [False] * (len(hulls) - 2) + [True]


def test_outlines_are_a_length_apart() -> None:
    figure = run_model(plan("slalom", stop_time=40.0)).plot()
    hulls: list[Any] = list(figure.axes[0].patches)
    centres = np.array([hull.get_xy()[:4].mean(axis=0) for hull in hulls])
    assert len(centres) <= 27
    apart = np.hypot(*np.diff(centres, axis=0).T)
    # along the path; straight across it is less
    assert (apart[:-1] > 0.9 * 20.0).all() or len(centres) == 2


def test_pandas(result: Result) -> None:
    pandas = pytest.importorskip("pandas")
    frame = result.to_pandas()
    assert isinstance(frame, pandas.DataFrame)
    assert frame.index.name == "time"
    assert list(frame.columns) == list(result.names[1:])
    assert frame.attrs["units"]["pose.heading"] == "rad"
    assert frame["pose.x"].iloc[-1] == result["pose.x"][-1]
    inputs = pandas.DataFrame(ROWS)
    for given in (inputs, inputs.set_index("time")):
        assert np.array_equal(plan(given).signals, plan(ROWS).signals)


def test_what_is_not_installed_is_named(result: Result, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(ModuleNotFoundError, match=r"pip install pandas"):
        result.to_pandas()


def table(columns: dict[str, list[float]]) -> Any:
    return np.array(list(zip(*columns.values(), strict=True)), dtype=[(name, float) for name in columns])


def test_inputs_may_come_in_any_shape(tmp_path: Path) -> None:
    """Each gives the same signals."""
    expected = plan(table(ROWS)).signals
    (tmp_path / "log.csv").write_text("time,thrust,port_thruster\n0,5,0\n4,8,1\n4,2,0\n10,2,0\n")
    shuffled = {
        "port_thruster": ROWS["port_thruster"],
        "speed": [0.0] * 4,
        "time": ROWS["time"],
        "thrust": ROWS["thrust"],
    }
    for given in (ROWS, shuffled, pl.DataFrame(ROWS), tmp_path / "log.csv"):
        assert np.array_equal(plan(given).signals, expected)


def test_a_result_as_inputs_gives_the_same_motion(result: Result) -> None:
    """With both rows of its jump."""
    again = run_model(plan(result, communication_step=0.5))
    assert all(np.array_equal(again[name], result[name]) for name in result)


def test_a_function_of_time() -> None:
    """It is taken at every communication point, the last one, too."""
    run = plan(lambda time: {"thrust": 5.0 + math.sin(time)}, stop_time=1.05, communication_step=0.1)
    assert run.stop_time == 1.05
    assert len(run.signals) == 12
    assert run.signals["thrust"] == pytest.approx([5.0 + math.sin(time) for time in run.signals["time"]], abs=0.0)
    assert not run.signals["port_thruster"].any()


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: DOOR.simulate("trun"), "scene = 'trun': must be one of launch, .*; did you mean 'turn'?"),
        (lambda: DOOR.simulate("turn", "nix.fmu"), "nix.fmu: no such FMU; 'hovercraft-fmu build' writes"),
        (lambda: DOOR.simulate("turn", mass=120.0), "simulate(mass=...): .*; did you mean start_values={"),
        (lambda: DOOR.simulate("turn", stop_tme=1.0), "simulate(stop_tme=...): .*; did you mean 'stop_time'?"),
        (lambda: DOOR.plan("turn", start_values={"Mass": 1}), "Mass = 1: must be a variable .*; did you mean 'mass'?"),
        (lambda: DOOR.plan("turn", start_values={"integrator": "rk"}), "must be one of .*; did you mean 'rk4'?"),
        (lambda: DOOR.plan({"time": [0.0], "thrus": [1.0]}), "column 'thrus' .*; did you mean 'thrust'?"),
        (lambda: DOOR.plan({"thrust": [1.0]}), "there must be a column 'time'; the columns are thrust"),
        (lambda: DOOR.plan({"time": [0.0], "thrust": [1.0, 2.0]}), "every column must have one value a row"),
        (lambda: DOOR.plan({"time": [0.0], "thrust": ["much"]}), "every column must be numbers"),
        (lambda: DOOR.plan(3), "inputs = int: must be a scene, a CSV file"),
        (lambda: DOOR.plan(lambda _: 3.0), "a function must give the same inputs by name at every time, and gave 3.0"),
        (lambda: DOOR.build("nativ"), "kind = 'nativ': must be one of .*; did you mean 'native'?"),
        (lambda: DOOR.sweep("turning_circl"), "one of turning_circle; did you mean 'turning_circle'?"),
        (lambda: DOOR.advise("ice", witin=1.0), "advise(witin=...): .*; did you mean 'within'?"),
        (lambda: DOOR.drive(recrd="a.csv"), "drive(recrd=...): .*; did you mean 'record'?"),
        (lambda: DOOR.animate(results=[], pth="a.gif"), "animate(pth=...): .*; did you mean 'path'?"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_line_that_helps(call: Any, message: str) -> None:
    pattern = re.escape(message).replace(r"\.\*", ".*")
    with pytest.raises((ValueError, TypeError, FileNotFoundError), match=pattern) as refused:
        call()
    assert len(str(refused.value).splitlines()) == 1


def test_a_file_beside_it_is_named(tmp_path: Path) -> None:
    (tmp_path / "HovercraftNative.fmu").touch()
    (tmp_path / "log.csv").touch()
    with pytest.raises(FileNotFoundError, match=r"no such FMU; did you mean 'HovercraftNative\.fmu'\?"):
        simulate("turn", tmp_path / "HovercraftNativ.fmu")
    with pytest.raises(FileNotFoundError, match=r"did you mean 'log\.csv'\?"):
        plan(tmp_path / "lgo.csv")


@pytest.mark.parametrize("name", [each for each in hovercraft_fmu.__all__ if each != "__version__"])
def test_every_function_that_is_exported_says_what_it_takes(name: str) -> None:
    """Each keyword has a type and stands in the docstring."""
    found = getattr(hovercraft_fmu, name)
    if not inspect.isfunction(found):
        return
    documented = inspect.getdoc(found) or ""
    for parameter in inspect.signature(found).parameters.values():
        assert parameter.annotation is not parameter.empty
        assert re.search(rf"\b{parameter.name}\b", documented), parameter.name
