"""python -m tests.fuzz ATTACK [N]: calls, valgrind, extremes, standards, signals, files, chunks.

calls: any sequence of FMI calls on sanitized native FMUs, by hostile hosts too, N seconds (600) each; valgrind: the
same of random bytes, N sequences (400) each; the others are in attacks.py, N times.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from random import Random
from time import perf_counter

from hovercraft_fmu.fmu.description import NATIVE, Flavour
from hovercraft_fmu.libraries import NATIVE_FLAVOURS
from tests import attacks
from tests.native import C_INCLUDES, C_TESTS, written_sources

SANITIZE = ("-g", "-fsanitize=fuzzer,address,undefined,float-cast-overflow", "-fno-sanitize-recover=all")
SHORT, LONG = ("-O0", *SANITIZE), ("-O1", *SANITIZE)
"""To optimize takes five times as long as to compile, and makes a run three times as fast."""
DEMANDS_ALONE = ("-O1", "-fsanitize=fuzzer")
"""For what fuzz.c itself demands: three times as fast again."""
WITH_A_MAIN = ("-O1", "-gdwarf-4", "-DALONE")
DEFAULT = 600
"""s"""
SEQUENCES = 400
SEEDS, SEED_SIZE = 50, 1000
"""Random bytes: of a thousand are some hundred calls."""
BLOCK, BLOCK_TO_WRITE = "static const struct variant VARIANT", "__attribute__((weak)) struct variant VARIANT"
"""What a library says of itself: here the fuzzer writes into it, as whoever has the file can."""


def missing() -> str:
    """Why it cannot run here; '' where it can."""
    return "" if shutil.which("clang") and sys.platform == "linux" else "no clang: apt-get install clang"


def folder_of(flavour: Flavour) -> str:
    """The model's."""
    assert flavour.native
    return flavour.native.folder


def compiled(folder: Path, flavour: Flavour = NATIVE, options: tuple[str, ...] = SHORT) -> Path:
    """The program, of the sources in that folder."""
    header, program = folder / "variables.h", folder / "fuzz"
    text = header.read_text(encoding="utf-8")
    assert text.count(BLOCK) == 1
    header.write_text(text.replace(BLOCK, BLOCK_TO_WRITE), encoding="utf-8")
    command = ["clang", "-std=c11", "-Wall", "-Wextra", "-ffp-contract=off", *options, f"-DFMI={flavour.fmi}",
               f'-DFUZZED="fuzz_{folder_of(flavour)}.h"',
               f"-DFMI{flavour.fmi}_OVERRIDE_FUNCTION_PREFIX", "-I", str(folder), *C_INCLUDES, "-Wl,--wrap=calloc",
               str(folder / flavour.unit), str(C_TESTS / "fuzz.c"), "-lm", "-o", str(program)]  # fmt: skip
    built = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (built.returncode, built.stderr) == (0, ""), built.stderr
    return program


def fuzz(program: Path, limit: str, **env: str) -> str:
    """Run up to a limit of libFuzzer's; its report. Raises AssertionError with it where there is a finding."""
    options = ["-max_len=4000", "-timeout=30", "-seed=1", "-print_final_stats=1", "-verbosity=0"]
    command = [str(program), limit, *options, str(seeds(program.parent))]
    done = subprocess.run(
        command, cwd=program.parent, env={**os.environ, **env}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-20000:]
    return done.stderr


def seeds(folder: Path) -> Path:
    """What it begins with, in `folder`: left alone it begins with a byte, and long has nothing past its start."""
    made, random = folder / "seeds", Random(1)
    made.mkdir(exist_ok=True)
    for number in range(SEEDS):
        (made / str(number)).write_bytes(random.randbytes(SEED_SIZE))
    return made


def calls(seconds: int) -> str:
    """Of both standards and every model. Raises AssertionError, as `fuzz` does."""
    if missing():
        sys.exit(missing())
    sequences = 0
    for each in NATIVE_FLAVOURS:
        with tempfile.TemporaryDirectory() as place:
            program = compiled(written_sources(Path(place), each), each, LONG)
            report = fuzz(program, f"-max_total_time={seconds}")
            sequences += int(report.split("number_of_executed_units: ")[1].split()[0])
    return f"{sequences:,} sequences on {len(NATIVE_FLAVOURS)} FMUs: nothing"


def valgrind(sequences: int) -> str:
    """Random sequences: nothing is read before it is written, which no sanitizer of `calls` sees; nothing is left."""
    for name in ("clang", "valgrind"):
        if not shutil.which(name):
            sys.exit(f"no {name}: apt-get install {name}")
    for each in NATIVE_FLAVOURS:
        with tempfile.TemporaryDirectory() as place:
            program = compiled(written_sources(Path(place), each), each, WITH_A_MAIN)
            command = ["valgrind", "-q", "--error-exitcode=9", "--leak-check=full", "--errors-for-leak-kinds=all",
                       str(program), str(sequences)]  # fmt: skip
            done = subprocess.run(command, capture_output=True, text=True, check=False)
            assert (done.returncode, done.stderr) == (0, ""), done.stderr[-20000:]
    return f"{sequences} sequences on each of {len(NATIVE_FLAVOURS)} FMUs: nothing"


if __name__ == "__main__":
    table = {"calls": (calls, DEFAULT), "valgrind": (valgrind, SEQUENCES), **attacks.ATTACKS}
    name = sys.argv[1] if len(sys.argv) > 1 else ""
    if name not in table:
        sys.exit(f"attack = {name!r}: must be one of {', '.join(table)}")
    attack, usual = table[name]
    begun = perf_counter()
    print(
        f"{name}: {attack(int(sys.argv[2]) if len(sys.argv) > 2 else usual)}; {(perf_counter() - begun) / 60:.1f} min"
    )
