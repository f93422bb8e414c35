"""Sweeps on a cluster, over TLS, into an object store, over HTTP: what fails loses nothing and doubles nothing."""

import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest
import s3fs

from hovercraft_fmu import SimulationError
from hovercraft_fmu.studies import cluster_costs
from hovercraft_fmu.sweeps import load, place, runner, sweep
from hovercraft_fmu.sweeps.chunks import SECONDS
from tests.clusters import PATIENCE, Cluster, cluster
from tests.object_store import FORBIDDEN, SLOW_DOWN, ObjectStore, every, object_store
from tests.shell import Shell

CHUNKS, RUNS = 12, 240
STUDY: dict[str, Any] = {
    "scene": "turn",
    "stop_time": 15.0,
    "set": {"integrator": "rk4", "step_size": 0.1},
    "sweep": {"mass": {"from": 60.0, "to": 170.0}, "inertia": {"normal": [500.0, 20.0]}},
    "sampling": {"method": "latin_hypercube", "runs": RUNS, "seed": 1},
    "keep": {"end": ["pose.x", "pose.y", "speed"], "distance": True},
}


@pytest.fixture(autouse=True)
def _many_chunks_and_no_pauses(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where seconds of work would be one chunk of such a study."""
    monkeypatch.setitem(runner.LEAST_CHUNKS, "batch", CHUNKS)
    monkeypatch.setattr(place, "PAUSES", (0.0, 0.0))


@pytest.fixture(scope="module")
def store() -> Iterator[ObjectStore]:
    """Where every process of the tests finds it."""
    with object_store() as served, pytest.MonkeyPatch.context() as patch:
        for name, value in served.environment.items():
            patch.setenv(name, value)
        yield served


@pytest.fixture
def bucket(store: ObjectStore, request: pytest.FixtureRequest) -> Iterator[str]:
    """An empty one."""
    name = f"b{abs(hash(request.node.name))}"
    s3fs.S3FileSystem().mkdir(name)
    yield name
    store.refuse = None


@pytest.fixture(scope="module")
def right(tmp_path_factory: pytest.TempPathFactory) -> pa.Table:
    """The rows of the study, made by one process, as one chunk after the other comes."""
    folder = tmp_path_factory.mktemp("right")
    assert sweep(STUDY, engine="batch", workers=1, output=folder).new == RUNS
    return rows(folder)


def rows(output: str | Path) -> pa.Table:
    """What must be the same, to the bit: all but the metadata."""
    return load(output).to_table().replace_schema_metadata(None)


def swept(output: str | Path, farm: Cluster | None = None, **options: Any) -> runner.Outcome:
    there: dict[str, Any] = {"scheduler": farm.address, "tls": tuple(farm.tls)} if farm else {}
    return sweep(STUDY, engine="batch", output=output, **there, **options)


def once(runs: int, action: Callable[[], None]) -> Callable[[int], None]:
    """Told how many runs are done: does something as soon as they are so many, and not all."""
    acted: list[int] = []

    def tell(done: int) -> None:
        if not acted and runs <= done < RUNS:
            acted.append(done)
            action()

    return tell


# ---- the same rows, whoever makes them and wherever they are


def test_on_a_cluster(store: ObjectStore, bucket: str, tmp_path: Path, right: pa.Table) -> None:
    """All on one: it takes seconds to start."""
    with cluster(tmp_path, 2, store.environment) as farm:
        for output in (tmp_path / "folder", f"s3://{bucket}/study"):
            assert swept(output, farm).new == RUNS
            assert rows(output).equals(right)
        assert_who_has_no_key_is_kept_out(farm, tmp_path / "stranger")
        assert_a_store_may_fail_now_and_then(store, f"s3://{bucket}/failing", right, farm)
        assert_what_a_killed_worker_had_others_make(farm, tmp_path / "worker", right)
        assert_it_goes_on_when_the_scheduler_is_back(farm, tmp_path / "scheduler", right)


def assert_who_has_no_key_is_kept_out(farm: Cluster, folder: Path) -> None:
    plain = farm.address.replace("tls://", "tcp://")
    with pytest.raises(OSError, match="must be there"):
        sweep(STUDY, engine="batch", scheduler=plain, output=folder)
    assert not (folder / "runs").exists()


def assert_what_a_killed_worker_had_others_make(farm: Cluster, folder: Path, right: pa.Table) -> None:
    victim = farm.workers[0]
    outcome = swept(folder, farm, tell=once(40, lambda: farm.kill(victim)))
    assert victim not in farm.workers
    assert (outcome.new, outcome.missing) == (RUNS, 0)
    assert rows(folder).equals(right)


def assert_it_goes_on_when_the_scheduler_is_back(farm: Cluster, folder: Path, right: pa.Table) -> None:
    """One line; with workers again the same command goes on where it was."""
    with pytest.raises(SimulationError, match="the scheduler is gone, or was restarted: what was made is there"):
        swept(folder, farm, tell=once(40, lambda: farm.kill(farm.scheduler)))
    for worker in list(farm.workers):
        farm.kill(worker)
    farm.start_scheduler()
    farm.start_workers(1)
    there = len(list((folder / "runs").glob("[!.]*.parquet"))) * RUNS // CHUNKS
    assert 40 <= there == RUNS - swept(folder, farm).new
    assert rows(folder).equals(right)


def assert_a_store_may_fail_now_and_then(
    store: ObjectStore, output: str, right: pa.Table, farm: Cluster | None
) -> None:
    """It is asked again."""
    store.refuse, store.refused = every(3), 0
    assert swept(output, farm, workers=None if farm else 1).new == RUNS
    assert store.refused >= CHUNKS // 3
    store.refuse = None
    assert rows(output).equals(right)


@pytest.mark.once
def test_parts_are_the_whole(bucket: str, right: pa.Table) -> None:
    """Each made by another number of processes, in any order."""
    output = f"s3://{bucket}/parts"
    made = [swept(output, part=f"{k}/3", workers=workers) for k, workers in ((2, 4), (3, 1), (1, 2))]
    assert [each.new for each in made] == [RUNS // 3] * 3
    assert [each.missing for each in made] == [2 * RUNS // 3, RUNS // 3, 0]
    assert rows(output).equals(right)


# ---- what fails


def test_a_store_that_fails_now_and_then(store: ObjectStore, bucket: str, right: pa.Table) -> None:
    assert_a_store_may_fail_now_and_then(store, f"s3://{bucket}/study", right, None)


def test_a_store_that_fails_for_good(store: ObjectStore, bucket: str, right: pa.Table) -> None:
    """One line; what was made before is there, and the same command goes on."""

    def refuse(method: str, path: str) -> str | None:
        return SLOW_DOWN if method == "PUT" and path.endswith("/00007.parquet") else None

    output = f"s3://{bucket}/study"
    store.refuse, store.refused = refuse, 0
    with pytest.raises(OSError, match=r"must be a place that can be read and written; OSError: .*Service Unavailable"):
        swept(output, workers=1)
    assert store.refused == 1 + len(place.PAUSES)
    store.refuse = None
    assert swept(output, workers=1).new == RUNS - 7 * RUNS // CHUNKS
    assert rows(output).equals(right)


def left(folder: Path) -> list[str]:
    """Files that were begun."""
    return [path.name for path in folder.rglob(".*.parquet*")]


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[tuple[Path, Callable[[], Any], str]]:
    """A file system with room for less than the study, how to make it larger, and what the system says until then.

    Where this user may not mount one: one whose files have a few kilobytes at most.
    """
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = shutil.which("mount")
    if mount and not subprocess.run([mount, "-t", "tmpfs", "-o", "size=64k", "tmpfs", folder], check=False).returncode:
        larger = [mount, "-o", "remount,size=8m", str(folder)]
        yield folder, lambda: subprocess.run(larger, check=True), "No space left on device"
        subprocess.run(["umount", folder], check=True)
        return
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (4096, before[1]))
    try:
        yield folder, lambda: resource.setrlimit(resource.RLIMIT_FSIZE, before), "File too large"
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def test_a_store_that_is_full(small_disk: tuple[Path, Callable[[], Any], str], shell: Shell, right: pa.Table) -> None:
    """One line; after there is room the same command goes on."""
    disk, enlarge, why = small_disk
    (shell.folder / "many.toml").write_text(TOML)
    command = ("sweep", "many.toml", "--engine", "batch", "--workers", "1", "--output", str(disk))
    assert f"with room for it ({why})" in shell.refused(*command)
    assert left(disk) == []
    there = len(list((disk / "runs").iterdir())) * RUNS // CHUNKS
    enlarge()
    assert f"{RUNS} runs, {RUNS - there} of them made now" in shell.ok(*command)
    assert (there > 0) is (why == "No space left on device")
    assert there < RUNS
    assert rows(disk).equals(right)


TOML = f"""
scene = "turn"
stop_time = 15.0
set.integrator = "rk4"
set.step_size = 0.1
sweep.mass = {{ from = 60.0, to = 170.0 }}
sweep.inertia = {{ normal = [500.0, 20.0] }}
sampling = {{ method = "latin_hypercube", runs = {RUNS}, seed = 1 }}
keep.end = ["pose.x", "pose.y", "speed"]
keep.distance = true
"""


def test_two_who_start_one_study(bucket: str, tmp_path: Path, right: pa.Table) -> None:
    """In a folder the second is refused; in a store each makes what it finds missing, and the rows are the same."""

    def refused() -> None:
        with pytest.raises(ValueError, match="another sweep is at work here: wait for it"):
            swept(tmp_path, workers=1)

    assert swept(tmp_path, workers=1, tell=once(60, refused)).new == RUNS
    assert rows(tmp_path).equals(right)

    second: list[int] = []
    output = f"s3://{bucket}/study"
    first = swept(output, workers=1, tell=once(60, lambda: second.append(swept(output, workers=1).new)))
    assert (first.new, second) == (RUNS, [RUNS - 60])
    assert rows(output).equals(right)


def test_a_store_that_cannot_be_used_is_one_line(store: ObjectStore, bucket: str, shell: Shell) -> None:
    (shell.folder / "many.toml").write_text(TOML)
    command = ("sweep", "many.toml", "--engine", "batch", "--workers", "1", "--output")
    no_bucket = shell.refused(*command, "s3://no-such-bucket/study")
    assert "output = 's3://no-such-bucket/study': must be a place that can be read and written" in no_bucket
    assert "bucket does not exist" in no_bucket
    assert not s3fs.S3FileSystem().exists("no-such-bucket")
    store.refuse = lambda method, _: FORBIDDEN if method == "PUT" else None
    assert "PermissionError: Forbidden" in shell.refused(*command, f"s3://{bucket}/study")
    assert "pip install gcsfs" in shell.refused(*command, "gs://bucket/study")


@pytest.mark.once
def test_what_a_chunk_costs(monkeypatch: pytest.MonkeyPatch) -> None:
    """Those who feed the workers: measured here with few, and one worker; no clock is asserted."""
    for name, value in {"QUICK": (1,), "FEW": 2, "MANY": 42, "RUNS": 2}.items():
        monkeypatch.setattr(cluster_costs, name, value)
    monkeypatch.setattr(cluster_costs, "PATIENCE", PATIENCE)
    done: list[float] = []
    findings = cluster_costs.measure(True, done.append)
    (row,) = findings.records["cluster"].to_dicts()
    assert (row["workers"], done) == (1, [1.0])
    spent = [row["starter_ms_a_chunk"], row["scheduler_ms_a_chunk"]]
    assert max(spent) > 0.0
    assert [row["starter_ms_a_second"], row["scheduler_ms_a_second"]] == pytest.approx(
        [each / SECONDS for each in spent]
    )
    assert row["workers_fed"] == int(1e3 * SECONDS / max(spent))
