"""A study: what is held, what is swept, how it is sampled, what is kept. Checked once, here."""

import json
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any, NamedTuple, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..fmu.interface import BY_NAME, EXTERNAL, INPUTS, WIND
from ..fmu.near_names import beside, did_you_mean, must_be_one_of
from ..fmu.start_values import start_value
from ..model.craft import Craft, check_parameter
from ..model.integrators import integrator
from ..model.subcycling import check_step_size, check_tolerance, substeps
from ..scenes import Signals
from ..simulation import Run, check_effect, plan, read_inputs
from ..simulation.planning import MAX_STEPS, MistakesError
from .quantities import FORMULAS, OBSERVED, Event, Keep
from .sampling import DISTRIBUTIONS, Factor, Sampling, distributed, log_uniform, uniform

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
MAX_RUNS = 10**10
"""Or a slip of the decimal point."""


Given = ParamSpec("Given")
Made = TypeVar("Made")


class Mistakes(list[str]):
    """Lines on what is wrong with a study, so that all of it is told at once."""

    def tried(self, make: Callable[Given, Made], *given: Given.args, **named: Given.kwargs) -> Made | None:
        """What is made of that, or None, and its mistakes are noted."""
        try:
            return make(*given, **named)
        except ValueError as error:
            self.extend(str(error).splitlines())
            return None

    def tell(self) -> None:
        """Raises ValueError where there are some."""
        if self:
            raise MistakesError(self)


@dataclass(frozen=True)
class Study:
    """A study, checked. Every run has a number; its parameters follow from that and the study alone."""

    name: str
    run: Run
    """All that the runs share: the scene or the inputs, the fixed settings, the times."""
    sampling: Sampling
    keep: Keep
    content: str
    """The study as JSON, inputs and all: two studies are the same where this is."""

    @property
    def factors(self) -> tuple[Factor, ...]:
        """What is swept."""
        return self.sampling.factors

    @property
    def runs(self) -> int:
        """How many there are."""
        return self.sampling.runs

    def samples(self, numbers: NDArray[np.int64]) -> dict[str, NDArray[Any]]:
        """See `Sampling.samples`."""
        return self.sampling.samples(numbers)


def read_study(source: str | Path | Mapping[str, Any]) -> Study:
    """Read and check a study: a TOML file, the name of one that comes with the package (STUDIES), or its content.

    Raises:
        OSError: no such file.
        ValueError: all mistakes, each one line with the file, the key, the value and the rule.
    """
    if isinstance(source, Mapping):
        return _study(source, "study", Path())
    path = SHIPPED / f"{source}.toml" if str(source) in STUDIES else Path(source)
    if not path.exists():
        meant = did_you_mean(source, STUDIES) or beside(path)
        raise FileNotFoundError(f"study = {str(source)!r}: must be a TOML file, or one of {', '.join(STUDIES)}{meant}")
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:  # of TOML, or of the encoding
        raise ValueError(f"{path}: must be a TOML file; {error}") from error
    try:
        return _study(table, path.stem, path.parent)
    except ValueError as error:
        raise MistakesError(f"{path}: {line}" for line in str(error).splitlines()) from error


def _study(table: Mapping[str, Any], name: str, folder: Path) -> Study:
    mistakes = Mistakes()
    mistakes.tried(_known, table, TOP, "")
    settings, swept = (_flat(mistakes.tried(_table, table, key) or {}) for key in ("set", "sweep"))
    sampling, kept = (mistakes.tried(_table, table, key) for key in ("sampling", "keep"))
    source = mistakes.tried(_source, table, folder)
    run = mistakes.tried(_plan, table, source, settings)
    factors = [mistakes.tried(_factor, key, value, source) for key, value in swept.items()]
    if not swept and isinstance(table.get("sweep", {}), Mapping):
        mistakes.append("sweep: must have at least one parameter")
    mistakes += [f"set.{key} = {value!r}: must not be swept, too" for key, value in settings.items() if key in swept]
    right = tuple(factor for factor in factors if factor)
    sampled = mistakes.tried(_sampled, sampling, right) if sampling is not None and right else None
    keep = mistakes.tried(_keep, kept, run) if kept is not None else None
    if keep:
        mistakes += _same_columns((factor.name for factor in right), keep)
    if mistakes or not (source and run and sampled and keep):
        raise MistakesError(mistakes)
    return Study(name, run, sampled, keep, _content(table, source.log))


def _same_columns(swept: Iterable[str], keep: Keep) -> list[str]:
    """A column that is there twice would be one of the two."""
    names = Counter(("run", *swept, *keep.columns, "warnings", "error"))
    return [
        f"keep: the column {name} must be there once: name the event otherwise" for name in names if names[name] > 1
    ]


class _Source(NamedTuple):
    """What drives the inputs."""

    given: str | Signals
    """The scene's name or the inputs."""
    title: str
    driven: tuple[str, ...]
    """The inputs that it drives."""
    log: Signals | None


def _source(table: Mapping[str, Any], folder: Path) -> _Source:
    if ("scene" in table) == ("inputs" in table):
        raise ValueError("scene: must be given, or else inputs (a control log), and not both")
    if "inputs" in table:
        log = read_inputs(folder / _text(table["inputs"], "inputs"))
        return _Source(log, "inputs", log.dtype.names or (), log)
    name = _text(table["scene"], "scene")
    if name.endswith(".csv"):
        raise ValueError(f"scene = {name!r}: must be the name of a scene; a control log is given as inputs")
    run = plan(name)
    still = {each for each in (*WIND, *EXTERNAL) if not run.signals[each].any()}
    return _Source(name, name, tuple(each for each in INPUTS if each not in still), None)


def _plan(table: Mapping[str, Any], source: _Source | None, settings: Mapping[str, Any]) -> Run | None:
    mistakes = Mistakes()
    options: dict[str, Any] = {
        key: mistakes.tried(_number, table[key], key)
        for key in ("start_time", "stop_time", "communication_step")
        if key in table
    }
    if "preset" in table:
        options["preset"] = mistakes.tried(_text, table["preset"], "preset")
    values = {name: mistakes.tried(_checked, name, value, "set") for name, value in settings.items()}
    if source:
        mistakes.tried(check_effect, settings, source.driven, source.title, "set.")
        right = {name: value for name, value in values.items() if value is not None and name not in source.driven}
        run = mistakes.tried(plan, source.given, start_values=right, **options)
    mistakes.tell()
    return run if source else None


def _content(table: Mapping[str, Any], log: Signals | None) -> str:
    rows = {} if log is None else {"inputs": {name: log[name].tolist() for name in log.dtype.names or ()}}
    try:
        return json.dumps({**table, **rows}, sort_keys=True)
    except TypeError as error:
        raise ValueError(f"every value must be text, a number, a list or a table; {error}") from error


# ---- the keys


def _known(table: Mapping[str, Any], keys: Iterable[str], where: str) -> None:
    Mistakes(
        f"{where}{key} = {value!r}: the key must be one of {', '.join(keys)}{did_you_mean(key, keys)}"
        for key, value in table.items()
        if key not in keys
    ).tell()


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
    Mistakes(must_be_one_of(key, name, known) for name in value if name not in known).tell()
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


def _factor(name: str, spec: Any, source: _Source | None) -> Factor:
    if source:
        check_effect({name: spec}, source.driven, source.title, "sweep.")
    if name in BY_NAME and (enumeration := BY_NAME[name].chooses):
        raise ValueError(f"sweep.{name} = {spec!r}: must be given as sweep.{enumeration}, which it stands beside")
    if isinstance(spec, list):
        if not spec:
            raise ValueError(f"sweep.{name} = []: must have at least one value")
        return Factor(name, _values(name, spec))
    if not isinstance(spec, Mapping):
        raise ValueError(f"sweep.{name} = {spec!r}: must be a list of values, a range or a distribution")
    if name not in BY_NAME or BY_NAME[name].start is None:
        _checked(name, spec, "sweep")
    if BY_NAME[name].kind != "Real":
        raise ValueError(f"sweep.{name} = {spec!r}: must be a list of values: the variable is no real number")
    if set(spec) & set(DISTRIBUTIONS):
        return _distributed(name, spec)
    return _range(name, spec)


def _values(name: str, given: Iterable[Any]) -> tuple[float | int, ...]:
    mistakes = Mistakes()
    values = [mistakes.tried(_checked, name, value, "sweep") for value in given]
    mistakes.tell()
    return tuple(value for value in values if value is not None)


def _range(name: str, spec: Mapping[str, Any]) -> Factor:
    where, mistakes = f"sweep.{name}.", Mistakes()
    mistakes.tried(_known, spec, ("from", "to", "count", "scale", *DISTRIBUTIONS), where)
    low, high = (mistakes.tried(_bound, name, spec, key) for key in ("from", "to"))
    count = mistakes.tried(_whole, spec["count"], where + "count", 2) if "count" in spec else None
    scale = spec.get("scale", "linear")
    if scale not in ("linear", "log"):
        mistakes.append(f"{where}scale = {scale!r}: must be linear or log")
    if low is not None and high is not None and not low < high:
        mistakes.append(f"{where}to = {high!r}: must be above from = {low!r}")
    if low is not None and scale == "log" and not low > 0.0:
        mistakes.append(f"{where}from = {low!r}: must be greater than 0 where scale is log")
    mistakes.tell()
    return _spread(name, low, high, scale, count)


def _bound(name: str, spec: Mapping[str, Any], key: str) -> float:
    if key not in spec:
        raise ValueError(f"sweep.{name}.{key}: must be given")
    return float(_checked(name, _number(spec[key], f"sweep.{name}.{key}"), "sweep"))


def _spread(name: str, low: Any, high: Any, scale: str, count: int | None) -> Factor:
    if count is not None:
        spaced = np.linspace(low, high, count) if scale == "linear" else np.geomspace(low, high, count)
        return Factor(name, tuple(spaced.tolist()))
    return distributed(name, uniform if scale == "linear" else log_uniform, low, high)


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
    return distributed(name, distribution.quantile, *numbers)


def _sampled(table: Mapping[str, Any], factors: tuple[Factor, ...]) -> Sampling:
    method = table.get("method", GRID)
    if method not in SAMPLING:
        raise ValueError(f"sampling.method = {method!r}: must be one of {', '.join(SAMPLING)}")
    mistakes = Mistakes()
    if method == GRID:
        mistakes.tried(_known, table, ("method",), "sampling.")
        mistakes += [
            f"sweep.{factor.name}: must be a list, or a range with a count, where sampling.method is {GRID}"
            for factor in factors
            if factor.quantile
        ]
        mistakes.tell()
        return Sampling(factors, _few_enough(prod(len(factor.values) for factor in factors)), None)
    mistakes.tried(_known, table, ("method", "runs", "seed"), "sampling.")
    runs = mistakes.tried(_whole, table.get("runs"), "sampling.runs", 1)
    seed = mistakes.tried(_whole, table.get("seed"), "sampling.seed", 0)
    mistakes.tell()
    return Sampling(factors, _few_enough(runs or 0), seed)


def _few_enough(runs: int) -> int:
    if runs > MAX_RUNS:
        raise ValueError(f"sampling: {runs} runs: must not be more than {MAX_RUNS}")
    return runs


# ---- what is kept


def _keep(table: Mapping[str, Any], run: Run | None) -> Keep:
    mistakes = Mistakes()
    mistakes.tried(_known, table, ("end", "minimum", "maximum", "distance", "events", "trajectory"), "keep.")
    known = (*OBSERVED, *FORMULAS)
    end, minimum, maximum = (
        mistakes.tried(_names, table.get(key, []), f"keep.{key}", known) or () for key in ("end", "minimum", "maximum")
    )
    distance = table.get("distance", False)
    if not isinstance(distance, bool):
        mistakes.append(f"keep.distance = {distance!r}: must be true or false")
    specs = mistakes.tried(_table, table, "events") or {}
    events = [mistakes.tried(_event, name, spec, known) for name, spec in specs.items()]
    every, names = mistakes.tried(_trajectory, table.get("trajectory"), run, known) or (None, ())
    keep = Keep(end, minimum, maximum, distance, tuple(event for event in events if event), every, names)
    if not mistakes and not keep.columns and not names:
        mistakes.append("keep: must name what to keep: end, minimum, maximum, distance, events or trajectory")
    mistakes.tell()
    return keep


def _event(name: str, spec: Any, known: tuple[str, ...]) -> Event:
    where, mistakes = f"keep.events.{name}", Mistakes()
    if not isinstance(spec, Mapping):
        raise ValueError(f"{where} = {spec!r}: must be a table")
    mistakes.tried(_known, spec, ("of", "above", "below", "values"), f"{where}.")
    of = mistakes.tried(_names, [spec.get("of")], f"{where}.of", known) or ("",)
    if ("above" in spec) == ("below" in spec):
        mistakes.append(f"{where}: must have above or below, one of them")
    side = "above" if "above" in spec else "below"
    limit = mistakes.tried(_number, spec[side], f"{where}.{side}") if side in spec else None
    values = mistakes.tried(_names, spec.get("values", []), f"{where}.values", known) or ()
    mistakes.tell()
    return Event(name, of[0], side == "above", limit or 0.0, values)


def _trajectory(spec: Any, run: Run | None, known: tuple[str, ...]) -> tuple[float | None, tuple[str, ...]]:
    if spec is None:
        return None, ()
    if not isinstance(spec, Mapping):
        raise ValueError(f"keep.trajectory = {spec!r}: must be a table")
    mistakes = Mistakes()
    mistakes.tried(_known, spec, ("every", "of"), "keep.trajectory.")
    every = mistakes.tried(_number, spec.get("every"), "keep.trajectory.every")
    if run and every is not None and not _is_whole(every, run.communication_step):
        mistakes.append(
            f"keep.trajectory.every = {every!r} s: must be a whole number of communication steps of "
            f"{run.communication_step!r} s"
        )
    names = mistakes.tried(_names, spec.get("of"), "keep.trajectory.of", known)
    if names == ():
        mistakes.append("keep.trajectory.of = []: must name at least one variable")
    mistakes.tell()
    return every, names or ()


def _is_whole(every: float, step: float) -> bool:
    return 0.0 < every <= MAX_STEPS * step and substeps(every, step)[1] == step
