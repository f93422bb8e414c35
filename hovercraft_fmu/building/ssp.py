"""The closed loop as one SSP file: hovercraft, autopilot, their connections, a parameter set; for any master."""

import os
from collections.abc import Mapping
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, register_namespace

from .._version import RELEASE_DATE, __version__
from ..autopilot.pilot_interface import AUTOPILOT_MODEL, COMMANDS
from ..fmu.archive import write_archive, zipped
from ..fmu.description import AUTHOR, xml
from ..fmu.interface import HOVERCRAFT, STATES
from ..fmu.variable import Variable
from ..scenes import VOYAGES, Voyage

CRAFT, PILOT = "hovercraft", "autopilot"
"""The names of the components."""
OF_SSP = "http://ssp-standard.org/SSP1/SystemStructure"
SSC, SSD, SSV = f"{OF_SSP}Common", f"{OF_SSP}Description", f"{OF_SSP}ParameterValues"
OSP = "http://opensimulationplatform.com/SSP/OSPAnnotations"
OMS = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"
for _prefix, _uri in (("ssc", SSC), ("ssd", SSD), ("ssv", SSV), ("osp", OSP), ("oms", OMS)):
    register_namespace(_prefix, _uri)
SHOWN = tuple(v.name for v in AUTOPILOT_MODEL.variables if v.causality == "output" and v.name not in COMMANDS)
"""Outputs of the autopilot that nothing in the loop takes."""
PARAMETERS = f"resources/{CRAFT}.ssv"


def build_ssp(
    path: str | os.PathLike[str], craft: Path, autopilot: Path, voyage: Voyage = VOYAGES["crosswind"]
) -> Path:
    """Write the loop of two FMUs on a voyage to `path` and return the path; two builds give the same bytes.

    Raises:
        ValueError: the name does not end in .ssp.
        OSError: a file cannot be read or written.
    """
    files = {
        "SystemStructure.ssd": xml(system_structure(voyage, craft.name, autopilot.name)),
        PARAMETERS: xml(parameter_set(voyage.craft)),
        f"resources/{craft.name}": craft.read_bytes(),
        f"resources/{autopilot.name}": autopilot.read_bytes(),
    }
    return write_archive(path, lambda: zipped(files), ".ssp")


def system_structure(voyage: Voyage, craft: str, autopilot: str) -> Element:
    """SystemStructure.ssd; the arguments after the voyage are the names of the FMU files."""
    root = Element(
        f"{{{SSD}}}SystemStructureDescription",
        {
            "name": f"{Path(craft).stem}Loop",
            "version": "1.0",
            "description": f"A hovercraft and its autopilot; {voyage.description}",
            "author": AUTHOR,
            "fileversion": __version__,
            "generationTool": f"hovercraft-fmu {__version__}",
            "generationDateAndTime": RELEASE_DATE,
        },
    )
    system = SubElement(root, f"{{{SSD}}}System", {"name": "loop"})
    elements = SubElement(system, f"{{{SSD}}}Elements")
    _component(elements, CRAFT, craft, HOVERCRAFT.by_name, COMMANDS, STATES, PARAMETERS)
    _component(elements, PILOT, autopilot, AUTOPILOT_MODEL.by_name, STATES, (*COMMANDS, *SHOWN))
    connections = SubElement(system, f"{{{SSD}}}Connections")
    for start, end, names in ((CRAFT, PILOT, STATES), (PILOT, CRAFT, COMMANDS)):
        for name in names:
            ends = {"startElement": start, "startConnector": name, "endElement": end, "endConnector": name}
            SubElement(connections, f"{{{SSD}}}Connection", ends)
    _annotate_for_openmodelica(system, voyage.communication_step)
    units = SubElement(root, f"{{{SSD}}}Units")
    for name, unit in {**HOVERCRAFT.units, **AUTOPILOT_MODEL.units}.items():
        node = SubElement(units, f"{{{SSC}}}Unit", {"name": name})
        SubElement(node, f"{{{SSC}}}BaseUnit", {base: str(exponent) for base, exponent in unit.base.items()})
    experiment = SubElement(
        root, f"{{{SSD}}}DefaultExperiment", {"startTime": "0.0", "stopTime": repr(voyage.stop_time)}
    )
    _annotate_for_osp(experiment, voyage.communication_step)
    return root


def parameter_set(values: Mapping[str, float]) -> Element:
    """The SSV file: start values of the hovercraft, by name."""
    root = Element(f"{{{SSV}}}ParameterSet", {"version": "1.0", "name": CRAFT})
    parameters = SubElement(root, f"{{{SSV}}}Parameters")
    for name, value in values.items():
        parameter = SubElement(parameters, f"{{{SSV}}}Parameter", {"name": name})
        SubElement(parameter, f"{{{SSV}}}Real", {"value": repr(value)})
    return root


def _component(
    parent: Element,
    name: str,
    source: str,
    variables: Mapping[str, Variable],
    inputs: tuple[str, ...],
    outputs: tuple[str, ...],
    parameters: str | None = None,
) -> None:
    node = SubElement(
        parent,
        f"{{{SSD}}}Component",
        {"name": name, "type": "application/x-fmu-sharedlibrary", "source": f"resources/{source}"},
    )
    connectors = SubElement(node, f"{{{SSD}}}Connectors")
    for kind, names in (("input", inputs), ("output", outputs)):
        for each in names:
            connector = SubElement(connectors, f"{{{SSD}}}Connector", {"name": each, "kind": kind})
            unit = variables[each].unit
            SubElement(connector, f"{{{SSC}}}{variables[each].kind}", {"unit": unit} if unit else {})
    if parameters:
        bindings = SubElement(node, f"{{{SSD}}}ParameterBindings")
        SubElement(bindings, f"{{{SSD}}}ParameterBinding", {"source": parameters})


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
