"""The pages inside the FMUs: complete, small, and what the laboratory's tables give."""

import re
import zipfile
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from PIL import Image, ImageColor

from hovercraft_fmu.autopilot import pilot_package
from hovercraft_fmu.building import PRODUCTS
from hovercraft_fmu.drawing.palette import PORT, STARBOARD
from hovercraft_fmu.fmu import document
from hovercraft_fmu.fmu.description import NATIVE, NATIVE3, PYTHON, Flavour
from hovercraft_fmu.fmu.document import FOLDER
from hovercraft_fmu.studies.pages import CHARTS, PICTURES, SHOWS, pages, shown, voyages
from tests.shell import Shell

SIZE_MAX, DOCUMENTS_MAX = 600_000, 16
PAGE_MAX = 250_000
"""Bytes, of the page to play, which comes on top."""


class Links(HTMLParser):
    """What a page refers to."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.found: set[str] = set()
        self.feed(page)

    def handle_starttag(self, _tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found |= {value for name, value in attrs if name in ("href", "src") and value}


def documentation(fmu: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(fmu) as archive:
        names = [name for name in archive.namelist() if name.startswith("documentation/")]
        return {name.removeprefix("documentation/"): archive.read(name) for name in names}


@pytest.mark.parametrize("name", sorted(pages()))
def test_the_pages_say_what_the_tables_say(name: str) -> None:
    """Where this fails: python -m hovercraft_fmu.studies.pages."""
    assert (FOLDER / name).read_bytes() == pages()[name]


@pytest.mark.parametrize("name", PICTURES)
def test_the_pictures_show_what_the_tables_say(name: str) -> None:
    """A picture says of which tables it was drawn: its pixels depend on the version of matplotlib and on fonts."""
    if name.endswith(".svg"):
        assert f"<dc:source>{shown(PICTURES[name])}</dc:source>" in (FOLDER / name).read_text(encoding="utf-8")
    else:
        with Image.open(FOLDER / name) as picture:
            assert picture.mode == "P"
            assert picture.info[SHOWS] == shown(PICTURES[name])


def test_the_pages_of_autopilot_and_tether_show_what_the_tables_say() -> None:
    assert pilot_package.VOYAGES.read_bytes() == voyages()
    for chart, (tables, _) in CHARTS.items():
        assert f"<dc:source>{shown(tables)}</dc:source>" in chart.read_text(encoding="utf-8")


@pytest.mark.parametrize("color", [PORT, STARBOARD])
def test_a_smaller_palette_leaves_the_thrusters_their_colours(color: str) -> None:
    """As they are drawn, half through, on white: of 32 colours of the picture none was near."""
    drawn = 0.55 * np.array(ImageColor.getrgb(color)) + 0.45 * 255.0
    with Image.open(pilot_package.HERE / pilot_package.PICTURE) as picture:
        found = np.array(picture.convert("RGB")).reshape(-1, 3)
    assert np.abs(found - drawn).max(axis=1).min() < 6.0


def test_what_is_to_be_read_in_a_picture_is_not_cut() -> None:
    """The numbers of its lines are: 0.001 s, in the legend, became 0.0 s with them."""
    legend = re.findall(r"integrator's error: (.*)</text>", (FOLDER / "coupling.svg").read_text(encoding="utf-8"))
    assert legend == ["semi_implicit_euler, 0.001 s", "semi_implicit_euler, 0.02 s", "rk4, 0.1 s"]


@pytest.mark.parametrize("name", ["results.html", "sweeps.html"])
def test_tables_can_be_read(name: str) -> None:
    """No ten columns, no 6.55e+04 runs."""
    page = pages()[name].decode()
    assert max(line.count("<th>") for line in re.findall(r"<tr>.*?</tr>", page, re.DOTALL)) < 10
    assert re.findall(r">-?[\d.]+e\+0[0-6]<", page) == []


@pytest.mark.parametrize("name", ["fmu", "autopilot"])
def test_the_documentation_of_a_python_fmu_is_complete_and_small(name: str, request: pytest.FixtureRequest) -> None:
    assert_complete_and_small(request.getfixturevalue(name))


def test_the_documentation_of_a_native_fmu_is_complete_and_small(complete_native_fmu: Path) -> None:
    assert_complete_and_small(complete_native_fmu)


@pytest.mark.parametrize("flavour", [PYTHON, NATIVE, NATIVE3], ids=lambda each: each.identifier)
def test_every_page_has_a_list_of_its_sections(flavour: Flavour) -> None:
    for name, page in {**document.pages(flavour), **{name: each.decode() for name, each in pages().items()}}.items():
        anchors = re.findall(r'<h2 id="([a-z0-9-]+)">', page)
        assert len(set(anchors)) == len(anchors) == page.count("<h2") > 3, name
        assert {link for link in Links(page).found if link.startswith("#")} == {f"#{anchor}" for anchor in anchors}


def test_no_page_shows_its_marks() -> None:
    """`<br>` in a cell of a table would be seen as text."""
    assert [name for name, page in pages().items() if b"&lt;br" in page] == []


def test_formulas_are_mathml_and_variables_are_in_groups() -> None:
    page = document.pages(NATIVE)["index.html"]
    formulas = [ET.fromstring(re.sub("&([a-z]+);", r"\1", each)) for each in re.findall("<math.*?</math>", page)]
    texts = ["".join(each.itertext()).replace("\u2062", "*") for each in formulas]
    assert texts[:2] == ["w=v+r*xd", "q=u*u+w*w"]
    assert formulas[1].find("msqrt") is not None
    assert texts[-4] == "I*drdt=N"
    assert formulas[-4].find("mfrac") is not None
    assert "<msup><msub><mi>x</mi><mi>d</mi></msub><mn>2</mn></msup>" in pages()["results.html"].decode()
    assert "1 semi_implicit_euler, 2 drag_implicit, 3 rk4" in page
    assert page.index(">craft</th>") < page.index("<code>mass</code></td>")
    shown = re.findall(r"<tr><td><code>([\w.]+)</code></td>", page[page.index('id="variables"') :])
    assert sorted(shown) == sorted(variable.name for variable in NATIVE.model.variables)


@pytest.mark.once
@pytest.mark.usefixtures("complete_native_fmu")
def test_the_site_is_whole(shell: Shell, request: pytest.FixtureRequest) -> None:
    """Every page of every FMU and SSP file, nothing that is referred to is missing, and a phone shows them whole."""
    shell.ok("docs")
    site = shell.folder / "build" / "docs"
    found = {page: Links(page.read_text(encoding="utf-8")).found for page in site.rglob("*.html")}
    assert len(found[site / "index.html"]) == len(PRODUCTS)
    for page, links in found.items():
        assert all((page.parent / link).is_file() for link in links if not re.match("https?:|#|data:", link)), page
    browser = request.getfixturevalue("browser")  # last: it may be skipped
    with browser.new_page(viewport={"width": 360, "height": 800}) as phone:
        for page in {each.name: each for each in found}.values():
            phone.goto(page.as_uri())
            assert phone.evaluate("document.documentElement.scrollWidth") == 360, page


def assert_complete_and_small(fmu: Path) -> None:
    """All that is referred to is there, all that is there is referred to, and no raw table is among it."""
    files = documentation(fmu)
    links = {each for name, page in files.items() if name.endswith(".html") for each in Links(page.decode()).found}
    assert {link for link in links if not re.match("https?:|#", link)} | {"index.html"} == files.keys()
    assert {Path(name).suffix for name in files} <= {".html", ".png", ".svg", ".txt"}
    assert len(files) <= DOCUMENTS_MAX
    assert len(files.get("play.html", b"")) <= PAGE_MAX
    assert fmu.stat().st_size < SIZE_MAX + PAGE_MAX
