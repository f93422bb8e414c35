"""A line between two craft, as an FMU of its own: the example that co-simulation people know."""
