"""A study: what is held, what is swept, how it is sampled, what is kept. Checked once, here."""

import json
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from math import isclose, prod
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.stats import qmc

from ..fmu.interface import BY_NAME, INPUTS
from ..fmu.start_values import start_value
from ..model.craft import Craft, check_parameter
from ..model.integrators import integrator
from ..model.subcycling import check_step_size, check_tolerance
from ..scenes import Signals
from ..simulation import Run, plan, read_inputs
from .quantities import FORMULAS, OBSERVED, Event, Keep

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

SHIPPED = Path(__file__).parent / "studies"
STUDIES = tuple(sorted(path.stem for path in SHIPPED.glob("*.toml")))
"""The names of the studies that come with the package."""
TOP = ("scene", "inputs", "preset", "start_time", "stop_time", "communication_step", "set", "sweep", "sampling", "keep")
GRID, LATIN_HYPERCUBE = "grid", "latin_hypercube"
SAMPLING = (GRID, LATIN_HYPERCUBE)
MAX_RUNS = 10**8
"""Or a slip of the decimal point: the samples of a Latin hypercube are all in memory."""


class Distribution(NamedTuple):
    """How a parameter is distributed: scipy's distribution, frozen, and its numbers as the study has them."""

    numbers: tuple[str, ...]
    frozen: Any
    """(numbers) -> the frozen distribution"""


DISTRIBUTIONS: Mapping[str, Distribution] = MappingProxyType(
    {
        "normal": Distribution(("mean", "standard deviation"), stats.norm),
        "lognormal": Distribution(
            ("median", "standard deviation of the logarithm"), lambda median, sd: stats.lognorm(sd, scale=median)
        ),
        "triangular": Distribution(
            ("lowest", "most likely", "highest"),
            lambda low, mode, high: stats.triang((mode - low) / (high - low), loc=low, scale=high - low),
        ),
    }
)


@dataclass(frozen=True)
class Factor:
    """A swept parameter: values to choose from, or a distribution."""

    name: str
    values: tuple[float | int, ...] = ()
    distribution: Any = None
    """scipy's, frozen; instead of values"""

    @property
    def kind(self) -> type[np.float64] | type[np.int32]:
        """Of the values, as the FMU has them."""
        return np.float64 if BY_NAME[self.name].kind == "Real" else np.int32

    def at(self, part: NDArray[np.float64]) -> NDArray[Any]:
        """The values at these parts (0 to 1) of the probability; of a list, every item has the same share."""
        if self.distribution is not None:
            found: NDArray[Any] = self.distribution.ppf(part)
            return found
        chosen = np.minimum((part * len(self.values)).astype(np.int64), len(self.values) - 1)
        items: NDArray[Any] = np.array(self.values, self.kind)
        return np.take(items, chosen)


@dataclass(frozen=True)
class Study:
    """A study, checked. Every run has a number; its parameters follow from that and the study alone."""

    name: str
    run: Run
    """All that the runs share: the scene or the inputs, the fixed settings, the times."""
    factors: tuple[Factor, ...]
    keep: Keep
    runs: int
    latin: NDArray[np.float64] | None
    """The points of the Latin hypercube, shape (runs, factors); None for the full grid."""
    content: str
    """The study as JSON, inputs and all: two studies are the same where this is."""

    def samples(self, numbers: NDArray[np.int64]) -> dict[str, NDArray[Any]]:
        """The swept parameters of these runs; on the grid the last factor changes first."""
        if self.latin is not None:
            return {factor.name: factor.at(self.latin[numbers, i]) for i, factor in enumerate(self.factors)}
        shape = [len(factor.values) for factor in self.factors]
        places = np.unravel_index(numbers, shape)
        return {
            factor.name: np.array(factor.values, factor.kind)[place]
            for factor, place in zip(self.factors, places, strict=True)
        }


def read_study(source: str | Path | Mapping[str, Any]) -> Study:
    """Read and check a study: a TOML file, the name of one that comes with the package (STUDIES), or its content.

    Raises:
        OSError: no such file.
        ValueError: one line with the file, the key, the value and the rule.
    """
    if isinstance(source, Mapping):
        return _study(source, "study", Path())
    path = SHIPPED / f"{source}.toml" if str(source) in STUDIES else Path(source)
    if not path.exists():
        raise FileNotFoundError(f"study = {str(source)!r}: must be a TOML file, or one of {', '.join(STUDIES)}")
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:  # of TOML, or of the encoding
        raise ValueError(f"{path}: must be a TOML file; {error}") from error
    try:
        return _study(table, path.stem, path.parent)
    except ValueError as error:
        raise ValueError(f"{path}: {error}") from error


def _study(table: Mapping[str, Any], name: str, folder: Path) -> Study:
    _known(table, TOP, "")
    if ("scene" in table) == ("inputs" in table):
        raise ValueError("scene: must be given, or else inputs (a control log), and not both")
    settings, swept = _flat(_table(table, "set")), _flat(_table(table, "sweep"))
    source, driven, log = _source(table, folder)
    run = _plan(table, source, settings)
    if not swept:
        raise ValueError("sweep: must have at least one parameter")
    factors = tuple(_factor(key, value, run, driven) for key, value in swept.items())
    for key in settings:
        if key in swept:
            raise ValueError(f"set.{key} = {settings[key]!r}: must not be swept, too")
    runs, latin = _sampled(_table(table, "sampling"), factors)
    return Study(name, run, factors, _keep(_table(table, "keep"), run), runs, latin, _content(table, log))


def _source(table: Mapping[str, Any], folder: Path) -> tuple[str | Signals, tuple[str, ...], Signals | None]:
    """The scene's name or the inputs; the inputs that they drive; and the log, where there is one."""
    if "inputs" in table:
        log = read_inputs(folder / _text(table["inputs"], "inputs"))
        return log, log.dtype.names or (), log
    name = _text(table["scene"], "scene")
    if name.endswith(".csv"):
        raise ValueError(f"scene = {name!r}: must be the name of a scene; a control log is given as inputs")
    run = plan(name)
    still = {each for each in ("wind.x", "wind.y") if not run.signals[each].any()}
    return name, tuple(each for each in INPUTS if each not in still), None


def _plan(table: Mapping[str, Any], source: str | Signals, settings: Mapping[str, Any]) -> Run:
    options: dict[str, Any] = {
        key: _number(table[key], key) for key in ("start_time", "stop_time", "communication_step") if key in table
    }
    if "preset" in table:
        options["preset"] = _text(table["preset"], "preset")
    return plan(
        source, start_values={name: _checked(name, value, "set") for name, value in settings.items()}, **options
    )


def _content(table: Mapping[str, Any], log: Signals | None) -> str:
    rows = {} if log is None else {"inputs": {name: log[name].tolist() for name in log.dtype.names or ()}}
    try:
        return json.dumps({**table, **rows}, sort_keys=True)
    except TypeError as error:
        raise ValueError(f"every value must be text, a number, a list or a table; {error}") from error


# ---- the keys


def _known(table: Mapping[str, Any], keys: Iterable[str], where: str) -> None:
    for key, value in table.items():
        if key not in keys:
            raise ValueError(f"{where}{key} = {value!r}: the key must be one of {', '.join(keys)}")


def _table(table: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    value = table.get(key, {})
    if not isinstance(value, Mapping):
        raise ValueError(f"{key} = {value!r}: must be a table")
    return value


def _flat(table: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """TOML reads a bare wind.x as a table in a table."""
    flat: dict[str, Any] = {}
    for key, value in table.items():
        nested = isinstance(value, Mapping) and any(name.startswith(f"{prefix}{key}.") for name in BY_NAME)
        flat |= _flat(value, f"{prefix}{key}.") if nested else {prefix + key: value}
    return flat


def _text(value: Any, key: str) -> str:
    if not isinstance(value, str):
        raise ValueError(f"{key} = {value!r}: must be text")
    return value


def _number(value: Any, key: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        raise ValueError(f"{key} = {value!r}: must be a finite number")
    return float(value)


def _whole(value: Any, key: str, least: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or value < least:
        raise ValueError(f"{key} = {value!r}: must be a whole number from {least}")
    return value


def _names(value: Any, key: str, known: Iterable[str]) -> tuple[str, ...]:
    if not isinstance(value, list) or len(set(map(str, value))) != len(value):
        raise ValueError(f"{key} = {value!r}: must be a list of names, each once")
    for name in value:
        if name not in known:
            raise ValueError(f"{key} = {name!r}: must be one of {', '.join(known)}")
    return tuple(value)


def _checked(name: str, value: Any, where: str) -> float | int:
    """The start value of a variable, possible by itself."""
    try:
        number = start_value(name, value)
        if not np.isfinite(number):
            raise ValueError(f"{name} = {number!r}: must be a finite number")
        if name in Craft.__dataclass_fields__:
            check_parameter(name, number)
        elif name == "step_size":
            check_step_size(number)
        elif name == "tolerance":
            check_tolerance(number)
        elif name == "integrator":
            integrator(int(number))
    except ValueError as error:
        raise ValueError(f"{where}.{error}") from error
    return number


# ---- what is swept


def _factor(name: str, spec: Any, run: Run, driven: tuple[str, ...]) -> Factor:
    if name in INPUTS and name in driven:
        raise ValueError(
            f"sweep.{name} = {spec!r}: must be an input that {run.title} leaves alone: its start value has no effect"
        )
    if name in BY_NAME and (enumeration := BY_NAME[name].chooses):
        raise ValueError(f"sweep.{name} = {spec!r}: must be given as sweep.{enumeration}, which it stands beside")
    if isinstance(spec, list):
        if not spec:
            raise ValueError(f"sweep.{name} = []: must have at least one value")
        return Factor(name, tuple(_checked(name, value, "sweep") for value in spec))
    if not isinstance(spec, Mapping):
        raise ValueError(f"sweep.{name} = {spec!r}: must be a list of values, a range or a distribution")
    if name not in BY_NAME or BY_NAME[name].start is None:
        _checked(name, spec, "sweep")
    if BY_NAME[name].kind != "Real":
        raise ValueError(f"sweep.{name} = {spec!r}: must be a list of values: the variable is no real number")
    if set(spec) & set(DISTRIBUTIONS):
        return _distributed(name, spec)
    return _range(name, spec)


def _range(name: str, spec: Mapping[str, Any]) -> Factor:
    where = f"sweep.{name}."
    _known(spec, ("from", "to", "count", "scale", *DISTRIBUTIONS), where)
    for key in ("from", "to"):
        if key not in spec:
            raise ValueError(f"{where}{key}: must be given")
        _checked(name, _number(spec[key], where + key), "sweep")
    low, high, scale = float(spec["from"]), float(spec["to"]), spec.get("scale", "linear")
    if scale not in ("linear", "log"):
        raise ValueError(f"{where}scale = {scale!r}: must be linear or log")
    if not low < high:
        raise ValueError(f"{where}to = {high!r}: must be above from = {low!r}")
    if scale == "log" and not low > 0.0:
        raise ValueError(f"{where}from = {low!r}: must be greater than 0 where scale is log")
    if "count" in spec:
        count = _whole(spec["count"], where + "count", 2)
        spaced = np.linspace(low, high, count) if scale == "linear" else np.geomspace(low, high, count)
        return Factor(name, tuple(spaced.tolist()))
    return Factor(
        name, distribution=stats.uniform(low, high - low) if scale == "linear" else stats.loguniform(low, high)
    )


def _distributed(name: str, spec: Mapping[str, Any]) -> Factor:
    if len(spec) != 1:
        raise ValueError(f"sweep.{name} = {dict(spec)!r}: must have one key, the distribution")
    ((kind, given),) = spec.items()
    where = f"sweep.{name}.{kind}"
    distribution = DISTRIBUTIONS[kind]
    if not isinstance(given, list) or len(given) != len(distribution.numbers):
        raise ValueError(f"{where} = {given!r}: must be a list of {', '.join(distribution.numbers)}")
    numbers = [_number(value, where) for value in given]
    if kind == "triangular" and not (numbers[0] <= numbers[1] <= numbers[2] and numbers[0] < numbers[2]):
        raise ValueError(f"{where} = {given!r}: must rise")
    if kind != "triangular" and not numbers[1] > 0.0:
        raise ValueError(f"{where} = {given!r}: the standard deviation must be greater than 0")
    if kind == "lognormal" and not numbers[0] > 0.0:
        raise ValueError(f"{where} = {given!r}: the median must be greater than 0")
    return Factor(name, distribution=distribution.frozen(*numbers))


def _sampled(table: Mapping[str, Any], factors: tuple[Factor, ...]) -> tuple[int, NDArray[np.float64] | None]:
    """Number of runs, and the points of a Latin hypercube."""
    method = table.get("method", GRID)
    if method not in SAMPLING:
        raise ValueError(f"sampling.method = {method!r}: must be one of {', '.join(SAMPLING)}")
    if method == GRID:
        _known(table, ("method",), "sampling.")
        for factor in factors:
            if factor.distribution is not None:
                raise ValueError(
                    f"sweep.{factor.name}: must be a list, or a range with a count, where sampling.method is {GRID}"
                )
        return _few_enough(prod(len(factor.values) for factor in factors)), None
    _known(table, ("method", "runs", "seed"), "sampling.")
    runs = _few_enough(_whole(table.get("runs"), "sampling.runs", 1))
    seed = np.random.default_rng(_whole(table.get("seed"), "sampling.seed", 0))
    return runs, qmc.LatinHypercube(d=len(factors), seed=seed).random(runs)


def _few_enough(runs: int) -> int:
    if runs > MAX_RUNS:
        raise ValueError(f"sampling: {runs} runs: must not be more than {MAX_RUNS}")
    return runs


# ---- what is kept


def _keep(table: Mapping[str, Any], run: Run) -> Keep:
    _known(table, ("end", "minimum", "maximum", "distance", "events", "trajectory"), "keep.")
    known = (*OBSERVED, *FORMULAS)
    end, minimum, maximum = (_names(table.get(key, []), f"keep.{key}", known) for key in ("end", "minimum", "maximum"))
    distance = table.get("distance", False)
    if not isinstance(distance, bool):
        raise ValueError(f"keep.distance = {distance!r}: must be true or false")
    events = tuple(_events(_table(table, "events"), known))
    every, names = _trajectory(table.get("trajectory"), run, known)
    keep = Keep(end, minimum, maximum, distance, events, every, names)
    if not keep.columns and not names:
        raise ValueError("keep: must name what to keep: end, minimum, maximum, distance, events or trajectory")
    return keep


def _events(table: Mapping[str, Any], known: tuple[str, ...]) -> Iterator[Event]:
    for name, spec in table.items():
        where = f"keep.events.{name}"
        if not isinstance(spec, Mapping):
            raise ValueError(f"{where} = {spec!r}: must be a table")
        _known(spec, ("of", "above", "below", "values"), f"{where}.")
        (of,) = _names([spec.get("of")], f"{where}.of", known)
        if ("above" in spec) == ("below" in spec):
            raise ValueError(f"{where}: must have above or below, one of them")
        side = "above" if "above" in spec else "below"
        values = _names(spec.get("values", []), f"{where}.values", known)
        yield Event(name, of, side == "above", _number(spec[side], f"{where}.{side}"), values)


def _trajectory(spec: Any, run: Run, known: tuple[str, ...]) -> tuple[float | None, tuple[str, ...]]:
    if spec is None:
        return None, ()
    if not isinstance(spec, Mapping):
        raise ValueError(f"keep.trajectory = {spec!r}: must be a table")
    _known(spec, ("every", "of"), "keep.trajectory.")
    every = _number(spec.get("every"), "keep.trajectory.every")
    whole = round(every / run.communication_step)
    if whole < 1 or not isclose(whole * run.communication_step, every, rel_tol=1e-9):
        raise ValueError(
            f"keep.trajectory.every = {every!r} s: must be a whole number of communication steps of "
            f"{run.communication_step!r} s"
        )
    names = _names(spec.get("of"), "keep.trajectory.of", known)
    if not names:
        raise ValueError("keep.trajectory.of = []: must name at least one variable")
    return every, names
