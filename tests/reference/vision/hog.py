"""What OpenCV's default people detector finds in frames of a video: python hog.py VIDEO OUT

OUT/hog_people.json gets the boxes (left, top, width, height) and sums of every hit, ungrouped and sorted, on one thread;
OUT/people_hog.f32 gets the detector's 3,780 weights and its offset. OpenCV 4.14.0 (opencv-contrib-python-headless
4.14.0.94). The time that OpenCV takes for a frame goes to standard error.
"""

import json
import sys
import time

import cv2
import numpy as np

assert cv2.__version__ == "4.14.0", cv2.__version__
video, out = sys.argv[1:]
cv2.setNumThreads(1)
hog = cv2.HOGDescriptor()
people = cv2.HOGDescriptor_getDefaultPeopleDetector()
hog.setSVMDetector(people)
np.asarray(people, "<f4").tofile(f"{out}/people_hog.f32")
capture = cv2.VideoCapture(video)
frames, seconds = [], []
for number in range(1, 786):
    frame = capture.read()[1]
    if (number - 5) % 78 == 0:
        start = time.process_time()
        boxes, sums = hog.detectMultiScale(frame, winStride=(8, 8), padding=(8, 8), scale=1.05, groupThreshold=0)
        seconds.append(time.process_time() - start)
        found = sorted([*map(int, box), round(float(s), 5)] for box, s in zip(boxes, np.ravel(sums)))
        frames.append({"frame": number, "found": found})
json.dump(frames, open(f"{out}/hog_people.json", "w"), separators=(",", ":"))
print("ms a frame, least and median:", min(seconds) * 1e3, np.median(seconds) * 1e3, file=sys.stderr)
