"""The named scenes that demos, tests, benchmarks and studies share: controls over time, start, exact solution."""

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .fmu.interface import CRAFT_PARAMETERS, INPUTS
from .fmu.near_names import must_be_one_of
from .model.craft import Craft, preset
from .model.dynamics import State

Row: TypeAlias = tuple[float, ...]
"""time [s], thrust [N], port thruster, starboard thruster [1]; and, where there is wind, its x and y [m/s]; and, where
loads come from outside, their x and y [N] and moment [N.m]."""
Signals: TypeAlias = NDArray[np.void]
"""Structured array with the fields `time` and names of inputs; linear between rows, a jump is two rows at one time."""

Times: TypeAlias = NDArray[np.float64]
"""s, shape (n,)."""
Trajectory: TypeAlias = tuple[NDArray[np.float64], ...]
"""The components of the state, in their order, shape (n,) each."""

CONTROL_LOGS = Path(__file__).parent / "controls"


@dataclass(frozen=True)
class Scene:
    """A situation to simulate: the craft, where it starts, and what the operator does."""

    name: str
    description: str
    rows: tuple[Row, ...]
    preset: str = "textbook"
    parameters: Mapping[str, float] = field(default_factory=dict)
    """What differs from the preset."""
    start: State = State()  # noqa: RUF009 - immutable
    communication_step: float = 0.1
    """s"""
    exact: Callable[[Times], Trajectory] | None = None
    """The exact solution, where there is one."""

    @property
    def stop_time(self) -> float:
        """s: the time of the last row."""
        return self.rows[-1][0]

    @property
    def signals(self) -> Signals:
        """The controls as fmpy takes them."""
        return signals(self.rows)

    @property
    def craft(self) -> Craft:
        """The craft of the scene."""
        chosen = preset(self.preset)
        values: dict[str, Any] = {name: getattr(chosen, name) for name in CRAFT_PARAMETERS}
        return Craft(**{**values, **self.parameters})


def signals(rows: Iterable[Row]) -> Signals:
    """Rows as a structured array, with a column for every input that they have."""
    table = list(rows)
    names = ("time", *INPUTS)[: len(table[0])]
    return np.array(table, dtype=[(name, np.float64) for name in names])


def scene(name: str) -> Scene:
    """The named scene. Raises ValueError with the names there are."""
    if name not in SCENES:
        raise ValueError(must_be_one_of("scene", name, SCENES))
    return SCENES[name]


def held(stop_time: float, *changes: Row) -> tuple[Row, ...]:
    """Controls that jump at each row's time and hold until the next one, or until `stop_time`."""
    rows: list[Row] = []
    for row in changes:
        if rows:
            rows.append((row[0], *rows[-1][1:]))
        rows.append(row)
    rows.append((stop_time, *rows[-1][1:]))
    return tuple(rows)


def _control_log(name: str) -> tuple[Row, ...]:
    """A recorded log that ships with the package: CSV, columns time, thrust, port thruster, starboard thruster."""
    table = np.loadtxt(CONTROL_LOGS / name, delimiter=",", skiprows=1)
    return tuple((float(t), float(thrust), float(port), float(starboard)) for t, thrust, port, starboard in table)


def _launch(times: Times) -> Trajectory:
    """From rest at constant thrust T: v = v_t*tanh(t/tau), x = v_t*tau*ln(cosh(t/tau)), tau = m*v_t/T."""
    craft, thrust = Craft(), 5.0
    terminal = math.sqrt(thrust / craft.drag_factor)
    tau = craft.mass * terminal / thrust
    zero = np.zeros_like(times)
    # ln(cosh(z)) = z + ln((1 + exp(-2z))/2), which does not overflow
    z = times / tau
    log_cosh = z + np.log1p(np.exp(-2.0 * z)) - math.log(2.0)
    return terminal * tau * log_cosh, zero, zero, terminal * np.tanh(z), zero, zero


COAST_SPEED = 2.0
"""m/s"""


def _coast(times: Times) -> Trajectory:
    """Without thrust, straight: v = v0/(1 + kappa*v0*t), x = ln(1 + kappa*v0*t)/kappa, kappa = k/m."""
    craft = Craft()
    kappa = craft.drag_factor / craft.mass
    zero = np.zeros_like(times)
    growth = 1.0 + kappa * COAST_SPEED * times
    return np.log(growth) / kappa, zero, zero, COAST_SPEED / growth, zero, zero


CYCLOID_YAW_RATE = 2.0 * math.pi / 30.0
"""rad/s"""


def _cycloid(times: Times) -> Trajectory:
    """No drag, constant thrust T and yaw rate w: v = T/(m*w)*(sin wt, 1 - cos wt), and its integral."""
    craft, thrust, w = Craft(), 5.0, CYCLOID_YAW_RATE
    turned = w * times
    speed = thrust / (craft.mass * w)
    return (
        speed / w * (1.0 - np.cos(turned)),
        speed / w * (turned - np.sin(turned)),
        turned,
        speed * np.sin(turned),
        speed * (1.0 - np.cos(turned)),
        np.full_like(times, w),
    )


SCENES: Mapping[str, Scene] = MappingProxyType(
    {
        each.name: each
        for each in (
            Scene(
                "launch",
                "from rest at 5 N, straight ahead, to terminal speed",
                held(60.0, (0.0, 5.0, 0.0, 0.0)),
                exact=_launch,
            ),
            Scene(
                "coast",
                "2 m/s ahead, no thrust, straight: drag alone",
                held(60.0, (0.0, 0.0, 0.0, 0.0)),
                start=State(vx=COAST_SPEED),
                exact=_coast,
            ),
            Scene(
                "cycloid",
                "no drag, constant thrust while the craft spins at 12 deg/s",
                held(60.0, (0.0, 5.0, 0.0, 0.0)),
                parameters={"drag_coefficient": 0.0},
                start=State(yaw_rate=CYCLOID_YAW_RATE),
                exact=_cycloid,
            ),
            Scene(
                "turn",
                "pulses of thrust and of both bow thrusters, at whole seconds",
                held(
                    60.0,
                    (0.0, 10.0, 0.0, 0.0),
                    (10.0, 10.0, 1.0, 0.0),
                    (14.0, 5.0, 0.0, 0.0),
                    (20.0, 5.0, 0.0, 1.0),
                    (23.0, 10.0, 0.0, 0.0),
                    (32.0, 10.0, 0.0, 1.0),
                    (37.0, 10.0, 1.0, 1.0),
                    (39.0, 0.0, 0.0, 0.0),
                    (45.0, 8.0, 1.0, 0.0),
                    (48.0, 8.0, 0.0, 0.0),
                ),
            ),
            Scene(
                "slalom",
                "thrust and bow thrusters that rise and fall all the time, port and starboard in turn",
                (
                    (0.0, 5.0, 0.0, 0.0),
                    (5.0, 7.5, 1.0, 0.0),
                    (10.0, 10.0, 0.0, 0.0),
                    (15.0, 7.5, 0.0, 1.0),
                    (20.0, 5.0, 0.0, 0.0),
                    (25.0, 7.5, 1.0, 0.0),
                    (30.0, 10.0, 0.0, 0.0),
                    (35.0, 7.5, 0.0, 1.0),
                    (40.0, 5.0, 0.0, 0.0),
                    (45.0, 7.5, 1.0, 0.0),
                    (50.0, 10.0, 0.0, 0.0),
                    (55.0, 7.5, 0.0, 1.0),
                    (60.0, 5.0, 0.0, 0.0),
                ),
            ),
            Scene(
                "stop",
                "full thrust, then full reverse through rest, then nothing",
                held(60.0, (0.0, 10.0, 0.0, 0.0), (25.0, -10.0, 0.0, 0.0), (35.0, 0.0, 0.0, 0.0)),
                parameters={"thrust_min": -10.0},
            ),
            Scene(
                "ice",
                "a recorded drive on ice: throttle up, a turn to starboard, one to port, one more, throttle off",
                _control_log("ice.csv"),
                preset="ice",
            ),
            Scene(
                "crosswind",
                "straight ahead at 10 N in a wind from port, with a gust from 20 to 30 s",
                held(
                    60.0,
                    (0.0, 10.0, 0.0, 0.0, 0.0, 0.15),
                    (20.0, 10.0, 0.0, 0.0, 0.0, 0.3),
                    (30.0, 10.0, 0.0, 0.0, 0.0, 0.15),
                ),
            ),
            Scene(
                "drift_to_rest",
                "sliding and spinning to rest on ground that rubs; a push that friction holds, and one it does not",
                held(60.0, (0.0, 0.0, 0.0, 0.0), (40.0, 5.0, 0.0, 0.0), (48.0, 10.0, 0.0, 0.0)),
                preset="ice",
                parameters={"skirt_friction": 0.008},
                start=State(vx=2.0, vy=-1.5, yaw_rate=0.4),
            ),
        )
    }
)


@dataclass(frozen=True)
class Voyage:
    """A course for the hovercraft and its autopilot, which is the one in the autopilot's start values."""

    name: str
    description: str
    craft: Mapping[str, float] = field(default_factory=dict)
    """Start values of the hovercraft that differ from its own: parameters, states, wind."""
    autopilot: Mapping[str, float] = field(default_factory=dict)
    """Start values of the autopilot that differ from its own; what it has in common with the craft it is told."""
    communication_step: float = 0.5
    """s"""
    stop_time: float = 4000.0
    """s: it must have arrived by then"""


def voyage(name: str) -> Voyage:
    """The named voyage. Raises ValueError with the names there are."""
    if name not in VOYAGES:
        raise ValueError(must_be_one_of("voyage", name, VOYAGES))
    return VOYAGES[name]


VOYAGES: Mapping[str, Voyage] = MappingProxyType(
    {
        each.name: each
        for each in (
            Voyage("calm", "the textbook craft in air at rest"),
            Voyage("half_mass", "half the mass", {"mass": 50.0}),
            Voyage("double_mass", "twice the mass", {"mass": 200.0}),
            Voyage("crosswind", "a wind of 0.2 m/s, half the top speed, down the screen", {"wind.y": 0.2}),
            Voyage("ice", "the preset ice at 2 m/s", {"air_density": preset("ice").air_density}, {"cruise_speed": 2.0}),
        )
    }
)
