"""Makes runs on the compiled kernel, all craft at once: with the bits of the native FMU."""

from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..fmu.interface import (
    ACTION,
    COUNTER_STOPPED,
    CRAFT_PARAMETERS,
    ERRORS,
    HELD,
    INPUT_HELD,
    INPUTS,
    MOTION,
    STATES,
    STEP_TURNS,
    STEP_UNSTABLE,
    SUBSTEPS_MAX,
    WATCHED,
)
from ..host.fleet import Array, Crafts, advance_fleet, observe_fleet, refusals
from ..host.ramps import slopes
from ..model.dynamics import Controls, State
from ..model.subcycling import NonFiniteError, Settings, meant_step, too_strong
from .engines import SETTINGS, Plan, Ran, empty, settings_of
from .quantities import Samples
from .timeline import Leg, merged


def run_batch(plan: Plan, samples: Samples) -> Ran:
    """Make runs on the compiled kernel, those with the same settings at once.

    A run that cannot be made has its error, and the others go on.
    """
    ran = empty(plan, len(next(iter(samples.values()))))
    with np.errstate(all="ignore"):  # what leaves the range of numbers is found, run by run
        for settings, group in _groups(plan, samples):
            possible = _possible(plan, samples, group, ran)
            if len(possible):
                _Batch(plan, settings, {name: column[possible] for name, column in samples.items()}, possible, ran).go()
    return ran


def _groups(plan: Plan, samples: Samples) -> Iterator[tuple[Settings, NDArray[np.int64]]]:
    """The runs with the same settings."""
    shared = {name: plan.run.value(name) for name in SETTINGS}
    swept = {name: samples[name].tolist() for name in SETTINGS if name in samples}
    if not swept:
        yield settings_of(shared), np.arange(len(next(iter(samples.values()))))
        return
    groups: dict[tuple[float | int, ...], list[int]] = {}
    for i, key in enumerate(zip(*swept.values(), strict=True)):
        groups.setdefault(key, []).append(i)
    for key, group in groups.items():
        yield settings_of(shared | dict(zip(swept, key, strict=True))), np.array(group)


def _parameters(plan: Plan, samples: Samples) -> dict[str, Array]:
    return {name: np.asarray(samples.get(name, plan.run.value(name)), float) for name in CRAFT_PARAMETERS}


def _possible(plan: Plan, samples: Samples, group: NDArray[np.int64], ran: Ran) -> NDArray[np.int64]:
    """Those of the group whose craft can be; the errors of the others are noted."""
    parameters = _parameters(plan, {name: column[group] for name, column in samples.items()})
    refused = refusals(parameters, len(group))
    for i, why in refused.items():
        ran.errors[group[i]] = why
    return np.delete(group, list(refused))


@lru_cache(maxsize=16)
def _merged(legs: tuple[Leg, ...], start_time: float, settings: Settings) -> list[Leg]:
    """The same for every chunk."""
    return merged(legs, start_time, settings)


class _Batch:
    """Runs that share sub-step and method, as arrays."""

    def __init__(self, plan: Plan, settings: Settings, samples: Samples, group: NDArray[np.int64], ran: Ran) -> None:
        self._plan, self._settings, self._samples, self._group, self._ran = plan, settings, samples, group, ran
        count = len(group)
        self._parameters = _parameters(plan, samples)
        self._crafts = Crafts(**self._parameters)
        start = [np.broadcast_to(samples.get(name, plan.run.value(name)), count) for name in STATES]
        self._states: Array = np.array(start, float)
        self._proposed, self._stability, self._rotation = np.zeros((3, count))
        self._substeps, self._held = np.zeros(count, np.int64), np.zeros(count, bool)
        self._errors: dict[int, str] = {}

    def go(self) -> None:
        timeline = self._plan.timeline
        point = 0
        if timeline.start_kept:
            self._keep(point, self._controls(timeline.start))
            point += 1
        for leg in _merged(timeline.legs, self._plan.run.start_time, self._settings):
            controls = self._advance(leg)
            if leg.kept:
                self._keep(point, controls)
                point += 1
        self._finish()

    def _controls(self, controls: Controls) -> Controls:
        given: Any = (self._samples.get(name, value) for name, value in zip(INPUTS, controls, strict=True))
        return Controls(*given)

    def _slopes(self, leg: Leg) -> Controls | None:
        """Those of swept inputs are 0."""
        if leg.first == leg.last:
            return None
        given = zip(INPUTS, slopes(leg.end - leg.time, leg.first, leg.last), strict=True)
        return Controls(*(0.0 if name in self._samples else slope for name, slope in given))

    def _advance(self, leg: Leg) -> Controls:
        """The controls at the end of the leg."""
        step = meant_step(leg.time, leg.end - leg.time, self._plan.run.start_time, self._settings.step_size)
        rates = self._slopes(leg)
        first = last = self._controls(leg.first)
        if rates:
            last = Controls(*(start + step * rate for start, rate in zip(first, rates, strict=True)))
        fleet = advance_fleet(self._states, first, self._crafts, step, self._settings, rates, proposed=self._proposed)
        self._states, self._proposed = fleet.states, fleet.proposed
        stability, rotation = fleet.stability, fleet.rotation
        for i, why in fleet.refused.items():
            if i not in self._errors:
                told = self._too_strong(i, last, leg) if isinstance(why, ArithmeticError) else ""
                self._errors[i] = told or _said(why, leg.time)
        for i in np.flatnonzero(~(np.isfinite(stability) & np.isfinite(rotation))).tolist():
            if i not in self._errors:
                told = self._too_strong(i, last, leg)
                self._errors[i] = told or _watched(stability[i].item(), rotation[i].item(), self._settings, leg)
        self._stability = np.maximum(self._stability, fleet.stability)
        self._rotation = np.maximum(self._rotation, fleet.rotation)
        self._substeps += fleet.substeps
        self._look_for_held(first)
        if rates:
            self._look_for_held(last)
        return last

    def _too_strong(self, i: int, controls: Controls, leg: Leg) -> str:
        """Of a run that no step helps, as an input drives the craft too fast; '' where none does."""
        held: Any = (np.broadcast_to(value, self._held.shape)[i].item() for value in controls)
        own = Controls(*held)
        field = too_strong(own, self._crafts.one(i))
        if not field:
            return ""
        return (
            f"{INPUTS[Controls._fields.index(field)]} = {getattr(own, field)!r}: must not drive the craft so fast that "
            f"even sub-steps of 1e-12 s are too long; the step was refused and the state of {leg.time!r} s stands"
        )

    def _look_for_held(self, controls: Controls) -> None:
        for value, limit in zip(controls[:3], self._saturated(controls), strict=True):
            self._held |= np.abs(value - limit) > HELD * np.maximum(1.0, np.abs(limit))

    def _saturated(self, controls: Controls) -> list[Array]:
        thrust = np.clip(controls.thrust, self._parameters["thrust_min"], self._parameters["thrust_max"])
        return [thrust, np.clip(controls.port, 0.0, 1.0), np.clip(controls.starboard, 0.0, 1.0)]

    def _keep(self, point: int, controls: Controls) -> None:
        read = self._plan.keep.read
        values = (*self._states, self._stability, self._rotation)
        seen: dict[str, Any] = dict(zip((*STATES, *WATCHED), values, strict=True)) | dict.fromkeys(ERRORS, 0.0)
        if {*MOTION, *ACTION} & set(read):
            seen |= self._observed(controls)
        for i, name in enumerate(read):
            self._ran.record[self._group, point, i] = seen[name]

    def _observed(self, controls: Controls) -> dict[str, Any]:
        """As model/observation.py has it."""
        surge, sway, force_x, force_y, moment, _ = observe_fleet(self._states, controls, self._crafts)
        vx, vy = self._states[3:5]
        mass, inertia = self._parameters["mass"], self._parameters["inertia"]
        thrust, port, starboard = self._saturated(controls)
        action = (force_x, force_y, moment, force_x / mass, force_y / mass, moment / inertia, thrust,
                  self._parameters["steering_force"] * (port - starboard))  # fmt: skip
        return dict(zip((*MOTION, *ACTION), (surge, sway, np.sqrt(vx * vx + vy * vy), *action), strict=True))

    def _finish(self) -> None:
        method = self._settings.integrator
        self._ran.warnings[self._group] = (
            INPUT_HELD * self._held
            + COUNTER_STOPPED * (self._substeps > SUBSTEPS_MAX)
            + STEP_UNSTABLE * (self._stability > method.stability_limit)
            + STEP_TURNS * (self._rotation > method.rotation_limit)
        )
        failed = self._group[list(self._errors)]
        self._ran.warnings[failed] = 0
        self._ran.record[failed] = np.nan
        for i, why in self._errors.items():
            self._ran.errors[self._group[i]] = why


# ---- in the words of the FMU


def _said(error: Exception, time: float) -> str:
    if not isinstance(error, NonFiniteError):
        return str(error)
    return _runaway(STATES[State._fields.index(error.component)], error.value, time, error.substep)


def _watched(stability: float, rotation: float, settings: Settings, leg: Leg) -> str:
    """What is watched over a step may overflow where the motion just does not."""
    name, value = ("stability_number", stability) if np.isfinite(rotation) else ("rotation_per_substep", rotation)
    return _runaway(name, value, leg.time, settings.step_size)


def _runaway(name: str, value: float, time: float, substep: float) -> str:
    return (
        f"{name} = {value!r} after {time!r} s: must stay a finite number; the step was refused and the state of "
        f"{time!r} s stands; the motion is too fast for sub-steps of {substep!r} s: set a smaller step_size"
    )
