"""Writes coco.json, kitti.json, tracking.json, ties.json and segmentation.json: random cases, and what others compute
for them.

`python3 make.py [NAME...]`; needs Python 3.11 with numpy 1.26.4 (motmetrics 1.4.0 does not run on NumPy 2), pycocotools 2.0.11,
trackeval 1.3.0 (`--no-deps`), motmetrics 1.4.0, scikit-learn 1.6.1. KITTI's development kit is a C++ program around a
web site: its rules are modelled in `kitti.py`.
"""

import contextlib
import io
import json
import random
import sys
import warnings
from pathlib import Path

import numpy as np

import kitti

warnings.filterwarnings("ignore")
HERE = Path(__file__).parent


def rounded(values, digits=3):
    return [round(v, digits) for v in values]


def jittered(rng, box, jitter):
    x, y, w, h = box
    return rounded([x + rng.gauss(0, jitter) * w, y + rng.gauss(0, jitter) * h,
                    w * np.exp(rng.gauss(0, jitter)), h * np.exp(rng.gauss(0, jitter))])


def box(rng, width, height):
    w, h = np.exp(rng.uniform(np.log(6), np.log(220))), np.exp(rng.uniform(np.log(6), np.log(220)))
    return rounded([rng.uniform(0, width), rng.uniform(0, height), w, h])


# COCO

def coco_image(rng, things, jitter, crowds, levels):
    truth, found = [], []
    for _ in range(rng.randrange(things + 1)):
        b = box(rng, 400, 300)
        truth.append((b, round(b[2] * b[3] * rng.choice([1, 0.8, 0.5]), 3), rng.random() < crowds))
        for _ in range(rng.choice([0, 1, 1, 1, 2])):
            found.append((jittered(rng, b, jitter), score(rng, 0.65, levels)))
    for _ in range(rng.randrange(things + 1)):
        found.append((box(rng, 400, 300), score(rng, 0.4, levels)))
    rng.shuffle(found)
    return {"truth": truth, "found": found}


def score(rng, mean, levels):
    s = min(max(rng.gauss(mean, 0.2), 0.0), 1.0)
    return round(s * levels) / levels if levels else round(s, 6)


def coco_numbers(classes):
    from pycocotools.coco import COCO
    from pycocotools.cocoeval import COCOeval

    boxes, results = [], []
    images = max(map(len, classes))
    for category, of_class in enumerate(classes, 1):
        for image, frame in enumerate(of_class, 1):
            for b, area, crowd in frame["truth"]:
                boxes.append({"id": len(boxes) + 1, "image_id": image, "category_id": category, "bbox": b,
                              "area": area, "iscrowd": int(crowd)})
            for b, s in frame["found"]:
                results.append({"image_id": image, "category_id": category, "bbox": b, "score": s})
    with contextlib.redirect_stdout(io.StringIO()):
        coco = COCO()
        coco.dataset = {"images": [{"id": k + 1} for k in range(images)], "annotations": boxes,
                        "categories": [{"id": k + 1} for k in range(len(classes))]}
        coco.createIndex()
        evaluation = COCOeval(coco, coco.loadRes(results), "bbox")
        evaluation.evaluate()
        evaluation.accumulate()
        evaluation.summarize()
    return list(evaluation.stats)


def coco_cases():
    settings = [(1, 4, 0.05, 0.0, 0), (2, 6, 0.1, 0.0, 0), (3, 6, 0.15, 0.2, 0), (1, 6, 0.05, 0.5, 4),
                (2, 3, 0.02, 0.1, 10), (1, 90, 0.05, 0.05, 0), (2, 12, 0.2, 0.1, 5)] * 2
    for seed, (classes, things, jitter, crowds, levels) in enumerate(settings):
        rng = random.Random(seed)
        images = 3 if things > 50 else 6
        made = [[coco_image(rng, things, jitter, crowds, levels) for _ in range(images)] for _ in range(classes)]
        yield {"classes": made, "expected": coco_numbers(made)}


# KITTI

def kitti_frame(rng, jitter):
    truth, found = [], []
    for _ in range(rng.randrange(9)):
        x, y, w, h = rng.uniform(0, 1000), rng.uniform(100, 250), rng.uniform(20, 160), rng.uniform(15, 120)
        kind = rng.choice(["Car"] * 4 + ["Van", "Pedestrian", "Pedestrian", "Person_sitting", "Cyclist", "DontCare", "Tram"])
        truncation, occlusion = rng.choice([0.0, 0.0, 0.1, 0.2, 0.4, 0.7]), rng.choice([0, 0, 0, 1, 1, 2, 3])
        if kind == "DontCare":
            truncation, occlusion = -1, -1
        truth.append((kind, truncation, occlusion, rounded([x, y, x + w, y + h])))
        for _ in range(rng.choice([0, 1, 1, 1, 2])):
            jx, jy, jw, jh = jittered(rng, [x, y, w, h], jitter)
            name = {"Van": "Car", "Person_sitting": "Pedestrian", "Tram": "Car"}.get(kind, kind)
            if name == "DontCare" or rng.random() < 0.05:
                name = rng.choice(["Car", "Pedestrian", "Cyclist"])
            found.append((name, rounded([jx, jy, jx + jw, jy + jh]), round(rng.gauss(0.6, 0.2), 4)))
    for _ in range(rng.randrange(3)):
        x, y, w, h = rng.uniform(0, 1000), rng.uniform(100, 250), rng.uniform(20, 160), rng.uniform(15, 120)
        found.append((rng.choice(["Car", "Pedestrian", "Cyclist"]), rounded([x, y, x + w, y + h]), round(rng.gauss(0.4, 0.2), 4)))
    return {"truth": truth, "found": found}


def kitti_cases():
    for seed in range(10):
        rng = random.Random(100 + seed)
        frames = [kitti_frame(rng, [0.02, 0.05, 0.1][seed % 3]) for _ in range([4, 12, 12, 30, 4, 12, 12, 4, 100, 30][seed])]
        yield {"frames": frames, "expected": kitti.average_precisions(frames)}


# Tracking

def tracking_sequence(rng, objects, frames, jitter, misses, switches, ghosts):
    truth = [(i * 3 + 1, [rng.uniform(0, 200), rng.uniform(0, 150), rng.uniform(20, 60), rng.uniform(30, 90)],
              rng.uniform(-4, 4), rng.uniform(-3, 3), rng.randrange(frames // 2 + 1), rng.randrange(frames // 2, frames + 1))
             for i in range(objects)]
    names, next_name, made = {}, 1, []
    for t in range(frames):
        there, found, used = [], [], set()
        for i, (x, y, w, h), vx, vy, first, last in truth:
            if not first <= t < last:
                continue
            b = rounded([x + vx * t, y + vy * t, w, h])
            there.append((i, b))
            if i not in names or rng.random() < switches:
                names[i], next_name = (rng.choice(list(names.values())) if names and rng.random() < 0.3 else next_name), next_name + 1
            if rng.random() >= misses and names[i] not in used:
                used.add(names[i])
                found.append((names[i], jittered(rng, b, jitter)))
        for _ in range(ghosts if rng.random() < 0.5 else 0):
            found.append((10_000 + next_name, rounded([rng.uniform(0, 200), rng.uniform(0, 150), 40, 70])))
            next_name += 1
        made.append({"truth": there, "found": found})
    return made


def arrays(frames):
    """A sequence as TrackEval takes it."""
    from trackeval.datasets._base_dataset import _BaseDataset as base

    ids = {side: sorted({i for f in frames for i, _ in f[side]}) for side in ("truth", "found")}
    number = {side: {i: k for k, i in enumerate(ids[side])} for side in ids}
    boxes = lambda f, side: np.array([b for _, b in f[side]], dtype=float).reshape(-1, 4)
    of = lambda side: [np.array([number[side][i] for i, _ in f[side]], dtype=int) for f in frames]
    return {
        "gt_ids": of("truth"), "tracker_ids": of("found"),
        "similarity_scores": [base._calculate_box_ious(boxes(f, "truth"), boxes(f, "found")) for f in frames],
        "num_gt_dets": sum(len(f["truth"]) for f in frames), "num_tracker_dets": sum(len(f["found"]) for f in frames),
        "num_gt_ids": len(ids["truth"]), "num_tracker_ids": len(ids["found"]), "num_timesteps": len(frames),
    }


def tracking_numbers(frames):
    from trackeval.metrics import CLEAR, HOTA, Identity

    data = arrays(frames)
    with contextlib.redirect_stdout(io.StringIO()):
        clear, identity, hota = (m.eval_sequence(data) for m in (CLEAR(), Identity(), HOTA()))
    number = lambda v: v.item() if hasattr(v, "item") else v
    return {
        "clear": {k: number(clear[v]) for k, v in {
            "mota": "MOTA", "motp": "MOTP", "true_positives": "CLR_TP", "false_positives": "CLR_FP",
            "false_negatives": "CLR_FN", "id_switches": "IDSW", "fragmentations": "Frag", "mostly_tracked": "MT",
            "partly_tracked": "PT", "mostly_lost": "ML"}.items()},
        "identity": {k: number(identity[v]) for k, v in {
            "idf1": "IDF1", "idp": "IDP", "idr": "IDR", "true_positives": "IDTP", "false_positives": "IDFP",
            "false_negatives": "IDFN"}.items()},
        "hota": {k: float(np.mean(hota[v])) for k, v in {
            "hota": "HOTA", "det_a": "DetA", "ass_a": "AssA", "loc_a": "LocA", "det_re": "DetRe", "det_pr": "DetPr",
            "ass_re": "AssRe", "ass_pr": "AssPr"}.items()},
    }


def motmetrics_numbers(frames):
    """MOTA and IDF1 of the other one; its matches outlive frames without, so MOTA differs where those are."""
    import motmetrics

    sequence = motmetrics.MOTAccumulator(auto_id=True)
    for frame, similarity in zip(frames, arrays(frames)["similarity_scores"]):
        distance = np.where(similarity >= 0.5, 1 - similarity, np.nan)
        sequence.update([i for i, _ in frame["truth"]], [i for i, _ in frame["found"]], distance)
    names = ["mota", "idf1", "idp", "idr", "mostly_tracked", "mostly_lost"]
    summary = motmetrics.metrics.create().compute(sequence, metrics=names)
    return {name: float(summary[name].iloc[0]) for name in names}


def tracking_cases():
    settings = [(3, 8, 0.03, 0.0, 0.0, 0), (5, 20, 0.08, 0.2, 0.1, 1), (8, 30, 0.15, 0.1, 0.05, 2), (4, 15, 0.1, 0.6, 0.2, 1),
                (12, 25, 0.12, 0.15, 0.1, 3), (2, 40, 0.1, 0.3, 0.3, 1)] * 2
    for seed, setting in enumerate(settings):
        frames = tracking_sequence(random.Random(200 + seed), *setting)
        yield {"frames": frames, "expected": tracking_numbers(frames), "motmetrics": motmetrics_numbers(frames)}


def tied_sequence(rng, frames, places, empty):
    """Boxes on a few places and half-way between two, many of them equal, in an order that changes."""
    def side(ids):
        there = rng.sample(range(ids), rng.randrange(ids + 1))
        return [(i, [40.0 * rng.randrange(places) + rng.choice([0, 0, 0, 10]), 10.0, 40.0, 80.0]) for i in there]

    return [{"truth": [] if empty == "truth" else side(rng.choice([3, 6, 9])),
             "found": [] if empty == "found" else side(rng.choice([3, 6, 9]))} for _ in range(frames)]


def ties_cases():
    for seed in range(24):
        rng = random.Random(400 + seed)
        empty = {0: "truth", 1: "found"}.get(seed)
        frames = tied_sequence(rng, [4, 12, 30][seed % 3], [1, 2, 4][seed // 3 % 3], empty)
        yield {"frames": frames, "expected": tracking_numbers(frames)}


# Segmentation

def segmentation_cases():
    from sklearn.metrics import confusion_matrix, jaccard_score

    for seed in range(6):
        rng = random.Random(300 + seed)
        classes, pixels = rng.choice([3, 5, 19]), 400
        present = [c for c in range(classes) if rng.random() < 0.7] or [0]
        truth = [255 if rng.random() < 0.1 else rng.choice(present) for _ in range(pixels)]
        found = [t if t != 255 and rng.random() < 0.7 else rng.choice(present) for t in truth]
        kept = [(t, f) for t, f in zip(truth, found) if t != 255]
        t, f = zip(*kept)
        seen = sorted(set(t) | set(f))
        yield {"classes": classes, "truth": truth, "found": found,
               "counts": confusion_matrix(t, f, labels=range(classes)).tolist(),
               "ious": {c: float(v) for c, v in zip(seen, jaccard_score(t, f, labels=seen, average=None))},
               "mean": float(jaccard_score(t, f, labels=seen, average="macro"))}


for name, cases in [("coco", coco_cases), ("kitti", kitti_cases), ("tracking", tracking_cases), ("ties", ties_cases),
                    ("segmentation", segmentation_cases)]:
    if sys.argv[1:] and name not in sys.argv[1:]:
        continue
    text = ",\n".join(json.dumps(case, separators=(",", ":")) for case in cases())
    (HERE / f"{name}.json").write_text(f"[\n{text}\n]\n")
