"""How the swept parameters of a run follow from its number: no run needs another one, nor room for all of them."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from statistics import NormalDist
from types import MappingProxyType
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..fmu.interface import BY_NAME

Parts: TypeAlias = NDArray[np.float64]
"""Of the probability, between 0 and 1, both left out."""
Words: TypeAlias = NDArray[Any]
"""Of 64 bits, without a sign."""

ROUNDS = 6
"""Of a Feistel network; four are enough where the function in them is random."""
GOLDEN = 0x9E3779B97F4A7C15
"""2^64 over the golden ratio: the step of SplitMix64."""


# ---- distributions: the value below which a part of the probability is


def _each(function: Callable[[float], float], values: Parts) -> Parts:
    """By the platform's libm: numpy's functions differ from processor to processor in the last bit."""
    return np.array([function(value) for value in values.tolist()], np.float64)


def uniform(low: float, high: float, parts: Parts) -> Parts:
    """The same everywhere from low to high."""
    return low + parts * (high - low)


def log_uniform(low: float, high: float, parts: Parts) -> Parts:
    """Its logarithm is uniform."""
    return _each(math.exp, uniform(math.log(low), math.log(high), parts))


def normal(mean: float, deviation: float, parts: Parts) -> Parts:
    """Of Gauss."""
    return _each(NormalDist(mean, deviation).inv_cdf, parts)


def log_normal(median: float, deviation: float, parts: Parts) -> Parts:
    """Its logarithm is normal."""
    return median * _each(math.exp, normal(0.0, deviation, parts))


def triangular(low: float, mode: float, high: float, parts: Parts) -> Parts:
    """Below the mode the probability is (x - low)^2/((high - low)*(mode - low)), and likewise above it."""
    width = high - low
    rising = low + np.sqrt(parts * (width * (mode - low)))
    falling = high - np.sqrt((1.0 - parts) * (width * (high - mode)))
    return np.where(parts * width < mode - low, rising, falling)


class Distribution(NamedTuple):
    """How a parameter may be distributed."""

    numbers: tuple[str, ...]
    """What the study gives."""
    quantile: Callable[..., Parts]
    """(numbers, parts) -> values"""


DISTRIBUTIONS: Mapping[str, Distribution] = MappingProxyType(
    {
        "normal": Distribution(("mean", "standard deviation"), normal),
        "lognormal": Distribution(("median", "standard deviation of the logarithm"), log_normal),
        "triangular": Distribution(("lowest", "most likely", "highest"), triangular),
    }
)


@dataclass(frozen=True)
class Factor:
    """A swept parameter: values to choose from, or a distribution."""

    name: str
    values: tuple[float | int, ...] = ()
    quantile: Callable[[Parts], Parts] | None = None
    """Of the distribution; instead of values"""

    @property
    def kind(self) -> type[np.float64] | type[np.int32]:
        """Of the values, as the FMU has them."""
        return np.float64 if BY_NAME[self.name].kind == "Real" else np.int32

    def at(self, parts: Parts) -> NDArray[Any]:
        """The values at these parts; of a list, every item has the same share."""
        if self.quantile is not None:
            return self.quantile(parts)
        chosen = np.minimum((parts * len(self.values)).astype(np.int64), len(self.values) - 1)
        items: NDArray[Any] = np.array(self.values, self.kind)
        return np.take(items, chosen)


def distributed(name: str, quantile: Callable[..., Parts], *numbers: float) -> Factor:
    """A parameter with such a distribution."""
    return Factor(name, quantile=partial(quantile, *numbers))


@dataclass(frozen=True)
class Sampling:
    """The full grid of the factors, or a Latin hypercube."""

    factors: tuple[Factor, ...]
    runs: int
    seed: int | None
    """Of the Latin hypercube; None: the grid."""

    def samples(self, numbers: NDArray[np.int64]) -> dict[str, NDArray[Any]]:
        """The swept parameters of these runs; on the grid the last factor changes first."""
        if self.seed is not None:
            parts = (latin_hypercube(self.seed, i, self.runs, numbers) for i in range(len(self.factors)))
            return {factor.name: factor.at(part) for factor, part in zip(self.factors, parts, strict=True)}
        places = np.unravel_index(numbers, [len(factor.values) for factor in self.factors])
        return {
            factor.name: np.array(factor.values, factor.kind)[place]
            for factor, place in zip(self.factors, places, strict=True)
        }


def latin_hypercube(seed: int, factor: int, runs: int, numbers: NDArray[np.int64]) -> Parts:
    """One coordinate of those points: in each of `runs` equal strata there is one run, anywhere in it.

    The strata are shuffled by a permutation that is worked out number by number: a Feistel network over the next power
    of 4, again and again until the number is one of a run (Black and Rogaway, 2002). In memory, shuffled as a whole,
    they would be gigabytes, in every worker.
    """
    keys = np.random.SeedSequence(seed, spawn_key=(factor,)).generate_state(2, np.uint64)
    shuffle, place = (int(key) for key in keys)
    jitter = (_random(place, numbers.astype(np.uint64)) >> 12) * 2.0**-52 + 2.0**-53
    parts: Parts = (_shuffled(shuffle, runs, numbers) + jitter) / runs
    return np.minimum(parts, 1.0 - 2.0**-53)  # where the last one is rounded up


def _shuffled(key: int, runs: int, numbers: NDArray[np.int64]) -> Words:
    half = max(1, -(-(runs - 1).bit_length() // 2))
    places = numbers.astype(np.uint64)
    outside = np.ones(len(places), bool)
    while outside.any():
        left, right = places[outside] >> half, places[outside] & (1 << half) - 1
        for i in range(ROUNDS):
            left, right = right, left ^ _random(key + i, right) & (1 << half) - 1
        places[outside] = left << half | right
        outside = places >= runs
    return places


def _random(key: int, numbers: Words) -> Words:
    """Output by output of SplitMix64 (Steele, Lea, Flood, 2014), whose state after n steps is key + n*GOLDEN."""
    x: Words = numbers * GOLDEN + np.uint64((key + GOLDEN) % 2**64)
    x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9
    x = (x ^ (x >> 27)) * 0x94D049BB133111EB
    mixed: Words = x ^ (x >> 31)
    return mixed
