"""Memory over many cycles and many steps, in processes of their own."""

from pathlib import Path

from tests.conftest import ROOT, Fresh

CYCLES = """
import sys, fmpy, psutil
path, cycles = sys.argv[1], int(sys.argv[2])
description = fmpy.read_model_description(path)
folder = fmpy.extract(path)
identifier = description.coSimulation.modelIdentifier
instance = fmpy.fmi2.FMU2Slave(guid=description.guid, unzipDirectory=folder, modelIdentifier=identifier)
memory = psutil.Process().memory_info
for k in range(cycles):
    if k == cycles // 10:
        early, entries = memory().rss, len(sys.path)
    instance.instantiate(loggingOn=True)
    instance.setupExperiment()
    instance.enterInitializationMode()
    instance.exitInitializationMode()
    instance.doStep(0.0, 0.01)
    instance.terminate()
    instance.fmi2FreeInstance(instance.component)
made = cycles - cycles // 10
print((memory().rss - early) / made, (len(sys.path) - entries) / made)
"""
EMPTY = """
import sys
from pathlib import Path
from pythonfmu import Fmi2Causality, Fmi2Slave, FmuBuilder, Real

SOURCE = '''
from pythonfmu import Fmi2Causality, Fmi2Slave, Real

class Empty(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.y = 0.0
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        return True
'''
Path("empty_slave.py").write_text(SOURCE)
print(FmuBuilder.build_FMU("empty_slave.py", dest=sys.argv[1]))
"""
STEPS = """
import sys
from pathlib import Path
import psutil
from tests.lowlevel import one, put, start

with one(Path(sys.argv[1])) as (instance, _):
    start(instance, step_size=0.01)
    rss = psutil.Process().memory_info
    for k in range(100_000):
        if k == 10_000:
            early = rss().rss
        instance.doStep(k * 0.01, 0.01)
    print(rss().rss - early, instance.getInteger([20])[0])
"""


def test_a_cycle_leaves_no_more_than_the_wrapper_itself(fmu: Path, fresh: Fresh, tmp_path: Path) -> None:
    """An FMU of pythonfmu's without content leaves about 7 kB and an entry of sys.path a cycle; this one, no more."""
    empty = fresh(EMPTY, tmp_path / "Empty.fmu").split()[-1]
    ours, entries = map(float, fresh(CYCLES, fmu, 2000).split())
    wrappers, _ = map(float, fresh(CYCLES, empty, 2000).split())
    print(
        f"bytes left a cycle: this FMU {ours:.0f}, one without content {wrappers:.0f}; sys.path entries {entries:.0f}"
    )
    assert entries == 1.0
    assert ours <= 1.15 * wrappers  # pages of 4 kB over 1800 cycles: 2 bytes a cycle; the allocator's arenas: 1 MB


def test_a_hundred_thousand_steps_leave_nothing(fmu: Path, fresh: Fresh) -> None:
    """One object a step, of 24 bytes at least, would be 2 MB."""
    grown, counted = map(int, fresh(STEPS, fmu, env={"PYTHONPATH": str(ROOT)}).split())
    assert counted == 100_000
    assert grown < 1_000_000
