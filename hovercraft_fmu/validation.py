"""Checks of an FMU: by the people who wrote the checkers, and by running it."""

import os
import platform
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import fmpy
import fmpy.validation
import numpy as np
from lxml import etree

from .simulation import SimulationError, instantiated, read_description

STEPS = 5
SCHEMA = Path(fmpy.__file__).parent / "schema" / "fmi2" / "fmi2ModelDescription.xsd"


class Check(NamedTuple):
    """What one check of one FMU found."""

    checker: str
    """Tool and version."""
    what: str
    problems: list[str]


def validate(path: str | os.PathLike[str]) -> Iterator[Check]:
    """Run every check on a FMI 2.0 co-simulation FMU; one Check each, as it is done.

    Raises:
        FileNotFoundError: no such file.
        ValueError: not an archive with a model description.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"{path}: no such FMU; 'hovercraft-fmu build' writes one")
    checker = f"fmpy {fmpy.__version__}"
    description = read_description(path, validate=False)
    yield Check(f"lxml {etree.__version__}", "XML schema of FMI 2.0", _schema_problems(path))
    yield Check(checker, "names, units, starts, model structure", list(fmpy.validation.validate_fmu(str(path))))
    what = f"load, initialize, {STEPS} steps, read all outputs, free"
    yield Check(f"{checker}, Python {platform.python_version()}", what, _run_problems(path, description))


def _schema_problems(path: Path) -> list[str]:
    schema = etree.XMLSchema(file=str(SCHEMA))
    with zipfile.ZipFile(path) as archive:
        schema.validate(etree.fromstring(archive.read("modelDescription.xml")))
    return [f"line {error.line}: {error.message}" for error in schema.error_log]


def _run_problems(path: Path, description: Any) -> list[str]:
    """A description can be clean and the binary still not load: only a run shows it."""
    if description.coSimulation is None:
        return ["the FMU must offer co-simulation"]
    experiment = description.defaultExperiment
    step = float(experiment.stepSize if experiment and experiment.stepSize else 0.01)
    messages: list[str] = []
    try:
        with instantiated(path, description, messages) as (folder, instance):
            rows = fmpy.simulate_fmu(
                folder,
                model_description=description,
                fmu_instance=instance,
                start_time=0.0,
                stop_time=STEPS * step,
                output_interval=step,
                validate=False,
            )
    except SimulationError as error:
        return [str(error)]
    except Exception as error:  # whatever fmpy raises of a call that failed
        return ["; ".join(messages) or str(error)]
    problems = [] if len(rows) == STEPS + 1 else [f"{len(rows) - 1} steps were made: must be {STEPS}"]
    unbounded = [name for name in rows.dtype.names if not np.isfinite(rows[name]).all()]
    return problems + [f"{name}: must be finite in every step" for name in unbounded]
