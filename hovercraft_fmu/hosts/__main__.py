"""python -m hovercraft_fmu.hosts single HOST FMU, or loop MASTER CRAFT AUTOPILOT: run it, print the rows as JSON."""

import json
import sys
from pathlib import Path

from . import RUN
from .loops import LOOPS

kind, name, *files = sys.argv[1:]
print("\n" + json.dumps((RUN if kind == "single" else LOOPS)[name](*map(Path, files))))
