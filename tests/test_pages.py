"""The pages inside the FMUs: complete, small, and what the laboratory's tables give."""

import re
import zipfile
from html.parser import HTMLParser
from pathlib import Path

import pytest
from PIL import Image

from hovercraft_fmu.fmu.description import NATIVE, NATIVE3, Flavour
from hovercraft_fmu.fmu.document import FOLDER
from hovercraft_fmu.fmu.native_package import build_native_fmu
from hovercraft_fmu.studies.pages import PICTURES, SHOWS, pages, shown
from tests.conftest import Built

SIZE_MAX, DOCUMENTS_MAX = 600_000, 15


class Links(HTMLParser):
    """What a page refers to."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.found: set[str] = set()
        self.feed(page)

    def handle_starttag(self, _tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found |= {value for name, value in attrs if name in ("href", "src") and value}


@pytest.fixture(
    scope="module", params=["fmu", "autopilot", NATIVE, NATIVE3], ids=lambda made: getattr(made, "identifier", made)
)
def complete(request: pytest.FixtureRequest, built: Built) -> Path:
    """Each FMU that is shipped, for all its platforms."""
    flavour = request.param
    if isinstance(flavour, Flavour):
        return built(f"{flavour.identifier}Complete.fmu", lambda path: build_native_fmu(path, flavour))
    made: Path = request.getfixturevalue(flavour)
    return made


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
    with Image.open(FOLDER / name) as picture:
        assert picture.mode == "P"
        assert picture.info[SHOWS] == shown(name)


def test_all_that_is_referred_to_is_there_and_all_that_is_there_is_referred_to(complete: Path) -> None:
    files = documentation(complete)
    links = {each for name, page in files.items() if name.endswith(".html") for each in Links(page.decode()).found}
    inside = {link for link in links if not re.match("https?:", link)}
    assert inside | {"index.html"} == files.keys() | {"index.html"}


def test_an_fmu_is_small(complete: Path) -> None:
    assert len(documentation(complete)) <= DOCUMENTS_MAX
    assert complete.stat().st_size < SIZE_MAX


def test_no_raw_tables_are_packed(complete: Path) -> None:
    assert {Path(name).suffix for name in documentation(complete)} <= {".html", ".css", ".png", ".txt"}
