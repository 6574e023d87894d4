"""A network in ONNX form as a detector of camera images, with boxes put on flat ground.

`detector.onnx` beside this file is a YOLO as `yolo export format=onnx` writes it: one input of 1 x 3 x height x width,
0 to 1, and one output of 1 x (4 + 80) x candidates, with the centre, the size and COCO's classes.
"""

from pathlib import Path

import numpy as np

import swerve
from swerve.messages import ActorKind, DetectedBox, Detections, Extent, Image, Pose2

try:
    import onnxruntime
except ImportError as error:
    raise ImportError("onnx_detector.py needs ONNX Runtime: pip install onnxruntime") from error

MODEL = Path(__file__).with_name("detector.onnx")
SCORE_MIN, OVERLAP_MAX = 0.3, 0.5
# COCO's classes, with usual lengths, widths and heights.
KINDS = {
    0: (ActorKind.PEDESTRIAN, Extent(0.5, 0.5, 1.75)),
    1: (ActorKind.CYCLIST, Extent(1.8, 0.6, 1.75)),
    2: (ActorKind.CAR, Extent(4.5, 1.9, 1.5)),
    3: (ActorKind.MOTORCYCLE, Extent(2.2, 0.8, 1.5)),
    7: (ActorKind.TRUCK, Extent(8.0, 2.5, 3.2)),
}


class Detector(swerve.Operator):
    inputs = {"image": Image}
    outputs = {"boxes": Detections}

    def __init__(self) -> None:
        if not MODEL.exists():
            raise FileNotFoundError(f"expected a network at {MODEL}, such as from `yolo export model=yolo11n.pt format=onnx`")
        self.network = onnxruntime.InferenceSession(str(MODEL), providers=["CPUExecutionProvider"])
        self.input = self.network.get_inputs()[0]

    def step(self, frame: swerve.Frame) -> Detections:
        image: Image = frame["image"]
        height, width = self.input.shape[2:]
        scale = min(width / image.width_px, height / image.height_px)
        [candidates] = self.network.run(None, {self.input.name: letterboxed(image.pixels, height, width, scale)})
        columns = candidates[0]
        known = columns[[4 + kind for kind in KINDS]]
        best = known.argmax(axis=0)
        scores = known.max(axis=0)
        order = [k for k in np.argsort(-scores, kind="stable") if scores[k] >= SCORE_MIN]
        centre, size = columns[:2] / scale, columns[2:4] / scale
        edges = np.concatenate([centre - size / 2, centre + size / 2])
        kept: list[int] = []
        for k in order:
            if all(best[k] != best[other] or overlap(edges[:, k], edges[:, other]) < OVERLAP_MAX for other in kept):
                kept.append(k)
        placed = [on_ground(image, edges[:, k], list(KINDS)[best[k]], float(scores[k])) for k in kept]
        return Detections(image.stamp, [box for box in placed if box is not None])


def letterboxed(pixels: np.ndarray, height: int, width: int, scale: float) -> np.ndarray:
    """The image scaled to fit, at the top left of a grey one."""
    into = np.full((1, 3, height, width), 114 / 255, np.float32)
    rows = np.arange(int(pixels.shape[0] * scale)) / scale
    columns = np.arange(int(pixels.shape[1] * scale)) / scale
    scaled = pixels[rows.astype(int)][:, columns.astype(int)]
    into[0, :, : len(rows), : len(columns)] = scaled.transpose(2, 0, 1) / np.float32(255)
    return into


def overlap(a: np.ndarray, b: np.ndarray) -> float:
    sides = np.maximum(np.minimum(a[2:], b[2:]) - np.maximum(a[:2], b[:2]), 0)
    area = [float(np.prod(one[2:] - one[:2])) for one in (a, b)]
    return float(np.prod(sides)) / max(sum(area) - float(np.prod(sides)), 1e-9)


def on_ground(image: Image, edges: np.ndarray, kind: int, score: float) -> DetectedBox | None:
    """The object whose lower edge is where its box ends; `None` above the horizon."""
    lens, ego_from_camera = image.camera.intrinsics, image.camera.ego_from_camera.matrix()
    foot = np.array([((edges[0] + edges[2]) / 2 - lens.cx_px) / lens.fx_px, (edges[3] - lens.cy_px) / lens.fy_px, 1.0])
    ray, origin = ego_from_camera[:3, :3] @ foot, ego_from_camera[:3, 3]
    if ray[2] > -1e-3:
        return None
    x, y, _ = origin - origin[2] / ray[2] * ray
    actor, extent = KINDS[kind]
    return DetectedBox(actor, score, Pose2(float(x) + extent.length_m / 2, float(y), 0.0), 0.0, extent, None)
