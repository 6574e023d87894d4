"""Frames of a video as raw RGB, by OpenCV 4.14: python frames.py VIDEO FIRST STEP COUNT OUT

Prints width and height; OUT gets NUMBER.rgb of each frame, counted from 1.
"""

import sys

import cv2

video, first, step, count, out = sys.argv[1], *map(int, sys.argv[2:5]), sys.argv[5]
capture = cv2.VideoCapture(video)
wanted = {first + step * k for k in range(count)}
for number in range(1, max(wanted) + 1):
    good, frame = capture.read()
    assert good, f"{video} ends before frame {number}"
    if number in wanted:
        cv2.cvtColor(frame, cv2.COLOR_BGR2RGB).tofile(f"{out}/{number}.rgb")
print(frame.shape[1], frame.shape[0])
