"""Comfort as nuPlan's metrics define it (nuplan-devkit e924167, planning/metrics/utils/state_extractors.py), computed by
SciPy's Savitzky-Golay filter: `python make.py > cases.json`, with scipy 1.17.1 and numpy 2.4.6."""

import json

import numpy as np
from scipy.signal import savgol_filter

DT = 0.1


def smooth(x, window, order, derivative=0):
    return savgol_filter(
        x, polyorder=order, window_length=min(window, len(x)), deriv=derivative, delta=DT, axis=-1
    )


def case(rng, count):
    t = np.arange(count) * DT
    wave = lambda size: sum(
        size / (k + 1) * rng.normal() * np.sin((0.5 + k) * t + rng.uniform(0, 6)) for k in range(4)
    )
    along, across = wave(3.0), wave(2.0)
    heading = wave(1.5) + 3.0
    along_s, across_s = smooth(along, 8, 2), smooth(across, 8, 2)
    unwrapped = np.unwrap(heading)
    rows = {
        "lon_accel": along_s,
        "lat_accel": across_s,
        "lon_jerk": smooth(along_s, 15, 2, 1),
        "jerk": smooth(smooth(np.hypot(along, across), 8, 2), 15, 2, 1),
        "yaw_rate": smooth(unwrapped, 5, 2, 1),
        "yaw_accel": smooth(unwrapped, 5, 3, 2),
    }
    limits = {
        "lon_accel": (-4.05, 2.40),
        "lat_accel": (-4.89, 4.89),
        "lon_jerk": (-4.13, 4.13),
        "jerk": (-8.37, 8.37),
        "yaw_rate": (-0.95, 0.95),
        "yaw_accel": (-1.93, 1.93),
    }
    within = np.all([(low < rows[k]) & (rows[k] < high) for k, (low, high) in limits.items()], axis=0)
    wrap = lambda a: float((a + np.pi) % (2 * np.pi) - np.pi)
    return {
        "lon_accel_mps2": along.tolist(),
        "lat_accel_mps2": across.tolist(),
        "heading_rad": [wrap(a) for a in heading],
        "share_within": float(np.mean(within)),
        "lon_accel_min": float(rows["lon_accel"].min()),
        "lon_accel_max": float(rows["lon_accel"].max()),
        "lat_accel_max": float(np.abs(rows["lat_accel"]).max()),
        "lon_jerk_max": float(np.abs(rows["lon_jerk"]).max()),
        "jerk_max": float(np.abs(rows["jerk"]).max()),
        "yaw_rate_max": float(np.abs(rows["yaw_rate"]).max()),
        "yaw_accel_max": float(np.abs(rows["yaw_accel"]).max()),
    }


rng = np.random.default_rng(7)
print(json.dumps([case(rng, count) for count in (4, 5, 7, 8, 9, 14, 15, 16, 40, 41, 90)]))
