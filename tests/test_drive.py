"""The window flies the FMU: the real event loop on SDL's video driver without a screen; only the clock is handed in."""

import os
import re
import shlex
import signal
import subprocess
import sys
import time
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pygame
import pytest
from matplotlib.path import Path as Outline
from numpy.typing import NDArray

from hovercraft_fmu.drawing.palette import HULL, WARNING, WINDOW_JETS
from hovercraft_fmu.drawing.shapes import outline
from hovercraft_fmu.fmu.interface import INPUTS, STATES
from hovercraft_fmu.fmu.start_values import Value
from hovercraft_fmu.host import SimulationError
from hovercraft_fmu.model.dynamics import State
from hovercraft_fmu.simulation import read_inputs, simulate
from hovercraft_fmu.view import gates
from hovercraft_fmu.view.drive import drive, plan_drive
from hovercraft_fmu.view.operator import TIME_SCALE
from hovercraft_fmu.view.window import BAR, SIZE, VIEW_LENGTHS
from tests.conftest import Fresh
from tests.shell import Shell

Picture = NDArray[np.uint8]
"""Red, green, blue; shape (height, width, 3)."""
SCALE = SIZE[0] / (VIEW_LENGTHS * 20.0)
"""pixels a metre"""


@pytest.fixture(autouse=True)
def no_screen(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")


def picture() -> Picture:
    """What the window shows."""
    screen = pygame.display.get_surface()
    assert screen
    return pygame.surfarray.array3d(screen).transpose(1, 0, 2)


class Script:
    """The clock of a window: frames at an even rate; keys go down and up, and pictures are taken, at their times."""

    def __init__(
        self, end: float, keys: Mapping[float, str] | None = None, rate: int = 25, seen: Collection[float] = ()
    ) -> None:
        self._end, self._keys, self._rate, self._frame, self._seen = end, keys or {}, rate, 0, seen
        self.pictures: dict[float, Picture] = {}

    def now(self) -> float:
        return self._frame / self._rate

    def tick(self) -> None:
        if self.now() in self._seen:
            self.pictures[self.now()] = picture()
        self._frame += 1
        for key in self._keys.get(self.now(), "").split():
            kind = pygame.KEYUP if key.startswith("-") and key != "-" else pygame.KEYDOWN
            pygame.event.post(pygame.event.Event(kind, key=pygame.key.key_code(key.lstrip("-") or "-")))
        if self.now() >= self._end:
            pygame.event.post(pygame.event.Event(pygame.QUIT))


MANEUVER = {
    0.2: "up", 0.6: "-up", 0.8: "right", 1.0: "down k", 1.2: "-right left", 1.4: "-down", 1.6: "-left -k right left",
    2.0: "-left", 2.2: "-right",
}  # fmt: skip
"""Every kind of key, two at a time too; times that 25 and 100 frames a second have."""


def end(result: Any) -> State:
    return State(*(float(result[name][-1]) for name in STATES))


def without_inputs(start_values: dict[str, Value]) -> dict[str, Value]:
    """The log has their columns."""
    return {name: value for name, value in start_values.items() if name not in INPUTS}


@pytest.mark.parametrize(
    ("preset", "start_values", "step"),
    [
        ("ice", {}, None),
        ("ice", {"integrator": "adaptive", "wind.x": 0.3, "skirt_friction": 0.0001}, 0.03),
        ("textbook", {"integrator": "rk4", "step_size": 0.1, "thrust_min": -10.0, "thrust": 1.0}, 0.1),
    ],
)
def test_what_is_recorded_replays_to_the_same_bits(
    each_fmu: Path, tmp_path: Path, preset: str, start_values: dict[str, Value], step: float | None
) -> None:
    run, logs, log = plan_drive(preset, start_values, step), list[Path](), tmp_path / "new" / "log.csv"
    state = drive(run, each_fmu, record=log, recorded=logs.append, clock=Script(2.4, MANEUVER))
    assert logs == [log]
    h = run.communication_step
    rows = read_inputs(log)
    steps = len(set(rows["time"])) - 1
    assert sorted(set(rows["time"])) == [n * h for n in range(steps + 1)]
    assert rows["time"][-1] == pytest.approx(2.4 * TIME_SCALE, abs=h)
    assert all(len(set(rows[name])) > 1 for name in ("thrust", "port_thruster", "starboard_thruster", "wind.y"))
    replayed = simulate(log, each_fmu, preset=preset, start_values=without_inputs(start_values), communication_step=h)
    assert end(replayed) == state
    assert replayed["time"].tolist() == [n * h for n in range(steps + 1)]


def test_the_motion_does_not_depend_on_the_frames(fmu: Path, tmp_path: Path) -> None:
    ends, logs = set(), set()
    for rate in (25, 100):
        log = tmp_path / f"{rate}.csv"
        ends.add(drive(plan_drive(), fmu, record=log, clock=Script(2.4, MANEUVER, rate)))
        logs.add(log.read_bytes())
    assert (len(ends), len(logs)) == (1, 1)


def is_color(shown: Picture, color: str) -> NDArray[np.bool_]:
    wanted = pygame.Color(color)
    matches: NDArray[np.bool_] = (shown == (wanted.r, wanted.g, wanted.b)).all(axis=2)
    return matches


def hull_pixels(shown: Picture) -> NDArray[np.bool_]:
    return is_color(shown[: SIZE[1] - BAR], HULL)


def inside(state: State, room: float) -> NDArray[np.bool_]:
    """Pixels of the view inside the outline of the model's page, which is `room` pixels larger all around."""
    height, width = SIZE[1] - BAR, SIZE[0]
    c, s = np.cos(state.heading), np.sin(state.heading)
    x, y = SCALE * state.x + 0.1 * width, SCALE * state.y + 0.5 * height
    long, wide, tip = 10.0 * SCALE + room, 5.0 * SCALE + room, 15.0 * SCALE + room
    corners = [(tip, 0.0), (long, wide), (-long, wide), (-long, -wide), (long, -wide)]
    points = [(x + c * a - s * b, y + s * a + c * b) for a, b in corners]
    rows, columns = np.mgrid[:height, :width]
    found = Outline(points).contains_points(np.column_stack([columns.ravel(), rows.ravel()]))
    return np.asarray(found).reshape(height, width)


def test_the_craft_is_drawn_where_its_state_is(fmu: Path) -> None:
    """To a pixel or two: all of the hull's colour is inside its outline, which is full of it."""
    script = Script(4.0, {0.2: "w right", 0.6: "-right"}, seen=[4.0])
    state = drive(plan_drive(), fmu, clock=script)
    assert state.y > 5.0, "a turn to starboard goes down the screen"
    drawn = hull_pixels(script.pictures[4.0])
    assert not (drawn & ~inside(state, 2.0)).any()
    assert drawn[inside(state, -2.0)].all()


def test_a_held_key_moves_the_craft_visibly_within_a_second(fmu: Path) -> None:
    for key in ("up", "right"):
        script = Script(1.2, {0.2: key}, seen=[0.2, 1.2])
        drive(plan_drive(), fmu, clock=script)
        before, after = (hull_pixels(script.pictures[time]) for time in (0.2, 1.2))
        assert (before != after).sum() > 0.1 * before.sum()  # it starts at rest


def test_the_view_wraps_at_its_edges(fmu: Path) -> None:
    """Half of the craft at either edge, and as much of it as in the middle."""
    at_the_edge = (1.0 - 0.1) * VIEW_LENGTHS * 20.0
    counts = []
    for x in (100.0, at_the_edge, at_the_edge + 5 * VIEW_LENGTHS * 20.0):
        script = Script(0.0, seen=[0.0])
        drive(plan_drive(start_values={"pose.x": x}), fmu, clock=script)
        drawn = hull_pixels(script.pictures[0.0])
        counts.append((drawn[:, : SIZE[0] // 2].sum(), drawn[:, SIZE[0] // 2 :].sum()))
    (left, right), (bow, stern), again = counts
    assert again == (bow, stern)
    assert min(bow, stern) > 0.4 * max(bow, stern)
    assert bow + stern == pytest.approx(left + right, rel=0.03)


def test_it_stands_still_until_a_key_is_held(fmu: Path) -> None:
    assert drive(plan_drive(), fmu, clock=Script(0.4)) == State()


def test_wasd_are_the_arrows(fmu: Path) -> None:
    assert len({drive(plan_drive(), fmu, clock=Script(1.6, {0.2: keys})) for keys in ("up left", "w a")}) == 1


def test_the_view_follows_and_gates_are_shown(fmu: Path) -> None:
    """The craft is in the middle then, wherever it is; the first gate is ahead of it, its port post above."""
    script = Script(1.2, {0.2: "f g", 0.6: "up"}, seen=[0.16, 0.4, 1.2])
    state = drive(plan_drive(start_values={"pose.x": 1e4, "pose.y": -3e3}), fmu, clock=script)
    assert state.x > 1e4
    middle = (SIZE[1] - BAR) / 2, SIZE[0] / 2
    for moment in (0.4, 1.2):
        where = np.argwhere(hull_pixels(script.pictures[moment]))
        assert (where.max(axis=0) + where.min(axis=0)) / 2 == pytest.approx(
            middle, abs=2.5 * SCALE + 2.0
        )  # the bow tip
    assert not is_color(script.pictures[0.16], WINDOW_JETS["port"]).any()
    for name, across in (("port", -30.0), ("starboard", 30.0)):
        post = np.argwhere(is_color(script.pictures[0.4], WINDOW_JETS[name])).mean(axis=0)
        assert post == pytest.approx((middle[0] + across * SCALE, middle[1] + 110.0 * SCALE), abs=2.0)


def test_gates_are_passed_in_their_order() -> None:
    """The course is the page's: its numbers are in course.js."""
    script = (Path(gates.__file__).parent / "page" / "course.js").read_text(encoding="utf-8")
    assert f"GATE_WIDTH = {gates.WIDTH:g};" in script
    assert f"SPACING = {gates.SPACING:g};" in script
    (places,) = re.findall(r"const GATES = \[(.*?)\]\.map", script, re.DOTALL)
    pairs = re.findall(r"\[([\d.-]+), ([\d.-]+)\]", places)
    assert [(float(x) * gates.SPACING, float(y) * gates.SPACING) for x, y in pairs] == gates.GATES
    course = gates.Course((10.0, 20.0, np.pi / 2))  # down the screen
    for step in range(13):
        course.go((10.0, 20.0 + 51.0 * step, 0.0), float(step))
    assert course.words == "all gates"
    assert course.clock(99.0) == 11.0 - 3.0  # 110 m are behind it after 3 steps of 51 m, 550 m after 11
    beside = gates.Course((0.0, 0.0, 0.0))
    for x in (0.0, 105.0, 115.0, 230.0):
        beside.go((x, 31.0, 0.0), x)
    assert beside.words == "gate 1 of 5"


def test_paused_time_stands_still_and_help_is_shown(fmu: Path, tmp_path: Path) -> None:
    script = Script(2.0, {0.4: "space", 0.8: "h", 1.2: "space h", 1.6: "h"}, seen=[0.48, 0.76, 1.0, 1.4])
    drive(plan_drive(), fmu, record=tmp_path / "log.csv", clock=script)
    assert read_inputs(tmp_path / "log.csv")["time"][-1] == pytest.approx(1.2 * TIME_SCALE, abs=0.011)
    pictures = script.pictures
    assert np.array_equal(hull_pixels(pictures[0.48]), hull_pixels(pictures[0.76]))
    middle = is_color(pictures[1.0], WARNING)[150:480, 330:950]
    assert middle.sum() > 200, "the names of the keys"
    assert not is_color(pictures[1.4], WARNING)[150:480, 330:950].any()


def test_a_reset_goes_back_to_the_start_and_keeps_the_record(fmu: Path, tmp_path: Path) -> None:
    """The key that is held across it stays held."""
    logs: list[Path] = []
    other = tmp_path / "log-2.csv"
    other.write_text("of another day")
    script = Script(2.0, {0.2: "up", 1.2: "r"})
    state = drive(plan_drive(), fmu, record=tmp_path / "log.csv", recorded=logs.append, clock=script)
    assert logs == [tmp_path / "log.csv", tmp_path / "log-3.csv"]
    assert other.read_text() == "of another day"
    lasts = [read_inputs(log)["time"][-1] for log in logs]
    assert lasts == pytest.approx([1.2 * TIME_SCALE, 0.8 * TIME_SCALE], abs=0.011)
    rows = read_inputs(logs[1])
    assert rows["thrust"][[0, np.flatnonzero(rows["time"] == 1.0)[-1]]].tolist() == [0.0, 1.0]
    assert end(simulate(logs[1], fmu, preset="ice")) == state


def test_time_runs_faster_and_slower(fmu: Path, tmp_path: Path) -> None:
    script = Script(3.0, {1.0: "+", 2.0: "- -"})
    drive(plan_drive(), fmu, record=tmp_path / "log.csv", clock=script, time_scale=4.0)
    assert read_inputs(tmp_path / "log.csv")["time"][-1] == pytest.approx(4.0 + 8.0 + 2.0, abs=0.011)


RUNAWAY: dict[str, Value] = {"velocity.x": 1000.0, "step_size": 0.01, "thrust": 0.0}
"""Dense air, and a sub-step far above what it allows: the motion overflows after some steps."""


def test_a_refused_step_is_told_and_ends_the_window_with_a_whole_record(each_fmu: Path, tmp_path: Path) -> None:
    log, logs = tmp_path / "log.csv", list[Path]()
    run = plan_drive("textbook", RUNAWAY)
    with pytest.raises(SimulationError, match=r" = inf after 0\.\d+ s: must stay .*; the step was refused"):
        drive(run, each_fmu, record=log, recorded=logs.append, clock=Script(9.0))
    assert not pygame.display.get_init()
    assert logs == [log]
    replayed = simulate(log, each_fmu, preset="textbook", start_values=without_inputs(RUNAWAY))
    assert replayed["time"][-1] == read_inputs(log)["time"][-1] > 0.0


def test_a_value_that_cannot_be_read_is_told_and_ends_the_window(each_fmu: Path) -> None:
    run = plan_drive(start_values={"velocity.y": 1e200, "drag_coefficient": 0.0})
    with pytest.raises(SimulationError, match="speed = inf: must be a finite number"):
        drive(run, each_fmu, clock=Script(0.4))
    assert not pygame.display.get_init()


def test_an_error_of_the_window_leaves_a_whole_record(fmu: Path, tmp_path: Path) -> None:
    class Broken(Script):
        def tick(self) -> None:
            super().tick()
            if self.now() > 0.5:
                raise RuntimeError("no more frames")

    log = tmp_path / "log.csv"
    with pytest.raises(RuntimeError, match="no more frames"):
        drive(plan_drive(), fmu, record=log, clock=Broken(9.0))
    assert simulate(log, fmu, preset="ice")["time"][-1] == pytest.approx(0.52 * TIME_SCALE - 0.4, abs=0.011)


def test_warnings_of_the_fmu_are_on_the_screen(each_fmu: Path) -> None:
    script = Script(0.4, seen=[0.0, 0.4])
    drive(plan_drive(start_values={"velocity.yaw_rate": 700.0}), each_fmu, clock=script)
    assert not is_color(script.pictures[0.0], WARNING)[30:60, :700].any()
    assert is_color(script.pictures[0.4], WARNING)[30:60, :700].sum() > 100


def test_a_machine_that_cannot_keep_up_says_so_and_stays_alive(fmu: Path, tmp_path: Path) -> None:
    class Slow(Script):
        """Every look at the clock takes a tenth of a second."""

        def now(self) -> float:
            self._looks = getattr(self, "_looks", 0) + 1
            return super().now() + 0.1 * self._looks

        def tick(self) -> None:
            if self._looks < 100:
                pygame.event.post(pygame.event.Event(pygame.USEREVENT))
            else:
                pygame.event.post(pygame.event.Event(pygame.QUIT))
            self.last = picture()

    script = Slow(9.0)
    drive(plan_drive(), fmu, record=tmp_path / "log.csv", clock=script)
    assert is_color(script.last, WARNING)[30:60, :700].sum() > 100
    assert 0.0 < read_inputs(tmp_path / "log.csv")["time"][-1] < 1.0


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: plan_drive("moon"), "preset = 'moon'"),
        (lambda: plan_drive(communication_step=2.0), "communication_step = 2.0 s: must be from 0.0001 to 1 s"),
        (lambda: drive(plan_drive(), "x.fmu", time_scale=0.0), "time_scale = 0.0: must be from 0.1 to 1000"),
        (lambda: plan_drive(start_values={"mass": -1.0}), "mass = -1.0: must be greater than 0"),
        (
            lambda: plan_drive(start_values={"port_thruster": 1}),
            "port_thruster = 1: must be an input that a drive leaves",
        ),
    ],
)
def test_what_cannot_be(make: Any, message: str) -> None:
    with pytest.raises(ValueError) as caught:  # noqa: PT011 - the message is compared below
        make()
    assert message in str(caught.value)


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-W", "error", "-c", "from hovercraft_fmu.cli import main; main()", *arguments]


def test_the_command_from_the_keyboard_to_the_replay(fmu: Path, tmp_path: Path) -> None:
    """Ended by Ctrl-C; the command that it prints comes to where it ended."""
    arguments = ("drive", str(fmu), "--record", "log.csv", "--integrator", "rk4", "--step-size", "0.05")
    options: dict[str, Any] = {"cwd": tmp_path, "text": True, "env": {**os.environ, "NO_COLOR": "1"}}
    driven = subprocess.Popen(
        command(*arguments, "--set", "mass=50"), stdout=subprocess.PIPE, stderr=subprocess.PIPE, **options
    )
    log = tmp_path / "log.csv"
    for _ in range(300):
        if log.exists() and log.stat().st_size > 0:
            break
        time.sleep(0.1)
    driven.send_signal(signal.SIGINT)
    printed, errors = driven.communicate(timeout=60)
    assert (driven.returncode, errors.strip()) == (130, "hovercraft-fmu: stopped")
    line = next(line for line in printed.splitlines() if line.strip().startswith("hovercraft-fmu simulate"))
    replayed = subprocess.run(command(*shlex.split(line)[1:]), capture_output=True, check=True, timeout=60, **options)
    place = re.search(r"\n# ended .*, at (\(.*\)) m\n$", log.read_text())
    assert place
    assert f"end position   {place[1]} m" in replayed.stdout


@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_a_killed_drive_loses_a_second_and_its_record_says_so(native_fmu: Path, shell: Shell) -> None:
    driven = subprocess.Popen(command("drive", str(native_fmu), "--record", "log.csv"), cwd=shell.folder)
    log = shell.folder / "log.csv"
    while not log.exists():
        assert driven.poll() is None
        time.sleep(0.05)
    driven.kill()
    driven.wait()
    rows = read_inputs(log)
    assert rows["time"][-1] > 0.5 * TIME_SCALE
    said = "log.csv: the record was cut, it does not say how it ended: at most a second is missing"
    assert said in shell.ok("simulate", str(native_fmu), "--input", "log.csv")


def test_without_pygame_it_says_how_to_get_it(tmp_path: Path) -> None:
    (tmp_path / "pygame.py").touch()  # as good as another package of that name
    done = subprocess.run(command("drive"), cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    assert "pip install 'hovercraft-fmu[drive]'" in done.stderr
    assert len(done.stderr.splitlines()) == 1


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there is always a display")
def test_without_a_display_it_says_so(fmu: Path, tmp_path: Path) -> None:
    env = {name: value for name, value in os.environ.items() if name not in ("SDL_VIDEODRIVER", "DISPLAY")}
    env |= {"WAYLAND_DISPLAY": "none", "XDG_RUNTIME_DIR": str(tmp_path)}
    done = subprocess.run(command("drive", str(fmu)), cwd=tmp_path, capture_output=True, text=True, env=env, timeout=60)
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr.startswith("hovercraft-fmu: no window can be opened, is there a display?")
    assert len(done.stderr.splitlines()) == 1


def test_the_outline_is_that_of_the_model() -> None:
    from hovercraft_fmu.model.craft import Craft

    assert set(outline(Craft())) == {(15.0, 0.0), (10.0, 5.0), (-10.0, 5.0), (-10.0, -5.0), (10.0, -5.0)}


def test_pygame_in_the_place_of_pygame_ce_is_said_with_the_way_out(fresh: Fresh, tmp_path: Path) -> None:
    """Both have one module: installed over one another they are neither."""
    (tmp_path / "pygame.py").write_text("")
    code = """
try:
    import hovercraft_fmu.view.window
except ModuleNotFoundError as error:
    print(error)
"""
    printed = fresh(code, env={"PYTHONPATH": str(tmp_path)})
    assert "pip uninstall -y pygame pygame-ce, then pip install 'hovercraft-fmu[drive]'" in printed
