"""Processor time of small_gicp for what `--bench localization` measures, one thread: python speed.py FOLDER

FOLDER is the one of the registration pair. Prints a line each: what, then the median of the milliseconds. small_gicp 1.0.1.
"""

import sys
import time
from pathlib import Path

import numpy as np
import small_gicp

THIN_M = 0.25
VOXEL_M = 1.0


def cloud(name):
    data = (Path(sys.argv[1]) / name).read_bytes()
    begin = data.index(b"end_header\n") + len(b"end_header\n")
    # x, y, z and intensity
    return np.frombuffer(data[begin:], dtype="<f4").reshape(-1, 4)[:, :3].astype(np.float64)


def prepared(points):
    return small_gicp.preprocess_points(points, downsampling_resolution=THIN_M, num_threads=1)


def voxels(points):
    voxel_map = small_gicp.GaussianVoxelMap(VOXEL_M)
    voxel_map.insert(points)
    return voxel_map


def measure(name, work, rounds=15):
    times = []
    for _ in range(rounds):
        began = time.process_time()
        work()
        times.append(1e3 * (time.process_time() - began))
    print(name, np.median(times))


source, target = cloud("source.ply"), cloud("target.ply")
thin, (thin_target, tree) = prepared(source)[0], prepared(target)
voxel_map = voxels(thin_target)


def vgicp(to, scan):
    return small_gicp.align(to, scan, num_threads=1, max_correspondence_distance=1.0)


def all_in():
    scan = prepared(source)[0]
    return vgicp(voxels(prepared(target)[0]), scan)


measure("vgicp", lambda: vgicp(voxel_map, thin))
measure("vgicp_all_in", all_in)
measure(
    "gicp",
    lambda: small_gicp.align(
        thin_target, thin, tree, registration_type="GICP", num_threads=1, max_correspondence_distance=1.0
    ),
)
