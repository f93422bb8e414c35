"""python -m tests.screenshots [FOLDER]: the page to play at three sizes, light and dark, and what a frame takes.

Someone drives round the gates on every picture; the one of the README is among them, of few colours.
"""

import io
import sys
from pathlib import Path
from statistics import median

from PIL import Image
from playwright.sync_api import Browser, Page

from hovercraft_fmu.view.page import page
from tests.browsers import chromium

SIZES = {"phone": (360, 740), "tablet": (768, 1024), "desk": (1920, 1080)}
README_SIZE, COLOURS = (1440, 900), 255
FRAME = 1.0 / 60.0
"""s"""
AT_THE_HELM = """([seconds, frame]) => {
    const { page } = hovercraft;
    let now = performance.now() / 1000 + 100;
    page.pace.restart(now);
    const turn = (angle) => Math.atan2(Math.sin(angle), Math.cos(angle));
    for (let i = 0; i < seconds / frame && !page.course?.finished; i++) {
        if (i % 10 === 0) {  // six times a second, as a person would
            const seen = page.flight.see().craft, gate = page.course.gates[page.course.next];
            const bearing = Math.atan2(gate.y - seen["pose.y"], gate.x - seen["pose.x"]);
            const course = seen.speed > 0.5 ? Math.atan2(seen["velocity.y"], seen["velocity.x"]) : bearing;
            const ahead = seen["pose.heading"] + 6 * seen["velocity.yaw_rate"];
            const off = turn(bearing + 1.5 * turn(bearing - course) - ahead);
            page.act("right", Number(off > 0.1));
            page.act("left", Number(off < -0.1));
            page.act("up", Number(seen.speed < 3.5));
            page.act("down", Number(seen.speed > 4.5));
        }
        page.frame((now += frame));
    }
    return [page.course.next, page.course.clock(page.flight.time), page.frames];
}"""
"""Frames as fast as they can be made, at ten times real time, by a clock that is ahead: then all stands."""


def opened(browser: Browser, file: Path, size: tuple[int, int], scheme: str, fragment: str = "") -> Page:
    """The page, with the gates, at rest."""
    width, height = size
    made = browser.new_page(
        viewport={"width": width, "height": height},
        color_scheme="dark" if scheme == "dark" else "light",
        has_touch=width < 800,
    )
    made.goto(f"{file.as_uri()}#{fragment}")
    made.wait_for_function("document.getElementById('price-rotational')?.textContent")
    made.keyboard.press("g")
    return made


def few_colours(png: bytes) -> bytes:
    """The picture with a palette."""
    buffer = io.BytesIO()
    with Image.open(io.BytesIO(png)) as picture:
        picture.convert("RGB").quantize(COLOURS, Image.Quantize.MAXCOVERAGE).save(buffer, "PNG", optimize=True)
    return buffer.getvalue()


def main(folder: Path) -> None:
    """All of it."""
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / "play.html"
    file.write_bytes(page())
    print(f"{file}: {file.stat().st_size / 1000:.0f} kB")
    with chromium() as browser:
        for name, size in SIZES.items():
            for scheme in ("light", "dark"):
                made = opened(browser, file, size, scheme)
                gates, _, frames = made.evaluate(AT_THE_HELM, [16.0, FRAME])
                path = folder / f"{name}_{scheme}.png"
                made.screenshot(path=path, full_page=size[0] < 1000)
                print(f"{path}: {gates} gates; scripts of a frame: {median(frames):.2f} ms, median of {len(frames)}")
                made.close()
        made = opened(browser, file, README_SIZE, "dark", "step_size=1&terms=rotational")
        made.evaluate(AT_THE_HELM, [11.0, FRAME])
        path = folder / "play.png"
        path.write_bytes(few_colours(made.screenshot()))
        print(f"{path}: {path.stat().st_size / 1000:.0f} kB")
        gates, clock, _ = made.evaluate(AT_THE_HELM, [120.0, FRAME])
        print(f"the course: {gates} gates in {clock:.0f} s, {clock / 10:.0f} s of a person's time")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "build/screenshots"))
