"""The physics of the hovercraft. Standard library only: this folder travels inside the FMU."""
