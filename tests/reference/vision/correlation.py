"""Boxes of dlib's correlation tracker on its 151 example frames: writes correlation.json (left, top, right, bottom).

dlib-bin 20.0.1.post1. The folder of the frames is the only argument.
"""

import json
import sys
from pathlib import Path

import dlib

tracker = dlib.correlation_tracker()
boxes = []
for at, path in enumerate(sorted(Path(sys.argv[1]).glob("*.jpg"))):
    image = dlib.load_rgb_image(str(path))
    if at == 0:
        tracker.start_track(image, dlib.rectangle(74, 67, 112, 153))
    else:
        tracker.update(image)
    box = tracker.get_position()
    boxes.append([round(side, 2) for side in (box.left(), box.top(), box.right(), box.bottom())])
Path(__file__).with_name("correlation.json").write_text(json.dumps(boxes) + "\n")
