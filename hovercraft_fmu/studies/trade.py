"""The trade: what speed costs and what accuracy costs, with the FMU's own methods and with a solver of the host's."""

from pathlib import Path

from ..fmu.description import NATIVE
from ..fmu.machine_code import library
from ..fmu.native_package import build_native_fmu
from ..fmu.python_package import build_fmu
from ..host import Fmu
from ..scenes import SCENES
from ..whole import temporary_folder
from .laboratory import Findings, Tell, part
from .model_exchange import SMOOTH, exchanged
from .work_precision import ADVISED_SCENE, ROUNDS, accuracy, advice, measured


def measure(quick: bool, tell: Tell) -> Findings:
    """Every scene with every setting; quick: the scene that advice is given for, once."""
    scenes, smooth = ([SCENES[ADVISED_SCENE]],) * 2 if quick else (list(SCENES.values()), SMOOTH)
    rounds = 1 if quick else ROUNDS
    with temporary_folder() as folder:
        with Fmu(build_fmu(Path(folder) / "Python.fmu")) as fmu, fmu.instance() as instance:
            found = measured(instance, scenes, rounds, part(tell, 0.0, 0.6))
        found.add(advice(found.records["work_precision"]))
        found.add(accuracy(quick))
        tell(0.7)
        if missing := library(NATIVE).missing:
            found.notes.append(f"Model exchange was not measured: {missing}")
            return found
        with (
            Fmu(build_native_fmu(Path(folder) / "Native.fmu")) as fmu,
            fmu.instance() as stepping,
            fmu.instance(exchange=True) as solving,
        ):
            found.add(exchanged(stepping, solving, smooth, rounds, part(tell, 0.7, 1.0)))
    return found
