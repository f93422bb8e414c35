"""A tow: two hovercraft, a line between them, and a small master for the three FMUs, or for the bare functions."""

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .building import default_fmu, default_tether_kind
from .coupling import GAUSS_SEIDEL, JACOBI, SCHEMES, FmuPart, Part
from .fmu.interface import CRAFT_PARAMETERS, EXTERNAL, HOVERCRAFT, STATES
from .fmu.near_names import must_be_one_of
from .host import Fmu
from .model.craft import Craft, preset
from .model.dynamics import Controls, State
from .model.subcycling import Settings, advance, meant_step
from .simulation import Progress, check_steps, write_csv
from .tether.line import Line, Pull, pull
from .tether.tether_interface import CRAFT, INPUTS, LOADS, OUTPUTS, PARAMETERS, TETHER_MODEL

Helm = tuple[float, float, float, float]
"""time [s] from which on the first craft has this thrust [N], port and starboard thruster [1]"""
DRIVEN = ("thrust", "port_thruster", "starboard_thruster", *EXTERNAL)
"""What the master sets of a craft."""
COLUMNS = ("time", *INPUTS, *OUTPUTS)


@dataclass(frozen=True)
class Tow:
    """Who tows whom. The second craft has no thrust."""

    first: State = State(x=42.0)  # noqa: RUF009 - immutable
    second: State = State()  # noqa: RUF009 - immutable
    craft: Craft = preset("ice")  # noqa: RUF009 - immutable
    """Both are such craft."""
    line: Line = Line()  # noqa: RUF009 - immutable
    helm: tuple[Helm, ...] = ((0.0, 10.0, 0.0, 0.0),)
    communication_step: float = 0.1
    """s"""
    stop_time: float = 60.0
    """s"""


BEND = Tow(
    helm=((0.0, 10.0, 0.0, 0.0), (20.0, 10.0, 0.18, 0.0), (60.0, 10.0, 0.0, 0.1), (80.0, 10.0, 0.0, 0.0)),
    stop_time=120.0,
)
"""One pulls the other round a bend on ice."""


@dataclass(frozen=True)
class Towed:
    """How it went: `towed["first.pose.x"]`, the names of COLUMNS; one value a communication point, shape (n,)."""

    data: NDArray[np.void]
    tow: Tow
    scheme: str

    def __getitem__(self, name: str) -> NDArray[Any]:
        if name not in COLUMNS:
            raise ValueError(must_be_one_of("column", name, COLUMNS))
        return self.data[name]

    def write_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write all columns as CSV, with all digits. Raises OSError where that cannot be done."""
        return write_csv(self.data, path)

    def ends(self) -> NDArray[np.float64]:
        """m, shape (n, 2, 2): of the line, for each communication point: first and second end, x and y."""
        made_fast = np.reshape(self.tow.line[3:], (2, 2))
        places = []
        for craft, (x, y) in zip(CRAFT, made_fast, strict=True):
            c, s = np.cos(self[f"{craft}.pose.heading"]), np.sin(self[f"{craft}.pose.heading"])
            places.append([self[f"{craft}.pose.x"] + c * x - s * y, self[f"{craft}.pose.y"] + s * x + c * y])
        return np.moveaxis(np.array(places), 2, 0)


def haul(
    tow: Tow = BEND,
    fmu: str | Path | None = None,
    tether: str | Path | None = None,
    *,
    scheme: str = JACOBI,
    communication_step: float | None = None,
    stop_time: float | None = None,
    progress: Progress | None = None,
) -> Towed:
    """A tow by three FMUs: two instances of the craft's, and the tether's.

    Args:
        tow: who tows whom.
        fmu, tether: the files; without them those in build/, which are built if they are not there.
        scheme: `jacobi`: all three step side by side, with what the others showed before; `gauss_seidel`: the tether
            first, and the craft with what it shows after its step.
        communication_step, stop_time: s; without them the tow's. Whole communication steps are made.
        progress: see `simulation.Progress`.

    Raises:
        ValueError: a value that cannot be; FileNotFoundError: no such file.
        SimulationError: an FMU refused a value or a step, with its message.
    """
    tether = default_fmu(default_tether_kind()) if tether is None else tether
    with (
        Fmu(fmu or default_fmu(), HOVERCRAFT.name) as craft_fmu,
        Fmu(tether, TETHER_MODEL.name) as tether_fmu,
        craft_fmu.instance() as first,
        craft_fmu.instance() as second,
        tether_fmu.instance() as line,
    ):
        first.start(_start_values(tow, tow.first))
        second.start(_start_values(tow, tow.second))
        line.start(dict(zip((*INPUTS, *PARAMETERS), (*tow.first, *tow.second, *tow.line), strict=True)))
        parts = (FmuPart(first, STATES, DRIVEN), FmuPart(second, STATES, DRIVEN), FmuPart(line, OUTPUTS, INPUTS))
        return _haul(parts, tow, scheme, communication_step, stop_time, progress)


def haul_bare(
    tow: Tow = BEND,
    *,
    scheme: str = JACOBI,
    communication_step: float | None = None,
    stop_time: float | None = None,
    settings: Settings = Settings(),  # noqa: B008 - immutable
) -> Towed:
    """The same with the bare functions. Raises as these do."""
    parts = (_BareCraft(tow.first, tow.craft, settings), _BareCraft(tow.second, tow.craft, settings), BareTether(tow))
    return _haul(parts, tow, scheme, communication_step, stop_time)


def _start_values(tow: Tow, start: State) -> Mapping[str, float]:
    usual = Craft()
    own = {name: getattr(tow.craft, name) for name in CRAFT_PARAMETERS}
    own = {name: value for name, value in own.items() if value != getattr(usual, name)}
    return MappingProxyType({**own, **dict(zip(STATES, start, strict=True))})


def _haul(
    parts: tuple[Part, Part, Part],
    tow: Tow,
    scheme: str,
    communication_step: float | None,
    stop_time: float | None,
    progress: Progress | None = None,
) -> Towed:
    if scheme not in SCHEMES:
        raise ValueError(must_be_one_of("scheme", scheme, SCHEMES))
    h = tow.communication_step if communication_step is None else communication_step
    end = tow.stop_time if stop_time is None else stop_time
    for name, value in (("communication_step", h), ("stop_time", end)):
        if isinstance(value, bool) or not 0.0 < value < math.inf:
            raise ValueError(f"{name} = {value!r} s: must be a finite number greater than 0")
    check_steps(0.0, end, h, len(COLUMNS))
    rows = []
    for time, shown in _master(parts, tow, scheme, h, round(end / h)):
        rows.append((time, *shown))
        if progress:
            progress(time)
    return Towed(np.array(rows, dtype=[(name, np.float64) for name in COLUMNS]), tow, scheme)


def _master(
    parts: tuple[Part, Part, Part], tow: Tow, scheme: str, step: float, steps: int
) -> Iterator[tuple[float, tuple[float, ...]]]:
    """Time [s], and what all three show, at every communication point."""
    first, second, tether = parts
    for k in range(steps + 1):
        time = k * step
        motion, outputs = (*first.read(), *second.read()), tether.read()
        yield time, (*motion, *outputs)
        if k == steps:
            return
        tether.write(motion)
        tether.step(time, step)
        if scheme == GAUSS_SEIDEL:
            outputs = tether.read()
        half = len(LOADS) // 2
        helm = [each for each in tow.helm if each[0] <= time * (1.0 + 1e-12)][-1]
        first.write((*helm[1:], *outputs[:half]))
        second.write((0.0, 0.0, 0.0, *outputs[half : 2 * half]))
        first.step(time, step)
        second.step(time, step)


class _BareCraft:
    """The hovercraft's model, without an FMU."""

    def __init__(self, start: State, craft: Craft, settings: Settings) -> None:
        self._state, self._craft, self._settings = start, craft, settings
        self._controls, self._proposed = Controls(), 0.0

    def read(self) -> Sequence[float]:
        """See Part."""
        return self._state

    def write(self, values: Sequence[float]) -> None:
        """See Part."""
        thrust, port, starboard, *load = values
        self._controls = Controls(thrust, port, starboard, 0.0, 0.0, *load)

    def step(self, time: float, duration: float) -> None:
        """See Part."""
        step = meant_step(time, duration, 0.0, self._settings.step_size)
        made = advance(self._state, self._controls, self._craft, step, self._settings, proposed=self._proposed)
        self._state, self._proposed = made.state, made.proposed


class BareTether:
    """The tether's law, without an FMU."""

    def __init__(self, tow: Tow) -> None:
        self._line, self._motion = tow.line, (tow.first, tow.second)
        self._pull = Pull()
        self.step(0.0, 0.0)

    def read(self) -> Sequence[float]:
        """See Part."""
        made = self._pull
        return (*made.first, *made.second, made.tension, made.distance)

    def write(self, values: Sequence[float]) -> None:
        """See Part."""
        half = len(values) // 2
        self._motion = State(*values[:half]), State(*values[half:])

    def step(self, _time: float, _duration: float) -> None:
        """See Part."""
        self._pull = pull(*self._motion, self._line)
