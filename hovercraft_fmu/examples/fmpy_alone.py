"""fmpy and no package of ours: inputs from a table, start values by name. First: hovercraft-fmu build native."""

import fmpy
import numpy as np

# inputs are linear between rows, two rows at one time are a jump; a column for each, as fmpy warns of others
names = ["time", "thrust", "port_thruster", "starboard_thruster", "wind.x", "wind.y"]
names += ["external.force.x", "external.force.y", "external.moment"]
inputs = np.zeros(5, dtype=[(name, float) for name in names])
inputs["time"], inputs["port_thruster"] = [0, 10, 10, 13, 13], [0, 0, 1, 1, 0]
inputs["thrust"], inputs["wind.y"] = 8, 0.05
result = fmpy.simulate_fmu(
    "build/HovercraftNative.fmu",
    input=inputs,
    start_values={"mass": 120.0, "integrator": 3, "step_size": 0.1},
    output=["pose.x", "pose.y", "pose.heading", "warnings"],
    output_interval=0.1,  # the communication step
    stop_time=60.0,
    debug_logging=True,  # a refused value comes with its message
)
print(f"({result['pose.x'][-1]:.2f}, {result['pose.y'][-1]:.2f}) m, {np.degrees(result['pose.heading'][-1]):.1f} deg")
