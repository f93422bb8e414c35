"""What the FMI cross-check asks of an exporting tool: the native FMU, inputs, options and a reference result."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ._version import __version__
from .building import build
from .fmu.description import NATIVE
from .fmu.interface import INPUTS, OUTPUTS
from .scenes import scene
from .simulation import holding, plan, run_fmu
from .whole import check_writable, write_whole

SCENE = "slalom"
"""Starts at rest with all start values as they are; its inputs are continuous."""
PLATFORMS = ("linux64", "win64", "darwin64")
README = """\
{name}: a hovercraft that moves in the plane, FMI 2.0 co-simulation, made by hovercraft-fmu {version}.

It needs nothing where it runs. The inputs in {name}_in.csv are linear between rows. The reference result is that of
fmpy, with communication steps of {step} s over which the inputs hold, each cut into 100 sub-steps of the default
method. Start values are the FMU's.
"""


def write_cross_check(folder: Path) -> list[Path]:
    """Write the files of the native FMU for every platform into a vendor's repository; return their folders.

    Raises:
        NotCompiledError: there is no machine code; the message says how to get it.
        OSError: a file cannot be written.
    """
    name, chosen = NATIVE.identifier, scene(SCENE)
    places = [folder / "fmus" / "2.0" / "cs" / each / "hovercraft-fmu" / __version__ / name for each in PLATFORMS]
    first = places[0]
    for place in places:
        check_writable(place / f"{name}.fmu")
    fmu = build("native", first / f"{name}.fmu")
    result = run_fmu(holding(plan(chosen)), fmu)
    step = chosen.communication_step
    options = {"StartTime": 0.0, "StopTime": chosen.stop_time, "StepSize": step, "RelTol": 1e-4}
    files = {
        f"{name}_ref.opt": "".join(f"{key},{value!r}\n" for key, value in options.items()),
        f"{name}_in.csv": _csv(plan(chosen).signals, ("time", *INPUTS)),
        f"{name}_ref.csv": _csv(result.data, ("time", *OUTPUTS)),
        "ReadMe.txt": README.format(name=name, version=__version__, step=step),
    }
    for place in places:
        for file, text in files.items():
            write_whole(place / file, text.encode())
        write_whole(place / fmu.name, fmu.read_bytes())
    return places


def _csv(table: NDArray[np.void], names: Sequence[str]) -> str:
    """All digits; names in quotes, as they have dots."""
    header = ",".join(f'"{name}"' for name in names)
    rows = "\n".join(",".join(repr(float(value)) for value in row) for row in table[list(names)])
    return f"{header}\n{rows}\n"
