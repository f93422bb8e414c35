"""The version, and the date that goes with it: the FMU carries both, so that two builds give the same bytes."""

__version__ = "0.1.0"
RELEASE_DATE = "2026-11-22T00:00:00Z"
