"""Checks of an FMU: by the people who wrote the checkers, and by running it."""

import os
import platform
import subprocess
import zipfile
import zlib
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import fmpy
import fmpy.validation
import numpy as np
from lxml import etree

from . import elsewhere
from ._version import __version__
from .fmu.interface import HOVERCRAFT
from .host import Fmu, SimulationError, is_of, is_ssp, read_description
from .whole import temporary_folder

STEPS = 5
FMPY = Path(fmpy.__file__).parent
SSP_SCHEMAS = {
    ".ssd": "SystemStructureDescription{}.xsd",
    ".ssv": "SystemStructureParameterValues.xsd",
    ".ssm": "SystemStructureParameterMapping.xsd",
}
"""Of FMPY/ssp/schema."""


class Check(NamedTuple):
    """What one check of one FMU found."""

    checker: str
    version: str
    what: str
    problems: list[str]
    missing: str = ""
    """Why it could not be made; then there are no problems either."""

    @property
    def result(self) -> str:
        """In one word."""
        return "FAILED" if self.problems else "not run" if self.missing else "ok"


def validate(path: str | os.PathLike[str]) -> Iterator[Check]:
    """Run every check on an FMU, FMI 2.0 or 3.0, as co-simulation and as model exchange; one Check each, as it is done.

    Raises:
        FileNotFoundError: no such file; ValueError: not an archive with a model description. At once, before any check.
    """
    path = Path(path)
    return _checks(path, read_description(path, validate=False))


def _checks(path: Path, description: Any) -> Iterator[Check]:
    version = description.fmiVersion
    yield Check("lxml", etree.__version__, f"XML schema of FMI {version}", _schema_problems(path, version))
    problems = list(fmpy.validation.validate_fmu(str(path)))
    yield Check("fmpy", fmpy.__version__, "names, units, starts, model structure", problems)
    what = f"load, initialize, {STEPS} steps, read all outputs, free"
    python = f"{fmpy.__version__}, Python {platform.python_version()}"
    yield Check("fmpy", python, what, _run_problems(path, description))
    if description.modelExchange is not None:
        what = f"model exchange: CVode to {STEPS} output points, read all outputs, free"
        yield Check("fmpy", python, what, _run_problems(path, description, exchange=True))


def check_file(path: str | os.PathLike[str]) -> Iterator[Check]:
    """Every check of a file, FMU or SSP; one that is not there, or is neither, fails the first."""
    path = Path(path)
    try:
        yield from (validate_ssp if is_ssp(path) else validate)(path)
    except (ValueError, FileNotFoundError, zipfile.BadZipFile, etree.XMLSyntaxError) as error:
        yield Check("hovercraft-fmu", __version__, "read the file", [str(error)])


def validate_ssp(path: str | os.PathLike[str]) -> Iterator[Check]:
    """Check an SSP file: the schemas of its XML, that it has what it names, and every FMU in it.

    Raises ValueError: it cannot be read.
    """
    path = Path(path)
    with temporary_folder() as folder:
        try:
            with zipfile.ZipFile(path) as archive:
                archive.extractall(folder)
        except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError) as error:  # as zipfile raises them
            raise ValueError(f"{path}: must be an archive that can be extracted; {error}") from error
        found = (each for each in sorted(Path(folder).rglob("*")) if each.is_file())
        files = {each.relative_to(folder).as_posix(): each for each in found}
        schemas = [_ssp_problems(name, file) for name, file in files.items() if file.suffix in SSP_SCHEMAS]
        yield Check("lxml", etree.__version__, "XML schemas of SSP", [each for some in schemas for each in some])
        yield Check("hovercraft-fmu", __version__, "members, connectors, connections", list(_loose_ends(files)))
        for name, file in files.items():
            if file.suffix == ".fmu":
                for check in check_file(file):
                    yield check._replace(what=f"{name}: {check.what}")


def _ssp_problems(name: str, file: Path) -> list[str]:
    tree = etree.parse(file)
    schema = SSP_SCHEMAS[file.suffix].format("11" if tree.getroot().get("version", "1.0") > "1.0" else "")
    return [f"{name}, {each}" for each in _against_schema(tree, FMPY / "ssp" / "schema" / schema)]


def _loose_ends(files: Mapping[str, Path]) -> Iterator[str]:
    """What the structure names and is not there: files, variables of FMUs, ends of connections."""
    root = etree.parse(files["SystemStructure.ssd"])
    ends = {(None, each.get("name")) for each in root.findall("{*}System/{*}Connectors/{*}Connector")}
    for component in root.iterfind(".//{*}Component"):
        name, source = component.get("name"), str(component.get("source"))
        connectors = {each.get("name") for each in component.iterfind(".//{*}Connector")}
        ends |= {(name, each) for each in connectors}
        if source not in files:
            yield f"component {name!r}: source = {source!r}: must be in the archive"
        elif source.endswith(".fmu"):
            has = {each.name for each in fmpy.read_model_description(files[source], validate=False).modelVariables}
            for each in sorted(map(str, connectors - has)):
                yield f"component {name!r}: connector {each!r}: must be a variable of {source}"
    for binding in root.iterfind(".//{*}ParameterBinding[@source]"):
        if binding.get("source") not in files:
            yield f"parameter binding: source = {binding.get('source')!r}: must be in the archive"
    for each in root.iterfind(".//{*}Connection"):
        for side in ("start", "end"):
            end = (each.get(f"{side}Element"), each.get(f"{side}Connector"))
            if end not in ends:
                yield f"connection {side} = {'.'.join(filter(None, end))!r}: must be a connector"


def validate_elsewhere(path: str | os.PathLike[str]) -> Iterator[Check]:
    """The checkers that others wrote and, for an FMU of the hovercraft, whose inputs are set there, the hosts.

    Each where it is installed. Raises as `validate` does.
    """
    path = Path(path)
    description = read_description(path, validate=False)
    toolbox = elsewhere.HOSTS["fmucontainer"]
    what, missing = "fmutool -check: schema and semantics", toolbox.missing()
    version = "" if missing else toolbox.version()
    yield Check("fmu-manipulation-toolbox", version, what, [] if missing else _fmutool_problems(path), missing)
    if is_of(description, HOVERCRAFT.name):
        yield from _host_checks(path)


def _host_checks(path: Path) -> Iterator[Check]:
    try:
        expected = elsewhere.run_in("fmpy", path)
    except elsewhere.HostError as error:  # then there is nothing to compare the others with
        yield Check("fmpy", fmpy.__version__, "steps with changing inputs", [str(error)])
        return
    for host in elsewhere.hosts_of(path).values():
        if host.name != "fmpy":
            yield _host_check(host, path, expected)


def _host_check(host: elsewhere.Host, path: Path, expected: list[list[float]]) -> Check:
    what = f"{len(expected)} steps with changing inputs: the bits that fmpy gives"
    missing = host.missing()
    if missing:
        return Check(host.name, "", what, [], missing)
    try:
        rows = elsewhere.run_in(host.name, path)
    except elsewhere.HostError as error:
        return Check(host.name, host.version(), what, [str(error)])
    return Check(host.name, host.version(), what, [] if rows == expected else ["the outputs must equal those in fmpy"])


def junit_report(found: Mapping[Path, Sequence[Check]]) -> bytes:
    """The checks of some files as JUnit has them, which build servers read: a suite a file, a case a check."""
    suites = etree.Element("testsuites", name="hovercraft-fmu validate")
    for file, checks in found.items():
        failed, skipped = (str(sum(each.result == result for each in checks)) for result in ("FAILED", "not run"))
        counts = {"tests": str(len(checks)), "failures": failed, "errors": "0", "skipped": skipped}
        suite = etree.SubElement(suites, "testsuite", name=str(file), **counts)
        for check in checks:
            named = f"{check.checker} {check.version}".strip()
            case = etree.SubElement(suite, "testcase", name=f"{check.what} ({named})", classname=str(file))
            if check.problems:
                etree.SubElement(case, "failure", message=check.problems[0]).text = "\n".join(check.problems)
            elif check.missing:
                etree.SubElement(case, "skipped", message=check.missing)
    report: bytes = etree.tostring(suites, xml_declaration=True, encoding="UTF-8", pretty_print=True)
    return report


def _fmutool_problems(path: Path) -> list[str]:
    command = elsewhere.module_command("fmu_manipulation_toolbox", "-input", str(path), "-check")
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    lines = (done.stdout + done.stderr).splitlines()
    problems = [line for line in lines if line.startswith(("ERROR", "WARNING", "CRITICAL", "FATAL"))]
    return problems or ([f"exit status {done.returncode}"] if done.returncode else [])


def _schema_problems(path: Path, version: str) -> list[str]:
    """Of the model description and, in FMI 3.0, of what else is XML."""
    fmi = f"fmi{version[0]}"
    schemas = {"modelDescription.xml": f"{fmi}ModelDescription.xsd"}
    if fmi == "fmi3":
        schemas["sources/buildDescription.xml"] = "fmi3BuildDescription.xsd"
        schemas["terminalsAndIcons/terminalsAndIcons.xml"] = "fmi3TerminalsAndIcons.xsd"
    problems = []
    with zipfile.ZipFile(path) as archive:
        for name in sorted(schemas.keys() & set(archive.namelist())):
            found = _against_schema(etree.fromstring(archive.read(name)), FMPY / "schema" / fmi / schemas[name])
            problems += [f"{name}, {each}" for each in found]
    return problems


def _against_schema(tree: Any, path: Path) -> list[str]:
    schema = etree.XMLSchema(file=str(path))
    schema.validate(tree)
    return [f"line {error.line}: {error.message}" for error in schema.error_log]


def _run_problems(path: Path, description: Any, exchange: bool = False) -> list[str]:
    """A description can be clean and the binary still not load: only a run shows it."""
    experiment = description.defaultExperiment
    step = float(experiment.stepSize if experiment and experiment.stepSize else 0.01)
    try:
        with Fmu(path, validate=False) as fmu, fmu.instance(exchange) as instance, instance.driven_by_fmpy():
            rows = fmpy.simulate_fmu(
                fmu.folder,
                model_description=description,
                fmu_instance=instance.fmpy,
                fmi_type="ModelExchange" if exchange else "CoSimulation",
                start_time=0.0,
                stop_time=STEPS * step,
                output_interval=step,
                validate=False,
            )
    except SimulationError as error:
        return [str(error)]
    problems = [] if len(rows) == STEPS + 1 else [f"{len(rows) - 1} steps were made: must be {STEPS}"]
    unbounded = [name for name in rows.dtype.names if not np.isfinite(rows[name]).all()]
    problems += instance.messages if exchange else []  # of a refused call inside the solver, no exception comes through
    return problems + [f"{name}: must be finite in every step" for name in unbounded]
