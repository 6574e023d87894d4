"""Scenarios drawn from a seed: other roads, speeds and road users for each one."""

from __future__ import annotations

from typing import Any

import numpy as np


def varied(seed: int) -> dict[str, Any]:
    """A scenario with a road of three bends and, each with its probability, a person who crosses, a car that brakes ahead, an
    oncoming car and parked cars. Equal seeds give equal scenarios.

    The goal is 220 m away; the target speed is 8 to 16 m/s.
    """
    rng = np.random.default_rng(seed)
    bends = [{"length_m": 40.0}]
    for _ in range(3):
        bends.append({"length_m": _of(rng, 40.0, 80.0), "curvature_1pm": _of(rng, -0.01, 0.01)})
    bends.append({"length_m": 300.0})
    speed_mps = _of(rng, 8.0, 16.0)
    makers = ((0.7, _person), (0.5, _lead), (0.5, _oncoming), (0.5, _parked))
    actors = [actor for share, make in makers if rng.random() < share for actor in make(rng, speed_mps)]
    return {
        "name": "varied",
        "road": {"segments": bends, "lane_width_m": 4.0, "left_m": 6.0, "right_m": 4.5, "friction": 0.9},
        "ego": {"target_speed_mps": speed_mps, "end_m": 220.0},
        "actor": actors,
        "end": {"timeout_s": 60.0, "after_collision_s": 0.5},
        "expect": {"verdict": "avoided"},
    }


def _of(rng: np.random.Generator, low: float, high: float) -> float:
    return round(float(rng.uniform(low, high)), 3)


def _person(rng: np.random.Generator, speed_mps: float) -> list[dict[str, Any]]:
    """Somebody who crosses, from one side or the other, when the ego is near; some stop in its lane."""
    is_left = bool(rng.random() < 0.5)
    walk = {
        "speed_mps": _of(rng, 1.0, 3.0),
        "distance_m": _of(rng, 3.0, 9.0),
        "direction": "right" if is_left else "left",
    }
    return [
        {
            "name": "person",
            "kind": "pedestrian",
            "s_m": _of(rng, 60.0, 180.0),
            "d_m": _of(rng, 4.5, 5.5) if is_left else _of(rng, -4.0, -3.0),
            "trigger": {"distance": {"to": "ego", "within_m": speed_mps * _of(rng, 2.0, 4.0)}},
            "motion": [{"walk": walk}],
        }
    ]


def _lead(rng: np.random.Generator, speed_mps: float) -> list[dict[str, Any]]:
    """A car ahead that is slower from some instant on."""
    first, then, at_s = _of(rng, 0.7, 1.0), _of(rng, 0.3, 0.7), _of(rng, 3.0, 8.0)
    fast, slow = round(first * speed_mps, 3), round(then * speed_mps, 3)
    speeds = [[0.0, fast], [at_s, fast], [at_s + _of(rng, 1.0, 3.0), slow]]
    drive = {"along": "road", "speeds": speeds, "distance_m": 350.0}
    return [{"name": "lead", "kind": "car", "s_m": _of(rng, 25.0, 45.0), "d_m": 0.0, "motion": [{"drive": drive}]}]


def _oncoming(rng: np.random.Generator, speed_mps: float) -> list[dict[str, Any]]:
    """A car on the other lane."""
    points = [[_of(rng, 180.0, 300.0), 4.0], [0.0, 4.0]]
    path = {"speed_mps": _of(rng, 6.0, 14.0), "points": points[1:]}
    place = {"s_m": points[0][0], "d_m": 4.0, "heading_rad": np.pi}
    return [{"name": "oncoming", "kind": "car", **place, "motion": [{"path": path}]}]


def _parked(rng: np.random.Generator, speed_mps: float) -> list[dict[str, Any]]:
    """One or two cars at the right edge of the road."""
    places = np.cumsum(rng.uniform(15.0, 60.0, int(rng.integers(1, 3)))) + 30.0
    return [
        {"name": f"parked_{k}", "kind": "car", "s_m": round(float(s_m), 3), "d_m": _of(rng, -3.3, -2.9)}
        for k, s_m in enumerate(places, 1)
    ]
