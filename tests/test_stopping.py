"""Stopped at any moment: one line, the status of the signal, nothing half-written, no folder left."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from hovercraft_fmu import Result, simulate, whole
from hovercraft_fmu.fmu.archive import write_archive
from hovercraft_fmu.view.animation import animate
from hovercraft_fmu.view.plots import plot_run

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
SOON = 5.0
"""s: two are promised, on a machine that has nothing else to do."""


def started(arguments: list[str], folder: Path) -> tuple["subprocess.Popen[str]", Path]:
    """The command in that folder, and its folder for what is temporary."""
    temporary = folder / "temporary"
    temporary.mkdir()
    env = {**os.environ, "TMPDIR": str(temporary)}
    # a background job of a shell ignores it, and so would the command
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        command = [sys.executable, "-W", "error", "-m", "hovercraft_fmu", *arguments]
        return subprocess.Popen(
            command, cwd=folder, env=env, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        ), temporary
    finally:
        signal.signal(signal.SIGINT, before)


def wait_for(folder: Path, pattern: str, process: "subprocess.Popen[str]") -> None:
    while not list(folder.glob(pattern)):
        assert process.poll() is None
        time.sleep(0.01)


def assert_stopped(process: "subprocess.Popen[str]", temporary: Path, by: int = signal.SIGINT) -> None:
    begun = time.monotonic()
    process.send_signal(by)
    _, said = process.communicate(timeout=60)
    assert (process.returncode, said.strip()) == (128 + by, "hovercraft-fmu: stopped")
    assert time.monotonic() - begun < SOON
    assert list(temporary.iterdir()) == []


LONG = ("--scene", "launch", "--communication-step", "60", "--output", "new/a.csv")
"""One step, of minutes."""


@pytest.mark.parametrize(
    ("step_size", "options", "by"),
    [("1e-3", ("--stop-time", "10000"), signal.SIGINT), ("1e-7", LONG, signal.SIGINT), ("1e-7", LONG, signal.SIGTERM)],
    ids=["between steps", "inside a step", "asked to end"],
)
@pytest.mark.parametrize("kind", ["python", "native"])
def test_while_an_fmu_steps(
    kind: str, step_size: str, options: tuple[str, ...], by: int, request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    """An exception inside a Python FMU ends the process with a signal; a step of machine code takes none at all."""
    fmu = request.getfixturevalue("fmu" if kind == "python" else "native_fmu")
    process, temporary = started(["simulate", str(fmu), "--set", f"step_size={step_size}", *options], tmp_path)
    wait_for(temporary, "hovercraft_*/binaries", process)
    time.sleep(0.3)
    assert_stopped(process, temporary, by)
    assert {path.name for path in tmp_path.rglob("*") if path.is_file()} == set()


@pytest.mark.skipif(sys.platform != "linux", reason="needs /proc")
def test_while_it_is_loaded(tmp_path: Path) -> None:
    """From its first line on, before anything of it is there."""
    process, temporary = started(["simulate"], tmp_path)
    while not _caught(process.pid) & 1 << signal.SIGTERM - 1:
        assert process.poll() is None
    assert_stopped(process, temporary)


def _caught(process: int) -> int:
    """The signals that a process has a function for, as bits."""
    lines = Path(f"/proc/{process}/status").read_text().splitlines()
    return int(next(line.split()[1] for line in lines if line.startswith("SigCgt")), 16)


def test_what_a_killed_process_left_is_cleared_a_day_later(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    whole._clear_left.cache_clear()
    names = {"gone": ended.pid, "young": ended.pid, "running": os.getpid()}
    folders = {name: tmp_path / f"hovercraft_{process}_{name}" for name, process in names.items()}
    folders["another's"] = tmp_path / "hovercraft_of_another"
    for name, folder in folders.items():
        folder.mkdir()
        (folder / "file").touch()
        age = 3600.0 if name == "young" else 2 * whole.DAY
        os.utime(folder, (time.time() - age,) * 2)
    with whole.temporary_folder() as made:
        assert Path(made).parent == tmp_path
    assert {name for name, folder in folders.items() if folder.exists()} == {"young", "running", "another's"}


def test_a_file_is_whole_or_what_it_was(tmp_path: Path) -> None:
    path = tmp_path / "new" / "file"
    whole.write_whole(path, b"first")
    with pytest.raises(KeyboardInterrupt):
        _interrupted_at(path)
    assert path.read_bytes() == b"first"
    assert [each.name for each in path.parent.iterdir()] == ["file"]


@contextmanager
def no_room(size: int) -> Iterator[None]:
    """No file can be larger, as where the disk is full."""
    resource = pytest.importorskip("resource", reason="of POSIX")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


WRITERS: dict[str, Callable[[Result, Path], Any]] = {
    "a.csv": lambda result, path: result.write_csv(path),
    "a.png": plot_run,
    "a.gif": lambda result, path: animate([result], path),
    "a.html": lambda result, path: animate([result], path),
    "a.fmu": lambda _, path: write_archive(path, lambda: bytes(10**5)),
}


def test_a_full_disk_takes_nothing_away(native_fmu: Path, tmp_path: Path) -> None:
    result = simulate("turn", native_fmu, stop_time=0.2)
    for name, write in WRITERS.items():
        path = tmp_path / name
        path.write_bytes(b"old")
        with no_room(100), pytest.raises(OSError, match="with room for it") as refused:
            write(result, path)
        assert refused.value.filename == str(path)
        assert path.read_bytes() == b"old"
    assert {path.name for path in tmp_path.iterdir()} == set(WRITERS)


def test_what_is_no_file_is_written_to(native_fmu: Path, tmp_path: Path) -> None:
    """A pipe, or /dev/null: nothing takes its place."""
    result, pipe = simulate("turn", native_fmu, stop_time=0.2), tmp_path / "pipe"
    os.mkfifo(pipe)
    with ThreadPoolExecutor(1) as pool:
        read = pool.submit(pipe.read_text)
        result.write_csv(pipe)
    assert read.result() == result.write_csv(tmp_path / "a.csv").read_text()
    assert pipe.is_fifo()


def _interrupted_at(path: Path) -> None:
    with whole.written(path) as unfinished:
        unfinished.write_bytes(b"half")
        raise KeyboardInterrupt
