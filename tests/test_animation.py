"""Pictures that move: what they show is where the craft is; metres are metres; two settings can be told apart."""

import itertools
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageColor

from hovercraft_fmu.drawing.palette import METHODS
from hovercraft_fmu.simulation import Result, plan, run_model
from hovercraft_fmu.view.animation import FRAMES, MovingPicture, Track, animate
from tests.conftest import ROOT
from tests.shell import Shell

COLORS = (METHODS["semi_implicit_euler"].color, METHODS["rk4"].color)


def ran(scene: str = "ice", **start_values: Any) -> Result:
    return run_model(plan(scene, start_values=start_values))


@pytest.fixture(scope="module")
def two() -> list[Result]:
    return [ran(step_size=0.1), ran(step_size=0.1, integrator="rk4")]


def tracks(results: list[Result]) -> list[Track]:
    return [Track(result, str(i), COLORS[i]) for i, result in enumerate(results)]


def frames(path: Path) -> list[Image.Image]:
    with Image.open(path) as image:
        shown = []
        for i in range(getattr(image, "n_frames", 1)):
            image.seek(i)
            shown.append(image.convert("RGB"))
        return shown


def test_a_gif_moves(two: list[Result], tmp_path: Path) -> None:
    told: list[float] = []
    path = animate(two, tmp_path / "new" / "two.gif", told.append)
    shown = frames(path)
    assert len(shown) == len(told) == FRAMES
    assert told == sorted(told)
    assert told[-1] == 1.0
    assert all(a.tobytes() != b.tobytes() for a, b in itertools.pairwise(shown))
    assert path.stat().st_size < 400_000


def test_fewer_communication_points_make_fewer_frames(tmp_path: Path) -> None:
    few = run_model(plan("launch", communication_step=10.0))
    path = animate([few], tmp_path / "few.gif")
    assert len(frames(path)) == 7
    assert animate([few], tmp_path / "again.gif").read_bytes() == path.read_bytes()
    page = animate([few], tmp_path / "few.html").read_text(encoding="utf-8")
    assert re.findall(r'"label":"(\d+)"', page) == ["0", "10", "20", "30", "40", "50", "60"]


def test_the_craft_is_drawn_where_it_is_and_metres_are_metres(two: list[Result]) -> None:
    picture, drawn = MovingPicture(tracks(two)), tracks(two)
    for i in (0, 900, 2400):
        image = np.array(picture.frame(i)).astype(int)
        for axes in (picture.path, picture.close_up):
            origin, right, down = axes.transData.transform([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])
            assert right[0] - origin[0] == pytest.approx(origin[1] - down[1]), "y is down, and as long as x"
            for corner in drawn[1].hull(i):  # the second craft is an outline, on top
                column, row = axes.transData.transform(corner).round().astype(int) * (1, -1) + (0, len(image))
                patch = image[row - 2 : row + 3, column - 2 : column + 3].reshape(-1, 3)
                assert np.abs(patch - ImageColor.getrgb(COLORS[1])).sum(axis=1).min() < 100


def test_the_distance_told_is_that_of_the_runs(two: list[Result], tmp_path: Path) -> None:
    a, b = two
    apart = np.hypot(b["pose.x"][-1] - a["pose.x"][-1], b["pose.y"][-1] - a["pose.y"][-1])
    page = animate(two, tmp_path / "two.html").read_text(encoding="utf-8")
    assert f"at the end {apart:.3g} m apart" in page
    for name in ("semi_implicit_euler, 0.1 s: 2 400 sub-steps", "rk4, 0.1 s: 2 400 sub-steps of 4 stages"):
        assert name in page


class Loads(HTMLParser):
    """What a browser would fetch."""

    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found += [f"{tag} {value}" for name, value in attrs if name in ("src", "href")]


def test_a_page_needs_no_network_and_has_every_frame(two: list[Result], tmp_path: Path) -> None:
    path = animate(two, tmp_path / "two.html")
    page = path.read_text(encoding="utf-8")
    loads = Loads()
    loads.feed(page)
    assert loads.found == []
    added = re.search(r"Plotly\.addFrames\('animation', (\[.*?\])\)", page, re.DOTALL)
    assert added
    shown = json.loads(added[1])
    labels = re.findall(r'"label":"([\d.]+)"', page)
    assert labels == [f"{time:g}" for time in np.arange(0.0, 240.1, 5.0)]  # round, and FRAMES at most
    assert len(shown) == len(labels) <= FRAMES
    hull = tracks(two)[0].hull(len(two[0]["time"]) - 1)
    assert shown[-1]["data"][3]["x"] == [x for x, _ in hull]
    assert shown[-1]["data"][3]["y"] == [y for _, y in hull]
    assert '"scaleanchor":"x"' in page
    assert animate(two, tmp_path / "again.html").read_bytes() == path.read_bytes()


def test_what_else_differs_is_named(tmp_path: Path) -> None:
    runs = [ran("launch"), ran("launch", mass=200.0, tolerance=1e-4)]
    page = animate(runs, tmp_path / "two.html").read_text(encoding="utf-8")
    assert "semi_implicit_euler, 0.001 s, mass 100: 60 000 sub-steps" in page
    assert "semi_implicit_euler, 0.001 s, mass 200: 60 000 sub-steps" in page


@pytest.mark.parametrize("name", ["same.gif", "same.html"])
def test_two_equal_runs_are_0_m_apart(name: str, tmp_path: Path) -> None:
    few = run_model(plan("launch", communication_step=10.0))
    assert animate([few, few], tmp_path / name).stat().st_size > 10_000


def test_what_cannot_be_animated(two: list[Result], tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"animation = '.*two\.mp4': must end in \.gif .* or \.html"):
        animate(two, tmp_path / "two.mp4")
    with pytest.raises(ValueError, match=r"results = 3 runs: must be one or two"):
        animate([*two, two[0]], tmp_path / "two.gif")
    with pytest.raises(ValueError, match=r"must have the same communication points"):
        animate([two[0], ran("launch")], tmp_path / "two.gif")


def test_the_readmes_animation_is_whole_and_small() -> None:
    (target,) = re.findall(r"\]\((\S+\.gif)\)", (ROOT / "README.md").read_text(encoding="utf-8"))
    assert (ROOT / target).stat().st_size <= 400_000
    assert len(frames(ROOT / target)) == FRAMES


def test_the_command_animates_one_setting_against_another(fmu: Path, shell: Shell) -> None:
    printed = shell.ok(
        "simulate", str(fmu), "--scene", "turn", "--stop-time", "10", "--set", "mass=50", "--against",
        "integrator=rk4,step_size=0.1", "--animate", "a/turn.gif",
    )  # fmt: skip
    assert re.findall(r"sub-steps +(\d+)", printed) == ["10000", "100"]
    assert "turn.gif" in printed
    assert len(frames(shell.folder / "a" / "turn.gif")) == FRAMES


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--animate", "x.mp4"), "animation = 'x.mp4': must end in .gif (a moving picture) or .html (a page)"),
        (("--against", "integrator=rk4"), "--against: must be given together with --animate"),
        (("--animate", "x.gif", "--against", ""), "--against : must be NAME=VALUE"),
        (("--animate", "x.gif", "--against", "rk4"), "--against rk4: must be NAME=VALUE"),
        (("--animate", "x.gif", "--against", "integrator=magic"), "integrator = 'magic': must be one of"),
    ],
)
def test_what_is_wrong_is_one_clear_line(fmu: Path, shell: Shell, arguments: tuple[str, ...], message: str) -> None:
    status = 2 if message.startswith("--") else 1
    assert message in shell.refused("simulate", str(fmu), "--stop-time", "1", *arguments, status=status)
