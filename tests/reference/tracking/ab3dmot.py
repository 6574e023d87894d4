"""The scheme of AB3DMOT, as a second opinion: matrices, polygons of Shapely, a general solver; it shares nothing with the crate.

Weng et al. 2020, with the constants that the authors publish for KITTI's cars: generalised overlap of at least -0.2 in
the best pairs in sum, a track reported from its third box on and gone after two frames without one.

    python3 tests/reference/tracking/ab3dmot.py     # writes ab3dmot.json again

Python 3.11, NumPy 2.4.1, SciPy 1.17, Shapely 2.2.
"""
import json
import math
import pathlib

import numpy as np
from scipy.optimize import linear_sum_assignment
from shapely import MultiPoint, Polygon

LEAST, BIRTH, DEATH = -0.2, 3, 2
# x, y, z, heading, length, width, height, and the rates of the first three.
MOVES = np.eye(10)
MOVES[0, 7] = MOVES[1, 8] = MOVES[2, 9] = 1
SEES = np.eye(7, 10)
FIRST = np.diag([10.0] * 7 + [1e4] * 3)
NOISE = np.diag([1.0] * 7 + [0.01] * 3)


def outline(box):
    x, y, _, heading, length, width, _ = box[:7]
    c, s = math.cos(heading), math.sin(heading)
    corners = [(1, 1), (-1, 1), (-1, -1), (1, -1)]
    return Polygon([(x + c * a * length / 2 - s * b * width / 2, y + s * a * length / 2 + c * b * width / 2) for a, b in corners])


def giou(a, b):
    p, q = outline(a), outline(b)
    low = lambda box: box[2] - box[6] / 2
    high = lambda box: box[2] + box[6] / 2
    shared = p.intersection(q).area * max(0, min(high(a), high(b)) - max(low(a), low(b)))
    union = p.area * a[6] + q.area * b[6] - shared
    hull = MultiPoint(list(p.exterior.coords) + list(q.exterior.coords)).convex_hull.area
    around = hull * (max(high(a), high(b)) - min(low(a), low(b)))
    return shared / union - (around - union) / around


class Track:
    def __init__(self, name, box):
        self.name, self.hits, self.unseen = name, 1, 0
        self.mean, self.cov = np.concatenate([box, np.zeros(3)]), FIRST.copy()

    def predict(self):
        self.mean, self.cov = MOVES @ self.mean, MOVES @ self.cov @ MOVES.T + NOISE
        self.unseen += 1

    def update(self, box):
        turn = math.remainder(box[3] - self.mean[3], 2 * math.pi)
        if abs(turn) > math.pi / 2:
            self.mean[3] += math.pi
        turn = math.remainder(box[3] - self.mean[3], 2 * math.pi)
        off = box - SEES @ self.mean
        off[3] = turn
        cov = SEES @ self.cov @ SEES.T + np.eye(7)
        gain = self.cov @ SEES.T @ np.linalg.inv(cov)
        self.mean, self.cov = self.mean + gain @ off, self.cov - gain @ cov @ gain.T
        self.unseen, self.hits = 0, self.hits + 1


def track(frames):
    tracks, given, told = [], 0, []
    for boxes in frames:
        boxes = [np.array(box) for box in boxes]
        for one in tracks:
            one.predict()
        free = list(range(len(boxes)))
        if tracks and boxes:
            like = np.array([[giou(t.mean, box) for box in boxes] for t in tracks])
            cost = np.minimum(LEAST - like, 0)
            for row, column in zip(*linear_sum_assignment(cost)):
                if like[row, column] > LEAST:
                    tracks[row].update(boxes[column])
                    free.remove(column)
        tracks = [t for t in tracks if t.unseen < DEATH]
        for k in free:
            given += 1
            tracks.append(Track(given, boxes[k]))
        told.append([[t.name, *(round(float(x), 5) for x in t.mean)] for t in tracks if t.hits >= BIRTH])
    return told


def scene(rng):
    """Cars that drive, turn, are missed, are seen the wrong way round, and boxes of nothing."""
    cars = []
    for _ in range(rng.integers(2, 8)):
        cars.append([rng.uniform(-30, 30), rng.uniform(-15, 15), rng.uniform(-3.1, 3.1), rng.uniform(0, 12), rng.uniform(-0.4, 0.4)])
    frames = []
    for _ in range(40):
        boxes = []
        for car in cars:
            x, y, heading, speed, turn = car
            car[0], car[1], car[2] = x + 0.1 * speed * math.cos(heading), y + 0.1 * speed * math.sin(heading), heading + 0.1 * turn
            if rng.random() < 0.2:
                continue
            seen = heading + rng.normal(0, 0.05) + (math.pi if rng.random() < 0.1 else 0)
            size = np.array([4.4, 1.8, 1.5]) + rng.normal(0, 0.1, 3)
            boxes.append([x + rng.normal(0, 0.2), y + rng.normal(0, 0.2), 0.75 + rng.normal(0, 0.05), math.remainder(seen, 2 * math.pi), *size])
        if rng.random() < 0.2:
            boxes.append([rng.uniform(-30, 30), rng.uniform(-15, 15), 0.8, rng.uniform(-3, 3), 4.0, 1.7, 1.6])
        frames.append([[round(float(v), 4) for v in box] for box in boxes])
    return frames


if __name__ == "__main__":
    rng = np.random.default_rng(2)
    scenes = [scene(rng) for _ in range(8)]
    cases = [{"frames": frames, "tracks": track(frames)} for frames in scenes]
    text = json.dumps(cases, separators=(",", ":"))
    pathlib.Path(__file__).with_suffix(".json").write_text(text + "\n")
