"""The files for the FMI cross-check, as fmpy's validation of a vendor's repository takes them."""

from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from fmpy import simulate_fmu
from fmpy.cross_check.validate_vendor_repo import validate_repo
from fmpy.util import read_csv, read_ref_opt_file

from hovercraft_fmu.cli import commands
from hovercraft_fmu.cross_check import PLATFORMS
from hovercraft_fmu.fmu.description import NATIVE
from tests.conftest import FMI_2

pytestmark = [pytest.mark.once, FMI_2]


@pytest.fixture(scope="module")
def repository(complete_native_fmu: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    assert complete_native_fmu.exists()  # or there is no compiler, and the test is skipped
    folder = tmp_path_factory.mktemp("vendor")
    done = CliRunner().invoke(commands, ["cross-check", str(folder)])
    assert done.exit_code == 0, done.output
    assert done.stdout.count("wrote ") == len(PLATFORMS)
    return folder


def test_fmpy_accepts_the_repository(repository: Path) -> None:
    assert validate_repo(str(repository)) == (len(PLATFORMS), 0, [])


def test_the_reference_is_what_the_files_give(repository: Path, complete_native_fmu: Path) -> None:
    """The same bits, from the files alone."""
    (folder,) = repository.glob(f"fmus/2.0/cs/linux64/*/*/{NATIVE.identifier}")
    path = folder / NATIVE.identifier
    assert path.with_suffix(".fmu").read_bytes() == complete_native_fmu.read_bytes()
    options = read_ref_opt_file(f"{path}_ref.opt")
    reference = read_csv(f"{path}_ref.csv")
    result = simulate_fmu(
        f"{path}.fmu",
        input=read_csv(f"{path}_in.csv"),
        start_time=options["StartTime"],
        stop_time=options["StopTime"],
        output_interval=options["StepSize"],
        output=reference.dtype.names[1:],
    )
    assert len(reference) == 601
    for name in reference.dtype.names:
        assert np.array_equal(reference[name], result[name]), name
    assert (folder / "ReadMe.txt").read_text().startswith(NATIVE.identifier)
