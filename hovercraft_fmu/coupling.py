"""The closed loop of hovercraft and autopilot: a small master for two FMUs, or for the bare functions behind them."""

import math
import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from .autopilot.guidance import Commands, Orders, Sight, Waypoint, beginning, steer
from .autopilot.pilot_interface import AUTOPILOT_MODEL, COMMANDS, DEMO_COURSE, ORDERS, STATUS
from .building import default_autopilot_kind, default_fmu
from .fmu.interface import CRAFT_PARAMETERS, HOVERCRAFT, STATES, WIND
from .fmu.near_names import did_you_mean, must_be_one_of
from .host import Fmu, Instance
from .model.craft import Craft
from .model.dynamics import Controls, State
from .model.subcycling import Settings, advance, meant_step
from .scenes import Voyage, voyage
from .simulation import Progress, check_steps, path_length, write_csv

JACOBI, GAUSS_SEIDEL = SCHEMES = ("jacobi", "gauss_seidel")
"""Both parts step side by side, with what the other one showed before; or the autopilot steps first, and the craft
with what the autopilot shows after its step."""
OUTPUTS = tuple(v.name for v in AUTOPILOT_MODEL.variables if v.causality == "output")
COLUMNS = ("time", *STATES, *OUTPUTS)
START_VALUES = (*CRAFT_PARAMETERS, *STATES, *WIND)
"""Of the hovercraft: what a voyage may set."""
TOLD = tuple(name for name in ORDERS if name in CRAFT_PARAMETERS)
"""Parameters of the hovercraft that the autopilot has, too."""
ARRIVED = COLUMNS.index("arrived") - 1


class Part(Protocol):
    """One side of the loop."""

    def read(self) -> Sequence[float]:
        """What the other side gets: of the craft STATES, of the autopilot COMMANDS, of its OUTPUTS the first."""

    def write(self, values: Sequence[float]) -> None:
        """What came from the other side."""

    def step(self, time: float, duration: float) -> None:
        """From one communication point [s] to the next."""


@dataclass(frozen=True)
class Passage:
    """How a voyage went: `passage["time"]`, the names of COLUMNS; one value a communication point, shape (n,)."""

    data: NDArray[np.void]
    voyage: Voyage
    scheme: str

    def __getitem__(self, name: str) -> NDArray[Any]:
        if name not in COLUMNS:
            raise ValueError(must_be_one_of("column", name, COLUMNS))
        return self.data[name]

    @property
    def arrived(self) -> bool:
        """Whether all waypoints were reached."""
        return bool(self["arrived"][-1])

    @property
    def reached(self) -> int:
        """How many waypoints; those that were missed are none of them."""
        passed = int(self["waypoint"][-1]) if self.arrived else int(self["waypoint"][-1]) - 1
        return passed - int(self["missed"][-1])

    @property
    def told(self) -> tuple[str, ...]:
        """What the autopilot said, one text for each bit of its last status."""
        status = int(self["status"][-1])
        return tuple(text for bit, text in STATUS.items() if status & bit)

    @property
    def craft(self) -> Craft:
        """That sailed."""
        return _craft(self.voyage)

    @property
    def distance(self) -> float:
        """m: length of the path from communication point to communication point."""
        return path_length(self["pose.x"], self["pose.y"])

    def write_csv(self, path: str | os.PathLike[str]) -> Path:
        """Write all columns as CSV, with all digits. Raises OSError where that cannot be done."""
        return write_csv(self.data, path)

    @property
    def waypoints(self) -> tuple[tuple[float, float], ...]:
        """m, world frame: the course."""
        return DEMO_COURSE

    @property
    def acceptance_radius(self) -> float:
        """m: a waypoint this near is reached."""
        return _orders(self.voyage).acceptance_radius


def sail(
    which: str | Voyage = "calm",
    fmu: str | Path | None = None,
    autopilot: str | Path | None = None,
    *,
    scheme: str = JACOBI,
    communication_step: float | None = None,
    stop_time: float | None = None,
    progress: Progress | None = None,
) -> Passage:
    """A voyage of the two FMUs, until the craft has arrived or the stop time is there.

    Args:
        which: the voyage, or its name.
        fmu, autopilot: the files; without them those in build/, which are built if they are not there.
        scheme: one of SCHEMES.
        communication_step, stop_time: s; without them the voyage's. Whole communication steps are made.
        progress: see `simulation.Progress`.

    Raises:
        ValueError: a name or a value that cannot be; FileNotFoundError: no such file.
        SimulationError: an FMU refused a value or a step, with its message.
    """
    chosen = _chosen(which)
    autopilot = default_fmu(default_autopilot_kind()) if autopilot is None else autopilot
    with (
        Fmu(fmu or default_fmu(), HOVERCRAFT.name) as craft_fmu,
        Fmu(autopilot, AUTOPILOT_MODEL.name) as pilot_fmu,
        craft_fmu.instance() as craft,
        pilot_fmu.instance() as pilot,
    ):
        initialize(craft, pilot, chosen)
        parts = FmuPart(craft, STATES, COMMANDS), FmuPart(pilot, OUTPUTS, STATES)
        return _sail(*parts, chosen, scheme, communication_step, stop_time, progress)


def initialize(craft: Instance, pilot: Instance, chosen: Voyage) -> None:
    """Both through initialization mode, in which the autopilot gets what the craft has: where it is, and what it is."""
    craft.set(chosen.craft)
    craft.enter_initialization()
    pilot.enter_initialization()
    for names in (STATES, TOLD):
        pilot.port(*names).set(craft.port(*names).get())
    pilot.set(chosen.autopilot)
    craft.exit_initialization()
    pilot.exit_initialization()


def sail_bare(
    which: str | Voyage = "calm",
    *,
    scheme: str = JACOBI,
    communication_step: float | None = None,
    stop_time: float | None = None,
    settings: Settings = Settings(),  # noqa: B008 - immutable
) -> Passage:
    """The same with the bare functions. Raises as these do."""
    chosen = _chosen(which)
    craft = BareCraft(chosen, settings)
    return _sail(craft, BareAutopilot(craft.state, _orders(chosen)), chosen, scheme, communication_step, stop_time)


def _chosen(which: str | Voyage) -> Voyage:
    chosen = voyage(which) if isinstance(which, str) else which
    for values, allowed in ((chosen.craft, START_VALUES), (chosen.autopilot, ORDERS)):
        for name, value in values.items():
            if name not in allowed:
                meant = did_you_mean(name, allowed)
                raise ValueError(f"{name} = {value!r}: must be one of {', '.join(allowed)}{meant}")
    return chosen


def _sail(
    craft: Part,
    pilot: Part,
    chosen: Voyage,
    scheme: str,
    communication_step: float | None,
    stop_time: float | None,
    progress: Progress | None = None,
) -> Passage:
    if scheme not in SCHEMES:
        raise ValueError(must_be_one_of("scheme", scheme, SCHEMES))
    h = chosen.communication_step if communication_step is None else communication_step
    end = chosen.stop_time if stop_time is None else stop_time
    for name, value in (("communication_step", h), ("stop_time", end)):
        if isinstance(value, bool) or not 0.0 < value < math.inf:
            raise ValueError(f"{name} = {value!r} s: must be a finite number greater than 0")
    check_steps(0.0, end, h, len(COLUMNS))
    keeps_station = _orders(chosen).keep_station == 1
    rows = []
    for time, shown in master(craft, pilot, scheme, h, round(end / h)):
        rows.append((time, *shown))
        if progress:
            progress(time)
        if shown[ARRIVED] and not keeps_station:
            break
    return Passage(np.array(rows, dtype=[(name, np.float64) for name in COLUMNS]), chosen, scheme)


def master(
    craft: Part, pilot: Part, scheme: str, communication_step: float, steps: int
) -> Iterator[tuple[float, tuple[float, ...]]]:
    """The loop: time [s], and what both parts show, at every communication point."""
    for k in range(steps + 1):
        time = k * communication_step
        pose, outputs = craft.read(), pilot.read()
        yield time, (*pose, *outputs)
        if k == steps:
            return
        pilot.write(pose)
        pilot.step(time, communication_step)
        if scheme == GAUSS_SEIDEL:
            outputs = pilot.read()
        craft.write(outputs[: len(COMMANDS)])
        craft.step(time, communication_step)


# ---- the parts as FMUs


class FmuPart:
    """An instance of an FMU."""

    def __init__(self, instance: Instance, shown: Sequence[str], taken: Sequence[str]) -> None:
        self._instance, self._shown, self._taken = instance, instance.port(*shown), instance.port(*taken)

    def read(self) -> Sequence[float]:
        """See Part."""
        return self._shown.get()

    def write(self, values: Sequence[float]) -> None:
        """See Part."""
        self._taken.set(values)

    def step(self, time: float, duration: float) -> None:
        """See Part."""
        self._instance.step(time, duration)


# ---- the parts as bare functions


def _craft(chosen: Voyage) -> Craft:
    return Craft(**{name: value for name, value in chosen.craft.items() if name in CRAFT_PARAMETERS})  # type: ignore[arg-type]


def _orders(chosen: Voyage) -> Orders:
    craft = _craft(chosen)
    values: dict[str, Any] = {name: getattr(craft, name) for name in TOLD}
    return Orders(**{**values, **chosen.autopilot})


class BareCraft:
    """The hovercraft's model, without an FMU."""

    def __init__(self, chosen: Voyage, settings: Settings) -> None:
        start = {name: chosen.craft.get(name, 0.0) for name in (*STATES, *WIND)}
        self.state = State(*(start[name] for name in STATES))
        self.wind = tuple(start[name] for name in WIND)
        self.controls = Controls()
        self.craft, self.settings, self.proposed = _craft(chosen), settings, 0.0

    def read(self) -> Sequence[float]:
        """See Part."""
        return self.state

    def write(self, values: Sequence[float]) -> None:
        """See Part."""
        self.controls = Controls(*values, *self.wind)

    def step(self, time: float, duration: float) -> None:
        """See Part."""
        step = meant_step(time, duration, 0.0, self.settings.step_size)
        made = advance(self.state, self.controls, self.craft, step, self.settings, proposed=self.proposed)
        self.state, self.proposed = made.state, made.proposed


class BareAutopilot:
    """The autopilot's law, without an FMU."""

    course = tuple(Waypoint(*point) for point in DEMO_COURSE)

    def __init__(self, motion: State, orders: Orders) -> None:
        self.motion, self.orders, self.pilot = motion, orders, beginning(motion)
        self.commands, self.sight = Commands(), Sight()
        self.step(0.0, 0.0)

    def read(self) -> Sequence[float]:
        """See Part."""
        pilot, count = self.pilot, len(self.course)
        at_end = pilot.passed >= count
        rest = (at_end, pilot.status, pilot.missed, pilot.turns)
        return (*self.commands, min(pilot.passed + 1, count), *self.sight, *rest)

    def write(self, values: Sequence[float]) -> None:
        """See Part."""
        self.motion = State(*values)

    def step(self, _time: float, duration: float) -> None:
        """See Part."""
        self.pilot, self.commands, self.sight = steer(self.pilot, self.motion, self.course, self.orders, duration)
