"""Makes runs on the bare model, all craft at once."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..fmu.interface import (
    ACTION,
    CRAFT_PARAMETERS,
    HELD,
    INPUT_HELD,
    INPUTS,
    MOTION,
    STATES,
    STEP_TURNS,
    STEP_UNSTABLE,
    WATCHED,
)
from ..model.craft import Craft
from ..model.dynamics import Controls, State, saturate
from ..model.observation import observe_action, observe_motion
from ..model.subcycling import Settings, advance, stability_number
from ..simulation import Run
from .engines import SETTINGS, Plan, Ran, empty, settings_of
from .study import Samples
from .timeline import Leg, merged


def run_batch(plan: Plan, samples: Samples) -> Ran:
    """Make runs on the bare model, all craft with the same settings at once, with the functions of the FMU.

    Where a run cannot be made its error is what the model says of that craft alone.

    Raises:
        ValueError: the adaptive method, whose step is each craft's own.
    """
    ran = empty(plan, len(next(iter(samples.values()))))
    with np.errstate(all="ignore"):  # what leaves the range of numbers is found at the end
        for settings, group in _groups(plan, samples):
            possible = _possible(plan, samples, group, ran)
            if len(possible):
                _batch(plan, settings, {name: column[possible] for name, column in samples.items()}, possible, ran)
    return ran


def _groups(plan: Plan, samples: Samples) -> Iterator[tuple[Settings, NDArray[np.int64]]]:
    """The runs with the same settings."""
    count = len(next(iter(samples.values())))
    columns = [np.broadcast_to(samples.get(name, plan.run.value(name)), count).tolist() for name in SETTINGS]
    groups: dict[tuple[float | int, ...], list[int]] = {}
    for i, key in enumerate(zip(*columns, strict=True)):
        groups.setdefault(key, []).append(i)
    for key, group in groups.items():
        yield settings_of(dict(zip(SETTINGS, key, strict=True))), np.array(group)


def _possible(plan: Plan, samples: Samples, group: NDArray[np.int64], ran: Ran) -> NDArray[np.int64]:
    """Those of the group whose craft can be; the errors of the others are noted."""
    if _refusal(plan.run, {name: column[group] for name, column in samples.items()}) is None:
        return group
    for i in group:
        ran.errors[i] = _refusal(plan.run, {name: column[i].item() for name, column in samples.items()})
    return np.array([i for i in group if ran.errors[i] is None], np.int64)


def _refusal(run: Run, values: Mapping[str, Any]) -> str | None:
    """Why there cannot be such a craft, or such craft."""
    try:
        _craft(run, values)
    except ValueError as error:
        return str(error)
    return None


def _batch(plan: Plan, settings: Settings, samples: Samples, group: NDArray[np.int64], ran: Ran) -> None:
    try:
        _Batch(plan, settings, samples, group, ran).go()
    except ValueError as error:  # a sub-step that cannot be, which they share
        ran.record[group] = np.nan
        for i in group:
            ran.errors[i] = str(error)


def _craft(run: Run, values: Mapping[str, Any]) -> Craft:
    return Craft(**{name: values.get(name, run.value(name)) for name in CRAFT_PARAMETERS})


class _Batch:
    """Runs that share sub-step and method, as arrays."""

    def __init__(self, plan: Plan, settings: Settings, samples: Samples, group: NDArray[np.int64], ran: Ran) -> None:
        self._plan, self._settings, self._samples, self._group, self._ran = plan, settings, samples, group, ran
        self._craft = _craft(plan.run, samples)
        everyone = np.ones(len(group))
        start: list[Any] = [samples.get(name, plan.run.value(name)) * everyone for name in STATES]
        self._state = State(*start)
        self._stability: NDArray[np.float64] = np.zeros(len(group))
        self._rotation: NDArray[np.float64] = np.zeros(len(group))
        self._held = np.zeros(len(group), bool)

    def go(self) -> None:
        timeline = self._plan.timeline
        point = 0
        if timeline.start_kept:
            self._keep(point, self._controls(timeline.start, self._samples))
            point += 1
        legs = merged(timeline.legs, self._settings)
        for leg in legs:
            controls = self._controls(leg.controls, self._samples)
            self._advance(leg, controls)
            if leg.kept:
                self._keep(point, controls)
                point += 1
        self._finish(legs)

    def _controls(self, controls: Controls, values: Mapping[str, Any]) -> Controls:
        return Controls(*(values.get(name, value) for name, value in zip(INPUTS, controls, strict=True)))

    def _advance(self, leg: Leg, controls: Controls) -> None:
        stretch = advance(self._state, controls, self._craft, leg.end - leg.time, self._settings, ns=np)
        self._state = stretch.state
        number = stability_number(stretch.drag_mass, stretch.rotation, self._craft)
        # not fmax: what is not a number stays so
        self._stability = np.maximum(self._stability, number)
        self._rotation = np.maximum(self._rotation, stretch.rotation)
        for value, limit in zip(controls, saturate(controls, self._craft, np), strict=True):
            self._held |= np.abs(value - limit) > HELD * np.maximum(1.0, np.abs(limit))

    def _keep(self, point: int, controls: Controls) -> None:
        read = self._plan.keep.read
        seen: dict[str, Any] = dict(
            zip((*STATES, *WATCHED), (*self._state, self._stability, self._rotation), strict=True)
        )
        seen |= zip(MOTION, observe_motion(self._state, np), strict=True)
        if set(ACTION) & set(read):
            seen |= zip(ACTION, observe_action(self._state, controls, self._craft, np), strict=True)
        for i, name in enumerate(read):
            self._ran.record[self._group, point, i] = seen[name]

    def _finish(self, legs: list[Leg]) -> None:
        method = self._settings.integrator
        warnings = (
            INPUT_HELD * self._held
            + STEP_UNSTABLE * (self._stability > method.stability_limit)
            + STEP_TURNS * (self._rotation > method.rotation_limit)
        )
        failed = ~np.isfinite(sum(self._state) + self._stability)
        self._ran.warnings[self._group] = np.where(failed, 0, warnings)
        self._ran.record[self._group[failed]] = np.nan
        for i in np.flatnonzero(failed):
            self._ran.errors[self._group[i]] = self._why({k: c[i].item() for k, c in self._samples.items()}, legs)

    def _why(self, values: Mapping[str, float | int], legs: list[Leg]) -> str:
        """What the model says of this craft alone."""
        run = self._plan.run
        state = State(*(float(values.get(name, run.value(name))) for name in STATES))
        craft = _craft(run, values)
        try:
            for leg in legs:
                controls = self._controls(leg.controls, values)
                state = advance(state, controls, craft, leg.end - leg.time, self._settings).state
        except (ValueError, ArithmeticError) as error:
            return str(error)
        return (
            f"stability_number: must stay a finite number; set a smaller step_size than {self._settings.step_size!r} s"
        )
