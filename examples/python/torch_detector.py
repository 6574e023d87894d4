"""The same place for a network of PyTorch: the image goes to it without a copy. Its weights are drawn, so what it says is
noise; put a trained one in its place."""

import sys

import swerve
from swerve.messages import ActorKind, DetectedBox, Detections, Extent, Image, Pose2

try:
    import torch
except ImportError:
    print("skipped: PyTorch is not installed")
    sys.exit(0)


class Network(torch.nn.Module):
    """How much of each of a grid of places ahead looks like something."""

    def __init__(self) -> None:
        super().__init__()
        torch.manual_seed(1)
        self.layers = torch.nn.Sequential(
            torch.nn.Conv2d(3, 8, 5, stride=4), torch.nn.ReLU(), torch.nn.Conv2d(8, 1, 3), torch.nn.AdaptiveAvgPool2d((4, 8))
        )

    def forward(self, pixels: torch.Tensor) -> torch.Tensor:
        return torch.sigmoid(self.layers(pixels.permute(2, 0, 1)[None].float() / 255))[0, 0]


class Detector(swerve.Operator):
    inputs = {"image": Image}
    outputs = {"boxes": Detections}

    def __init__(self) -> None:
        self.network = Network().eval()

    @torch.inference_mode()
    def step(self, frame: swerve.Frame) -> Detections:
        image: Image = frame["image"]
        # The memory is the sensor's: PyTorch warns that it cannot be written to, and nobody here does.
        scores = self.network(torch.from_numpy(image.pixels))
        boxes = [
            DetectedBox(ActorKind.CAR, float(score), Pose2(10.0 * (4 - row), 2.0 * (4 - column), 0.0), 0.0, Extent(4.5, 1.9, 1.5), None)
            for row, line in enumerate(scores)
            for column, score in enumerate(line)
            if score > 0.6
        ]
        return Detections(image.stamp, sorted(boxes, key=lambda box: -box.score))


if __name__ == "__main__":
    config = {"camera": {"front": {"width_px": 320, "height_px": 160, "period_ms": 500}}, "log": {"sensors": ["front"]}}
    images = swerve.run("lane", config, streams=["front.rgb"]).streams["front.rgb"]
    detector = Detector()
    for image in images:
        found = detector.step(swerve.Frame("detector", image.stamp, image.stamp, None, {"image": [(None, image)]}))
        print(f"{image.stamp * 1e-9:5.2f} s: {len(found.boxes)} boxes")
