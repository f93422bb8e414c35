"""The pages that ship inside the FMU, from their templates and the table of variables.

Those of measurements, results.html and sweeps.html with their pictures, are there as `studies/pages.py` wrote them.
"""

import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import jinja2
from markupsafe import Markup, escape

from .._version import __version__
from ..model.craft import DRAG_AREAS, PRESETS
from ..model.integrators import INTEGRATORS
from .description import FMI_3_TYPES, NATIVE, NATIVE3, PYTHON, Flavour
from .interface import ACTUATORS, CRAFT_PARAMETERS, WARNINGS
from .variable import Variable

FOLDER = Path(__file__).parent / "documentation"
LICENSE_FILE = "licenses/license.txt"
CHECKED: Mapping[str, str] = {
    PYTHON.identifier: "checked.md",
    NATIVE.identifier: "checked_native.md",
    NATIVE3.identifier: "checked_native3.md",
}
"""What `hovercraft-fmu validate --table` printed for each FMU."""


def pages(flavour: Flavour = PYTHON, more: Iterable[str] = ()) -> dict[str, str]:
    """Path inside the documentation -> the whole page, for one of the hovercraft's FMUs; beside them are `more`."""
    ordinary = flavour.variant_of or flavour
    values = {
        "native": bool(flavour.parts),
        "more": tuple(more),
        "flavour": flavour,
        "ordinary": ordinary,
        "exchange": bool(flavour.exchange),
        "fmi": flavour.fmi,
        "types": FMI_3_TYPES if flavour.fmi == 3 else {},
        "description": ordinary.model.description,
        "variables": flavour.model.variables,
        "warnings": WARNINGS,
        "integrators": INTEGRATORS,
        "presets": PRESETS,
        "drag_areas": DRAG_AREAS,
        "checked": table_rows(FOLDER / CHECKED[ordinary.identifier]),
        "own": flavour.model.listed(flavour.own_starts),
    }
    return rendered(FOLDER, values)


def licenses(parts: str, file: str, notice: bytes) -> dict[str, bytes]:
    """The package's licence, which names the parts under another one, and that one: path -> content."""
    ours = (FOLDER / LICENSE_FILE).read_bytes()
    return {LICENSE_FILE: ours + f"\n{parts}: see {file}.\n".encode(), f"licenses/{file}": notice}


def documents(flavour: Flavour, more: Mapping[str, bytes] = {}) -> dict[str, bytes]:
    """All of documentation/ but licences, for one of the hovercraft's FMUs: path -> content, with that of `more`."""
    static = {
        path.relative_to(FOLDER).as_posix(): path.read_bytes() for path in sorted(FOLDER.rglob("*")) if _goes(path)
    }
    del static[LICENSE_FILE]
    if flavour.parts:
        del static["externalDependencies.txt"]
    return {**static, **{name: page.encode() for name, page in pages(flavour, more).items()}, **more}


def _goes(path: Path) -> bool:
    """Whether a file goes in as it is: tables of checks are on a page, the style is in each."""
    return path.is_file() and path.suffix not in (".jinja", ".md", ".css")


def rendered(folder: Path, values: Mapping[str, Any]) -> dict[str, str]:
    """Path -> page, of the templates NAME.html.jinja in a folder; they may include those in FOLDER."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader((folder, FOLDER)),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
    )
    environment.globals.update(version=__version__, limits=_limits, grouped=_grouped, math=_math)
    names = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*.html.jinja"))
    return {
        name.removesuffix(".jinja"): _with_contents(environment.get_template(name).render(values)) for name in names
    }


def _with_contents(page: str) -> str:
    """With a list of its sections before the first, each with an anchor."""
    titles = re.findall(r"<h2>(.*?)</h2>", page, re.DOTALL)
    anchors = [re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-") for title in titles]
    for title, anchor in zip(titles, anchors, strict=True):
        page = page.replace(f"<h2>{title}</h2>", f'<h2 id="{anchor}">{title}</h2>', 1)
    links = "".join(f'<li><a href="#{anchor}">{title}</a></li>' for title, anchor in zip(titles, anchors, strict=True))
    return page.replace("<h2 id=", f"<nav><ul>{links}</ul></nav>\n\n<h2 id=", 1)


def _grouped(variables: Iterable[Variable]) -> dict[str, list[Variable]]:
    """As people look for them, and terminals have them: what stands before the dot, commands, the craft, the rest."""
    groups: dict[str, list[Variable]] = {}
    for variable in variables:
        prefix = variable.name.rpartition(".")[0]
        if variable.name in ACTUATORS:
            prefix = "actuators"
        elif prefix.startswith("external"):
            prefix = "load"
        elif variable.name in CRAFT_PARAMETERS:
            prefix = "craft"
        elif not prefix:
            prefix = {"parameter": "settings", "output": "outputs"}.get(variable.causality, "watched")
        groups.setdefault(prefix, []).append(variable)
    return groups


GREEK = {name: f"&{name};" for name in ("psi", "rho", "tau", "kappa", "omega")}
TOKEN = re.compile(r"([A-Za-z]+)(?:_([A-Za-z]+))?(?:\^([0-9]))?|([0-9.]+)|(.)")
"""Of a formula: a name with or without an index and a power, a number, a sign."""
FRACTION = re.compile(r"(.*?)([\w^]+)/([\w^]+)(.*)")


def _math(formula: str) -> Markup:
    """A formula in one line as MathML, which browsers draw: names with indices and powers, signs, a/b, sqrt(...)."""

    def drawn(text: str) -> str:
        if root := re.fullmatch(r"(.*)sqrt\((.*)\)", text):
            return f"{drawn(root[1])}<msqrt>{drawn(root[2])}</msqrt>"
        if fraction := FRACTION.fullmatch(text):
            top, bottom = (f"<mrow>{drawn(each)}</mrow>" for each in fraction.group(2, 3))
            return f"{drawn(fraction[1])}<mfrac>{top}{bottom}</mfrac>{drawn(fraction[4])}"
        found = ""
        for name, index, power, number, sign in TOKEN.findall(text.replace(" ", "")):
            symbol = f"<mi>{GREEK.get(name, name)}</mi>"
            if index:
                symbol = f"<msub>{symbol}<mi>{index}</mi></msub>"
            if name:
                found += f"<msup>{symbol}<mn>{power}</mn></msup>" if power else symbol
            elif number:
                found += f"<mn>{number}</mn>"
            else:
                found += f"<mo>{'&#x2062;' if sign == '*' else escape(sign)}</mo>"
        return found

    return Markup(f'<math display="block">{drawn(formula)}</math>')  # noqa: S704 - formulas of these pages


def table_rows(table: Path) -> list[list[str]]:
    """The rows of a table in Markdown, titles first; none where there is none yet: checking needs a build."""
    lines = table.read_text(encoding="utf-8").splitlines() if table.exists() else []
    return [[cell.strip() for cell in line.strip("| ").split(" | ")] for line in lines if not re.match(r"\| ?--", line)]


def _limits(variable: Variable) -> str:
    """'0 ... 1', 'from 0', or nothing."""
    low, high = variable.minimum, variable.maximum
    if low is not None and high is not None:
        return f"{low:.10g} ... {high:.10g}"
    return "" if low is None else f"from {low:.10g}"
