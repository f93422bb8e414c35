"""Reading what a sweep left: lazily, safely, with some rows in memory at a time."""

import json
import random
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pytest
from numpy.typing import NDArray

from hovercraft_fmu._version import __version__
from hovercraft_fmu.sweeps import load
from hovercraft_fmu.sweeps.cells import Plane, cells_of
from hovercraft_fmu.sweeps.charts import draw_sweep
from hovercraft_fmu.sweeps.reading import overview
from hovercraft_fmu.sweeps.store import packed, runs_table
from tests.conftest import Fresh

SWEPT, KEPT = ["mass", "air_density"], ["end.pose.x", "far.time"]
RUNS, CHUNK = 1000, 300


def store(
    folder: Path, runs: int = RUNS, chunk: int = CHUNK, side: int = 0, swept: Sequence[str] = SWEPT, far: bool = False
) -> NDArray[np.float64]:
    """Files as a sweep writes them, of invented rows: a grid of so many masses, or random numbers.

    Where they are `far`, x is infinite. Gives the rows of SWEPT and KEPT, NaN where there is nothing.
    """
    study = {"keep": {"events": {"far": {}}}, "sampling": {"method": "grid" if side else "latin_hypercube"}}
    about = {
        "study": json.dumps(study), "engine": "batch", "fmu_sha256": None,
        "hovercraft_fmu": __version__, "runs": runs, "chunk": chunk, "name": "invented", "swept": swept, "kept": KEPT,
        "files": ["runs"],
    }  # fmt: skip
    dice = np.random.default_rng(1)
    every: NDArray[np.float64] = dice.normal(size=(4, runs))
    if side:
        every[:2] = np.unravel_index(np.arange(runs), (side, -(-runs // side)))
    every[3, every[3] > 1.0] = np.nan
    every[2] += np.inf if far else 0.0
    every[2:, ::100] = np.nan  # they failed
    (folder / "runs").mkdir(parents=True)
    for number, first in enumerate(range(0, runs, chunk)):
        here = every[:, first : first + chunk]
        errors = [None if (first + i) % 100 else "refused" for i in range(here.shape[1])]
        columns = dict(zip((*SWEPT, *KEPT), here, strict=True))
        table = runs_table(
            first + np.arange(here.shape[1]), {name: columns[name] for name in SWEPT},
            {name: columns[name] for name in KEPT}, np.zeros(here.shape[1], np.int32), errors,
        )  # fmt: skip
        (folder / "runs" / f"{number:05}.parquet").write_bytes(packed(table, about, "runs", number))
    return every


def test_rows_come_in_their_order_by_columns_and_filters(tmp_path: Path) -> None:
    every = store(tmp_path)
    runs = load(tmp_path)
    whole = runs.to_table()
    assert whole.schema.names == ["run", *SWEPT, *KEPT, "warnings", "error"]
    assert whole["run"].to_pylist() == list(range(RUNS))
    assert pa.Table.from_batches(runs.to_batches()).equals(whole)
    np.testing.assert_array_equal(whole["far.time"].to_numpy(), every[3])
    heavy = runs.to_table(columns=["end.pose.x", "run"], filter=pc.field("mass") > 0.5)
    assert heavy["run"].to_pylist() == np.flatnonzero(every[0] > 0.5).tolist()
    assert runs.count_rows() == RUNS
    assert json.loads(runs.schema.metadata[b"hovercraft_fmu"])["runs"] == RUNS


def test_only_what_is_asked_for_is_read(tmp_path: Path) -> None:
    """What is there no more once it is loaded is not missed by a filter of other runs, and by every other reader."""
    store(tmp_path)
    runs = load(tmp_path)
    assert load(tmp_path, check=False).to_table() == load(tmp_path).to_table()
    (tmp_path / "runs" / "00002.parquet").write_bytes(b"spoiled")
    few = (pc.field("run") < 2) | (pc.field("run") == 901)
    assert runs.to_table(filter=few)["run"].to_pylist() == [0, 1, 901]
    for use in (runs.to_table, runs.count_rows, lambda: list(runs.to_batches()), lambda: overview(tmp_path)):
        with pytest.raises(ValueError, match=r"runs/00002\.parquet: is no file of a sweep, or cut.* makes it anew$"):
            use()
    (tmp_path / "runs" / "00002.parquet").unlink()
    with pytest.raises(ValueError, match=r"runs/00002\.parquet: is missing; the same command makes it anew$"):
        runs.to_table()
    with pytest.raises(ValueError, match="3 of 4 chunks are there, not 2: finish it with the same command"):
        load(tmp_path)


def test_no_flipped_bit_gives_other_rows(tmp_path: Path) -> None:
    """Wherever it is: in a page, its header, the statistics that filters go by, the metadata, the checksum."""
    store(tmp_path, 40, 20)
    path, dice = tmp_path / "runs" / "00001.parquet", random.Random(1)
    good = path.read_bytes()
    runs = load(tmp_path)
    for at in dice.sample(range(len(good)), 120):
        bad = bytearray(good)
        bad[at] ^= 1 << dice.randrange(8)
        path.write_bytes(bad)
        with pytest.raises(ValueError, match=r"00001\.parquet: is "):
            runs.to_table(columns=["run"], filter=pc.field("mass") > 0.0)


def test_a_file_of_another_sweep_is_refused_where_it_is_read(tmp_path: Path) -> None:
    store(tmp_path / "one", 40, 20)
    store(tmp_path / "other", 30, 20)
    runs = load(tmp_path / "one")
    name = "runs/00001.parquet"
    (tmp_path / "one" / name).write_bytes((tmp_path / "other" / name).read_bytes())
    with pytest.raises(ValueError, match=r"another sweep \(runs differ\)"):
        runs.to_table()


@pytest.mark.parametrize("far", [False, True])
def test_least_and_greatest_are_those_of_all_rows(tmp_path: Path, far: bool) -> None:
    every = store(tmp_path, far=far)
    found = overview(tmp_path)
    for extreme, values in zip(found.extremes, every[2:], strict=True):
        low, high = (1, 1) if np.isinf(values).any() else (np.nanargmin(values), np.nanargmax(values))
        assert (extreme.least, extreme.greatest) == (values[low], values[high])
        assert list(extreme.least_run.values()) == every[:2, low].tolist()
        assert list(extreme.greatest_run.values()) == every[:2, high].tolist()
    never = np.flatnonzero(np.isnan(every[3]) & ~np.isnan(every[2]))
    assert found.unreached == [("far", len(never), never[:10].tolist())]


def test_cells_count_every_run_once(tmp_path: Path) -> None:
    """As numpy counts them, whose cells are as wide."""
    every = store(tmp_path)
    (cells,) = cells_of(load(tmp_path), [Plane("mass", "far.time", None)], ())
    reached = every[:, ~np.isnan(every[3])]
    edges = np.array([every[0].min(), every[0].max()]), np.array([reached[3].min(), reached[3].max()])
    shape = cells.values.shape[::-1]
    assert shape == (160, 120)
    counted = np.histogram2d(reached[0], reached[3], shape, edges)[0].T
    np.testing.assert_array_equal(np.nan_to_num(cells.values), counted)
    assert np.isnan(cells.values[counted == 0]).all()


def test_cells_of_a_grid_have_the_mean_of_their_neighbours(tmp_path: Path) -> None:
    """400 masses in 134 cells of three neighbours each, but the last; five densities in one each."""
    every = store(tmp_path, 2000, side=400)
    (cells,) = cells_of(load(tmp_path), [Plane("mass", "air_density", "end.pose.x")], SWEPT)
    np.testing.assert_allclose(cells.x, [-0.5, *np.arange(2.5, 399.0, 3.0), 399.5])
    np.testing.assert_allclose(cells.y, np.arange(-0.5, 5.0))
    x = every[2].reshape(400, 5)
    expected = [np.nanmean(x[first : first + 3], axis=0) for first in range(0, 400, 3)]
    np.testing.assert_allclose(cells.values.T, expected, rtol=1e-12)


@pytest.mark.parametrize(("swept", "colour"), [(SWEPT[:1], "number"), (SWEPT, "mean")])
def test_a_picture_of_many_runs_is_one_of_cells(tmp_path: Path, swept: list[str], colour: str) -> None:
    """It says so. Each panel has its cells: how many runs are in each, or their mean."""
    every = store(tmp_path, 20_001, 10_000, swept=swept)
    figure = draw_sweep(tmp_path)
    figure.canvas.draw()
    assert figure.get_suptitle() == (
        f"invented: 20001 runs, 201 failed\nmore than 20000: drawn in cells, each coloured by the {colour} of its runs"
    )
    panels = [axes.collections[0].get_array() for axes in figure.axes[:2]]
    for panel, values in zip(panels, every[2:], strict=True):
        assert panel is not None
        cells = np.ma.filled(panel, np.nan)
        there = values[~np.isnan(values)]
        if colour == "number":
            assert np.nansum(cells) == len(there)
        else:
            assert there.min() <= np.nanmin(cells) <= np.nanmean(cells) <= np.nanmax(cells) <= there.max()


@pytest.mark.skipif(sys.platform != "linux", reason="the most memory of a process is told by Linux")
def test_memory_does_not_grow_with_the_rows(tmp_path: Path, fresh: Fresh) -> None:
    """Ten times the rows, which are 50 MB in memory, take no more than what allocators keep of a few chunks."""
    store(tmp_path / "few", 100_000, 50_000)
    store(tmp_path / "many", 1_000_000, 50_000)
    told: Any = fresh(f"""
from hovercraft_fmu.sweeps.charts import plot_sweep
from hovercraft_fmu.sweeps.reading import overview
for name in "few", "many":
    place = {str(tmp_path)!r} + "/" + name
    overview(place)
    plot_sweep(place, place + ".png")
    print(*[line.split()[1] for line in open("/proc/self/status") if line.startswith("VmHWM:")])
""")
    few, many = (int(line) / 1e3 for line in told.split())
    assert many < few + 25.0
