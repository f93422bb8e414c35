"""Figures of matplotlib, which is loaded when one is asked for, and the files that they go to."""

import importlib
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..whole import written

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PICTURES = {".png": {"Software": None}, ".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
"""What a file of a picture may end in, and what is to be left out of it: the same picture is the same bytes."""


def check_plot(path: str | os.PathLike[str]) -> Path:
    """The path; so that a run need not be made to learn that it cannot be drawn.

    Raises:
        ValueError: the name ends in none of PICTURES.
        ModuleNotFoundError: matplotlib is not installed; says how to install it.
    """
    path = Path(path)
    if path.suffix not in PICTURES:
        raise ValueError(f"plot = {str(path)!r}: must end in .png, .svg or .pdf")
    new_figure()
    return path


def new_figure(**options: Any) -> "Figure":
    """matplotlib's Figure, without a window. Raises ModuleNotFoundError, which says how to install it."""
    try:
        module = importlib.import_module("matplotlib.figure")
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            "pictures need matplotlib, which is not installed: "
            "pip install 'hovercraft-fmu[plot]', in a checkout '.[plot]'"
        ) from error
    figure: Figure = module.Figure(**options)
    return figure


def save(figure: "Figure", path: Path) -> Path:
    """Write a picture, whose folder is made, at once or not at all, and return its path. Raises OSError."""
    with importlib.import_module("matplotlib").rc_context({"svg.hashsalt": "hovercraft"}), written(path) as unfinished:
        figure.savefig(unfinished, format=path.suffix[1:], metadata=PICTURES[path.suffix])
    return path
