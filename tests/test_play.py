"""The page that carries the FMU, in a real browser: the same C, and what a person does with it."""

import csv
import itertools
import re
import shlex
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, expect

from hovercraft_fmu.fmu.description import NATIVE
from hovercraft_fmu.fmu.interface import INPUTS, STATES, VARIABLES
from hovercraft_fmu.fmu.machine_code import BROWSER, NotCompiledError
from hovercraft_fmu.fmu.start_values import variant
from hovercraft_fmu.host import Fmu
from hovercraft_fmu.libraries import compile_libraries
from hovercraft_fmu.model.integrators import INTEGRATORS
from hovercraft_fmu.scenes import SCENES
from hovercraft_fmu.view.page import FILE, FOLDER, page
from tests.conftest import Built
from tests.native import STEPS
from tests.shell import Shell

pytestmark = pytest.mark.once

Opened = Callable[..., Page]
COMMUNICATION_STEP, DURATION = 0.1, 60.0
"""s"""
READ = [v.name for v in VARIABLES if v.causality in ("output", "local") and v.kind == "Real"]


@pytest.fixture(scope="module")
def file(built: Built) -> Path:
    """The page of this tree."""

    def make(path: Path) -> Path:
        compile_libraries([BROWSER])
        path.write_bytes(page())
        return path

    try:
        return built(FILE, make)
    except NotCompiledError as error:
        pytest.skip(str(error))


@pytest.fixture
def opened(window: tuple[Page, list[str]], file: Path) -> Iterator[Opened]:
    """Opens a page, with a fragment; whatever is written to the console fails the test."""
    made, written = window

    def open_page(fragment: str = "", size: tuple[int, int] = (480, 360), path: Path = file, **media: Any) -> Page:
        made.goto("about:blank")
        made.set_viewport_size({"width": size[0], "height": size[1]})
        made.emulate_media(**{"color_scheme": "light", "reduced_motion": "no-preference", **media})
        made.goto(f"{path.as_uri()}#{fragment}")
        made.wait_for_function("globalThis.hovercraft")
        return made

    yield open_page
    for key in ("ArrowUp", "ArrowLeft", "KeyD"):
        made.keyboard.up(key)
    made.goto("about:blank")
    assert written == []
    written.clear()


RUN = """([name, method, size, step, duration, read]) => {
    const { library, description, data, Instance, Reel } = hovercraft;
    const scene = data.scenes.find((each) => each.name === name);
    const rest = Object.fromEntries(description.inputs.map((each) => [each.name, 0]));
    const reel = new Reel(scene, rest, step);
    const craft = new Instance(library, description, () => {});
    const values = { ...data.presets[scene.preset], ...scene.values };
    craft.initialize({ ...values, integrator: description.item("integrator", method), step_size: size }, reel.inputs());
    for (let n = 0; n < Math.round(duration / step); n++, reel.pass()) {
        craft.setInputs(reel.inputs());
        craft.doStep(n * step, (n + 1) * step - n * step);
    }
    const seen = craft.get(...read);
    const inputs = reel.inputs();
    craft.free();
    return [read.map((name) => seen[name]), inputs];
}"""


def native_run(native: Fmu, name: str, method: str, size: float) -> list[float]:
    """The same calls on the native library; a scene's inputs are as they are where each step begins."""
    scene, rows = SCENES[name], SCENES[name].rows
    craft = scene.craft
    start = {field: getattr(craft, field) for field in ("air_density", *scene.parameters)}
    start |= dict(zip(STATES, scene.start, strict=True))
    names, row = INPUTS[: len(rows[0]) - 1], 0
    with native.instance() as instance:
        inputs, read = instance.port(*names), instance.port(*READ)
        instance.set({**start, "integrator": method, "step_size": size})
        instance.enter_initialization(0.0, None)
        inputs.set(rows[0][1:])
        instance.exit_initialization()
        for n in range(round(DURATION / COMMUNICATION_STEP)):
            time, after = n * COMMUNICATION_STEP, (n + 1) * COMMUNICATION_STEP
            while row + 1 < len(rows) and rows[row + 1][0] <= time:
                row += 1
            here, ahead = rows[row], rows[min(row + 1, len(rows) - 1)]
            share = (time - here[0]) / (ahead[0] - here[0]) if ahead[0] > here[0] else 0.0
            inputs.set([a + share * (b - a) for a, b in zip(here[1:], ahead[1:], strict=True)])
            instance.step(time, after - time)
        return [float(value) for value in read.get()]


def test_every_scene_and_method_has_the_bits_of_the_native_library(opened: Opened, native3_fmu: Path) -> None:
    """60 s of FMI calls in the page, and on the machine."""
    made = opened()
    made.keyboard.press(" ")
    with Fmu(native3_fmu) as native:
        for name in SCENES:
            for method in (each.name for each in INTEGRATORS):
                size = STEPS.get(method, 0.05)
                case = [name, method, size, COMMUNICATION_STEP, DURATION, READ]
                assert made.evaluate(RUN, case)[0] == native_run(native, name, method, size), (name, method)


SEEN = "(names) => hovercraft.page.flight.craft.get(...names)"


def test_what_keys_did_replays_to_the_same_bits(opened: Opened, native_fmu: Path, shell: Shell) -> None:
    """Thrust, both turning keys (left wins), wind, friction: as the log has it, and as the FMU comes out of it."""
    made = opened("scale=20&integrator=rk4&step_size=0.02&terms=friction&preset=ice")
    until = made.wait_for_function
    made.locator("summary", has_text="Other inputs").click()
    made.keyboard.down("ArrowUp")
    until("hovercraft.page.flight.inputs.thrust > 4")
    made.keyboard.down("KeyD")
    until("hovercraft.page.flight.inputs.port_thruster === 1")
    made.keyboard.down("ArrowLeft")
    until("hovercraft.page.flight.inputs.starboard_thruster === 1 && hovercraft.page.flight.inputs.port_thruster === 0")
    made.keyboard.up("ArrowLeft")
    made.keyboard.up("KeyD")
    made.keyboard.up("ArrowUp")
    made.locator("[id='input-wind.y']").fill("0.25")
    made.keyboard.press("Escape")
    until("hovercraft.page.flight.time > 30")
    made.keyboard.press(" ")
    expect(made.locator("#paused")).to_be_visible()
    with made.expect_download() as download:
        made.get_by_role("button", name="Save the log").click()
    download.value.save_as(shell.folder / "hovercraft.csv")
    with (shell.folder / "hovercraft.csv").open() as log:
        rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(log)]
    assert {*rows[0]} == {"time", *INPUTS}
    assert (rows[0]["time"], rows[0]["thrust"]) == (0.0, 0.0)
    assert {(row["port_thruster"], row["starboard_thruster"]) for row in rows} == {(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)}
    rising = [row for row in rows if 0.5 < row["thrust"] < 4.0]
    rates = {round(b["thrust"] - a["thrust"], 9) for a, b in itertools.pairwise(rising)}
    assert rates == {0.0, 0.02}  # 1 N/s, and two rows at every change
    words = shlex.split(made.locator("#command").input_value())
    assert words[:2] == ["hovercraft-fmu", "simulate"]
    shell.ok(*words[1:2], str(native_fmu), *words[2:], "--output", "out.csv")
    with (shell.folder / "out.csv").open() as out:
        last = list(csv.DictReader(out))[-1]
    seen = made.evaluate(
        "hovercraft.page.flight.craft.get(...hovercraft.page.flight.craft.description.variables.keys())"
    )
    assert float(last["time"]) == made.evaluate("hovercraft.page.flight.time")
    assert {name: float(last[name]) for name in (*READ, "substeps")} == {
        name: seen[name] for name in (*READ, "substeps")
    }


def test_a_change_of_settings_goes_on_from_where_the_craft_is(opened: Opened, native_fmu: Path, shell: Shell) -> None:
    """And that replays, too: the state is in the command."""
    made = opened("scale=50")
    made.keyboard.down("ArrowUp")
    made.wait_for_function("hovercraft.page.flight.see().craft['pose.x'] > 2")
    before = made.evaluate("hovercraft.page.flight.craft.get('pose.x')['pose.x']")
    made.locator("#integrator").select_option("drag_implicit")
    made.wait_for_function("hovercraft.page.flight.steps > 100")
    made.keyboard.press(" ")
    assert made.evaluate("hovercraft.page.flight.values['pose.x']") >= before > 2.0
    (shell.folder / "hovercraft.csv").write_text(made.evaluate("hovercraft.page.flight.log()"))
    words = shlex.split(made.locator("#command").input_value())
    shell.ok(*words[1:2], str(native_fmu), *words[2:], "--output", "out.csv")
    with (shell.folder / "out.csv").open() as out:
        last = list(csv.DictReader(out))[-1]
    assert {name: float(last[name]) for name in READ} == made.evaluate(SEEN, READ)


def test_a_scene_that_is_played_replays(opened: Opened, native_fmu: Path, shell: Shell) -> None:
    """With its inputs held, as they were; ended, it is played again by a reset."""
    made = opened("scene=slalom&step_size=0.1&scale=200")
    expect(made.locator("#paused")).to_be_visible()
    assert made.evaluate("hovercraft.page.flight.time") == 60.0
    (shell.folder / "hovercraft.csv").write_text(made.evaluate("hovercraft.page.flight.log()"))
    words = shlex.split(made.locator("#command").input_value())
    shell.ok(*words[1:2], str(native_fmu), *words[2:], "--output", "out.csv")
    with (shell.folder / "out.csv").open() as out:
        last = list(csv.DictReader(out))[-1]
    seen = made.evaluate(SEEN, READ)
    assert {name: float(last[name]) for name in READ} == seen
    made.get_by_role("button", name="Reset").click()
    assert made.evaluate("hovercraft.page.flight.steps") == 0
    made.get_by_role("button", name="Go on").click()
    made.wait_for_function("hovercraft.page.flight.time === 60")
    assert made.evaluate(SEEN, READ) == seen


THIRTY_MINUTES = """([from, to]) => {
    const { page } = hovercraft;
    let now = performance.now() / 1000 + from;
    page.pace.restart(now);
    for (let i = 0; page.flight.time < to; i++) {
        page.act(["up", "left", "down", "right"][i % 4], Number(i % 8 < 4));
        page.frame((now += 0.05));
    }
}"""


def test_half_an_hour_of_driving_does_not_grow(opened: Opened) -> None:
    """Simulated time; what is kept of it is the keys that were pressed. In bytes, after the garbage was collected: a
    number kept of each of the 120 000 steps would be as much.
    """
    made = opened("scale=200&estimate=false&step_size=0.01")
    # the prices, too, take memory, once, as soon as they are measured
    made.wait_for_function("[...document.querySelectorAll('output[id^=price-]')].every(each => each.textContent)")
    session = made.context.new_cdp_session(made)

    def used() -> tuple[int, int]:
        session.send("HeapProfiler.collectGarbage")
        heap = session.send("Runtime.getHeapUsage")["usedSize"]
        return int(heap), int(made.evaluate("hovercraft.library.memory.buffer.byteLength"))

    made.evaluate(THIRTY_MINUTES, [1000, 600])
    before = used()
    made.evaluate(THIRTY_MINUTES, [2000, 1800])
    after = used()
    assert after[0] - before[0] < 960_000
    assert after[1] == before[1]


def test_settings_are_made_again_and_again_in_the_same_memory(opened: Opened) -> None:
    made = opened()
    made.keyboard.press(" ")
    again = "for (let i = 0; i < 50; i++) hovercraft.page.change({ step_size: [0.001, 0.01][i % 2] })"
    made.evaluate(again)
    size = made.evaluate("hovercraft.library.memory.buffer.byteLength")
    made.evaluate(again)
    assert made.evaluate("hovercraft.library.memory.buffer.byteLength") == size


def test_a_browser_that_cannot_is_told_so(browser: Browser, file: Path) -> None:
    """What a script does not take away stays: so it is without scripts."""
    with browser.new_context() as context:
        context.add_init_script("delete globalThis.WebAssembly")
        made = context.new_page()
        made.goto(file.as_uri())
        expect(made.locator("#sorry")).to_have_text(re.compile("needs a browser with WebAssembly"))
        expect(made.locator("#sorry")).to_be_visible()
        expect(made.locator("#app")).to_be_hidden()


def test_what_is_unstable_looks_so(opened: Opened) -> None:
    """The gauge is over its limit, the FMU says so in its own words, and the ghost is elsewhere."""
    made = opened("scale=100")
    made.get_by_role("button", name="Show me 'unstable'").click()
    made.locator("#scale").select_option("100")
    expect(made.locator("#notices")).to_contain_text("step_size")
    assert "over" in (made.locator("#stability b").get_attribute("class") or "")
    made.wait_for_function("hovercraft.page.flight.see().distance > 20")  # its length


def test_a_refusal_is_shown_and_a_reset_goes_on(opened: Opened) -> None:
    """A link with what cannot be is said, too."""
    made = opened("integrator=euler&step_size=0.01")
    expect(made.locator("#notices")).to_have_text(re.compile("link: integrator = euler: must be semi_implicit_euler"))
    assert made.evaluate("hovercraft.page.settings.step_size") == 0.01
    made.evaluate("hovercraft.page.act('wind.x', 1e300)")
    expect(made.locator("#notices .bad").last).to_be_visible()
    made.evaluate("hovercraft.page.act('wind.x', 0)")
    made.get_by_role("button", name="Reset").click()
    made.wait_for_function("hovercraft.page.flight.time > 0.5")
    expect(made.locator("#notices")).to_be_empty()


def test_a_link_brings_the_settings_back(opened: Opened) -> None:
    made = opened()
    made.locator("#integrator").select_option("rk4")
    made.locator("#scale").select_option("50")
    made.get_by_label("skirt friction").check()
    made.locator("#term-wind").check()
    fields = made.evaluate("[...document.querySelectorAll('#inputs input')].map((each) => each.id)")
    assert fields == [f"input-{name}" for name in INPUTS[3:]]
    link = made.evaluate("location.hash").removeprefix("#")
    settings = made.evaluate("hovercraft.page.settings")
    assert settings["inputs"] == {"wind.y": 0.5}
    assert opened(link).evaluate("hovercraft.page.settings") == settings


def test_gates_are_passed_in_their_order(opened: Opened) -> None:
    made = opened()
    made.keyboard.press(" ")
    made.keyboard.press("g")
    gates = made.evaluate("hovercraft.page.course.gates")
    assert len(gates) >= 4
    through = (
        "([x, y, t]) => { hovercraft.page.course.pass({ x, y, heading: 0 }, t); return hovercraft.page.course.next }"
    )
    passed = [made.evaluate(through, [gates[1]["x"] + far, gates[1]["y"], 0]) for far in (-5, 5)]
    assert passed == [0, 0]
    for i, gate in enumerate(gates):
        assert made.evaluate(through, [gate["x"] - 5, gate["y"] + 31, 10 * i]) == i
        assert made.evaluate(through, [gate["x"] + 5, gate["y"] + 31, 10 * i]) == i  # beside its post
        made.evaluate(through, [gate["x"] - 5, gate["y"], 10 * i])
        assert made.evaluate(through, [gate["x"] + 5, gate["y"], 10 * i]) == i + 1
    assert made.evaluate("hovercraft.page.course.clock(1e9)") == 10 * (len(gates) - 1)


def test_a_finger_holds_what_a_key_does(opened: Opened) -> None:
    made = opened("scale=50", (360, 740))
    for name in ("Turn to port", "Turn to starboard", "More thrust"):
        made.get_by_label(name).dispatch_event("pointerdown", {"pointerId": 1})
    made.wait_for_function("hovercraft.page.flight.inputs.thrust > 1")
    assert made.evaluate("hovercraft.page.flight.inputs.starboard_thruster") == 1
    assert made.evaluate("hovercraft.page.flight.inputs.port_thruster") == 0


SIZES = [(360, 740, "dark"), (768, 1024, "light"), (1920, 1080, "dark")]
CONTRAST = """(name) => {
    const light = (color) => {
        const canvas = document.createElement("canvas").getContext("2d");
        canvas.fillStyle = color;
        canvas.fillRect(0, 0, 1, 1);
        const part = (value) => (value / 255 <= 0.04045 ? value / 255 / 12.92 : ((value / 255 + 0.055) / 1.055) ** 2.4);
        const [r, g, b] = [...canvas.getImageData(0, 0, 1, 1).data].map(part);
        return 0.2126 * r + 0.7152 * g + 0.0722 * b;
    };
    const value = (each) => getComputedStyle(document.documentElement).getPropertyValue(each);
    const [a, b] = [light(value(name)), light(value("--paper"))].sort((x, y) => y - x);
    return (a + 0.05) / (b + 0.05);
}"""
UNNAMED = """[...document.querySelectorAll("input, select, button, textarea, canvas, [role=meter]")]
    .filter((each) => !(each.ariaLabel || each.labels?.length || each.hasAttribute("aria-labelledby")))
    .filter((each) => !each.textContent.trim()).map((each) => each.id)"""
CUT = """[...document.querySelectorAll("dd, label, legend, button, .gauge")]
    .filter((each) => each.scrollWidth > each.clientWidth + 1).map((each) => each.outerHTML)"""
FIELDS = """[...document.querySelectorAll("#panel :is(input, select, button, textarea)")]
    .filter((each) => each.checkVisibility()).map((each) => each.id)"""


@pytest.mark.parametrize(("width", "height", "scheme"), SIZES)
def test_it_is_legible(opened: Opened, width: int, height: int, scheme: str) -> None:
    """Nothing is wider than the screen or than its own place; contrast is as WCAG 2 wants it (4.5); all has a name."""
    made = opened("", (width, height), color_scheme=scheme)
    made.keyboard.press("g")
    made.keyboard.press(" ")
    assert made.evaluate("document.documentElement.scrollWidth") <= width
    assert made.evaluate(CUT) == []
    for name in ("--ink", "--quiet", "--accent", "--bad"):
        assert made.evaluate(CONTRAST, name) >= 4.5, name
    assert made.evaluate(UNNAMED) == []


def test_the_keyboard_reaches_everything(opened: Opened) -> None:
    """Tab goes through all that can be set; Escape gives the arrow keys back to the craft."""
    made = opened(reduced_motion="reduce")
    reached = set()
    for _ in range(40):
        made.keyboard.press("Tab")
        reached.add(made.evaluate("document.activeElement.id"))
    assert {*made.evaluate(FIELDS)} <= reached
    made.locator("#fineness").focus()
    made.keyboard.press("ArrowRight")
    assert made.evaluate("hovercraft.page.settings.step_size") == 0.002
    made.keyboard.press("Escape")
    made.keyboard.down("ArrowUp")
    made.wait_for_function("hovercraft.page.flight.inputs.thrust > 0")
    assert made.evaluate("hovercraft.page.settings.step_size") == 0.002


def test_each_key_does_what_the_help_says(opened: Opened) -> None:
    """A pair of keys there and back, two that go round, a single step; a button by the space bar; what the window
    cannot hear any more is let go."""
    made = opened()
    made.keyboard.press(" ")

    def settings() -> dict[str, Any]:
        found: dict[str, Any] = made.evaluate("hovercraft.page.settings")
        return found

    before = settings()
    for there, back, name in (("]", "[", "step_size"), ("+", "-", "scale"), ("=", "-", "scale")):
        made.keyboard.press(there)
        assert settings()[name] > before[name]
        made.keyboard.press(back)
        assert settings() == before
    for key, name, count in (("v", "view", 2), ("m", "integrator", len(INTEGRATORS))):
        seen = []
        for _ in range(count):
            made.keyboard.press(key)
            seen.append(settings()[name])
        assert len({*seen}) == count
        assert seen[-1] == before[name]
    steps = made.evaluate("hovercraft.page.flight.steps")
    made.keyboard.press(".")
    assert made.evaluate("hovercraft.page.flight.steps") == steps + 1
    made.locator("#integrator").select_option("adaptive")
    made.keyboard.press("Escape")
    made.keyboard.press("]")
    assert settings()["tolerance"] > before["tolerance"]
    made.get_by_label("More thrust").focus()
    made.keyboard.down("Space")
    for _ in range(2):
        made.keyboard.press(".")
    assert made.evaluate("hovercraft.page.flight.inputs.thrust") > 0
    made.keyboard.up("Space")
    made.keyboard.press("Escape")
    made.keyboard.down("ArrowLeft")
    made.keyboard.press(".")
    assert made.evaluate("hovercraft.page.flight.inputs.starboard_thruster") == 1
    made.evaluate("dispatchEvent(new Event('blur'))")
    made.keyboard.press(".")
    assert made.evaluate("hovercraft.page.flight.inputs.starboard_thruster") == 0


def test_an_fmu_with_start_values_of_its_own_has_them_on_its_page(opened: Opened, file: Path, tmp_path: Path) -> None:
    """The module and its description say the same, and the command names the file."""
    own = tmp_path / FILE
    own.write_bytes(page(variant(NATIVE, "Heavy", {"mass": 200.0, "integrator": "rk4"})))
    made = opened("", path=own)
    expect(made.locator("#about")).to_contain_text("Heavy")
    assert made.evaluate("hovercraft.page.flight.craft.get('mass').mass") == 200.0
    assert made.evaluate("hovercraft.page.flight.values") == {"error_estimate": 2, "integrator": 1}
    assert made.locator("#command").input_value().startswith("hovercraft-fmu simulate Heavy.fmu --input")
    assert page() == file.read_bytes()  # and the ordinary one is the same when it is made again


def test_the_modules_are_one_script(file: Path) -> None:
    """Nothing of it is fetched from elsewhere, and nothing is left out."""
    text = file.read_text(encoding="utf-8")
    assert not re.search(r'(src|href)="|\bfetch\(|await import\(|https?://', text)
    assert not re.search(r"^(import|export) ", text, re.MULTILINE)
    for name in {*FOLDER.glob("*.js")} - {FOLDER / "animation.js"}:
        assert name.read_text(encoding="utf-8").splitlines()[0] in text, name


def test_the_command_writes_it_and_opens_it(file: Path, shell: Shell, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where it goes is said; a browser that does not start, too."""
    asked: list[str] = []

    def opens(address: str) -> bool:
        asked.append(address)
        return len(asked) > 1

    monkeypatch.setattr("webbrowser.open", opens)
    assert "no browser" in shell.ok("play")
    assert (shell.folder / "build" / "play.html").read_bytes() == file.read_bytes()
    assert asked == [(shell.folder / "build" / "play.html").resolve().as_uri()]
    assert "no browser" not in shell.ok("play", "--output", "own.html")
    shell.ok("play", "--no-open")
    assert len(asked) == 2
    refused = shell.refused("play", "--output", "play.htm", status=2)
    assert refused == "hovercraft-fmu: --output play.htm: must end in .html\n"
