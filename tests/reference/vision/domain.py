"""Prints the figures of crates/swerve-vision/domains.toml: AP50 or intersection over union in each weather.

`python3 domain.py SWERVE MODEL [WEATHER...]` with the program and `detector.street` or such; needs Python alone. The streets, the seed and the camera
are those of the test set `clear_noon` of each recipe; the images are rendered into out/training, as by `swerve train`.
"""

import re
import subprocess
import sys
from pathlib import Path

VISION = Path(__file__).parents[3] / "crates/swerve-vision"
WEATHERS = ["clear_noon", "cloudy_noon", "wet_noon", "wet_cloudy_noon", "soft_rain_noon", "mid_rainy_noon", "hard_rain_noon",
            "clear_sunset", "cloudy_sunset", "wet_sunset", "wet_cloudy_sunset", "soft_rain_sunset", "mid_rain_sunset",
            "hard_rain_sunset", "clear_night"]


def tested(swerve, kind, recipe, weather):
    """Rows of `swerve train --test` with one test set, of this weather."""
    text = recipe.read_text()
    sets = re.findall(r"\[\[set\]\]\n(?:.+\n)+", text)
    kept = [one for one in sets if 'purpose = "test"' not in one]
    [test] = [one for one in sets if 'name = "clear_noon"' in one]
    for one in sets:
        text = text.replace(one, "")
    made = Path("out") / f"domain_{kind}_{recipe.stem}.toml"
    made.parent.mkdir(exist_ok=True)
    made.write_text(text + "\n".join([*kept, test.replace('"clear_noon"', f'"{weather}"')]))
    weights = recipe.with_suffix(".weights")
    done = subprocess.run([swerve, "train", kind, made, "--test", weights], capture_output=True, text=True, check=True)
    return [line.split() for line in done.stdout.splitlines()]


def detector(swerve, name, weather):
    rows = tested(swerve, "detector", VISION / f"detectors/{name}.toml", weather)
    of = {row[2]: float(row[3]) for row in rows if row[0] == "ground" and row[1] == weather and row[3] != "-"}
    return {"people": of["pedestrian"], "cars": of["car"]}


def segmentation(swerve, name, weather):
    rows = tested(swerve, "segmentation", VISION / f"segmentations/{name}.toml", weather)
    [mean] = [float(row[1]) for row in rows if row[0] == weather]
    return {"mean": mean}


def main(swerve, model, *weathers):
    kind, name = model.split(".")
    figures = {"detector": detector, "segmentation": segmentation}[kind]
    for weather in weathers or WEATHERS:
        found = ", ".join(f"{key} = {value:.2f}" for key, value in figures(swerve, name, weather).items())
        print(f"{weather} = {{ {found} }}", flush=True)


main(*sys.argv[1:])
