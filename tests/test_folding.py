"""Constants multiplied once, before a stretch: what that costs in roundings, beside the equations as people write them.

In double precision they give the trajectories from before the constants were folded, bit by bit; in quadruple
precision, what a sub-step should be. Run with -s it prints both.
"""

import math
import subprocess
from fractions import Fraction
from pathlib import Path

import pytest

from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.dynamics import State
from hovercraft_fmu.model.integrators import INTEGRATORS
from hovercraft_fmu.model.subcycling import advance, substeps
from hovercraft_fmu.scenes import SCENES
from hovercraft_fmu.simulation import Run, held_steps, plan
from tests.native import C_TESTS, c_compiler, compile_c

SMOOTH = [scene for scene in SCENES.values() if not scene.craft.rubs]
STEPS = {"semi_implicit_euler": 0.001, "rk4": 0.1}
WIDTHS = {"double": (), "quadruple": ("-DQUAD", "-lquadmath")}


def _require_quadmath(folder: Path) -> None:
    probe = folder / "probe.c"
    probe.write_text("#include <quadmath.h>\nint main(void) { return 0; }\n")
    command = [c_compiler(), str(probe), "-lquadmath", "-o", str(folder / "probe")]
    if subprocess.run(command, capture_output=True, check=False).returncode != 0:
        pytest.skip("no libquadmath (it comes with gcc; clang has none)")


@pytest.fixture(scope="module")
def unfolded(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("unfolded")
    _require_quadmath(folder)
    return {
        name: compile_c(folder / name, [C_TESTS / "unfolded.c"], *options, "-lm") for name, options in WIDTHS.items()
    }


def _constants(craft: Craft) -> tuple[float, ...]:
    return (craft.mass, craft.inertia, craft.drag_factor, craft.drag_center, craft.steering_force, 0.5 * craft.length,
            craft.thrust_min, craft.thrust_max)  # fmt: skip


def _written_out(program: Path, run: Run) -> list[tuple[Fraction, ...]]:
    """Where the craft is, and how it moves, after each communication step."""
    method = INTEGRATORS.index(run.settings.integrator) + 1
    lines = [(*_constants(run.craft), *run.start, float(method))]
    for time, end, held in held_steps(run):
        n, h = substeps(end - time, run.settings.step_size)
        lines.append((float(n), h, *held[:5]))  # no scene has loads from outside
    text = "\n".join(" ".join(value.hex() for value in line) for line in lines)
    done = subprocess.run([program], input=text, capture_output=True, text=True, check=True)
    rows = [[Fraction(float.fromhex(value)) for value in line.split()] for line in done.stdout.splitlines()]
    return [tuple(high + low for high, low in zip(row[::2], row[1::2], strict=True)) for row in rows]


def _ours(run: Run) -> list[State]:
    state, states = run.start, []
    for time, end, held in held_steps(run):
        state = advance(state, held, run.craft, end - time, run.settings).state
        states.append(state)
    return states


def _apart(one: list[tuple[Fraction, ...]], other: list[tuple[Fraction, ...]]) -> float:
    """m, m from the origin: the largest distance between two paths, in the distance from the origin, at least 1 m."""
    return max(
        math.hypot(a[0] - b[0], a[1] - b[1]) / max(1.0, math.hypot(a[0], a[1])) for a, b in zip(one, other, strict=True)
    )


def test_no_scene_is_left_out_but_the_one_with_friction() -> None:
    assert set(SCENES) - {scene.name for scene in SMOOTH} == {"drift_to_rest"}


@pytest.mark.parametrize("method", STEPS)
def test_folded_constants_err_as_the_equations_themselves_do(method: str, unfolded: dict[str, Path]) -> None:
    """Every scene, for a minute: within 1e-12 of the distance from the origin, and as near to what is right.

    Both err by roundings alone, which add up as they happen to fall: in a scene by a half more or less, in the mean
    over the scenes (of the logarithm) by nothing that counts.
    """
    ratios = []
    for scene in SMOOTH:
        run = plan(scene, start_values={"integrator": method, "step_size": STEPS[method]}, stop_time=60.0)
        before, exact = (_written_out(unfolded[name], run) for name in WIDTHS)
        now = [tuple(map(Fraction, state)) for state in _ours(run)]
        moved, error_before, error = _apart(now, before), _apart(before, exact), _apart(now, exact)
        print(
            f"\n{method} {scene.name}: {moved:.1e} from before; from quadruple {error_before:.1e}, now {error:.1e}",
            end="",
        )
        assert moved <= 1e-12
        ratios.append(error / error_before)
    assert max(ratios) <= 1.5
    assert math.prod(ratios) ** (1.0 / len(ratios)) <= 1.1
