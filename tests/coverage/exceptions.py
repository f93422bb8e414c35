"""Branches that no test takes, each with its reason: at most 20."""

from tests.coverage.branches import Exempt

EXCEPTIONS: tuple[Exempt, ...] = ()
