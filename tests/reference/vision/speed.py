"""Processor time of OpenCV for what `--bench vision` measures, one thread: python speed.py FOLDER OUT

FOLDER is the one of the images; OUT gets a frame of vtest.avi, 768 x 576, as raw RGB. Prints a line each: what, then the median of the milliseconds. OpenCV 4.14.0
(opencv-contrib-python-headless 4.14.0.94).
"""

import sys
import time
from pathlib import Path

import cv2
import numpy as np

FOLDER = Path(sys.argv[1])
cv2.setNumThreads(1)


def measure(name, work, rounds=15):
    times = []
    for _ in range(rounds):
        began = time.process_time()
        work()
        times.append(1e3 * (time.process_time() - began))
    print(name, np.median(times))


middlebury = [FOLDER / "middlebury_2003" / name / "im{}.png" for name in ("cones", "teddy")]
for name, count, path, sides in (
    ("cones", 64, middlebury[0], (2, 6)),
    ("teddy", 64, middlebury[1], (2, 6)),
    ("motorcycle", 80, FOLDER / "middlebury_motorcycle" / "motorcycle_{}.png", ("left", "right")),
):
    left, right = (cv2.imread(str(path).format(side), 0) for side in sides)
    matcher = cv2.StereoSGBM_create(
        0, count, 5, P1=8 * 25, P2=32 * 25, disp12MaxDiff=1, uniquenessRatio=10, speckleWindowSize=100,
        speckleRange=2, mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )
    measure(name, lambda: matcher.compute(left, right))

people = cv2.HOGDescriptor()
people.setSVMDetector(cv2.HOGDescriptor_getDefaultPeopleDetector())
frame = cv2.VideoCapture(str(FOLDER / "opencv_samples" / "vtest.avi")).read()[1]
cv2.cvtColor(frame, cv2.COLOR_BGR2RGB).tofile(sys.argv[2])
options = {"winStride": (8, 8), "padding": (8, 8), "scale": 1.05, "groupThreshold": 0}
measure("hog", lambda: people.detectMultiScale(frame, **options))
