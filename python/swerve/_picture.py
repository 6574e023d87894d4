"""Pictures of drives from above, for `render_mode="rgb_array"`."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .messages import ActorKind

#: Rows and columns, and metres a pixel; the ego is a quarter of the width from the left edge and drives to the right.
ROWS, COLUMNS, METRES = 240, 640, 0.2
GROUND, ROAD, LINE, EGO = (197, 204, 190), (92, 96, 104), (232, 232, 226), (33, 102, 172)
COLORS = {ActorKind.PEDESTRIAN: (214, 96, 77), ActorKind.CYCLIST: (244, 165, 66)}
OTHER = (250, 214, 120)
PERSON_LEAST_M = 0.8


def picture(bodies: Sequence[Sequence[float]], route: Sequence[Sequence[float]]) -> NDArray[np.uint8]:
    """The surroundings of the ego, an array of rows, columns and three colours.

    `bodies` are kind, pose of the middle, length and width, the ego's first; `route` is x, y, heading and the distances to
    the left and right border.
    """
    image = np.empty((ROWS, COLUMNS, 3), np.uint8)
    image[:] = GROUND
    _, x_m, y_m, heading_rad, *_ = bodies[0]
    view = _View(x_m, y_m, heading_rad)
    if len(route) > 1:
        line = np.array(route)
        left = view.pixels(line[:, 0] - line[:, 3] * np.sin(line[:, 2]), line[:, 1] + line[:, 3] * np.cos(line[:, 2]))
        right = view.pixels(line[:, 0] + line[:, 4] * np.sin(line[:, 2]), line[:, 1] - line[:, 4] * np.cos(line[:, 2]))
        for k in range(len(line) - 1):
            _fill(image, np.stack([left[k], left[k + 1], right[k + 1], right[k]]), ROAD)
        middle = view.pixels(line[:, 0], line[:, 1])
        for column, row in np.floor(middle[:: 4 if len(middle) > 4 else 1]).astype(int):
            if 0 <= row < ROWS and 0 <= column < COLUMNS:
                image[max(row - 1, 0) : row + 1, max(column - 1, 0) : column + 1] = LINE
    kinds = list(ActorKind)
    for kind, x, y, heading, length_m, width_m in reversed(list(bodies)):
        known = 0 <= int(kind) < len(kinds)
        color = EGO if kind < 0 else COLORS.get(kinds[int(kind)], OTHER) if known else OTHER
        size = np.maximum([length_m, width_m], PERSON_LEAST_M) / 2
        along, across = np.array([1, 1, -1, -1]) * size[0], np.array([1, -1, -1, 1]) * size[1]
        cos, sin = np.cos(heading), np.sin(heading)
        _fill(image, view.pixels(x + along * cos - across * sin, y + along * sin + across * cos), color)
    return image


class _View:
    """From the map to columns and rows of the picture."""

    def __init__(self, x_m: float, y_m: float, heading_rad: float) -> None:
        self._x_m, self._y_m = x_m, y_m
        self._cos, self._sin = np.cos(heading_rad), np.sin(heading_rad)

    def pixels(self, x_m: NDArray[np.float64], y_m: NDArray[np.float64]) -> NDArray[np.float64]:
        """Columns and rows, (points, 2)."""
        dx, dy = x_m - self._x_m, y_m - self._y_m
        ahead, left = dx * self._cos + dy * self._sin, dy * self._cos - dx * self._sin
        return np.stack([COLUMNS / 4 + ahead / METRES, ROWS / 2 - left / METRES], axis=-1)


def _fill(image: NDArray[np.uint8], corners: NDArray[np.float64], color: tuple[int, int, int]) -> None:
    """Fills a convex polygon of columns and rows."""
    low = np.maximum(np.floor(corners.min(axis=0)).astype(int), 0)
    high = np.minimum(np.ceil(corners.max(axis=0)).astype(int) + 1, [COLUMNS, ROWS])
    if (low >= high).any():
        return
    columns, rows = np.meshgrid(np.arange(low[0], high[0]) + 0.5, np.arange(low[1], high[1]) + 0.5)
    sides = []
    for (x0, y0), (x1, y1) in zip(corners, np.roll(corners, -1, axis=0)):
        sides.append((x1 - x0) * (rows - y0) - (y1 - y0) * (columns - x0))
    inside = np.all([side >= 0 for side in sides], axis=0) | np.all([side <= 0 for side in sides], axis=0)
    image[low[1] : high[1], low[0] : high[0]][inside] = color
