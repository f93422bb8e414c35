"""Which method owns which region: the cheapest by count, for scenes and for random craft, at every accuracy."""

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import polars as pl

from ..host.fleet import advance_fleet
from ..model.integrators import INTEGRATORS, Integrator
from ..model.subcycling import Settings
from ..simulation import counted, method_in_words, metres
from .extremes import RK4, WITH_TERMS, Batch, advanced, chosen, own_time, pushes, sample
from .laboratory import Tell
from .work_precision import FIRST_STEP

Array = Any
"""One number a run."""
ACCURACIES = (1.0, 0.01, 0.001, 1e-5)
"""m: of scenes, at every communication point."""
SHARES = (0.1, 0.01, 0.001, 1e-6)
"""Of the way: of random craft, at the end."""
TIE = 1.25
"""Times the least count: within that it is a tie. Sub-steps of the grid are a factor of 2 or 2.5 apart, and of the
adaptive method the steps that it refuses are not counted."""


class Owner(NamedTuple):
    """A region and who owns it."""

    region: str
    within: str
    """The accuracy, in words."""
    owner: str
    """The method or, where they tie, the methods."""
    how: str
    """A setting and its count, or the part of the craft that it is the cheapest for."""
    next: str
    """The next method, and what it costs."""


def of_scenes(found: pl.DataFrame) -> Iterator[Owner]:
    """From the table of `work_precision.measured`: of every method the least count that is not warned of."""
    for scene, accuracy in itertools.product(found["scene"].unique(maintain_order=True), ACCURACIES):
        good = found.filter(pl.col("largest_error") <= accuracy, scene=scene, said="nothing")
        least = good.sort("loads", pl.col("communication_step"), descending=[False, True], maintain_order=True)
        offers = list(least.group_by("method", maintain_order=True).first().iter_rows(named=True))
        said = [
            f"{method_in_words(each['method'], each['setting'], each['setting'])}: {each['loads']:.3g}"
            for each in offers
        ]
        tied = sum(each["loads"] <= TIE * offers[0]["loads"] for each in offers)
        owner = " = ".join(each["method"] for each in offers[:tied])
        yield Owner(scene, metres(accuracy), owner, "; ".join(said[:tied]), "".join(said[tied : tied + 1]))


# ---- random craft

DRAWN, KEPT = 16384, 200
"""Craft that are drawn, and the most of a kind that are run."""
HORIZON = 10.0
"""Times in which the motion of a craft changes."""
CUTS = tuple(2**n for n in range(2, 14))
"""Sub-steps of the horizon."""
REFERENCE = 2**15
"""Sub-steps, of RK4; half as many check it."""
DOUBT = 0.1
"""Of the error that is asked for: where the reference may be off by more, the craft says nothing."""
TIGHTNESS = tuple(10.0**-n for n in range(1, 11))
"""Tolerances of the adaptive method, over the mean speed: they are in SI units."""


def _still(runs: Batch) -> Any:
    return ~np.any(pushes(runs), axis=0)


def _spins(runs: Batch) -> Any:
    return np.abs(runs.start.yaw_rate) * own_time(runs) > 0.9


KINDS: Mapping[str, tuple[bool, Callable[[Batch], Any]]] = {
    "random, without air": (False, lambda runs: runs.craft.air_density == 0.0),
    "random, coasting": (False, lambda runs: (runs.craft.air_density > 0.0) & _still(runs)),
    "random, spinning": (False, lambda runs: (runs.craft.air_density > 0.0) & _spins(runs)),
    "random, driven": (False, lambda runs: (runs.craft.air_density > 0.0) & ~_still(runs) & ~_spins(runs)),
    "random, every term, no friction": (True, lambda runs: runs.craft.skirt_friction == 0.0),
    "random, every term": (True, lambda runs: runs.craft.skirt_friction > 0.0),
}
"""Kind -> whether it is drawn with every term, and which of the drawn are of it."""


def of_random_craft(seed: int, tell: Tell) -> Iterator[Owner]:
    """Extremes (`extremes.sample`), each for ten times its own time: what is the cheapest for most of them."""
    for done, (kind, (terms, is_one)) in enumerate(KINDS.items()):
        drawn = sample(np.random.default_rng(seed), DRAWN, 1, WITH_TERMS if terms else "steps to the craft's own time")
        runs = chosen(drawn, np.flatnonzero(is_one(drawn))[:KEPT])
        runs = runs._replace(h=HORIZON * own_time(runs))
        end, way, doubt = _reference(runs)
        counts = [_counts(method, runs, end, way) for method in INTEGRATORS]
        for n, share in enumerate(SHARES):
            sure = (doubt <= DOUBT * share * way) & (way > 0.0)
            yield _owner(kind, f"{share:g} of the way", np.array([count[n] for count in counts])[:, sure])
        tell((done + 1) / len(KINDS))


def _owner(kind: str, within: str, counts: Array) -> Owner:
    """`counts`: of every method, of every craft; infinite where nothing reaches it."""
    best = counts.min(axis=0)
    reached = counts[:, np.isfinite(best)]
    parts = (reached <= TIE * best[np.isfinite(best)]).mean(axis=1)
    order = np.argsort(-parts, kind="stable")
    said = [f"{INTEGRATORS[i].name}: {parts[i]:.0%} of {reached.shape[1]}" for i in order]
    return Owner(kind, within, INTEGRATORS[order[0]].name, said[0], said[1])


def _reference(runs: Batch) -> tuple[Array, Array, Array]:
    """Where they end, shape (2, runs); the length of the way, and how far the end may be off [m]."""
    state, way, pieces = runs.start, np.zeros_like(runs.h), 64
    with np.errstate(all="ignore"):
        for _ in range(pieces):
            cut = runs._replace(h=runs.h / REFERENCE)
            after = advanced(cut, RK4, state, REFERENCE // pieces)[0]
            way = way + np.hypot(after.x - state.x, after.y - state.y)
            state = after
        near = advanced(runs._replace(h=2.0 * runs.h / REFERENCE), RK4, runs.start, REFERENCE // 2)[0]
        return np.array(state[:2]), way, np.hypot(near.x - state.x, near.y - state.y)


def _counts(method: Integrator, runs: Batch, end: Array, way: Array) -> Array:
    """The least count that keeps each share of the way, with all finer settings; shape (shares, runs), infinite: none.

    The adaptive method is not tried where random craft rub: creeping ones take it any number of steps.
    """
    if not method.integrate and np.any(runs.craft.skirt_friction):
        return np.full((len(SHARES), len(runs.h)), np.inf)
    tried = list(_tried(method, runs, way))
    with np.errstate(all="ignore"):
        off = np.array([np.hypot(*(state - end)) / way for state, _, _ in tried])
    quiet, loads = (np.array(values) for values in list(zip(*tried, strict=True))[1:])
    least = []
    for share in SHARES:
        good = quiet & (off <= share)
        kept = np.logical_and.accumulate(good[::-1])[::-1]
        least.append(np.where(kept, loads, np.inf).min(axis=0))
    return np.array(least)


def _tried(method: Integrator, runs: Batch, way: Array) -> Iterator[tuple[Array, Array, Array]]:
    """Setting by setting, the coarsest first: where the craft end, which are quiet, what they cost."""
    if method.integrate:
        for cut in CUTS:
            state, stability, rotation = advanced(runs._replace(h=runs.h / cut), method, runs.start, cut)
            quiet = (stability <= method.stability_limit) & (rotation <= method.rotation_limit)
            yield np.array(state[:2]), quiet, np.full(len(runs.h), counted(method, cut))
        return
    scale = np.maximum(way / runs.h, 1e-300)
    for tightness in TIGHTNESS:
        fleet = advance_fleet(
            runs.start, runs.controls, runs.craft, runs.h, Settings(FIRST_STEP, method, tightness * scale)
        )
        fleet.states[:, fleet.refused.numbers] = np.nan
        yield fleet.states[:2], np.ones(len(runs.h), bool), fleet.substeps * counted(method, 1)


# ---- the map


def map_of(owners: Sequence[Owner]) -> pl.DataFrame:
    """A row a region and accuracy."""
    return pl.DataFrame(owners, Owner._fields, orient="row")


def superseded(owners: pl.DataFrame) -> list[str]:
    """The methods that own no region, and do not tie for one."""
    named = {name for each in owners["owner"] for name in each.split(" = ")}
    return [method.name for method in INTEGRATORS if method.name not in named]


# ---- what to set, in four rows

CHOICES = (
    ("a craft in the background", "splitting", 0.5),
    ("nearly everything", "rk4", 0.1),
    ("a reference, or motion of unknown pace", "adaptive", 1e-8),
    ("(what is set: the teaching example's method)", "semi_implicit_euler", 0.001),
)


def choices(runs: pl.DataFrame, rubbing: Sequence[str]) -> pl.DataFrame:
    """Of each the largest error of all scenes, with those that rub and without, and its loads, the mean over scenes."""
    rows = []
    for what, method, setting in CHOICES:
        own = runs.filter(method=method, setting=setting).group_by("scene").agg(pl.col("largest_error", "loads").max())
        rubs = pl.col("scene").is_in(list(rubbing))
        off, rubbed = (own.filter(part)["largest_error"].to_list() for part in (~rubs, rubs))
        words = metres(max(off)) + "".join(f"; with friction {metres(each)}" for each in rubbed)
        rows.append({
            "for": what, "set": method_in_words(method, setting, setting), "off, at most": words,
            "loads a simulated second": own["loads"].mean(),
        })  # fmt: skip
    return pl.DataFrame(rows)
