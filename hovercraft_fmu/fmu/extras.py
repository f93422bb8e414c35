"""FMI 3.0's build description for the sources, which FMI 2.0.4 lets an FMU carry, too; its terminals and icon."""

from collections.abc import Iterable
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, register_namespace

from .description import Flavour, xml
from .interface import ACTUATORS, EXTERNAL
from .variable import Model

LS_REF, LS_MANIFEST = "org.fmi-standard.fmi-ls-ref", "http://fmi-standard.org/fmi-ls-manifest"
register_namespace("fmi-ls", LS_MANIFEST)
RESULT = Path(__file__).parent / "extra" / "out.csv"
"""As `studies/pages.py` wrote it, from a run of the native FMU: its bits depend on no machine."""
ICON = Path(__file__).with_name("icon.png")
"""The craft from above, 128 x 128."""
ICON_SIZE, ICON_MM = 100.0, 20.0
"""Width and height of the icon, in units of the diagram and in mm."""


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


def terminals(model: Model) -> dict[str, dict[str, str]]:
    """Terminal -> member -> variable: inputs and outputs that belong together, what a host may connect at once.

    By the scheme that FMI 3.0.2 suggests (2.4.9.2) a variable is named TERMINAL.MEMBER; and there are the commands, and
    the load from outside.
    """
    found: dict[str, dict[str, str]] = {}
    for variable in model.variables:
        terminal, _, member = variable.name.rpartition(".")
        if variable.name in ACTUATORS:
            terminal, member = "actuators", variable.name
        elif variable.name in EXTERNAL:
            terminal, member = "load", variable.name.removeprefix("external.")
        if terminal and variable.causality in ("input", "output"):
            found.setdefault(terminal, {})[member] = variable.name
    return found


def terminals_and_icons(model: Model) -> Element:
    """terminalsAndIcons/terminalsAndIcons.xml; the icon stands beside it.

    In FMUs of FMI 3.0 alone: FMI 2.0.4 allows one of version 3.0, but FMI Library takes it there for a fatal error.
    """
    root = Element("fmiTerminalsAndIcons", {"fmiVersion": "3.0"})
    graphics = SubElement(root, "GraphicalRepresentation")
    half = ICON_SIZE / 2
    corners = {"x1": repr(-half), "y1": repr(-half), "x2": repr(half), "y2": repr(half)}
    SubElement(graphics, "CoordinateSystem", {**corners, "suggestedScalingFactorTo_mm": repr(ICON_MM / ICON_SIZE)})
    SubElement(graphics, "Icon", corners)
    parent = SubElement(root, "Terminals")
    for terminal, members in terminals(model).items():
        # bus: the other side may have some of them alone
        node = SubElement(parent, "Terminal", {"name": terminal, "matchingRule": "bus"})
        for member, name in members.items():
            attributes = {"variableName": name, "memberName": member, "variableKind": "signal"}
            SubElement(node, "TerminalMemberVariable", attributes)
    return root


def reference_result(flavour: Flavour) -> dict[str, bytes]:
    """What the default experiment gives, with the manifest of FMI-LS-REF 1.0.0-alpha.1: path -> content. None of a
    variant, which gives something else.
    """
    if flavour.variant_of:
        return {}
    file = f"{flavour.identifier}_out.csv"
    root = Element(
        "fmiReferences",
        {
            f"{{{LS_MANIFEST}}}fmi-ls-name": LS_REF,
            f"{{{LS_MANIFEST}}}fmi-ls-version": "1.0.0-alpha.1",
            f"{{{LS_MANIFEST}}}fmi-ls-description": "Files that are related to this FMU",
        },
    )
    about = "Outputs of the default experiment, every second"
    SubElement(root, "Related", {"type": "text/csv", "source": file, "role": "result", "description": about})
    return {f"extra/{LS_REF}/fmi-ls-manifest.xml": xml(root), f"extra/{LS_REF}/{file}": RESULT.read_bytes()}
