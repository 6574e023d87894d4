"""A detector without weights: what stands up from the ground in an image of depths, as boxes.

Run by itself it is shown the images of a drive, and then drives: there it is an operator, in a process of its own.
"""

from pathlib import Path

import numpy as np

import swerve
from swerve.messages import ActorKind, DetectedBox, Detections, Extent, Image, Pose2


class Detector(swerve.Operator):
    inputs = {"depth": Image}
    outputs = {"boxes": Detections}

    def step(self, frame: swerve.Frame) -> Detections:
        image: Image = frame["depth"]
        lens, ego_from_camera = image.camera.intrinsics, image.camera.ego_from_camera.matrix()
        row, column = np.mgrid[: image.height_px, : image.width_px] + 0.5
        z = image.pixels[np.isfinite(image.pixels)]
        x = (column[np.isfinite(image.pixels)] - lens.cx_px) / lens.fx_px * z
        y = (row[np.isfinite(image.pixels)] - lens.cy_px) / lens.fy_px * z
        points = (ego_from_camera @ np.stack([x, y, z, np.ones_like(z)])).T[:, :3]
        solid = points[(points[:, 2] > 0.4) & (points[:, 2] < 2.5) & (abs(points[:, 1]) < 4.0)]
        solid = solid[np.argsort(solid[:, 0])]
        groups = np.split(solid, np.flatnonzero(np.diff(solid[:, 0]) > 1.5) + 1)
        return Detections(image.stamp, [box(group) for group in groups if len(group) > 20])


def box(points: np.ndarray) -> DetectedBox:
    low, high = points.min(axis=0), points.max(axis=0)
    (x, y, _), (length, width, _) = (low + high) / 2, high - low
    kind = ActorKind.PEDESTRIAN if width < 1.0 else ActorKind.CAR
    pose, extent = Pose2(float(x), float(y), 0.0), Extent(float(length), float(width), float(high[2]))
    return DetectedBox(kind, min(1.0, len(points) / 200), pose, 0.0, extent, None)


if __name__ == "__main__":
    camera = {"width_px": 320, "height_px": 160, "period_ms": 200, "outputs": ["depth"]}
    config = {"camera": {"front": camera}, "log": {"sensors": ["front"]}}
    images = swerve.run("person_behind_truck", config, streams=["front.depth"]).streams["front.depth"]
    detector = Detector()
    for image in images:
        found = detector.step(swerve.Frame("detector", image.stamp, image.stamp, None, {"depth": [(None, image)]}))
        told = ", ".join(f"{b.kind.value} {b.pose.x_m:.1f} m ahead, {b.pose.y_m:.1f} m left" for b in found.boxes)
        print(f"{image.stamp * 1e-9:5.2f} s: {told or 'nothing'}")
    # As `swerve run person_behind_truck -c detector.toml` does. The file names the class above, wherever this is called.
    result = swerve.run("person_behind_truck", Path(__file__).with_name("detector.toml"), allow_code=True)
    print(f"{result.verdict}, digest {result.digest}")
