"""A short way of what `python -m tests.fuzz` does at length."""

from pathlib import Path

from tests import attacks


def test_the_whole_range_of_every_parameter_is_the_same_in_python_and_in_c() -> None:
    """A division by 0, as of skirt_friction = 1e160, was an error of Python's, and none of C's."""
    assert attacks.extremes(4000).startswith("4000 runs: ")


def test_a_forged_chunk_is_named_and_made_anew_or_was_sealed_again() -> None:
    assert attacks.chunks(20).startswith("20 files: ")


def test_the_three_fmus_take_and_refuse_the_same(native_fmu: Path, native3_fmu: Path, fmu: Path) -> None:
    assert attacks.compare([native_fmu, native3_fmu, fmu], 100).startswith("100 sequences")
