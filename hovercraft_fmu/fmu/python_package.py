"""Builds the FMU archive; two builds of one tree give the same bytes."""

import hashlib
import io
import os
import sys
import tempfile
import zipfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from types import ModuleType

import pythonfmu
from pythonfmu.builder import FmuBuilder

from .description import PYTHON, Flavour
from .document import RESULTS, pages
from .icon import icon_png

PACKAGE = Path(__file__).parent.parent
SHARED = (
    "_version.py",
    "model/*.py",
    "fmu/__init__.py",
    "fmu/interface.py",
    "fmu/variable.py",
    "fmu/description.py",
    "fmu/python/__init__.py",
    "fmu/python/life_cycle.py",
    "fmu/python/wrapper.py",
)
"""What of this package goes into every Python FMU, as patterns."""
STATIC = Path(__file__).parent / "documentation"
ENTRY_SCRIPT = '''\
"""The entry of the FMU. Its name carries a digest of the content, so no other module can be taken for it."""

from typing import Any

from {package}.{module} import {slave}


class {model}({slave}):
    """The slave of this very build."""

    build = "{build}"

    # pythonfmu's wrapper needs a class with a method of its own
    def __init__(self, **kwargs: Any) -> None:
        super().__init__(**kwargs)
'''


@dataclass(frozen=True)
class Content:
    """What one Python FMU is made of."""

    flavour: Flavour
    module: str
    """Of its slave, inside this package."""
    slave: str
    """Its class there."""
    travels: tuple[str, ...]
    """What of this package goes into it, beside SHARED."""
    documents: Callable[[], dict[str, bytes]]
    """Files of documentation/, by path."""


def build_fmu(path: str | os.PathLike[str] = f"build/{PYTHON.identifier}.fmu") -> Path:
    """Write the FMU to `path` (its folder is made) and return the path.

    Raises:
        ValueError: the name does not end in .fmu.
        OSError: the file cannot be written; one that stood there before still does.
    """
    return write_python_fmu(path, HOVERCRAFT_CONTENT)


def write_python_fmu(path: str | os.PathLike[str], content: Content) -> Path:
    """Write the Python FMU of that content to `path`. Raises as `build_fmu` does."""
    return write_fmu(path, lambda: _archive(content))


def write_fmu(path: str | os.PathLike[str], make: Callable[[], bytes]) -> Path:
    """Write what `make` makes to `path`. Raises as `build_fmu` does."""
    return write_archive(path, ".fmu", make)


def write_archive(path: str | os.PathLike[str], suffix: str, make: Callable[[], bytes]) -> Path:
    """Write what `make` makes to `path`, which must have that suffix, at once or not at all."""
    path = Path(path)
    if path.suffix != suffix:
        raise ValueError(f"path = {str(path)!r}: must end in {suffix}")
    content = make()
    path.parent.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        unfinished.write_bytes(content)
        unfinished.replace(path)
    finally:
        unfinished.unlink(missing_ok=True)
    return path


def _archive(content: Content) -> bytes:
    sources = {path.relative_to(PACKAGE).as_posix(): path.read_bytes() for path in _traveling(content)}
    documents = {**content.documents(), "licenses/pythonfmu.txt": _pythonfmu_license()}
    icon = icon_png()
    build = digest({**sources, **documents, "model.png": icon, **_pythonfmu_files()})
    name = content.flavour.identifier
    package = f"{name.lower()}_{build[:16]}"
    with tempfile.TemporaryDirectory(prefix="hovercraft_fmu_") as folder:
        work = Path(folder)
        _write(work / package, {"__init__.py": b'"""The model of one FMU."""\n', **sources})
        _write(work / "documentation", documents)
        script = work / f"{package}_fmu.py"
        text = ENTRY_SCRIPT.format(package=package, module=content.module, slave=content.slave, model=name, build=build)
        script.write_text(text, encoding="utf-8", newline="\n")
        with _apart_from_this_process(package):
            fmu = FmuBuilder.build_FMU(
                script,
                dest=work / f"{name}.fmu",
                project_files=[work / package],
                documentation_folder=work / "documentation",
            )
        return _repacked(fmu, package, icon)


def _traveling(content: Content) -> list[Path]:
    return sorted(path for pattern in (*SHARED, *content.travels) for path in PACKAGE.glob(pattern))


def documents(flavour: Flavour) -> dict[str, bytes]:
    """What every flavour has in documentation/, by path."""
    static = {
        path.relative_to(STATIC).as_posix(): path.read_bytes()
        for path in sorted(STATIC.rglob("*"))
        if path.is_file()
        and path.suffix != ".jinja"
        and not (flavour.sources and path.name == "externalDependencies.txt")
    }
    measured = {f"results/{path.name}": path.read_bytes() for path in sorted(RESULTS.glob("*"))}
    return {**static, **measured, **{name: page.encode() for name, page in pages(flavour).items()}}


HOVERCRAFT_CONTENT = Content(
    PYTHON, "fmu.python.slave", "HovercraftSlave", ("fmu/python/slave.py",), lambda: documents(PYTHON)
)


def _pythonfmu_license() -> bytes:
    files = metadata.files("pythonfmu") or []
    return next(file for file in files if file.name.upper().startswith("LICENSE")).read_binary()


def _pythonfmu_files() -> dict[str, bytes]:
    """What the builder puts in from pythonfmu: its modules and its binaries."""
    home = Path(pythonfmu.__file__).parent
    paths = [*home.glob("*.py"), *(path for path in (home / "resources").rglob("*") if path.is_file())]
    return {f"pythonfmu/{path.relative_to(home).as_posix()}": path.read_bytes() for path in paths}


def digest(files: Mapping[str, bytes]) -> str:
    """Hexadecimal, of names and contents."""
    total = hashlib.sha256()
    for name in sorted(files):
        total.update(f"{name}\0{len(files[name])}\0".encode() + files[name])
    return total.hexdigest()[:32]


def _write(folder: Path, files: Mapping[str, bytes]) -> None:
    for name, content in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)


@contextmanager
def _apart_from_this_process(package: str) -> Iterator[None]:
    """The builder imports the slave, and leaves it and a folder in sys.path behind; here nothing stays.

    Where this very FMU has run in this process its modules are loaded, with the copy of pythonfmu that it carries:
    they are put aside while it is built.
    """
    path, aside = list(sys.path), _taken_out(package)
    try:
        yield
    finally:
        sys.path[:] = path
        _taken_out(package)
        sys.modules.update(aside)


def _taken_out(package: str) -> dict[str, ModuleType]:
    names = [name for name in sys.modules if name.startswith(package)]
    return {name: sys.modules.pop(name) for name in names}


def _repacked(fmu: Path, package: str, icon: bytes) -> bytes:
    """The archive with pythonfmu moved, without the times and permissions of the files it was made from."""
    with zipfile.ZipFile(fmu) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    files["model.png"] = icon
    # pythonfmu, too, gets a name of its own: a host may have imported another version of it
    moved = f"resources/{package}/pythonfmu/"
    return zipped({name.replace("resources/pythonfmu/", moved, 1): content for name, content in files.items()})


def zipped(files: Mapping[str, bytes]) -> bytes:
    """An archive of these files, the same whenever and wherever it is made."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name in sorted(files):
            info = zipfile.ZipInfo(name, date_time=(1980, 1, 1, 0, 0, 0))
            info.compress_type = zipfile.ZIP_DEFLATED
            info.create_system = 3  # Unix, wherever it was built
            info.external_attr = 0o644 << 16
            archive.writestr(info, files[name])
    return buffer.getvalue()
