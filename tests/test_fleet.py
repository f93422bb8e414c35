"""Many craft at once: each with the bits of the kernel that the native FMU has, whatever its neighbours do."""

import math
import subprocess
import sys
import threading
from ctypes import CDLL, addressof, byref, c_double, c_void_p
from dataclasses import astuple, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from hovercraft_fmu import advance_fleet
from hovercraft_fmu.examples import cloud
from hovercraft_fmu.fmu.machine_code import C_FOLDER, FLEET, Library, NotCompiledError
from hovercraft_fmu.host.fleet import Crafts, _CFleet, _CReached, _library, _Way, observe_fleet
from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.dynamics import Controls, State
from hovercraft_fmu.model.integrators import ADAPTIVE, INTEGRATORS
from hovercraft_fmu.model.subcycling import Settings
from hovercraft_fmu.simulation import held_steps, plan
from tests.native import IN_TURN, KERNEL_FILES, STEPS, Kernel, compile_c

pytestmark = pytest.mark.usefixtures("fleet")
METHODS = {method.name: method for method in INTEGRATORS}
EVERY = pytest.mark.parametrize("method", METHODS)
TERMS: dict[str, dict[str, float]] = {
    "plain": {},
    "directional": {"drag_area": 2},
    "spin": {"rotational_drag": 0.7},
    "friction": {"skirt_friction": 0.003},
    "no drag": {"drag_coefficient": 0.0},
    "wind": {},
    "load": {},
}

SLOPES = {"held": Controls(0.0), "thrusters": Controls(0.7, 0.2, -0.1), "wind": Controls(0.7, 0.2, -0.1, 0.05, 0.0)}
SLOPES["load"] = Controls(0.0, external_force_x=0.3, external_force_y=-0.2, external_moment=2.0)


@pytest.fixture(scope="module")
def kernel(tmp_path_factory: pytest.TempPathFactory) -> Kernel:
    """That of the native FMU, by this machine's compiler."""
    return Kernel(compile_c(tmp_path_factory.mktemp("kernel") / "kernel.so", KERNEL_FILES, "-shared", "-fPIC", "-lm"))


def drawn(count: int, seed: int, **parameters: Any) -> tuple[list[State], list[Controls], list[Craft]]:
    """Craft that go at anything from a creep to a gale, and head anywhere, some of them after millions of turns."""
    dice = np.random.default_rng(seed)

    def sized(least: float, most: float) -> Any:
        return dice.choice([-1.0, 1.0], count) * 10.0 ** dice.uniform(least, most, count)

    headings = np.where(dice.random(count) < 0.1, np.pi / 2 * dice.integers(-9, 9, count), sized(-3.0, 8.0))
    moving = [sized(*range_) for range_ in ((-1.0, 3.0), (-1.0, 3.0), (-4.0, 1.0), (-4.0, 1.0), (-4.0, 0.0))]
    states = [State(*row) for row in np.array([*moving[:2], headings, *moving[2:]]).T.tolist()]
    controls = [Controls(*row) for row in dice.uniform(-0.5, 12.0, (count, 3)).tolist()]
    ranges = {"mass": (50.0, 200.0), "inertia": (300.0, 900.0), "drag_center_fraction": (-0.5, 0.1)}
    constants: Any = {name: dice.uniform(low, high, count).tolist() for name, (low, high) in ranges.items()}
    crafts = [replace(Craft(), **{name: row[i] for name, row in constants.items()}, **parameters) for i in range(count)]
    return states, controls, crafts


def columns(rows: list[Any]) -> NDArray[np.float64]:
    return np.array([tuple(row) for row in rows], float).T


def assert_alike(found: Any, expected: list[tuple[str, Any]], before: list[State]) -> None:
    for i, (outcome, stretch) in enumerate(expected):
        assert (outcome == "advanced") == (i not in found.refused), found.refused.get(i)
        if outcome == "advanced":
            assert tuple(found.states[:, i]) == stretch.state, i
            assert found.substeps[i] == stretch.substeps
            assert (found.stability[i], found.rotation[i]) == (stretch.stability, stretch.rotation)
            assert found.proposed[i] == stretch.proposed
        else:
            assert tuple(found.states[:, i]) == before[i]


@EVERY
@pytest.mark.parametrize("term", TERMS)
@pytest.mark.parametrize("slope", SLOPES.values(), ids=SLOPES)
def test_each_craft_has_the_bits_of_the_native_fmu(term: str, method: str, slope: Controls, kernel: Kernel) -> None:
    states, controls, crafts = drawn(43, seed=len(term), **TERMS[term])
    if term == "wind":
        controls = [each._replace(wind_x=0.2, wind_y=-0.1) for each in controls]
    if term == "load":
        controls = [Controls(*each[:5], 3.0, -2.0, 25.0) for each in controls]
    way = Settings(STEPS[method], METHODS[method], 1e-6)
    found = advance_fleet(columns(states), columns(controls), crafts, 0.73, way, slope)
    expected = [
        kernel.advance(state, held, craft, 0.73, way, rate=slope)
        for state, held, craft in zip(states, controls, crafts, strict=True)
    ]
    assert_alike(found, expected, states)
    assert sum(outcome == "advanced" for outcome, _ in expected) > 20


@pytest.mark.parametrize(("name", "method"), IN_TURN.items())
def test_every_scene(name: str, method: str, kernel: Kernel) -> None:
    """With one of the methods; nine craft, so that a block and one more go through it."""
    run = plan(name, start_values={"integrator": method, "step_size": STEPS[method]}, stop_time=20.0)
    states = np.tile(np.array(run.start)[:, None], 9)
    state, proposed, own = run.start, np.zeros(9), 0.0
    for time, end, held in held_steps(run):
        found = advance_fleet(states, held, run.craft, end - time, run.settings, proposed=proposed)
        states, proposed = found.states, found.proposed
        outcome, made = kernel.advance(state, held, run.craft, end - time, run.settings, own)
        state, own = made.state, made.proposed
        assert outcome == "advanced"
    assert not found.refused
    assert (states == np.array(state)[:, None]).all()


@pytest.mark.parametrize("method", ["semi_implicit_euler", "rk4"])
def test_neighbours_change_nothing(method: str) -> None:
    """Whatever the number of craft and their order, with others in between that cannot be, or go elsewhere."""
    states, controls, crafts = drawn(29, seed=3)
    way = Settings(STEPS[method], METHODS[method])
    whole = advance_fleet(columns(states), columns(controls), crafts, 1.0, way)
    crafts = [replace(each, skirt_friction=0.01) if i % 5 == 2 else each for i, each in enumerate(crafts)]
    states = [each._replace(vx=1e200) if i % 7 == 3 else each for i, each in enumerate(states)]
    states[11] = states[11]._replace(heading=math.nan)
    mixed = advance_fleet(columns(states), columns(controls), crafts, 1.0, way)
    assert {3, 10, 11, 24} <= set(mixed.refused)
    for i in range(29):
        alone = advance_fleet(columns(states[i : i + 1]), columns(controls[i : i + 1]), crafts[i], 1.0, way)
        np.testing.assert_array_equal(alone.states[:, 0], mixed.states[:, i])
        if i % 5 != 2 and i % 7 != 3 and i != 11:
            np.testing.assert_array_equal(whole.states[:, i], mixed.states[:, i])
    assert str(mixed.refused[11]) == "heading = nan: must be a finite number"
    assert "must stay a finite number" in str(mixed.refused[3])
    assert mixed.states[3, 3] == 1e200


@pytest.mark.parametrize("method", ["semi_implicit_euler", "rk4"])
def test_a_block_that_is_not_finite_ends_at_once(method: str) -> None:
    """Of 10^9 sub-steps, which would take half a minute, the first 65 536; but not where a neighbour goes on."""
    hot, way = Craft(mass=1e-3, inertia=1e-3, air_density=1000.0), Settings(1.0, METHODS[method])
    assert list(advance_fleet(State(vx=1e3), Controls(0.0), hot, 1e9, way).refused) == [0]
    both = advance_fleet(columns([State(vx=1e3), State(vx=0.3)]), Controls(0.0), [hot, Craft()], 1e5, way)
    assert list(both.refused) == [0]
    alone = advance_fleet(State(vx=0.3), Controls(0.0), Craft(), 1e5, way)
    assert tuple(both.states[:, 1]) == tuple(alone.states[:, 0])


def test_a_ramp_beside_controls_that_hold() -> None:
    """They do not go side by side, and have the bits that they have alone."""
    ramps = [0.7, 0.0]
    slopes = columns([Controls(ramp) for ramp in ramps])
    both = advance_fleet(columns([State()] * 2), Controls(5.0), Craft(), 0.5, slopes=slopes)
    for i, ramp in enumerate(ramps):
        alone = advance_fleet(State(), Controls(5.0), Craft(), 0.5, slopes=Controls(ramp))
        assert tuple(both.states[:, i]) == tuple(alone.states[:, 0])


def test_the_entry_in_c_refuses_what_is_missing() -> None:
    """-1, whichever array or structure is not there; a craft with a number that cannot be is refused alone."""
    library: Any = CDLL(_library()._name)  # which takes any pointer
    ones, found = (c_double * 1)(1.0), (c_double * 64)()
    fleet, way, reached = _CFleet(count=1), _Way(integrator=1), _CReached()
    constants = list(fleet.constants)
    numbers = [*fleet.states, *fleet.controls, *fleet.slopes, *constants]
    for column in (*numbers, *way.numbers):
        column.values = addressof(ones)
    reached.states = (c_void_p * 6)(*[addressof(found)] * 6)
    others = [field[0] for field in _CReached._fields_ if field[0] != "states"]
    for name in others:
        setattr(reached, name, addressof(found))
    motion, loads = (c_void_p * 2)(*[addressof(found)] * 2), (c_void_p * 4)(*[addressof(found)] * 4)

    def entries() -> tuple[int, int, int]:
        advanced = library.fleet_advance(byref(fleet), byref(way), byref(reached))
        observed = library.fleet_observe(byref(fleet), motion, loads)
        return advanced, observed, library.fleet_derived(byref(fleet), found)

    assert entries() == (0, 0, 0)
    for column in (*numbers, *way.numbers):
        column.values = None
        assert entries() == (-1, -any(column is each for each in numbers), -any(column is each for each in constants))
        for number in (math.inf, -1.0):
            bad = c_double(number)
            column.values = addressof(bad)
            cannot_be = number == math.inf or not any(column is each for each in numbers)
            assert not cannot_be or entries()[0] == 1
        column.values = addressof(ones)
    for place in (reached.states, motion, loads):
        for k, there in enumerate(place):
            place[k] = None
            assert -1 in entries()
            place[k] = there
    for name in others:
        setattr(reached, name, None)
        assert entries()[0] == -1
        setattr(reached, name, addressof(found))
    for way.integrator in (0, 6):
        assert entries()[0] == -1
    fleet.count = -1
    assert entries() == (-1, -1, -1)
    assert library.fleet_advance(None, byref(way), byref(reached)) == -1
    assert library.fleet_advance(byref(fleet), byref(way), None) == -1
    assert library.fleet_observe(None, motion, loads) == library.fleet_derived(None, found) == -1
    fleet.count, way.integrator = 1, 1
    assert library.fleet_advance(byref(fleet), None, byref(reached)) == -1
    assert library.fleet_advance(byref(fleet), byref(way), None) == -1
    assert library.fleet_observe(byref(fleet), None, loads) == library.fleet_observe(byref(fleet), motion, None) == -1
    assert library.fleet_derived(byref(fleet), None) == -1
    assert entries() == (0, 0, 0)


def test_steps_and_tolerances_of_their_own() -> None:
    """Craft whose numbers of sub-steps differ do not go side by side, and have their own bits all the same."""
    states, controls, crafts = drawn(20, seed=5)
    step, size, tolerance = np.linspace(0.1, 2.0, 20), np.geomspace(0.001, 0.1, 20), np.geomspace(1e-9, 1e-3, 20)
    for method in INTEGRATORS:
        way = Settings(size, method, tolerance)  # type: ignore[arg-type]
        found = advance_fleet(columns(states), columns(controls), crafts, step, way)
        for i in range(20):
            own = Settings(float(size[i]), method, float(tolerance[i]))
            alone = advance_fleet(states[i], controls[i], crafts[i], float(step[i]), own)
            assert tuple(alone.states[:, 0]) == tuple(found.states[:, i])
            assert alone.substeps[0] == found.substeps[i]


def test_rows_are_read_where_they_are_and_never_written_into() -> None:
    states, controls, crafts = drawn(16, seed=7)
    rows = np.ascontiguousarray(columns(states).T)  # a craft a row: the columns have strides
    rows.setflags(write=False)
    one = advance_fleet(rows.T, columns(controls), crafts, 0.5)
    other = advance_fleet(columns(states), columns(controls), Crafts.of(crafts), 0.5)
    np.testing.assert_array_equal(one.states, other.states)
    records = np.zeros(16, [("pad", "u1"), ("x", "f8")])  # numbers at odd places
    records["x"] = rows[:, 0]
    moved = advance_fleet([records["x"], *columns(states)[1:]], columns(controls), crafts, 0.5)
    np.testing.assert_array_equal(moved.states, one.states)


def test_no_craft_one_craft_and_a_step_of_no_time() -> None:
    for none in (Craft(), Crafts(mass=[])):
        assert advance_fleet(np.empty((6, 0)), Controls(5.0), none, 0.1).states.shape == (6, 0)
    one = advance_fleet(State(vx=0.3), Controls(5.0), Craft(), 0.0)
    assert tuple(one.states[:, 0]) == State(vx=0.3)
    assert one.substeps.tolist() == [0]
    assert not one.refused


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"states": np.zeros((5, 3))}, "states: 5 rows: must be 6, one for each quantity"),
        ({"controls": np.zeros((5, 4))}, "thrust: shape (4,): must be (3,), one for each craft"),
        ({"communication_step": np.zeros(2)}, "communication_step: shape (2,): must be (3,), one for each"),
        ({"crafts": [Craft()] * 2}, "mass: shape (2,): must be (3,), one for each"),
        ({"communication_step": "x"}, "communication_step = 'x': must be a number, or an array of them, one for each"),
        ({"proposed": [0.1, "a"]}, "proposed = [0.1, 'a']: must be a number, or an array of"),
        ({"states": 0.0}, "states: 1 rows: must be 6, one for each quantity"),
        ({"states": [*State()[:5], "fast"]}, "yaw_rate = 'fast': must be a number, or an array of them"),
        ({"slopes": [0.0, [[1.0], [1.0, 2.0]], 0.0, 0.0, 0.0]}, "slope of port = [[1.0], [1.0, 2.0]]: must be a"),
    ],
)  # fmt: skip
def test_what_does_not_fit_is_named(change: dict[str, Any], says: str) -> None:
    given: dict[str, Any] = {"states": np.zeros((6, 3)), "controls": Controls(), "crafts": Craft()}
    with pytest.raises(ValueError, match="must be") as caught:
        advance_fleet(**({"communication_step": 0.1} | given | change))
    assert str(caught.value).startswith(says)


@pytest.mark.parametrize(
    ("parameters", "says"),
    [
        ({"mass": [1.0, -2.0, 3.0]}, "craft 1: mass = -2.0: must be greater than 0"),
        ({"drag_area": [1, 1.5]}, "craft 1: drag_area = 1.5: must be one of 1 (constant), 2 (directional)"),
        ({"thrust_min": [0.0, 20.0]}, "craft 1: thrust_min = 20.0 N: must not be above thrust_max = 10.0 N"),
        ({"air_density": [1.0, 1e308]}, "craft 1: drag_factor = inf kg/m: must be a finite number"),
        ({"mass": math.nan}, "mass = nan: must be a finite number"),
        ({"mass": "a"}, "mass = 'a': must be a number, or an array of them, one for each craft"),
        ({"weight": 1.0}, "weight: must be a parameter of a craft: mass, "),
        ({"mass": [1.0, 2.0], "inertia": [1.0, 2.0, 3.0]}, "mass: shape (2,): must be (3,)"),
    ],
)
def test_craft_that_cannot_be(parameters: dict[str, Any], says: str) -> None:
    with pytest.raises(ValueError, match=r"must be|must not") as caught:
        Crafts(**parameters)
    assert str(caught.value).startswith(says)


REFUSED = {
    "x": ({"step": -0.1}, "communication_step = -0.1: must not be negative"),
    "size": ({"size": 0.0}, "step_size = 0.0: must be greater than 0"),
    "many": ({"step": 1e9}, "communication step = 1000000000.0 s: must not need more than 10^9 sub-steps of step_size"),
    "slope": ({"slope": math.inf}, "slope of thrust = inf: must be a finite number"),
    "small": ({"tolerance": 1e-300, "method": 3}, "step = "),
}


@pytest.mark.parametrize("name", REFUSED)
def test_each_refusal_has_its_reason(name: str) -> None:
    change, says = REFUSED[name]
    way = Settings(change.get("size", 0.001), INTEGRATORS[int(change.get("method", 0))], change.get("tolerance", 1e-6))
    step = np.array([0.1, change.get("step", 0.1)])
    slopes = Controls(0.0)._replace(thrust=np.array([0.0, change.get("slope", 0.0)]))  # type: ignore[arg-type]
    found = advance_fleet(State(vx=1.0), Controls(), Crafts(mass=[100.0, 101.0]), step, way, slopes)
    assert str(found.refused[1]).startswith(says)
    assert tuple(found.states[:, 1]) == State(vx=1.0)


def test_too_many_steps_of_the_adaptive_method(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the limit is a thousand steps; of 10^8 one sees nothing in a minute."""
    files = [C_FOLDER / FLEET / "fleet.c"]
    options = ("-DHOVERCRAFT_MAX_TRIED=1000", "-O0", "-Wno-psabi", "-shared", "-fPIC", "-lm")
    few = compile_c(tmp_path / "few.so", files, *options)
    monkeypatch.setattr(Library, "path", lambda *_: few)
    _library.cache_clear()
    spun = advance_fleet(State(), Controls(0.0, 1.0), Craft(drag_coefficient=0.0), 86400.0, Settings(1.0, ADAPTIVE))
    _library.cache_clear()
    assert str(spun.refused[0]) == (
        "communication step = 86400.0 s: must not need more than 10^8 sub-steps to meet tolerance = 1e-06; set a "
        "larger tolerance, or take a shorter step"
    )


@pytest.mark.parametrize("machine", ["riscv64", "sparc"])
def test_a_machine_without_machine_code(machine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("platform.machine", lambda: machine)
    _library.cache_clear()
    with pytest.raises(NotCompiledError, match=f"no machine code of HovercraftFleet for {machine}-"):
        advance_fleet(State(), Controls(), Craft(), 0.1)


def test_what_is_no_parameter_of_crafts() -> None:
    assert Crafts(mass=[1.0, 2.0]).mass.tolist() == [1.0, 2.0]
    with pytest.raises(AttributeError, match="weight"):
        Crafts().weight  # noqa: B018


def test_what_is_seen_of_them(kernel: Kernel) -> None:
    for parameters in TERMS.values():
        states, controls, crafts = drawn(9, seed=9, **parameters)
        states[4] = State(heading=0.3)
        seen = observe_fleet(columns(states), columns(controls), crafts)
        for i, (state, held, craft) in enumerate(zip(states, controls, crafts, strict=True)):
            assert tuple(seen[2:, i]) == kernel.loads(state, held, craft)
            surge, sway = math.cos(state.heading), math.sin(state.heading)
            forward = surge * state.vx + sway * state.vy
            assert seen[0, i] == pytest.approx(forward, rel=1e-12, abs=1e-14 * math.hypot(state.vx, state.vy))


def test_the_interpreter_goes_on_meanwhile() -> None:
    """A thread counts while another one is in C."""
    running, counted = threading.Event(), 0

    def fly() -> None:
        advance_fleet(np.zeros((6, 8)), Controls(), Craft(), 2000.0, Settings(0.001, METHODS["drag_implicit"]))
        running.clear()

    running.set()
    thread = threading.Thread(target=fly)
    thread.start()
    while running.is_set():
        counted += 1
    thread.join()
    assert counted > 1000


def test_the_cloud_of_ten_thousand(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cloud.main(tmp_path / "cloud.png")
    assert "10000 craft" in capsys.readouterr().out
    assert (tmp_path / "cloud.png").stat().st_size > 20000


def test_the_cloud_is_refused_before_the_fleet_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    monkeypatch.delattr(cloud, "advance_fleet")
    with pytest.raises(ModuleNotFoundError, match=r"pictures need matplotlib.*pip install 'hovercraft-fmu\[plot\]'"):
        cloud.main(tmp_path / "cloud.png")


def test_constants_are_in_the_order_of_the_craft() -> None:
    names = list(Crafts().columns)
    assert [float(Crafts().columns[name]) for name in names] == list(map(float, astuple(Craft())))


@pytest.mark.parametrize(
    ("before", "says"),
    [
        (
            "from hovercraft_fmu.fmu import machine_code as c; c.COMPILED /= 'none'",
            "no machine code: it was never compiled",
        ),
        ("import sys; sys.modules['matplotlib'] = None", "pip install 'hovercraft-fmu[plot]'"),
    ],
)
def test_what_the_cloud_lacks_is_said_in_one_line(before: str, says: str, tmp_path: Path) -> None:
    code = f"{before}; import runpy; runpy.run_module('hovercraft_fmu.examples.cloud', run_name='__main__')"
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout) == (1, "")
    assert says in done.stderr
    assert len(done.stderr.splitlines()) == 1
