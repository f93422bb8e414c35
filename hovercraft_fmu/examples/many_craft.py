"""A thousand craft at once as numpy arrays: how far the wind of a minute sets each, by its mass."""

import numpy as np

from hovercraft_fmu import Crafts, advance_fleet

rng = np.random.default_rng(1)
crafts = Crafts(mass=np.linspace(50.0, 200.0, 1000))
states = np.zeros((6, 1000))  # rows: x, y, heading, vx, vy, yaw rate
wind = np.zeros(1000)
for _ in range(60):
    wind = 0.9 * wind + rng.normal(0.0, 0.02, 1000)  # m/s, another one for each
    controls = np.zeros((5, 1000))  # rows: thrust, port, starboard, wind x, wind y
    controls[0], controls[4] = 5.0, wind
    fleet = advance_fleet(states, controls, crafts, communication_step=1.0)
    states = fleet.states
light, heavy = states[1, :500].std(), states[1, 500:].std()
print(f"set aside by {light:.2f} m where light, by {heavy:.2f} m where heavy; {len(fleet.refused)} were refused")
