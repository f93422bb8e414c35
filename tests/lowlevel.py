"""The FMU through fmpy's low-level interface."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import fmpy

from hovercraft_fmu.fmu.interface import ACTION, BY_NAME, INPUTS, MOTION, STATES, VARIABLES
from hovercraft_fmu.simulation import instantiated, read_description

REALS = [v for v in VARIABLES if v.kind == "Real"]
INTEGERS = [v for v in VARIABLES if v.kind != "Real"]
CONTINUOUS = (*INPUTS, *STATES, *MOTION, *ACTION)


def reference(name: str) -> int:
    return BY_NAME[name].reference


def start(instance: Any, time: float = 0.0, **values: float) -> None:
    instance.setupExperiment(startTime=time)
    put(instance, **values)
    instance.enterInitializationMode()
    instance.exitInitializationMode()


def put(instance: Any, **values: float) -> None:
    """Set reals by name; a dot in a name is written as two underscores."""
    if values:
        instance.setReal([reference(name.replace("__", ".")) for name in values], list(values.values()))


def get(instance: Any, *names: str) -> list[float]:
    return list(instance.getReal([reference(name) for name in names]))


def count(instance: Any, name: str = "substeps") -> int:
    return int(instance.getInteger([reference(name)])[0])


def everything(instance: Any) -> dict[str, float]:
    """All that can be read, by name."""
    values = [*instance.getReal([v.reference for v in REALS]), *instance.getInteger([v.reference for v in INTEGERS])]
    return {variable.name: value for variable, value in zip((*REALS, *INTEGERS), values, strict=True)}


@contextmanager
def one(fmu: Path, exchange: bool = False) -> Iterator[tuple[Any, list[str]]]:
    """An instance, for co-simulation or model exchange, and the messages that come from it."""
    messages: list[str] = []
    with instantiated(fmu, read_description(fmu), messages, exchange) as (_, instance):
        yield instance, messages


def another(instance: Any) -> Any:
    """A further instance of the same extracted FMU."""
    made = fmpy.fmi2.FMU2Slave(
        guid=instance.guid, unzipDirectory=instance.unzipDirectory, modelIdentifier=instance.modelIdentifier
    )
    made.instantiate(loggingOn=True)
    return made
