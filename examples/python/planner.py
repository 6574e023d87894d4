"""A planner in Python: along the route, no faster than it can stop before the place where somebody will be on it.

Run by itself it drives, beside the planner of the stack. `swerve run person_crossing -c planner.toml` drives it, too.
"""

from pathlib import Path

import numpy as np

import swerve
from swerve.messages import Plan

BRAKE_MPS2 = 5.0
HORIZON_S, STEP_S = 5.0, 0.1
GAP_M = 6.0


class Planner(swerve.Planner):
    def plan(self, request: swerve.PlanRequest) -> Plan:
        start = request.start
        free_m = max(0.0, self.clear_m(request) - GAP_M)
        speed_mps = min(request.target_speed_mps, (2.0 * BRAKE_MPS2 * free_m) ** 0.5)
        t = np.arange(0.0, HORIZON_S, STEP_S)
        v = np.clip(speed_mps, start.speed_mps - BRAKE_MPS2 * t, start.speed_mps + 1.5 * t).clip(0.0)
        along = np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * STEP_S)])
        # The offset from the route decays over ten metres.
        path = request.route.path(request.along_m + along, request.aside_m * np.exp(-along / 10.0))
        return request.answer(request.points(t, *path, v), work=len(request.predictions))

    def clear_m(self, request: swerve.PlanRequest) -> float:
        """Distance to the nearest predicted place on the route."""
        line = np.stack([request.route.x_m, request.route.y_m])
        half_m = 0.5 * request.shape.width_m + 1.0
        front_m = request.along_m + request.shape.length_m - request.shape.rear_overhang_m
        nearest_m = 200.0
        for place in (place for one in request.predictions for place in one.path):
            off_m = np.hypot(*(line - [[place.pose.x_m], [place.pose.y_m]]))
            ahead_m = float(request.route.s_m[off_m.argmin()]) - front_m
            if off_m.min() < half_m and ahead_m > 0.0:
                nearest_m = min(nearest_m, ahead_m)
        return nearest_m


if __name__ == "__main__":
    for config in [None, Path(__file__).with_name("planner.toml")]:
        result = swerve.run("person_crossing", config, allow_code=True)
        nearest_m = result.metrics["min_distance_m"]
        print(f"{config.name if config else 'of the stack'}: {result.verdict}, {nearest_m:.2f} m, {result.digest}")
