"""AP50 of the built-in detectors and of OpenCV's people detector in KITTI's tracking frames, by `swerve eval`.

    python kitti_ap.py FOLDER PROGRAM     # FOLDER with t_SEQUENCE.txt and t_SEQUENCE_FRAME.png, PROGRAM is swerve

Vans and trucks do not count as cars, and sitting people and cyclists not as people; neither do boxes at these places,
nor in `DontCare`. The truth and the results remain as COCO files in out/kitti_ap/.
"""

import json
import subprocess
import sys
from pathlib import Path

FOLDER, PROGRAM = Path(sys.argv[1]), sys.argv[2]
IMAGES = sorted(FOLDER.glob("t_*_*.png"))
CLASSES = {"people": 1, "cars": 2}
COUNTS = {"Pedestrian": "people", "Car": "cars"}
BESIDE = {"Person_sitting": ["people"], "Cyclist": ["people"], "Van": ["cars"], "Truck": ["cars"], "DontCare": ["people", "cars"]}
OUT = Path("out/kitti_ap")
FOV_DEG = "81.4"


def truth():
    boxes = []
    for k, image in enumerate(IMAGES, 1):
        _, sequence, frame = image.stem.split("_")
        for line in (FOLDER / f"t_{sequence}.txt").read_text().splitlines():
            f = line.split()
            if int(f[0]) != int(frame):
                continue
            left, top, right, bottom = map(float, f[6:10])
            for name in [COUNTS[f[2]]] if f[2] in COUNTS else BESIDE.get(f[2], []):
                boxes.append({"id": len(boxes) + 1, "image_id": k, "category_id": CLASSES[name],
                              "bbox": [left, top, right - left, bottom - top],
                              "area": (right - left) * (bottom - top), "iscrowd": int(f[2] not in COUNTS)})
    return {"images": [{"id": k} for k in range(1, len(IMAGES) + 1)], "annotations": boxes,
            "categories": [{"id": k, "name": name} for name, k in CLASSES.items()]}


def ours(detector, rung):
    call = [PROGRAM, "look", *map(str, IMAGES), "--detector", detector, "--rung", rung, "--fov", FOV_DEG, "--height", "1.65",
            "--least", "0", "--json"]
    lines = [json.loads(line) for line in subprocess.run(call, capture_output=True, text=True, check=True).stdout.splitlines()]
    at = {str(image): k for k, image in enumerate(IMAGES, 1)}
    names = {"pedestrian": "people", "person": "people", "car": "cars"}
    return [{"image_id": at[line["image"]], "category_id": CLASSES[names[one["class"]]], "bbox": one["box"], "score": one["score"]}
            for line in lines for one in line["objects"] if one["class"] in names]


def opencv(scale):
    import cv2

    hog = cv2.HOGDescriptor()
    hog.setSVMDetector(cv2.HOGDescriptor_getDefaultPeopleDetector())
    found = []
    for k, image in enumerate(IMAGES, 1):
        pixels = cv2.resize(cv2.imread(str(image)), None, fx=scale, fy=scale)
        boxes, weights = hog.detectMultiScale(pixels, hitThreshold=-0.5, winStride=(8, 8), scale=1.05)
        for (x, y, w, h), score in zip(boxes, weights.ravel() if len(boxes) else []):
            # The person within the window.
            box = [float(x + w / 4) / scale, float(y + h / 8) / scale, float(w / 2) / scale, float(0.75 * h) / scale]
            found.append({"image_id": k, "category_id": CLASSES["people"], "bbox": box, "score": float(score)})
    return found


def average_precisions(name, found):
    (OUT / f"{name}.json").write_text(json.dumps(found))
    call = [PROGRAM, "eval", "detection", OUT / "truth.json", OUT / f"{name}.json", "--format", "coco", "--json"]
    classes = json.loads(subprocess.run(call, capture_output=True, text=True, check=True).stdout)["classes"]
    return ", ".join(f"{of} {figures['ap50']:.2f}" for of, figures in classes.items())


OUT.mkdir(parents=True, exist_ok=True)
(OUT / "truth.json").write_text(json.dumps(truth()))
RUNGS = {"street": ["ground", "full"], "hog_street": ["ground", "doubled", "full"], "acf_inria": ["as_it_is", "doubled"],
         "ldcf_inria": ["as_it_is", "doubled"]}
for detector, rungs in RUNGS.items():
    for rung in rungs:
        print(detector, rung, average_precisions(f"{detector}_{rung}", ours(detector, rung)), flush=True)
for scale in (1, 2):
    print("OpenCV", scale, average_precisions(f"opencv_{scale}", opencv(scale)), flush=True)
