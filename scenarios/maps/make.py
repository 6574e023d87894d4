#!/usr/bin/env python3
"""Makes the road networks of scenarios: the OpenDRIVE 1.7 files of this folder.

usage: make.py [--check]

Writes the files beside this script; with --check, compares them and fails if they differ. The files are the same on
every machine.

Frame: metres, x east, y north; flat; right-hand traffic. Arms of a junction lead to it: lane -1 is incoming, lane 1
outgoing. docs/howto/read_a_map.md lists the networks and the numbers of their roads.
"""

import math
import sys
import xml.etree.ElementTree as xml
from dataclasses import dataclass, field
from itertools import chain, repeat
from pathlib import Path

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
    # Width over the length of the section: coefficients of a cubic polynomial, metres.
    width: tuple
    # Road mark at the outer border.
    mark: str = "none"
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
    # Road mark of the centre lane.
    center: str = "none"


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
    is_roundabout: bool = False


def text(value):
    return repr(value + 0.0).removesuffix(".0") if isinstance(value, float) else str(value)


def add(parent, name, /, **attributes):
    return xml.SubElement(parent, name, {key: text(value) for key, value in attributes.items()})


def rounded(value):
    """Value of which the last bits, which depend on the machine, are left out."""
    return round(value, 10)


def add_road(root, road):
    names = {"id": road.number, "name": road.name}
    element = add(root, "road", **names, length=rounded(road.length()), junction=road.junction, rule="RHT")
    add_links(add(element, "link"), road)
    kind, limit = road.kind
    add(add(element, "type", s=0.0, type=kind), "speed", max=limit, unit="km/h")
    add_plan_view(add(element, "planView"), road)
    lanes = add(element, "lanes")
    for one in road.sections:
        add_section(add(lanes, "laneSection", s=one.s), one)
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
        "center": [(0, Lane("none", None, section.center))],
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
    if lane.width:
        add(element, "width", sOffset=0.0, **dict(zip("abcd", lane.width)))
    change = "none" if lane.mark == "solid" else "both"
    width = {} if lane.mark == "none" else {"width": 0.12}
    add(element, "roadMark", sOffset=0.0, type=lane.mark, color="white", **width, laneChange=change)
    if lane.kind == "sidewalk":
        add(element, "height", sOffset=0.0, inner=0.12, outer=0.12)


def add_signal(parent, signal):
    """A signal for the incoming lane."""
    dynamic = "yes" if signal.country == "OpenDRIVE" else "no"
    place = {"s": signal.s, "t": signal.t, "zOffset": signal.z}
    kind = {"dynamic": dynamic, "orientation": "+", "country": signal.country, "type": signal.kind, "subtype": "-1"}
    size = dict(zip(("width", "height"), signal.size))
    element = add(parent, "signal", name=signal.name, id=signal.name, **place, **kind, **size)
    add(element, "validity", fromLane=-1, toLane=-1)
    if signal.line:
        add(element, "reference", elementType="signal", elementId=signal.line, type="stopLine")


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
    if network.is_roundabout:
        group = add(root, "junctionGroup", id="roundabout", name="roundabout", type="roundabout")
        for junction in network.junctions:
            add(group, "junctionReference", junction=junction.number)
    xml.indent(root)
    return b'<?xml version="1.0" encoding="UTF-8"?>\n' + xml.tostring(root) + b"\n"


ARMS = ("east", "north", "west", "south")
TOWN = ("town", 50)
LANE_M = 3.5


def street(width=constant(LANE_M)):
    """Lanes of one side of a street."""
    return [Lane("driving", width, "solid"), Lane("sidewalk", constant(2.0))]


def arm(k, inner, length, junction):
    """Arm of a junction at the origin, which ends at the distance `inner` from it."""
    angle = k * QUARTER
    outer = inner + length
    start = Pose(outer * math.cos(angle), outer * math.sin(angle), angle + math.pi)
    sections = [Section(0.0, street(), street(), "broken")]
    return Road(k + 1, ARMS[k], TOWN, start, [Piece(length)], sections, after=("junction", junction))


def add_signals(arm, name, line_kind, line_m, signal_m, **signal):
    """Adds a stop line to an arm, and its signal beside the lane; distances are from the end of the arm."""
    line = f"line_{arm.name}"
    arm.signals = [
        Signal(line, arm.length() - line_m, -LANE_M / 2, line_kind, size=(LANE_M, 0.5)),
        Signal(f"{name}_{arm.name}", arm.length() - signal_m, -LANE_M - 0.5, line=line, **signal),
    ]


def add_light(arm):
    add_signals(arm, "light", "294", 2.0, 0.0, kind="1000001", country="OpenDRIVE", z=2.2, size=(0.3, 0.9))


def add_yield_sign(arm):
    add_signals(arm, "yield", "341", 0.5, 0.5, kind="205", z=2.0, size=(0.9, 0.9))


def inwards(road, end):
    """Pose at an end of a road, in the direction of the junction there."""
    pose = road.end() if end == "end" else road.start
    return pose if end == "end" else Pose(pose.x, pose.y, pose.heading + math.pi)


def through(number, junction, a, b, radius, sidewalk):
    """Road inside a junction, from an end of a road to another one: an arc or a line between their centre lines."""
    (one, one_end), (other, other_end) = a, b
    start = inwards(one, one_end)
    turn = math.remainder(inwards(other, other_end).heading + math.pi - start.heading, math.tau)
    piece = Piece(2 * radius) if abs(turn) < 0.1 else arc(math.copysign(QUARTER, turn), radius)
    lanes = street() if sidewalk or piece.begin < 0 else street()[:1]
    lanes[0].mark = "none"
    side = {"end": 1, "start": -1}
    before, after = [(-side[one_end] * k for k in (1, 2)), (side[other_end] * k for k in (1, 2))]
    ends = {"before": ("road", one.number, one_end), "after": ("road", other.number, other_end)}
    sections = one_section(linked(lanes, before, after))
    return Road(number, f"{one.name} to {other.name}", TOWN, start, [piece], sections, junction, **ends)


def through_crossing(a, b, radius):
    """Road from arm to arm. The sidewalk follows the right turns."""
    return through(10 * a.number + b.number, 100, (a, "end"), (b, "end"), radius, sidewalk=False)


def conflict(one, other):
    """True if two connecting roads of a crossing cross or lead to the same arm."""
    # Ends of lanes at the crossing, counter-clockwise: an arm's outgoing lane, then its incoming one.
    ends = [(2 * road.before[1] + 1, 2 * road.after[1]) for road in (one, other)]
    begin, end = sorted(ends[0])
    between = [begin < place < end for place in ends[1]]
    return one.after == other.after or between[0] != between[1]


def crossing(name, lights=False, priority=False):
    """A crossing of two streets, whose lanes turn right with a radius of 9.25 m and left with 12.75 m."""
    radius = 11.0
    arms = [arm(k, radius, 150.0, 100) for k in range(4)]
    inside = [through_crossing(a, b, radius) for a in arms for b in arms if a is not b]
    junction = Junction(100, name)
    controllers = []
    if lights:
        for one in arms:
            add_light(one)
        controllers = [("north_south", ("light_north", "light_south")), ("east_west", ("light_east", "light_west"))]
        junction.controllers = [controller for controller, _ in controllers]
    if priority:
        for one in (arms[1], arms[3]):
            add_yield_sign(one)
        main, side = ([road for road in inside if road.before[1] % 2 == odd] for odd in (1, 0))
        junction.priorities = [(a.number, b.number) for a in main for b in side if conflict(a, b)]
    return Network(name, arms + inside, [junction], controllers)


# Centre line and width of the ring's lane; left borders of the lanes that lead to it and from it.
RING_RADIUS_M = 16.0
RING_LANE_M = 4.5
TURN_RADIUS_M = 13.0


def roundabout():
    """A roundabout with one lane. The left borders of entries and exits are arcs that touch the ring's left border."""
    border = RING_RADIUS_M - RING_LANE_M / 2
    # Angle at the ring's centre between an arm and the place at which its lanes touch the ring.
    apart = math.asin(TURN_RADIUS_M / (TURN_RADIUS_M + border))
    inner = (TURN_RADIUS_M + border) * math.cos(apart)
    roads, junctions = [], []
    for k in range(4):
        to_ring = arm(k, inner, 120.0, 101 + k)
        add_yield_sign(to_ring)
        roads += [to_ring, *around_arm(to_ring, k * QUARTER, border, apart)]
        junctions.append(Junction(101 + k, to_ring.name, [(41 + k, 21 + k)]))
    return Network("roundabout", roads, junctions, is_roundabout=True)


def around_arm(arm, angle, border, apart):
    """Roads at an arm: the ring to the next arm, the entry, the exit, the ring past the arm."""
    number, junction, name = arm.number, arm.after[1], arm.name
    next_number, last_number = number % 4 + 1, (number - 2) % 4 + 1
    begin, end = (
        Pose(border * math.cos(at), border * math.sin(at), at + QUARTER) for at in (angle - apart, angle + apart)
    )
    turn, past, along = arc(apart - QUARTER, TURN_RADIUS_M), arc(2 * apart, border), arc(QUARTER - 2 * apart, border)
    entry = one_section(linked(street(smooth(LANE_M, RING_LANE_M, turn.length)), (-1, -2), (-1, -2)))
    leave = one_section(linked(street(smooth(RING_LANE_M, LANE_M, turn.length)), (-1, -2), (1, 2)))
    across = one_section(linked([Lane("driving", constant(RING_LANE_M))], (-1,), (-1,)), "solid")
    of_arm, last = ("road", number, "end"), ("road", 10 + last_number, "end")
    following, next_junction = ("road", 10 + number, "start"), ("junction", 100 + next_number)
    between = one_section(street(constant(RING_LANE_M)), "solid")
    return [
        Road(10 + number, f"ring {name}", TOWN, end, [along], between, -1, ("junction", junction), next_junction),
        Road(20 + number, f"entry {name}", TOWN, arm.end(), [turn], entry, junction, of_arm, following),
        Road(30 + number, f"exit {name}", TOWN, begin, [turn], leave, junction, last, of_arm),
        Road(40 + number, f"past {name}", TOWN, begin, [past], across, junction, last, following),
    ]


def ramp():
    """A motorway to the east, and a ramp that joins it along a spiral of 60 m into an acceleration lane."""
    motorway, slow = ("motorway", 130), ("motorway", 80)
    width, shoulder_m, join_m, narrow_m = 3.75, 2.5, 60.0, 80.0

    def lane(mark, kind="driving", polynomial=constant(width)):
        return Lane(kind, polynomial, mark)

    def shoulder(polynomial=constant(shoulder_m)):
        return Lane("shoulder", polynomial)

    # The shoulder before the ramp closes as the spiral comes nearer, with the cube of the distance.
    closing = tuple(shoulder_m * factor / join_m**k for k, factor in enumerate((1, -3, 3, -1)))
    start = one_section([lane("broken"), lane("solid"), shoulder()], "solid")
    main = linked([lane("broken"), lane("solid"), shoulder(closing)], (-1, -2, -3), (-1, -2))
    on_ramp = one_section([lane("solid", "onRamp"), shoulder()], "solid")
    joining = linked([lane("solid", "onRamp"), shoulder()], (-1, -2), (-3, -4))
    entry = [lane("broken"), lane("broken"), lane("solid", "entry"), shoulder()]
    ending = [lane("broken"), lane("broken"), lane("solid", "entry", smooth(width, 0.0, narrow_m)), shoulder()]
    last = linked([lane("broken"), lane("solid"), shoulder()], (-1, -2, -4))
    after = [
        Section(0.0, linked(entry, (), (-1, -2, -3, -4)), center="solid"),
        Section(250.0, linked(ending, (-1, -2, -3, -4), (-1, -2, None, -3)), center="solid"),
        Section(250.0 + narrow_m, last, center="solid"),
    ]
    curvature = -6 * shoulder_m / join_m**2
    join = Piece(join_m, curvature, 0.0)
    pieces = [Piece(60.0), Piece(60.0, 0.0, curvature), Piece(130.0, curvature, curvature)]
    begin, split, end = (Pose(x, 0.0, 0.0) for x in (0.0, 280.0, 280.0 + join_m))
    joins = Pose(end.x, -2 * width, 0.0).after(join.reversed())
    ramp_begin = joins
    for piece in reversed(pieces):
        ramp_begin = ramp_begin.after(piece.reversed())
    junction, to_end = ("junction", 100), ("road", 2, "start")
    inside, onto = one_section(main, "solid"), one_section(joining, "solid")
    roads = [
        Road(1, "motorway before the ramp", motorway, begin, [Piece(split.x)], start, after=junction),
        Road(2, "motorway after the ramp", motorway, end, [Piece(900.0 - end.x)], after, before=junction),
        Road(3, "ramp", slow, ramp_begin, pieces, on_ramp, after=junction),
        Road(12, "motorway", motorway, split, [Piece(join_m)], inside, 100, ("road", 1, "end"), to_end),
        Road(32, "ramp to motorway", slow, joins, [join], onto, 100, ("road", 3, "end"), to_end),
    ]
    return Network("ramp", roads, [Junction(100, "ramp")])


def two_lane_road():
    """A rural road with a bend to the left of 86 degrees."""
    curvature = 1 / 120
    bend = [Piece(60.0, 0.0, curvature), Piece(120.0, curvature, curvature), Piece(60.0, curvature, 0.0)]
    pieces = [Piece(180.0), *bend, Piece(180.0)]
    sides = [[Lane("driving", constant(LANE_M), "solid"), Lane("shoulder", constant(0.5))] for _ in range(2)]
    sections = [Section(0.0, *sides, "broken")]
    return Network("two_lane_road", [Road(1, "road", ("rural", 80), Pose(0.0, 0.0, 0.0), pieces, sections)])


def two_ways():
    """Two junctions of three streets each, and two ways between them: 228 m and 387 m."""
    radius, apart = 11.0, 250.0
    side = [Piece(60.0), arc(-QUARTER, 15.0)]
    pieces = {
        "west": [Piece(150.0)],
        "direct": [Piece(apart - 2 * radius)],
        "detour": [*side, Piece(apart - 30.0), *side[::-1]],
        "east": [Piece(150.0)],
    }
    starts = [
        Pose(-radius - 150.0, 0.0, 0.0),
        Pose(radius, 0.0, 0.0),
        Pose(0.0, radius, QUARTER),
        Pose(apart + radius, 0.0, 0.0),
    ]
    ends = [{"after": 100}, {"before": 100, "after": 200}, {"before": 100, "after": 200}, {"before": 200}]
    roads = []
    for number, (name, start, at) in enumerate(zip(pieces, starts, ends), 1):
        sections = [Section(0.0, street(), street(), "broken")]
        links = {end: ("junction", junction) for end, junction in at.items()}
        roads.append(Road(number, name, TOWN, start, pieces[name], sections, **links))
    west, direct, detour, east = roads
    inside = []
    for junction, arms in (
        (100, [(west, "end"), (direct, "start"), (detour, "start")]),
        (200, [(direct, "end"), (east, "start"), (detour, "end")]),
    ):
        # The sidewalk along the first two, to the right of the first, has no street beside it.
        for k, a in enumerate(arms):
            for m, b in enumerate(arms):
                if k != m:
                    number = junction + 10 * (k + 1) + m + 1
                    inside.append(through(number, junction, a, b, radius, sidewalk=(k, m) == (0, 1)))
    return Network("two_ways", roads + inside, [Junction(100, "west"), Junction(200, "east")])


def main():
    check = sys.argv[1:] == ["--check"]
    if sys.argv[1:] and not check:
        sys.exit(__doc__)
    networks = [
        crossing("crossing", lights=True),
        crossing("crossing_right_first"),
        crossing("crossing_priority", priority=True),
        roundabout(),
        ramp(),
        two_lane_road(),
        two_ways(),
    ]
    folder = Path(__file__).resolve().parent
    stale = []
    for network in networks:
        path, content = folder / f"{network.name}.xodr", document(network)
        if not check:
            path.write_bytes(content)
        elif not path.exists() or path.read_bytes() != content:
            stale.append(path.name)
    if stale:
        sys.exit(f"{', '.join(stale)}: not as make.py makes them: run it without --check")


if __name__ == "__main__":
    main()
