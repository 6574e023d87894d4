"""Converts a scenario of Argoverse 2 motion forecasting to CommonRoad 2020a (`pip install pyarrow`).

    python argoverse_to_commonroad.py SCENARIO.parquet MAP.json OUT.xml [--ego TRACK]

The ego is the recording vehicle (`AV`), or the given track. The format has no sizes: the script takes those that the viewer of
`av2` draws, and typical ones for the rest. Tracks of the type `background` are left out, as are speed limits and lights, which
the format does not have.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from commonroad_xml import Lane, State, Track, Wrong, along, crosswalk, document, finite, json_of, points, readable, written

try:
    import pyarrow.lib
    import pyarrow.parquet
except ImportError:
    raise SystemExit("error: Argoverse 2 has parquet files: expected `pip install pyarrow`") from None

KINDS = {
    "vehicle": ("car", 4.0, 2.0),
    "bus": ("bus", 7.0, 2.1),
    "motorcyclist": ("motorcycle", 2.0, 0.7),
    "cyclist": ("bicycle", 2.0, 0.7),
    "riderless_bicycle": ("bicycle", 2.0, 0.7),
    "pedestrian": ("pedestrian", 0.6, 0.6),
    "static": ("pillar", 0.6, 0.6),
    "construction": ("constructionZone", 0.6, 0.6),
    "unknown": ("unknown", 2.0, 2.0),
}
"""Type of obstacle, length and width by the type of a track."""

COLUMNS = ["scenario_id", "track_id", "object_type", "timestep", "position_x", "position_y", "heading", "velocity_x", "velocity_y"]
STEPS_MAX = 100_000
LANES = {"VEHICLE": "urban", "BIKE": "bicycleLane", "BUS": "busLane"}


def tracks_of(path: Path) -> tuple[str, list[Track]]:
    """Name of the scenario, and its tracks in the order of the file."""
    try:
        table = pyarrow.parquet.read_table(readable(path))
    except pyarrow.lib.ArrowException as error:
        raise Wrong(f"{path}: {str(error).splitlines()[0]}") from None
    missing = [name for name in COLUMNS if name not in table.column_names]
    if missing:
        raise Wrong(f"{path}: expected the column `{missing[0]}` of a motion forecasting scenario")
    rows = zip(*(table.column(name).to_pylist() for name in COLUMNS))
    name, tracks = "", dict[str, Track]()
    for row, (name, track, kind, *numbers) in enumerate(rows):
        step, x, y, heading, vx, vy = (finite(value, f"{path}: row {row}: {key}") for key, value in zip(COLUMNS[3:], numbers))
        if not (step.is_integer() and 0 <= step <= STEPS_MAX):
            raise Wrong(f"{path}: row {row}: timestep: expected a whole number from 0 to {STEPS_MAX}, found {step}")
        if kind == "background":
            continue
        if kind not in KINDS:
            raise Wrong(f"{path}: row {row}: object_type: expected one of {', '.join(KINDS)}, background, found {kind!r}")
        one = tracks.setdefault(str(track), Track(str(track), *KINDS[kind], {}))
        one.states[int(step)] = State(x, y, heading, along(vx, vy, heading))
    return str(name), list(tracks.values())


def mark(kind: str) -> str:
    """Line marking of a bound; lines that are solid on one side only are unknown."""
    if kind.startswith(("DASHED", "DOUBLE_DASH")):
        return "dashed"
    if kind.startswith(("SOLID_DASH", "DASH_SOLID")):
        return "unknown"
    return "solid" if "SOLID" in kind else "no_marking" if kind == "NONE" else "unknown"


def lanes_of(path: Path) -> dict[str, Lane]:
    """Lanes and crossings of a map."""
    content = json_of(path)
    if not isinstance(content, dict) or not isinstance(content.get("lane_segments"), dict):
        raise Wrong(f"{path}: expected the key `lane_segments` of a map of Argoverse 2")
    segments: dict[str, Any] = content["lane_segments"]
    lanes = {}
    for name, segment in segments.items():
        where = f"{path}: lane_segments.{name}"
        try:
            kinds = [LANES.get(segment["lane_type"], "unknown")] + ["intersection"] * bool(segment["is_intersection"])
            bounds = {side: points(segment[f"{side}_lane_boundary"], f"{where}.{side}_lane_boundary") for side in ("left", "right")}
            marks = {side: mark(str(segment[f"{side}_lane_mark_type"])) for side in ("left", "right")}
            after = [str(one) for one in segment["successors"]]
            beside = {}
            for side in ("left", "right"):
                one = segments.get(str(segment[f"{side}_neighbor_id"]))
                if one is not None:
                    opposite = str(one[f"{side}_neighbor_id"]) == name
                    beside[side.title()] = (str(segment[f"{side}_neighbor_id"]), opposite)
        except KeyError as error:
            raise Wrong(f"{where}: expected the key {error} of a lane segment") from None
        except TypeError:
            raise Wrong(f"{where}: expected a lane segment, found {segment!r:.40}") from None
        lanes[name] = Lane(bounds["left"], bounds["right"], kinds, after, beside, marks)
    crossings = content.get("pedestrian_crossings") or {}
    if not isinstance(crossings, dict) or not all(isinstance(one, dict) for one in crossings.values()):
        raise Wrong(f"{path}: pedestrian_crossings: expected crossings by their identity")
    for name, one in crossings.items():
        where = f"{path}: pedestrian_crossings.{name}"
        edges = (points(one.get(edge), f"{where}.{edge}") for edge in ("edge1", "edge2"))
        lanes[f"crossing {name}"] = crosswalk(*edges)
    return lanes


def main() -> None:
    parser = argparse.ArgumentParser(description="Converts a scenario of Argoverse 2 motion forecasting to CommonRoad 2020a.")
    parser.add_argument("scenario", type=Path, metavar="SCENARIO.parquet")
    parser.add_argument("map", type=Path, metavar="MAP.json")
    parser.add_argument("out", type=Path, metavar="OUT.xml")
    parser.add_argument("--ego", default="AV", metavar="TRACK", help="track that the stack replaces (default: AV)")
    asked = parser.parse_args()

    def convert() -> str:
        name, tracks = tracks_of(asked.scenario)
        return document(f"Argoverse2 {name}", lanes_of(asked.map), tracks, asked.ego)

    written(convert, asked.out)


if __name__ == "__main__":
    main()
