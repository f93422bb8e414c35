"""What a run costs, counted: the same on every machine, so that two measurements rank alike."""

from ..model.integrators import Integrator

SINE, ROOT = 0.51, 0.28
"""1: a sine with its cosine, and a square root, as parts of a sub-step of Euler's, which works the loads out once.
Fixed; `hovercraft-fmu measure step-costs` measured them: 13.9 and 7.5 of 27.1 ns, each waiting for what it follows."""
REST = 1.0 - SINE - ROOT
"""The additions and multiplications around them."""
OPERATIONS = {"splitting": (1, 2)}
"""Sines with their cosines and roots of a sub-step, where it has not one of each whenever it works the loads out."""


def counted(method: Integrator, substeps: float) -> float:
    """What sub-steps cost, in evaluations of the loads: each has a sine with its cosine, a square root, and the rest.

    Of adaptive those of the steps it refused, too. Terms of a scene count nothing: they cost all methods alike.
    """
    sines, roots = OPERATIONS.get(method.name, (method.stages, method.stages))
    return substeps * (sines * SINE + roots * ROOT + method.stages * REST)
