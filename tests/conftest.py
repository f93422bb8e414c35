"""What the tests share: one FMU, fresh processes, and no silent skip where skipping is not allowed."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Collection, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import pytest
from filelock import FileLock
from hypothesis import settings

from hovercraft_fmu import advance_fleet, build
from hovercraft_fmu.autopilot.pilot_native import AUTOPILOT_NATIVE, AUTOPILOT_NATIVE3
from hovercraft_fmu.autopilot.pilot_package import build_autopilot, build_native_autopilot
from hovercraft_fmu.fmu.description import NATIVE, NATIVE3, Flavour
from hovercraft_fmu.fmu.interface import HOVERCRAFT
from hovercraft_fmu.fmu.machine_code import BROWSER, PLATFORMS, TARGETS, NotCompiledError
from hovercraft_fmu.fmu.native_package import build_native_fmu
from hovercraft_fmu.fmu.python_package import build_fmu
from hovercraft_fmu.libraries import compile_libraries
from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.dynamics import Controls, State
from hovercraft_fmu.tether.tether_interface import TETHER_MODEL
from hovercraft_fmu.tether.tether_native import TETHER_NATIVE, TETHER_NATIVE3
from hovercraft_fmu.tether.tether_package import build_native_tether
from tests.lowlevel import one
from tests.shell import Shell

if TYPE_CHECKING:
    from playwright.sync_api import Browser, ConsoleMessage, Error, Page

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")

ROOT = Path(__file__).parent.parent
Fresh: TypeAlias = Callable[..., str]
Built: TypeAlias = Callable[[str, Callable[[Path], Path]], Path]
HERE = {"linux": ["x86_64-linux"], "win32": ["x86_64-windows"], "darwin": ["x86_64-darwin", "aarch64-darwin"]}
"""Platforms that a machine needs of a native FMU."""


@pytest.fixture(scope="session")
def shared_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One for all of pytest's workers in this run; what is made in it is made under a lock."""
    base = tmp_path_factory.getbasetemp()
    folder = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / "shared"
    folder.mkdir(exist_ok=True)
    return folder


@pytest.fixture(scope="session")
def built(shared_folder: Path) -> Built:
    """Make an archive of this tree once a run: whichever of pytest's workers asks first makes it, the others wait."""

    def once(name: str, make: Callable[[Path], Path]) -> Path:
        path = shared_folder / name
        with FileLock(f"{path}.lock"):
            return path if path.exists() else make(path)

    return once


@pytest.fixture(scope="module")
def browser() -> Iterator["Browser"]:
    """One for all tests of a module; longer, its loop would be in the way of those of others."""
    from tests.browsers import chromium

    try:
        with chromium() as opened:
            yield opened
    except FileNotFoundError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def window(browser: "Browser") -> Iterator[tuple["Page", list[str]]]:
    """A window for all tests, with keys and a finger; and what is written to its console."""
    written: list[str] = []

    def heard(message: "ConsoleMessage | Error") -> None:
        written.append(getattr(message, "text", str(message)))

    with browser.new_context(has_touch=True) as context:
        made = context.new_page()
        made.set_default_timeout(30_000)
        made.on("console", heard)
        made.on("pageerror", heard)
        yield made, written


@pytest.fixture(scope="session")
def fmu(built: Built) -> Path:
    """The FMU of this tree."""
    return built("Hovercraft.fmu", build_fmu)


def _native(flavour: Flavour, variable: str, built: Built) -> Path:
    """A native FMU of this tree, or the one that an environment variable names (a sanitized one, for example)."""
    if given := os.environ.get(variable):
        return Path(given)
    return _compiled(flavour, f"{flavour.identifier}.fmu", built, HERE[sys.platform])


def _compiled(flavour: Flavour, name: str, built: Built, platforms: Collection[str]) -> Path:
    """A native FMU; C that was changed since it was compiled is compiled again, where the compiler is installed."""

    def make(path: Path) -> Path:
        compile_libraries(platforms)
        if BROWSER in platforms:  # as the package builds it
            return build("native" if flavour is NATIVE else "native3", path)
        if flavour.model is TETHER_MODEL:
            return build_native_tether(path, flavour, platforms)
        make_it = build_native_fmu if flavour.model is HOVERCRAFT else build_native_autopilot
        return make_it(path, flavour, platforms)

    try:
        return built(name, make)
    except NotCompiledError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="session")
def native_fmu(built: Built) -> Path:
    """The native FMU, FMI 2.0, for this machine alone."""
    return _native(NATIVE, "NATIVE_FMU", built)


@pytest.fixture(scope="session")
def fleet(built: Built) -> None:
    """The compiled library of many craft, of this machine."""

    def make(path: Path) -> Path:
        compile_libraries(HERE[sys.platform])
        path.touch()
        return path

    built("fleet", make)
    try:
        advance_fleet(State(), Controls(), Craft(), 0.1)
    except NotCompiledError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="session")
def native3_fmu(built: Built) -> Path:
    """The native FMU, FMI 3.0, for this machine alone."""
    return _native(NATIVE3, "NATIVE3_FMU", built)


@pytest.fixture(scope="session")
def complete(built: Built) -> Callable[[Flavour], Path]:
    """A native FMU of any model, for every platform."""

    def made(flavour: Flavour) -> Path:
        targets = TARGETS if flavour.model is HOVERCRAFT else PLATFORMS
        return _compiled(flavour, f"{flavour.identifier}Complete.fmu", built, targets)

    return made


@pytest.fixture(scope="session")
def here(built: Built) -> Callable[[Flavour], Path]:
    """A native FMU of any model, for this machine alone."""
    return lambda flavour: _compiled(flavour, f"{flavour.identifier}.fmu", built, HERE[sys.platform])


@pytest.fixture(scope="session")
def complete_native_fmu(standard: int, complete: Callable[[Flavour], Path]) -> Path:
    """The native FMU of FMI 2.0, then that of FMI 3.0, for every platform."""
    return complete(NATIVE if standard == 2 else NATIVE3)


@pytest.fixture(scope="session")
def autopilot(built: Built) -> Path:
    """The autopilot's Python FMU of this tree."""
    return built("Autopilot.fmu", build_autopilot)


@pytest.fixture(scope="session")
def native_autopilot(here: Callable[[Flavour], Path]) -> Path:
    """The native one, FMI 2.0, for this machine alone."""
    return here(AUTOPILOT_NATIVE)


@pytest.fixture(scope="session")
def native3_autopilot(here: Callable[[Flavour], Path]) -> Path:
    """And of FMI 3.0."""
    return here(AUTOPILOT_NATIVE3)


@pytest.fixture(scope="session")
def each_native_tether(standard: int, here: Callable[[Flavour], Path]) -> Path:
    """The native tether of FMI 2.0, then that of FMI 3.0, for this machine alone."""
    return here(TETHER_NATIVE if standard == 2 else TETHER_NATIVE3)


@pytest.fixture(scope="session")
def each_native_autopilot(standard: int, request: pytest.FixtureRequest) -> Path:
    """The native autopilot of FMI 2.0, then that of FMI 3.0."""
    made: Path = request.getfixturevalue("native_autopilot" if standard == 2 else "native3_autopilot")
    return made


@pytest.fixture(scope="session")
def each_autopilot(flavour: str, request: pytest.FixtureRequest) -> Path:
    """All kinds of it, beside `each_fmu`."""
    made: Path = request.getfixturevalue("autopilot" if flavour == "python" else f"{flavour}_autopilot")
    return made


FLAVOURS = ("python", "native", "native3")


@pytest.fixture(scope="session", params=FLAVOURS)
def flavour(request: pytest.FixtureRequest) -> str:
    """All kinds of FMU, one after the other."""
    return str(request.param)


@pytest.fixture(scope="session")
def each_fmu(flavour: str, request: pytest.FixtureRequest) -> Path:
    """The FMU of that kind."""
    made: Path = request.getfixturevalue("fmu" if flavour == "python" else f"{flavour}_fmu")
    return made


@pytest.fixture(scope="session", params=[2, 3])
def standard(request: pytest.FixtureRequest) -> int:
    """The version of FMI of `each_native_fmu` and `complete_native_fmu`."""
    return int(request.param)


@pytest.fixture(scope="session")
def each_native_fmu(standard: int, request: pytest.FixtureRequest) -> Path:
    """The native FMU of FMI 2.0, then that of FMI 3.0."""
    made: Path = request.getfixturevalue("native_fmu" if standard == 2 else "native3_fmu")
    return made


@pytest.fixture(scope="module")
def stepped(each_native_fmu: Path) -> Iterator[Any]:
    """An instance for co-simulation, for a module whose `shared` one is for model exchange."""
    with one(each_native_fmu) as (made, _):
        yield made


FMI_2 = pytest.mark.parametrize("standard", [2], indirect=True)
"""For what FMI 3.0 has not got."""


@pytest.fixture
def instance(shared: tuple[Any, list[str]]) -> Any:
    """The module's `shared` instance (see there), as if it were new."""
    shared[0].reset()
    shared[1].clear()
    return shared[0]


@pytest.fixture
def messages(shared: tuple[Any, list[str]]) -> list[str]:
    """What the `shared` instance has said since."""
    return shared[1]


@pytest.fixture
def fresh(tmp_path: Path) -> Fresh:
    """Run Python code in a process of its own, in an empty folder, warnings as errors; return what it printed."""

    def run(code: str, *arguments: object, flags: tuple[str, ...] = (), env: Mapping[str, str] | None = None) -> str:
        command = [sys.executable, "-W", "error", *flags, "-c", code, *map(str, arguments)]
        done = subprocess.run(
            command, cwd=tmp_path, env={**os.environ, **(env or {})}, capture_output=True, text=True, timeout=300
        )
        assert done.returncode == 0, f"{done.returncode}\n{done.stdout}\n{done.stderr}"
        return done.stdout

    return run


@pytest.fixture
def native_at_hand(native_fmu: Path, tmp_path: Path) -> Path:
    """The native FMU where commands look for it first, in build/ under the shell's folder."""
    (tmp_path / "build").mkdir()
    return Path(shutil.copy(native_fmu, tmp_path / "build"))


@pytest.fixture
def shell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Shell:
    """An empty folder to type the command in."""
    monkeypatch.chdir(tmp_path)
    return Shell(tmp_path, capsys.readouterr)


skipped: list[str] = []


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    if report.skipped:
        skipped.append(report.nodeid)


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Where CI is set every test must run: a skip is a failure."""
    if os.environ.get("CI") and skipped and session.exitstatus == pytest.ExitCode.OK:
        print(f"\nskipped, which CI does not allow: {', '.join(skipped)}")
        session.exitstatus = pytest.ExitCode.TESTS_FAILED
