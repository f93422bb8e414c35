"""This package: a function of time as inputs, a table of pandas, a picture, how far off it is, what is cheaper."""

from math import sin

from hovercraft_fmu import advise, simulate

result = simulate(
    lambda time: {"thrust": 6.0 + 2.0 * sin(0.2 * time), "port_thruster": float(20.0 <= time < 22.0)},
    preset="ice",
    start_values={"integrator": "rk4", "step_size": 0.1, "error_estimate": "on"},
    stop_time=120.0,
    communication_step=0.1,
)
print(result)
result.write("build/one_run.csv")
result.plot().savefig("build/one_run.png")
print(result.to_pandas()[["pose.x", "pose.y", "speed"]].tail(2))
print("the cheapest way to a millimetre on a slalom:", advise("slalom", within=1e-3).best.words)
