#!/usr/bin/env python3
"""Vehicle updates per second of traffic in SUMO and in Swerve, on the same network, on one core.

usage: speed.py NET THROUGHPUT [VEHICLES [SECONDS [ROUNDS]]]

NET is a road network of SUMO, such as `worlds/sumo/made/town01.net.xml` of the test data; THROUGHPUT the example of
`swerve-traffic` (`cargo build --release -p swerve-traffic --example throughput`). Needs SUMO 1.28.0 (`pip install
eclipse-sumo==1.28.0`). Both programs drive the same number of cars at random for the same time, by IDM, ten steps a second;
SUMO's get random walks that take longer than that. The programs run in turn. Prints medians with their extremes.
"""

import random
import re
import statistics
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as xml
from pathlib import Path

FASTEST_MPS = 14.0
DRIVER = 'carFollowModel="IDM" accel="1.5" decel="2.0" tau="1.5" minGap="2.0" length="4.5" width="1.8" sigma="0"'


def walks(net, vehicles, seconds):
    """Random walks over the edges for cars, each longer than a car can drive in this time."""
    root = xml.parse(net).getroot()
    for_cars = lambda lane: "passenger" in lane.get("allow", "passenger") and "passenger" not in lane.get("disallow", "")
    lengths_m = {
        edge.get("id"): max(float(lane.get("length")) for lane in edge.iter("lane"))
        for edge in root.iter("edge")
        if edge.get("function") is None and any(map(for_cars, edge.iter("lane")))
    }
    onward = {name: set() for name in lengths_m}
    for link in root.iter("connection"):
        if link.get("from") in onward and link.get("to") in onward:
            onward[link.get("from")].add(link.get("to"))
    # Only edges from which a walk can go on for ever.
    while ends := {name for name, next_ones in onward.items() if not next_ones}:
        onward = {name: next_ones - ends for name, next_ones in onward.items() if name not in ends}
    draw = random.Random(1)
    for _ in range(vehicles):
        walk = [draw.choice(sorted(onward))]
        length_m = 0.0
        while length_m < seconds * FASTEST_MPS:
            walk.append(draw.choice(sorted(onward[walk[-1]])))
            length_m += lengths_m[walk[-1]]
        yield walk


def sumo(net, routes, seconds):
    """Millions of vehicle updates per second, and the mean number of cars."""
    command = ["sumo", "-n", net, "-r", routes, "--step-length", "0.1", "--end", seconds, "--time-to-teleport", "-1"]
    command += ["--no-step-log", "--duration-log.statistics", "--seed", "1", "--xml-validation", "never"]
    done = subprocess.run([str(part) for part in command], check=True, capture_output=True, text=True).stdout
    updates = float(re.search(r"UPS: ([\d.]+)", done).group(1))
    inserted = int(re.search(r"Inserted: (\d+)", done).group(1))
    return updates * 1e-6, inserted


def swerve(program, net, vehicles, seconds):
    """Millions of vehicle updates per second, and the number of cars."""
    command = [str(part) for part in (program, net, vehicles, seconds)]
    done = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    return float(re.search(r"([\d.]+) million", done).group(1)), int(done.split()[0])


def main():
    net, program = sys.argv[1:3]
    defaults = [200, 600, 7]
    given = [int(text) for text in sys.argv[3:]]
    vehicles, seconds, rounds = given + defaults[len(given) :]
    with tempfile.TemporaryDirectory() as folder:
        routes = Path(folder) / "rou.xml"
        cars = ""
        for k, walk in enumerate(walks(net, vehicles, seconds)):
            cars += f'<vehicle id="{k}" type="idm" depart="0" departPos="random_free" departLane="best">'
            cars += f'<route edges="{" ".join(walk)}"/></vehicle>'
        routes.write_text(f'<routes><vType id="idm" {DRIVER}/>{cars}</routes>')
        found = [(sumo(net, routes, seconds), swerve(program, net, vehicles, seconds)) for _ in range(rounds)]
    for name, column in (("SUMO", 0), ("Swerve", 1)):
        speeds = [pair[column][0] for pair in found]
        print(f"{name}: {found[0][column][1]} cars, {spread(speeds)} million vehicle updates per second")
    print(f"Swerve over SUMO: {spread([ours[0] / theirs[0] for theirs, ours in found])}")


def spread(values):
    return f"{statistics.median(values):.2f} [{min(values):.2f} .. {max(values):.2f}]"


if __name__ == "__main__":
    main()
