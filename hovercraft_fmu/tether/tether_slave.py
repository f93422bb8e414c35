"""The tether as a PythonFMU slave: it samples its inputs at the start of a communication step."""

from typing import Any

from ..fmu.python.life_cycle import Slave, refuse_non_finite
from ..fmu.variable import Variable
from ..model.dynamics import State
from .line import Line, Pull, check_line, pull
from .tether_interface import INPUTS, OUTPUTS, PARAMETERS, TETHER_MODEL

REFERENCE = {name: variable.reference for name, variable in TETHER_MODEL.by_name.items()}
MOTION = tuple(REFERENCE[name] for name in INPUTS)
SHOWN = tuple(REFERENCE[name] for name in OUTPUTS)
OF_LINE = tuple(REFERENCE[name] for name in PARAMETERS)
STATE_COUNT = len(State._fields)


class TetherSlave(Slave):
    """The tether behind the FMI functions of pythonfmu's wrapper."""

    model = TETHER_MODEL

    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
        self._pull = Pull()  # of what was sampled last: read until the next step

    def _check_value(self, variable: Variable, value: float) -> None:
        if variable.name in PARAMETERS:
            check_line(variable.name, value)

    def _take_up_start_values(self) -> None:
        self._sample()
        self._tuned, self._stale = False, True

    def _advance(self, _time: float, _step_size: float) -> None:
        self._sample()
        self._tuned = False

    def _sample(self) -> None:
        motion = [self._given[reference] for reference in MOTION]
        line = Line(*(self._given[reference] for reference in OF_LINE))
        made = pull(State(*motion[:STATE_COUNT]), State(*motion[STATE_COUNT:]), line)
        refuse_non_finite(OUTPUTS, (*made.first, *made.second, made.tension, made.distance))
        self._pull = made

    def _observe(self) -> dict[int, float]:
        made = self._pull
        return dict(zip(SHOWN, (*made.first, *made.second, made.tension, made.distance), strict=True))

    def _own_state(self) -> dict[str, Any]:
        return {"pull": [list(part) if isinstance(part, tuple) else part for part in self._pull]}

    def _set_own_state(self, state: dict[str, Any]) -> None:
        first, second, tension, distance = state["pull"]
        self._pull = Pull(type(self._pull.first)(*first), type(self._pull.second)(*second), tension, distance)
