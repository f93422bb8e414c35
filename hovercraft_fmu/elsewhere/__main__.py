"""python -m hovercraft_fmu.elsewhere HOST FMU: run it, print the rows as JSON."""

import json
import sys
from pathlib import Path

from . import RUN

name, file = sys.argv[1:]
print("\n" + json.dumps(RUN[name](Path(file))))
