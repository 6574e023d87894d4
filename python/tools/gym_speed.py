"""Measures how many control steps a second one core takes in environments without a camera.

`python python/tools/gym_speed.py [STEPS] [SCENARIO]` after `pip install './python[gym]'`; docs/performance.md has what came of it.
"""

from __future__ import annotations

import statistics
import sys
import time
from typing import Any

import gymnasium
import numpy as np

ROUNDS = 15
DRIVES = 32


def rates(observe: Any, scenario: str, steps: int) -> list[float]:
    """Steps a second of each round, drives that begin anew included; processor time, so that others do not count."""
    env = gymnasium.make_vec(
        f"swerve.gym:swerve/{scenario}-v0",
        num_envs=DRIVES,
        vectorization_mode="vector_entry_point",
        observe=observe,
        threads=1,
    )
    # Straight on with a little throttle: most drives go on to their end.
    actions = np.tile(np.array([0.0, 0.15, 0.0], np.float32), (DRIVES, 1))
    env.reset(seed=1)
    measured = []
    for _ in range(ROUNDS):
        start = time.process_time()
        for _ in range(steps // DRIVES):
            env.step(actions)
        measured.append(steps // DRIVES * DRIVES / (time.process_time() - start))
    env.close()
    return measured


def main() -> None:
    steps = int(sys.argv[1]) if len(sys.argv) > 1 else 20_000
    scenario = sys.argv[2] if len(sys.argv) > 2 else "PersonBehindTruck"
    for observe in ("pose", ("route", "pose"), ("route", "pose", "obstacles")):
        measured = rates(observe, scenario, steps)
        low, high = min(measured), max(measured)
        name = observe if isinstance(observe, str) else ", ".join(observe)
        print(f"{scenario}, {name}: {statistics.median(measured):,.0f} [{low:,.0f} .. {high:,.0f}] steps a second")


if __name__ == "__main__":
    main()
