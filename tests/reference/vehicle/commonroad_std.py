"""Writes commonroad_std.json: the single-track drift model of the CommonRoad vehicle models, driven with
open-loop steering and acceleration, as a second opinion on Swerve's car.

    python3 -m venv venv && venv/bin/pip install commonroad-vehicle-models==3.0.2
    venv/bin/python commonroad_std.py

Source of the model: Althoff and Wuersching, "CommonRoad: Vehicle Models", 2020, section 8.

The model gets the numbers of Swerve's default car (crates/swerve-vehicle/src/params.rs), none of them fitted:
mass, yaw inertia, wheelbase, centre of gravity, wheel radius, spin inertia, brake and drive split, steering
limits, and for each tyre curve the same four numbers (slope, shape, curvature, peak = friction of the ground).
Left as published: the weighting functions of combined slip. Set to zero: all offsets of the tyre curves
(conicity, ply steer), because Swerve's tyre is symmetric.
What the model does not have: load transfer between left and right, load sensitivity, relaxation of the tyre,
suspension, drag, rolling resistance. Drag and rolling resistance are switched off on Swerve's side when the
two are compared; the rest stays, as differences that are meant to be there.
"""

import json
import math
from pathlib import Path

from vehiclemodels.init_std import init_std
from vehiclemodels.vehicle_dynamics_std import vehicle_dynamics_std
from vehiclemodels.vehicle_parameters import VehicleParameters, setup_vehicle_parameters

G = 9.81
INPUT_STEP_S = 0.01  # inputs are constant over this long
RECORD_STEP_S = 0.05

CAR = {
    "mass_kg": 1800.0,
    "yaw_inertia_kgm2": 3260.0,
    "wheelbase_m": 2.85,
    "front_weight_share": 0.55,
    "cg_height_m": 0.55,
    "wheel_radius_m": 0.335,
    "wheel_spin_inertia_kgm2": 1.7,
    "brake_front_share": 0.7,
    "drive_front_share": 1.0,
    "steering_max_rad": 0.61,
    "steering_rate_max_radps": 0.7,
    "longitudinal": {"stiffness": 22.303, "shape": 1.6411, "curvature": 0.464},
    "lateral": {"stiffness": 21.92, "shape": 1.3507, "curvature": -0.0075},
    "friction": 0.9,
}


def parameters():
    p: VehicleParameters = setup_vehicle_parameters(vehicle_id=2)
    p.m, p.I_z, p.h_s = CAR["mass_kg"], CAR["yaw_inertia_kgm2"], CAR["cg_height_m"]
    p.b = CAR["front_weight_share"] * CAR["wheelbase_m"]
    p.a = CAR["wheelbase_m"] - p.b
    p.R_w = CAR["wheel_radius_m"]
    p.I_y_w = 2.0 * CAR["wheel_spin_inertia_kgm2"]  # its one wheel stands for the two of an axle
    p.T_sb, p.T_se = CAR["brake_front_share"], CAR["drive_front_share"]
    p.steering.max, p.steering.min = CAR["steering_max_rad"], -CAR["steering_max_rad"]
    p.steering.v_max, p.steering.v_min = CAR["steering_rate_max_radps"], -CAR["steering_rate_max_radps"]
    p.longitudinal.v_min, p.longitudinal.v_max, p.longitudinal.a_max = 0.0, 60.0, 12.0
    tyre, x, y = p.tire, CAR["longitudinal"], CAR["lateral"]
    tyre.p_cx1, tyre.p_kx1, tyre.p_ex1, tyre.p_dx1 = x["shape"], x["stiffness"], x["curvature"], CAR["friction"]
    tyre.p_cy1, tyre.p_ky1, tyre.p_ey1, tyre.p_dy1 = y["shape"], -y["stiffness"], y["curvature"], CAR["friction"]
    for offset in ("p_hx1", "p_vx1", "r_hx1", "p_hy1", "p_vy1", "r_by3", "r_hy1", "r_vy1", "r_vy3"):
        setattr(tyre, offset, 0.0)
    return p


def runge_kutta(x, u, p, h):
    f = lambda state: vehicle_dynamics_std(list(state), u, p)
    k1 = f(x)
    k2 = f([a + 0.5 * h * b for a, b in zip(x, k1)])
    k3 = f([a + 0.5 * h * b for a, b in zip(x, k2)])
    k4 = f([a + h * b for a, b in zip(x, k3)])
    return [a + h / 6.0 * (b + 2 * c + 2 * d + e) for a, b, c, d, e in zip(x, k1, k2, k3, k4)]


def inner_step(speed):
    """The wheel's equation stiffens as the car slows down."""
    return 1e-3 if speed > 6.0 else 1e-4 if speed > 0.7 else 2e-5


def drive(speed_mps, steering_rates, accels, p):
    """Rows [t, x, y, yaw, yaw rate, speed, lateral acceleration] of the centre of gravity, and the lowest
    wheel slip above 3 m/s."""
    x = init_std([0.0, 0.0, 0.0, speed_mps, 0.0, 0.0, 0.0], p)
    rows, peak_yaw_rate, slip_min = [], 0.0, 0.0
    peak_lateral = 0.0
    for i, u in enumerate(zip(steering_rates, accels)):
        ay = lateral(x, u, p)
        if i % round(RECORD_STEP_S / INPUT_STEP_S) == 0:
            rows.append([i * INPUT_STEP_S, x[0], x[1], x[4], x[5], x[3], ay])
        left = INPUT_STEP_S
        while left > 1e-9 and x[3] > 0.02:
            h = min(left, inner_step(x[3]))
            x = runge_kutta(x, u, p, h)
            x[7], x[8] = max(0.0, x[7]), max(0.0, x[8])
            left -= h
            peak_yaw_rate = max(peak_yaw_rate, abs(x[5]))
            if x[3] > 3.0:
                slip_min = min(slip_min, *(w * p.R_w / x[3] - 1.0 for w in x[7:9]))
        peak_lateral = max(peak_lateral, abs(ay))
        if x[3] <= 0.02:
            rows.append([(i + 1) * INPUT_STEP_S, x[0], x[1], x[4], x[5], 0.0, 0.0])
            break
    else:
        rows.append([len(accels) * INPUT_STEP_S, x[0], x[1], x[4], x[5], x[3], 0.0])
    return rows, peak_yaw_rate, peak_lateral, slip_min


def lateral(x, u, p):
    f = vehicle_dynamics_std(list(x), u, p)
    return f[3] * math.sin(x[6]) + x[3] * math.cos(x[6]) * (f[6] + x[5])


def sine(amplitude_rad, period_s, start_s, end_s):
    """Steering rates of one period of a sine of the angle."""
    def angle(t):
        t -= start_s
        return amplitude_rad * math.sin(2 * math.pi * t / period_s) if 0.0 <= t <= period_s else 0.0
    n = round(end_s / INPUT_STEP_S)
    angles = [round(angle(i * INPUT_STEP_S), 6) for i in range(n + 1)]
    return [(b - a) / INPUT_STEP_S for a, b in zip(angles, angles[1:])], angles


def lane_change(speed_mps, peak_g, accel_mps2, p):
    """One sine whose amplitude gives the wanted peak lateral acceleration in the reference model."""
    period_s, start_s, end_s = 2.0, 0.5, 3.5
    accels = [accel_mps2 if i * INPUT_STEP_S >= start_s else 0.0 for i in range(round(end_s / INPUT_STEP_S))]
    low, high = 0.0, 3.0 * peak_g * G * CAR["wheelbase_m"] / speed_mps**2
    for _ in range(12):
        middle = 0.5 * (low + high)
        rates, _angles = sine(middle, period_s, start_s, end_s)
        _, _, peak, _ = drive(speed_mps, rates, accels, p)
        low, high = (middle, high) if peak < peak_g * G else (low, middle)
    rates, angles = sine(low, period_s, start_s, end_s)
    return case("lane_change", speed_mps, rates, angles, accels, p)


def stop(speed_mps, accel_mps2, p):
    n = round((1.0 + 1.3 * speed_mps / -accel_mps2) / INPUT_STEP_S)
    return case("stop", speed_mps, [0.0] * n, [0.0] * (n + 1), [accel_mps2] * n, p)


def hardest_stop(speed_mps, p):
    """The strongest braking at which no wheel of the reference model locks: it has no ABS of its own."""
    low, high = 5.0, 10.0
    for _ in range(9):
        middle = 0.5 * (low + high)
        n = round(1.5 * speed_mps / middle / INPUT_STEP_S)
        _, _, _, slip = drive(speed_mps, [0.0] * n, [-middle] * n, p)
        low, high = (middle, high) if slip > -0.5 else (low, middle)
    return {**stop(speed_mps, -round(low - 0.005, 2), p), "kind": "hardest_stop"}


def case(kind, speed_mps, rates, angles, accels, p):
    rows, peak_yaw_rate, peak_lateral, slip_min = drive(speed_mps, rates, accels, p)
    record = [[round(v, 4) for v in row] for row in rows]
    print(f"{kind} {speed_mps} m/s: ay {peak_lateral / G:.3f} g, y {rows[-1][2]:.3f} m, x {rows[-1][1]:.3f} m, "
          f"yaw rate {peak_yaw_rate:.4f} rad/s, accel {accels[-1]}, slip {slip_min:.3f}")
    straight = not any(angles)
    return {
        "kind": kind,
        "speed_mps": speed_mps,
        "accel_mps2": accels[-1],
        "accel_from_s": 0.5 if kind == "lane_change" else 0.0,
        "duration_s": len(accels) * INPUT_STEP_S,
        "steering_rad": [] if straight else angles,
        "end_x_m": round(rows[-1][1], 4),
        "end_y_m": round(rows[-1][2], 4),
        "peak_yaw_rate_radps": round(peak_yaw_rate, 5),
        "peak_lateral_accel_mps2": round(peak_lateral, 4),
        "rows": record,
    }


def main():
    p = parameters()
    cases = []
    for speed in (16.0, 18.0, 20.0, 22.0):
        cases += [lane_change(speed, g, 0.0, p) for g in (0.2, 0.4, 0.6)]
        cases.append(lane_change(speed, 0.4, -3.0, p))
        cases += [stop(speed, accel, p) for accel in (-4.0, -7.0)]
        cases.append(hardest_stop(speed, p))
    head = json.dumps({"package": "commonroad-vehicle-models 3.0.2, vehicle_dynamics_std", "car": CAR,
                       "steering_step_s": INPUT_STEP_S,
                       "rows": ["t_s", "x_m", "y_m", "yaw_rad", "yaw_rate_radps", "speed_mps",
                                "lateral_accel_mps2"]})
    body = ",\n".join(json.dumps(c, separators=(",", ":")) for c in cases)
    out = Path(__file__).with_suffix(".json")
    out.write_text(head[:-1] + ',\n"cases": [\n' + body + "\n]}\n")


main()
