"""Drive the FMU from the keyboard, in real time, and record what the operator did."""

import itertools
import os
import signal
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from io import FileIO
from math import inf
from pathlib import Path
from time import perf_counter
from types import TracebackType
from typing import Protocol

from ..building import default_fmu
from ..fmu.interface import INPUTS, STATES
from ..fmu.near_names import explains_keywords
from ..fmu.start_values import Value
from ..model.dynamics import Controls, State
from ..scenes import signals
from ..simulation import Run, Stepper, check_effect, plan, stepping
from ..simulation.control_log import ENDED, RECORDED
from ..stopping import SIGNALS
from ..whole import check_writable, write_whole
from .gates import Course, Pose
from .operator import PRESET, TIME_SCALE, Action, Operator, Pace
from .window import Frame, Window, pygame

SLOWEST, FASTEST = 0.1, 1000.0
FRAME_RATE = 60
FLUSHED_EVERY = 1.0
"""s: what a drive that is killed loses."""
LONGEST_LAG = 0.25
"""s: what one frame catches up at most, and computes at most; the rest is dropped, and the drive runs slower."""
SHORTEST_STEP, LONGEST_STEP = 1e-4, 1.0
"""s, of the communication step."""
KEYED = INPUTS[1:3]
"""The thrusters fire while their keys are held, whatever they start with."""
HELD_KEYS: Mapping[int, Action] = {
    pygame.K_UP: Action.MORE_THRUST,
    pygame.K_DOWN: Action.LESS_THRUST,
    pygame.K_RIGHT: Action.PORT_THRUSTER,
    pygame.K_LEFT: Action.STARBOARD_THRUSTER,
    pygame.K_w: Action.MORE_THRUST,
    pygame.K_s: Action.LESS_THRUST,
    pygame.K_d: Action.PORT_THRUSTER,
    pygame.K_a: Action.STARBOARD_THRUSTER,
    pygame.K_l: Action.WIND_RIGHT,
    pygame.K_j: Action.WIND_LEFT,
    pygame.K_k: Action.WIND_DOWN,
    pygame.K_i: Action.WIND_UP,
}
FASTER = (pygame.K_PLUS, pygame.K_EQUALS, pygame.K_KP_PLUS)
SLOWER = (pygame.K_MINUS, pygame.K_KP_MINUS)


class Clock(Protocol):
    """What the window runs by."""

    def now(self) -> float:
        """s, from any moment on."""

    def tick(self) -> None:
        """Wait for the next frame."""


class WallClock:
    """Time as it passes."""

    def __init__(self) -> None:
        self._frames = pygame.time.Clock()

    def now(self) -> float:
        """s."""
        return perf_counter()

    def tick(self) -> None:
        """Wait for the next frame."""
        self._frames.tick(FRAME_RATE)


@explains_keywords
def plan_drive(
    preset: str = PRESET, start_values: Mapping[str, Value] | None = None, communication_step: float | None = None
) -> Run:
    """What a drive needs, checked: preset, start_values and communication_step [s] as of `plan`, over no scene.

    Raises ValueError as `plan` does, and for an impossible craft or step.
    """
    check_effect(start_values or {}, KEYED, "a drive")
    values = {INPUTS[0]: 0.0, **(start_values or {})}  # it starts at rest, and stays so until a key is held
    run = plan(signals([(0.0,)]), preset=preset, start_values=values, communication_step=communication_step)
    step = run.communication_step
    if not SHORTEST_STEP <= step <= LONGEST_STEP:
        raise ValueError(
            f"communication_step = {step!r} s: must be from {SHORTEST_STEP} to {LONGEST_STEP:g} s to drive"
        )
    _ = run.craft  # it is checked when it is made
    return run


@explains_keywords
def drive(
    run: Run | None = None,
    fmu: str | os.PathLike[str] | None = None,
    *,
    record: str | os.PathLike[str] | None = None,
    recorded: Callable[[Path], None] = lambda _: None,
    time_scale: float = TIME_SCALE,
    clock: Clock | None = None,
) -> State:
    """Open a window and drive the FMU until it is closed; return the state that it ended in.

    Args:
        run: see `plan_drive`, which is asked where none is given.
        fmu: the file; without it the native FMU in build/ under the current folder, which is built if it is not there.
        record: where the control log goes, a row a communication point, two where controls change: `simulate` over it,
            with the same craft, settings and communication step, comes to the same bits. After a reset the next one
            goes beside it.
        recorded: called with every log when it is complete, after an error, too.
        time_scale: simulated seconds a second, at the start.
        clock: what the window runs by, if not by the time that passes.

    Raises:
        ValueError, FileNotFoundError, SimulationError: as `simulate` does; the window is closed.
        OSError: no window can be opened, or the log cannot be written.
    """
    if not SLOWEST <= time_scale <= FASTEST:
        raise ValueError(f"time_scale = {time_scale!r}: must be from {SLOWEST:g} to {FASTEST:g}")
    run = run or plan_drive()
    with (
        stepping(run, default_fmu() if fmu is None else fmu) as stepper,
        Flight(stepper, run, Path(record) if record else None, recorded) as flight,
        closing(Window(run.craft, f"hovercraft: {run.method}")) as window,
    ):
        loop = _Loop(flight, window, time_scale, clock or WallClock())
        with _ended_by_signals(loop):
            loop.run()
        if loop.stopped:
            signal.raise_signal(loop.stopped)
        return flight.state


class ControlLog:
    """A CSV file that grows while one drives: controls that hold, so a change is two rows at its time.

    It is written whole lines at a time, once a second, and its last one says how it ended: where that is missing the
    record was cut.
    """

    def __init__(self, path: Path) -> None:
        check_writable(path)
        self.path, self.last = path, -inf
        self._held: Controls | None = None
        self._file: FileIO | None = None
        self._failed = False
        self._lines, self._flushed = [",".join(("time", *INPUTS)), RECORDED], perf_counter()

    def write(self, time: float, controls: Controls) -> None:
        """The controls from this communication point on, with all digits."""
        if self._held not in (None, controls):
            self._add(time, self._held)
        self._add(time, controls)
        self.last, self._held = time, controls
        if perf_counter() - self._flushed > FLUSHED_EVERY:
            self._flush()

    def _add(self, time: float, controls: Controls | None) -> None:
        self._lines.append(",".join(map(repr, (time, *(controls or ())))))

    def _flush(self) -> None:
        """Raises OSError, once: what is there then must not be written over."""
        if self._failed:
            return
        content = "".join(f"{line}\n" for line in self._lines).encode()
        try:
            if self._file is None:  # what stood there stays until there is something
                write_whole(self.path, content)
                self._file, content = FileIO(self.path, "a"), b""
            while content:
                content = content[self._file.write(content) :]
        except OSError as error:
            self._failed = True
            raise OSError(error.errno, f"the record ends here ({error.strerror})", str(self.path)) from error
        self._lines, self._flushed = [], perf_counter()

    def close(self, how: str) -> None:
        """All is on the disk. Raises OSError where that cannot be done."""
        self._lines.append(f"{ENDED}{how}")
        try:
            self._flush()
        finally:
            if self._file:
                self._file.close()


class Flight:
    """An FMU, its operator, and the record of what the operator did."""

    def __init__(self, stepper: Stepper, run: Run, record: Path | None, recorded: Callable[[Path], None]) -> None:
        self._stepper, self._run = stepper, run
        self._record, self._recorded = record, recorded
        self._log: ControlLog | None = None
        self._recorded_once = False
        self._states, self._speed = stepper.port(*STATES), stepper.port("speed")
        self.operator = self._new_operator()
        stepper.start(self.operator.controls)

    def _new_operator(self) -> Operator:
        start = Controls(*(float(self._run.signals[name][0]) for name in INPUTS))
        return Operator(start, self._run.craft, self._run.communication_step)

    @property
    def step_size(self) -> float:
        """s: the communication step."""
        return self._run.communication_step

    @property
    def time(self) -> float:
        """s."""
        return self._stepper.time

    @property
    def state(self) -> State:
        """As the FMU gives it."""
        return State(*self._states.get())

    @property
    def speed(self) -> float:
        """m/s."""
        return self._speed.get()[0]

    @property
    def warnings(self) -> list[str]:
        """What the FMU has said since the start."""
        return self._stepper.messages

    def step(self) -> None:
        """One communication step. Raises SimulationError: the FMU refused it; OSError: the log cannot be written."""
        controls = self.operator.controls
        if self._record:
            if self._log is None:
                self._log = self._new_log(self._record)
            self._log.write(self.time, controls)
        self._stepper.step(controls)
        self.operator.pass_step()

    def _new_log(self, first: Path) -> ControlLog:
        """The first one where it was asked for, the next ones beside it, under names that are free."""
        beside = (first.with_stem(f"{first.stem}-{n}") for n in itertools.count(2))
        path = next(each for each in beside if not each.exists()) if self._recorded_once else first
        self._recorded_once = True
        return ControlLog(path)

    def reset(self) -> None:
        """Back to the start. What was recorded stays; what comes is recorded beside it."""
        self.close("by a reset")
        held = self.operator.held
        self.operator = self._new_operator()
        self.operator.held = held
        self._stepper.restart(self.operator.controls)

    def __enter__(self) -> "Flight":
        return self

    def __exit__(
        self, _type: type[BaseException] | None, error: BaseException | None, _at: TracebackType | None
    ) -> None:
        self.close(" ".join(f"{type(error).__name__}: {error}".split()) if error else "by the operator")

    def close(self, how: str) -> None:
        """The last communication point ends the log: a row without a step."""
        log, self._log = self._log, None
        if log is None:
            return
        if log.last < self.time:  # a step that was refused has its row, at this very time
            log.write(self.time, self.operator.controls)
        state = self.state
        log.close(f"{how}, at ({state.x:.3f}, {state.y:.3f}) m")
        self._recorded(log.path)


class _Loop:
    """The event loop: time passes with the keys as they were, then the keys change, then the frame is drawn.

    In this order the motion depends on when keys change, and not on how many frames were drawn meanwhile.
    """

    def __init__(self, flight: Flight, window: Window, time_scale: float, clock: Clock) -> None:
        self._flight, self._window, self._clock = flight, window, clock
        self._pace = Pace(flight.step_size, time_scale, clock.now())
        self._paused = self._help = self._late = self._ended = False
        self._course: Course | None = None
        self.stopped = 0
        """The signal that ended it."""

    def stop(self, signum: int, _frame: object) -> None:
        """By a signal."""
        self.stopped, self._ended = signum, True

    def run(self) -> None:
        """Until the window is closed."""
        while not self._ended:
            self._catch_up(self._clock.now())
            for event in pygame.event.get():
                self._take(event)
            self._window.draw(self._shown())
            self._clock.tick()

    def _catch_up(self, now: float) -> None:
        if self._paused:
            self._pace.restart(now)
            return
        due, most = self._pace.due(now), int(LONGEST_LAG * self._pace.scale / self._flight.step_size) + 1
        self._late = due > most
        for _ in range(min(due, most)):
            self._flight.step()
            self._pace.take()
            if self._course:
                self._course.go(self._pose, self._flight.time)
            if self._clock.now() - now > LONGEST_LAG:
                self._late = True
                break
        if self._late:
            self._pace.restart(self._clock.now())

    def _take(self, event: "pygame.event.Event") -> None:
        if event.type == pygame.QUIT:
            self._ended = True
        elif event.type == pygame.KEYDOWN:
            self._press(event.key)
        elif event.type == pygame.KEYUP and event.key in HELD_KEYS:
            self._flight.operator.held.discard(HELD_KEYS[event.key])

    def _press(self, key: int) -> None:
        if key in HELD_KEYS:
            self._flight.operator.held.add(HELD_KEYS[key])
        elif key == pygame.K_ESCAPE:
            self._ended = True
        elif key == pygame.K_SPACE:
            self._paused = not self._paused
        elif key == pygame.K_h:
            self._help = not self._help
        elif key == pygame.K_c:
            self._flight.operator.calm()
        elif key == pygame.K_f:
            self._window.follows = not self._window.follows
        elif key == pygame.K_g:
            self._course = None if self._course else Course(self._pose)
        elif key == pygame.K_r:
            self._flight.reset()
            self._window.clear()
            self._course = Course(self._pose) if self._course else None
            self._pace.restart(self._clock.now())
        elif key in FASTER or key in SLOWER:
            scale = self._pace.scale * (2.0 if key in FASTER else 0.5)
            self._pace.rescale(min(max(scale, SLOWEST), FASTEST), self._clock.now())

    @property
    def _pose(self) -> Pose:
        state = self._flight.state
        return state.x, state.y, state.heading

    def _shown(self) -> Frame:
        notes = [f"warning: {each}" for each in self._flight.warnings]
        if self._late:
            notes.append("this machine cannot keep up: the drive runs slower than asked (- halves it)")
        return Frame(
            self._flight.time, self._pose, self._flight.speed, self._flight.operator.controls,
            self._pace.scale, self._paused, self._help, notes, self._course,
        )  # fmt: skip


@contextmanager
def _ended_by_signals(loop: _Loop) -> Iterator[None]:
    """Ctrl-C in the terminal closes the window as its button does, and not in the middle of a step."""
    before = {each: signal.getsignal(each) for each in SIGNALS}
    for each, handler in before.items():
        if handler not in (signal.SIG_IGN, signal.SIG_DFL):
            signal.signal(each, loop.stop)
    try:
        yield
    finally:
        for each, handler in before.items():
            signal.signal(each, handler)
