"""Many craft at once: the compiled kernel by ctypes, each craft with the bits that the native FMU gives it."""

import math
import platform
import reprlib
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from ctypes import CDLL, POINTER, Structure, byref, c_int32, c_int64, c_void_p
from dataclasses import fields
from functools import cache
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..fmu.machine_code import NotCompiledError, fleet_library
from ..fmu.near_names import explains_keywords
from ..model.craft import CONSTANT, DERIVED, DIRECTIONAL, Craft, check_parameter
from ..model.dynamics import Controls, State
from ..model.integrators import ADAPTIVE, INTEGRATORS, StepTooSmallError, too_many_tried
from ..model.subcycling import NonFiniteError, Settings, too_many_substeps

Array: TypeAlias = NDArray[np.float64]
Rows: TypeAlias = ArrayLike | Sequence[ArrayLike]
"""One row a quantity: an array of shape (quantities, craft), or a sequence of rows; a row is of shape (craft,), or one
number that all craft share."""
PARAMETERS = tuple(field.name for field in fields(Craft))
LOAD = Controls._fields[5:]


class Fleet(NamedTuple):
    """What became of the craft, in their order. One that was refused is where it was, with zeros beside it."""

    states: Array
    """Shape (6, craft): rows in the order of State; m, rad, m/s, rad/s."""
    substeps: NDArray[np.int64]
    """Shape (craft,)."""
    stability: Array
    """1, shape (craft,): the largest of a sub-step, wherever the loads were worked out and at the end; see Stretch."""
    rotation: Array
    """rad, shape (craft,): the largest turn in a sub-step, there too."""
    proposed: Array
    """s, shape (craft,): for the next call with the adaptive method."""
    refused: "Refused"
    """Number of a craft -> why it was refused: what the model would raise."""


class Refused(Mapping[int, Exception]):
    """Reasons, made when they are asked for."""

    def __init__(self, numbers: NDArray[np.int64], reason: Callable[[int], Exception]) -> None:
        self.numbers = numbers
        """Of the craft that were refused, ascending."""
        self._reason = reason

    def __getitem__(self, number: int) -> Exception:
        if number not in self.numbers:
            raise KeyError(number)
        return self._reason(number)

    def __iter__(self) -> Iterator[int]:
        return iter(self.numbers.tolist())

    def __len__(self) -> int:
        return len(self.numbers)


class Crafts:
    """The constants of many craft, checked once: `Crafts(mass=np.linspace(80.0, 120.0, 1000), air_density=1.1)`.

    A parameter of Craft is an array of shape (craft,), or one number that all share; what is not given has its default.
    As attributes both can be read: `crafts.mass`, `crafts.drag_factor`.

    Raises:
        ValueError: the first craft that cannot be, its parameter, the value and the rule; arrays of different lengths.
    """

    def __init__(self, **parameters: ArrayLike) -> None:
        unknown = sorted(parameters.keys() - set(PARAMETERS))
        if unknown:
            raise ValueError(f"{unknown[0]}: must be a parameter of a craft: {', '.join(PARAMETERS)}")
        columns = {field.name: _column(field.name, field.default) for field in fields(Craft)}
        columns |= {name: _column(name, value) for name, value in parameters.items()}
        lengths = {name: column.size for name, column in columns.items() if column.ndim}
        count = max(lengths.values(), default=1)
        for name, column in columns.items():
            _check_shape(name, column, count)
        self.count = count if lengths else None
        """How many; None where all numbers are shared, by however many craft there are."""
        self.columns = columns
        self.derived = _derived(columns, count)
        """What is worked out of them: name -> shape (craft,), or (1,)."""
        for number, why in _refusals(columns, self.derived, count).items():
            raise ValueError(f"craft {number}: {why}" if lengths else why)

    def __getattr__(self, name: str) -> Array:
        for values in ("columns", "derived"):
            if name in self.__dict__.get(values, ()):
                found: Array = self.__dict__[values][name]
                return found
        raise AttributeError(name)

    def some(self, which: Any) -> "Crafts":
        """Some of them: a mask, a slice, or indices. What all share they still do."""
        made = object.__new__(Crafts)  # they were checked
        made.columns = {name: column[which] if column.ndim else column for name, column in self.columns.items()}
        made.derived = {name: row if self.count is None else row[which] for name, row in self.derived.items()}
        made.count = None if self.count is None else len(next(c for c in made.columns.values() if c.ndim))
        return made

    def one(self, number: int) -> Craft:
        """One of them."""
        return Craft(**_constants(self.columns, number))

    @classmethod
    def of(cls, crafts: "Crafts | Craft | Iterable[Craft]") -> "Crafts":
        """Of one craft, for all, or of a sequence of them."""
        if isinstance(crafts, Crafts):
            return crafts
        if isinstance(crafts, Craft):
            return cls(**{name: getattr(crafts, name) for name in PARAMETERS})
        every = list(crafts)
        return cls(**{name: [getattr(each, name) for each in every] for name in PARAMETERS})


@explains_keywords
def advance_fleet(
    states: Rows,
    controls: Rows,
    crafts: Crafts | Craft | Sequence[Craft],
    communication_step: ArrayLike,
    settings: Settings = Settings(),  # noqa: B008 - immutable
    slopes: Rows | None = None,
    *,
    proposed: ArrayLike = 0.0,
) -> Fleet:
    """Many craft, each one communication step later, with the bits of the native FMU; Python's lock is released.

    A row of `float64`, whatever its strides, is read where it is; nothing is written into what is given. Eight craft go
    side by side where drag is plain (no wind, constant area, no friction, no rotational drag), no load comes from
    outside and the method is semi-implicit Euler or RK4; the others one after the other.

    Args:
        states: see `Rows`; 6 of them, in the order of State: m, rad, m/s, rad/s.
        controls: 8 rows, in the order of Controls: N, 1, 1, m/s, m/s, N, N, N.m; or 5, without loads from outside. Each
            craft holds them inside its limits.
        crafts: the constants of each; `Crafts` are checked only once.
        communication_step: s, of each craft, or one for all.
        settings: method, sub-step [s] and tolerance; the latter two may be arrays of shape (craft,), too.
        slopes: as many rows, per s: how the controls change over the step, from its start; None: they hold.
        proposed: s; what the last call with the adaptive method returned, 0 at the start.

    Raises:
        ValueError: rows of another number or length, what is no number, crafts that cannot be. (A craft whose numbers
            are not finite, or whose motion runs away, is refused alone; see `Fleet`.)
        NotCompiledError: the compiled library is missing; the message says how to get it.
    """
    rows = _rows("states", states, State._fields)
    chosen = Crafts.of(crafts)
    count = max([row.size for row in rows if row.ndim], default=chosen.count or 1)
    given = _Given(count, rows, _rows("controls", controls, Controls._fields), chosen, slopes)
    numbers = (communication_step, settings.step_size, settings.tolerance, proposed)
    way = [_column(name, each) for name, each in zip(_WAY, numbers, strict=True)]
    structure = _Way(integrator=INTEGRATORS.index(settings.integrator) + 1)
    way = _put(structure, "numbers", count, way, _WAY)
    found = _Found(count)
    _library().fleet_advance(byref(given.structure), byref(structure), byref(found.structure))
    tries = settings.integrator is ADAPTIVE
    return found.fleet(lambda i: given.numbers(i) | _numbers(_WAY, way, i), too_many_tried if tries else None)


def observe_fleet(states: Rows, controls: Rows, crafts: Crafts | Craft | Sequence[Craft]) -> Array:
    """Surge, sway [m/s], force x, y [N, world frame], moment [N.m], k*q [kg/s] of many craft, shape (6, craft).

    For arguments and errors see `advance_fleet`.
    """
    rows = _rows("states", states, State._fields)
    chosen = Crafts.of(crafts)
    count = max([row.size for row in rows if row.ndim], default=chosen.count or 1)
    given = _Given(count, rows, _rows("controls", controls, Controls._fields), chosen, None)
    seen = np.empty((6, count))
    pointers = [row.ctypes.data for row in seen]
    _library().fleet_observe(byref(given.structure), (c_void_p * 2)(*pointers[:2]), (c_void_p * 4)(*pointers[2:]))
    return seen


def refusals(parameters: Mapping[str, Array], count: int) -> dict[int, str]:
    """Number of a craft -> why there cannot be such a craft.

    Args:
        parameters: all of a craft's, of shape (craft,) or ().
        count: how many craft there are.
    """
    return _refusals(parameters, _derived(parameters, count), count)


def _refusals(parameters: Mapping[str, Array], derived: Mapping[str, Array], count: int) -> dict[int, str]:
    doubtful = np.zeros(count, bool)
    for name, column in parameters.items():
        if not _is_right(name, column):
            doubtful |= [not _is_right(name, value) for value in np.broadcast_to(column, count)]
    with np.errstate(invalid="ignore"):
        doubtful |= ~(parameters["thrust_max"] - parameters["thrust_min"] >= 0.0)
    doubtful |= ~np.isfinite(list(derived.values())).all(axis=0)
    reasons = {i: _refusal(_constants(parameters, i)) for i in np.flatnonzero(doubtful).tolist()}
    return {i: why for i, why in reasons.items() if why}


def _refusal(constants: Any) -> str:
    """Why there cannot be such a craft; '' where there can."""
    why = ""
    try:
        Craft(**constants)
    except ValueError as error:
        why = str(error)
    return why


def _constants(parameters: Mapping[str, Array], i: int) -> Any:
    """Of one craft, for Craft."""
    numbers = _numbers(tuple(parameters), list(parameters.values()), i)
    area = numbers["drag_area"]
    return numbers | {"drag_area": int(area) if area.is_integer() else area}


def _is_right(name: str, column: Array) -> bool:
    """Whether the least and the greatest keep the rule, and so all; of the drag area, each."""
    if column.size == 0:
        return True
    if name == "drag_area":
        return bool(np.all((column == CONSTANT) | (column == DIRECTIONAL)))
    try:
        check_parameter(name, float(column.min()))
        check_parameter(name, float(column.max()))
    except ValueError:
        return False
    return True


def _derived(parameters: Mapping[str, Array], count: int) -> dict[str, Array]:
    """The numbers of DERIVED, by name."""
    found = np.empty((len(DERIVED), count))
    structure = _CFleet(count=count)
    held = _put(structure, "constants", count, list(parameters.values()), PARAMETERS)
    _library().fleet_derived(byref(structure), found.ctypes.data)
    del held  # not before
    return {name: row for (name, _, _), row in zip(DERIVED, found, strict=True)}


# ---- as C has it: native/fleet/fleet.h


class _Column(Structure):
    _fields_ = [("values", c_void_p), ("stride", c_int64)]


class _CFleet(Structure):
    _fields_ = [
        ("count", c_int64), ("states", _Column * 6), ("controls", _Column * 8), ("slopes", _Column * 8),
        ("constants", _Column * 15),
    ]  # fmt: skip


_WAY = ("communication_step", "step_size", "tolerance", "proposed")


class _Way(Structure):
    _fields_ = [("numbers", _Column * 4), ("integrator", c_int32)]


class _CReached(Structure):
    _fields_ = [
        ("states", c_void_p * 6), ("substeps", c_void_p), ("stability", c_void_p), ("rotation", c_void_p),
        ("proposed", c_void_p), ("why", c_void_p), ("part", c_void_p), ("value", c_void_p), ("substep", c_void_p),
    ]  # fmt: skip


TOO_MANY, RUNAWAY, TOO_SMALL = range(1, 4)


def _rows(name: str, given: Rows, quantities: Sequence[str]) -> list[Array]:
    rows = list(given) if isinstance(given, Sequence) else list(np.atleast_1d(given))
    if len(rows) == len(quantities) - len(LOAD) and quantities[-1].endswith(LOAD[-1]):
        rows += [0.0] * len(LOAD)
    if len(rows) != len(quantities):
        raise ValueError(f"{name}: {len(rows)} rows: must be {len(quantities)}, one for each quantity")
    return [_column(quantity, row) for quantity, row in zip(quantities, rows, strict=True)]


def _column(name: str, given: Any) -> Array:
    try:
        return np.asarray(given, float)
    except (ValueError, TypeError):
        shown = " ".join(reprlib.repr(given).split())
        raise ValueError(f"{name} = {shown}: must be a number, or an array of them, one for each craft") from None


def _check_shape(name: str, column: Array, count: int) -> None:
    if column.shape not in ((), (count,)):
        raise ValueError(f"{name}: shape {column.shape}: must be ({count},), one for each craft, or one number")


def _put(structure: Structure, field: str, count: int, columns: Sequence[Array], names: Iterable[str]) -> list[Array]:
    """Write columns into a field. They must live as long as the structure: so they are returned."""
    place = getattr(structure, field)
    held = list(columns)
    for i, (column, name) in enumerate(zip(columns, names, strict=True)):
        _check_shape(name, column, count)
        stride, rest = divmod(column.strides[0], 8) if column.ndim else (0, 0)
        if rest or not column.flags.aligned:  # inside of records
            held[i], stride = np.ascontiguousarray(column), 1
        place[i].values, place[i].stride = held[i].__array_interface__["data"][0], stride
    return held


class _Given:
    """What C reads."""

    def __init__(
        self, count: int, states: list[Array], controls: list[Array], crafts: Crafts, slopes: Rows | None
    ) -> None:
        self.structure = _CFleet(count=count)
        slope_names = tuple(f"slope of {name}" for name in Controls._fields)
        rates = [np.zeros(())] * len(slope_names) if slopes is None else _rows("slopes", slopes, slope_names)
        self._rows: dict[str, Array] = {}
        for field, columns, names in (
            ("states", states, State._fields),
            ("controls", controls, Controls._fields),
            ("slopes", rates, slope_names),
        ):
            self._rows |= zip(names, _put(self.structure, field, count, columns, names), strict=True)
        self._constants = _put(self.structure, "constants", count, list(crafts.columns.values()), PARAMETERS)

    def numbers(self, i: int) -> dict[str, float]:
        """All of a craft, but its constants, by name."""
        return _numbers(tuple(self._rows), list(self._rows.values()), i)


def _numbers(names: Sequence[str], columns: Sequence[Array], i: int) -> dict[str, float]:
    return {name: (column[i] if column.ndim else column).item() for name, column in zip(names, columns, strict=True)}


class _Found:
    """Room for what C writes."""

    def __init__(self, count: int) -> None:
        self._states = np.empty((len(State._fields), count))
        self._reals = {name: np.empty(count) for name in ("stability", "rotation", "proposed", "value", "substep")}
        self._why, self._part = np.empty(count, np.int32), np.empty(count, np.int32)
        self._substeps = np.empty(count, np.int64)
        rows = (c_void_p * 6)(*(row.ctypes.data for row in self._states))
        self.structure = _CReached(states=rows, substeps=self._substeps.ctypes.data, why=self._why.ctypes.data,
                                   part=self._part.ctypes.data,
                                   **{name: column.ctypes.data for name, column in self._reals.items()})  # fmt: skip

    def fleet(
        self, numbers: Callable[[int], dict[str, float]], tried: Callable[[float, float], ValueError] | None
    ) -> Fleet:
        """`numbers` gives those of a craft by name; `tried` says that a method which tries steps found no end."""
        refused = Refused(np.flatnonzero(self._why), lambda i: self._error(i, numbers(i), tried))
        stability, rotation, proposed = (self._reals[name] for name in ("stability", "rotation", "proposed"))
        return Fleet(self._states, self._substeps, stability, rotation, proposed, refused)

    def _error(
        self, i: int, numbers: dict[str, float], tried: Callable[[float, float], ValueError] | None
    ) -> Exception:
        """What the model would raise."""
        why, substep = self._why[i], self._reals["substep"][i].item()
        if why == RUNAWAY:
            return NonFiniteError(State._fields[self._part[i]], self._reals["value"][i].item(), substep)
        if why == TOO_SMALL:
            return StepTooSmallError(substep, numbers["tolerance"])
        if why == TOO_MANY and tried:
            return tried(numbers["communication_step"], numbers["tolerance"])
        if why == TOO_MANY:
            return too_many_substeps(numbers["communication_step"], numbers["step_size"])
        bad, rule = next((name, rule) for name, value in numbers.items() if (rule := _broken_rule(name, value)))
        return ValueError(f"{bad} = {numbers[bad]!r}: {rule}")


def _broken_rule(name: str, value: float) -> str:
    if not math.isfinite(value):
        return "must be a finite number"
    if name in ("communication_step", "proposed"):
        return "must not be negative" if value < 0.0 else ""
    return "must be greater than 0" if name in _WAY and value <= 0.0 else ""


@cache
def _library() -> Any:
    """The compiled fleet of this machine. Raises NotCompiledError."""
    system = {"linux": "linux", "win32": "windows", "darwin": "darwin"}.get(sys.platform, sys.platform)
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower(), platform.machine().lower())
    try:
        library: Any = CDLL(str(fleet_library().path(f"{machine}-{system}")))
    except KeyError:
        raise NotCompiledError(f"no machine code of HovercraftFleet for {machine}-{system}") from None
    library.fleet_advance.restype = c_int64
    library.fleet_advance.argtypes = (POINTER(_CFleet), POINTER(_Way), POINTER(_CReached))
    library.fleet_derived.argtypes = (POINTER(_CFleet), c_void_p)
    library.fleet_observe.argtypes = (POINTER(_CFleet), c_void_p * 2, c_void_p * 4)
    return library
