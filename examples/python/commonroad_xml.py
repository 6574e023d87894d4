"""Scenarios of recorded drives as CommonRoad 2020a files, for the converters beside this file; standard library only.

A file has the lanelets, one planning problem from the ego's first to its last recorded place, and all other road users as
obstacles with their recorded states. A road user that is out of sight for some steps becomes one obstacle for each stretch
without a gap. Coordinates and headings are those of the recording: metres and radians, right-handed.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple
from xml.sax.saxutils import quoteattr

Point = tuple[float, float]
STEP_S, GOAL_LENGTH_M, GOAL_WIDTH_M, GOAL_FROM = 0.1, 10.0, 6.0, 0.7
"""Time step; size of the goal around the ego's last place; share of the recorded time from which on the goal can be reached."""
SIZE_MAX_MB = 256
"""Largest input file."""


class State(NamedTuple):
    """Centre, heading and speed along the heading."""

    x_m: float
    y_m: float
    heading_rad: float
    speed_mps: float


@dataclass
class Track:
    """A road user with its states by time step."""

    name: str
    kind: str
    """Type of obstacle of CommonRoad, such as `car`."""
    length_m: float
    width_m: float
    states: dict[int, State]


@dataclass
class Lane:
    """A lane with its bounds in the direction of travel."""

    left: Sequence[Point]
    right: Sequence[Point]
    kinds: list[str] = field(default_factory=lambda: ["urban"])
    """Types of lanelet of CommonRoad."""
    successors: list[str] = field(default_factory=list)
    beside: dict[str, tuple[str, bool]] = field(default_factory=dict)
    """Lane to the `Left` and `Right`, with true if its traffic runs the other way."""
    marks: dict[str, str] = field(default_factory=dict)
    """Marking of the bound to the `left` and `right`."""


class Wrong(Exception):
    """An input that is not as expected."""


def shares(points: Sequence[Point]) -> list[float]:
    """Arc length of each point by that of the line."""
    at = [0.0]
    for (x0, y0), (x1, y1) in zip(points, points[1:]):
        at.append(at[-1] + math.hypot(x1 - x0, y1 - y0))
    if at[-1] < 0.01:
        raise Wrong("expected a line of at least 1 cm")
    return [s / at[-1] for s in at]


def paired(left: Sequence[Point], right: Sequence[Point]) -> tuple[list[Point], list[Point]]:
    """Both bounds with a point at the same shares of their lengths: CommonRoad has pairs of points. No vertex is lost."""
    both = shares(left), shares(right)
    wanted: list[float] = []
    for share in sorted({0.0, 1.0, *both[0], *both[1]}):
        if not wanted or share - wanted[-1] > 1e-6:
            wanted.append(share)
    wanted[-1] = 1.0

    def resampled(points: Sequence[Point], at: list[float]) -> list[Point]:
        found, k = [], 0
        for share in wanted:
            while k + 2 < len(at) and at[k + 1] < share:
                k += 1
            part = (share - at[k]) / (at[k + 1] - at[k]) if at[k + 1] > at[k] else 0.0
            (x0, y0), (x1, y1) = points[k], points[k + 1]
            found.append((x0 + part * (x1 - x0), y0 + part * (y1 - y0)))
        return found

    return resampled(left, both[0]), resampled(right, both[1])


def bound(name: str, points: Sequence[Point], mark: str | None) -> str:
    inside = "".join(f"<point><x>{x!r}</x><y>{y!r}</y></point>" for x, y in points)
    return f"<{name}>{inside}{f'<lineMarking>{mark}</lineMarking>' if mark else ''}</{name}>"


def exact(name: str, value: float) -> str:
    return f"<{name}><exact>{value!r}</exact></{name}>"


def state(name: str, step: int, at: State, more: str = "") -> str:
    position = f"<position><point><x>{at.x_m!r}</x><y>{at.y_m!r}</y></point></position>"
    numbers = exact("orientation", at.heading_rad) + exact("time", step) + exact("velocity", at.speed_mps)
    return f"<{name}>{position}{numbers}{more}</{name}>"


def lanelets(lanes: dict[str, Lane]) -> list[str]:
    ids = {name: number for number, name in enumerate(lanes, 1)}
    before: dict[str, list[str]] = {name: [] for name in lanes}
    for name, lane in lanes.items():
        for after in lane.successors:
            before.get(after, []).append(name)
    text = []
    for name, lane in lanes.items():
        try:
            left, right = paired(lane.left, lane.right)
        except Wrong as wrong:
            raise Wrong(f"lane {name}: {wrong}") from None
        inside = bound("leftBound", left, lane.marks.get("left")) + bound("rightBound", right, lane.marks.get("right"))
        inside += "".join(f'<predecessor ref="{ids[one]}"/>' for one in before[name])
        inside += "".join(f'<successor ref="{ids[one]}"/>' for one in lane.successors if one in ids)
        for side, (one, opposite) in lane.beside.items():
            if one in ids:
                direction = "opposite" if opposite else "same"
                inside += f'<adjacent{side} ref="{ids[one]}" drivingDir="{direction}"/>'
        inside += "".join(f"<laneletType>{kind}</laneletType>" for kind in lane.kinds)
        text.append(f'<lanelet id="{ids[name]}">{inside}</lanelet>')
    return text


def stretches(states: dict[int, State]) -> list[list[tuple[int, State]]]:
    """States without gaps."""
    found: list[list[tuple[int, State]]] = []
    for step in sorted(states):
        if not found or found[-1][-1][0] != step - 1:
            found.append([])
        found[-1].append((step, states[step]))
    return found


def obstacles(track: Track, first: int, last: int, number: int) -> Iterable[str]:
    """Obstacles of a road user, numbered from `number` on; steps count from `first` on."""
    shape = f"<shape><rectangle><length>{track.length_m!r}</length><width>{track.width_m!r}</width></rectangle></shape>"
    within = {step - first: at for step, at in track.states.items() if first <= step <= last}
    for part, states in enumerate(stretches(within)):
        (step, at), *later = states
        inside = f"<type>{track.kind}</type>{shape}{state('initialState', step, at)}"
        if later:
            inside += "<trajectory>" + "".join(state("state", *one) for one in later) + "</trajectory>"
        yield f'<dynamicObstacle id="{number + part}">{inside}</dynamicObstacle>'


def document(name: str, lanes: dict[str, Lane], tracks: list[Track], ego: str) -> str:
    """The text of the file; the ego is the road user of this name.

    Raises `Wrong` if there are no lanes or no such road user, or if it has fewer than ten states.
    """
    own = next((track for track in tracks if track.name == ego), None)
    if own is None:
        known = ", ".join(track.name for track in tracks if len(track.states) >= 10)
        raise Wrong(f"expected the name of a road user as ego, found {ego!r}; known with ten states: {known}")
    if len(own.states) < 10:
        raise Wrong(f"ego {ego}: expected at least ten states, found {len(own.states)}")
    if not lanes:
        raise Wrong("expected lanes, found none")
    first, last = min(own.states), max(own.states)
    text = [f'<commonRoad commonRoadVersion="2020a" timeStepSize="{STEP_S}" benchmarkID={quoteattr(name)}>']
    text += lanelets(lanes)
    number = len(lanes) + 1
    for track in tracks:
        found = [] if track is own else list(obstacles(track, first, last, number))
        text += found
        number += len(found)
    start, end, steps = own.states[first], own.states[last], last - first
    start = start._replace(speed_mps=max(start.speed_mps, 0.0))
    size = f"<length>{GOAL_LENGTH_M}</length><width>{GOAL_WIDTH_M}</width><orientation>{end.heading_rad!r}</orientation>"
    center = f"<center><x>{end.x_m!r}</x><y>{end.y_m!r}</y></center>"
    interval = f"<intervalStart>{math.ceil(GOAL_FROM * steps)}</intervalStart><intervalEnd>{steps}</intervalEnd>"
    goal = f"<goalState><position><rectangle>{size}{center}</rectangle></position><time>{interval}</time></goalState>"
    initial = state("initialState", 0, start, exact("yawRate", 0.0) + exact("slipAngle", 0.0))
    text.append(f'<planningProblem id="{number}">{initial}{goal}</planningProblem>')
    return "\n".join(['<?xml version="1.0"?>', *text, "</commonRoad>", ""])


def along(vx_mps: float, vy_mps: float, heading_rad: float) -> float:
    """Speed along a heading."""
    return vx_mps * math.cos(heading_rad) + vy_mps * math.sin(heading_rad)


def finite(value: object, where: str) -> float:
    """A number of at most 1e12."""
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) <= 1e12:
        raise Wrong(f"{where}: expected a number, found {value!r:.40}")
    return float(value)


def readable(path: Path) -> Path:
    """A path to a file of at most `SIZE_MAX_MB`."""
    if path.stat().st_size > SIZE_MAX_MB * 1e6:
        raise Wrong(f"{path}: expected a file of at most {SIZE_MAX_MB} MB")
    return path


def json_of(path: Path) -> Any:
    """Content of a JSON file."""
    try:
        return json.loads(readable(path).read_text())
    except (ValueError, RecursionError) as error:
        raise Wrong(f"{path}: expected JSON: {error}") from None


def points(value: object, where: str, least: int = 2) -> list[Point]:
    """Points of a list of objects with `x` and `y`."""
    if not isinstance(value, list) or len(value) < least:
        raise Wrong(f"{where}: expected a list of at least {least} points")
    found: list[Point] = []
    for k, one in enumerate(value):
        if not isinstance(one, dict) or "x" not in one or "y" not in one:
            raise Wrong(f"{where}[{k}]: expected `x` and `y`, found {one!r:.40}")
        found.append((finite(one["x"], f"{where}[{k}].x"), finite(one["y"], f"{where}[{k}].y")))
    return found


def crosswalk(one: Sequence[Point], other: Sequence[Point]) -> Lane:
    """A crossing for pedestrians between two edges."""
    (ax, ay), (bx, by) = one[0], one[-1]
    (cx, cy), (dx, dy) = other[0], other[-1]
    if (bx - ax) * (dx - cx) + (by - ay) * (dy - cy) < 0.0:
        other, (cx, cy) = list(reversed(other)), (dx, dy)
    is_left = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) > 0.0
    left, right = (other, one) if is_left else (one, other)
    return Lane(left, right, ["crosswalk"])


def written(convert: Callable[[], str], out: Path) -> None:
    """Writes the converted text; ends the program with one line if the input is wrong."""
    try:
        text = convert()
        out.write_text(text)
    except (Wrong, OSError) as wrong:
        sys.exit(f"error: {wrong}")
    print(f"{out}: {text.count('<lanelet ')} lanelets, {text.count('<dynamicObstacle ')} obstacles")
