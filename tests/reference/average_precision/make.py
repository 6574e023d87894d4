"""Writes cases.json: random boxes, and what pycocotools 2.0.11 computes for them.

`python3 make.py`; needs `pip install pycocotools numpy`. Boxes that do not count get an area beyond the range that is
asked for, which is how COCO leaves them out. KITTI's recalls are put in the place of COCO's.
"""

import contextlib
import io
import json
import random
from pathlib import Path

import numpy as np
from pycocotools.coco import COCO
from pycocotools.cocoeval import COCOeval

RECALLS = {
    "coco101": np.linspace(0, 1, 101),
    "kitti11": np.arange(11) / 10,
    "kitti40": np.arange(1, 41) / 40,
}


def case(rng, frames, jitter, misses, ghosts, ignored, levels):
    made = []
    for _ in range(frames):
        wanted, found = [], []
        for _ in range(rng.randrange(7)):
            x, y, w, h = rng.uniform(0, 80), rng.uniform(0, 80), rng.uniform(5, 40), rng.uniform(5, 40)
            wanted.append(([x, y, x + w, y + h], rng.random() >= ignored))
            for _ in range(rng.choice([1, 1, 1, 2])):
                if rng.random() < misses:
                    continue
                off = [rng.gauss(0, jitter) for _ in range(4)]
                box = [x + off[0] * w, y + off[1] * h, x + w + off[2] * w, y + h + off[3] * h]
                if box[0] < box[2] and box[1] < box[3]:
                    found.append((box, score(rng, 0.65, levels)))
        for _ in range(ghosts):
            x, y = rng.uniform(0, 80), rng.uniform(0, 80)
            found.append(([x, y, x + rng.uniform(5, 40), y + rng.uniform(5, 40)], score(rng, 0.45, levels)))
        made.append({"wanted": wanted, "found": found})
    return made


def score(rng, mean, levels):
    s = min(max(rng.gauss(mean, 0.2), 0.0), 1.0)
    return round(s * levels) / levels if levels else s


def average_precision(frames, overlap_min, recalls):
    boxes, results = [], []
    for image, frame in enumerate(frames, 1):
        for (x0, y0, x1, y1), counts in frame["wanted"]:
            boxes.append({
                "id": len(boxes) + 1, "image_id": image, "category_id": 1, "iscrowd": 0,
                "bbox": [x0, y0, x1 - x0, y1 - y0], "area": 100 if counts else 1e9,
            })
        for (x0, y0, x1, y1), s in frame["found"]:
            results.append({"image_id": image, "category_id": 1, "bbox": [x0, y0, x1 - x0, y1 - y0], "score": s})
    with contextlib.redirect_stdout(io.StringIO()):
        truth = COCO()
        truth.dataset = {
            "images": [{"id": k + 1} for k in range(len(frames))],
            "annotations": boxes,
            "categories": [{"id": 1, "name": "thing"}],
        }
        truth.createIndex()
        run = COCOeval(truth, truth.loadRes(results), "bbox")
        run.params.iouThrs = np.array([overlap_min])
        run.params.recThrs = recalls
        run.params.areaRng, run.params.areaRngLbl = [[0, 1e8]], ["all"]
        run.params.maxDets = [100]
        run.evaluate()
        run.accumulate()
    return float(np.mean(run.eval["precision"][0, :, 0, 0, 0]))


def main():
    rng = random.Random(4)
    shapes = [
        (6, 0.0, 0.0, 0, 0.0, 0), (6, 0.05, 0.1, 1, 0.0, 0), (8, 0.1, 0.2, 2, 0.0, 0), (8, 0.1, 0.2, 2, 0.3, 0),
        (8, 0.15, 0.3, 3, 0.2, 0), (10, 0.1, 0.1, 1, 0.0, 10), (10, 0.1, 0.4, 4, 0.1, 5), (3, 0.2, 0.6, 6, 0.0, 0),
    ]
    cases = []
    for shape in shapes:
        for overlap_min in (0.5, 0.7):
            frames = case(rng, *shape)
            aps = {name: average_precision(frames, overlap_min, r) for name, r in RECALLS.items()}
            cases.append({"overlap_min": overlap_min, "frames": frames, **aps})
    text = ",\n".join(json.dumps(c) for c in cases)
    Path(__file__).with_name("cases.json").write_text(f"[\n{text}\n]\n")


main()
