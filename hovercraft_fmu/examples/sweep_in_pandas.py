"""A sweep of 200 craft over a scene, and what became of them in pandas."""

from hovercraft_fmu import load, sweep

STUDY = {
    "scene": "turn",
    "set": {"integrator": "rk4", "step_size": 0.1},
    "sweep": {"mass": {"normal": [100.0, 10.0]}, "air_density": {"from": 1.0, "to": 1.3}},
    "sampling": {"method": "latin_hypercube", "runs": 200, "seed": 1},
    "keep": {"end": ["pose.x", "pose.y"], "maximum": ["speed"]},
}

if __name__ == "__main__":  # workers read this file, too
    outcome = sweep(STUDY, engine="batch", workers=1, output="build/sweep/masses", overwrite=True)
    runs = load(outcome.folder).to_table().to_pandas()
    print(runs[["mass", "air_density", "end.pose.x", "maximum.speed"]].describe().round(3))
    print(runs.corr(numeric_only=True).loc[["mass", "air_density"], ["end.pose.x", "maximum.speed"]].round(2))
