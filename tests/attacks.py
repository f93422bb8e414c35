"""Attacks in Python: what `python -m tests.fuzz` has beside libFuzzer's; each returns what it did, in words."""

import hashlib
import io
import math
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import zipfile
from collections import Counter
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import fields
from pathlib import Path
from typing import Any

from hovercraft_fmu.building import build
from hovercraft_fmu.fmu.interface import BY_NAME, VARIABLES
from hovercraft_fmu.fmu.machine_code import c_file
from hovercraft_fmu.host import Fmu, Instance, SimulationError
from hovercraft_fmu.model.craft import Craft
from hovercraft_fmu.model.dynamics import Controls, State
from hovercraft_fmu.model.integrators import INTEGRATORS, StepTooSmallError, Stretch
from hovercraft_fmu.model.subcycling import NonFiniteError, Settings, advance
from hovercraft_fmu.sweeps import load, store, sweep
from tests.native import C_TESTS, Kernel, compile_c

WHOLE_RANGE, MODERATE = 308.0, 2.0
"""Decades on either side of 1."""
FEW = 8
"""Sub-steps of a run."""


def number(dice: random.Random, decades: float) -> float:
    """Of any size: every decade is as likely, and so are the ends."""
    kind = dice.random()
    if kind < 0.1 and decades > MODERATE:
        return dice.choice((0.0, 1.0, 5e-324, 2.2250738585072014e-308, 1e-160, 1e160, 1.7976931348623157e308))
    return dice.uniform(1.0, 10.0) * math.pow(10.0, dice.uniform(-decades, decades - 1.0))


def _signed(dice: random.Random, decades: float) -> float:
    return math.copysign(number(dice, decades), dice.choice((1.0, -1.0)))


def craft(dice: random.Random, decades: float) -> Craft:
    """One that can be; about half of its parameters are usual ones."""
    while True:
        values: dict[str, Any] = {}
        for field in fields(Craft):
            if dice.random() < 0.5:
                continue
            values[field.name] = _signed(dice, decades) if field.name.startswith(("drag_center", "thrust")) else (
                number(dice, decades)
            )  # fmt: skip
        values |= {"drag_area": dice.choice((1, 2)), "rotational_drag": dice.choice((0.0, 0.5, 1.0))}
        try:
            return Craft(**values)
        except ValueError:
            continue


def cases(runs: int, seed: int = 1) -> Iterator[tuple[State, Controls, Craft, float, Settings]]:
    """Start, controls, craft, communication step [s], settings; the adaptive method over fewer decades, or it goes on
    and on.
    """
    dice = random.Random(seed)
    for _ in range(runs):
        method = dice.choice(INTEGRATORS)
        decades = WHOLE_RANGE if method.integrate else MODERATE
        of_state = dice.choice((2.0, decades))
        step = number(dice, dice.choice((3.0, decades))) if method.integrate else 1e-6
        start = State(*(_signed(dice, of_state) * (dice.random() < 0.7) for _ in State._fields))
        held = Controls(*(_signed(dice, decades) * (dice.random() < 0.5) for _ in Controls._fields))
        step_size = step if step > 0.0 else 0.01
        settings = Settings(step_size, method, 10.0 ** dice.uniform(-3.0, 3.0))
        communication_step = min(step_size * dice.choice((1, 1, 2, FEW, 2.5)), 1.7976931348623157e308)
        yield start, held, craft(dice, decades), communication_step, settings


def extremes(runs: int) -> str:
    """Python's kernel against C, with one libm, over the whole range of every parameter: the same, to the bit."""
    ended: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as place:
        rounding = C_TESTS / "rounding_of.c"
        library = compile_c(
            Path(place) / "kernel.so", [c_file("kernel.c"), rounding], "-DHOVERCRAFT_LIBM", "-shared", "-fPIC", "-lm"
        )
        kernel = Kernel(library)
        for case in cases(runs):
            outcome, made = kernel.advance(case[0], case[1], case[2], case[3], case[4])
            expected, stretch = of_python(*case)
            assert outcome == expected, (outcome, expected, case)
            assert stretch is None or repr(made) == repr(stretch), (made, stretch, case)
            ended[outcome] += 1
    return f"{runs} runs: {', '.join(f'{count} {outcome}' for outcome, count in ended.most_common())}"


def of_python(state: State, held: Controls, made_of: Craft, step: float, how: Settings) -> tuple[str, Stretch | None]:
    """What came of it, in the kernel's words."""
    try:
        return "advanced", advance(state, held, made_of, step, how)
    except NonFiniteError:
        return "not finite", None
    except StepTooSmallError:
        return "step too small", None
    except ValueError:
        return "too many sub-steps", None


# ---- one sequence of calls, three FMUs


READ = [variable.name for variable in VARIABLES if variable.kind == "Real"]
SET = [
    variable.name
    for variable in VARIABLES
    if variable.causality in ("input", "parameter") and variable.start is not None
]


def standards(runs: int, seed: int = 1) -> str:
    """See `compare`."""
    with tempfile.TemporaryDirectory() as place:
        return compare(
            [build(kind, Path(place) / f"{kind}.fmu") for kind in ("native", "native3", "python")], runs, seed
        )


def compare(fmus: list[Path], runs: int, seed: int = 1) -> str:
    """Sequences of calls on FMI 2.0, FMI 3.0 and the Python FMU: taken by all or refused by all; what is read is the
    same, of the two native ones to the bit, of the Python one as near as its sine.
    """
    dice, done = random.Random(seed), Counter[str]()
    with ExitStack() as stack:
        crafts = [stack.enter_context(stack.enter_context(Fmu(path)).instance()) for path in fmus]
        for _ in range(runs):
            for craft_ in crafts:
                craft_.reset()
            time_, started = 0.0, False
            for _ in range(dice.randrange(3, 12)):
                kind = dice.choice(("set", "set", "step", "step", "read")) if started else dice.choice(("set", "start"))
                step = dice.choice((0.1, 0.05, 0.013, 1e-9, -1.0, 0.0, math.inf))
                name, value = dice.choice(SET), dice.choice((number(dice, 2.0), _signed(dice, 300.0), math.nan))
                value = value if BY_NAME[name].kind == "Real" else dice.randrange(-1, 7)
                answers = [_call(each, kind, name, value, time_, step) for each in crafts]
                taken = {isinstance(each, list) for each in answers}
                assert len(taken) == 1, (kind, name, value, time_, step, answers)
                done[f"{kind} {'taken' if taken == {True} else 'refused'}"] += 1
                if taken == {False}:
                    break
                assert repr(answers[0]) == repr(answers[1]), (kind, name, value, answers)
                assert _near(answers[0], answers[2]), (kind, name, value, answers)
                time_, started = time_ + step * (kind == "step"), started or kind == "start"
    return f"{runs} sequences, {sum(done.values())} calls on each: " + ", ".join(
        f"{n} {what}" for what, n in done.items()
    )


def _near(found: Any, wanted: Any) -> bool:
    return all(abs(a - b) <= 1e-9 * max(1.0, abs(a)) or repr(a) == repr(b) for a, b in zip(found, wanted, strict=True))


def _call(on: Instance, kind: str, name: str, value: float, point: float, step: float) -> "list[float] | str":
    """What is read then, or why it was refused."""
    try:
        if kind == "set":
            on.set({name: value})
        elif kind == "start":
            on.enter_initialization()
            on.exit_initialization()
        elif kind == "step":
            on.step(point, step)
        return on.port(*READ).get() if kind in ("step", "read") else []
    except (SimulationError, ValueError, OverflowError) as error:
        return str(error)


# ---- the command


COMMANDS = {
    "simulate": ("simulate", "--scene", "turn", "--stop-time", "500", "--output", "a.csv"),
    "simulate --fmu python": (
        "simulate",
        "--fmu",
        "python",
        "--scene",
        "turn",
        "--stop-time",
        "500",
        "--output",
        "a.csv",
    ),
    "a long step": ("simulate", "--communication-step", "60", "--set", "step_size=1e-7"),
    "drive": ("drive", "--record", "log.csv"),
    "demo": ("demo",),
    "demo --loop": ("demo", "--loop"),
    "sweep": ("sweep", "turning_circle", "--workers", "2"),
    "measure": ("measure", "coupling", "--quick"),
    "advise": ("advise", "--scene", "slalom", "--within", "1e-7"),
    "build": ("build",),
    "validate": ("validate",),
    "cross-check": ("cross-check", "there"),
}


def signals(runs: int, seed: int = 1) -> str:
    """Every command stopped at random moments, in two ways: stopped, its status, in two seconds, nothing left."""
    dice, ended = random.Random(seed), Counter[str]()
    with tempfile.TemporaryDirectory() as place:
        folder, temporary = Path(place) / "work", Path(place) / "temporary"
        build("native", folder / "build" / "HovercraftNative.fmu")
        temporary.mkdir()
        env = {**os.environ, "TMPDIR": str(temporary), "SDL_VIDEODRIVER": "dummy"}
        for run in range(runs):
            name, by = list(COMMANDS)[run % len(COMMANDS)], dice.choice((signal.SIGINT, signal.SIGTERM))
            for path in ("a.csv", "log.csv", "build/sweep"):
                shutil.rmtree(folder / path, ignore_errors=True)
            process = subprocess.Popen(
                [sys.executable, "-m", "hovercraft_fmu", *COMMANDS[name]], cwd=folder, env=env, text=True,
                stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, start_new_session=True,
                preexec_fn=lambda: signal.signal(signal.SIGINT, signal.default_int_handler),
            )  # fmt: skip
            time.sleep(dice.uniform(0.2, 4.0))
            begun = time.monotonic()
            process.send_signal(by)
            said = process.communicate(timeout=60)[1].strip()
            took = time.monotonic() - begun
            stopped = (process.returncode, said) == (128 + by, "hovercraft-fmu: stopped")
            assert stopped or process.returncode == 0, (name, by, process.returncode, said)
            left = [*temporary.iterdir(), *(each for each in folder.rglob(".*") if each.name != ".lock")]
            assert (took < 2.0, left) == (True, []), (name, by, took, left)
            ended["stopped" if stopped else "at the end already"] += 1
    return f"{runs} runs of {len(COMMANDS)} commands: {', '.join(f'{count} {how}' for how, count in ended.items())}"


# ---- files


def files(runs: int, seed: int = 1) -> str:
    """Files with bytes flipped, cut out, put in, at random places: taken or one line, no traceback, no crash."""
    dice, ended = random.Random(seed), Counter[str]()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        kinds = _good(folder)
        for run in range(runs):
            name, arguments = list(kinds.items())[run % len(kinds)]
            good = (folder / name).read_bytes()
            (folder / f"bad{Path(name).suffix}").write_bytes(_spoiled(dice, good))
            code = "from hovercraft_fmu.cli import main; main()"
            done = subprocess.run([sys.executable, "-W", "error", "-c", code, *arguments], cwd=folder, text=True,
                                  capture_output=True, timeout=120, check=False)  # fmt: skip
            lines = done.stderr.strip().splitlines()
            assert done.returncode in (0, 1, 2), (name, done.returncode, done.stderr)
            assert all(line.startswith("hovercraft-fmu: ") for line in lines), (name, run, done.stderr)
            ended[f"{Path(name).suffix} {'refused' if done.returncode else 'taken'}"] += 1
    return f"{runs} files: {', '.join(f'{count} {what}' for what, count in sorted(ended.items()))}"


STUDY = 'scene = "turn"\nstop_time = 1.0\nset.step_size = 0.1\nkeep.end = ["speed"]\nsweep.mass = [60, 100]\n'


def _good(folder: Path) -> dict[str, tuple[str, ...]]:
    """File -> the command that reads its spoiled copy, bad.*"""
    build("native", folder / "good.fmu")
    build("native_loop", folder / "good.ssp")
    (folder / "good.toml").write_text(STUDY)
    (folder / "good.csv").write_text("time,thrust,port_thruster\n0,5,0\n0.5,8,1\n0.5,2,1\n1.0,2,0\n")
    return {
        "good.fmu": ("simulate", "bad.fmu", "--stop-time", "0.1"),
        "good.ssp": ("validate", "bad.ssp"),
        "good.toml": ("sweep", "bad.toml", "--engine", "batch", "--workers", "1", "--output", "swept"),
        "good.csv": ("simulate", "good.fmu", "--input", "bad.csv", "--set", "step_size=0.1"),
    }


def _spoiled(dice: random.Random, content: bytes) -> bytes:
    if zipfile.is_zipfile(io.BytesIO(content)) and dice.random() < 0.7:  # what is packed, or the archive itself
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            parts = {each: archive.read(each) for each in archive.namelist()}
        chosen = dice.choice([each for each in parts if each.endswith((".xml", ".ssd", ".ssv")) or "/" not in each])
        parts[chosen] = _mangled(dice, parts[chosen])
        into = io.BytesIO()
        with zipfile.ZipFile(into, "w") as archive:
            for each, part in parts.items():
                archive.writestr(each, part)
        return into.getvalue()
    return _mangled(dice, content)


def _mangled(dice: random.Random, content: bytes) -> bytes:
    spoiled = bytearray(content)
    for _ in range(dice.randrange(1, 4)):
        at = dice.randrange(len(spoiled) or 1)
        how = dice.randrange(4)
        if how == 0:
            spoiled[at : at + 1] = bytes([dice.randrange(256)])
        elif how == 1:
            del spoiled[at : at + dice.choice((1, 10, len(spoiled)))]
        elif how == 2:
            spoiled[at:at] = dice.choice((b"nan", b"1e999", b"-", b"\0", b"\xff\xfe", b"[" * 300, b'"', b"\n", b"../"))
        else:
            spoiled[at:at] = spoiled[at : at + 40]
    return bytes(spoiled)


def chunks(runs: int, seed: int = 1) -> str:
    """The files of a sweep spoiled at random places, half of them with the right checksum again: named, set aside and
    made anew, so that the sweep is what it was; only what was sealed again may be taken for one.
    """
    dice, ended = random.Random(seed), Counter[str]()
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        sweep(CHUNKED, engine="batch", workers=1, output=folder)
        paths = sorted(folder.glob("*/*.parquet"))
        good, whole = {path: path.read_bytes() for path in paths}, load(folder).to_table()
        for _ in range(runs):
            path, sealed = dice.choice(paths), dice.random() < 0.5
            bad = _mangled(dice, good[path])
            bad = _sealed(bad) if sealed else bad
            if bad == good[path]:
                continue
            path.write_bytes(bad)
            taken, said = False, ""
            try:
                taken = not sweep(CHUNKED, engine="batch", workers=1, output=folder).spoiled
                there = load(folder).to_table()
                assert taken or there == whole
            except (OSError, ValueError) as error:
                taken, said = False, str(error)
            # as another sweep's, or as a file that is none; what was sealed again pyarrow may not understand
            assert sealed or not said or said.startswith(str(folder)), said
            assert sealed or not taken, path
            ended["taken" if taken else "set aside"] += 1
            for each, content in good.items():
                each.write_bytes(content)
    return f"{runs} files: {', '.join(f'{count} {how}' for how, count in ended.items())}"


def _sealed(content: bytes) -> bytes:
    """With the checksum of what it is now, where it still has one."""
    for seal in set(store.SEAL.findall(content)):
        content = content.replace(seal, store.BLANK)
        content = content.replace(store.BLANK, hashlib.sha256(content).hexdigest().encode())
    return content


CHUNKED: dict[str, Any] = {
    "scene": "turn",
    "stop_time": 1.0,
    "set": {"step_size": 0.1},
    "keep": {"end": ["speed"], "trajectory": {"every": 0.5, "of": ["speed"]}},
    "sweep": {"mass": [60.0, 100.0]},
}


ATTACKS = {
    "extremes": (extremes, 20_000),
    "standards": (standards, 3_000),
    "signals": (signals, 120),
    "files": (files, 300),
    "chunks": (chunks, 300),
}
"""Name -> the attack, and how often by default."""
