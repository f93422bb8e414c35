"""Inputs that are linear over a step, handed to an FMU in the way that it takes them."""

import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeAlias

from ..model.subcycling import rounding
from .fmu_file import Fmu
from .instance import Instance, Intermediate, Port
from .messages import WARNING

LONGEST_PART = 0.1
"""s: of what is run with the value at its middle; the error of that goes with its square."""
Leg: TypeAlias = tuple[float, float, Sequence[float], Sequence[float], bool]
"""Start [s], end [s], the inputs at both, whether what is seen at the end is read."""


class _Line:
    """What inputs do in a step, for an FMU that asks for them inside it."""

    def __init__(self) -> None:
        self.time, self.first = 0.0, [0.0]
        self.slopes: list[float] | None = None
        """Per s; None: they hold."""

    def at(self, time: float) -> list[float] | None:
        """At a time [s]."""
        if self.slopes is None:
            return None
        passed = time - self.time
        return [value + passed * slope for value, slope in zip(self.first, self.slopes, strict=True)]


class Ramps:
    """Steps of an instance, each with inputs that go linearly from their values at its start to those at its end.

    An FMU of FMI 2.0 that can interpolate inputs is given their slopes, one of FMI 3.0 that asks for them inside a step
    the values. Any other is given the values at the middle, and where they change its steps are cut into parts no
    longer than LONGEST_PART. Inputs that hold are set, no more.
    """

    def __init__(self, craft: Instance, names: Sequence[str], line: _Line | None) -> None:
        self.craft, self.inputs = craft, craft.port(*names)
        self._line = line
        self._takes_slopes = not craft.is_fmi_3 and bool(craft.description.coSimulation.canInterpolateInputs)

    @classmethod
    @contextmanager
    def on(cls, fmu: Fmu, names: Sequence[str], ramped: bool) -> Iterator["Ramps"]:
        """A new instance; `ramped` is whether its inputs will ever change within a step: what asks pays for it."""
        asks = ramped and getattr(fmu.description.coSimulation, "providesIntermediateUpdate", False)
        line = _Line() if asks else None
        with fmu.instance(intermediate=Intermediate(names, line.at) if line else None) as craft:
            yield cls(craft, names, line)

    def step(self, time: float, end: float, first: Sequence[float], last: Sequence[float]) -> None:
        """From a communication point [s] to the next. Raises SimulationError: the FMU refused a call."""
        craft, inputs, line = self.craft, self.inputs, self._line
        if first == last:
            inputs.set(first)
            craft.step(time, end - time)
        elif self._takes_slopes:
            inputs.set(first)
            inputs.set_slopes(slopes(end - time, first, last))
            craft.step(time, end - time)
        elif line:
            inputs.set(first)
            line.time, line.first, line.slopes = time, list(first), slopes(end - time, first, last)
            try:
                craft.step(time, end - time)
            finally:
                line.slopes = None
        else:
            for begin, until, middle in parts(time, end, first, last):
                inputs.set(middle)
                craft.step(begin, until - begin)

    def follow(self, legs: Iterable[Leg], seen: Port, rows: Iterable[Any]) -> None:
        """Many steps, with what is asked again and again asked once: so they cost what their calls through ctypes cost.

        Args:
            legs: the steps; where inputs hold the same object at both ends saves a look.
            seen: variables of one type.
            rows: where what is read goes, one after the other; see `Port.over`.
        """
        craft, inputs, do_step = self.craft, self.inputs, self.craft.function("DoStep")
        is_fmi_3, component, row = craft.is_fmi_3, craft.component, iter(rows)
        get, references, count = seen.call
        held = None
        for time, end, first, last, kept in legs:
            if first is not last and first != last:
                self.step(time, end, first, last)
                held = None
            else:
                if first is not held and first != held:
                    inputs.set(first)
                held = first
                if is_fmi_3:
                    craft.step(time, end - time)
                elif (status := do_step(component, time, end - time, 1)) > WARNING:
                    craft.check(status)
            if kept and is_fmi_3:
                seen.get_into(next(row))
            elif kept and (status := get(component, references, count, next(row))) > WARNING:
                craft.check(status)


def slopes(duration: float, first: Sequence[float], last: Sequence[float]) -> list[float]:
    """Per s: of inputs that go from the first values to the last ones within a duration [s]."""
    return [(b - a) / duration for a, b in zip(first, last, strict=True)]


def parts(
    time: float, end: float, first: Sequence[float], last: Sequence[float]
) -> Iterator[tuple[float, float, list[float]]]:
    """(start, end) [s] of the parts of a step, and the inputs at the middle of each; one part where they hold."""
    duration = end - time
    longest = LONGEST_PART + rounding(max(abs(time), abs(end)), LONGEST_PART)
    n = 1 if first == last else math.ceil(duration / longest)
    for k in range(n):
        share = (k + 0.5) / n
        middle = [a + share * (b - a) for a, b in zip(first, last, strict=True)]
        yield time + k / n * duration, end if k + 1 == n else time + (k + 1) / n * duration, middle
