"""Average precision of OpenCV's people detector on rendered, labelled images, beside ours, in one run.

    python hog_ap.py FOLDER PROGRAM [RUNG]     # FOLDER of `swerve train` with kitti/training, PROGRAM is swerve

People count within 40 m, at most partly hidden and 30 % beyond the edge, as `swerve train detector --test` counts them.
OpenCV gets the image twice as large as well, and boxes as they are and shrunk to the person within the window: its best
of the four is told.
"""

import json
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np

FOLDER, PROGRAM = Path(sys.argv[1]), sys.argv[2]
RUNG = sys.argv[3:] or ["ground"]
IMAGES = sorted((FOLDER / "kitti/training/image_2").glob("*.png"))


def truths(image):
    rows = []
    for line in (FOLDER / "kitti/training/label_2" / (image.stem + ".txt")).read_text().splitlines():
        f = line.split()
        left, top, right, bottom = map(float, f[4:8])
        if f[0] in ("Pedestrian", "Person_sitting", "Cyclist"):
            counts = f[0] == "Pedestrian" and int(f[2]) <= 1 and float(f[1]) <= 0.3 and float(f[13]) <= 40.0
            rows.append(([left, top, right - left, bottom - top], counts))
    return rows


def iou(a, b):
    w = min(a[0] + a[2], b[0] + b[2]) - max(a[0], b[0])
    h = min(a[1] + a[3], b[1] + b[3]) - max(a[1], b[1])
    shared = max(w, 0) * max(h, 0)
    return shared / (a[2] * a[3] + b[2] * b[3] - shared)


def average_precision(found):
    """COCO's 101 recalls at an overlap of one half."""
    marks, wanted = [], 0
    for image, boxes in zip(IMAGES, found):
        there = truths(image)
        wanted += sum(counts for _, counts in there)
        taken = set()
        for box, score in sorted(boxes, key=lambda b: -b[1]):
            free = [(iou(box, t), counts, k) for k, (t, counts) in enumerate(there) if k not in taken]
            free = [one for one in free if one[0] >= 0.5]
            if free:
                _, counts, k = max(free, key=lambda one: (one[1], one[0]))
                taken.add(k)
                if counts:
                    marks.append((score, True))
            else:
                marks.append((score, False))
    marks.sort(key=lambda m: -m[0])
    right = np.cumsum([hit for _, hit in marks])
    precision = right / np.arange(1, len(marks) + 1)
    precision = np.maximum.accumulate(precision[::-1])[::-1]
    recall = right / wanted
    at = np.searchsorted(recall, np.linspace(0, 1, 101), side="left")
    return float(np.mean([precision[k] if k < len(precision) else 0.0 for k in at])), wanted


def opencv():
    hog = cv2.HOGDescriptor()
    hog.setSVMDetector(cv2.HOGDescriptor_getDefaultPeopleDetector())
    best = 0.0
    for scale in (1, 2):
        raw = []
        for image in IMAGES:
            pixels = cv2.resize(cv2.imread(str(image)), None, fx=scale, fy=scale)
            boxes, weights = hog.detectMultiScale(pixels, hitThreshold=-0.5, winStride=(8, 8), scale=1.05)
            raw.append([([v / scale for v in box], float(w)) for box, w in zip(boxes, np.ravel(weights))])
        for shrink in ((1.0, 1.0), (0.5, 0.75)):
            w, h = shrink
            found = [[([x + a * (1 - w) / 2, y + b * (1 - h) / 2, a * w, b * h], s) for (x, y, a, b), s in boxes] for boxes in raw]
            value, wanted = average_precision(found)
            print(f"OpenCV HOG, image x{scale}, boxes x{shrink}: AP50 {value:.3f} of {wanted}", flush=True)
            best = max(best, value)
    return best


def ours():
    call = [PROGRAM, "look", *map(str, IMAGES), "--detector", "street", "--rung", RUNG[0], "--fov", "70", "--least", "0.01", "--json"]
    lines = subprocess.run(call, capture_output=True, text=True, check=True).stdout.splitlines()
    of = {json.loads(line)["image"]: json.loads(line)["objects"] for line in lines}
    found = [[(o["box"], o["score"]) for o in of[str(image)] if o["class"] == "pedestrian"] for image in IMAGES]
    return average_precision(found)[0]


theirs, own = opencv(), ours()
print(f"OpenCV {theirs:.3f}, ours ({RUNG[0]}) {own:.3f}, above it by {own - theirs:.3f}")
