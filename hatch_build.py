"""Hooks of the build: machine code of the native FMUs, compiled when a wheel is made; the README of a package index."""

import os
import re
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface
from hatchling.metadata.plugin.interface import MetadataHookInterface
from packaging.tags import sys_tags

HAVE_COMPILER = {
    "macosx_13_0_arm64",
    "macosx_13_0_x86_64",
    *(f"manylinux_2_12_{machine}" for machine in ("i686", "x86_64")),
    *(f"manylinux_2_17_{machine}" for machine in ("aarch64", "armv7l", "ppc64le", "s390x")),
    "manylinux_2_31_riscv64",
    *(f"musllinux_1_1_{machine}" for machine in ("aarch64", "armv7l", "i686", "ppc64le", "riscv64", "s390x", "x86_64")),
    *("win32", "win_amd64", "win_arm64"),
}
"""Platforms for which the compiler's package has a wheel."""


class MachineCodeHook(BuildHookInterface):  # type: ignore[type-arg, misc, unused-ignore]  # there may be no hatchling
    """Where the compiler is left out or fails the install succeeds, and the package says what is missing."""

    PLUGIN_NAME = "custom"

    def dependencies(self) -> list[str]:
        """The compiler, where it can be had and is needed."""
        code, all_of_it = (_module(self.root, name) for name in ("fmu.machine_code", "libraries"))
        if os.environ.get(code.LEAVE_OUT) or not any(each.missing for each in all_of_it.libraries()):
            return []
        return ["==".join(code.COMPILER)] if any(tag.platform in HAVE_COMPILER for tag in sys_tags()) else []

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:  # noqa: ARG002 - hatchling's
        """Compile."""
        if reason := _module(self.root, "libraries").compile_libraries():
            self.app.display_warning(f"no machine code of the native FMUs: {reason}")


def _module(root: str, name: str) -> Any:
    """A module of the package that needs nothing which is not installed yet."""
    sys.path.insert(0, root)
    return import_module(f"hovercraft_fmu.{name}")


class ReadmeHook(MetadataHookInterface):  # type: ignore[misc, unused-ignore]
    """The README as a package index shows it, where no file stands beside it: without pictures and links to files."""

    PLUGIN_NAME = "custom"

    def update(self, metadata: dict[str, Any]) -> None:
        """Put it in."""
        text = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        text = re.sub(r"^!\[[^\]]*\]\((?!https:)[^)]*\)\n+", "", text, flags=re.MULTILINE)
        text = re.sub(r"\[([^\]]*)\]\((?!https:|#)[^)]*\)", r"\1", text)
        metadata["readme"] = {"content-type": "text/markdown", "text": text}
