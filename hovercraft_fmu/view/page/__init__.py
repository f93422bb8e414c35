"""The page that carries the FMU: to be driven in a browser, without an install.

One file of HTML: what lies in this folder, and the FMU compiled for browsers, packed, with its description and scenes.
"""

import base64
import json
import math
import re
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..._version import __version__
from ...fmu.block import patched
from ...fmu.description import NATIVE3, Flavour, model_description, xml
from ...fmu.interface import BY_NAME, CRAFT_PARAMETERS, INPUTS, STATES
from ...fmu.machine_code import BROWSER, block_of, identity, library
from ...model.craft import DIRECTIONAL, PRESETS
from ...model.integrators import INTEGRATORS
from ...scenes import SCENES, Scene

FOLDER = Path(__file__).parent
FILE = "play.html"
FIRST = "ice"
"""The craft at the start: the one that moves visibly within seconds."""
TERMS: tuple[tuple[str, str, Mapping[str, float]], ...] = (
    ("wind", "wind", {"wind.y": 0.5}),
    ("friction", "skirt friction", {"skirt_friction": 0.002}),
    ("directional", "directional area", {"drag_area": DIRECTIONAL}),
    ("rotational", "rotational drag", {"rotational_drag": 1.0}),
)
"""What a scene may ask for: name, words, values."""
IMPORT = re.compile(r'^import \{[^}]*\} from "\./(\w+)\.js";\n', re.MULTILINE)


def page(flavour: Flavour = NATIVE3) -> bytes:
    """The page of a native FMU: FMI 3.0 whatever the FMU's own standard is, with its start values.

    Raises:
        NotCompiledError: there is no machine code of the C that is here.
    """
    own = NATIVE3.variant(flavour.identifier, flavour.own_starts) if flavour.variant_of else NATIVE3
    return assembled("index.html", "main", _data(own))


def assembled(name: str, main: str, data: Mapping[str, Any]) -> bytes:
    """A page of this folder as one file: with its style, its main module and those that it needs, and data.

    Raises ValueError: there is a number among the data that is not finite.
    """
    html = (FOLDER / name).read_text(encoding="utf-8")
    style = (FOLDER / "page.css").read_text(encoding="utf-8")
    text = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    for place, content in (
        ('<link rel="stylesheet" href="page.css">', f"<style>\n{style}</style>"),
        (f'<script type="module" src="{main}.js"></script>', f'<script type="module">\n{_script(main)}</script>'),
        ('id="data"></script>', f'id="data">{text}</script>'),
    ):
        before, after = html.split(place)
        html = before + content + after
    return html.encode()


def _script(main: str) -> str:
    """Modules as one: each behind those that it imports."""
    texts: dict[str, str] = {}

    def take(name: str) -> None:
        text = (FOLDER / f"{name}.js").read_text(encoding="utf-8")
        for needed in IMPORT.findall(text):
            if needed not in texts:
                take(needed)
        texts[name] = module_text(text)

    take(main)
    return "\n".join(texts.values())


def module_text(source: str) -> str:
    """What of a module stands in a page's one script."""
    return re.sub(r"^export ", "", IMPORT.sub("", source), flags=re.MULTILINE)


def _data(flavour: Flavour) -> dict[str, Any]:
    """As settings.js says it."""
    build = identity(flavour)
    module = library(NATIVE3).path(BROWSER).read_bytes()
    if flavour.variant_of:
        module = patched(module, block_of(flavour, build), f"{flavour.identifier}.wasm")
    return {
        "version": __version__,
        "fmu": f"{flavour.identifier}.fmu" if flavour.variant_of else "",
        "module": _packed(module),
        "description": _packed(xml(model_description(build, flavour))),
        "presets": {**({"own": {}} if flavour.variant_of else {}), **_presets()},
        "scenes": [_scene(each) for each in SCENES.values()],
        "terms": [
            {"name": name, "label": label, "values": values, "input": any(each in INPUTS for each in values)}
            for name, label, values in TERMS
        ],
        "methods": {
            each.name: {
                "stages": each.stages,
                "stability": each.stability_limit if math.isfinite(each.stability_limit) else None,
                "rotation": each.rotation_limit if math.isfinite(each.rotation_limit) else None,
                "text": each.description,
            }
            for each in INTEGRATORS
        },
    }


def _packed(content: bytes) -> str:
    return base64.b64encode(zlib.compress(content, 9)).decode()


def _presets() -> dict[str, dict[str, float]]:
    """What a preset sets: that in which presets differ; the first one is that of the start."""
    differ = [name for name in CRAFT_PARAMETERS if len({getattr(craft, name) for craft in PRESETS.values()}) > 1]
    names = sorted(PRESETS, key=lambda name: name != FIRST)
    return {name: {each: getattr(PRESETS[name], each) for each in differ} for name in names}


def _scene(scene: Scene) -> dict[str, Any]:
    moved = {name: value for name, value in zip(STATES, scene.start, strict=True) if value != BY_NAME[name].start}
    return {
        "name": scene.name,
        "description": scene.description,
        "preset": scene.preset,
        "values": {**scene.parameters, **moved},
        "inputs": INPUTS[: len(scene.rows[0]) - 1],
        "rows": scene.rows,
    }
