"""A system of FMUs as one SSP file: FMUs, connectors, connections, parameter sets, a page; for any master."""

import os
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, register_namespace

from .._version import RELEASE_DATE, __version__
from ..fmu.archive import write_archive, zipped
from ..fmu.description import AUTHOR, xml
from ..fmu.document import rendered
from ..fmu.variable import Model

OF_SSP = "http://ssp-standard.org/SSP1/SystemStructure"
SSC, SSD, SSV = f"{OF_SSP}Common", f"{OF_SSP}Description", f"{OF_SSP}ParameterValues"
OSP = "http://opensimulationplatform.com/SSP/OSPAnnotations"
OMS = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"
for _prefix, _uri in (("ssc", SSC), ("ssd", SSD), ("ssv", SSV), ("osp", OSP), ("oms", OMS)):
    register_namespace(_prefix, _uri)
HERE = Path(__file__).parent
TEMPLATE = "system.html"


@dataclass(frozen=True)
class ParameterSet:
    """Start values by name."""

    file: str
    """Without folder and suffix."""
    name: str
    """By which Ecos takes it, and all others of that name."""
    values: Mapping[str, float]

    @property
    def path(self) -> str:
        """In the archive."""
        return f"resources/{self.file}.ssv"


@dataclass(frozen=True)
class Component:
    """An FMU in a system. Several may be of one file."""

    name: str
    fmu: Path
    model: Model
    given: ParameterSet
    shown: tuple[str, ...] = ()
    """Outputs that nothing in the system takes."""

    @property
    def held(self) -> tuple[str, ...]:
        """Inputs that have a start value, and no connector: fmpy.ssp would hold them at 0."""
        return tuple(name for name in self.given.values if self.model.by_name[name].causality == "input")


@dataclass(frozen=True)
class System:
    """What an SSP file tells."""

    name: str
    """Of the file, without suffix."""
    label: str
    """Of the system in it, and of its page."""
    description: str
    components: tuple[Component, ...]
    connections: tuple[tuple[str, str, str, str], ...]
    """component and its output -> component and its input"""
    communication_step: float
    """s"""
    stop_time: float
    """s"""
    spare: Mapping[str, ParameterSet] = field(default_factory=dict)
    """Component -> a set to be bound to it in the place of its own."""

    def connectors(self, part: Component) -> dict[str, tuple[str, ...]]:
        """Kind -> variables."""
        taken = tuple(name for *_, end, name in self.connections if end == part.name)
        made = tuple(name for start, name, *_ in self.connections if start == part.name)
        parameters = tuple(name for name in part.given.values if name not in part.held)
        return {"input": taken, "output": (*made, *part.shown), "parameter": parameters}

    def sets(self) -> list[tuple[str, ParameterSet]]:
        """Whose they are, and all of them."""
        return [*((part.name, part.given) for part in self.components), *self.spare.items()]


def write_ssp(path: str | os.PathLike[str], system: System) -> Path:
    """Write a system to `path` and return the path; two builds give the same bytes.

    Raises:
        ValueError: the name does not end in .ssp.
        OSError: a file cannot be read or written.
    """
    held = dict.fromkeys(name for part in system.components for name in part.held)
    python = any(is_python(fmu) for fmu in _fmus(system))
    page = rendered(HERE, {"system": system, "held": tuple(held), "python": python})[TEMPLATE]
    files = {
        "SystemStructure.ssd": xml(system_structure(system)),
        **{each.path: xml(_parameter_set(each)) for _, each in system.sets()},
        f"documentation/{system.label}.html": page.encode(),
        **{f"resources/{fmu.name}": fmu.read_bytes() for fmu in _fmus(system)},
    }
    return write_archive(path, lambda: zipped(files), ".ssp")


def _fmus(system: System) -> list[Path]:
    return list(dict.fromkeys(part.fmu for part in system.components))


def is_python(fmu: Path) -> bool:
    """Whether it carries its model as Python."""
    with zipfile.ZipFile(fmu) as archive:
        return any(name.startswith("resources/") and name.endswith(".py") for name in archive.namelist())


def system_structure(system: System) -> Element:
    """SystemStructure.ssd."""
    root = Element(
        f"{{{SSD}}}SystemStructureDescription",
        {
            "name": system.name,
            "version": "1.0",
            "description": system.description,
            "author": AUTHOR,
            "fileversion": __version__,
            "generationTool": f"hovercraft-fmu {__version__}",
            "generationDateAndTime": RELEASE_DATE,
        },
    )
    inner = SubElement(root, f"{{{SSD}}}System", {"name": system.label})
    elements = SubElement(inner, f"{{{SSD}}}Elements")
    for part in system.components:
        _component(elements, part, system.connectors(part))
    connections = SubElement(inner, f"{{{SSD}}}Connections")
    for start, output, end, taken in system.connections:
        ends = {"startElement": start, "startConnector": output, "endElement": end, "endConnector": taken}
        SubElement(connections, f"{{{SSD}}}Connection", ends)
    _annotate_for_openmodelica(inner, system.communication_step)
    units = SubElement(root, f"{{{SSD}}}Units")
    for name, unit in {name: unit for part in system.components for name, unit in part.model.units.items()}.items():
        node = SubElement(units, f"{{{SSC}}}Unit", {"name": name})
        SubElement(node, f"{{{SSC}}}BaseUnit", {base: str(exponent) for base, exponent in unit.base.items()})
    experiment = SubElement(
        root, f"{{{SSD}}}DefaultExperiment", {"startTime": "0.0", "stopTime": repr(system.stop_time)}
    )
    _annotate_for_osp(experiment, system.communication_step)
    return root


def _parameter_set(given: ParameterSet) -> Element:
    """An SSV file: all values Reals, which every reader takes."""
    root = Element(f"{{{SSV}}}ParameterSet", {"version": "1.0", "name": given.name})
    parameters = SubElement(root, f"{{{SSV}}}Parameters")
    for name, value in given.values.items():
        parameter = SubElement(parameters, f"{{{SSV}}}Parameter", {"name": name})
        SubElement(parameter, f"{{{SSV}}}Real", {"value": repr(value)})
    return root


def _component(parent: Element, part: Component, ends: Mapping[str, tuple[str, ...]]) -> None:
    """`ends`: kind of connector -> variables."""
    node = SubElement(
        parent,
        f"{{{SSD}}}Component",
        {"name": part.name, "type": "application/x-fmu-sharedlibrary", "source": f"resources/{part.fmu.name}"},
    )
    connectors = SubElement(node, f"{{{SSD}}}Connectors")
    for kind, names in ends.items():
        for each in names:
            connector = SubElement(connectors, f"{{{SSD}}}Connector", {"name": each, "kind": kind})
            variable = part.model.by_name[each]
            SubElement(connector, f"{{{SSC}}}{variable.kind}", {"unit": variable.unit} if variable.unit else {})
    bindings = SubElement(node, f"{{{SSD}}}ParameterBindings")
    SubElement(bindings, f"{{{SSD}}}ParameterBinding", {"source": part.given.path})


def _annotation(parent: Element, kind: str) -> Element:
    return SubElement(SubElement(parent, f"{{{SSD}}}Annotations"), f"{{{SSC}}}Annotation", {"type": kind})


def _annotate_for_osp(experiment: Element, step: float) -> None:
    """The Open Simulation Platform's master: libcosim."""
    algorithm = SubElement(_annotation(experiment, "com.opensimulationplatform"), f"{{{OSP}}}Algorithm")
    SubElement(algorithm, f"{{{OSP}}}FixedStepAlgorithm", {"baseStepSize": repr(step)})


def _annotate_for_openmodelica(system: Element, step: float) -> None:
    """OMSimulator's master."""
    annotations = SubElement(_annotation(system, "org.openmodelica"), f"{{{OMS}}}Annotations")
    information = SubElement(annotations, f"{{{OMS}}}SimulationInformation")
    tolerances = {"absoluteTolerance": "1e-4", "relativeTolerance": "1e-4"}  # its own; a fixed step needs none
    SubElement(
        information, f"{{{OMS}}}FixedStepMaster", {"description": "oms-ma", "stepSize": repr(step), **tolerances}
    )
