"""The table of variables -> modelDescription.xml, for both flavours of the FMU."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from xml.etree.ElementTree import Element, SubElement

from .._version import RELEASE_DATE, __version__
from .interface import CRAFT_PARAMETERS, DERIVATIVES, INPUTS, STATES, VARIABLES, Model, Variable

MODEL_NAME = "Hovercraft"
DESCRIPTION = (
    "Hovercraft that moves in the plane: a rigid body with one propeller, two bow thrusters, and air drag that acts "
    "behind the centre of gravity"
)
AUTHOR = "The hovercraft-fmu authors"
LICENSE = "MIT"
START_TIME, STOP_TIME, COMMUNICATION_STEP = 0.0, 60.0, 0.01
"""s: the default experiment. It names no tolerance: masters would pass it on to the FMU."""
HOVERCRAFT = Model(MODEL_NAME, DESCRIPTION, VARIABLES, STOP_TIME, COMMUNICATION_STEP)
COMMON_CAPABILITIES = {
    "canBeInstantiatedOnlyOncePerProcess": "false",
    "canNotUseMemoryManagementFunctions": "true",
    "canGetAndSetFMUstate": "true",
    "canSerializeFMUstate": "true",
    "providesDirectionalDerivative": "false",
    # the model is inside and runs in the host's own process, in any Python 3; no tool runs it elsewhere
    "needsExecutionTool": "false",
}
CAPABILITIES = {
    **COMMON_CAPABILITIES,
    "canHandleVariableCommunicationStepSize": "true",
    "canInterpolateInputs": "false",
    "maxOutputDerivativeOrder": "0",
    "canRunAsynchronuously": "false",  # sic: the schema spells it so
}
NATIVE_CAPABILITIES = {"canNotUseMemoryManagementFunctions": "false", "providesDirectionalDerivative": "true"}
LOG_CATEGORIES = {
    "logStatusWarning": "What the run survives but its user should know",
    "logStatusError": "A call that was refused",
    "logAll": "Everything",
}


@dataclass(frozen=True)
class Flavour:
    """What is not the same in every FMU."""

    model: Model
    identifier: str
    """FMI's modelIdentifier: the name of the binaries."""
    tool: str
    capabilities: Mapping[str, str]
    categories: Mapping[str, str]
    exchange: Mapping[str, str] = field(default_factory=dict)
    """The capabilities in model exchange; none where there is no such interface."""
    sources: tuple[str, ...] = ()
    """Files of sources/ to compile."""

    def of(self, model: Model) -> "Flavour":
        """The same kind of FMU of another model."""
        return replace(self, model=model, identifier=model.name)


PYTHON = Flavour(
    model=HOVERCRAFT,
    identifier=MODEL_NAME,
    tool="PythonFMU",
    capabilities=MappingProxyType(CAPABILITIES),
    categories=MappingProxyType(
        {
            "logStatusFatal": "A call that was refused, as pythonfmu's wrapper reports it: the instance must be freed",
            **LOG_CATEGORIES,
        }
    ),
)
NATIVE = Flavour(
    model=HOVERCRAFT,
    identifier=f"{MODEL_NAME}Native",
    tool="zig cc",
    capabilities=MappingProxyType(
        {
            **CAPABILITIES,
            **NATIVE_CAPABILITIES,
            "canInterpolateInputs": "true",
            "maxOutputDerivativeOrder": "1",
        }
    ),
    exchange=MappingProxyType({**COMMON_CAPABILITIES, **NATIVE_CAPABILITIES}),
    categories=MappingProxyType(LOG_CATEGORIES),
    sources=(
        "exchange.c",
        "fmi2.c",
        "instance.c",
        "kernel.c",
        "linearization.c",
        "logarithm.c",
        "memory.c",
        "partials.c",
        "serialize.c",
        "text.c",
        "trig.c",
    ),
)


def model_description(build: str, flavour: Flavour = PYTHON) -> Element:
    """The description of the FMU whose content has the hexadecimal digest `build`, as an XML tree."""
    model = flavour.model
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": "2.0",
            "modelName": model.name,
            "guid": guid(build),
            "description": model.description,
            "author": AUTHOR,
            "version": __version__,
            "copyright": f"Copyright (c) {RELEASE_DATE[:4]} {AUTHOR}",
            "license": LICENSE,
            "generationTool": f"hovercraft-fmu {__version__} with {flavour.tool}",
            "generationDateAndTime": RELEASE_DATE,
            "variableNamingConvention": "structured",
            **({"numberOfEventIndicators": "0"} if flavour.exchange else {}),
        },
    )
    if flavour.exchange:
        _interface(root, "ModelExchange", flavour, flavour.exchange)
    _interface(root, "CoSimulation", flavour, flavour.capabilities)
    _units(SubElement(root, "UnitDefinitions"), model)
    _types(SubElement(root, "TypeDefinitions"), model)
    categories = SubElement(root, "LogCategories")
    for name, text in flavour.categories.items():
        SubElement(categories, "Category", {"name": name, "description": text})
    SubElement(
        root,
        "DefaultExperiment",
        {
            "startTime": repr(START_TIME),
            "stopTime": repr(model.stop_time),
            "stepSize": repr(model.communication_step),
        },
    )
    variables = SubElement(root, "ModelVariables")
    for variable in model.variables:
        _variable(variables, variable, model)
    _structure(SubElement(root, "ModelStructure"), model, bool(flavour.exchange))
    return root


def guid(build: str) -> str:
    """A digest in the shape of a GUID."""
    return f"{{{build[:8]}-{build[8:12]}-{build[12:16]}-{build[16:20]}-{build[20:32]}}}"


def _interface(parent: Element, name: str, flavour: Flavour, capabilities: Mapping[str, str]) -> None:
    node = SubElement(parent, name, {"modelIdentifier": flavour.identifier, **capabilities})
    if flavour.sources:
        files = SubElement(node, "SourceFiles")
        for name in flavour.sources:
            SubElement(files, "File", {"name": name})


def _units(parent: Element, model: Model) -> None:
    for name, unit in model.units.items():
        node = SubElement(parent, "Unit", {"name": name})
        SubElement(node, "BaseUnit", {base: str(exponent) for base, exponent in unit.base.items()})
        if unit.display:
            display, factor = unit.display
            SubElement(node, "DisplayUnit", {"name": display, "factor": repr(factor)})


def _types(parent: Element, model: Model) -> None:
    for name, unit in model.units.items():
        node = SubElement(parent, "SimpleType", {"name": unit.type_name, "description": f"{unit.quantity} in {name}"})
        real = SubElement(node, "Real", {"quantity": unit.quantity, "unit": name})
        if unit.display:
            real.set("displayUnit", unit.display[0])
    for each in model.enumerations:
        node = SubElement(parent, "SimpleType", {"name": each.type_name, "description": each.description})
        items = SubElement(node, "Enumeration", {"quantity": each.type_name})
        for number, (name, text) in enumerate(each.items, 1):
            SubElement(items, "Item", {"name": name, "value": str(number), "description": text})


def _variable(parent: Element, variable: Variable, model: Model) -> None:
    attributes = {
        "name": variable.name,
        "valueReference": str(variable.reference),
        "description": variable.description,
        "causality": variable.causality,
        "variability": variable.variability,
    }
    if variable.initial:
        attributes["initial"] = variable.initial
    _typed(SubElement(parent, "ScalarVariable", attributes), variable, model)


def _typed(parent: Element, variable: Variable, model: Model) -> None:
    node = SubElement(parent, variable.kind)
    if variable.enumeration:
        node.set("declaredType", variable.enumeration.type_name)
    if variable.unit:
        unit = model.units[variable.unit]
        node.set("declaredType", unit.type_name)
        node.set("quantity", unit.quantity)
        node.set("unit", variable.unit)
        if unit.display:
            node.set("displayUnit", unit.display[0])
    numbers = {"min": variable.minimum, "max": variable.maximum, "nominal": variable.nominal, "start": variable.start}
    for name, value in numbers.items():
        if value is not None:
            node.set(name, repr(value))  # repr: the shortest text that gives the same bits
    if variable.derivative_of:
        node.set("derivative", str(model.index[variable.derivative_of]))


def _structure(parent: Element, model: Model, exchange: bool) -> None:
    # In co-simulation an output belongs to a communication point: it never follows the inputs of that point, so there
    # are no dependencies. Without saying so, masters see algebraic loops that are not there. In model exchange it
    # follows the states, and no inputs either.
    outputs = SubElement(parent, "Outputs")
    for variable in model.variables:
        if variable.causality == "output":
            names = (variable.name,) if variable.name in STATES else variable.depends_on
            _unknown(outputs, model, variable.name, names if exchange else ())
    if exchange:
        derivatives = SubElement(parent, "Derivatives")
        for name in DERIVATIVES:
            _unknown(derivatives, model, name, (name,) if name in STATES else _followed(name))
    unknowns = SubElement(parent, "InitialUnknowns")
    for variable in model.variables:
        if variable.initial == "calculated" and variable.causality in ("output", "calculatedParameter"):
            _unknown(unknowns, model, variable.name, variable.depends_on)
        elif exchange and variable.initial == "calculated" and variable.name in DERIVATIVES:
            _unknown(unknowns, model, variable.name, _followed(variable.name) + CRAFT_PARAMETERS)


def _followed(acceleration: str) -> tuple[str, ...]:
    """The states and inputs that an acceleration follows; thrust has no moment."""
    inputs = tuple(name for name in INPUTS if not (name == "thrust" and acceleration == "acceleration.yaw"))
    return (*inputs, "pose.heading", "velocity.x", "velocity.y", "velocity.yaw_rate")


def _unknown(parent: Element, model: Model, name: str, dependencies: tuple[str, ...]) -> None:
    indices = sorted(model.index[each] for each in dependencies)
    SubElement(parent, "Unknown", {"index": str(model.index[name]), "dependencies": " ".join(map(str, indices))})
