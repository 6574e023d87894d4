"""AP50 of a detector on cars seen from the side, by `swerve look` and `swerve eval`.

    python3 broadside_ap.py FOLDER PROGRAM DETECTOR RUNG     # FOLDER: out/training, after `domain.py PROGRAM detector.street across`

Counts cars and vans within 40 m, at least 25 pixels high, of occlusion level 0 or 1 and truncated by at most 0.3, whose
side is turned to the camera by at most 30 degrees. All other vehicles are ignored. Prints the mean and the standard
deviation over the streets, and the number of cars.
"""

import json
import math
import statistics
import subprocess
import sys
from pathlib import Path

FOLDER, PROGRAM, DETECTOR, RUNG = Path(sys.argv[1]), *sys.argv[2:]
OUT = Path("out/broadside_ap")


def labels(image):
    """Boxes of vehicles, and true for those to be found."""
    for line in (image.parents[1] / "label_2" / f"{image.stem}.txt").read_text().splitlines():
        kind, truncated, occluded, alpha, left, top, right, bottom, *rest = line.split()
        if kind not in ("Car", "Van", "Truck"):
            continue
        [left, top, right, bottom] = map(float, (left, top, right, bottom))
        near = float(rest[5]) <= 40.0 and bottom - top >= 25.0
        seen = float(truncated) <= 0.3 and int(occluded) <= 1
        side = abs(math.cos(float(alpha))) >= math.cos(math.radians(30.0))
        yield [left, top, right - left, bottom - top], kind != "Truck" and near and seen and side


def street(folder):
    images = sorted((folder / "kitti/training/image_2").glob("*.png"))
    at = {str(image): k for k, image in enumerate(images, 1)}
    boxes = [(k, *one) for image, k in at.items() for one in labels(Path(image))]
    truth = {"images": [{"id": k} for k in at.values()], "categories": [{"id": 1, "name": "cars"}],
             "annotations": [{"id": n, "image_id": k, "category_id": 1, "bbox": box, "area": box[2] * box[3], "iscrowd": int(not counts)}
                             for n, (k, box, counts) in enumerate(boxes, 1)]}
    call = [PROGRAM, "look", *at, "--detector", DETECTOR, "--rung", RUNG, "--fov", "70", "--height", "1.35", "--least", "0", "--json"]
    lines = map(json.loads, subprocess.run(call, capture_output=True, text=True, check=True).stdout.splitlines())
    found = [{"image_id": at[line["image"]], "category_id": 1, "bbox": one["box"], "score": one["score"]}
             for line in lines for one in line["objects"] if one["class"] == "car"]
    OUT.mkdir(parents=True, exist_ok=True)
    (OUT / "truth.json").write_text(json.dumps(truth))
    (OUT / "found.json").write_text(json.dumps(found))
    call = [PROGRAM, "eval", "detection", OUT / "truth.json", OUT / "found.json", "--format", "coco", "--json"]
    classes = json.loads(subprocess.run(call, capture_output=True, text=True, check=True).stdout)["classes"]
    return classes["cars"]["ap50"], sum(counts for _, _, counts in boxes)


results = [street(folder) for folder in sorted(FOLDER.glob("across_*"))]
values = [ap for ap, _ in results if ap is not None]
print(f"{statistics.mean(values):.2f}, sd {statistics.stdev(values) if len(values) > 1 else 0.0:.2f}, "
      f"{sum(count for _, count in results)} cars on {len(values)} streets")
