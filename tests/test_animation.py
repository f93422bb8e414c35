"""Pictures that move: what they show is where the craft is; metres are metres; two settings can be told apart."""

import io
import itertools
import json
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image, ImageColor
from playwright.sync_api import Page, expect

from hovercraft_fmu.coupling import sail_bare
from hovercraft_fmu.drawing.palette import METHODS
from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.integrators import integrator
from hovercraft_fmu.model.subcycling import Settings
from hovercraft_fmu.simulation import Result, plan, run_model
from hovercraft_fmu.towing import BEND, haul_bare
from hovercraft_fmu.view.animation import FRAMES, MovingPicture, Track, animate
from hovercraft_fmu.view.film import BLOWN, Moving, Towline, film
from hovercraft_fmu.view.plots import animate_passage
from hovercraft_fmu.view.tow_pictures import animate_tow
from tests.conftest import ROOT
from tests.shell import Shell

Pixels = NDArray[np.float64]
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


# ---- the page


@pytest.fixture
def played(window: tuple[Page, list[str]], tmp_path: Path) -> Iterator[Callable[..., Page]]:
    """Opens a page; whatever is written to the console fails the test."""
    made, written = window

    def play(page: bytes, width: int = 900, height: int = 600, scheme: Literal["light", "dark"] = "light") -> Page:
        path = tmp_path / "played.html"
        path.write_bytes(page)
        made.set_viewport_size({"width": width, "height": height})
        made.emulate_media(color_scheme=scheme)
        made.goto(path.as_uri())
        made.wait_for_function("globalThis.animation")
        return made

    yield play
    made.goto("about:blank")
    assert written == []


def page_of(results: Result | list[Result], folder: Path) -> bytes:
    return animate(results, folder / "page.html").read_bytes()


def data_of(page: bytes) -> dict[str, Any]:
    found = re.search(r'id="data">(.*?)</script>', page.decode(), re.DOTALL)
    assert found
    data: dict[str, Any] = json.loads(found[1])
    return data


def colored(made: Page, color: str) -> Pixels:
    """Column and row of the pixels of a colour in the view, from its middle, shape (n, 2)."""
    made.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    with Image.open(io.BytesIO(made.locator("#view").screenshot())) as image:
        shown = np.array(image.convert("RGB")).astype(int)
    rows, columns = np.nonzero(np.abs(shown - ImageColor.getrgb(color)).sum(axis=2) < 6)
    return np.column_stack([columns, rows]) + 0.5 - np.array(shown.shape[1::-1]) / 2


def middle(result: Result, i: int) -> Pixels:
    """m: of the hull's area; the pentagon is a box and a triangle of a quarter of the length."""
    length, heading = result.run.craft.length, result["pose.heading"][i]
    ahead = (0.25 / 2 * (0.5 + 0.25 / 3) / (1 + 0.25 / 2)) * length
    return np.array([result["pose.x"][i], result["pose.y"][i]]) + ahead * np.array([np.cos(heading), np.sin(heading)])


HULL, ACCENT = "#fbfbff", "#0b4f8c"


def test_the_page_draws_the_craft_where_it_is(two: list[Result], played: Callable[..., Page], tmp_path: Path) -> None:
    """As many pixels a metre everywhere, y down, in the middle that of the path; or the craft, where it is followed."""
    made, result = played(page_of(two[0], tmp_path)), two[0]
    path = np.column_stack([result["pose.x"], result["pose.y"]])
    center, scales = (path.min(axis=0) + path.max(axis=0)) / 2, []
    for i in (200, 1100, 2100):
        made.evaluate("(time) => animation.go(time)", float(result["time"][i]))
        there, expected = colored(made, HULL).mean(axis=0), middle(result, i) - center
        scale = float(there @ expected / (expected @ expected))
        assert there == pytest.approx(scale * expected, abs=1.5)
        scales.append(scale)
        made.keyboard.press("f")
        assert np.abs(colored(made, HULL).mean(axis=0)).max() < 6.0, "followed: off by less than hull's middle is"
        made.keyboard.press("f")
    assert scales == pytest.approx([scales[0]] * 3, rel=0.01)


def test_the_slider_has_round_numbers(two: list[Result], played: Callable[..., Page], tmp_path: Path) -> None:
    made = played(page_of(two, tmp_path))
    labels, time = made.locator("#labels span"), made.locator("#time")
    assert labels.all_inner_texts() == ["0", "50", "100", "150", "200"]
    made.keyboard.press("ArrowRight")
    expect(time).to_have_text("1 s")
    made.locator("#slider").fill("120")
    expect(time).to_have_text("120 s")
    made = played(page_of(run_model(plan("launch", stop_time=7.3)), tmp_path), 360, 640, "dark")
    assert made.evaluate("document.documentElement.scrollWidth") <= 360
    texts = labels.all_inner_texts()
    assert texts in (["0", "5"], ["0", "2", "4", "6"])
    made.keyboard.press("ArrowRight")
    expect(time).to_have_text("0.05 s")
    made.keyboard.press("End")
    expect(time).to_have_text("7.30 s")


def test_it_plays_to_the_end_and_again(played: Callable[..., Page], tmp_path: Path) -> None:
    made = played(page_of(run_model(plan("launch", communication_step=10.0)), tmp_path))
    expect(made.locator("#speed option:checked")).to_have_text("\N{MULTIPLICATION SIGN} 2")
    for _ in range(5):
        made.keyboard.press("+")
    expect(made.locator("#speed option:checked")).to_have_text("\N{MULTIPLICATION SIGN} 100")
    made.keyboard.press(" ")
    expect(made.locator("#play")).to_have_text("Pause")
    expect(made.locator("#time")).to_have_text("60.0 s")
    expect(made.locator("#play")).to_have_text("Play")
    made.locator("#play").click()
    expect(made.locator("#play")).to_have_text("Pause")


def test_the_line_of_a_tow_is_drawn_from_end_to_end(played: Callable[..., Page]) -> None:
    """And looser where it does not pull: dots have gaps."""
    craft, time = Craft(), np.array([0.0, 1.0, 2.0])
    rest = np.zeros(3)
    crafts = [Moving(name, craft, (rest + x, rest, rest, rest, rest)) for name, x in (("first", 60.0), ("second", 0.0))]
    line = Towline(((-10.0, 0.0), (15.0, 0.0)), np.array([5.0, 5.0, 0.0]))
    made = played(film("tow", time, crafts, towline=line))
    expect(made.locator("#between")).to_have_text("the line pulls at 5.0 N")
    taut = colored(made, ACCENT)
    made.keyboard.press("End")
    expect(made.locator("#between")).to_have_text("the line pulls at 0.0 N")
    loose = colored(made, ACCENT)
    hulls = np.sort(colored(made, HULL)[:, 0])
    assert 0.2 * len(taut) < len(loose) < 0.6 * len(taut)
    assert np.ptp(taut[:, 0]) / (hulls[-1] - hulls[0]) == pytest.approx(35.0 / 85.0, abs=0.02)  # -10 .. 75 m


def test_a_page_is_small_and_needs_no_network(two: list[Result], tmp_path: Path) -> None:
    """What is in it is the run, to a thousandth of a craft's length."""
    page = page_of(two, tmp_path)
    assert len(page) < 200_000
    assert not re.search(r'(src|href)="|\bfetch\(|https?://|^(import|export) ', page.decode(), re.MULTILINE)
    data = data_of(page)
    for run, crafts in zip(two, data["crafts"], strict=True):
        for name in ("x", "y", "heading"):
            there = np.interp(data["time"], run["time"], run[f"pose.{name}"])
            assert np.abs(crafts[name] - there).max() <= 0.01
    assert [each["ghost"] for each in data["crafts"]] == [False, True]
    assert page == page_of(two, tmp_path)


def test_a_tow_and_a_voyage_are_pages_too(played: Callable[..., Page], tmp_path: Path) -> None:
    """With what is known of them: the helm of the first craft, the line, waypoints."""
    coarse = Settings(0.1, integrator(3))
    towed = haul_bare(BEND, communication_step=0.1, stop_time=70.0, settings=coarse)
    page = animate_tow(towed, tmp_path / "tow.html").read_bytes()
    data = data_of(page)
    assert [each["x"][-1] for each in data["crafts"]] == pytest.approx(
        [towed[f"{name}.pose.x"][-1] for name in ("first", "second")], abs=0.01
    )
    for time, *blown in BEND.helm[: sum(row[0] <= 60.0 for row in BEND.helm)]:
        later = np.searchsorted(data["time"], time + 1.0)
        assert [data["crafts"][0][name][later] for name in BLOWN] == pytest.approx(blown)
    assert data["line"]["tension"][-1] == pytest.approx(towed["tension"][-1], abs=0.01)
    played(page).keyboard.press("End")
    passage = sail_bare("calm", communication_step=1.0, stop_time=100.0, settings=coarse)
    page = animate_passage(passage, tmp_path / "loop.html").read_bytes()
    data = data_of(page)
    assert data["marks"] == [list(each) for each in passage.waypoints]
    assert data["crafts"][0]["y"] == pytest.approx(passage["pose.y"], abs=0.01)
    played(page, scheme="dark").keyboard.press("f")


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
