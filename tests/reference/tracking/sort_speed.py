"""Frames a second of the SORT of its authors, on one thread: what `cargo bench --bench tracking` holds ours against.

sort-tracker-py 1.0.2 (their program as a package; GPL-3, called and not copied), filterpy 2.0.0, NumPy 2.4.1, SciPy 1.17. The
folder of the detections (a file a sequence, rows of frame,left,top,width,height,score) is the only argument.
"""
import os

# One thread: before NumPy is loaded.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import sys
import time
from pathlib import Path

import numpy as np
from sort_tracker import Sort


def frames(path):
    rows = np.loadtxt(path, delimiter=",", ndmin=2)
    rows[:, 3:5] += rows[:, 1:3]
    return [rows[rows[:, 0] == frame, 1:6] for frame in range(1, int(rows[:, 0].max()) + 1)]


sequences = [frames(path) for path in sorted(Path(sys.argv[1]).glob("*.csv"))]
count, best = sum(map(len, sequences)), float("inf")
for _ in range(2):
    start = time.perf_counter()
    for sequence in sequences:
        tracker = Sort(max_age=1, min_hits=3, iou_threshold=0.3)
        for boxes in sequence:
            tracker.update(boxes)
    best = min(best, time.perf_counter() - start)
print(count / best)
