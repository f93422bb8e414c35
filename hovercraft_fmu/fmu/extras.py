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
    """sources/buildDescription.xml: the file to compile, with any compiler; for GCC (and Clang, which takes the same)
    the options of the binaries, too.
    """
    root = Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    for compiler in ({}, {"compiler": "gcc", "compilerOptions": " ".join(options)}):
        configuration = SubElement(root, "BuildConfiguration", {"modelIdentifier": flavour.identifier})
        configuration.set("description", "GCC or Clang, as the binaries" if compiler else "any compiler of C11")
        files = SubElement(configuration, "SourceFileSet", {"language": "C11", **compiler})
        SubElement(files, "SourceFile", {"name": flavour.unit})
        definition = {
            "name": f"FMI{flavour.fmi}_OVERRIDE_FUNCTION_PREFIX",
            "optional": "true",
            "value": "",
            "description": "For a library that is loaded: the FMI functions have no prefix",
        }
        SubElement(files, "PreprocessorDefinition", definition)
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
