"""The autopilot: its control law, and the FMU around it."""
