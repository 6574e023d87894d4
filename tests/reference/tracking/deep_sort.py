"""The scheme of DeepSORT by motion alone, as a second opinion: matrices and a general solver, sharing nothing with the crate.

Wojke, Bewley, Paulus 2017, sections 2.1 to 2.3: an 8-dimensional Kalman filter, the Mahalanobis gate, the matching
cascade with the Mahalanobis distance as cost (equation 5 with lambda = 1), overlap for the rest.

    python3 tests/reference/tracking/deep_sort.py     # writes deep_sort.json again

Python 3.11, NumPy 2.4.1, SciPy 1.17.
"""
import json
import pathlib

import numpy as np
from scipy.optimize import linear_sum_assignment

GATE, OVERLAP_MAX, AGE_MAX, HITS_MIN, SCORE_MIN = 9.4877, 0.7, 30, 3, 0.3
MOVES = np.eye(8) + np.eye(8, k=4)
SEES = np.eye(4, 8)


def shape(box):
    left, top, right, bottom = box
    return np.array([(left + right) / 2, (top + bottom) / 2, (right - left) / (bottom - top), bottom - top])


def edges(mean):
    x, y, aspect, height = mean[:4]
    return [x - aspect * height / 2, y - height / 2, x + aspect * height / 2, y + height / 2]


def overlap(a, b):
    width = min(a[2], b[2]) - max(a[0], b[0])
    height = min(a[3], b[3]) - max(a[1], b[1])
    if width <= 0 or height <= 0:
        return 0.0
    area = lambda r: (r[2] - r[0]) * (r[3] - r[1])
    return width * height / (area(a) + area(b) - width * height)


def deviations(height, place, rate, aspect, aspect_rate):
    return np.array([place * height] * 2 + [aspect, place * height] + [rate * height] * 2 + [aspect_rate, rate * height])


class Track:
    def __init__(self, name, box, score):
        self.name, self.score, self.hits, self.unseen, self.confirmed = name, score, 1, 0, False
        self.mean = np.concatenate([shape(box), np.zeros(4)])
        self.cov = np.diag(deviations(self.mean[3], 2 / 20, 10 / 160, 1e-2, 1e-5) ** 2)

    def predict(self):
        noise = np.diag(deviations(self.mean[3], 1 / 20, 1 / 160, 1e-2, 1e-5) ** 2)
        self.mean, self.cov = MOVES @ self.mean, MOVES @ self.cov @ MOVES.T + noise
        self.unseen += 1

    def expected(self):
        noise = np.diag(np.array([self.mean[3] / 20] * 2 + [1e-1, self.mean[3] / 20]) ** 2)
        return SEES @ self.mean, SEES @ self.cov @ SEES.T + noise

    def distance(self, box):
        mean, cov = self.expected()
        off = shape(box) - mean
        return float(off @ np.linalg.solve(cov, off))

    def update(self, box, score):
        mean, cov = self.expected()
        gain = self.cov @ SEES.T @ np.linalg.inv(cov)
        self.mean = self.mean + gain @ (shape(box) - mean)
        self.cov = self.cov - gain @ cov @ gain.T
        self.score, self.unseen, self.hits = score, 0, self.hits + 1
        self.confirmed |= self.hits >= HITS_MIN


def match(tracks, boxes, cost, limit):
    """Pairs at the least cost in sum, what is beyond the limit counted as a little more than it; those are no pairs."""
    if not tracks or not boxes:
        return []
    matrix = np.array([[cost(t, b) for b in boxes] for t in tracks])
    matrix[matrix > limit] = limit + 1e-5
    return [(tracks[r], boxes[c]) for r, c in zip(*linear_sum_assignment(matrix)) if matrix[r, c] <= limit]


def track(frames):
    tracks, given, told = [], 0, []
    for number, boxes in enumerate(frames, 1):
        for one in tracks:
            one.predict()
        free, pairs = [k for k, box in enumerate(boxes) if box[4] >= SCORE_MIN], []
        for age in range(1, AGE_MAX + 1):
            level = [t for t in tracks if t.confirmed and t.unseen == age]
            found = match(level, free, lambda t, k: t.distance(boxes[k][:4]), GATE)
            free = [k for k in free if all(k != taken for _, taken in found)]
            pairs += found
        left = [t for t in tracks if all(t is not taken for taken, _ in pairs) and (not t.confirmed or t.unseen == 1)]
        found = match(left, free, lambda t, k: 1 - overlap(edges(t.mean), boxes[k]), OVERLAP_MAX)
        free = [k for k in free if all(k != taken for _, taken in found)]
        for one, k in pairs + found:
            one.update(boxes[k][:4], boxes[k][4])
        tracks = [t for t in tracks if t.unseen == 0 or (t.confirmed and t.unseen <= AGE_MAX)]
        for k in free:
            given += 1
            tracks.append(Track(given, boxes[k][:4], boxes[k][4]))
        told.append([[t.name, *(round(x, 4) for x in edges(t.mean))] for t in tracks if t.confirmed and t.unseen == 0])
    return told


def scene(rng):
    """People who cross, stop and are hidden for a while, and boxes of nothing."""
    people = []
    for _ in range(rng.integers(3, 9)):
        height = rng.uniform(50, 160)
        people.append([rng.uniform(0, 600), rng.uniform(100, 300), height, rng.normal(0, 4), rng.normal(0, 1), rng.uniform(0.05, 0.4)])
    hidden = np.zeros(len(people), int)
    frames = []
    for _ in range(50):
        boxes = []
        for k, person in enumerate(people):
            x, y, height, vx, vy, missed = person
            person[0], person[1] = x + vx, y + vy
            if rng.random() < 0.03:
                person[3] = rng.normal(0, 4)
            if rng.random() < 0.03:
                hidden[k] = rng.integers(2, 36)
            hidden[k] = max(0, hidden[k] - 1)
            if hidden[k] or rng.random() < missed:
                continue
            noise = rng.normal(0, 0.02 * height, 4)
            left, top = x - 0.2 * height + noise[0], y - height / 2 + noise[1]
            boxes.append([left, top, left + 0.4 * height + noise[2], top + height + noise[3], rng.uniform(0.2, 1.0)])
        if rng.random() < 0.3:
            left, top = rng.uniform(0, 600), rng.uniform(0, 300)
            boxes.append([left, top, left + 40, top + 90, rng.uniform(0.2, 0.6)])
        rng.shuffle(boxes)
        frames.append([[round(float(x), 2) for x in box] for box in boxes])
    return frames


if __name__ == "__main__":
    rng = np.random.default_rng(1)
    scenes = [scene(rng) for _ in range(10)]
    cases = [{"frames": frames, "tracks": track(frames)} for frames in scenes]
    text = json.dumps(cases, separators=(",", ":"))
    pathlib.Path(__file__).with_suffix(".json").write_text(text + "\n")
