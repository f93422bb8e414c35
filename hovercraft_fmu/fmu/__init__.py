"""From the model to .fmu files."""
