"""python -m hovercraft_fmu.libraries: compile what of the C was changed since, with the compiler of this environment.

All that is compiled: the native FMUs, a line for each model; and many craft at once. The build hook needs it, so it
wants the standard library alone.
"""

import sys
from collections.abc import Iterable

from .autopilot.pilot_native import AUTOPILOT_NATIVE, AUTOPILOT_NATIVE3
from .fmu.description import NATIVE, NATIVE3
from .fmu.machine_code import Library, compile_all, fleet_library, library
from .tether.tether_native import TETHER_NATIVE, TETHER_NATIVE3

NATIVE_FLAVOURS = (NATIVE, NATIVE3, AUTOPILOT_NATIVE, AUTOPILOT_NATIVE3, TETHER_NATIVE, TETHER_NATIVE3)


def libraries() -> list[Library]:
    """All of them, made for this package as it is now."""
    return [*(library(flavour) for flavour in NATIVE_FLAVOURS), fleet_library()]


def compile_libraries(platforms: Iterable[str] | None = None) -> str:
    """Compile all of them that are not yet. Returns why that failed; '' where it did not."""
    return compile_all(libraries(), platforms)


if __name__ == "__main__":
    sys.exit(compile_libraries() or 0)
