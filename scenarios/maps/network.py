"""Elements of road networks, and their OpenDRIVE 1.7 files."""

import math
import xml.etree.ElementTree as xml
from dataclasses import dataclass, field
from itertools import chain, repeat

QUARTER = math.pi / 2


@dataclass
class Piece:
    """Line, arc or spiral: length, metres; curvatures at both ends, 1/m, positive to the left."""

    length: float
    begin: float = 0.0
    end: float = 0.0

    def turned(self, s):
        """Change of the heading from the begin to a place, radians."""
        return s * (self.begin + 0.5 * (self.end - self.begin) * s / self.length)

    def reversed(self):
        return Piece(-self.length, self.end, self.begin)


def arc(turn, radius):
    """Arc that turns by an angle, radians, positive to the left."""
    curvature = math.copysign(1 / radius, turn)
    return Piece(abs(turn) * radius, curvature, curvature)


@dataclass
class Pose:
    x: float
    y: float
    heading: float

    def turned(self):
        """Pose at the same place in the other direction."""
        return Pose(self.x, self.y, self.heading + math.pi)

    def aside(self, right):
        return Pose(self.x + right * math.sin(self.heading), self.y - right * math.cos(self.heading), self.heading)

    def after(self, piece):
        """Pose at the end of a piece that begins here, by Simpson's rule: within 1e-9 m for the pieces of this file."""
        steps = 400
        x = y = 0.0
        for k in range(steps + 1):
            weight = 1 if k in (0, steps) else 4 if k % 2 else 2
            heading = self.heading + piece.turned(piece.length * k / steps)
            x += weight * math.cos(heading)
            y += weight * math.sin(heading)
        third = piece.length / steps / 3
        return Pose(self.x + third * x, self.y + third * y, self.heading + piece.turned(piece.length))


@dataclass
class Lane:
    kind: str
    # Width over the length of the section: coefficients of a cubic polynomial, metres; or several with their begins.
    width: tuple | list
    # Road mark at the outer border; or several with their begins.
    mark: str | list = "none"
    # Lanes that it continues and that continue it.
    before: int | None = None
    after: int | None = None


def linked(lanes, before=(), after=()):
    """The lanes, each with the number of the lane that it continues and of the one that continues it."""
    for lane, one, other in zip(lanes, chain(before, repeat(None)), chain(after, repeat(None))):
        lane.before, lane.after = one, other
    return lanes


def constant(width):
    return (width, 0.0, 0.0, 0.0)


def smooth(begin, end, length):
    """Width from one value to another, with slope 0 at both ends."""
    return (begin, 0.0, 3 * (end - begin) / length**2, -2 * (end - begin) / length**3)


@dataclass
class Section:
    s: float
    # Lanes from inside to outside.
    right: list
    left: list = field(default_factory=list)
    # Road mark of the centre lane; or several with their begins.
    center: str | list = "none"


def one_section(right, center="none"):
    """The only section of a road, with lanes at the right side."""
    return [Section(0.0, right, center=center)]


@dataclass
class Signal:
    name: str
    s: float
    t: float
    kind: str
    # Width and height, metres.
    size: tuple
    country: str = "DE"
    z: float = 0.0
    # Name of the stop line that it belongs to.
    line: str | None = None
    # Lanes for which it holds: the first and the last.
    lanes: tuple = (-1, -1)


@dataclass
class Crosswalk:
    """A zebra crossing, across the whole road."""

    name: str
    s: float
    t: float
    # Along the road and across it, metres.
    size: tuple


@dataclass
class Road:
    number: int
    name: str
    # Type and speed limit, km/h.
    kind: tuple
    start: Pose
    pieces: list
    sections: list
    # Number of its junction.
    junction: int = -1
    # Predecessor and successor: kind, number and, for a road, its end.
    before: tuple | None = None
    after: tuple | None = None
    signals: list = field(default_factory=list)
    crosswalks: list = field(default_factory=list)
    # Height: begins with coefficients of cubic polynomials, metres.
    elevation: list = field(default_factory=list)

    def length(self):
        return sum(piece.length for piece in self.pieces)

    def poses(self):
        """Poses at the begin of each piece, and at the end of the road."""
        poses = [self.start]
        for piece in self.pieces:
            poses.append(poses[-1].after(piece))
        return poses

    def end(self):
        return self.poses()[-1]


@dataclass
class Junction:
    """A junction; its connections are those of the roads in it."""

    number: int
    name: str
    # Pairs of connecting roads: the first has priority over the second.
    priorities: list = field(default_factory=list)
    controllers: list = field(default_factory=list)


@dataclass
class Network:
    name: str
    roads: list
    junctions: list = field(default_factory=list)
    # Name and signals of each.
    controllers: list = field(default_factory=list)
    # Names of roundabouts, and the numbers of their junctions.
    roundabouts: dict = field(default_factory=dict)


def text(value):
    return repr(value + 0.0).removesuffix(".0") if isinstance(value, float) else str(value)


def add(parent, name, /, **attributes):
    return xml.SubElement(parent, name, {key: text(value) for key, value in attributes.items()})


def rounded(value):
    """Value of which the last bits, which depend on the machine, are left out."""
    return round(value, 10)


def with_begins(value):
    """Values with their begins; a single value begins at 0."""
    return value if isinstance(value, list) else [(0.0, value)]


def add_road(root, road):
    names = {"id": road.number, "name": road.name}
    element = add(root, "road", **names, length=rounded(road.length()), junction=road.junction, rule="RHT")
    add_links(add(element, "link"), road)
    kind, limit = road.kind
    add(add(element, "type", s=0.0, type=kind), "speed", max=limit, unit="km/h")
    add_plan_view(add(element, "planView"), road)
    if road.elevation:
        profile = add(element, "elevationProfile")
        for s, height in road.elevation:
            add(profile, "elevation", s=rounded(s), **dict(zip("abcd", height)))
    lanes = add(element, "lanes")
    for one in road.sections:
        add_section(add(lanes, "laneSection", s=rounded(one.s)), one)
    if road.crosswalks:
        objects = add(element, "objects")
        for crosswalk in road.crosswalks:
            add_crosswalk(objects, crosswalk)
    if road.signals:
        signals = add(element, "signals")
        for signal in road.signals:
            add_signal(signals, signal)


def add_links(element, road):
    for name, link in (("predecessor", road.before), ("successor", road.after)):
        if link:
            kind, number, *end = link
            add(element, name, elementType=kind, elementId=number, **({"contactPoint": end[0]} if end else {}))


def add_plan_view(element, road):
    s = 0.0
    for pose, piece in zip(road.poses(), road.pieces):
        heading = rounded(math.remainder(pose.heading, math.tau))
        place = {"x": rounded(pose.x), "y": rounded(pose.y), "hdg": heading}
        geometry = add(element, "geometry", s=rounded(s), **place, length=rounded(piece.length))
        if piece.begin != piece.end:
            add(geometry, "spiral", curvStart=piece.begin, curvEnd=piece.end)
        elif piece.begin != 0:
            add(geometry, "arc", curvature=piece.begin)
        else:
            add(geometry, "line")
        s += piece.length


def add_section(element, section):
    sides = {
        "left": [(k, lane) for k, lane in enumerate(section.left, 1)][::-1],
        "center": [(0, Lane("none", [], section.center))],
        "right": [(-k, lane) for k, lane in enumerate(section.right, 1)],
    }
    for side, lanes in sides.items():
        if lanes:
            parent = add(element, side)
            for number, lane in lanes:
                add_lane(parent, number, lane)


def add_lane(parent, number, lane):
    element = add(parent, "lane", id=number, type=lane.kind, level="false")
    if lane.before or lane.after:
        link = add(element, "link")
        for name, other in (("predecessor", lane.before), ("successor", lane.after)):
            if other:
                add(link, name, id=other)
    for begin, width in with_begins(lane.width):
        add(element, "width", sOffset=rounded(begin), **dict(zip("abcd", width)))
    for begin, mark in with_begins(lane.mark):
        change = "both" if mark in ("none", "broken") else "none"
        width = {} if mark == "none" else {"width": 0.12}
        add(element, "roadMark", sOffset=rounded(begin), type=mark, color="white", **width, laneChange=change)
    if lane.kind == "sidewalk":
        add(element, "height", sOffset=0.0, inner=0.12, outer=0.12)


def add_signal(parent, signal):
    """A signal for incoming lanes."""
    dynamic = "yes" if signal.country == "OpenDRIVE" else "no"
    place = {"s": rounded(signal.s), "t": signal.t, "zOffset": signal.z}
    orientation = "+" if signal.lanes[0] < 0 else "-"
    kind = {"country": signal.country, "type": signal.kind, "subtype": "-1"}
    kind = {"dynamic": dynamic, "orientation": orientation, **kind}
    size = dict(zip(("width", "height"), signal.size))
    element = add(parent, "signal", name=signal.name, id=signal.name, **place, **kind, **size)
    add(element, "validity", fromLane=signal.lanes[0], toLane=signal.lanes[1])
    if signal.line:
        add(element, "reference", elementType="signal", elementId=signal.line, type="stopLine")


def add_crosswalk(parent, crosswalk):
    names = {"type": "crosswalk", "id": crosswalk.name, "name": crosswalk.name, "orientation": "none"}
    place = {"s": rounded(crosswalk.s), "t": crosswalk.t, "zOffset": 0.0, "hdg": 0.0, "pitch": 0.0, "roll": 0.0}
    size = dict(zip(("length", "width"), crosswalk.size))
    add(parent, "object", **names, **place, **size, height=0.0)


def add_junction(root, junction, roads):
    element = add(root, "junction", id=junction.number, name=junction.name)
    inside = [road for road in roads if road.junction == junction.number]
    for k, road in enumerate(inside):
        ways = {"incomingRoad": road.before[1], "connectingRoad": road.number}
        connection = add(element, "connection", id=k, **ways, contactPoint="start")
        for number, lane in enumerate(road.sections[0].right, 1):
            if lane.before:
                add(connection, "laneLink", **{"from": lane.before, "to": -number})
    for high, low in junction.priorities:
        add(element, "priority", high=high, low=low)
    for name in junction.controllers:
        add(element, "controller", id=name, type="0")


def document(network):
    """The file of a network."""
    root = xml.Element("OpenDRIVE")
    root.append(xml.Comment(" Made by scenarios/maps/make.py. "))
    add(root, "header", revMajor=1, revMinor=7, name=network.name, vendor="Swerve")
    for road in network.roads:
        add_road(root, road)
    for name, signals in network.controllers:
        controller = add(root, "controller", id=name, name=name)
        for signal in signals:
            add(controller, "control", signalId=signal, type="0")
    for junction in network.junctions:
        add_junction(root, junction, network.roads)
    for name, numbers in network.roundabouts.items():
        group = add(root, "junctionGroup", id=name, name=name, type="roundabout")
        for number in numbers:
            add(group, "junctionReference", junction=number)
    xml.indent(root)
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + xml.tostring(root) + b"\n"


TOWN = ("town", 50)
LANE_M = 3.5


def street(width=constant(LANE_M)):
    """Lanes of one side of a street."""
    return [Lane("driving", width, "solid"), Lane("sidewalk", constant(2.0))]


# Centre line and width of a roundabout's lane; left borders of the lanes that lead to it and from it.
RING_RADIUS_M = 16.0
RING_LANE_M = 4.5
TURN_RADIUS_M = 13.0


def ring():
    """Radius of the left border of a roundabout's lane, which the left borders of entries and exits touch; the angle at
    its centre between an arm and that place; the distance of arms from the centre."""
    border = RING_RADIUS_M - RING_LANE_M / 2
    apart = math.asin(TURN_RADIUS_M / (TURN_RADIUS_M + border))
    return border, apart, (TURN_RADIUS_M + border) * math.cos(apart)


def conflict(one, other):
    """True if two ways through a junction, each from an arm to another, cross or lead to the same arm. Arms have their
    numbers counter-clockwise."""
    # Ends of lanes at the junction, counter-clockwise: an arm's outgoing lane, then its incoming one.
    ends = [(2 * before + 1, 2 * after) for before, after in (one, other)]
    begin, end = sorted(ends[0])
    between = [begin < place < end for place in ends[1]]
    return one[1] == other[1] or between[0] != between[1]
