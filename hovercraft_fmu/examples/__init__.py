"""Scripts to start from: `python -m hovercraft_fmu.examples.cloud`."""
