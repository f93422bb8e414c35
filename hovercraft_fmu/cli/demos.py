"""The command demo: the whole way at once, and what to try next."""

from math import degrees
from pathlib import Path
from typing import TYPE_CHECKING

import click

from .files import checked
from .options import FOLDER, make_room
from .output import OUTPUT, print_rows, progress_of
from .running import print_result, simulated, write

if TYPE_CHECKING:
    from ..building import Kind
    from ..coupling import Passage

DEMO_FOLDER = FOLDER / "demo"


@click.command()
@click.option("--loop", is_flag=True, help="The closed loop: an autopilot FMU takes it round a course in a crosswind.")
@click.option("--tow", is_flag=True, help="A tow: one craft pulls another one round a bend, by a line that is an FMU.")
def demo(loop: bool, tow: bool) -> None:
    """Build the FMUs, check them, and drive them over a recorded control log; see build/demo/."""
    from ..building import default_autopilot_kind, default_kind, default_tether_kind
    from ..drawing.figures import check_plot
    from ..scenes import CONTROL_LOGS, SCENES
    from ..simulation import holding, plan

    if loop and tow:
        raise click.UsageError("--loop and --tow: must not be given together")
    picture = check_plot(DEMO_FOLDER / ("loop.png" if loop else "tow.png" if tow else "ice.png"))
    make_room(*(picture.with_suffix(suffix) for suffix in (".png", ".csv", ".gif", ".html")))
    native = _built_and_valid(default_kind())
    if loop:
        return _demo_of_the_loop(native, _built_and_valid(default_autopilot_kind()), picture)
    if tow:
        return _demo_of_the_tow(native, _built_and_valid(default_tether_kind()), picture)
    python = _built_and_valid("python")
    run = plan(CONTROL_LOGS / "ice.csv", preset="ice", communication_step=SCENES["ice"].communication_step)
    result, one, other = (simulated(*each) for each in ((run, native), (holding(run), native), (holding(run), python)))
    print_result(result)
    largest, column = max((float(abs(one[name] - other[name]).max()), name) for name in one.names)
    OUTPUT.print(
        f"{native.name} and {python.name} agree where inputs hold over each communication step: of {len(one.names)} "
        f"columns and {len(one['time'])} rows the largest difference is {largest:.2g}, of {column}"
    )
    write(result, DEMO_FOLDER / "ice.csv", picture)
    OUTPUT.print(
        "\nWorth trying next:\n"
        "  hovercraft-fmu simulate --scene turn --plot build/turn.png\n"
        "  hovercraft-fmu simulate --scene ice --set mass=200 --plot build/heavy.png\n"
        "  hovercraft-fmu simulate --list-scenes"
    )
    return None


def _built_and_valid(kind: "Kind") -> Path:
    from ..building import build

    fmu = build(kind)
    OUTPUT.print(f"built {fmu}")
    if any(check.problems for check in checked(fmu)):
        raise click.ClickException("the FMU is not valid")
    return fmu


def _demo_of_the_loop(fmu: Path, autopilot: Path, picture: Path) -> None:
    from ..coupling import sail
    from ..scenes import VOYAGES
    from ..view.plots import animate_passage, plot_passage

    voyage = VOYAGES["crosswind"]
    with progress_of(voyage.stop_time) as progress:
        passage = sail(voyage, fmu, autopilot, progress=progress)
    _print_passage(passage)
    OUTPUT.print(f"wrote {passage.write_csv(DEMO_FOLDER / 'loop.csv')}")
    OUTPUT.print(f"wrote {plot_passage(passage, picture)}")
    OUTPUT.print(f"wrote {animate_passage(passage, picture.with_suffix('.html'))}")


def _demo_of_the_tow(fmu: Path, tether: Path, picture: Path) -> None:
    from ..towing import BEND, haul
    from ..view.tow_pictures import animate_tow, plot_tow

    with progress_of(BEND.stop_time) as progress:
        towed = haul(BEND, fmu, tether, progress=progress)
    print_rows(
        "A tow on ice: one craft pulls another one round a bend",
        {
            "tension": f"{towed['tension'].max():.2f} N at most, {towed['tension'].mean():.2f} N in the mean",
            "line": f"{towed['distance'].max():.2f} m at most; below {towed.tow.line.slack_length:g} m it hangs loose",
            "heading at the end": f"first {degrees(towed['first.pose.heading'][-1]):.2f} deg, "
            f"second {degrees(towed['second.pose.heading'][-1]):.2f} deg",
        },
    )
    OUTPUT.print(f"wrote {towed.write_csv(picture.with_suffix('.csv'))}")
    OUTPUT.print(f"wrote {plot_tow(towed, picture)}")
    for suffix in (".gif", ".html"):
        with progress_of(1.0, "drawing") as tell:
            path = animate_tow(towed, picture.with_suffix(suffix), tell)
        OUTPUT.print(f"wrote {path}")


def _print_passage(passage: "Passage") -> None:
    off = abs(passage["cross_track_error"])
    arrived = f"after {passage['time'][-1]:g} s" if passage.arrived else "no"
    distance = passage.distance
    print_rows(
        f"{passage.voyage.name}: {passage.voyage.description}",
        {
            "waypoints reached": f"{passage.reached} of {len(passage.waypoints)}",
            "arrived": arrived,
            "told": "; ".join(passage.told) or "nothing",
            "distance": f"{distance:.2f} m, {distance / passage.craft.length:.1f} craft lengths",
            "off the legs": f"{off.mean():.2f} m in the mean, {off.max():.2f} m where a leg begins",
        },
    )
