"""The C kernel against the Python model: equal with this platform's libm, close with the sine and cosine that ship."""

import itertools
import math
import random
import sys
from ctypes import CDLL, byref, c_double
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hovercraft_fmu.fmu.machine_code import c_file
from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.dynamics import Controls, State, load_function, loads, saturate
from hovercraft_fmu.model.error_estimate import Companion, accompany, estimated_error
from hovercraft_fmu.model.integrators import INTEGRATORS, Integrator, StepTooSmallError, Stretch
from hovercraft_fmu.model.subcycling import NonFiniteError, Settings, advance, substeps, too_strong
from hovercraft_fmu.simulation import held_steps, plan
from tests.native import C_TESTS, SCENES_AND_METHODS, STEPS, Kernel, Text, compile_c
from tests.strategies import calm_crafts, controls, crafts, numbers, states

KERNEL, TRIG, LOGARITHM = (c_file(f"{name}.c") for name in ("kernel", "trig", "logarithm"))
ROUNDING = C_TESTS / "rounding_of.c"
SHARED = ("-shared", "-fPIC", "-lm")
METHODS = {method.name: method for method in INTEGRATORS}


@pytest.fixture(scope="module")
def libm(tmp_path_factory: pytest.TempPathFactory) -> Kernel:
    """With this platform's sine and cosine, which are Python's."""
    folder = tmp_path_factory.mktemp("libm")
    return Kernel(compile_c(folder / "kernel.so", [KERNEL, ROUNDING], "-DHOVERCRAFT_LIBM", *SHARED))


@pytest.fixture(scope="module")
def shipped(tmp_path_factory: pytest.TempPathFactory) -> Kernel:
    """With those of the FMU."""
    return Kernel(
        compile_c(
            tmp_path_factory.mktemp("shipped") / "kernel.so",
            [KERNEL, TRIG, LOGARITHM, ROUNDING, C_TESTS / "trig_of.c"],
            *SHARED,
        )
    )


@pytest.fixture(scope="module")
def text(tmp_path_factory: pytest.TempPathFactory) -> Text:
    files = [c_file("text.c"), C_TESTS / "text_of.c"]
    return Text(compile_c(tmp_path_factory.mktemp("text") / "text.so", files, "-shared", "-fPIC"))


def _of_python(
    state: State, held: Controls, craft: Craft, step: float, how: Settings, proposed: float = 0.0
) -> tuple[str, Stretch | None]:
    try:
        return "advanced", advance(state, held, craft, step, how, proposed=proposed)
    except NonFiniteError:
        return "not finite", None
    except StepTooSmallError:
        return "step too small", None
    except ValueError:
        return "too many sub-steps", None


def _assert_close(found: Stretch, expected: Stretch) -> None:
    assert found.substeps == expected.substeps
    for value, wanted in zip(found.state, expected.state, strict=True):
        assert abs(value - wanted) <= 1e-12 * max(1.0, abs(wanted))


@pytest.mark.parametrize(("name", "method"), SCENES_AND_METHODS)
def test_every_scene_and_method(name: str, method: str, libm: Kernel, shipped: Kernel) -> None:
    """Every communication step of a run is equal, and with the shipped sine and cosine its end is close. Every method
    in one plain scene and in those with a term, and one of them in each of the others.
    """
    run = plan(name, start_values={"integrator": method, "step_size": STEPS[method]})
    craft, how = run.craft, run.settings
    state = python = run.start
    proposed = python_proposed = other = 0.0
    near = run.start
    for time, end, held in held_steps(run):
        expected = advance(python, held, craft, end - time, how, proposed=python_proposed)
        outcome, made = libm.advance(state, held, craft, end - time, how, proposed)
        assert (outcome, made) == ("advanced", expected)
        python, python_proposed = expected.state, expected.proposed
        state, proposed = made.state, made.proposed
        outcome, made = shipped.advance(near, held, craft, end - time, how, other)
        near, other = made.state, made.proposed
    for value, wanted in zip(near, python, strict=True):
        assert abs(value - wanted) <= 1e-12 * max(1.0, abs(wanted))


AT_OR_NEAR_REST = st.one_of(st.just(0.0), numbers(-1e-2, 1e-2))
RUBBING = st.builds(
    Craft,
    skirt_friction=numbers(1e-6, 0.01),
    drag_area=st.sampled_from([1, 2]),
    rotational_drag=st.sampled_from([0.0, 0.5]),
    air_density=st.sampled_from([0.0, 1.225]),
)
SLOW = st.builds(State, x=numbers(-1e3, 1e3), y=numbers(-1e3, 1e3), heading=numbers(-4.0, 4.0), vx=AT_OR_NEAR_REST,
                 vy=AT_OR_NEAR_REST, yaw_rate=AT_OR_NEAR_REST)  # fmt: skip
"""Where friction holds, or lets go, or stops a craft within a step."""
CRAFT_AND_STATE = st.one_of(st.tuples(crafts, states), st.tuples(calm_crafts, states), st.tuples(RUBBING, SLOW))


@settings(max_examples=300)
@given(
    craft_and_state=CRAFT_AND_STATE,
    held=controls,
    method=st.sampled_from(INTEGRATORS),
    step=st.one_of(numbers(1e-6, 0.2), st.sampled_from([0.01, 0.009999999999999787, 0.1, 1.0, 1e-13])),
    step_size=st.sampled_from([0.001, 0.01, 0.1, 0.0005, 0.3]),
    tolerance=st.sampled_from([1e-3, 1e-6, 1e-9]),
    proposed=st.sampled_from([0.0, 0.004, 10.0]),
)
def test_random_craft_states_controls_and_steps(
    craft_and_state: tuple[Craft, State],
    held: Controls,
    method: object,
    step: float,
    step_size: float,
    tolerance: float,
    proposed: float,
    libm: Kernel,
) -> None:
    craft, state = craft_and_state
    how = Settings(step_size, method, tolerance)  # type: ignore[arg-type]
    outcome, expected = _of_python(state, held, craft, step, how, proposed=proposed)
    found, made = libm.advance(state, held, craft, step, how, proposed)
    assert found == outcome
    assert expected is None or made == expected


@settings(max_examples=200)
@given(
    craft_and_state=CRAFT_AND_STATE,
    held=controls,
    method=st.sampled_from(INTEGRATORS),
    step=st.one_of(numbers(1e-6, 0.2), st.sampled_from([0.01, 0.009999999999999787, 0.1])),
    step_size=st.sampled_from([0.001, 0.01, 0.1, 0.3]),
    proposed=st.sampled_from([0.0, 0.004]),
)
def test_the_companion_of_random_craft(
    craft_and_state: tuple[Craft, State],
    held: Controls,
    method: Integrator,
    step: float,
    step_size: float,
    proposed: float,
    libm: Kernel,
) -> None:
    craft, state = craft_and_state
    how = Settings(step_size, method, 1e-4)
    found = libm.accompany(Companion(state, proposed), held, craft, step, how, substeps(step, step_size))
    expected = accompany(Companion(state, proposed), held, craft, step, how)
    assert repr(found) == repr(expected)  # NaN where it is lost
    assert libm.estimated_error(state, found, craft, method) == estimated_error(state, found, craft, method)


@settings(max_examples=100)
@given(craft=calm_crafts, state=states, held=controls, method=st.sampled_from(INTEGRATORS), step=numbers(1e-4, 0.1))
def test_shipped_sine_and_cosine_are_close(
    craft: Craft, state: State, held: Controls, method: object, step: float, shipped: Kernel
) -> None:
    """Of the bits, a few of the last differ: on stable runs that stays so."""
    how = Settings(0.001, method, 1e-3)  # type: ignore[arg-type]
    outcome, made = shipped.advance(state, held, craft, step, how)
    assert outcome == "advanced"
    _assert_close(made, advance(state, held, craft, step, how))


@given(craft_and_state=CRAFT_AND_STATE, held=controls)
def test_loads(craft_and_state: tuple[Craft, State], held: Controls, libm: Kernel) -> None:
    craft, state = craft_and_state
    expected = (*loads(state, held, craft), load_function(held, craft)(*state[2:])[3])
    assert libm.loads(state, held, craft) == expected


HELD = Craft(mass=1.0, inertia=1e60, drag_coefficient=0.0, skirt_friction=1.0, gravity=1000.0, thrust_max=0.0)
"""It loses 1 m/s a millisecond, and its spin next to nothing."""
EXTREMES = {
    "overflow of the drag": (State(vx=1e150), Craft(), 0.1),
    "overflow of the position": (State(x=1.7e308, vx=1.7e308), Craft(drag_coefficient=0.0), 1.0),
    "overflow of the heading": (State(heading=1.7e308, yaw_rate=1.7e308), Craft(drag_coefficient=0.0), 1.0),
    "density without end": (State(vx=1.0), Craft(air_density=1e300, drag_coefficient=100.0), 0.1),
    "too many sub-steps": (State(), Craft(), 1e7),
    "a huge heading": (State(heading=-1e200, vx=1.0, yaw_rate=1.0), Craft(), 0.1),
    "the end of the world": (State(x=1.7e308, y=1.7e308), Craft(), 0.1),
    "a spin too fast to follow": (State(yaw_rate=1e13), Craft(drag_coefficient=0.0), 0.1),
    "turned beyond all numbers": (State(), Craft(inertia=1e-300, drag_center_fraction=0.0), 0.1),
    "turned beyond all numbers, from rest on ground that rubs": (
        State(heading=sys.float_info.max), Craft(skirt_friction=0.01, drag_coefficient=0.0), 0.1,
    ),
    "masses whose product is no number": (
        State(vx=1.0, yaw_rate=1.0), Craft(mass=1e-200, inertia=1e-200, drag_coefficient=0.0), 0.01,
    ),
    "friction that takes all but the last bit": (State(vx=math.nextafter(1.0, 0.0), yaw_rate=1e-31), HELD, 0.001),
}  # fmt: skip


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("name", EXTREMES)
def test_extremes_end_in_the_same_way(name: str, method: str, libm: Kernel) -> None:
    if name == "too many sub-steps" and method == "adaptive":
        return  # it has no limit, and no sub-steps that would be cut
    state, craft, step = EXTREMES[name]
    how, held = Settings(0.001, METHODS[method]), Controls(external_moment=1e308 if name.startswith("turned") else 0.0)
    outcome, expected = _of_python(state, held, craft, step, how)
    found, made = libm.advance(state, held, craft, step, how)
    assert found == outcome
    assert expected is None or made == expected


@pytest.mark.parametrize("method", METHODS)
def test_a_companion_that_cannot_go_on_is_lost_in_the_same_way(method: str, libm: Kernel) -> None:
    spinning, craft = Companion(State(heading=1.7e308, yaw_rate=1.7e308)), Craft(drag_coefficient=0.0)
    how = Settings(1.0, METHODS[method])
    found = libm.accompany(spinning, Controls(), craft, 3.0, how, substeps(3.0, 1.0))
    assert math.isnan(found.state.x)
    assert repr(found) == repr(accompany(spinning, Controls(), craft, 3.0, how))
    assert repr(libm.accompany(found, Controls(), craft, 3.0, how, substeps(3.0, 1.0))) == repr(found)


@pytest.mark.parametrize("friction", [0.0, 0.001])
@pytest.mark.parametrize("method", [name for name in METHODS if name != "adaptive"])
def test_a_long_step_is_two_shorter_ones(method: str, friction: float, libm: Kernel) -> None:
    """To the bit, where both have more sub-steps than are made before the motion is looked at, 65 536."""
    craft, h = Craft(skirt_friction=friction, rotational_drag=0.1), 2.0**-10
    start, held, how = State(vx=1.0, yaw_rate=0.1), Controls(9.0, 0.3, 0.1, 0.2), Settings(h, METHODS[method])
    outcome, whole = libm.advance(start, held, craft, 150_000 * h, how)
    _, first = libm.advance(start, held, craft, 70_000 * h, how)
    _, second = libm.advance(first.state, held, craft, 80_000 * h, how)
    assert (outcome, whole.substeps) == ("advanced", 150_000)
    assert whole.state == second.state
    assert whole.stability == max(first.stability, second.stability)
    assert whole.rotation == max(first.rotation, second.rotation)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("name", ["wind_x", "wind_y", "external_force_x", "external_force_y", "external_moment"])
def test_an_input_is_too_strong_from_one_speed_on(name: str, sign: float, libm: Kernel) -> None:
    """Where a step of 1e-12 s is as long as drag takes, 1/(2 k q (1/m + x_d^2/I)); a force leads to q = sqrt(F/k)."""
    k = 0.5 * 1.225 * 1.25 * 75.0
    q = 1.0 / (1e-12 * k * 2.0 * (1.0 / 100.0 + 25.0 / 500.0))
    limit = q if name.startswith("wind") else k * q * q * (20.0 if name == "external_moment" else 1.0)
    for strong, expected in ((0.999, None), (1.001, name)):
        held = Controls()._replace(**{name: sign * strong * limit})
        assert [rule(held, Craft()) for rule in (too_strong, libm.too_strong)] == [expected] * 2


# ---- ramps, which the Python model does not have


RAMP = Controls(1.5, 0.2, -0.1, 0.3, -0.2, -1.0, 2.0, 20.0)
START = Controls(9.0, 0.1, 0.6, -0.1, 0.2, 0.0, -3.0, -40.0)


@pytest.mark.parametrize(
    ("method", "when"), [("semi_implicit_euler", 0.0), ("drag_implicit", 0.0), ("splitting", 0.5 * 0.001)]
)
def test_lower_methods_take_a_ramp_at_one_time_in_each_substep(method: str, when: float, libm: Kernel) -> None:
    """As if the controls were set anew, and held, sub-step by sub-step; thrust meets its limit on the way."""
    how = Settings(0.001, METHODS[method])
    state = State(vx=0.3, yaw_rate=0.05)
    outcome, made = libm.advance(state, START, Craft(), 2.0, how, rate=RAMP)
    assert outcome == "advanced"
    for i in range(2000):
        t = i * 0.001 + when
        held = Controls(*(start + t * rate for start, rate in zip(START, RAMP, strict=True)))
        state = advance(state, held, Craft(), 0.001, how).state
    assert made.state == state


@pytest.mark.parametrize("method", ["rk4", "adaptive"])
def test_higher_methods_are_exact_on_a_ramp_of_thrust(method: str, libm: Kernel) -> None:
    """Without drag the velocity is the integral of the ramp, (T t + a t^2/2)/m, the position a cubic."""
    craft = Craft(drag_coefficient=0.0)
    how = Settings(0.5, METHODS[method])
    outcome, made = libm.advance(State(), Controls(1.0, 0.0, 0.0), craft, 4.0, how, rate=Controls(2.0))
    assert outcome == "advanced"
    assert made.state.vx == pytest.approx((1.0 * 4.0 + 2.0 * 8.0) / 100.0, rel=1e-14)
    assert made.state.x == pytest.approx((0.5 * 16.0 + 2.0 * 64.0 / 6.0) / 100.0, rel=1e-14)


def test_rk4_keeps_its_order_on_ramps(libm: Kernel) -> None:
    """The slope of the error against the step; the ramps stay inside their limits."""
    rates = Controls(1.0, 0.2, -0.1, 0.02, -0.01, -1.0, 2.0, 20.0)
    held = Controls(2.0, 0.1, 0.5, 0.05, 0.1, 0.0, -3.0, -40.0)
    start = State(vx=0.3, vy=-0.1, yaw_rate=0.1)

    def end(h: float) -> NDArray[np.float64]:
        outcome, made = libm.advance(start, held, Craft(), 4.0, Settings(h, METHODS["rk4"]), rate=rates)
        assert outcome == "advanced"
        return np.array(made.state)

    best = end(0.001)
    errors = [np.abs(end(h) - best).max() for h in (0.02, 0.01)]
    assert math.log2(errors[0] / errors[1]) == pytest.approx(4.0, abs=0.1)


@pytest.mark.parametrize("method", METHODS)
def test_a_wind_that_rises_abeam_is_one_from_ahead_turned(method: str, libm: Kernel) -> None:
    """By a quarter, and the craft with it; the air is calm at first."""
    craft, how = Craft(rotational_drag=0.1), Settings(0.01, METHODS[method])
    _, ahead = libm.advance(State(), Controls(5.0, 0.4), craft, 4.0, how, rate=Controls(0.0, wind_x=-0.3))
    turned = State(heading=math.pi / 2.0)
    outcome, abeam = libm.advance(turned, Controls(5.0, 0.4), craft, 4.0, how, rate=Controls(0.0, wind_y=-0.3))
    x, y, heading, vx, vy, yaw_rate = ahead.state
    assert outcome == "advanced"
    assert tuple(abeam.state) == pytest.approx((-y, x, heading + math.pi / 2.0, -vy, vx, yaw_rate), rel=1e-9, abs=1e-12)
    assert abs(vx) > 0.01


@pytest.mark.parametrize("method", METHODS)
def test_a_ramp_saturates_and_stays_there(method: str, libm: Kernel) -> None:
    """Thrust meets its limit after 1 s; after that all is as with the limit held."""
    craft = Craft(drag_coefficient=0.0)
    how = Settings(0.001, METHODS[method], 1e-9)
    outcome, made = libm.advance(State(), Controls(8.0, 0.0, 0.0), craft, 5.0, how, rate=Controls(2.0))
    assert outcome == "advanced"
    assert made.state.vx == pytest.approx((8.0 + 1.0 + 4 * 10.0) / 100.0, abs=2e-5)
    assert saturate(Controls(18.0, 0.0, 0.0), craft).thrust == 10.0


def test_a_step_of_adaptive_ends_where_a_ramp_saturates(libm: Kernel) -> None:
    """So each is smooth: without drag the fifth order is exact, whatever the tolerance. All three inputs, both ways."""
    craft, start, rate = Craft(drag_coefficient=0.0), Controls(9.0, 0.3, 0.9), Controls(0.7, -0.2, 0.05)
    outcome, made = libm.advance(State(), start, craft, 10.0, Settings(20.0, METHODS["adaptive"], 1e3), rate=rate)
    port, starboard = 0.3 * 0.3 / (2.0 * 0.2), 10.0 - 0.5 * 0.1 * 0.1 / 0.05  # command times s; in limits 0 and 1
    assert outcome == "advanced"
    assert made.substeps >= 4
    assert made.state.yaw_rate == pytest.approx(30.0 / 500.0 * (port - starboard), rel=1e-12)


def test_a_step_of_adaptive_ends_nowhere_else(libm: Kernel) -> None:
    """Where thrust turns round it meets no limit: a sub-step as long as it may be goes on."""
    craft, how = Craft(thrust_min=-10.0), Settings(20.0, METHODS["adaptive"], 1e3)
    ways = [libm.advance(State(), Controls(thrust), craft, 10.0, how, rate=Controls(0.7)) for thrust in (-3.0, 2.0)]
    assert [(outcome, made.substeps) for outcome, made in ways] == [("advanced", 1)] * 2


def test_adaptive_that_finds_no_end_is_stopped(tmp_path: Path, libm: Kernel) -> None:
    """In C as in Python, where the limit is a thousand steps."""
    few = Kernel(
        compile_c(tmp_path / "few.so", [KERNEL, ROUNDING], "-DHOVERCRAFT_LIBM", "-DHOVERCRAFT_MAX_TRIED=1000", *SHARED)
    )
    craft, way = Craft(drag_coefficient=0.0), Settings(1.0, METHODS["adaptive"])
    for duration, outcome in ((86400.0, "too many sub-steps"), (60.0, "advanced")):
        assert few.advance(State(), Controls(0.0, 1.0), craft, duration, way)[0] == outcome
    assert libm.advance(State(), Controls(0.0, 1.0), craft, 600.0, way)[0] == "advanced"


def test_adaptive_does_not_go_beyond_all_numbers_near_rest(libm: Kernel) -> None:
    """On ground that hardly rubs, with a tolerance that takes any speed for rest: a refused step leaves no infinity."""
    craft, how = Craft(skirt_friction=1e-290, drag_coefficient=0.0), Settings(1e140, METHODS["adaptive"], 1e300)
    state = State(x=sys.float_info.max, vx=1e153)
    outcome, expected = _of_python(state, Controls(), craft, 1e140, how)
    found, made = libm.advance(state, Controls(), craft, 1e140, how)
    assert (found, made) == (outcome, expected)
    assert all(map(math.isfinite, made.state))


def test_a_run_that_is_not_finite_ends_at_once(libm: Kernel) -> None:
    """Of 10^9 sub-steps, which would take half a minute, the first 65 536."""
    hot = Craft(mass=1e-3, inertia=1e-3, air_density=1000.0)
    for method in ("semi_implicit_euler", "rk4"):
        outcome, made = libm.advance(State(vx=1e3), Controls(0.0), hot, 1e9, Settings(1.0, METHODS[method]))
        assert outcome == "not finite"
        assert math.isnan(made.state.vx)
    pushed = Controls(0.0, external_force_x=1e308)
    for craft in (Craft(drag_coefficient=0.0), Craft(drag_coefficient=0.0, skirt_friction=0.1)):
        for method in METHODS.keys() - {"adaptive"}:
            assert libm.advance(State(), pushed, craft, 1e9, Settings(1.0, METHODS[method]))[0] == "not finite"


def test_the_arctangent_of_any_vector(tmp_path: Path) -> None:
    """As libm's, within one unit in the last place and with its signs: zeros, infinities, no numbers, all quadrants."""
    angle_of: Any = CDLL(str(compile_c(tmp_path / "angle.so", [c_file("arctangent.c")], *SHARED))).angle_of
    angle_of.restype, angle_of.argtypes = c_double, (c_double, c_double)
    sizes = [0.0, 5e-324, 1e-300, 1e-9, 0.4, 0.6, 1.0, 1.5, 2.5, 1e9, 1e300, math.inf]
    numbers = [*sizes, *(-size for size in sizes)]
    for y, x in itertools.product(numbers, numbers):
        found, expected = angle_of(y, x), math.atan2(y, x)
        assert abs(found - expected) <= math.ulp(expected), (y, x)
        assert math.copysign(1.0, found) == math.copysign(1.0, expected), (y, x)
    assert all(math.isnan(angle_of(*pair)) for pair in ((math.nan, 1.0), (1.0, math.nan)))


# ---- sine and cosine


def _sine_cosine(kernel: Kernel, angle: float) -> tuple[float, float]:
    sine, cosine = c_double(), c_double()
    kernel.library.trig_alone(c_double(angle), byref(sine), byref(cosine))
    return sine.value, cosine.value


def test_sine_and_cosine_of_any_angle(shipped: Kernel) -> None:
    """Within one unit in the last place of 1 of libm's: small, a few turns, millions of radians, any size."""
    dice = random.Random(1)
    angles = [k * math.pi / 4 + shift for k in range(-400, 400) for shift in (0.0, 1e-9, -1e-9)]
    angles += [dice.uniform(-1.0, 1.0) * 10.0**power for power in range(-320, 309) for _ in range(50)]
    angles += [2.0**power for power in range(-1074, 1024)] + [k * math.pi / 2 for k in range(1 << 20, (1 << 20) + 99)]
    for angle in angles:
        sine, cosine = _sine_cosine(shipped, angle)
        assert abs(sine - math.sin(angle)) <= 2.3e-16 * min(1.0, 2.0 * abs(math.sin(angle)) + 1e-300), angle
        assert abs(cosine - math.cos(angle)) <= 2.3e-16 * min(1.0, 2.0 * abs(math.cos(angle)) + 1e-300), angle


def test_the_hardest_angle(shipped: Kernel) -> None:
    """The double nearest to a multiple of pi/2 (Muller, Elementary Functions, table of worst cases)."""
    assert _sine_cosine(shipped, 6381956970095103.0 * 2.0**797) == (1.0, -4.6871659242546276e-19)


def test_sine_and_cosine_at_the_ends(shipped: Kernel) -> None:
    assert _sine_cosine(shipped, -0.0) == (0.0, 1.0)
    for angle in (math.inf, -math.inf, math.nan):
        assert all(math.isnan(value) for value in _sine_cosine(shipped, angle))


@given(before=st.one_of(numbers(-50.0, 50.0), st.floats()), angle=st.one_of(numbers(-50.0, 50.0), st.floats()))
def test_the_angle_before_changes_no_bit(before: float, angle: float, shipped: Kernel) -> None:
    """What is kept from one angle to the next is a short cut only."""
    sine, cosine = c_double(), c_double()
    shipped.library.trig_after(c_double(before), c_double(angle), byref(sine), byref(cosine))
    expected = _sine_cosine(shipped, angle)
    assert (sine.value, cosine.value) == expected or all(math.isnan(value) for value in (sine.value, *expected))


@given(angle=st.floats(allow_nan=False, allow_infinity=False))
def test_sine_is_odd_and_cosine_even(angle: float, shipped: Kernel) -> None:
    sine, cosine = _sine_cosine(shipped, angle)
    assert _sine_cosine(shipped, -angle) == (-sine, cosine)


def test_the_logarithm(shipped: Kernel) -> None:
    """Within one unit in the last place of libm's."""
    shipped.library.logarithm_of.restype = c_double
    dice = random.Random(2)
    numbers_ = [2.0**power for power in range(-1074, 1024)]
    numbers_ += [dice.uniform(0.5, 2.0) for _ in range(5000)]
    numbers_ += [dice.uniform(1.0, 10.0) * 10.0**power for power in range(-307, 308) for _ in range(10)]
    for x in numbers_:
        found, expected = shipped.library.logarithm_of(c_double(x)), math.log(x)
        assert abs(found - expected) <= math.ulp(expected), x
    assert shipped.library.logarithm_of(c_double(math.inf)) == math.inf


# ---- numbers in messages


@settings(max_examples=1000)
@given(value=st.floats())
def test_numbers_read_as_in_python(value: float, text: Text) -> None:
    assert text.real("%r", value) == repr(value)
    assert text.real("%4", value) == f"{value:.4g}"
    assert text.real("%3", value) == f"{value:.3g}"


def test_numbers_where_digits_and_powers_meet(text: Text) -> None:
    values = [2.0**power for power in range(-1074, 1024)] + [float(f"1e{power}") for power in range(-323, 309)]
    for value in [*values, 99995.0, 9999.5, 99950.0, 0.00099995, 1e16, 9999999999999998.0, 5e-324, 1.0, 0.1]:
        assert [text.real(form, value) for form in ("%r", "%4", "%3")] == [repr(value), f"{value:.4g}", f"{value:.3g}"]


def test_integers_and_strings(text: Text) -> None:
    for value in (0, -1, 2**63 - 1, -(2**63)):
        assert text.integer("%i", value) == str(value)
    assert text.string("'%q'", "a%s#b\n\u00e9") == "'a?s?b???'"
    assert text.string("%s", "x" * 2000) == "x" * 639
