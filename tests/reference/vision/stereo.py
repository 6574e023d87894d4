"""What OpenCV's semi-global matching makes of real pairs with truth: writes stereo.json, and prints times.

opencv-contrib-python-headless 4.14.0.94, numpy 2.4.6. The folder of the images is the only argument.
"""

import json
import sys
import time
from pathlib import Path

import cv2
import numpy as np

FOLDER = Path(sys.argv[1])
cv2.setNumThreads(1)


def pairs():
    for name in ("cones", "teddy"):
        folder = FOLDER / "middlebury_2003" / name
        truth = cv2.imread(str(folder / "disp2.pgm"), 0).astype(np.float32) / 4
        truth[truth == 0] = np.nan
        yield name, 64, [cv2.imread(str(folder / f"im{i}.png"), 0) for i in (2, 6)], truth
    folder = FOLDER / "middlebury_motorcycle"
    truth = np.load(folder / "motorcycle_disp.npz")["arr_0"].astype(np.float32)
    truth[~np.isfinite(truth)] = np.nan
    images = [cv2.imread(str(folder / f"motorcycle_{side}.png"), 0) for side in ("left", "right")]
    yield "motorcycle", 80, images, truth


def figures(found, truth):
    known = np.isfinite(truth)
    told = known & np.isfinite(found)
    error = np.abs(found - truth)[told]
    return {
        "density": float(told.sum() / known.sum()),
        "bad_2px": float((error > 2).mean()),
        "median_px": float(np.median(error)),
    }


modes = {"3way": cv2.STEREO_SGBM_MODE_SGBM_3WAY, "sgbm": cv2.STEREO_SGBM_MODE_SGBM, "hh": cv2.STEREO_SGBM_MODE_HH}
cases = []
for name, count, (left, right), truth in pairs():
    case = {"pair": name, "disparities": count}
    for mode, number in modes.items():
        matcher = cv2.StereoSGBM_create(
            0, count, 5, P1=8 * 25, P2=32 * 25, disp12MaxDiff=1, uniquenessRatio=10, speckleWindowSize=100,
            speckleRange=2, mode=number,
        )
        times = []
        for _ in range(15):
            began = time.perf_counter()
            raw = matcher.compute(left, right)
            times.append(time.perf_counter() - began)
        found = raw.astype(np.float32) / 16
        found[raw < 0] = np.nan
        case[mode] = figures(found, truth)
        print(f"{name} {mode}: {1e3 * min(times):.1f} ms {case[mode]}")
    cases.append(case)

Path(__file__).with_suffix(".json").write_text(json.dumps(cases, indent=1) + "\n")
