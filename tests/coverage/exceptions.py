"""Branches that no test takes, each with its reason: at most 20."""

from tests.coverage.branches import Exempt

NATIVE = "hovercraft_fmu/fmu/native/"
_OLD = "a processor, or a system, without AVX2: the code for it is taken by test_fleet_platforms.py"
_LAST = "the last part of a state is told only where no other is no number, and then all are none: it keeps the index"
_OF_C = (
    Exempt(f"{NATIVE}fleet/fleet.c", "!__get_cpuid(1", "true", _OLD),
    Exempt(f"{NATIVE}fleet/fleet.c", "!(c & system_saves)", "true", _OLD),
    Exempt(f"{NATIVE}fleet/fleet.c", "!(c & avx)", "true", _OLD),
    Exempt(f"{NATIVE}fleet/fleet.c", "(low & registers) == registers", "false", _OLD),
    Exempt(f"{NATIVE}fleet/fleet.c", "__get_cpuid_count(7", "false", _OLD),
    Exempt(f"{NATIVE}fleet/fleet.c", "(b & avx2)", "false", _OLD),
    Exempt(f"{NATIVE}fleet/fleet.c", "k + 1 < FLEET_STATES", "false", _LAST),
    Exempt(f"{NATIVE}hovercraft/hovercraft.c", "n + 1 < STATE_COUNT", "false", _LAST),
    Exempt(f"{NATIVE}hovercraft/hovercraft.c", "settings->integrator == ADAPTIVE", "true",
           "10^8 sub-steps take a minute; the kernel is stopped after a thousand in test_native_kernel.py"),
)  # fmt: skip
_OF_PYTHON = (
    Exempt(
        "hovercraft_fmu/fmu/python/wrapper.py",
        "if type(slave) is cls:",
        "to for slave in list(ALIVE):",
        "slaves of another class: this host imports an FMU's module once, so its instances share one",
    ),
)
EXCEPTIONS: tuple[Exempt, ...] = (*_OF_C, *_OF_PYTHON)
