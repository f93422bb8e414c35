"""What a sweep keeps of a run: from what was read at its communication points to the columns of a row."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..fmu.interface import ACTION, BY_NAME, ERRORS, MOTION, STATES, WATCHED
from ..fmu.variable import UNITS

Record: TypeAlias = NDArray[np.float64]
"""Shape (runs, points, quantities): what was read at the communication points that matter."""
Values: TypeAlias = NDArray[np.float64]
"""Shape (runs, points)."""
Samples: TypeAlias = Mapping[str, NDArray[Any]]
"""Swept parameter -> its values, one a run."""

OBSERVED = (*STATES, *MOTION, *ACTION, *WATCHED, *ERRORS)
"""What is read from the FMU, or worked out of the bare model."""


class Formula(NamedTuple):
    """A quantity that is worked out of what is read; for what they are see documentation/sweeps.html."""

    unit: str
    parts: tuple[str, ...]
    of: Callable[..., Any]


FORMULAS: Mapping[str, Formula] = MappingProxyType(
    {
        "drift_angle": Formula(
            "rad",
            ("body.surge", "body.sway"),
            lambda surge, sway: np.arctan2(-sway, surge),
        ),
        "turning_radius": Formula(
            "m",
            ("speed", "velocity.yaw_rate"),
            lambda speed, yaw_rate: speed / np.abs(yaw_rate),
        ),
    }
)


class Event(NamedTuple):
    """When a quantity first passes a level, and what others are then; linear between communication points."""

    name: str
    of: str
    rises: bool
    """Whether the event is above the level, or below it."""
    level: float
    values: tuple[str, ...]


@dataclass(frozen=True)
class Keep:
    """What is kept of every run."""

    end: tuple[str, ...]
    minimum: tuple[str, ...]
    maximum: tuple[str, ...]
    distance: bool
    """m: the length of the path from communication point to communication point."""
    events: tuple[Event, ...]
    every: float | None
    """s, of the trajectories"""
    trajectory: tuple[str, ...]

    @property
    def watches(self) -> bool:
        """Whether every communication point matters."""
        return bool(self.minimum or self.maximum or self.distance or self.events)

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of the columns of a row, in the order of `row_columns`."""
        return (
            *(f"end.{name}" for name in self.end),
            *(f"minimum.{name}" for name in self.minimum),
            *(f"maximum.{name}" for name in self.maximum),
            *(("distance",) if self.distance else ()),
            *(f"{event.name}.{value}" for event in self.events for value in ("time", *event.values)),
        )

    @property
    def read(self) -> tuple[str, ...]:
        """What must be read, in the order of OBSERVED."""
        asked = {*self.end, *self.minimum, *self.maximum, *self.trajectory}
        asked |= {name for event in self.events for name in (event.of, *event.values)}
        asked |= {"pose.x", "pose.y"} if self.distance else set()
        parts = {part for name in asked & FORMULAS.keys() for part in FORMULAS[name].parts}
        return tuple(name for name in OBSERVED if name in asked | parts)


def unit(quantity: str) -> str:
    """The unit of a quantity, or of a column of a row."""
    if quantity in FORMULAS:
        return FORMULAS[quantity].unit
    if quantity in BY_NAME:
        return BY_NAME[quantity].unit or ""
    if quantity == "distance":
        return "m"
    if quantity == "time" or quantity.endswith(".time"):
        return "s"
    return unit(quantity.partition(".")[2]) if "." in quantity else ""


def display(quantity: str) -> tuple[str, float]:
    """What is shown to people instead of the unit, and its factor; no unit: of a plain number."""
    shown = unit(quantity)
    name, factor = (UNITS[shown].display if shown else None) or (shown, 1.0)
    return ("" if name == "1" else name), factor


def quantity_function(keep: Keep, record: Record) -> Callable[[str], Values]:
    """Name -> its values, read or derived."""
    place = {name: i for i, name in enumerate(keep.read)}

    def values(name: str) -> Values:
        if name not in FORMULAS:
            return record[:, :, place[name]]
        parts = [record[:, :, place[part]] for part in FORMULAS[name].parts]
        with np.errstate(all="ignore"):  # straight ahead the radius is infinite
            found: Values = FORMULAS[name].of(*parts)
        return found

    return values


def row_columns(keep: Keep, record: Record, times: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    """Column -> one value a run; NaN: an event that did not happen.

    Args:
        keep: what is kept.
        record: see `Record`; the last point is the end.
        times: s, of the points.
    """
    values = quantity_function(keep, record)
    found = [
        *(values(name)[:, -1] for name in keep.end),
        *(values(name).min(axis=1) for name in keep.minimum),
        *(values(name).max(axis=1) for name in keep.maximum),
    ]
    if keep.distance:
        found.append(np.hypot(np.diff(values("pose.x")), np.diff(values("pose.y"))).sum(axis=1))
    for event in keep.events:
        found += _at_event(event, values, times)
    return dict(zip(keep.columns, found, strict=True))


def _at_event(event: Event, values: Callable[[str], Values], times: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """The time, and the other quantities then."""
    of = values(event.of)
    past = of > event.level if event.rises else of < event.level
    runs, happens = np.arange(len(of)), past.any(axis=1)
    after = past.argmax(axis=1)
    before = np.maximum(after - 1, 0)
    with np.errstate(all="ignore"):
        share = (event.level - of[runs, before]) / (of[runs, after] - of[runs, before])
    share = np.where(after == before, 0.0, share)  # at the start already

    def then(each: Values) -> NDArray[np.float64]:
        start = each[runs, before]
        return np.where(happens, start + share * (each[runs, after] - start), np.nan)

    every = np.broadcast_to(times, of.shape)
    return [then(every), *(then(values(name)) for name in event.values)]
