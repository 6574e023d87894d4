"""Published detectors as files of weights of `swerve-vision`.

  python acf_models.py MODELS OUT

MODELS is the folder `detector/models` of pdollar/toolbox (BSD-2, external/bsd.txt there); OUT gets acf_inria.weights and
ldcf_inria.weights. scipy 1.15 or later reads the models, xxhash 3.5 or later makes the digests. Features there count
column by column; trees of unequal depth are filled up with nodes whose two sides are the same.
"""

import struct
import sys

import numpy as np
import scipy.io
import xxhash


def varint(n):
    out = bytearray()
    while n > 127:
        out.append(n & 127 | 128)
        n >>= 7
    return bytes(out + bytes([n]))


def text(s):
    return varint(len(s.encode())) + s.encode()


def zigzag(n):
    return varint(n << 1 if n >= 0 else (-n << 1) - 1)


def floats(numbers, kind="f"):
    return b"".join(struct.pack("<" + kind, x) for x in numbers)


def vector(items, each):
    items = list(items)
    return varint(len(items)) + b"".join(each(x) for x in items)


def f32(x):
    return struct.pack("<f", x)


def full(clf, tree, depth, columns, lines):
    """Features, thresholds and leaves of one tree, made full."""
    features, thresholds, leaves = [], [], []
    level = [0]
    for _ in range(depth):
        below = []
        for node in level:
            child = int(clf.child[node, tree])
            f = int(clf.fids[node, tree])
            plane, column, line = f // (columns * lines), f % (columns * lines) // lines, f % lines
            features.append(plane * columns * lines + line * columns + column if child else 0)
            thresholds.append(float(clf.thrs[node, tree]) if child else 0.0)
            below += [child - 1, child] if child else [node, node]
        level = below
    leaves = [float(clf.hs[node, tree]) for node in level]
    return features, thresholds, leaves


def convert(path, source):
    detector = scipy.io.loadmat(path, struct_as_record=False, squeeze_me=True)["detector"]
    opts, clf = detector.opts, detector.clf
    pyramid = opts.pPyramid
    shrink = int(pyramid.pChns.shrink)
    filters = np.asarray(getattr(opts, "filters", []), np.float32)
    cell = shrink * (2 if filters.size else 1)
    lines, columns = (int(n) // cell for n in opts.modelDsPad)
    depth = int(clf.depth.max())
    trees = [full(clf, k, depth, columns, lines) for k in range(clf.fids.shape[1])]
    features, thresholds, leaves = ([x for tree in trees for x in tree[k]] for k in range(3))
    order = filters.transpose(3, 2, 0, 1).ravel() if filters.size else []
    payload = text(source) + varint(shrink) + floats(pyramid.lambdas) + vector(order, f32)
    payload += vector(["pedestrian"], text)
    height, width = (float(n) for n in opts.modelDs)
    model = varint(0) + varint(columns) + varint(lines) + floats([width, height], "d") + floats([1.4, 2.0], "d")
    model += varint(1) + varint(depth) + vector(features, varint) + vector(thresholds, f32) + vector(leaves, f32)
    payload += varint(1) + model
    # Octave, levels of one, stride in cells, trees; the last two as their authors have them, on two sizes.
    all_of_them, own, stride = len(trees), int(pyramid.nPerOct), int(opts.stride) // cell or 1
    rungs = [
        ("half", -1, own, stride, all_of_them),
        ("quick", 0, 4, 2 * stride, all_of_them // 8),
        ("coarse", 0, 4, 2 * stride, all_of_them),
        ("doubled_coarse", 1, 4, 2 * stride, all_of_them),
        ("as_it_is", 0, own, stride, all_of_them),
        ("doubled", 1, own, stride, all_of_them),
    ]
    rung = lambda name, octave, per_octave, stride, asked: (
        text(name) + zigzag(octave) + varint(per_octave) + varint(stride) + varint(asked)
        + f32(float(opts.cascThr)) + varint(1) + b"\0" + varint(0)
    )
    payload += varint(len(rungs)) + b"".join(rung(*r) for r in rungs)
    payload += floats([float(opts.pNms.overlap)], "d") + varint(1)
    digest = struct.pack("<Q", xxhash.xxh3_64_intdigest(payload))
    return b"SWERVDET\x02" + digest + payload


if __name__ == "__main__":
    folder, out = sys.argv[1:]
    for name in ["Acf", "Ldcf"]:
        source = f"pdollar/toolbox detector/models/{name}InriaDetector.mat (BSD-2), by tests/reference/vision/acf_models.py"
        with open(f"{out}/{name.lower()}_inria.weights", "wb") as file:
            file.write(convert(f"{folder}/{name}InriaDetector.mat", source))
