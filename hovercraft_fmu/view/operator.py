"""The operator: held keys become controls, counted in communication steps and not in frames."""

from enum import Enum
from math import floor, inf

from ..model.craft import Craft
from ..model.dynamics import Controls

PRESET, TIME_SCALE = "ice", 10.0
"""The craft, and simulated seconds a second, at which a held key moves it visibly within a second."""
THRUST_RATE = 1.0
"""N/s, while a key is held."""
WIND_RATE = 0.1
"""m/s2, while a key is held."""


class Action(Enum):
    """What a key does while it is held."""

    MORE_THRUST = "more thrust"
    LESS_THRUST = "less thrust"
    PORT_THRUSTER = "turn to starboard"
    STARBOARD_THRUSTER = "turn to port"
    WIND_RIGHT = "wind to the right"
    WIND_LEFT = "wind to the left"
    WIND_DOWN = "wind down the screen"
    WIND_UP = "wind up the screen"


class Ramp:
    """A control that rises and falls at a rate while a key is held."""

    def __init__(self, start: float, rate: float, low: float = -inf, high: float = inf) -> None:
        self.value = min(max(start, low), high)
        self._rate, self._low, self._high = rate, low, high
        self._foot, self._direction, self._steps = self.value, 0, 0

    def hold(self, direction: int, step: float) -> None:
        """One communication step [s] later: +1 rises, -1 falls, 0 stays.

        Steps are counted from where the direction last changed, so n of them come to n*step*rate, rounded once.
        """
        if direction != self._direction:
            self._foot, self._direction, self._steps = self.value, direction, 0
        self._steps += 1
        value = self._foot + direction * (self._steps * step * self._rate)
        self.value = min(max(value, self._low), self._high)


class Operator:
    """Controls over time from the keys that are held; thrust and wind start as in the run, and loads from outside are
    those of its start.
    """

    def __init__(self, start: Controls, craft: Craft, step: float) -> None:
        self.held: set[Action] = set()
        self._step = step
        self._thrust = Ramp(start.thrust, THRUST_RATE, craft.thrust_min, craft.thrust_max)
        self._wind_x, self._wind_y = Ramp(start.wind_x, WIND_RATE), Ramp(start.wind_y, WIND_RATE)
        self._outside = start[5:]

    @property
    def controls(self) -> Controls:
        """Those of the communication step that begins now."""
        port, starboard = (float(each in self.held) for each in (Action.PORT_THRUSTER, Action.STARBOARD_THRUSTER))
        return Controls(self._thrust.value, port, starboard, self._wind_x.value, self._wind_y.value, *self._outside)

    def pass_step(self) -> None:
        """One communication step goes by with the keys held as they are."""
        for ramp, up, down in (
            (self._thrust, Action.MORE_THRUST, Action.LESS_THRUST),
            (self._wind_x, Action.WIND_RIGHT, Action.WIND_LEFT),
            (self._wind_y, Action.WIND_DOWN, Action.WIND_UP),
        ):
            ramp.hold((up in self.held) - (down in self.held), self._step)

    def calm(self) -> None:
        """No wind."""
        self._wind_x, self._wind_y = Ramp(0.0, WIND_RATE), Ramp(0.0, WIND_RATE)


class Pace:
    """How many communication steps are due. Counted from one moment on, so it does not matter how often one asks."""

    def __init__(self, step: float, scale: float, now: float) -> None:
        self._step, self.scale = step, scale
        self.restart(now)

    def restart(self, now: float) -> None:
        """From now [s] on; what was due is dropped."""
        self._moment, self._taken = now, 0

    def rescale(self, scale: float, now: float) -> None:
        """So many simulated seconds a second, from now [s] on."""
        self.scale = scale
        self.restart(now)

    def due(self, now: float) -> int:
        """Steps that are due now [s], and were not taken yet."""
        return floor((now - self._moment) * self.scale / self._step) - self._taken

    def take(self) -> None:
        """One step was taken."""
        self._taken += 1
