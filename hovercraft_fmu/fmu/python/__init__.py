"""What travels inside a Python FMU, beside the model: the standard library alone."""
