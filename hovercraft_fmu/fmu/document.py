"""The page that ships inside the FMU, from its template and the table of variables."""

from pathlib import Path

import jinja2

from .._version import __version__
from ..model.craft import PRESETS
from ..model.integrators import INTEGRATORS
from .description import DESCRIPTION
from .interface import VARIABLES, WARNINGS, Variable


def index_html() -> str:
    """The whole page."""
    folder = Path(__file__).parent / "documentation"
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(folder), autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True
    )
    checked = (folder / "checked.md").read_text(encoding="utf-8").splitlines()
    return environment.get_template("index.html.jinja").render(
        checked=[line.strip("| ").split(" | ") for line in checked if not line.startswith("| ---")],
        warnings=WARNINGS,
        version=__version__,
        description=DESCRIPTION,
        variables=VARIABLES,
        limits=_limits,
        integrators=INTEGRATORS,
        presets=PRESETS,
    )


def _limits(variable: Variable) -> str:
    """'0 ... 1', 'from 0', or nothing."""
    low, high = variable.minimum, variable.maximum
    if low is not None and high is not None:
        return f"{low:.10g} ... {high:.10g}"
    return "" if low is None else f"from {low:.10g}"
