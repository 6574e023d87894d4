"""The town: streets and junctions of all kinds, a roundabout at each end, a motorway with ramps, and a hill.

North of the town, the motorway leads from the western roundabout to the eastern one; the hill road is beyond it. East
and west mirror each other, and the ramps of the hill road are those of the north street turned by half a turn.
"""

from motorway import RAMPS_M, add_motorway
from network import QUARTER, constant, smooth
from streets import EAST, NORTH, SOUTH, WEST, Node, Profile, Roundabout, Town, bend, corner

STREET, PARKING, ZONE, ZONE_PARKING = (
    Profile(("town", limit), parking=parking) for limit in (50, 30) for parking in (False, True)
)
MAIN, LINK = Profile(("town", 50), lanes=2), Profile(("rural", 70), sidewalk=False)
COUNTRY = Profile(("rural", 80), sidewalk=False)

# Middle of the town, and of the motorway.
MIDDLE_X_M, MOTORWAY_Y_M = 300.0, 550.0
# Distances of the streets to which ramps lead, and of roundabouts, from the middle.
RAMP_X_M, ROUNDABOUT_X_M = 400.0, 550.0
# Height of the hill, and lengths of its slopes: 5 % in their middle.
HILL_M, SLOPE_M = 5.0, 150.0


def town():
    """The network of the town."""
    made = Town()
    west = Roundabout(131, "west", MIDDLE_X_M - ROUNDABOUT_X_M, MOTORWAY_Y_M, (EAST, NORTH, SOUTH))
    east = Roundabout(134, "east", MIDDLE_X_M + ROUNDABOUT_X_M, MOTORWAY_Y_M, (NORTH, WEST, SOUTH))
    nodes = junctions()
    add_streets(made, nodes, west, east)
    on, off = ([nodes["d_west"], nodes["e_east"]], [nodes["e_west"], nodes["d_east"]])
    add_motorway(made, [west.end(EAST), east.end(WEST)], on, off)
    for node in nodes.values():
        made.add_junction(node)
    for roundabout in (west, east):
        made.add_roundabout(roundabout)
    return made.network()


def junctions():
    """Junctions by letter of their street from the south to the north, and number from the west to the east."""
    main = {"along": 11.0, "across": 14.0, "lights": True}
    everywhere = (EAST, NORTH, WEST, SOUTH)
    y = {"a": 0.0, "b": 150.0, "c": 300.0, "d": MOTORWAY_Y_M - RAMPS_M, "e": MOTORWAY_Y_M + RAMPS_M}
    ramps = [MIDDLE_X_M - RAMP_X_M, MIDDLE_X_M + RAMP_X_M]
    x = [0.0, 200.0, 400.0, 600.0]
    placed = {
        "a1": (101, x[1], {"signs": {NORTH: "yield"}, "zebras": (NORTH,)}),
        "a2": (102, x[2], {"signs": {NORTH: "stop"}, "zebras": (NORTH,)}),
        "b0": (103, x[0], {"signs": {EAST: "stop"}, "zebras": (EAST,)}),
        "b1": (104, x[1], {"zebras": (NORTH, SOUTH)}),
        "b2": (105, x[2], {}),
        "b3": (106, x[3], {"signs": {WEST: "yield"}, "zebras": (WEST,)}),
        "c0": (107, x[0], {**main, "zebras": (EAST, NORTH)}),
        "c1": (108, x[1], {**main, "zebras": everywhere}),
        "c2": (109, x[2], {**main, "zebras": everywhere}),
        "c3": (110, x[3], {**main, "zebras": (WEST, SOUTH)}),
        "d0": (111, x[0], {"signs": {SOUTH: "yield"}, "zebras": (SOUTH,)}),
        "d1": (112, x[1], {"signs": {SOUTH: "yield"}, "zebras": (SOUTH,)}),
        "d2": (113, x[2], {}),
        "d3": (114, x[3], {"signs": {SOUTH: "stop"}, "zebras": (SOUTH,)}),
        "d_west": (115, ramps[0], {"zebras": (EAST,)}),
        "d_east": (116, ramps[1], {"signs": {NORTH: "yield"}, "zebras": (WEST,)}),
        "e_west": (117, ramps[0], {"signs": {SOUTH: "yield"}}),
        "e_east": (118, ramps[1], {}),
    }
    return {name: Node(number, name, at, y[name[0]], **kind) for name, (number, at, kind) in placed.items()}


def add_streets(made, nodes, west, east):
    def street(number, name, profile, start, start_way, end, end_way, **more):
        made.street(number, name, profile, [(nodes[start], start_way), (nodes[end], end_way)], **more)

    left, right = QUARTER, -QUARTER
    # South.
    street(1, "south street west", STREET, "b0", SOUTH, "a1", WEST, shape=corner(left))
    street(2, "south street", STREET, "a1", EAST, "a2", WEST, shape=bend(20.0, -80.0), zebras=(89.0,))
    street(3, "south street east", STREET, "a2", EAST, "b3", SOUTH, shape=corner(left))
    # The zone in the middle.
    street(11, "church street west", ZONE, "b0", EAST, "b1", WEST)
    street(12, "church street", ZONE_PARKING, "b1", EAST, "b2", WEST)
    street(13, "church street east", ZONE, "b2", EAST, "b3", WEST, zebras=(89.0,))
    street(14, "mill lane south", ZONE, "a1", NORTH, "b1", SOUTH)
    street(15, "mill lane north", ZONE, "b1", NORTH, "c1", SOUTH)
    street(16, "market lane south", ZONE, "a2", NORTH, "b2", SOUTH)
    street(17, "market lane north", ZONE, "b2", NORTH, "c2", SOUTH)
    # The main street, and the streets across it.
    for number, (one, other) in enumerate((("c0", "c1"), ("c1", "c2"), ("c2", "c3")), 21):
        street(number, f"main street {number - 20}", MAIN, one, EAST, other, WEST)
    street(24, "west street south", STREET, "b0", NORTH, "c0", SOUTH)
    street(25, "west street north", STREET, "c0", NORTH, "d0", SOUTH)
    street(26, "mill street", STREET, "c1", NORTH, "d1", SOUTH)
    street(27, "market street", PARKING, "c2", NORTH, "d2", SOUTH)
    street(28, "east street south", STREET, "b3", NORTH, "c3", SOUTH)
    street(29, "east street north", STREET, "c3", NORTH, "d3", SOUTH)
    # North.
    street(31, "north street west", STREET, "d_west", EAST, "d0", WEST)
    street(32, "north street 1", STREET, "d0", EAST, "d1", WEST, zebras=(89.0,))
    street(33, "north street 2", STREET, "d1", EAST, "d2", WEST)
    street(34, "north street 3", STREET, "d2", EAST, "d3", WEST, shape=bend(20.0, 80.0))
    street(35, "north street east", STREET, "d3", EAST, "d_east", WEST)
    # To the roundabouts, and over the hill.
    made.street(36, "west link", LINK, [west.end(SOUTH), (nodes["d_west"], WEST)], shape=corner(left))
    made.street(37, "east link", LINK, [(nodes["d_east"], EAST), east.end(SOUTH)], shape=corner(left))
    made.street(41, "hill road west", LINK, [west.end(NORTH), (nodes["e_west"], WEST)], shape=corner(right))
    hill = made.street(
        42, "hill road", COUNTRY, [(nodes["e_west"], EAST), (nodes["e_east"], WEST)], shape=bend(50.0, 160.0)
    )
    made.street(43, "hill road east", LINK, [(nodes["e_east"], EAST), east.end(NORTH)], shape=corner(right))
    add_hill(hill)


def add_hill(road):
    """A hill in the middle of a road, up and down with the slope 0 at both ends. The crest hides oncoming traffic."""
    begin, middle = 0.5 * road.length() - SLOPE_M, 0.5 * road.length()
    up, down = smooth(0.0, HILL_M, SLOPE_M), smooth(HILL_M, 0.0, SLOPE_M)
    road.elevation = [(0.0, constant(0.0)), (begin, up), (middle, down), (middle + SLOPE_M, constant(0.0))]
