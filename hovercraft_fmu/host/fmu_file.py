"""An FMU file: its description, and what of it an instance needs, extracted."""

import os
import zipfile
from pathlib import Path
from types import TracebackType
from typing import Any

import fmpy

from ..fmu.interface import HOVERCRAFT
from ..fmu.near_names import beside
from ..stopping import Interruptible
from ..whole import check_survived, temporary_folder
from .instance import Instance, Intermediate

VERSIONS = ("2.0", "3.0")
"""Of FMI, that are driven here."""
NOT_NEEDED = ("documentation/", "sources/")
"""By an instance: these folders are not extracted."""
PYTHON_PART = "resources/slavemodule.txt"
"""Of an FMU that pythonfmu's wrapper runs."""


class Fmu:
    """An FMU file for co-simulation, FMI 2.0 or 3.0, extracted until it is closed; it makes instances.

        with Fmu(path) as fmu, fmu.instance() as craft, fmu.instance(exchange=True) as solved:
            craft.start({"mass": 200.0})

    Args:
        path: the file.
        model: the name of the model that it must be of; without it any.
        validate: whether its description must be valid.

    Raises:
        FileNotFoundError: no such file.
        ValueError: see `read_description`; what is in it cannot be extracted.
        OSError: nor can it to the temporary folder.
    """

    def __init__(self, path: str | os.PathLike[str], model: str | None = None, validate: bool = True) -> None:
        self.path = Path(path)
        self.description = read_description(self.path, validate, model)
        self.is_fmi_3: bool = self.description.fmiVersion == "3.0"
        self._folder, self._interruptible = temporary_folder(), Interruptible()
        self.folder = self._folder.name
        """Where it was extracted to."""
        try:
            _extract(self.path, self.folder)
        except BaseException:
            self.close()
            raise

    def instance(self, exchange: bool = False, intermediate: Intermediate | None = None) -> Instance:
        """A new instance, for co-simulation, with inputs inside its steps or without, or for model exchange.

        Raises:
            SimulationError: it is not an FMU for that, or it cannot be loaded or instantiated.
            ValueError: it takes no such inputs inside a step.
        """
        return Instance(self.description, self.folder, exchange, intermediate)

    def close(self) -> None:
        """Delete what was extracted; its instances must be closed."""
        self._interruptible.close()
        self._folder.cleanup()

    def __enter__(self) -> "Fmu":
        return self

    def __exit__(
        self, _type: type[BaseException] | None, _error: BaseException | None, _at: TracebackType | None
    ) -> None:
        self.close()


def _extract(path: Path, folder: str) -> None:
    try:
        fmpy.extract(path, unzipdir=folder, include=lambda name: not name.startswith(NOT_NEEDED))
    except OSError:
        raise
    except Exception as error:  # fmpy and zipfile raise many kinds
        raise ValueError(f"{path}: must be an archive that can be extracted; {error}") from error
    _check_python_part(path, Path(folder))


def _check_python_part(path: Path, folder: Path) -> None:
    """pythonfmu's wrapper does not look whether there is what it needs, and then the process dies."""
    part = folder / PYTHON_PART
    if part.exists():
        check_survived(str(folder))
        module = Path(PYTHON_PART).with_name(f"{part.read_text(encoding='utf-8', errors='replace').strip()}.py")
        if not (folder / module).is_file():
            raise ValueError(f"{path}: must have {module.as_posix()}, which {PYTHON_PART} names")
    elif any(part.name.encode() in binary.read_bytes() for binary in folder.glob("binaries/*/*") if binary.is_file()):
        raise ValueError(f"{path}: must have {PYTHON_PART}, which its binary asks for")


def read_description(path: Path, validate: bool = True, model: str | None = None) -> Any:
    """fmpy's model description.

    Raises:
        FileNotFoundError: no such file.
        ValueError: the file is no FMU for co-simulation, FMI 2.0 or 3.0, its description is not valid, or it is of
            another model than the given one.
    """
    if path.is_dir():
        raise IsADirectoryError(f"{path}: must be an FMU, and is a folder")
    if not path.is_file():
        hint = beside(path) or "; 'hovercraft-fmu build' writes them into build/"
        raise FileNotFoundError(f"{path}: no such FMU{hint}")
    try:
        description = fmpy.read_model_description(path, validate=validate)
    except Exception as error:  # a bad archive, bad XML, a bad description: fmpy raises many kinds
        if is_ssp(path):
            raise ValueError(
                f"{path}: is an SSP file, a loop of FMUs: must be an FMU; a co-simulation master runs the loop, and so "
                "does 'hovercraft-fmu demo --loop'"
            ) from error
        raise ValueError(f"{path}: must be an FMU with a valid model description; {error}") from error
    if description.fmiVersion not in VERSIONS or description.coSimulation is None:
        raise ValueError(f"{path}: must be an FMU for co-simulation, FMI {' or '.join(VERSIONS)}")
    if model and not is_of(description, model):
        raise ValueError(f"{path}: is an FMU of the model {description.modelName!r}: must be of {model!r}")
    return description


def is_ssp(path: Path) -> bool:
    """Whether a file is an SSP file."""
    if not zipfile.is_zipfile(path):
        return False
    with zipfile.ZipFile(path) as archive:
        return "SystemStructure.ssd" in archive.namelist()


def is_of(description: Any, model: str) -> bool:
    """Whether an FMU is of a model: by the name, or, as a variant of the hovercraft has its own, by the variables."""
    names = {variable.name for variable in description.modelVariables}
    return bool(description.modelName == model or (model == HOVERCRAFT.name and HOVERCRAFT.by_name.keys() <= names))
