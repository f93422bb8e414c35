"""python -m hovercraft_fmu.hosts HOST FMU: drive the FMU in a host, print the rows as JSON."""

import json
import sys
from pathlib import Path

from . import RUN

print("\n" + json.dumps(RUN[sys.argv[1]](Path(sys.argv[2]))))
