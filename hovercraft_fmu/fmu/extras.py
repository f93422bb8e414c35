"""FMI 3.0's build description for the sources, terminals and icon; FMI 2.0.4 lets an FMU carry them, too."""

from collections.abc import Iterable, Mapping
from types import MappingProxyType
from xml.etree.ElementTree import Element, SubElement

from .description import Flavour
from .interface import INPUTS, STATES

TERMINALS: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "actuators": tuple(name for name in INPUTS if not name.startswith("wind.")),
        "wind": tuple(name for name in INPUTS if name.startswith("wind.")),
        "motion": STATES,
    }
)
"""Variables that belong together: what a host may connect at once."""
ICON_SIZE = 100.0
"""Units of the diagram."""


def build_description(flavour: Flavour, options: Iterable[str]) -> Element:
    """sources/buildDescription.xml: the files to compile together, and the compiler options that keep the bits."""
    root = Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    configuration = SubElement(root, "BuildConfiguration", {"modelIdentifier": flavour.identifier})
    files = SubElement(configuration, "SourceFileSet", {"language": "C11", "compilerOptions": " ".join(options)})
    for name in flavour.sources:
        SubElement(files, "SourceFile", {"name": name})
    return root


def terminals_and_icons() -> Element:
    """terminalsAndIcons/terminalsAndIcons.xml; the icon stands beside it."""
    root = Element("fmiTerminalsAndIcons", {"fmiVersion": "3.0"})
    graphics = SubElement(root, "GraphicalRepresentation")
    corners = {"x1": -ICON_SIZE / 2, "y1": -ICON_SIZE / 2, "x2": ICON_SIZE / 2, "y2": ICON_SIZE / 2}
    SubElement(graphics, "Icon", {name: repr(value) for name, value in corners.items()})
    parent = SubElement(root, "Terminals")
    for terminal, names in TERMINALS.items():
        node = SubElement(parent, "Terminal", {"name": terminal, "matchingRule": "plug"})
        for name in names:
            member = {"variableName": name, "memberName": name, "variableKind": "signal"}
            SubElement(node, "TerminalMemberVariable", member)
    return root
