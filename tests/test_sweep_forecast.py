"""What a sweep would come to, before anything is made."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hovercraft_fmu.model.integrators import integrator
from hovercraft_fmu.model.subcycling import Settings
from hovercraft_fmu.sweeps import chunks, estimate, forecast, read_study, sweep
from hovercraft_fmu.sweeps.engines import Plan, Ran
from hovercraft_fmu.sweeps.quantities import Samples
from hovercraft_fmu.sweeps.timeline import timeline
from hovercraft_fmu.sweeps.work import Job, run
from tests.shell import Shell

STUDY: dict[str, Any] = {
    "scene": "turn",
    "stop_time": 2.0,
    "set": {"integrator": "rk4", "step_size": 0.1},
    "sweep": {"mass": {"from": 50.0, "to": 200.0}, "air_density": {"from": 0.3, "to": 1.2}},
    "sampling": {"method": "latin_hypercube", "runs": 3000, "seed": 1},
    "keep": {"end": ["pose.x", "pose.y"], "trajectory": {"every": 1.0, "of": ["speed"]}},
}


def test_runs_chunks_and_bytes_are_those_of_the_sweep(
    native_fmu: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    studies = {"batch": STUDY, "fmu": {**STUDY, "sampling": {**STUDY["sampling"], "runs": 300}}}
    for engine, study in studies.items():
        fmu = native_fmu if engine == "fmu" else None
        parts = [estimate(study, fmu, engine=engine, output=engine, part=f"{k}/2") for k in (1, 2)]
        whole = estimate(study, fmu, engine=engine, output=engine, workers=3)
        assert not (tmp_path / engine).exists()
        sweep(study, fmu, engine=engine, workers=1, output=engine)
        files = list((tmp_path / engine).glob("*/*.parquet"))
        assert whole.runs == sum(part.runs for part in parts) == study["sampling"]["runs"]
        assert 2 * whole.chunks == 2 * sum(part.chunks for part in parts) == len(files)
        assert whole.bytes == pytest.approx(sum(path.stat().st_size for path in files), rel=0.1)
        assert whole.seconds == pytest.approx(whole.seconds_of_one * -(-whole.chunks // 3) / whole.chunks)


def test_the_time_is_that_of_all_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a clock that a chunk of runs moves on by so much, and each run by three times what is counted of it."""
    steps, methods = {"from": 0.001, "to": 0.1, "scale": "log"}, ["rk4", "semi_implicit_euler"]
    sampling = {**STUDY["sampling"], "runs": 1000}
    study = read_study({**STUDY, "set": {}, "sweep": {"step_size": steps, "integrator": methods}, "sampling": sampling})
    plan = Plan(study.run, study.keep, timeline(study.run, study.keep))
    now, chunk, slower = 0.0, 0.2, 3e3

    def seconds(samples: Samples) -> float:
        pairs = zip(samples["step_size"].tolist(), samples["integrator"].tolist(), strict=True)
        return slower * sum(
            chunks.seconds(plan, Settings(step, integrator(method)), chunks.BATCH_COSTS) for step, method in pairs
        )

    def timed(job: Job, samples: Samples) -> Ran:
        nonlocal now
        now += chunk + seconds(samples)
        return run(job, {name: column[:1] for name, column in samples.items()})

    monkeypatch.setattr(forecast, "perf_counter", lambda: now)
    monkeypatch.setattr(forecast, "run", timed)
    monkeypatch.setattr(forecast, "tables", lambda *_: ())
    found = estimate(study, engine="batch", workers=1)
    assert 8 <= found.measured < 100
    # the mean of twelve evenly chosen steps stands for all: the midpoint rule errs by 0.6 % there
    every = seconds(study.samples(np.arange(study.runs)))
    assert found.seconds == pytest.approx(found.chunks * chunk + every, rel=0.01)


@pytest.mark.usefixtures("fleet")
def test_the_command_makes_nothing(shell: Shell) -> None:
    (shell.folder / "short.toml").write_text(
        'scene = "turn"\nstop_time = 1.0\nset.step_size = 0.1\nsweep.mass = [60, 100]\nkeep.end = ["speed"]\n'
    )
    command = ("sweep", "short.toml", "--dry-run")
    printed = shell.ok(*command, "--fmu", "python", "--workers", "2")
    assert "short: 2 runs in 2 chunks, " in printed
    assert " by one worker, " in printed
    told = json.loads(shell.ok(*command, "--engine", "batch", "--part", "1/2", "--json"))
    assert (told["runs"], told["chunks"]) == (1, 1)
    assert "--scheduler: must not be given with --dry-run" in shell.refused(
        *command, "--engine", "batch", "--scheduler", "tcp://10.0.0.1:8786", status=2
    )
    assert "part = '3/2': must be k/n" in shell.refused(*command, "--engine", "batch", "--part", "3/2")
    assert [path.name for path in shell.folder.iterdir()] == ["short.toml"]
