"""Prints the figures of crates/swerve-vision/domains.toml: AP50 or mean intersection over union in each weather, mean
and standard deviation over five held-out streets.

`python3 domain.py SWERVE MODEL [WEATHER...]` with the program and `detector.street` or such; needs Python alone. The
seed and the camera are those of the test set `clear_noon` of the recipe; the images are rendered into out/training, as
by `swerve train`. `across` in place of a weather: streets with traffic across, at clear noon.
"""

import re
import statistics
import subprocess
import sys
from pathlib import Path

VISION = Path(__file__).parents[3] / "crates/swerve-vision"
WEATHERS = ["clear_noon", "cloudy_noon", "wet_noon", "wet_cloudy_noon", "soft_rain_noon", "mid_rainy_noon", "hard_rain_noon",
            "clear_sunset", "cloudy_sunset", "wet_sunset", "wet_cloudy_sunset", "soft_rain_sunset", "mid_rain_sunset",
            "hard_rain_sunset", "clear_night"]


STREETS = 5


def tested(swerve, kind, recipe, weather):
    """Rows of `swerve train --test` with one test set per street, of this weather."""
    text = recipe.read_text()
    sets = re.findall(r"\[\[set\]\]\n(?:.+\n)+", text)
    kept = [one for one in sets if 'purpose = "test"' not in one]
    [test] = [one for one in sets if 'name = "clear_noon"' in one]
    first = 1900 if weather == "across" else 900
    for one in sets:
        text = text.replace(one, "")
    for street in range(first, first + STREETS):
        one = test.replace('weather = "clear_noon"', f'weather = "{weather if first == 900 else "clear_noon"}"')
        one = one.replace('name = "clear_noon"', f'name = "{weather}_{street}"')
        kept.append(re.sub(r"streets = .+", f"streets = [{street}, {street + 1}]", one))
    made = Path("out") / f"domain_{kind}_{recipe.stem}.toml"
    made.parent.mkdir(exist_ok=True)
    made.write_text(text + "\n".join(kept))
    weights = recipe.with_suffix(".weights")
    done = subprocess.run([swerve, "train", kind, made, "--test", weights], capture_output=True, text=True, check=True)
    return [line.split() for line in done.stdout.splitlines()]


def detector(swerve, name, weather):
    rows = tested(swerve, "detector", VISION / f"detectors/{name}.toml", weather)
    of = lambda kind: [float(row[3]) for row in rows if row[0] == "ground" and row[2] == kind and row[3] != "-"]
    return {"people": of("pedestrian"), "cars": of("car")}


def segmentation(swerve, name, weather):
    rows = tested(swerve, "segmentation", VISION / f"segmentations/{name}.toml", weather)
    return {"mean": [float(row[1]) for row in rows if row[0].startswith(weather)]}


def main(swerve, model, *weathers):
    kind, name = model.split(".")
    figures = {"detector": detector, "segmentation": segmentation}[kind]
    for weather in weathers or WEATHERS:
        found = figures(swerve, name, weather)
        means = ", ".join(f"{key} = {statistics.mean(values):.2f}" for key, values in found.items())
        spreads = ", ".join(f"{key} {statistics.stdev(values):.2f}" for key, values in found.items())
        print(f"{weather} = {{ {means} }} # sd {spreads}", flush=True)


main(*sys.argv[1:])
