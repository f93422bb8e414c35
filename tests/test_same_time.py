"""One rule for the same time: what a host's rounding of the time makes is none of the motion's business."""

import itertools
import math
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path
from typing import TypeAlias

import fmpy
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from hovercraft_fmu.fmu.interface import STATES
from hovercraft_fmu.fmu.machine_code import c_file
from hovercraft_fmu.model.subcycling import meant_step, rounding, substeps
from hovercraft_fmu.scenes import Signals, signals
from hovercraft_fmu.simulation import Result, plan, run_fmu, run_model
from hovercraft_fmu.sweeps import load, sweep
from tests.native import C_TESTS, Kernel, compile_c
from tests.strategies import numbers

Host: TypeAlias = Callable[[float, float, int], float]
"""(start, step, n) -> the time after n steps."""


@pytest.fixture(scope="module")
def kernel(tmp_path_factory: pytest.TempPathFactory) -> Kernel:
    """In C."""
    made = tmp_path_factory.mktemp("same_time") / "kernel.so"
    return Kernel(
        compile_c(made, [c_file("kernel.c"), C_TESTS / "rounding_of.c"], "-DHOVERCRAFT_LIBM", "-shared", "-fPIC", "-lm")
    )


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
    point = start if n == 1 and host is _sum else host(start, wanted, n - 1)
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


def test_the_end_of_a_step_is_one_of_its_times(kernel: Kernel) -> None:
    """At 1 s a step of 1 s and a little is 1 s, as the end, at 2 s, may round by that much; at 0 s it is not."""
    step = 1.0 + 6 * math.ulp(1.0)
    for rule in (meant_step, kernel.meant_step):
        assert [rule(time, step, 0.0, 0.5) for time in (0.0, 1.0, -1.0)] == [step, 1.0, step]
        steps = [1.0 + n * math.ulp(1.0) for n in (4, 5)]  # the rounding of 1 s, and more
        assert [rule(-1.0, each, 0.0, 0.5) for each in steps] == [1.0, steps[1]]


def test_a_day_of_milliseconds_and_a_year_of_seconds_keep_their_count(kernel: Kernel) -> None:
    """All the step counts in which a rounding could go wrong: about powers of two, and many between them."""
    day, year = 86_400_000, 31_536_000
    for size, last in ((0.001, day), (1.0, year), (0.1, 10 * year)):
        counts = {2**e + d for e in range(30) for d in range(-8, 9)} | set(range(0, last, last // 5000)) | {last - 1}
        for n in counts:
            if 0 <= n < last:
                step = n * size, (n + 1) * size - n * size, 0.0, size
                assert meant_step(*step) == kernel.meant_step(*step) == size, n


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


# ---- whole runs


def _log(start: float) -> Signals:
    """A ramp, a jump at 3 s, a ramp; 10 s."""
    rows = ((0.0, 5.0, 0.0), (3.0, 8.0, 0.0), (3.0, 8.0, 1.0), (10.0, 2.0, 1.0))
    return signals((start + time, thrust, port, 0.0) for time, thrust, port in rows)


def _assert_as_from_zero(made: Result, right: Result, start: float) -> None:
    """The physics has no clock: 101 rows, 10 000 sub-steps of 0.001 s, and the motion of the log from 0."""
    assert made["time"].tolist() == [start + n * 0.1 for n in range(101)]
    assert made["substeps"][-1] == right["substeps"][-1] == 10_000
    for name in ("pose.x", "pose.y"):
        assert made[name] == pytest.approx(right[name], rel=0.0, abs=1e-6)


LATE = pytest.mark.parametrize("start", [86_400.0, 1_700_000_000.0, 1e10])


@LATE
def test_a_log_with_the_time_of_the_day_or_of_the_epoch(start: float) -> None:
    """Seen: 85 rows from 1 700 000 000 s and one from 1e10 s."""
    made, right = (run_model(plan(_log(each), communication_step=0.1)) for each in (start, 0.0))
    _assert_as_from_zero(made, right, start)


@LATE
def test_a_log_with_such_times_through_an_fmu(start: float, each_fmu: Path) -> None:
    made, right = (run_fmu(plan(_log(each), communication_step=0.1), each_fmu) for each in (start, 0.0))
    _assert_as_from_zero(made, right, start)


@pytest.mark.usefixtures("fleet")
@pytest.mark.parametrize("engine", ["fmu", "batch"])
def test_a_study_with_such_times(engine: str, native_fmu: Path, tmp_path: Path) -> None:
    ends = []
    for start in (0.0, 1_700_000_000.0):
        rows = "".join(",".join(map(repr, row)) + "\n" for row in _log(start).tolist())
        (tmp_path / "log.csv").write_text("time,thrust,port_thruster,starboard_thruster\n" + rows)
        study = {
            "inputs": str(tmp_path / "log.csv"), "communication_step": 0.1, "sweep": {"mass": [100.0]},
            "keep": {"end": ["pose.x"], "trajectory": {"every": 0.5, "of": ["pose.x"]}},
        }  # fmt: skip
        found = tmp_path / str(start)
        sweep(study, native_fmu if engine == "fmu" else None, workers=1, output=found, engine=engine)
        path = load(found, "trajectories").to_table()
        assert path["time"].to_pylist() == [start + n * 0.5 for n in range(21)]
        ends.append(path["pose.x"].to_pylist())
    assert ends[1] == pytest.approx(ends[0], rel=0.0, abs=1e-6)


def test_fmpy_a_day_on(each_fmu: Path) -> None:
    """Two seconds of milliseconds: the count, and the bits of a start at 0."""
    ends = []
    for start in (0.0, 86_400.0):
        made = fmpy.simulate_fmu(
            str(each_fmu), start_time=start, stop_time=start + 2.0, output_interval=0.001,
            start_values={"velocity.x": 0.3, "velocity.yaw_rate": 0.1}, output=[*STATES, "substeps"],
        )  # fmt: skip
        ends.append([made[name][-1] for name in (*STATES, "substeps")])
    assert ends[0][-1] == 2000
    assert ends[1] == ends[0]
