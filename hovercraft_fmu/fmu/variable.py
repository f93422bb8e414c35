"""What a table of variables is made of: units, enumerations, rows, when a row may be set; and what follows from it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from functools import cached_property
from types import MappingProxyType
from typing import Literal, TypeAlias

Kind: TypeAlias = Literal["Real", "Integer", "Enumeration", "Boolean"]
Causality: TypeAlias = Literal["input", "output", "local", "parameter", "calculatedParameter", "independent"]
Variability: TypeAlias = Literal["continuous", "discrete", "fixed", "tunable"]


@dataclass(frozen=True)
class Unit:
    """A unit as FMI wants it: exponents of the SI base units, and what displays show instead."""

    type_name: str
    quantity: str
    base: Mapping[str, int]
    display: tuple[str, float] | None = None
    """Name and factor: display value = factor * value."""


DEGREES_PER_RADIAN = 57.29577951308232

UNITS: Mapping[str, Unit] = MappingProxyType(
    {
        "1": Unit("Ratio", "Dimensionless", {}),
        "1/rad": Unit("PerAngle", "PerAngle", {"rad": -1}),
        "kg": Unit("Mass", "Mass", {"kg": 1}),
        "kg.m2": Unit("MomentOfInertia", "MomentOfInertia", {"kg": 1, "m": 2}),
        "kg/m3": Unit("Density", "Density", {"kg": 1, "m": -3}),
        "kg/s": Unit("MassFlowRate", "MassFlowRate", {"kg": 1, "s": -1}),
        "m": Unit("Length", "Length", {"m": 1}),
        "m/s": Unit("Velocity", "Velocity", {"m": 1, "s": -1}),
        "m/s2": Unit("Acceleration", "Acceleration", {"m": 1, "s": -2}),
        "m2": Unit("Area", "Area", {"m": 2}),
        "N.s/m": Unit("Damping", "Damping", {"kg": 1, "s": -1}),
        "N/m": Unit("Stiffness", "Stiffness", {"kg": 1, "s": -2}),
        "N": Unit("Force", "Force", {"kg": 1, "m": 1, "s": -2}),
        "N.m": Unit("Moment", "Torque", {"kg": 1, "m": 2, "s": -2}),
        "rad": Unit("Angle", "Angle", {"rad": 1}, ("deg", DEGREES_PER_RADIAN)),
        "rad/s": Unit("AngularVelocity", "AngularVelocity", {"rad": 1, "s": -1}, ("deg/s", DEGREES_PER_RADIAN)),
        "rad/s2": Unit("AngularAcceleration", "AngularAcceleration", {"rad": 1, "s": -2}),
        "s": Unit("Time", "Time", {"s": 1}),
        "s/rad": Unit("TimePerAngle", "TimePerAngle", {"s": 1, "rad": -1}),
    }
)


@dataclass(frozen=True)
class Enumeration:
    """An enumeration as FMI wants it; the items are numbered from 1."""

    type_name: str
    description: str
    items: tuple[tuple[str, str], ...]
    """Name, description."""

    @property
    def listed(self) -> str:
        """Its items for a message: '1 (constant), 2 (directional)'."""
        return ", ".join(f"{number} ({name})" for number, (name, _) in enumerate(self.items, 1))

    def number(self, name: str) -> int | None:
        """The number of an item; None: there is none of that name."""
        names = [item for item, _ in self.items]
        return names.index(name) + 1 if name in names else None


@dataclass(frozen=True)
class Variable:
    """A row of the table. Names and value references stay as they are within a major version."""

    reference: int
    name: str
    causality: Causality
    variability: Variability
    unit: str | None
    start: float | int | None
    description: str
    kind: Kind = "Real"
    minimum: float | None = None
    maximum: float | None = None
    nominal: float | None = None
    derivative_of: str | None = None
    depends_on: tuple[str, ...] = ()
    """For a calculated output or parameter: the start values that its own start follows from."""
    enumeration: Enumeration | None = None
    """The choices of a variable of this kind."""
    chooses: str | None = None
    """The Enumeration that this Integer stands beside: 0, or the number of an item of it."""

    @property
    def initial(self) -> str | None:
        """FMI's `initial`: exact where a start is given, else calculated; none for an input and for the time."""
        if self.causality in ("input", "independent"):
            return None
        return "calculated" if self.start is None else "exact"

    def shown(self, value: float | int) -> str:
        """A value of it in words: an item of an enumeration by name, a real with its unit."""
        if self.enumeration:
            return self.enumeration.items[int(value) - 1][0]
        return f"{value!r} {self.unit}" if self.unit not in (None, "1") else repr(value)


class Phase(Enum):
    """Where the instance is in FMI's life cycle, in the words of the standard."""

    INSTANTIATED = "instantiated"
    INITIALIZING = "initialization mode"
    STEPPING = "step mode"
    TERMINATED = "terminated"


def may_be_set(variable: Variable, phase: Phase) -> bool:
    """Whether a host may set it there: start values before the first step, then inputs and what is tunable."""
    if phase is Phase.STEPPING:
        return variable.causality == "input" or variable.variability == "tunable"
    return phase is not Phase.TERMINATED and variable.start is not None


@dataclass(frozen=True)
class Model:
    """What an FMU is of: its table of variables, and what follows from that."""

    name: str
    description: str
    variables: tuple[Variable, ...]
    stop_time: float
    """s, of the default experiment"""
    communication_step: float
    """s, of the default experiment"""

    def variant(self, name: str, starts: Mapping[str, float | int]) -> "Model":
        """The same with another name, and start values of its own."""
        variables = tuple(replace(each, start=starts.get(each.name, each.start)) for each in self.variables)
        starts = {each.name: starts[each.name] for each in self.variables if each.name in starts}
        own = f"; with start values of its own: {self.listed(starts)}" if starts else ""
        return replace(self, name=name, description=self.description + own, variables=variables)

    def listed(self, values: Mapping[str, float | int]) -> str:
        """Values of variables in words: 'integrator = rk4, step_size = 0.1 s'."""
        return ", ".join(f"{name} = {self.by_name[name].shown(value)}" for name, value in values.items())

    @cached_property
    def by_reference(self) -> Mapping[int, Variable]:
        """Value reference -> variable."""
        return {variable.reference: variable for variable in self.variables}

    @cached_property
    def by_name(self) -> Mapping[str, Variable]:
        """Name -> variable."""
        return {variable.name: variable for variable in self.variables}

    @cached_property
    def index(self) -> Mapping[str, int]:
        """Place in ModelVariables, counted from 1: what the model structure refers to."""
        return {variable.name: i for i, variable in enumerate(self.variables, 1)}

    @cached_property
    def inputs(self) -> frozenset[int]:
        """References of the inputs."""
        return frozenset(v.reference for v in self.variables if v.causality == "input")

    @cached_property
    def kept(self) -> tuple[int, ...]:
        """References of the Reals that are kept as the host set them: inputs and parameters."""
        return tuple(
            v.reference
            for v in self.variables
            if v.kind == "Real" and v.start is not None and v.causality in ("input", "parameter")
        )

    @cached_property
    def units(self) -> Mapping[str, Unit]:
        """Name -> unit, of those that its variables have."""
        used = {variable.unit for variable in self.variables}
        return {name: unit for name, unit in UNITS.items() if name in used}

    @cached_property
    def enumerations(self) -> tuple[Enumeration, ...]:
        """Of its variables, each once."""
        return tuple(dict.fromkeys(v.enumeration for v in self.variables if v.enumeration))

    @cached_property
    def choices(self) -> Mapping[str, Variable]:
        """Enumeration -> the Integer beside it."""
        return {variable.chooses: variable for variable in self.variables if variable.chooses}

    def check_choice(self, enumeration: str, number: int) -> None:
        """Raises ValueError where the Integer beside an Enumeration is neither 0 nor the number of an item."""
        items = self.by_name[enumeration].enumeration
        if items and not 0 <= number <= len(items.items):
            rule = f"must be 0 (as {enumeration} says) or one of {items.listed}"
            raise ValueError(f"{self.choices[enumeration].name} = {number}: {rule}")

    def chosen(self, enumeration: str, item: int, number: int) -> int:
        """The item that an Enumeration and the Integer beside it say together.

        Raises:
            ValueError: both are set, which an Enumeration is where it has not its start value, and they differ.
        """
        if number not in (0, item) and item != self.by_name[enumeration].start:
            both = f"{enumeration} = {item} and {self.choices[enumeration].name} = {number}"
            raise ValueError(f"{both}: must be the same where both are set")
        return number or item
