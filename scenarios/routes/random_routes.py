#!/usr/bin/env python3
"""Makes random routes over any road network, for `swerve suite --rules leaderboard FOLDER`.

usage: random_routes.py MAP FOLDER [ROUTES [SEED]]

Writes ROUTES (10) scenarios with traffic into FOLDER: places are drawn from the extent of MAP until the shortest way over
them is 0.9 to 1.6 km long and the scenario is valid. The program is SWERVE, by default `swerve`.
"""

import json
import os
import random
import subprocess
import sys
from pathlib import Path

LENGTH_M = (900.0, 1600.0)
DRAWS_MAX = 200  # for each route
PROGRAM = os.environ.get("SWERVE", "swerve")

ROUTE = """name = "{name}"
description = "A random route over {map} in traffic."

[map]
file = "{path}"

[ego]
start = {start}
via = [{via}]
goal = {goal}
target_speed_mps = 13.9
start_speed_mps = 0.0

[traffic]
vehicles = 60
pedestrians = 40
"""


def shown(*arguments):
    """What `swerve map show` prints, and its message if it fails."""
    try:
        done = subprocess.run([PROGRAM, "map", "show", *arguments, "--json"], capture_output=True, text=True)
    except OSError as error:
        sys.exit(f"{PROGRAM}: {error.strerror}: name the program in the variable SWERVE")
    return (json.loads(done.stdout) if done.returncode == 0 else None), done.stderr.strip()


def places(draw, extent_m, path):
    """Places of a route, in order; None if the last one makes it too long."""
    length_m, found = 0.0, []
    while length_m < LENGTH_M[0]:
        place = [draw.uniform(*extent_m[axis]) for axis in "xy"]
        if found:
            ends = [f"{x:.1f},{y:.1f}" for x, y in (found[-1], place)]
            leg, _ = shown(path, "--route", *ends)
            if not leg:
                return None
            length_m += leg["route"]["length_m"]
        found.append(place)
    return found if length_m <= LENGTH_M[1] else None


def main():
    if len(sys.argv) < 3 or not all(text.isdigit() for text in sys.argv[3:]):
        sys.exit(__doc__)
    path, folder = Path(sys.argv[1]).resolve(), Path(sys.argv[2])
    count, seed = (int(text) for text in (sys.argv[3:] + ["10", "1"][len(sys.argv) - 3 :]))
    network, message = shown(str(path))
    if network is None:
        sys.exit(message or f"{path}: cannot be shown")
    folder.mkdir(parents=True, exist_ok=True)
    draw, made, draws = random.Random(seed), 0, 0
    while made < count:
        if draws == DRAWS_MAX * count:
            sys.exit(f"{path}: {made} routes of {LENGTH_M[0]:.0f} to {LENGTH_M[1]:.0f} m in {draws} draws, expected {count}")
        draws += 1
        found = places(draw, network["extent_m"], str(path))
        if not found:
            continue
        start, *via, goal = (f"{{ x_m = {x:.1f}, y_m = {y:.1f} }}" for x, y in found)
        name = f"{path.stem.lower()}_{made + 1:02}"
        file = folder / f"{name}.toml"
        file.write_text(ROUTE.format(name=name, map=path.stem, path=path, start=start, via=", ".join(via), goal=goal))
        if subprocess.run([PROGRAM, "check", str(file)], capture_output=True).returncode == 0:
            made += 1
        else:
            file.unlink()


if __name__ == "__main__":
    main()
