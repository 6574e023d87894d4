"""Trains detectors on the first half of a video and compares them with built-in ones on the second half.

    python own_pictures.py VIDEO LABELS PROGRAM     # vtest.avi and mot15/det/PETS09-S2L1.csv, PROGRAM is swerve

Needs OpenCV. Writes every fifth frame and COCO's labels to out/own_pictures/people, and trains by own_pictures.toml and
by the same recipe with a support vector machine. The labels are boxes of another detector, not drawn by people. Prints
AP50 (overlap of one half) on the second half, by `swerve eval`.
"""

import json
import subprocess
import sys
from pathlib import Path

import cv2

VIDEO, LABELS, PROGRAM = sys.argv[1:4]
OUT, EVERY = Path("out/own_pictures"), 5
RECIPE = Path(__file__).with_name("own_pictures.toml").read_text()
TREES = "method.trees = { depth = 3, rounds = [64, 256, 512], one_of = 8 }"
BUILT_IN = {"acf_inria": ["as_it_is", "doubled"], "ldcf_inria": ["doubled"], "hog_street": ["full"], "street": ["full"]}


def frames():
    folder, images, number = OUT / "people", [], 0
    folder.mkdir(parents=True, exist_ok=True)
    capture = cv2.VideoCapture(VIDEO)
    while True:
        good, frame = capture.read()
        if not good:
            break
        number += 1
        if number % EVERY == 0:
            name = f"{number:06}.jpg"
            cv2.imwrite(str(folder / name), frame, [cv2.IMWRITE_JPEG_QUALITY, 95])
            images.append({"id": number, "file_name": name, "width": frame.shape[1], "height": frame.shape[0]})
    boxes = []
    for line in Path(LABELS).read_text().splitlines():
        if line[:1].isdigit() and int(line.split(",")[0]) % EVERY == 0:
            number, *bbox = [float(word) for word in line.split(",")[:5]]
            boxes.append({"id": len(boxes) + 1, "image_id": int(number), "category_id": 1, "bbox": bbox,
                          "area": bbox[2] * bbox[3], "iscrowd": 0})
    labels = {"images": images, "annotations": boxes, "categories": [{"id": 1, "name": "person"}]}
    (folder / "instances.json").write_text(json.dumps(labels))
    held_out = images[round(len(images) / 2):]
    numbers = {image["id"] for image in held_out}
    truth = labels | {"images": held_out, "annotations": [box for box in boxes if box["image_id"] in numbers]}
    (OUT / "truth.json").write_text(json.dumps(truth))
    return held_out


def train(name, text):
    recipe, weights = OUT / f"{name}.toml", OUT / f"{name}.weights"
    recipe.write_text(text)
    call = [PROGRAM, "train", "detector", recipe, "--data", OUT, "--out", weights, "--overwrite", "--threads", "2"]
    print(subprocess.run(call, stdout=subprocess.PIPE, text=True, check=True).stdout, flush=True)
    return weights


def ap50(name, detector, rung, held_out):
    files = {str(OUT / "people" / image["file_name"]): image["id"] for image in held_out}
    call = [PROGRAM, "look", *files, "--detector", detector, "--rung", rung, "--least", "0", "--json"]
    found = [{"image_id": files[line["image"]], "category_id": 1, "bbox": one["box"], "score": one["score"]}
             for line in map(json.loads, subprocess.run(call, capture_output=True, text=True, check=True).stdout.splitlines())
             for one in line["objects"] if one["class"] in ("pedestrian", "person")]
    results = OUT / f"{name}_{rung}.json"
    results.write_text(json.dumps(found))
    call = [PROGRAM, "eval", "detection", OUT / "truth.json", results, "--format", "coco", "--json"]
    metrics = json.loads(subprocess.run(call, capture_output=True, text=True, check=True).stdout)["classes"]["person"]
    return f"{name}, {rung}: {metrics['ap50']:.3f}"


held_out = frames()
for name, rungs in BUILT_IN.items():
    for rung in rungs:
        print(ap50(name, name, rung, held_out), flush=True)
for name, method in {"trees": TREES, "svm": "method.svm = { cost = 0.1, rounds = 3 }"}.items():
    weights = train(name, RECIPE.replace(TREES, method))
    for rung in ("coarse", "as_it_is"):
        print(ap50(name, weights, rung, held_out), flush=True)
