"""Makes problems.json: small problems of the model predictive controller and their solutions by OSQP.

Written apart from the Rust code: states are absolute and in the map, derivatives are central differences of the
nonlinear step, costs and corridor are rotated into the axes of each knot. What both share is the model (kinematic
bicycle, midpoint rule) and the meaning of weights and bounds.

    pip install numpy scipy osqp && python make.py
"""

import json
import math
import pathlib

import numpy as np
import osqp
import scipy.sparse as sp

DT, WHEELBASE = 0.1, 2.85
WEIGHTS = dict(along=1.0, across=4.0, heading=4.0, speed=1.0, steering=0.1, accel=0.05,
               steering_rate=0.5, jerk=0.001, terminal=2.0, slack=50.0, slack_squared=50.0)
BOUNDS = dict(steering=0.61, steering_rate=0.7, accel_min=-8.0, accel_max=3.0, jerk=30.0, speed=40.0)
STATE = ["x_m", "y_m", "heading_rad", "speed_mps", "steering_rad", "accel_mps2"]


def step(state, rates):
    """One step of the bicycle by the explicit midpoint rule."""
    x, y, heading, v, steering, a = state
    v_mid = v + 0.5 * DT * a
    turn = DT * v_mid * math.tan(steering + 0.5 * DT * rates[0]) / WHEELBASE
    return np.array([x + DT * v_mid * math.cos(heading + 0.5 * turn),
                     y + DT * v_mid * math.sin(heading + 0.5 * turn),
                     heading + turn, v + DT * a + 0.5 * DT**2 * rates[1],
                     steering + DT * rates[0], a + DT * rates[1]])


def jacobians(state, rates, h=1e-6):
    columns = []
    for k in range(8):
        e = np.zeros(8)
        e[k] = h
        columns.append((step(state + e[:6], rates + e[6:]) - step(state - e[:6], rates - e[6:])) / (2 * h))
    both = np.array(columns).T
    return both[:, :6], both[:, 6:]


def axes(heading):
    """Rotation from map axes to along and across, identity on the other states."""
    rotation = np.eye(6)
    c, s = math.cos(heading), math.sin(heading)
    rotation[:2, :2] = [[c, s], [-s, c]]
    return rotation


def solve(case):
    knots = [np.array([k[name] for name in STATE]) for k in case["knots"]]
    start = np.array([case["start"][name] for name in STATE])
    n = len(knots) - 1
    x0, u0, s0, size = 0, 6 * n, 8 * n, 9 * n
    w, bound = WEIGHTS, BOUNDS
    P, q = np.zeros((size, size)), np.zeros(size)
    rows, low, high = [], [], []

    def constrain(entries, lo, hi):
        row = np.zeros(size)
        for place, values in entries:
            row[place:place + len(values)] = values
        rows.append(row), low.append(lo), high.append(hi)

    for k in range(n):
        knot, after = knots[k], knots[k + 1]
        rates = np.array([(after[4] - knot[4]) / DT, (after[5] - knot[5]) / DT])
        A, B = jacobians(knot, rates)
        base = step(knot, rates) - A @ knot - B @ rates
        for i in range(6):
            entries = [(x0 + 6 * k + i, [-1.0]), (u0 + 2 * k, B[i])]
            known = base[i]
            if k == 0:
                known += A[i] @ start
            else:
                entries.append((x0 + 6 * (k - 1), A[i]))
            constrain(entries, -known, -known)
        # Cost of the state after the step, in the axes of its knot.
        wanted = case["knots"][k + 1]
        scale = w["terminal"] if k == n - 1 else 1.0
        W = scale * np.diag([w[name] for name in ["along", "across", "heading", "speed", "steering", "accel"]])
        R = axes(after[2])
        aim = after + np.array([math.cos(after[2]), math.sin(after[2]), 0, 0, 0, 0]) * wanted["wanted_along_m"]
        aim[3], aim[5] = wanted["wanted_speed_mps"], wanted["wanted_accel_mps2"]
        block = slice(x0 + 6 * k, x0 + 6 * k + 6)
        P[block, block] = R.T @ W @ R
        q[block] = -R.T @ W @ R @ aim
        P[u0 + 2 * k, u0 + 2 * k] = w["steering_rate"]
        P[u0 + 2 * k + 1, u0 + 2 * k + 1] = w["jerk"]
        P[s0 + k, s0 + k], q[s0 + k] = w["slack_squared"], w["slack"]
        # Bounds.
        constrain([(u0 + 2 * k, [1.0])], -bound["steering_rate"], bound["steering_rate"])
        constrain([(u0 + 2 * k + 1, [1.0])], -bound["jerk"], bound["jerk"])
        constrain([(x0 + 6 * k + 3, [1.0])], -np.inf, bound["speed"])
        constrain([(x0 + 6 * k + 4, [1.0])], -bound["steering"], bound["steering"])
        constrain([(x0 + 6 * k + 5, [1.0])], bound["accel_min"], bound["accel_max"])
        left = [-math.sin(after[2]), math.cos(after[2])]
        at = left[0] * after[0] + left[1] * after[1]
        constrain([(x0 + 6 * k, left), (s0 + k, [-1.0])], -np.inf, at + wanted["left_m"])
        constrain([(x0 + 6 * k, left), (s0 + k, [1.0])], at - wanted["right_m"], np.inf)
        constrain([(s0 + k, [1.0])], 0.0, np.inf)

    problem = osqp.OSQP()
    problem.setup(sp.csc_matrix(np.triu(P)), q, sp.csc_matrix(np.array(rows)), np.array(low), np.array(high),
                  eps_abs=1e-10, eps_rel=1e-10, max_iter=400_000, polishing=True, verbose=False)
    result = problem.solve(raise_error=False)
    assert result.info.status == "solved", result.info.status
    return {"states": result.x[:6 * n].reshape(n, 6).tolist(), "slack_m": result.x[s0:].tolist()}


def knot(x, y, heading, speed, steering=0.0, **wanted):
    return {"x_m": x, "y_m": y, "heading_rad": heading, "speed_mps": speed, "steering_rad": steering,
            "accel_mps2": 0.0, "wanted_along_m": 0.0, "wanted_speed_mps": speed, "wanted_accel_mps2": 0.0,
            "left_m": 1.2, "right_m": 1.2, **wanted}


def state(x, y, heading, speed, steering=0.0, accel=0.0):
    return dict(zip(STATE, [x, y, heading, speed, steering, accel]))


def arc(n, speed, radius, **wanted):
    """Knots on a left turn."""
    steering = math.atan(WHEELBASE / radius)
    return [knot(radius * math.sin(a), radius * (1 - math.cos(a)), a, speed, steering, **wanted)
            for a in (speed * DT * k / radius for k in range(n + 1))]


CASES = [
    dict(name="a metre beside a straight path", start=state(0.2, 1.0, 0.05, 9.0),
         knots=[knot(1.0 * k, 0.0, 0.0, 10.0) for k in range(9)]),
    dict(name="late on a turn", start=state(-0.5, -0.2, 0.0, 11.0, 0.02, 0.5), knots=arc(10, 12.0, 40.0, wanted_along_m=0.8)),
    dict(name="full brake", start=state(0.0, 0.0, 0.0, 15.0, 0.0, 1.0),
         knots=[knot(1.4 * k, 0.0, 0.0, 15.0 - 0.8 * k, wanted_speed_mps=0.0, wanted_accel_mps2=-8.0) for k in range(9)]),
    dict(name="pushed out of the corridor", start=state(0.0, -0.9, 0.1, 10.0),
         knots=[knot(1.0 * k, 0.0, 0.0, 10.0, right_m=-0.5, left_m=1.5) for k in range(9)]),
]

if __name__ == "__main__":
    for case in CASES:
        case["solution"] = solve(case)
        print(case["name"], max(case["solution"]["slack_m"]))
    out = {"dt_s": DT, "wheelbase_m": WHEELBASE, "weights": WEIGHTS, "bounds": BOUNDS, "cases": CASES}
    pathlib.Path(__file__).with_name("problems.json").write_text(json.dumps(out, indent=1) + "\n")
