"""Drives a scenario and looks at what came of it."""

import sys

import numpy as np

import swerve

scenario = sys.argv[1] if len(sys.argv) > 1 else "person_behind_truck"
result = swerve.run(scenario, set={"planning.planner": "rrt_star"}, seed=1)
pose = result.streams["pose"]
print(f"{scenario}: {result.verdict}, digest {result.digest}")
print(f"{len(pose)} poses, {np.min(pose['speed_mps']):.1f} to {np.max(pose['speed_mps']):.1f} m/s")
last = result.streams["planner"][-1]
print(f"the last plan ({last.status.value}) has {len(last.points)} points")
