"""The map of a town."""

from __future__ import annotations

import math
import os
import re
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import swerve

from .values import Location, Rotation, Transform

EARTH_RADIUS_M = 6_378_137.0


@dataclass
class GeoLocation:
    latitude: float
    longitude: float
    altitude: float


def _any_way(opendrive: str) -> dict[str, dict[str, object]]:
    """Start and goal on one driving lane: `read_map` reads scenarios, which need them."""
    for road in ElementTree.fromstring(opendrive).iter("road"):
        length_m = float(road.attrib["length"])
        for lane in road.iterfind("lanes/laneSection/right/lane[@type='driving']"):
            ends = {"start": 0.2 * length_m, "goal": 0.8 * length_m}
            if road.attrib["junction"] == "-1" and length_m > 20.0:
                return {key: {"road": road.attrib["id"], "lane": int(lane.attrib["id"]), "s_m": s_m} for key, s_m in ends.items()}
    raise RuntimeError("the map has no driving lane")


def _place(road: ElementTree.Element, s_m: float, t_m: float) -> tuple[float, float, float]:
    """Point beside the reference line of a road, in the axes of OpenDRIVE, and the line's heading, radians."""
    piece = [each for each in road.iterfind("planView/geometry") if float(each.attrib["s"]) <= s_m][-1]
    s, x, y, heading = (float(piece.attrib[key]) for key in ("s", "x", "y", "hdg"))
    along, arc = s_m - s, piece.find("arc")
    turn = along * float(arc.attrib["curvature"]) if arc is not None else 0.0
    chord = along if turn == 0.0 else along * math.sin(turn / 2) / (turn / 2)
    x, y = x + chord * math.cos(heading + turn / 2), y + chord * math.sin(heading + turn / 2)
    heading += turn
    return x - t_m * math.sin(heading), y + t_m * math.cos(heading), heading


class Map:
    """A road network in OpenDRIVE, whose y axis is CARLA's turned round. `version` selects the projection of the latitude."""

    def __init__(self, name: str, file: Path, version: str = "0.9.15") -> None:
        self.name, self._text, self._version = name, file.read_text(), version
        ends = {"map": {"file": os.fspath(file.resolve())}, "ego": _any_way(self._text), "end": {"timeout_s": 1.0}}
        self.lanes = swerve.read_map({"name": name, **ends})
        origin = [re.search(rf"\+{key}=(\S+?)[\s\]]", self._text) for key in ("lat_0", "lon_0")]
        self.origin = [42.0 if origin[0] is None else float(origin[0][1]), 2.0 if origin[1] is None else float(origin[1][1])]

    def to_opendrive(self) -> str:
        return self._text

    def get_spawn_points(self) -> list[Transform]:
        """A place on each driving lane that is long enough and not in a junction."""
        lanes = [lane for lane in self.lanes.values() if lane.kind == "driving" and not lane.in_junction and lane.s_m[-1] > 25]
        places = []
        for lane in lanes:
            k = next(k for k, s_m in enumerate(lane.s_m) if s_m >= 10 or k == len(lane.s_m) - 1)
            share = (10 - lane.s_m[k - 1]) / (lane.s_m[k] - lane.s_m[k - 1])
            x, y = (each[k - 1] + share * (each[k] - each[k - 1]) for each in (lane.x_m, lane.y_m))
            heading = math.atan2(lane.y_m[k] - lane.y_m[k - 1], lane.x_m[k] - lane.x_m[k - 1])
            places.append(Transform(Location(float(x), -float(y), 0.0), Rotation(yaw=-math.degrees(heading))))
        return places

    def signals(self) -> dict[str, Transform]:
        """Places of the traffic lights by their identities, on roads of lines and arcs, with the direction of the traffic that
        they are for."""
        found = {}
        for road in ElementTree.fromstring(self._text).iter("road"):
            for signal in road.iterfind("signals/signal[@dynamic='yes']"):
                x, y, heading = _place(road, float(signal.attrib["s"]), float(signal.attrib["t"]))
                heading += math.pi if signal.attrib["orientation"] == "-" else 0.0
                found[signal.attrib["id"]] = Transform(Location(x, -y, 0.0), Rotation(yaw=-math.degrees(heading)))
        return found

    def transform_to_geolocation(self, location: Location) -> GeoLocation:
        """Up to 0.9.15 by the Mercator projection of a sphere; in 0.9.16 by the transverse one, mirrored."""
        latitude, longitude = map(math.radians, self.origin)
        if self._version == "0.9.16":
            x, y = (each / (0.9996 * EARTH_RADIUS_M) for each in (location.x, location.y))
            north = math.asin(math.sin(latitude + y) / math.cosh(x))
            east = longitude + math.atan2(math.sinh(x), math.cos(latitude + y))
        else:
            scale = math.cos(latitude) * EARTH_RADIUS_M
            up = math.log(math.tan(math.pi / 4 + latitude / 2)) - location.y / scale
            north, east = 2 * math.atan(math.exp(up)) - math.pi / 2, longitude + location.x / scale
        return GeoLocation(math.degrees(north), math.degrees(east), location.z)
