"""python -m hovercraft_fmu.studies.pages: the pages of measurements that ship inside the FMUs, and all their pictures.

They are committed where the builder packs them, so that it needs nothing of the laboratory. Run it (a minute) when a
table, a picture or a template has changed; a test holds what is committed equal to the tables.
"""

import csv
import io
import re
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import polars as pl
from fmpy import simulate_fmu
from matplotlib import rc_context
from PIL import Image, PngImagePlugin

from ..autopilot import pilot_package
from ..coupling import sail
from ..drawing.palette import METHODS
from ..fmu.archive import digest
from ..fmu.document import FOLDER as PACKED
from ..fmu.document import rendered
from ..fmu.extras import RESULT
from ..fmu.interface import ACTION, ERRORS, HOVERCRAFT, MOTION, OUTPUTS, STATES, WATCHED
from ..fmu.native_package import build_native_fmu
from ..fmu.python_package import build_fmu
from ..model.integrators import INTEGRATORS
from ..scenes import CONTROL_LOGS, SCENES, VOYAGES
from ..simulation import plan, run_model
from ..sweeps import sweep
from ..sweeps.charts import draw_sweep
from ..sweeps.study import SHIPPED
from ..tether import tether_package
from ..towing import BEND, haul
from ..view.diagram import draw_diagram
from ..view.plots import plot_passage
from ..view.tow_pictures import plot_tow
from ..whole import temporary_folder, write_whole
from . import closed_loop, owners, scene_terms, step_limit, tow, work_precision
from .laboratory import text, three_digits

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HERE = Path(__file__).parent
RESULTS = HERE / "results"
"""What `hovercraft-fmu measure` wrote, with `--output` there; the pictures it leaves there are not committed."""
PICTURES: Mapping[str, tuple[Path, ...]] = {
    "diagram.png": (),
    "ice.svg": (CONTROL_LOGS / "ice.csv",),
    "turning_circle.svg": (SHIPPED / "turning_circle.toml", SHIPPED / "turning_circle.csv"),
    "stability.png": (RESULTS / "stability.csv", RESULTS / "extremes.csv"),
    "work_precision.svg": (RESULTS / "work_precision.csv", RESULTS / "holding.csv"),
    "coupling.svg": (RESULTS / "coupling.csv",),
    "scene_terms.svg": (RESULTS / "scene_terms.csv",),
}
"""Each picture of the pages, and what it shows."""
CHARTS: Mapping[Path, tuple[tuple[Path, ...], Callable[..., "Figure"]]] = {
    pilot_package.HERE / pilot_package.CHART: ((RESULTS / "coupling_limit.csv",), step_limit.draw),
    tether_package.HERE / tether_package.CHART: ((RESULTS / "tow_limits.csv", RESULTS / "tow_growth.csv"), tow.draw),
}
"""Those of the pages of the autopilot and the tether: what they show, and what draws it."""


def _turning_circle(*_tables: pl.DataFrame) -> "Figure":
    with temporary_folder() as folder:
        done = sweep(SHIPPED / "turning_circle.toml", engine="batch", workers=1, output=Path(folder) / "sweep")
        return draw_sweep(done.folder)


DRAWN: Mapping[str, Callable[..., "Figure"]] = {
    "coupling.svg": closed_loop.draw,
    "ice.svg": lambda _log: run_model(plan("ice", communication_step=1.0)).plot(),
    "scene_terms.svg": scene_terms.draw,
    "turning_circle.svg": _turning_circle,
    "work_precision.svg": work_precision.draw_work_precision,
}
"""Those that are drawn of their tables alone, as lines."""
COLORS = 24
"""Of a picture's palette: lines and markers need few."""
COLORS_OF_SHIPS = 48
"""Of a picture with outlines that are filled: with fewer the two thrusters lose their colours, or the craft theirs."""
SHOWS = "Shows"
"""The key in a picture under which it says what it shows."""


def pages() -> dict[str, bytes]:
    """Path inside the documentation -> the whole page."""
    values = {
        "integrators": INTEGRATORS,
        "measured": _measured(),
        "machine": (RESULTS / "machine.txt").read_text(encoding="utf-8").strip(),
        "study": (SHIPPED / "turning_circle.toml").read_text(encoding="utf-8"),
        "tie": owners.TIE,
        "colors": {name: style.color for name, style in METHODS.items()},
        **_owned(),
        "observed": (*STATES, *MOTION, *ACTION, *WATCHED, *ERRORS),
    }
    return {name: page.encode() for name, page in rendered(HERE, values).items()}


def _owned() -> dict[str, object]:
    """The map, region by region: of scenes, of random craft; and who owns nothing."""
    found = pl.read_csv(RESULTS / "owners.csv")
    regions = [(rows["region"][0], rows.to_dicts()) for rows in found.partition_by("region", maintain_order=True)]
    scene_owners = [each for each in regions if each[0] in SCENES]
    random_owners = [(name.removeprefix("random, "), rows) for name, rows in regions if name not in SCENES]
    return {
        "scene_owners": scene_owners, "random_owners": random_owners, "superseded": owners.superseded(found),
    }  # fmt: skip


def shown(tables: Iterable[Path]) -> str:
    """A digest of what a picture shows."""
    return digest({path.name: path.read_bytes() for path in tables})


def voyages() -> bytes:
    """The table of the autopilot's page."""
    return text(pl.read_csv(RESULTS / "coupling_voyages.csv").drop("voyage", "missed")).encode() + b"\n"


def in_palette(picture: Path, shows: str, colors: int = COLORS) -> bytes:
    """A PNG as small as it can be, which says what it shows."""
    with Image.open(picture) as colored:
        image = colored.convert("RGB").quantize(colors, Image.Quantize.MEDIANCUT, kmeans=6, dither=Image.Dither.NONE)
    note, content = PngImagePlugin.PngInfo(), io.BytesIO()
    note.add_text(SHOWS, shows)
    image.save(content, "PNG", optimize=True, pnginfo=note)
    return content.getvalue()


TAG = re.compile(r"<[^>]*>")
LONG_NUMBER = re.compile(r"(?<=[ \"LM,(])(-?\d+\.\d)\d+(?=[ \"\n,)L])")
"""In a tag of an SVG: what is behind the tenth of a point is not seen. (Between tags is what is to be read.)"""


def line_art(figure: "Figure", shows: str) -> bytes:
    """An SVG, which says what it shows; the same bytes each time."""
    content = io.BytesIO()
    with rc_context({"svg.fonttype": "none", "svg.hashsalt": "hovercraft", "path.simplify_threshold": 1.0}):
        figure.savefig(content, format="svg", dpi=72, metadata={"Date": None, "Creator": None, "Source": shows})
    return TAG.sub(lambda tag: LONG_NUMBER.sub(r"\1", tag[0]), content.getvalue().decode()).encode()


def assemble(results: Path = RESULTS) -> list[Path]:
    """Write the pages and pictures to where the builders pack them.

    A picture that shows more than its table does is taken from `results`; without it the old one stays.
    """
    files = {PACKED / name: content for name, content in pages().items()}
    for name, draw in DRAWN.items():
        tables = [pl.read_csv(path) for path in PICTURES[name] if path.suffix == ".csv"]
        files[PACKED / name] = line_art(draw(*tables), shown(PICTURES[name]))
    for chart, (shows, charted) in CHARTS.items():
        files[chart] = line_art(charted(*map(pl.read_csv, shows)), shown(shows))
    files[pilot_package.VOYAGES] = voyages()
    with temporary_folder() as folder:
        _draw(Path(folder))
        for name in PICTURES.keys() - DRAWN.keys():
            picture = next((each / name for each in (Path(folder), results) if (each / name).exists()), None)
            if picture:
                files[PACKED / name] = in_palette(picture, shown(PICTURES[name]))
        for package in (pilot_package, tether_package):
            files[package.HERE / package.PICTURE] = in_palette(Path(folder) / package.PICTURE, "", COLORS_OF_SHIPS)
        files[RESULT] = default_result(build_native_fmu(Path(folder) / "HovercraftNative.fmu"))
    for path, content in files.items():
        write_whole(path, content)
    return sorted(files)


def default_result(fmu: Path) -> bytes:
    """The outputs of the default experiment, every second, as CSV; the shortest text that gives the same bits."""
    found = simulate_fmu(
        str(fmu), output_interval=HOVERCRAFT.communication_step, output=list(OUTPUTS), fmi_type="CoSimulation"
    )
    rows = found[:: round(1.0 / HOVERCRAFT.communication_step)]
    lines = [",".join(found.dtype.names), *(",".join(map(repr, row.tolist())) for row in rows)]
    return "".join(f"{line}\n" for line in lines).encode()


def _draw(folder: Path) -> None:
    """What is drawn anew each time: it takes seconds."""
    draw_diagram().savefig(folder / "diagram.png", format="png")
    fmu, autopilot = build_fmu(folder / "Hovercraft.fmu"), pilot_package.build_autopilot(folder / "Autopilot.fmu")
    plot_passage(sail(VOYAGES["crosswind"], fmu, autopilot), folder / pilot_package.PICTURE)
    tether = tether_package.build_tether(folder / "Tether.fmu")
    plot_tow(haul(BEND, fmu, tether), folder / tether_package.PICTURE)


def _measured() -> dict[str, list[dict[str, str]]]:
    """Table -> rows; none for a table that was not measured yet."""
    return defaultdict(list, {path.stem: _rows(path) for path in sorted(RESULTS.glob("*.csv"))})


def _rows(path: Path) -> list[dict[str, str]]:
    """The rows of a CSV file, numbers short enough to read."""
    with path.open(newline="", encoding="utf-8") as file:
        return [{name: _short(text) for name, text in row.items()} for row in csv.DictReader(file)]


def _short(text: str) -> str:
    """Three digits; none of a count, nothing where there is no number."""
    try:
        number = float(text)
    except ValueError:
        return text
    if number != number:  # NaN
        return ""
    return text if text.isdecimal() else three_digits(number)


if __name__ == "__main__":
    for written in assemble():
        print(f"wrote {written}")
