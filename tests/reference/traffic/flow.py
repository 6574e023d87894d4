#!/usr/bin/env python3
"""Flow and speed through a signalised junction in SUMO, with the intelligent driver model.

usage: flow.py NET [OUT]

NET is the crossing of the test data, `worlds/sumo/made/cross.net.xml`. Needs SUMO 1.28.0 (`pip install
eclipse-sumo==1.28.0`). Writes OUT, by default `flow.json` beside this script. Cars drive straight on from all four arms, on
one lane each, one every `period_s` seconds on each arm; those for which there is no room wait. The demand of the first case is
above the capacity, that of the others below. Cars are counted, and their trips measured, at `END_M` beyond the junction from
`FROM_S` to `TO_S`.
"""

import json
import subprocess
import sys
import tempfile
import xml.etree.ElementTree as xml
from pathlib import Path

PERIODS_S = [2.5, 8.0, 15.0]
ROUTES = {"we": "WC CE", "ew": "EC CW", "ns": "NC CS", "sn": "SC CN"}
BEGIN_M, END_M, BEGIN_MPS = 10, 150, 10
FROM_S, TO_S = 300, 2100
DRIVER = {"accel": 1.5, "decel": 2.0, "tau": 1.5, "minGap": 2.0}


def run(net, period_s, folder):
    """Cars per hour and mean speed, m/s."""
    driver = " ".join(f'{key}="{value}"' for key, value in DRIVER.items())
    still = 'lcStrategic="-1" lcSpeedGain="0" lcKeepRight="0" lcCooperative="-1"'
    text = f'<routes><vType id="idm" carFollowModel="IDM" {driver} {still} length="4.5" width="1.8" sigma="0" '
    text += 'speedFactor="1" speedDev="0" jmDriveAfterYellowTime="-1"/>'
    for name, edges in ROUTES.items():
        text += f'<route id="{name}" edges="{edges}"/>'
    for name in ROUTES:
        text += f'<flow id="{name}" type="idm" route="{name}" begin="0" end="{TO_S}" period="{period_s}" departLane="0" '
        text += f'departPos="{BEGIN_M + 2.25}" departSpeed="{BEGIN_MPS}" arrivalPos="{END_M}"/>'
    routes, trips = folder / "rou.xml", folder / "trips.xml"
    routes.write_text(text + "</routes>")
    command = ["sumo", "-n", net, "-r", routes, "--tripinfo-output", trips, "--step-length", "0.1", "--end", str(TO_S)]
    command += ["--time-to-teleport", "-1", "--no-step-log", "--seed", "1", "--default.speeddev", "0"]
    subprocess.run([str(part) for part in command], check=True, stdout=subprocess.DEVNULL)
    done = [trip for trip in xml.parse(trips).getroot().iter("tripinfo") if float(trip.get("arrival")) >= FROM_S]
    length_m = sum(float(trip.get("routeLength")) for trip in done)
    duration_s = sum(float(trip.get("duration")) for trip in done)
    return len(done) * 3600 / (TO_S - FROM_S), length_m / duration_s


def main():
    net = sys.argv[1]
    out = Path(sys.argv[2]) if len(sys.argv) > 2 else Path(__file__).with_name("flow.json")
    cases = []
    with tempfile.TemporaryDirectory() as folder:
        for period_s in PERIODS_S:
            cars_per_h, speed_mps = run(net, period_s, Path(folder))
            case = {"period_s": period_s, "cars_per_h": round(cars_per_h, 1), "speed_mps": round(speed_mps, 3)}
            cases.append(case)
    out.write_text(json.dumps({"sumo": "1.28.0", "cases": cases}, indent=1) + "\n")


if __name__ == "__main__":
    main()
