"""The table of variables -> modelDescription.xml, for every flavour of the FMU: FMI 2.0 or 3.0."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Literal
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from .._version import RELEASE_DATE, __version__
from ..model.error_estimate import OFF
from .block import guid
from .craft_native import CRAFT_NATIVE
from .interface import CRAFT_PARAMETERS, DERIVATIVES, EXTERNAL, HOVERCRAFT, INPUTS, STATES, TIME
from .native_header import Native
from .variable import UNITS, Kind, Model, Unit, Variable

AUTHOR = "The hovercraft-fmu authors"
LICENSE = "MIT"
START_TIME = 0.0
"""s: of the default experiment. It names no tolerance: masters would pass it on to the FMU."""
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
NATIVE_CAPABILITIES = {"providesDirectionalDerivative": "true"}
CAPABILITIES_3 = {
    "needsExecutionTool": "false",
    "canBeInstantiatedOnlyOncePerProcess": "false",
    "canGetAndSetFMUState": "true",
    "canSerializeFMUState": "true",
    "providesDirectionalDerivatives": "true",
    "providesAdjointDerivatives": "true",
    "providesPerElementDependencies": "false",
    "providesEvaluateDiscreteStates": "false",
}
"""Of FMI 3.0, whatever the interface. Early return and clocks: nothing that could check them."""
STEPS_ALONE = (("skirt_friction", 0.0), ("error_estimate", OFF))
"""What co-simulation alone offers, and its value that is off."""
ROOM_PARTS = (
    "exchange.c",
    "instance.c",
    "memory.c",
    "messages.c",
    "permits.c",
    "rates.c",
    "serialize.c",
    "step.c",
    "text.c",
    "variables.c",
    "variant.c",
)
"""The C of every native FMU, beside the face of its standard."""
LOG_CATEGORIES = {
    "logStatusWarning": "What the run survives but its user should know",
    "logStatusDiscard": "A call that was refused, where other values, another step or another state can be tried",
    "logStatusError": "A call that was refused",
    "logAll": "Everything",
}
FMI_3_TYPES: Mapping[Kind, str] = {
    "Real": "Float64",
    "Integer": "Int32",
    "Enumeration": "Enumeration",
    "Boolean": "Boolean",
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
    native: Native | None = None
    """Its C; None: it is not machine code."""
    fmi: Literal[2, 3] = 2
    """The version of the standard."""
    in_browsers: bool = False
    """It is compiled for browsers, too: view/page has a page that carries it."""
    variant_of: "Flavour | None" = None
    """Whose code it has, with start values of its own."""

    @property
    def parts(self) -> tuple[str, ...]:
        """Files of C in sources/, which `unit` includes; the face first. None where there is no C."""
        return (f"fmi{self.fmi}.c", *sorted((*ROOM_PARTS, *self.native.parts))) if self.native else ()

    @property
    def unit(self) -> str:
        """The one file of C to compile: both standards want it named after the model identifier."""
        return f"{self.identifier}.c"

    def of(self, model: Model) -> "Flavour":
        """The same kind of FMU of another model."""
        return replace(self, model=model, identifier=model.name)

    def variant(self, name: str, starts: Mapping[str, float | int]) -> "Flavour":
        """The same FMU under another name, with start values of its own. Where skirt and ground rub, or its error is
        estimated, it offers no model exchange.
        """
        model = self.model.variant(name, starts)
        alone = any(name in model.by_name and model.by_name[name].start != off for name, off in STEPS_ALONE)
        return replace(self.of(model), exchange={} if alone else self.exchange, variant_of=self)

    @property
    def own_starts(self) -> dict[str, float | int]:
        """The start values of a variant that are its own, by name."""
        before = (self.variant_of or self).model.by_name
        starts = {v.name: v.start for v in self.model.variables if v.start is not None}
        return {name: start for name, start in starts.items() if repr(start) != repr(before[name].start)}


PYTHON = Flavour(
    model=HOVERCRAFT,
    identifier=HOVERCRAFT.name,
    tool="PythonFMU",
    capabilities=MappingProxyType(CAPABILITIES),
    categories=MappingProxyType(
        {
            "logStatusFatal": "A call that was refused, as pythonfmu's wrapper reports it: the instance must be freed",
            **LOG_CATEGORIES,
            "cppfmu": "A function of FMI that pythonfmu's wrapper does not have",
        }
    ),
)
NATIVE = Flavour(
    model=HOVERCRAFT,
    identifier=f"{HOVERCRAFT.name}Native",
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
    native=CRAFT_NATIVE,
)
NATIVE3 = Flavour(
    model=HOVERCRAFT,
    identifier=f"{HOVERCRAFT.name}Native3",
    tool="zig cc",
    capabilities=MappingProxyType(
        {
            "canHandleVariableCommunicationStepSize": "true",
            "maxOutputDerivativeOrder": "1",
            "providesIntermediateUpdate": "true",
            "mightReturnEarlyFromDoStep": "false",
            "canReturnEarlyAfterIntermediateUpdate": "false",
            "hasEventMode": "false",
            **CAPABILITIES_3,
        }
    ),
    exchange=MappingProxyType({"needsCompletedIntegratorStep": "true", **CAPABILITIES_3}),
    categories=MappingProxyType(LOG_CATEGORIES),
    native=CRAFT_NATIVE,
    fmi=3,
    in_browsers=True,
)


def model_description(build: str, flavour: Flavour = PYTHON) -> Element:
    """The description of the FMU whose content has the hexadecimal digest `build`, as an XML tree."""
    model = flavour.model
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": f"{flavour.fmi}.0",
            "modelName": model.name,
            "guid" if flavour.fmi == 2 else "instantiationToken": guid(build),
            "description": model.description,
            "author": AUTHOR,
            "version": __version__,
            "copyright": f"Copyright (c) {RELEASE_DATE[:4]} {AUTHOR}",
            "license": LICENSE,
            "generationTool": f"hovercraft-fmu {__version__} with {flavour.tool}",
            "generationDateAndTime": RELEASE_DATE,
            "variableNamingConvention": "structured",
            **({"numberOfEventIndicators": "0"} if flavour.exchange and flavour.fmi == 2 else {}),
        },
    )
    if flavour.exchange:
        _interface(root, "ModelExchange", flavour, flavour.exchange)
    _interface(root, "CoSimulation", flavour, flavour.capabilities)
    _units(SubElement(root, "UnitDefinitions"), flavour)
    _types(SubElement(root, "TypeDefinitions"), flavour)
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
    for variable in model.variables if flavour.fmi == 2 else (TIME, *model.variables):
        _variable(variables, variable, flavour)
    _structure(SubElement(root, "ModelStructure"), flavour)
    return root


def xml(root: Element) -> bytes:
    """The tree as the content of a file."""
    indent(root)
    text: bytes = tostring(root, encoding="UTF-8", xml_declaration=True)
    return text + b"\n"


def _interface(parent: Element, name: str, flavour: Flavour, capabilities: Mapping[str, str]) -> None:
    node = SubElement(parent, name, {"modelIdentifier": flavour.identifier, **capabilities})
    if flavour.parts and flavour.fmi == 2:  # FMI 3.0 has them in sources/buildDescription.xml
        SubElement(SubElement(node, "SourceFiles"), "File", {"name": flavour.unit})


def _units_of(flavour: Flavour) -> Mapping[str, Unit]:
    """Of its variables; in FMI 3.0 the time is one of them."""
    own = flavour.model.units
    return {**own, "s": UNITS["s"]} if flavour.fmi == 3 else own


def _units(parent: Element, flavour: Flavour) -> None:
    for name, unit in _units_of(flavour).items():
        node = SubElement(parent, "Unit", {"name": name})
        SubElement(node, "BaseUnit", {base: str(exponent) for base, exponent in unit.base.items()})
        if unit.display:
            display, factor = unit.display
            SubElement(node, "DisplayUnit", {"name": display, "factor": repr(factor)})


def _types(parent: Element, flavour: Flavour) -> None:
    for name, unit in _units_of(flavour).items():
        attributes = {"name": unit.type_name, "description": f"{unit.quantity} in {name}"}
        real = _typed(parent, "SimpleType", "Real", attributes, flavour.fmi)
        real.set("quantity", unit.quantity)
        real.set("unit", name)
        if unit.display:
            real.set("displayUnit", unit.display[0])
    for each in flavour.model.enumerations:
        attributes = {"name": each.type_name, "description": each.description}
        items = _typed(parent, "SimpleType", "Enumeration", attributes, flavour.fmi)
        items.set("quantity", each.type_name)
        for number, (name, text) in enumerate(each.items, 1):
            SubElement(items, "Item", {"name": name, "value": str(number), "description": text})


def _typed(parent: Element, tag: str, kind: Kind, attributes: dict[str, str], fmi: int) -> Element:
    """The element for what a type defines: FMI 2.0 nests it, FMI 3.0 names the outer one after the type."""
    if fmi == 2:
        return SubElement(SubElement(parent, tag, attributes), kind)
    return SubElement(parent, FMI_3_TYPES[kind] + ("Type" if tag == "SimpleType" else ""), attributes)


def _variable(parent: Element, variable: Variable, flavour: Flavour) -> None:
    attributes = {
        "name": variable.name,
        "valueReference": str(variable.reference),
        "description": variable.description,
        "causality": variable.causality,
        "variability": variable.variability,
    }
    if variable.initial:
        attributes["initial"] = variable.initial
    if variable.causality == "input" and flavour.capabilities.get("providesIntermediateUpdate") == "true":
        attributes["intermediateUpdate"] = "true"
    node = _typed(parent, "ScalarVariable", variable.kind, attributes, flavour.fmi)
    if variable.enumeration:
        node.set("declaredType", variable.enumeration.type_name)
    if variable.unit:
        unit = _units_of(flavour)[variable.unit]
        node.set("declaredType", unit.type_name)
        node.set("quantity", unit.quantity)
        node.set("unit", variable.unit)
        if unit.display:
            node.set("displayUnit", unit.display[0])
    numbers = {"min": variable.minimum, "max": variable.maximum, "nominal": variable.nominal, "start": variable.start}
    for name, value in numbers.items():
        if value is not None:
            node.set(name, repr(value))  # repr: the shortest text that gives the same bits
    if variable.derivative_of and flavour.exchange:  # it points into the list of derivatives, which no other FMU has
        node.set("derivative", _place(variable.derivative_of, flavour))


def _place(name: str, flavour: Flavour) -> str:
    """How one variable refers to another."""
    model = flavour.model
    return str(model.index[name] if flavour.fmi == 2 else model.by_name[name].reference)


def _followed(acceleration: str, flavour: Flavour) -> tuple[str, ...]:
    """The states and inputs that an acceleration follows, and in FMI 3.0 the tunable parameters; thrust has no moment,
    rotational drag is one; a load from outside is along one of them.
    """
    turns = acceleration == "acceleration.yaw"
    tunable = [
        v.name for v in flavour.model.variables if v.name in CRAFT_PARAMETERS and v.variability == "tunable"
    ] if flavour.fmi == 3 else []  # fmt: skip
    names = (*INPUTS, "pose.heading", "velocity.x", "velocity.y", "velocity.yaw_rate", *tunable)
    force = f"external.force.{acceleration[-1]}"
    own = ("external.moment", "rotational_drag") if turns else (force, "thrust", "thrust_min", "thrust_max")
    others = {*EXTERNAL, "thrust", "thrust_min", "thrust_max", "rotational_drag"} - {*own}
    return tuple(name for name in names if name not in others)


def _followed_initially(acceleration: str) -> tuple[str, ...]:
    """And the parameters. At rest on ground that rubs each acceleration follows the whole push: a moment, too, the
    thrust, mass and inertia. Rotational drag is a moment, and nothing at rest.
    """
    parameters = tuple(
        name for name in CRAFT_PARAMETERS if not (name == "rotational_drag" and acceleration != "acceleration.yaw")
    )
    return (*INPUTS, "pose.heading", "velocity.x", "velocity.y", "velocity.yaw_rate", *parameters)


def _structure(parent: Element, flavour: Flavour) -> None:
    # In co-simulation an output belongs to a communication point: it never follows the inputs of that point, so there
    # are no dependencies. Without saying so, masters see algebraic loops that are not there. In model exchange it
    # follows the states, and no inputs either.
    table = flavour.model.variables
    outputs = {v.name: (v.name,) if v.name in STATES else v.depends_on for v in table if v.causality == "output"}
    initial = {
        v.name: v.depends_on
        for v in table
        if v.initial == "calculated" and v.causality in ("output", "calculatedParameter")
    }
    derivatives = {name: (name,) if name in STATES else _followed(name, flavour) for name in DERIVATIVES}
    if not flavour.exchange:
        outputs, derivatives = dict.fromkeys(outputs, ()), {}
    calculated = {v.name for v in table if v.initial == "calculated"}
    initial |= {name: _followed_initially(name) for name in derivatives if name in calculated}
    initial = dict(sorted(initial.items(), key=lambda unknown: flavour.model.index[unknown[0]]))
    _unknowns(parent, "Output", outputs, flavour)
    _unknowns(parent, "Derivative" if flavour.fmi == 2 else "ContinuousStateDerivative", derivatives, flavour)
    _unknowns(parent, "InitialUnknown", initial, flavour)


def _unknowns(parent: Element, role: str, dependencies: Mapping[str, tuple[str, ...]], flavour: Flavour) -> None:
    """FMI 2.0 has a list for each role, FMI 3.0 elements of that name."""
    if not dependencies:
        return
    if flavour.fmi == 2:
        parent, tag, key = SubElement(parent, f"{role}s"), "Unknown", "index"
    else:
        tag, key = role, "valueReference"
    for name, others in dependencies.items():
        ordered = sorted(others, key=lambda other: int(_place(other, flavour)))
        places = " ".join(_place(other, flavour) for other in ordered)
        node = SubElement(parent, tag, {key: _place(name, flavour), "dependencies": places})
        if flavour.fmi == 3:  # a state is its own output, and a velocity the derivative of a position: the factor is 1
            node.set("dependenciesKind", " ".join("constant" if other == name else "dependent" for other in ordered))
