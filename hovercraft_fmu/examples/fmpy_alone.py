"""fmpy and no package of ours: inputs from a table, start values by name. First: hovercraft-fmu build native."""

import fmpy
import numpy as np

# inputs are linear between rows; two rows at one time are a jump
names = ["time", "thrust", "port_thruster", "starboard_thruster", "wind.x", "wind.y"]
wind = (0.0, 0.05)  # m/s, in x and y
rows = [(0, 8, 0, 0, *wind), (10, 8, 0, 0, *wind), (10, 8, 1, 0, *wind), (13, 8, 1, 0, *wind), (13, 8, 0, 0, *wind)]
result = fmpy.simulate_fmu(
    "build/HovercraftNative.fmu",
    input=np.array(rows, dtype=[(name, float) for name in names]),
    start_values={"mass": 120.0, "integrator": 3, "step_size": 0.1},
    output=["pose.x", "pose.y", "pose.heading", "warnings"],
    output_interval=0.1,  # the communication step
    stop_time=60.0,
    debug_logging=True,  # a refused value comes with its message
)
print(f"({result['pose.x'][-1]:.2f}, {result['pose.y'][-1]:.2f}) m, {np.degrees(result['pose.heading'][-1]):.1f} deg")
