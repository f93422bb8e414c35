"""python -m hovercraft_fmu.fmu: compile what of the C was changed since, with the compiler of this environment."""

import sys

from .machine_code import compile_all

sys.exit(compile_all() or 0)
