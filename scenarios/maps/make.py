#!/usr/bin/env python3
"""Makes the road networks of scenarios: the OpenDRIVE 1.7 files of this folder.

usage: make.py [--check]

Writes the files beside this script; with --check, compares them and fails if they differ. The files are the same on
every machine.

Frame: metres, x east, y north; flat, but for a hill of the town; right-hand traffic. Arms of a junction lead to it:
lane -1 is incoming, lane 1 outgoing. docs/howto/read_a_map.md lists the networks and the numbers of their roads.
"""

import math
import sys
from pathlib import Path

# No folder of compiled modules beside the maps.
sys.dont_write_bytecode = True

from network import (
    LANE_M,
    QUARTER,
    RING_LANE_M,
    TOWN,
    TURN_RADIUS_M,
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
    document,
    linked,
    one_section,
    ring,
    smooth,
    street,
)
from town import town

ARMS = ("east", "north", "west", "south")


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
        arms_of = {road.number: (road.before[1], road.after[1]) for road in inside}
        pairs = [(a.number, b.number) for a in main for b in side]
        junction.priorities = [(a, b) for a, b in pairs if conflict(arms_of[a], arms_of[b])]
    return Network(name, arms + inside, [junction], controllers)


def roundabout():
    """A roundabout with one lane."""
    border, apart, inner = ring()
    roads, junctions = [], []
    for k in range(4):
        to_ring = arm(k, inner, 120.0, 101 + k)
        add_yield_sign(to_ring)
        roads += [to_ring, *around_arm(to_ring, k * QUARTER, border, apart)]
        junctions.append(Junction(101 + k, to_ring.name, [(41 + k, 21 + k)]))
    numbers = [junction.number for junction in junctions]
    return Network("roundabout", roads, junctions, roundabouts={"roundabout": numbers})


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
        town(),
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
