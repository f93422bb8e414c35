"""One rule for the same time: what a host's rounding of the time makes is none of the motion's business."""

import itertools
import math
from collections.abc import Callable
from fractions import Fraction
from typing import TypeAlias

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from hovercraft_fmu.fmu.machine_code import C_FOLDER
from hovercraft_fmu.model.subcycling import meant_step, rounding, substeps
from tests.native import Kernel, compile_c
from tests.strategies import numbers

Host: TypeAlias = Callable[[float, float, int], float]
"""(start, step, n) -> the time after n steps."""


@pytest.fixture(scope="module")
def kernel(tmp_path_factory: pytest.TempPathFactory) -> Kernel:
    """In C."""
    made = tmp_path_factory.mktemp("same_time") / "kernel.so"
    return Kernel(compile_c(made, [C_FOLDER / "kernel.c"], "-DHOVERCRAFT_LIBM", "-shared", "-fPIC", "-lm"))


def _product(start: float, step: float, n: int) -> float:
    """fmpy, the Reference FMUs."""
    return start + n * step


def _best(start: float, step: float, n: int) -> float:
    """The double next to the right time."""
    return float(Fraction(start) + n * Fraction(step))


def _nanoseconds(start: float, step: float, n: int) -> float:
    """libcosim: whole nanoseconds, as a double at last."""
    return (round(Fraction(start) * 10**9) + n * round(Fraction(step) * 10**9)) / 1e9


def _sum(start: float, step: float, n: int) -> float:
    """One more step on top of a time."""
    return _product(start, step, n - 1) + step


STARTS = st.one_of(
    st.sampled_from([0.0, 86400.0, 1.7e9, -1000.0, 1e10]),
    st.builds(lambda sign, e: sign * 10.0**e, st.sampled_from([-1.0, 1.0]), numbers(-3.0, 10.0)),
)
SIZES = st.one_of(st.sampled_from([0.001, 0.01, 0.1, 1.0]), numbers(1e-4, 2.0))


@given(
    start=STARTS,
    size=SIZES,
    many=st.integers(1, 2000),
    n=st.one_of(st.integers(1, 40), st.integers(1, 10**8)),
    host=st.sampled_from([_product, _best, _nanoseconds, _sum]),
)
def test_a_step_means_its_sub_steps_wherever_the_time_starts(
    start: float, size: float, many: int, n: int, host: Host, kernel: Kernel
) -> None:
    """However a host works out its times: the rounding of the time is not the step's."""
    if host is _nanoseconds:
        size = math.ceil(size * 1e6) / 1e6  # what is no whole number of nanoseconds it cannot mean
    wanted = many * size
    point = start if n == 1 else host(start, wanted, n - 1)
    step = host(start, wanted, n) - point
    largest = max(abs(start), abs(point), abs(point + step))
    if host is _nanoseconds:  # it takes the start for a whole number of them, too
        assume(start == 0.0 or largest > 1.0)
    assume(wanted > 50 * math.ulp(largest))
    assert abs(Fraction(step) - Fraction(wanted)) <= 4 * Fraction(math.ulp(largest))
    assert meant_step(point, step, start, size) == wanted
    assert kernel.meant_step(point, step, start, size) == wanted
    assert substeps(wanted, size) == (many, size)


@given(start=STARTS, size=SIZES, step=numbers(1e-9, 100.0), n=st.integers(0, 10**8))
def test_no_more_than_the_rounding_of_the_time_is_taken_from_a_step(
    start: float, size: float, step: float, n: int, kernel: Kernel
) -> None:
    """By fractions; and always far less than the step."""
    point = start + n * step
    meant = meant_step(point, step, start, size)
    assert kernel.meant_step(point, step, start, size) == meant
    largest = max(abs(start), abs(point), abs(point + step))
    assert abs(Fraction(meant) - Fraction(step)) <= min(8 * Fraction(math.ulp(largest)), Fraction(step) / 9)


def test_a_day_of_milliseconds_and_a_year_of_seconds_keep_their_count() -> None:
    """All the step counts in which a rounding could go wrong: about powers of two, and many between them."""
    day, year = 86_400_000, 31_536_000
    for size, last in ((0.001, day), (1.0, year), (0.1, 10 * year)):
        counts = {2**e + d for e in range(30) for d in range(-8, 9)} | set(range(0, last, last // 5000)) | {last - 1}
        for n in counts:
            if 0 <= n < last:
                assert meant_step(n * size, (n + 1) * size - n * size, 0.0, size) == size, n


def test_twenty_seconds_of_milliseconds_a_day_on(kernel: Kernel) -> None:
    """Seen: 34 720 sub-steps of 20 000."""
    for start in (86_400.0, 1.7e9):
        times = [start + n * 0.001 for n in range(20_001)]
        for time, end in itertools.pairwise(times):
            assert meant_step(time, end - time, start, 0.001) == 0.001
        assert kernel.meant_step(times[-2], times[-1] - times[-2], start, 0.001) == 0.001


@given(largest=numbers(0.0, 1e18), step=numbers(1e-12, 1e6), steps=numbers(0.0, 1e9))
def test_c_has_the_same_rule(largest: float, step: float, steps: float, kernel: Kernel) -> None:
    assert kernel.rounding(largest, step, steps) == rounding(largest, step, steps)


@pytest.mark.parametrize("step", [0.001, 0.1, 1 / 3])
@pytest.mark.parametrize("start", [0.0, 86_400.0, -1000.0])
def test_a_sum_of_steps_is_the_same_time(start: float, step: float) -> None:
    """Of a host that adds up time, at its end; a ninth of a step on is another time."""
    time, steps = start, 20_000
    for _ in range(steps):
        time += step
    right = Fraction(start) + steps * Fraction(step)
    assert abs(Fraction(time) - right) <= rounding(max(abs(start), abs(time)), step, steps) < step / 9
