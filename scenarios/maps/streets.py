"""Streets and their junctions, at right angles: lanes, marks, lights, signs, zebra crossings, roundabouts."""

import math
from dataclasses import dataclass, field

from network import (
    LANE_M,
    QUARTER,
    RING_LANE_M,
    TURN_RADIUS_M,
    Crosswalk,
    Junction,
    Lane,
    Network,
    Piece,
    Pose,
    Road,
    Section,
    Signal,
    arc,
    conflict,
    constant,
    linked,
    one_section,
    ring,
    rounded,
    smooth,
)

# Directions of arms, in quarters of a turn.
EAST, NORTH, WEST, SOUTH = range(4)
DIRECTIONS = ("east", "north", "west", "south")

SIDEWALK_M, VERGE_M, PARKING_M = 2.5, 0.5, 2.2
# No overtaking before a junction and after it.
NEAR_M = 30.0
# Width of zebra crossings along the road; their distance from a junction, and that of the lines before them.
ZEBRA_M, ZEBRA_AT_M, LIGHT_LINE_M = 3.0, 3.0, 5.5
# Before a place to give way, a car stands between it and the crossing.
ZEBRA_BEFORE_YIELD_M = 8.0
PARKING_FROM_M, PARKING_TAPER_M = 24.0, 6.0
# Ground inside a roundabout for the rear wheels of trucks.
APRON_M = 2.0


@dataclass
class Profile:
    kind: tuple
    # Lanes each way.
    lanes: int = 1
    sidewalk: bool = True
    parking: bool = False


@dataclass
class Arm:
    """An end of a road at a junction."""

    road: Road
    end: str
    profile: Profile
    # Lanes that lead to the junction, and from it.
    lanes_in: int
    lanes_out: int

    def inwards(self):
        """Pose of the end, in the direction of the junction."""
        return self.road.end() if self.end == "end" else self.road.start.turned()

    def outwards(self):
        return self.inwards().turned()

    def side(self):
        """Sign of the lanes that lead to the junction."""
        return -1 if self.end == "end" else 1

    def link(self):
        return ("road", self.road.number, self.end)

    def sidewalk(self):
        """Number of the sidewalks' lanes."""
        return self.profile.lanes + 1 if self.profile.sidewalk else None

    def place(self, back, aside):
        """Place before the junction, beside the lanes that lead to it."""
        return {"s": self.road.length() - back if self.end == "end" else back, "t": self.side() * aside}


@dataclass
class Node:
    """A junction of streets at right angles: lights, signs at some arms, or neither."""

    number: int
    name: str
    x: float
    y: float
    lights: bool = False
    # Kind of the sign of each arm that gives way.
    signs: dict = field(default_factory=dict)
    # Arms with a zebra crossing.
    zebras: tuple = ()
    # Distance of arms from the middle: in the direction of wide streets, and across them.
    along: float = 11.0
    across: float = 11.0
    arms: dict = field(default_factory=dict)

    def pose(self, direction):
        """End of an arm, in its direction."""
        apart = self.along if direction in (EAST, WEST) else self.across
        heading = direction * QUARTER
        return Pose(self.x + apart * math.cos(heading), self.y + apart * math.sin(heading), heading)


def straight(length, _):
    return [Piece(length)]


def bend(spiral, radius):
    """Shape of a street that swings out to the left and back to its line; with a negative radius, to the right."""

    def pieces(length, _):
        out = [Piece(spiral, 0.0, 1 / radius), Piece(spiral, 1 / radius, 0.0)]
        back = [Piece(spiral, 0.0, -1 / radius), Piece(spiral, -1 / radius, 0.0)]
        swing = [*out, *back, *back, *out]
        rest = 0.5 * (length - displaced(swing)[0])
        return [Piece(rest), *swing, Piece(rest)]

    return pieces


def corner(turn, radius=40.0, spiral=20.0):
    """Shape of a street around a corner of 90 degrees, between two spirals."""

    def pieces(ahead, aside):
        curvature = math.copysign(1 / radius, turn)
        rest = arc(turn - math.copysign(spiral / radius, turn), radius)
        around = [Piece(spiral, 0.0, curvature), rest, Piece(spiral, curvature, 0.0)]
        x, y = displaced(around)
        return [Piece(ahead - x), *around, Piece(abs(aside) - abs(y))]

    return pieces


def displaced(pieces):
    """Way ahead and to the left from the begin of pieces to their end."""
    pose = Pose(0.0, 0.0, 0.0)
    for piece in pieces:
        pose = pose.after(piece)
    return pose.x, pose.y


def records(length, solid):
    """Marks along a road: solid between these places, else broken."""
    marks = []
    at = 0.0
    for begin, end in sorted((max(begin, 0.0), min(end, length)) for begin, end in solid):
        if begin > at + 5.0:
            marks.append((at, "broken"))
        else:
            begin = at
        if not marks or marks[-1][1] == "broken":
            marks.append((begin, "solid"))
        at = max(at, end)
    if length > at + 1e-6:
        marks.append((at, "broken"))
    return marks


def clipped(marks, begin, end):
    """Marks of a part of a road, from its begin on."""
    first = [mark for mark in marks if mark[0] <= begin][-1]
    return [(0.0, first[1]), *((s - begin, mark) for s, mark in marks if begin < s < end)]


def side(profile, length, forward):
    """Lanes of one side of a street. No lane is left shortly before a junction."""
    near = (length - NEAR_M, length) if forward else (0.0, NEAR_M)
    between = records(length, [near])
    marks = [between] * (profile.lanes - 1) + ["solid"]
    beside = Lane("sidewalk", constant(SIDEWALK_M)) if profile.sidewalk else Lane("shoulder", constant(VERGE_M))
    return [*(Lane("driving", constant(LANE_M), mark) for mark in marks), beside]


def with_parking(length):
    """Lanes of one side of a part of a street with parking cars."""
    taper = PARKING_TAPER_M
    widths = [(0.0, smooth(0.0, PARKING_M, taper)), (taper, constant(PARKING_M))]
    widths.append((length - taper, smooth(PARKING_M, 0.0, taper)))
    driving = Lane("driving", constant(LANE_M), "broken")
    return [driving, Lane("parking", widths), Lane("sidewalk", constant(SIDEWALK_M))]


def sections(profile, length, center):
    """Lane sections of a street with these marks in its middle. Parking cars keep away from junctions."""
    if not profile.parking:
        return [Section(0.0, side(profile, length, True), side(profile, length, False), center)]
    begin, end = PARKING_FROM_M, length - PARKING_FROM_M
    parts = []
    for k, (one, other) in enumerate(((0.0, begin), (begin, end), (end, length))):
        lanes = [with_parking(other - one) if k == 1 else side(profile, other - one, True) for _ in range(2)]
        before, after = [((), (1, 3)), ((1, None, 2), (1, None, 2)), ((1, 3), ())][k]
        for sign, of_side in zip((-1, 1), lanes):
            linked(of_side, *([number and sign * number for number in links] for links in (before, after)))
        parts.append(Section(one, *lanes, clipped(center, one, other)))
    return parts


class Town:
    """Streets and junctions so far."""

    def __init__(self):
        self.roads, self.inside, self.junctions, self.controllers = [], [], [], []
        self.roundabouts = {}

    def street(self, number, name, profile, ends, shape=straight, zebras=()):
        """Adds a street between arms of two junctions, with zebra crossings at these places."""
        (one, one_way), (other, other_way) = ends
        start, target = one.pose(one_way), other.pose(other_way)
        dx, dy = target.x - start.x, target.y - start.y
        cos, sin = math.cos(start.heading), math.sin(start.heading)
        pieces = shape(dx * cos + dy * sin, dy * cos - dx * sin)
        length = sum(piece.length for piece in pieces)
        lines = [(0.0, NEAR_M), (length - NEAR_M, length), *bends(pieces)]
        lines += [(s - 15.0, s + 15.0) for s in zebras]
        links = {"before": ("junction", one.number), "after": ("junction", other.number)}
        # No overtaking over the middle of a wide street.
        center = "solid solid" if profile.lanes > 1 else records(length, lines)
        of_road = sections(profile, length, center)
        road = Road(number, name, profile.kind, start, pieces, of_road, **links)
        for k, s in enumerate(zebras, 1):
            add_zebra(road, profile, s, f"zebra_{number}_{k}")
        self.roads.append(road)
        for (node, way), end in zip(ends, ("start", "end")):
            node.arms[way] = Arm(road, end, profile, profile.lanes, profile.lanes)
        return road

    def add_junction(self, node):
        """Adds a junction with its ways, signs or lights, and zebra crossings, when it has all arms."""
        arms = sorted(node.arms.items())
        ways = {}
        for k, (one_way, one) in enumerate(arms):
            beside = arms[(k + 1) % len(arms)][0]
            for m, (other_way, other) in enumerate(arms):
                if k != m and one.lanes_in and other.lanes_out:
                    number = 100 * node.number + 10 * (one_way + 1) + other_way + 1
                    road = through(number, node.number, (one_way, one), (other_way, other), other_way == beside)
                    ways[road.number] = (road, (k, m))
        self.inside += [road for road, _ in ways.values()]
        places = {way: k for k, (way, _) in enumerate(arms)}
        minor = {places[way] for way in node.signs}
        first = [way for way in ways.values() if way[1][0] not in minor]
        second = [way for way in ways.values() if way[1][0] in minor]
        pairs = [(a.number, b.number) for a, by_a in first for b, by_b in second if conflict(by_a, by_b)]
        junction = Junction(node.number, node.name, pairs)
        for way, arm in arms:
            at = f"{node.name}_{DIRECTIONS[way]}"
            if way in node.zebras:
                back = ZEBRA_BEFORE_YIELD_M if way in node.signs else ZEBRA_AT_M
                add_zebra(arm.road, arm.profile, arm.place(back, 0.0)["s"], f"zebra_{at}")
            if node.lights:
                add_light(arm, at)
            elif way in node.signs:
                add_sign(arm, at, node.signs[way])
        if node.lights:
            for name, pair in (("north_south", (NORTH, SOUTH)), ("east_west", (EAST, WEST))):
                lights = [f"light_{node.name}_{DIRECTIONS[way]}" for way in pair if way in node.arms]
                self.controllers.append((f"{node.name}_{name}", lights))
                junction.controllers.append(f"{node.name}_{name}")
        self.junctions.append(junction)

    def add_roundabout(self, roundabout):
        """Adds the ring of a roundabout, with entries and exits, when it has all arms."""
        arms = [(way, node, node.arms[way]) for way, node in sorted(roundabout.nodes.items())]
        for k, (way, node, arm) in enumerate(arms):
            last, (next_way, following, _) = arms[k - 1], arms[(k + 1) % len(arms)]
            roads = roundabout.around(way, node, arm, last[1], (next_way, following))
            self.roads.append(roads[0])
            self.inside += roads[1:]
            entry, _, past = roads[1:]
            self.junctions.append(Junction(node.number, node.name, [(past.number, entry.number)]))
            add_sign(arm, node.name, "yield")
        self.roundabouts[roundabout.name] = [node.number for _, node, _ in arms]

    def network(self):
        return Network("town", self.roads + self.inside, self.junctions, self.controllers, self.roundabouts)


def bends(pieces):
    """Places of bends and 20 m beside them."""
    s = 0.0
    for piece in pieces:
        if piece.begin or piece.end:
            yield (s - 20.0, s + piece.length + 20.0)
        s += piece.length


def add_zebra(road, profile, s, name):
    width = 2 * profile.lanes * LANE_M
    road.crosswalks.append(Crosswalk(name, s, 0.0, (ZEBRA_M, width)))


def add_stop(arm, at, line_kind, back, signal_back, **signal):
    lanes = (arm.side(), arm.side() * arm.lanes_in)
    width = arm.lanes_in * LANE_M
    line = f"line_{at}"
    arm.road.signals += [
        Signal(line, **arm.place(back, width / 2), kind=line_kind, size=(width, 0.5), lanes=lanes),
        Signal(**arm.place(signal_back, width + 0.5), line=line, lanes=lanes, **signal),
    ]


def add_light(arm, name):
    light = {"kind": "1000001", "country": "OpenDRIVE", "z": 2.2, "size": (0.3, 0.9)}
    add_stop(arm, name, "294", LIGHT_LINE_M, 0.0, name=f"light_{name}", **light)


def add_sign(arm, name, kind):
    """A yield or stop sign, with its line 0.5 m before the junction."""
    line, number = {"yield": ("341", "205"), "stop": ("294", "206")}[kind]
    add_stop(arm, name, line, 0.5, 0.5, name=f"{kind}_{name}", kind=number, z=2.0, size=(0.9, 0.9))


def through(number, junction, one, other, beside):
    """Road through a junction: straight on, or around an arc that touches the left borders of the lanes that it joins.
    The sidewalk is beside ways to the next arm at the right."""
    (one_way, a), (other_way, b) = one, other
    turn = (other_way - one_way - 2) % 4
    count = min(a.lanes_in, b.lanes_out) if turn == 0 else 1
    # The first lane, from the middle of the road.
    first_in, first_out = (a.lanes_in, b.lanes_out) if turn == 3 else (1, 1)
    start = a.inwards().aside(LANE_M * (first_in - 1))
    pieces = between(start, b.outwards().aside(LANE_M * (first_out - 1)))
    lanes = [Lane("driving", constant(LANE_M)) for _ in range(count)]
    before = [a.side() * (first_in + k) for k in range(count)]
    after = [-b.side() * (first_out + k) for k in range(count)]
    if beside and a.sidewalk() and b.sidewalk():
        lanes.append(Lane("sidewalk", constant(SIDEWALK_M)))
        before.append(a.side() * a.sidewalk())
        after.append(-b.side() * b.sidewalk())
    kind = ("town", min(a.profile.kind[1], b.profile.kind[1], 50))
    name = f"{a.road.name} to {b.road.name}"
    links = {"before": a.link(), "after": b.link()}
    return Road(number, name, kind, start, pieces, one_section(linked(lanes, before, after)), junction, **links)


def between(start, end):
    """Line, or an arc that touches the lines through both poses with one more line."""
    dx, dy = end.x - start.x, end.y - start.y
    turn = math.remainder(end.heading - start.heading, math.tau)
    if abs(turn) < 1e-6:
        return [Piece(math.hypot(dx, dy))]
    # Distances from both to the place at which the lines meet.
    before = (dx * math.sin(end.heading) - dy * math.cos(end.heading)) / math.sin(turn)
    after = (dy * math.cos(start.heading) - dx * math.sin(start.heading)) / math.sin(turn)
    touch = min(before, after)
    radius = rounded(touch / math.tan(abs(turn) / 2))
    pieces = [Piece(before - touch), arc(turn, radius), Piece(after - touch)]
    return [piece for piece in pieces if piece.length > 1e-6]


class Roundabout:
    """A roundabout with one lane, whose arms are junctions with numbers from the first on."""

    def __init__(self, first, name, x, y, ways):
        self.name, self.x, self.y = name, x, y
        self.border, self.apart, inner = ring()
        self.nodes = {
            way: Node(first + k, f"{name}_{DIRECTIONS[way]}", x, y, along=inner, across=inner)
            for k, way in enumerate(ways)
        }

    def end(self, way):
        """End of a street at an arm."""
        return self.nodes[way], way

    def on_ring(self, angle):
        x, y = self.x + self.border * math.cos(angle), self.y + self.border * math.sin(angle)
        return Pose(x, y, angle + QUARTER)

    def around(self, way, node, arm, last, following):
        """Roads at an arm: the ring to the next arm, the entry, the exit, the ring past the arm. The ring after an arm
        has ten times its junction's number."""
        angle, number = way * QUARTER, node.number
        next_way, next_node = following
        turn = arc(self.apart - QUARTER, TURN_RADIUS_M)
        past = arc(2 * self.apart, self.border)
        along = arc((next_way - way) % 4 * QUARTER - 2 * self.apart, self.border)
        begin, end = self.on_ring(angle - self.apart), self.on_ring(angle + self.apart)

        def apron():
            return [Lane("shoulder", constant(APRON_M))]

        def lanes(width):
            return [Lane("driving", width, "solid"), Lane("shoulder", constant(VERGE_M))]

        from_arm, to_arm = [(sign, 2 * sign) for sign in (arm.side(), -arm.side())]
        entry = linked(lanes(smooth(LANE_M, RING_LANE_M, turn.length)), from_arm, (-1, -2))
        leave = linked(lanes(smooth(RING_LANE_M, LANE_M, turn.length)), (-1, -2), to_arm)
        across = linked([Lane("driving", constant(RING_LANE_M))], (-1,), (-1,))
        sections = [
            [Section(0.0, lanes(constant(RING_LANE_M)), apron(), "solid")],
            one_section(entry),
            one_section(leave),
            [Section(0.0, across, linked(apron(), (1,), (1,)), "solid")],
        ]
        of_arm, on, before = arm.link(), ("road", 10 * number, "start"), ("road", 10 * last.number, "end")
        kind, to_next = ("town", 50), ("junction", next_node.number)
        return [
            Road(10 * number, f"ring {node.name}", kind, end, [along], sections[0], -1, ("junction", number), to_next),
            Road(100 * number + 1, f"entry {node.name}", kind, arm.inwards(), [turn], sections[1], number, of_arm, on),
            Road(100 * number + 2, f"exit {node.name}", kind, begin, [turn], sections[2], number, before, of_arm),
            Road(100 * number + 3, f"past {node.name}", kind, begin, [past], sections[3], number, before, on),
        ]
