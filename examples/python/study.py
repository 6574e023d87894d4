"""Varies planner and speed, on all cores, and prints a table."""

import swerve

STUDY = {
    "name": "planners_and_speeds",
    "base": {"scenario": "person_crossing"},
    "axis": [
        {"key": "planning.planner", "values": ["fot", "aeb"]},
        {"key": "ego.speed_mps", "values": [6, 10, 14]},
    ],
}

study = swerve.study(STUDY)
for cell in study.cells:
    print(*cell["labels"], cell["verdict"], cell["min_distance_m"], sep="\t")
