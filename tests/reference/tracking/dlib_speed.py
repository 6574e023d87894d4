"""Milliseconds of processor time that dlib's correlation tracker takes for a frame of its example video, one thread.

python dlib_speed.py FOLDER, that of the frames. The median of five passes; dlib-bin 20.0.1.post1.
"""

import statistics
import sys
import time
from pathlib import Path

import dlib

images = [dlib.load_rgb_image(str(path)) for path in sorted(Path(sys.argv[1]).glob("*.jpg"))]
passes = []
for _ in range(5):
    tracker = dlib.correlation_tracker()
    tracker.start_track(images[0], dlib.rectangle(74, 67, 112, 153))
    began = time.process_time()
    for image in images[1:]:
        tracker.update(image)
    passes.append(1e3 * (time.process_time() - began) / (len(images) - 1))
print(statistics.median(passes))
