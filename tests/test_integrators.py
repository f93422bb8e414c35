"""What is promised of each method: order, exactness, energy, error control."""

import csv
import itertools
import math
import random
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, reject
from hypothesis import strategies as st

import hovercraft_fmu
from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.dynamics import Controls, State, kinetic_energy
from hovercraft_fmu.model.integrators import (
    ADAPTIVE,
    INTEGRATORS,
    MAX_TRIED,
    StepTooSmallError,
    integrator,
    integrator_number,
    semi_implicit_euler,
)
from hovercraft_fmu.model.subcycling import NonFiniteError, Settings, advance
from hovercraft_fmu.scenes import COAST_SPEED, SCENES
from tests.strategies import calm_crafts, controls, crafts, numbers, rubbing_crafts, states
from tests.test_scenes import EXACT, NAMES

NONE = Controls(0.0, 0.0, 0.0)
TABLES = Path(hovercraft_fmu.__file__).parent / "studies" / "results"
FIXED = [method for method in INTEGRATORS if method.integrate]
ORDERS = {"semi_implicit_euler": 1.0, "drag_implicit": 1.0, "rk4": 4.0, "splitting": 2.0}


def method(name: str) -> Any:
    return integrator(integrator_number(name))


@pytest.mark.parametrize("name", ORDERS)
@pytest.mark.parametrize("scene", [each for each in EXACT if each.name != "coast"], ids=lambda each: each.name)
def test_order_is_a_slope(name: str, scene: Any) -> None:
    """On the smooth scenes with an exact solution; coasting has its own test, where drag_implicit is exact."""
    steps = np.array([0.04, 0.02, 0.01, 0.005]) * {"rk4": 12.0, "splitting": 4.0}.get(name, 1.0)  # above rounding
    errors = []
    for h in steps:
        end = advance(scene.start, Controls(*scene.rows[0][1:]), scene.craft, 48.0, Settings(h, method(name))).state
        exact = scene.exact(np.array([48.0]))
        errors.append(max(abs(value - float(part[0])) for value, part in zip(end, exact, strict=True)))
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(ORDERS[name], abs=0.1)
    assert ORDERS[name] == method(name).order


@pytest.mark.parametrize("h", [1e-3, 0.1, 10.0])
def test_drag_implicit_coasts_at_the_exact_speed(h: float) -> None:
    end = advance(State(vx=COAST_SPEED), NONE, Craft(), 60.0, Settings(h, method("drag_implicit"))).state
    assert end.vx == pytest.approx(COAST_SPEED / (1.0 + 0.57421875 * COAST_SPEED * 60.0), rel=1e-11)  # 6e4 roundings


STABLE = pytest.mark.parametrize("name", ["drag_implicit", "splitting"])
"""At any step."""


@STABLE
@pytest.mark.parametrize("h", [0.01, 1.0, 100.0])
def test_the_terminal_speed_stays_exact(name: str, h: float) -> None:
    terminal = math.sqrt(5.0 / Craft().drag_factor)
    start = State(vx=terminal)
    end = advance(start, Controls(5.0, 0.0, 0.0), Craft(), 1000 * h, Settings(h, method(name))).state
    assert end.vx == pytest.approx(terminal, rel=1e-13)


@pytest.mark.parametrize("craft", [Craft(), Craft(drag_area=2, rotational_drag=0.5)], ids=["plain", "every term"])
def test_splitting_is_of_second_order_in_wind_and_in_a_turn(craft: Craft) -> None:
    """Against RK4, whose error is below 1e-9 there; u and w have one sign each, so the directional area is smooth."""
    start, asked = State(vx=1.0, vy=-0.3, yaw_rate=0.2), Controls(8.0, 0.3, 0.0, 0.4, -0.3)
    exact = advance(start, asked, craft, 1.0, Settings(0.001, method("rk4"))).state
    steps = 0.02 * 0.5 ** np.arange(4.0)
    ends = [advance(start, asked, craft, 1.0, Settings(float(h), method("splitting"))).state for h in steps]
    errors = [max(abs(a - b) for a, b in zip(end, exact, strict=True)) for end in ends]
    assert np.polyfit(np.log(steps), np.log(errors), 1)[0] == pytest.approx(2.0, abs=0.05)


def test_splitting_comes_to_the_terminal_speed_from_below_however_long_its_steps() -> None:
    """Without a limit of stability, but not without error: of steps a thousand times too long 400 reach two thirds."""
    craft, terminal = Craft(), math.sqrt(5.0 / Craft().drag_factor)
    h = 1000.0 * craft.mass / (craft.drag_factor * terminal)
    state, speeds = State(), [0.0]
    for _ in range(400):
        state = advance(state, Controls(5.0), craft, h, Settings(h, method("splitting"))).state
        speeds.append(state.vx / terminal)
    assert speeds[1:] == sorted(speeds[1:])
    assert speeds[-1] == pytest.approx(0.66, abs=0.01)


@pytest.mark.parametrize("density", [1e50, 1e100, 1e160, 1e300])
def test_splitting_takes_any_drag(density: float) -> None:
    """h times its rate is 1e52 to 1e302: above 1e154 its square is no number. The middle of a sub-step is in the
    middle of the pose, and each takes off at least four fifths; where that is nearly nothing, all.
    """
    craft = Craft(air_density=density, drag_center_fraction=0.0)
    end = advance(State(vx=1.0, vy=-2.0), NONE, craft, 2.0, Settings(1.0, method("splitting"))).state
    assert (end.heading, end.yaw_rate) == (0.0, 0.0)
    assert 0.0 <= end.vx <= 0.041
    assert -2.0 * end.vx == pytest.approx(end.vy, rel=1e-9, abs=1e-15)
    assert 0.5 <= end.x <= 0.73


def test_splitting_warns_where_drag_and_friction_stop_at_once_what_a_thruster_drives() -> None:
    """The thruster spins it up against a rotational drag 1600 times too steep for the sub-step, in which friction stops
    what that leaves: at the ends of the sub-steps there is no spin to be seen, of sqrt(moment/d) = 1.2 rad/s.
    """
    craft = Craft(
        mass=1322.0, inertia=0.195, length=14.67, air_density=884.0, drag_center_fraction=0.0, steering_force=2.4e5,
        rotational_drag=0.106, skirt_friction=0.127,
    )  # fmt: skip
    split, h = method("splitting"), 2.9e-4
    made = advance(State(vx=0.05), Controls(0.0, 0.426), craft, 16 * h, Settings(h, split))
    steady = math.sqrt(0.426 * craft.thruster_moment / craft.spin_drag_factor)
    assert abs(made.state.yaw_rate) < 1e-3 * steady
    assert made.stability > 100.0 * split.stability_limit


extreme_crafts = st.builds(
    Craft,
    mass=numbers(1e-3, 1e6),
    inertia=numbers(1e-3, 1e6),
    length=numbers(0.1, 100.0),
    width=st.just(10.0),
    height=st.just(5.0),
    drag_coefficient=numbers(0.0, 10.0),
    air_density=numbers(0.0, 1000.0),
    drag_center_fraction=numbers(-0.5, 0.5),
    steering_force=st.just(3.0),
    thrust_min=st.just(0.0),
    thrust_max=st.just(10.0),
)
extreme_states = st.builds(
    State,
    x=st.just(0.0),
    y=st.just(0.0),
    heading=numbers(-1e6, 1e6),
    vx=numbers(-1e6, 1e6),
    vy=numbers(-1e6, 1e6),
    yaw_rate=numbers(-1e4, 1e4),
)


@STABLE
@given(extreme_crafts, extreme_states, numbers(1e-4, 100.0))
def test_coasting_never_adds_energy(name: str, craft: Craft, state: State, h: float) -> None:
    energy = kinetic_energy(state, craft)
    for _ in range(20):
        state = advance(state, NONE, craft, h, Settings(h, method(name))).state
        after = kinetic_energy(state, craft)
        assert after <= energy * (1.0 + 1e-13)  # some hundred roundings a step
        energy = after


def test_two_thousand_coasting_extremes_lose_energy_with_splitting() -> None:
    """With every drag, evenly over powers of ten; 1e-15 a step is what some roundings of the velocities may add."""
    dice = random.Random(7)

    def spread(low: float, high: float) -> float:
        return float(10.0 ** dice.uniform(math.log10(low), math.log10(high)))

    for _ in range(2000):
        craft = Craft(
            mass=spread(1e-3, 1e6), inertia=spread(1e-3, 1e6), length=spread(0.1, 100.0), air_density=spread(1e-3, 1e3),
            drag_center_fraction=dice.uniform(-0.5, 0.5), drag_area=dice.choice((1, 2)),
            rotational_drag=dice.choice((0.0, dice.random())),
        )  # fmt: skip
        course, speed = dice.uniform(0.0, 6.3), spread(1e-3, 1e6)
        state = State(vx=speed * math.cos(course), vy=speed * math.sin(course), yaw_rate=spread(1e-4, 1e4))
        h, energy = spread(1e-4, 100.0), kinetic_energy(state, craft)
        for _ in range(20):
            state = advance(state, NONE, craft, h, Settings(h, method("splitting"))).state
            after = kinetic_energy(state, craft)
            assert after <= energy * (1.0 + 1e-15), (craft, state, h)
            energy = after


@given(crafts, states, controls, numbers(1e-4, 1e-3))
def test_drag_implicit_solves_its_equations(craft: Craft, state: State, asked: Controls, h: float) -> None:
    """Against numpy's solver on the full 3 x 3 system, wind and loads from outside stand on its right side."""
    from hovercraft_fmu.model.dynamics import actuation, load_function

    *_, kq = load_function(asked, craft)(*state[2:])
    ahead = np.array([math.cos(state.heading), math.sin(state.heading)])
    starboard = np.array([-ahead[1], ahead[0]])
    thrust, side, turn = actuation(asked, craft)
    # velocity of the drag point = J (vx, vy, yaw rate)
    point = np.column_stack([np.eye(2), craft.drag_center * starboard])
    inertia = np.diag([craft.mass, craft.mass, craft.inertia])
    spin = np.diag([0.0, 0.0, craft.spin_drag_factor * abs(state.yaw_rate)])
    push = np.append(thrust * ahead + side * starboard, turn) + asked[5:]
    drag = kq * point.T @ point
    wind = np.array([asked.wind_x, asked.wind_y, 0.0])
    right = inertia @ np.array(state[3:]) + h * push + h * drag @ wind
    expected = np.linalg.solve(inertia + h * drag + h * spin, right)
    end = advance(state, asked, craft, h, Settings(h, method("drag_implicit"))).state
    scale = np.abs([*state[3:], *wind]).max() + h * np.abs(push).max() / min(craft.mass, craft.inertia)
    assert end[3:] == pytest.approx(expected, rel=0.0, abs=1e-9 * scale)  # the condition of the system is up to 1e6


def test_the_limits_of_the_warnings_are_those_that_were_measured() -> None:
    """As `hovercraft-fmu measure stability` wrote them, of each method with a fixed step."""
    with (TABLES / "warnings.csv").open(encoding="utf-8") as file:
        rows = {row["method"]: row for row in csv.DictReader(file)}
    assert rows.keys() == {each.name for each in FIXED} == {each.name for each in INTEGRATORS} - {"adaptive"}
    for each in FIXED:
        limits = [float(rows[each.name][name]) for name in ("stability_limit", "rotation_limit")]
        assert limits == [each.stability_limit, each.rotation_limit]
    assert method("adaptive") is ADAPTIVE


@pytest.mark.parametrize("scene", EXACT, ids=NAMES)
def test_the_error_of_adaptive_falls_with_its_tolerance(scene: Any) -> None:
    """Over six decades, and never above a hundred times the tolerance at the end of a minute."""
    tolerances, errors = 10.0 ** -np.arange(3.0, 9.5, 1.0), []
    exact = scene.exact(np.array([60.0]))
    for tolerance in tolerances:
        settings = Settings(0.01, method("adaptive"), float(tolerance))
        end = advance(scene.start, Controls(*scene.rows[0][1:]), scene.craft, 60.0, settings).state
        errors.append(max(abs(value - float(part[0])) for value, part in zip(end, exact, strict=True)))
    assert all(error <= 100.0 * tolerance for error, tolerance in zip(errors, tolerances, strict=True))
    assert errors[-1] <= 1e-4 * errors[0]
    assert np.polyfit(np.log(tolerances), np.log(errors), 1)[0] == pytest.approx(1.0, abs=0.3)


def test_a_step_of_adaptive_errs_by_one_order_more_than_a_run() -> None:
    scene = next(each for each in EXACT if each.name == "cycloid")
    assert scene.exact
    errors = []
    for h in (1.0, 0.5):
        how = Settings(h, method("adaptive"), 1e3)
        made = advance(scene.start, Controls(*scene.rows[0][1:]), scene.craft, h, how)
        assert made.substeps == 1
        pairs = zip(made.state, scene.exact(np.array([h])), strict=True)
        errors.append(max(abs(value - float(part[0])) for value, part in pairs))
    assert math.log2(errors[0] / errors[1]) == pytest.approx(method("adaptive").order + 1, abs=0.1)


def test_adaptive_does_not_depend_on_where_the_craft_is() -> None:
    ends = []
    for x in (0.0, 2.0**20):  # a power of two, so that the far craft's position has its bits, too
        settings = Settings(0.01, method("adaptive"), 1e-6)
        stretch = advance(State(x=x, vx=1.0), Controls(5.0, 1.0, 0.0), Craft(), 30.0, settings)
        ends.append((stretch.substeps, stretch.proposed, stretch.state[2:]))
    assert ends[0] == ends[1]


@given(st.lists(numbers(1e-13, 5.0), min_size=1, max_size=20))
def test_adaptive_ends_exactly_on_time(steps: list[float]) -> None:
    state, proposed = State(vx=1.0), 0.0
    settings = Settings(0.01, method("adaptive"))
    for step in steps:
        state, _, _, _, proposed = advance(state, NONE, Craft(drag_coefficient=0.0), step, settings, proposed=proposed)
    assert state.x == pytest.approx(math.fsum(steps), rel=1e-13)


def test_adaptive_sees_every_turn_of_a_spin() -> None:
    """90 turns a second and a first step of 1 s: every stage finds the heading of the start, but for whole turns."""
    w, thrust, craft = 2.0 * math.pi * 90.0, 5.0, Craft(drag_coefficient=0.0)
    made = advance(State(yaw_rate=w), Controls(thrust), craft, 2.0, Settings(1.0, method("adaptive")))
    assert made.rotation <= 1.0
    exact = thrust / (craft.mass * w) * 2.0  # m: abeam; along the thrust it has come back
    assert made.state[:2] == pytest.approx((0.0, exact), abs=1e-4)


def test_adaptive_turns_no_further_where_a_push_begins_to_turn_it() -> None:
    """From rest the first step knows nothing of the turn; 1.5 rad/s2 over 20 s lead to 300 rad."""
    craft = Craft(drag_coefficient=0.0, inertia=20.0)
    made = advance(State(), Controls(5.0, 1.0, 0.0), craft, 20.0, Settings(20.0, method("adaptive"), 1e3))
    assert made.state.heading == pytest.approx(300.0, rel=1e-12)
    assert made.substeps >= 300


def test_right_after_a_refused_step_adaptive_does_not_take_a_longer_one(monkeypatch: pytest.MonkeyPatch) -> None:
    from hovercraft_fmu.model import integrators

    tried: list[tuple[float, bool]] = []
    one_step = integrators._dormand_prince

    def seen(y: Any, first: Any, h: float, rates_at: Any) -> Any:
        made = one_step(y, first, h, rates_at)
        tried.append((h, made[2] <= 1e-6))
        return made

    monkeypatch.setattr(integrators, "_dormand_prince", seen)
    for course in np.linspace(0.0, 6.0, 20):  # where the drag point comes through rest
        start = State(vx=math.cos(course), vy=math.sin(course), yaw_rate=0.2)
        begun = len(tried)
        made = advance(start, Controls(0.0), Craft(), 20.0, Settings(5.0, method("adaptive")))
        assert made.substeps == len(tried) - begun  # what is refused costs as much, and is counted
    after = [(b[0], c[0]) for a, b, c in zip(tried, tried[1:], tried[2:], strict=False) if not a[1] and b[1] and c[1]]
    assert len(after) > 20
    assert all(longer <= h for h, longer in after)


def test_adaptive_that_finds_no_end_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """A thruster, no drag, a day: 5184 rad/s in the end, and 2e8 rad; of 10^8 steps a test has time for a thousand."""
    assert MAX_TRIED == 10**8  # which the message says
    monkeypatch.setattr("hovercraft_fmu.model.integrators.MAX_TRIED", 1000)
    with pytest.raises(
        ValueError, match=r"86400.0 s: must not need more than 10\^8 sub-steps to meet tolerance = 1e-06"
    ):
        advance(State(), Controls(0.0, 1.0), Craft(drag_coefficient=0.0), 86400.0, Settings(1.0, method("adaptive")))


def test_a_run_that_is_not_finite_ends_before_all_its_substeps() -> None:
    taken: list[int] = []

    def counting(*arguments: Any) -> Any:
        taken.append(arguments[-1])
        return semi_implicit_euler(*arguments)._replace(state=State(vx=math.nan))

    with pytest.raises(NonFiniteError, match="vx = nan"):
        advance(State(), NONE, Craft(), 1e6, Settings(0.001, INTEGRATORS[0]._replace(integrate=counting)))
    assert sum(taken) < 10**5 < 10**9


def test_long_runs_are_not_changed_by_looking_whether_they_are_finite() -> None:
    """Two hundred thousand sub-steps in one communication step, and in twenty."""
    state, way = State(vx=0.2, yaw_rate=0.1), Settings(0.001)
    whole = advance(state, Controls(8.0, 0.5), Craft(), 200.0, way)
    stability = 0.0
    for _ in range(20):
        part = advance(state, Controls(8.0, 0.5), Craft(), 10.0, way)
        state, stability = part.state, max(stability, part.stability)
    assert (whole.state, whole.substeps, whole.stability) == (state, 200_000, stability)


def test_adaptive_says_where_it_cannot_go_on() -> None:
    hard = Craft(mass=1e-3, inertia=1e-3, air_density=1000.0)
    with pytest.raises(StepTooSmallError, match=r"below 1e-12 s, .* to meet tolerance = 1e-14; set a larger"):
        advance(State(vx=1e6), NONE, hard, 1.0, Settings(1e-3, method("adaptive"), 1e-14))


def test_adaptive_does_not_follow_a_spin_that_turns_by_a_radian_within_its_least_step() -> None:
    with pytest.raises(StepTooSmallError, match=r"step = 9\S+e-14 s: must not fall below 1e-12 s"):
        advance(State(yaw_rate=1e13), NONE, Craft(drag_coefficient=0.0), 1.0, Settings(1e-3, method("adaptive")))


@pytest.mark.parametrize("each", INTEGRATORS, ids=lambda each: each.name)
def test_what_is_watched(each: Any) -> None:
    """Coasting slows down, so the largest number is that of the first sub-step; the spin is without drag."""
    craft = Craft(drag_center_fraction=0.0)
    stretch = advance(State(vx=1.0), NONE, craft, 0.5, Settings(0.05, each))
    if each.integrate:
        assert stretch.stability == pytest.approx(0.05 * 2.0 * craft.drag_factor / craft.mass)
    spin = advance(State(yaw_rate=-3.0), NONE, Craft(drag_coefficient=0.0), 0.5, Settings(0.05, each))
    assert spin.rotation == pytest.approx(0.15) if each.integrate else spin.rotation <= 1.5


@pytest.mark.parametrize("each", FIXED, ids=lambda each: each.name)
@given(craft=st.one_of(calm_crafts, rubbing_crafts), state=states, asked=controls)
def test_what_is_watched_does_not_depend_on_how_the_time_is_cut(
    each: Any, craft: Craft, state: State, asked: Controls
) -> None:
    """Of the sub-steps it is the largest: maxima of different ones are not put together."""
    way = Settings(0.001, each)
    try:
        whole = advance(state, asked, craft, 0.04, way)
    except NonFiniteError:
        reject()  # so light a craft, so fast, that the sub-step is too long for it
    parts = [whole._replace(state=state)]
    for _ in range(40):
        parts.append(advance(parts[-1].state, asked, craft, 0.001, way))
    assert parts[-1].state == whole.state
    assert max(part.stability for part in parts[1:]) == whole.stability
    assert max(part.rotation for part in parts[1:]) == whole.rotation


def test_the_fastest_drag_of_a_spin_that_speeds_up() -> None:
    """The spin dies down while the speed grows: the number is that of one sub-step, from the formula by hand."""
    craft = Craft(drag_center_fraction=0.0, rotational_drag=1.0)
    state, rates = State(yaw_rate=2.0), []
    for _ in range(41):
        drag = 0.5 * 1.225 * 75.0 * 1.25 * state.vx
        spin = 1.225 * 1.25 * 5.0 * 20.0**4 / 64.0
        rates.append(2.0 * drag / 100.0 + 2.0 * spin * abs(state.yaw_rate) / 500.0)
        state = advance(state, Controls(thrust=10.0), craft, 0.001, Settings(0.001)).state
    made = advance(State(yaw_rate=2.0), Controls(thrust=10.0), craft, 0.04, Settings(0.001))
    assert made.stability == pytest.approx(0.001 * max(rates), rel=1e-12)


def test_rk4_beats_both_first_order_methods() -> None:
    """At equal steps on the pulses of `turn`, against RK4 at a hundredth of the step."""
    turn = SCENES["turn"]

    def end(name: str, h: float) -> State:
        state = turn.start
        held = {row[0]: Controls(*row[1:]) for row in turn.rows}  # of two rows at one time, the second
        for start, stop in itertools.pairwise(sorted(held)):
            state = advance(state, held[start], turn.craft, stop - start, Settings(h, method(name))).state
        return state

    reference = end("rk4", 0.001)
    errors = {name: math.dist(end(name, 0.1)[:2], reference[:2]) for name in ORDERS}
    assert errors["rk4"] < 1e-3 * min(errors["drag_implicit"], errors["semi_implicit_euler"])
