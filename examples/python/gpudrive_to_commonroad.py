"""Converts a scene of the Waymo Open Motion Dataset, as GPUDrive's JSON, to CommonRoad 2020a; standard library only.

    python gpudrive_to_commonroad.py SCENE.json OUT.xml [--ego ID] [--degrees]

The ego is the recording vehicle (`metadata.sdc_track_index`), or the object with the given id. Older files have neither ids nor
the recording vehicle: an id is the place in the list, from 0 on.

The format has the centre lines of lanes only: they become `LANE_WIDTH_M` wide, a lane follows where its line begins at the end of
another, and lanes of one direction that begin and end beside each other are neighbours. Light states, stop signs, lines and edges
are left out.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from commonroad_xml import Lane, Point, State, Track, Wrong, along, crosswalk, document, finite, json_of, points, written

LANE_WIDTH_M, JOINT_M, JOINT_RAD = 3.5, 0.5, 0.6
"""Width of lanes; largest gap and turn between a lane and the next."""
BESIDE_M, ABREAST_M, PARALLEL_RAD = (2.5, 5.0), 5.0, 0.2
"""Distance of neighbours from each other; how far the one may begin or end before the other; largest turn between them."""
KINDS = {"vehicle": "car", "pedestrian": "pedestrian", "cyclist": "bicycle", "other": "unknown", "unset": "unknown"}
BIKE_LANE = 3
"""`map_element_id` of lanes for bicycles."""


def track_of(value: Any, where: str, number: int, degrees: bool) -> Track:
    """Road user of the element of this number in `objects`, which is its id in older files."""
    if not isinstance(value, dict):
        raise Wrong(f"{where}: expected an object, found {value!r:.40}")
    missing = [key for key in ("type", "length", "width", "position", "heading", "velocity", "valid") if key not in value]
    if missing:
        raise Wrong(f"{where}: expected the key `{missing[0]}`")
    kind = KINDS.get(str(value["type"]))
    if kind is None:
        raise Wrong(f"{where}.type: expected one of {', '.join(KINDS)}, found {value['type']!r:.40}")
    lists = [value[key] for key in ("valid", "position", "heading", "velocity")]
    if not all(isinstance(one, list) and len(one) == len(lists[0]) for one in lists):
        raise Wrong(f"{where}: expected `position`, `heading`, `velocity` and `valid` of the same length")
    states = {}
    for step, (valid, at, heading, velocity) in enumerate(zip(*lists)):
        if not valid:
            continue
        [(x, y)] = points([at], f"{where}.position.{step}", 1)
        [(vx, vy)] = points([velocity], f"{where}.velocity.{step}", 1)
        angle = finite(heading, f"{where}.heading[{step}]")
        angle = math.radians(angle) if degrees else angle
        if abs(angle) > 2.0 * math.pi:
            raise Wrong(f"{where}.heading[{step}]: expected radians, found {angle}; older files have degrees: see `--degrees`")
        states[step] = State(x, y, angle, along(vx, vy, angle))
    length, width = (finite(value[key], f"{where}.{key}") for key in ("length", "width"))
    if states and not (0.0 < length < 100.0 and 0.0 < width < 100.0):
        raise Wrong(f"{where}: expected length and width up to 100 m, found {length} and {width}")
    return Track(str(value.get("id", number)), kind, length, width, states)


def heading(line: Sequence[Point], k: int) -> float:
    """Direction of a line at its begin (0) or its end (-1)."""
    (x0, y0), (x1, y1) = (line[0], line[1]) if k == 0 else (line[-2], line[-1])
    return math.atan2(y1 - y0, x1 - x0)


def turn(from_rad: float, to_rad: float) -> float:
    return abs(math.remainder(to_rad - from_rad, 2.0 * math.pi))


def moved(line: Sequence[Point], left_m: float) -> list[Point]:
    """A line beside another; at a vertex it has the mean direction of both sides."""
    found = []
    for k, (x, y) in enumerate(line):
        (x0, y0), (x1, y1) = line[max(k - 1, 0)], line[min(k + 1, len(line) - 1)]
        length = math.hypot(x1 - x0, y1 - y0)
        found.append((x - left_m * (y1 - y0) / length, y + left_m * (x1 - x0) / length) if length > 0.0 else (x, y))
    return found


def side(of: Sequence[Point], other: Sequence[Point]) -> str | None:
    """`Left` or `Right` if the other line runs beside this one, from begin to end and in its direction."""
    offsets = []
    for k in (0, -1):
        at, angle = of[k], heading(of, k)
        dx, dy = other[k][0] - at[0], other[k][1] - at[1]
        left_m = dy * math.cos(angle) - dx * math.sin(angle)
        if abs(dx * math.cos(angle) + dy * math.sin(angle)) > ABREAST_M or turn(angle, heading(other, k)) > PARALLEL_RAD:
            return None
        offsets.append(left_m)
    if not all(BESIDE_M[0] <= abs(one) <= BESIDE_M[1] for one in offsets) or offsets[0] * offsets[1] < 0.0:
        return None
    return "Left" if offsets[0] > 0.0 else "Right"


def linked(lines: dict[str, list[Point]], lanes: dict[str, Lane]) -> None:
    """Adds the lanes after and beside each lane, and joins the bounds of lanes that follow each other."""
    nearest: dict[tuple[str, str], float] = {}
    for name, line in lines.items():
        for other, to in lines.items():
            if other == name or lanes[other].kinds != lanes[name].kinds:
                continue
            if math.dist(line[-1], to[0]) <= JOINT_M and turn(heading(line, -1), heading(to, 0)) <= JOINT_RAD:
                lanes[name].successors.append(other)
            beside = side(line, to)
            distance_m = math.dist(line[0], to[0])
            if beside and distance_m < nearest.get((name, beside), math.inf):
                nearest[name, beside] = distance_m
                lanes[name].beside[beside] = (other, False)
    for name, lane in lanes.items():
        if lane.successors:
            # The road has no gap at the joint.
            after = lanes[min(lane.successors, key=lambda one: turn(heading(lines[name], -1), heading(lines[one], 0)))]
            lane.left = [*lane.left[:-1], after.left[0]]
            lane.right = [*lane.right[:-1], after.right[0]]


def lanes_of(roads: list[Any], where: str) -> dict[str, Lane]:
    """Lanes and crossings of `roads`."""
    lanes, lines = {}, {}
    for k, road in enumerate(roads):
        if not isinstance(road, dict) or "type" not in road or "geometry" not in road:
            raise Wrong(f"{where}[{k}]: expected the keys `type` and `geometry`")
        if road["type"] == "crosswalk":
            corners = points(road["geometry"], f"{where}[{k}].geometry", 3)
            if len(corners) > 4 and corners[0] == corners[-1]:
                corners.pop()
            if len(corners) == 4:
                a, b, c, d = corners
                is_along = math.dist(a, b) + math.dist(c, d) >= math.dist(b, c) + math.dist(d, a)
                lanes[f"crossing {k}"] = crosswalk(*(([a, b], [d, c]) if is_along else ([b, c], [a, d])))
        if road["type"] != "lane":
            continue
        line = points(road["geometry"], f"{where}[{k}].geometry", 1)
        line = [at for i, at in enumerate(line) if i == 0 or at != line[i - 1]]
        if len(line) < 2:
            continue
        name, is_bike = f"lane {k}", road.get("map_element_id") == BIKE_LANE
        lines[name] = line
        left, right = (moved(line, sign * LANE_WIDTH_M / 2.0) for sign in (1.0, -1.0))
        lanes[name] = Lane(left, right, ["bicycleLane" if is_bike else "urban"])
    linked(lines, lanes)
    return lanes


def converted(path: Path, ego: str | None, degrees: bool) -> str:
    """Text of the file."""
    content = json_of(path)
    if not isinstance(content, dict) or not all(isinstance(content.get(key), list) for key in ("objects", "roads")):
        raise Wrong(f"{path}: expected the lists `objects` and `roads` of a scene of GPUDrive")
    tracks = [track_of(one, f"{path}: objects[{k}]", k, degrees) for k, one in enumerate(content["objects"])]
    if ego is None:
        metadata = content.get("metadata")
        index = metadata.get("sdc_track_index") if isinstance(metadata, dict) else None
        if not isinstance(index, int) or not 0 <= index < len(tracks):
            raise Wrong(f"{path}: expected the index of an object in `metadata.sdc_track_index`, found {index}; see `--ego`")
        ego = tracks[index].name
    name = str(content.get("scenario_id") or content.get("name") or path.stem)
    return document(f"Waymo {name}", lanes_of(content["roads"], f"{path}: roads"), tracks, ego)


def main() -> None:
    parser = argparse.ArgumentParser(description="Converts a scene of GPUDrive (Waymo Open Motion) to CommonRoad 2020a.")
    parser.add_argument("scene", type=Path, metavar="SCENE.json")
    parser.add_argument("out", type=Path, metavar="OUT.xml")
    parser.add_argument("--ego", metavar="ID", help="object that the stack replaces (default: the recording vehicle)")
    parser.add_argument("--degrees", action="store_true", help="headings are in degrees, as in older files")
    asked = parser.parse_args()
    written(lambda: converted(asked.scene, asked.ego, asked.degrees), asked.out)


if __name__ == "__main__":
    main()
