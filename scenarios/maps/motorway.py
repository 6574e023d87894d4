"""The motorway of the town: two carriageways between two roundabouts, with ramps to the streets beside it."""

from network import (
    LANE_M,
    QUARTER,
    Junction,
    Lane,
    Piece,
    Pose,
    Road,
    Section,
    arc,
    constant,
    linked,
    one_section,
    smooth,
)
from streets import NORTH, SOUTH, VERGE_M, Arm, Node, Profile, displaced

LINK, RAMP = Profile(("rural", 70), sidewalk=False), Profile(("motorway", 80), sidewalk=False)
MOTORWAY = ("motorway", 100)

# Distance of the streets beside the motorway, to which its ramps lead, from its middle.
RAMPS_M = 100.0
# Radius of ramps, and length over which their shoulder begins and ends.
RAMP_RADIUS_M, RAMP_SHOULDER_M = 45.0, 30.0
# Half of the ground between the carriageways; hard shoulder.
MEDIAN_M, SHOULDER_M = 1.5, 2.5
# Lengths over which traffic joins and leaves, of lanes for that, and over which these and the second lanes begin and
# end; of roads with one lane each way before the roundabouts.
JOIN_M, ENTRY_M, ENTRY_END_M, WIDENING_M, LINK_M = 60.0, 170.0, 60.0, 80.0, 60.0
# Curvature at which a ramp meets the shoulder, which closes with the cube of the distance.
MEETS_PM = 6 * SHOULDER_M / JOIN_M**2
CLOSING = tuple(SHOULDER_M * factor / JOIN_M**k for k, factor in enumerate((1, -3, 3, -1)))
OPENING = (0.0, 0.0, 0.0, SHOULDER_M / JOIN_M**3)


def carriageway(*beside, second=constant(LANE_M), median=constant(MEDIAN_M), shoulder=constant(SHOULDER_M)):
    """Lanes of a carriageway, with those between the second lane and the shoulder."""
    outer = "broken" if beside else "solid"
    driving = [Lane("driving", constant(LANE_M), "broken"), Lane("driving", second, outer)]
    return [Lane("median", median, "solid"), *driving, *beside, Lane("shoulder", shoulder)]


def sides(lanes, before=(), after=()):
    """Lanes at the right and at the left of a road, each with the lanes that it continues and that continue it."""
    both = []
    for sign in (-1, 1):
        links = [[number and sign * number for number in numbers] for numbers in (before, after)]
        both.append(linked(lanes(sign), *links))
    return both


def link(before=(), after=()):
    """A lane each way."""

    def lanes(_):
        return [Lane("driving", constant(LANE_M), "solid"), Lane("shoulder", constant(VERGE_M))]

    return [Section(0.0, *sides(lanes, before, after), center="solid")]


def widening(length, begins):
    """Second lane, median and shoulder begin at the begin of a road, or end at its end."""

    def width(narrow, wide):
        if begins:
            return [(0.0, smooth(narrow, wide, WIDENING_M)), (WIDENING_M, constant(wide))]
        return [(0.0, constant(wide)), (length - WIDENING_M, smooth(wide, narrow, WIDENING_M))]

    def lanes(_):
        widths = {"second": width(0.0, LANE_M), "median": width(0.0, MEDIAN_M), "shoulder": width(VERGE_M, SHOULDER_M)}
        return carriageway(**widths)

    links = (None, 1, None, 2)
    return [Section(0.0, *sides(lanes, *((links, ()) if begins else ((), links))))]


def between_ramps(length):
    """Sections with a lane for joining traffic after the ramp, and for leaving traffic before it."""

    def lanes(width, begin):
        def of(sign):
            # In the direction of travel, traffic joins first.
            kind = "entry" if begin == (sign < 0) else "exit"
            return carriageway(Lane(kind, width, "solid"))

        return of

    all_five, without = (1, 2, 3, 4, 5), (1, 2, 3, None, 4)
    to_end, to_middle = smooth(LANE_M, 0.0, ENTRY_END_M), (1, 2, 3, 5)
    ends = ENTRY_M + ENTRY_END_M
    return [
        Section(0.0, *sides(lanes(constant(LANE_M), True), (), all_five)),
        Section(ENTRY_M, *sides(lanes(to_end, True), all_five, without)),
        Section(ends, *sides(lambda _: carriageway(), to_middle, to_middle)),
        Section(length - ends, *sides(lanes(smooth(0.0, LANE_M, ENTRY_END_M), False), without, all_five)),
        Section(length - ENTRY_M, *sides(lanes(constant(LANE_M), False), all_five)),
    ]


def on_ramp():
    """Pieces of a ramp from its street to the motorway; the last one joins it. An exit has them in reverse."""
    tight = 1 / RAMP_RADIUS_M
    around = [Piece(30.0, 0.0, -tight), Piece(45.0, -tight, -MEETS_PM), Piece(JOIN_M, -MEETS_PM, 0.0)]
    rest = -QUARTER - sum(piece.turned(piece.length) for piece in around)
    around.insert(1, arc(rest, RAMP_RADIUS_M))
    ahead = RAMPS_M - Node(0, "", 0.0, 0.0).across - MEDIAN_M - 2 * LANE_M
    return [Piece(ahead - displaced(around)[0]), *around]


def ramp_lanes(kind, shoulder=constant(SHOULDER_M)):
    return [Lane(kind, constant(LANE_M), "solid"), Lane("shoulder", shoulder)]


def add_motorway(town, ends, on, off):
    """Adds the motorway between roundabouts in the west and the east. Ramps lead to it from streets in the southwest
    and the northeast, and from it to streets in the northwest and the southeast."""
    (west, west_way), (east, east_way) = ends
    begin, end = west.pose(west_way), east.pose(east_way)
    aside = abs(displaced(on_ramp())[1])
    join, leave = on[0].x + aside, off[1].x - aside
    at = [begin.x, begin.x + LINK_M, join - JOIN_M, join, leave, leave + JOIN_M, end.x - LINK_M, end.x]
    kinds = (LINK.kind, MOTORWAY, MOTORWAY, MOTORWAY, LINK.kind)
    names = ("motorway begin", "motorway west", "motorway middle", "motorway east", "motorway end")
    spans = [(0, 1), (1, 2), (3, 4), (5, 6), (6, 7)]
    lengths = [at[other] - at[one] for one, other in spans]
    sections = [
        link(after=(2, 4)),
        widening(lengths[1], begins=True),
        between_ramps(lengths[2]),
        widening(lengths[3], begins=False),
        link(before=(2, 4)),
    ]
    links = [
        (("junction", west.number), ("road", 52, "start")),
        (("road", 51, "end"), ("junction", 121)),
        (("junction", 121), ("junction", 122)),
        (("junction", 122), ("road", 55, "start")),
        (("road", 54, "end"), ("junction", east.number)),
    ]
    roads = []
    for k, (before, after) in enumerate(links):
        start = Pose(at[spans[k][0]], begin.y, begin.heading)
        line = [Piece(lengths[k])]
        roads.append(Road(51 + k, names[k], kinds[k], start, line, sections[k], before=before, after=after))
    town.roads += roads
    west.arms[west_way] = Arm(roads[0], "start", LINK, 1, 1)
    east.arms[east_way] = Arm(roads[4], "end", LINK, 1, 1)
    middle = roads[2]
    add_ramps(town, (121, "ramps west"), (roads[1], "end"), (middle, "start"), (61, on[0], NORTH), (64, off[0], SOUTH))
    add_ramps(town, (122, "ramps east"), (roads[3], "start"), (middle, "end"), (63, on[1], SOUTH), (62, off[1], NORTH))


def add_ramps(town, names, outer, middle, on, off):
    """Adds a junction at which a ramp joins the carriageway to the middle, and another leaves the one from it."""
    junction, name = names
    sign = -1 if outer[1] == "end" else 1
    town.junctions.append(Junction(junction, name))
    add_carriageways(town, junction, outer, middle, sign)
    to_middle = ("road", middle[0].number, middle[1])
    *pieces, last = on_ramp()
    number, node, way = on
    begins = [(0.0, smooth(0.0, SHOULDER_M, RAMP_SHOULDER_M)), (RAMP_SHOULDER_M, constant(SHOULDER_M))]
    lanes = one_section(ramp_lanes("onRamp", begins))
    ends = {"before": ("junction", node.number), "after": ("junction", junction)}
    ramp = Road(number, f"ramp from {node.name}", RAMP.kind, node.pose(way), pieces, lanes, **ends)
    node.arms[way] = Arm(ramp, "start", RAMP, 0, 1)
    lanes = one_section(linked(ramp_lanes("onRamp"), (-1, -2), (sign * 4, sign * 5)))
    ends = {"before": ("road", number, "end"), "after": to_middle}
    joins = Road(100 * junction + 3, f"{ramp.name} joins", RAMP.kind, ramp.end(), [last], lanes, junction, **ends)
    town.roads.append(ramp)
    town.inside.append(joins)
    # A ramp for leaving is the mirror image, which ends at its street.
    number, node, way = off
    first, *rest = [Piece(piece.length, piece.end, piece.begin) for piece in reversed((*pieces, last))]
    start = node.pose(way).turned()
    for piece in reversed(rest):
        start = start.after(piece.reversed())
    full_m = sum(piece.length for piece in rest) - RAMP_SHOULDER_M
    closes = [(0.0, constant(SHOULDER_M)), (full_m, smooth(SHOULDER_M, 0.0, RAMP_SHOULDER_M))]
    lanes = one_section(ramp_lanes("offRamp", closes))
    ends = {"before": ("junction", junction), "after": ("junction", node.number)}
    ramp = Road(number, f"ramp to {node.name}", RAMP.kind, start, rest, lanes, **ends)
    node.arms[way] = Arm(ramp, "end", RAMP, 1, 0)
    lanes = one_section(linked(ramp_lanes("offRamp"), (-sign * 4, -sign * 5), (-1, -2)))
    ends = {"before": to_middle, "after": ("road", number, "start")}
    begin = start.after(first.reversed())
    leaves = Road(100 * junction + 4, f"{ramp.name} leaves", RAMP.kind, begin, [first], lanes, junction, **ends)
    town.roads.append(ramp)
    town.inside.append(leaves)


def add_carriageways(town, junction, outer, middle, sign):
    """Adds the carriageways between two ends of the motorway, whose lanes to the middle have this sign. A ramp takes
    the place of the shoulder of the one to the middle, and begins beside the other one."""
    ends = [("road", road.number, end) for road, end in (outer, middle)]
    names = [f"{one[0].name} to {other[0].name}" for one, other in ((outer, middle), (middle, outer))]
    with_shoulder, without = (1, 2, 3, 4), (1, 2, 3, None)
    for k, (links, side, shoulder) in enumerate(
        (((with_shoulder, without), sign, CLOSING), ((without, with_shoulder), -sign, OPENING))
    ):
        road, end = (outer, middle)[k]
        start = road.end() if end == "end" else road.start.turned()
        numbers = [[number and side * number for number in of_end] for of_end in links]
        lanes = one_section(linked(carriageway(shoulder=shoulder), *numbers))
        before, after = ends[k], ends[1 - k]
        number, line = 100 * junction + k + 1, [Piece(JOIN_M)]
        town.inside.append(Road(number, names[k], MOTORWAY, start, line, lanes, junction, before, after))
