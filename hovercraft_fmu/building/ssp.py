"""The closed loop as one SSP file: hovercraft, autopilot, their connections, a parameter set; for any master."""

import os
from collections.abc import Mapping
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, register_namespace

from .._version import RELEASE_DATE, __version__
from ..autopilot.pilot_interface import AUTOPILOT_MODEL, COMMANDS, ORDERS
from ..fmu.archive import write_archive, zipped
from ..fmu.description import AUTHOR, xml
from ..fmu.document import rendered
from ..fmu.interface import CRAFT_PARAMETERS, HOVERCRAFT, STATES, WIND
from ..fmu.variable import Variable
from ..model.craft import preset
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
PARAMETERS, ORDERS_FILE, ICE_FILE = (f"resources/{name}.ssv" for name in (CRAFT, PILOT, "ice"))
HERE = Path(__file__).parent
PAGE = "loop.html"


def build_ssp(
    path: str | os.PathLike[str], craft: Path, autopilot: Path, voyage: Voyage = VOYAGES["crosswind"]
) -> Path:
    """Write the loop of two FMUs on a voyage to `path` and return the path; two builds give the same bytes.

    Raises:
        ValueError: the name does not end in .ssp.
        OSError: a file cannot be read or written.
    """
    sets = parameter_sets(voyage)
    files = {
        "SystemStructure.ssd": xml(system_structure(voyage, craft.name, autopilot.name)),
        **{file: xml(parameter_set(Path(file).stem, values)) for file, _, values in sets},
        f"documentation/{PAGE}": _page(voyage, craft.name, autopilot.name).encode(),
        f"resources/{craft.name}": craft.read_bytes(),
        f"resources/{autopilot.name}": autopilot.read_bytes(),
    }
    return write_archive(path, lambda: zipped(files), ".ssp")


def parameter_sets(voyage: Voyage) -> tuple[tuple[str, str, Mapping[str, float]], ...]:
    """File, whose it is, start values by name: the first two are bound. The autopilot is told the craft."""
    craft = {**dict.fromkeys(WIND, 0.0), **preset_values("textbook"), **voyage.craft}
    orders = {name: AUTOPILOT_MODEL.by_name[name].start for name in ("acceptance_radius", "cruise_speed")}
    told = {name: craft[name] for name in ORDERS if name in CRAFT_PARAMETERS and name in craft}
    pilot = {**{name: float(start or 0.0) for name, start in orders.items()}, **told, **voyage.autopilot}
    ice = {**craft, **preset_values("ice")}
    return (PARAMETERS, CRAFT, craft), (ORDERS_FILE, PILOT, pilot), (ICE_FILE, CRAFT, ice)


def preset_values(name: str) -> dict[str, float]:
    """What of a craft the sets give: what the autopilot is told, and the air."""
    craft = preset(name)
    return {each: getattr(craft, each) for each in ("mass", "inertia", "length", "steering_force", "air_density")}


def _page(voyage: Voyage, craft: str, autopilot: str) -> str:
    names = [Path(each).stem for each in (craft, autopilot)]
    values = {
        "name": f"{names[0]}Loop.ssp", "craft": craft, "autopilot": autopilot, "voyage": voyage,
        "sets": parameter_sets(voyage), "native": names[1] != AUTOPILOT_MODEL.name,
    }  # fmt: skip
    return rendered(HERE, values)[PAGE]


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
    (_, _, given), (_, _, told), _ = parameter_sets(voyage)
    parameters = tuple(name for name in given if name not in WIND)  # an input: fmpy.ssp would hold it at 0
    ends_of_craft = {"input": COMMANDS, "output": STATES, "parameter": parameters}
    ends_of_pilot = {"input": STATES, "output": (*COMMANDS, *SHOWN), "parameter": tuple(told)}
    _component(elements, CRAFT, craft, HOVERCRAFT.by_name, ends_of_craft, PARAMETERS)
    _component(elements, PILOT, autopilot, AUTOPILOT_MODEL.by_name, ends_of_pilot, ORDERS_FILE)
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


def parameter_set(set_name: str, values: Mapping[str, float]) -> Element:
    """An SSV file: start values by name, all of them Reals, which every reader takes."""
    root = Element(f"{{{SSV}}}ParameterSet", {"version": "1.0", "name": set_name})
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
    ends: Mapping[str, tuple[str, ...]],
    parameters: str,
) -> None:
    """`ends`: kind of connector -> variables."""
    node = SubElement(
        parent,
        f"{{{SSD}}}Component",
        {"name": name, "type": "application/x-fmu-sharedlibrary", "source": f"resources/{source}"},
    )
    connectors = SubElement(node, f"{{{SSD}}}Connectors")
    for kind, names in ends.items():
        for each in names:
            connector = SubElement(connectors, f"{{{SSD}}}Connector", {"name": each, "kind": kind})
            unit = variables[each].unit
            SubElement(connector, f"{{{SSC}}}{variables[each].kind}", {"unit": unit} if unit else {})
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
