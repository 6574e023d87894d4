#!/usr/bin/env python3
"""Makes the routes of the driving score: the scenarios of this folder, in the town of ../maps.

usage: make.py [--check]

Writes the files beside this script; with --check, compares them and fails if they differ.

Each route has traffic, and scenarios of the ten types of CARLA's Leaderboard 1.0 that begin when the ego comes near.
Places are along the ego's route: `s` metres from the begin of its first lane, `d` metres to the left of the centre of
its lane. Road users wait beside the road, beyond the pavement, and end there: nobody stands in a lane before or after.

Every scenario can be solved by a careful driver: when a road user reaches the ego's lane, an ego at the speed limit is
at least the distance away in which it stops after 1 s of reaction with 4 m/s2, and 5 m more. `distance_m` is that rule.
Vehicles that cross the ego's way in a junction have the right of way: they brake for nobody. Slippery patches are in
bends, between the scenarios with road users: who drives the bend with 2 m/s2 has 2 m/s2 left for the brakes.
"""

import math
import sys
from dataclasses import dataclass
from pathlib import Path

REACTION_S, BRAKE_MPS2, SPARE_M = 1.0, 4.0, 5.0
# Half the ego's length, and half the width of a lane.
EGO_M, LANE_M = 2.5, 1.75
WALK_MPS, RIDE_MPS, SLOW_MPS, PULL_MPS = 1.2, 2.5, 4.0, 5.0
# Friction and length of a slippery patch.
PATCH_FRICTION, PATCH_M = 0.3, 15.0


@dataclass
class Street:
    """Speed limit, and distances of the ends of the pavements from the centre of the ego's lane."""

    limit_kmh: float
    right_m: float
    left_m: float


STREET, ZONE = Street(50, 4.25, 7.75), Street(30, 4.25, 7.75)
PARKING, ZONE_PARKING = Street(50, 6.45, 9.95), Street(30, 6.45, 9.95)
# The inner and the outer lane of the main street.
INNER, OUTER = Street(50, 7.75, 11.25), Street(50, 4.25, 14.75)
LINK, COUNTRY = Street(70, 2.25, 5.75), Street(80, 2.25, 5.75)


def distance_m(limit_kmh, until_s):
    """Distance of the ego's centre at which a road user begins that reaches its lane `until_s` later."""
    v = limit_kmh / 3.6
    return v * until_s + v * REACTION_S + v * v / (2 * BRAKE_MPS2) + EGO_M + SPARE_M


def actor(name, kind, place, trigger_m=None, motion=(), **more):
    lines = ["[[actor]]", f'name = "{name}"', f'kind = "{kind}"']
    lines += [f"{key} = {value}" for key, value in {**place, **more}.items()]
    if trigger_m is not None:
        lines.append(f'trigger = {{ reaches = {{ who = "ego", s_m = {trigger_m:.1f} }} }}')
    if motion:
        lines.append("motion = [" + ", ".join(motion) + "]")
    return "\n".join(lines) + "\n"


def along(s, d):
    return {"s_m": f"{s:.1f}", "d_m": f"{d:.2f}"}


def path(speed_mps, *points):
    listed = ", ".join(f"[{s:.1f}, {d:.2f}]" for s, d in points)
    return f"{{ path = {{ speed_mps = {speed_mps}, points = [{listed}] }} }}"


def control_loss(name, s):
    """Type 1: the ego's lane is slippery from `s` on, in a bend."""
    keys = [f"friction = {PATCH_FRICTION}", f"s_m = {s:.1f}", f"length_m = {PATCH_M}"]
    return "\n".join(["[[slippery]]", f'name = "{name}"', *keys]) + "\n"


def walker(name, s, street, begin_m):
    """A person who walks from `begin_m` to the right over the whole road."""
    trigger_m = s - distance_m(street.limit_kmh, (begin_m - LANE_M) / WALK_MPS)
    way_m = begin_m + street.left_m + 1.0
    walk = f'{{ walk = {{ speed_mps = {WALK_MPS}, distance_m = {way_m:.2f}, direction = "left" }} }}'
    return actor(name, "pedestrian", along(s, -begin_m), trigger_m, [walk])


def crossing_pedestrian(name, s, street):
    """Type 3: a person crosses in plain sight."""
    return walker(name, s, street, street.right_m + 0.6)


def hidden_pedestrian(name, s, street):
    """Type 3, with sight obstruction: a van beside the road hides the person until the pavement."""
    size = "{ length_m = 5.5, width_m = 2.0, height_m = 2.3 }"
    van = actor(f"{name}_van", "car", along(s - 3.6, -street.right_m - 1.3), size=size)
    return van + "\n" + walker(name, s, street, street.right_m + 1.6)


def rider(name, s, street, limit_kmh):
    """A cyclist who rides straight over the road from the right."""
    begin_m = street.right_m + 1.5
    trigger_m = s - distance_m(limit_kmh, (begin_m - LANE_M - 0.9) / RIDE_MPS)
    way_m = begin_m + street.left_m + 2.0
    ride = f'{{ drive = {{ along = "heading", speed_mps = {RIDE_MPS}, distance_m = {way_m:.2f} }} }}'
    return actor(name, "cyclist", along(s, -begin_m), trigger_m, [ride], heading_rad=f"{math.pi / 2:.5f}")


def crossing_cyclist(name, s, street):
    """Type 3: a cyclist crosses from a driveway."""
    return rider(name, s, street, street.limit_kmh)


def red_light_runner(name, s, street):
    """Type 7: a cyclist rides over the road behind the lights, which are green for the ego."""
    return rider(name, s, street, street.limit_kmh)


def cyclist_after_turn(name, s, street):
    """Type 4: a cyclist crosses where the ego comes out of a turn, which it drives with less than 20 km/h."""
    return rider(name, s, street, 20.0)


def slow_cyclist(name, s, street):
    """Type 5: a slow cyclist ahead, for 55 m."""
    begin_m = street.right_m + 1.0
    until_s = math.hypot(6.0, begin_m - 1.1) / SLOW_MPS * (begin_m - LANE_M) / (begin_m - 1.1)
    ride = f'{{ drive = {{ along = "road", speed_mps = {SLOW_MPS}, distance_m = 55.0 }} }}'
    motion = [path(SLOW_MPS, (s + 6.0, -1.1)), ride, path(SLOW_MPS, (s + 69.0, -begin_m - 0.5))]
    return actor(name, "cyclist", along(s, -begin_m), s - distance_m(street.limit_kmh, until_s), motion)


def lead_brakes(name, s, street):
    """Type 2: a car pulls out, drives ahead at 9 m/s, and brakes to rest with 4 m/s2."""
    begin_m = street.right_m + 2.0
    until_s = math.hypot(12.0, begin_m) / PULL_MPS * (begin_m - LANE_M - 0.9) / begin_m
    speeds = "[[0.0, 5.0], [2.0, 9.0], [6.0, 9.0], [8.25, 0.0], [11.0, 0.0], [13.0, 7.0]]"
    drive = f'{{ drive = {{ along = "road", speeds = {speeds}, distance_m = 81.0 }} }}'
    motion = [path(PULL_MPS, (s + 12.0, 0.0)), drive, path(PULL_MPS, (s + 105.0, -begin_m))]
    return actor(name, "car", along(s, -begin_m), s - distance_m(street.limit_kmh, until_s), motion)


def through(name, s, start, goal):
    """Types 8 to 10: a car drives through the junction that the ego enters at `s`. It comes from a place beside a lane,
    36 m before the junction, and leaves the lane 86 m after it has entered it."""
    road, lane, length_m = start
    at_m = length_m - 36.0
    place = {
        "start": f'{{ road = "{road}", lane = {lane}, s_m = {at_m if lane < 0 else 36.0:.1f} }}',
        "goal": f'{{ road = "{goal[0]}", lane = {goal[1]}, s_m = 60.0 }}',
        "d_m": -8.0,
    }
    drive = '{ drive = { along = "road", speed_mps = 7.0, distance_m = 86.0 } }'
    motion = [path(6.0, (at_m + 12.0, 0.0)), drive, path(6.0, (at_m + 110.0, -8.0))]
    # An ego at 30 km/h comes to the junction 0.5 s after the car, which needs 2.4 s to its lane and 3.4 s from there.
    return actor(name, "car", place, s - 8.3 * 6.3, motion)


def oncoming_at_left_turn(name, s, *ways):
    """Type 8: oncoming traffic at a left turn."""
    return through(name, s, *ways)


def crossing_at_right_turn(name, s, *ways):
    """Type 9: crossing traffic at a right turn."""
    return through(name, s, *ways)


def crossing_without_lights(name, s, *ways):
    """Type 10: negotiation at a junction without lights."""
    return through(name, s, *ways)


def place(road, lane, s):
    return f'{{ road = "{road}", lane = {lane}, s_m = {s:.1f} }}'


# Start, places on the way and goal (road, lane, s), target speed, and scenarios in the order of the way.
ROUTES = [
    (
        [(31, -1, 20), (26, 1, 60), (22, -1, 100), (17, 1, 60), (2, 1, 100), (1, 1, 150), (24, -1, 40), (25, -1, 60)],
        13.9,
        [
            (crossing_pedestrian, 140, STREET),
            (hidden_pedestrian, 220, STREET),
            (cyclist_after_turn, 301, STREET),
            (crossing_pedestrian, 370, STREET),
            (control_loss, 421),
            (cyclist_after_turn, 641, ZONE),
            (crossing_without_lights, 757.9, (12, -1, 178), (13, -1)),
            (hidden_pedestrian, 850, ZONE),
            (crossing_cyclist, 1000, STREET),
            (lead_brakes, 1220, STREET),
            (red_light_runner, 1611, STREET),
        ],
    ),
    (
        [(24, 1, 100), (11, -1, 80), (14, 1, 60), (2, -1, 100), (16, -1, 60), (12, 1, 90), (15, -1, 60), (23, -1, 100)],
        13.9,
        [
            (crossing_pedestrian, 190, ZONE),
            (hidden_pedestrian, 260, ZONE),
            (cyclist_after_turn, 346, ZONE),
            (crossing_cyclist, 410, ZONE),
            (slow_cyclist, 560, STREET),
            (control_loss, 668),
            (oncoming_at_left_turn, 813.5, (17, 1, 125), (16, 1)),
            (hidden_pedestrian, 930, ZONE_PARKING),
            (cyclist_after_turn, 1034, ZONE),
            (crossing_pedestrian, 1270, INNER),
            (red_light_runner, 1370, INNER),
        ],
    ),
    (
        [(1, 1, 60), (24, -1, 60), (21, -1, 80), (23, -1, 100), (29, -1, 60), (34, 1, 80), (33, 1, 80), (26, 1, 60)]
        + [(21, 2, 60)],
        13.9,
        [
            (crossing_pedestrian, 400, STREET),
            (hidden_pedestrian, 600, INNER),
            (red_light_runner, 673, INNER),
            (crossing_pedestrian, 780, INNER),
            (red_light_runner, 873, INNER),
            (cyclist_after_turn, 1079, STREET),
            (crossing_cyclist, 1140, STREET),
            (slow_cyclist, 1280, STREET),
            (control_loss, 1357),
            (oncoming_at_left_turn, 1594.6, (32, -1, 178), (33, -1)),
            (cyclist_after_turn, 1763, OUTER),
        ],
    ),
    (
        [(25, -1, 40), (61, -1, 40), (62, -1, 60), (34, 1, 100), (27, 1, 60), (22, 2, 60)],
        27.8,
        [
            (cyclist_after_turn, 153, STREET),
            (crossing_pedestrian, 190, STREET),
            (control_loss, 300),
            (cyclist_after_turn, 1164, STREET),
            (crossing_pedestrian, 1205, STREET),
            (hidden_pedestrian, 1310, STREET),
            (crossing_cyclist, 1390, STREET),
            (hidden_pedestrian, 1530, PARKING),
            (cyclist_after_turn, 1604, OUTER),
            (crossing_pedestrian, 1680, OUTER),
        ],
    ),
    (
        [(37, -1, 60), (43, 1, 60), (63, -1, 40), (64, -1, 60), (41, 1, 60), (36, -1, 60), (31, -1, 60)],
        27.8,
        [
            (crossing_cyclist, 180, LINK),
            (slow_cyclist, 330, LINK),
            (crossing_pedestrian, 440, LINK),
            (control_loss, 540),
            (cyclist_after_turn, 1411, LINK),
            (hidden_pedestrian, 1500, LINK),
            (crossing_pedestrian, 1570, LINK),
            (lead_brakes, 1710, LINK),
            (crossing_pedestrian, 1920, STREET),
        ],
    ),
    (
        [(36, 1, 60), (51, -1, 20), (53, -2, 250), (55, -1, 30), (37, 1, 120), (34, 1, 60)],
        27.8,
        [
            (control_loss, 146),
            (crossing_cyclist, 270, LINK),
            (crossing_pedestrian, 1265, LINK),
            (cyclist_after_turn, 1322, LINK),
            (crossing_pedestrian, 1400, LINK),
            (hidden_pedestrian, 1480, LINK),
            (crossing_cyclist, 1570, STREET),
            (crossing_pedestrian, 1660, STREET),
            (hidden_pedestrian, 1725, STREET),
        ],
    ),
    (
        [(31, 1, 60), (41, -1, 100), (42, -1, 300), (43, -1, 60), (37, 1, 80), (29, 1, 60)],
        13.9,
        [
            (crossing_pedestrian, 190, LINK),
            (crossing_cyclist, 260, LINK),
            (hidden_pedestrian, 420, LINK),
            (lead_brakes, 700, COUNTRY),
            (crossing_pedestrian, 950, COUNTRY),
            (slow_cyclist, 1130, COUNTRY),
            (hidden_pedestrian, 1450, LINK),
            (control_loss, 1495),
            (cyclist_after_turn, 1638, LINK),
            (crossing_pedestrian, 1760, LINK),
            (cyclist_after_turn, 1952, STREET),
        ],
    ),
    (
        [(29, 1, 80), (28, 1, 60), (3, 1, 200), (2, 1, 80), (14, -1, 60), (11, 1, 80), (24, -1, 60), (32, -1, 80)],
        13.9,
        [
            (red_light_runner, 158, STREET),
            (crossing_pedestrian, 240, STREET),
            (hidden_pedestrian, 400, STREET),
            (lead_brakes, 450, STREET),
            (control_loss, 692),
            (cyclist_after_turn, 832, ZONE),
            (oncoming_at_left_turn, 951.7, (15, 1, 125), (14, 1)),
            (hidden_pedestrian, 1080, ZONE),
            (crossing_cyclist, 1240, STREET),
            (red_light_runner, 1322, STREET),
        ],
    ),
    (
        [(2, -1, 60), (3, -1, 150), (28, -1, 60), (23, 1, 60), (27, -1, 60), (33, 1, 60), (25, 1, 60), (24, 1, 60)],
        13.9,
        [
            (crossing_pedestrian, 270, STREET),
            (hidden_pedestrian, 350, STREET),
            (slow_cyclist, 400, STREET),
            (crossing_cyclist, 600, STREET),
            (hidden_pedestrian, 790, OUTER),
            (crossing_cyclist, 940, PARKING),
            (control_loss, 1003),
            (crossing_pedestrian, 1120, STREET),
            (crossing_cyclist, 1320, STREET),
            (cyclist_after_turn, 1429, STREET),
        ],
    ),
    (
        [(33, -1, 60), (27, 1, 60), (17, 1, 60), (12, 1, 60), (15, -1, 60), (26, -1, 60), (34, -1, 100), (29, 1, 60)]
        + [(28, 1, 60)],
        13.9,
        [
            (crossing_pedestrian, 260, PARKING),
            (red_light_runner, 350, ZONE),
            (crossing_at_right_turn, 470.5, (13, 1, 178), (12, 1)),
            (hidden_pedestrian, 570, ZONE_PARKING),
            (cyclist_after_turn, 686, ZONE),
            (red_light_runner, 835, STREET),
            (crossing_pedestrian, 1040, STREET),
            (hidden_pedestrian, 1250, STREET),
            (control_loss, 1270),
            (cyclist_after_turn, 1373, STREET),
            (crossing_cyclist, 1560, STREET),
        ],
    ),
]

# Controllers of the lights, with the offsets of the streets from east to west and from north to south.
LIGHTS = [("c0", 0, 25), ("c1", 10, 35), ("c2", 20, 45), ("c3", 30, 5)]


def route(number, stops, target_mps, scenarios):
    start, *via, goal = (place(*stop) for stop in stops)
    parts = [
        f'name = "{number:02}"\n'
        f'description = "A route through the town in traffic, with {len(scenarios)} scenarios."\n',
        '[map]\nfile = "../maps/town.xodr"\n',
    ]
    for junction, *offsets in LIGHTS:
        for way, offset in zip(("east_west", "north_south"), offsets):
            parts.append(
                f'[[map.light]]\ncontroller = "{junction}_{way}"\n'
                f"green_s = 20.0\nred_s = 27.0\noffset_s = {offset:.1f}\n"
            )
    listed = "".join(f"    {stop},\n" for stop in via)
    parts.append(
        f"[ego]\nstart = {start}\nvia = [\n{listed}]\ngoal = {goal}\n"
        f"target_speed_mps = {target_mps}\nstart_speed_mps = 8.0\n"
    )
    patches = [one for one in scenarios if one[0] is control_loss]
    for listed in (patches, [one for one in scenarios if one[0] is not control_loss]):
        for k, (scenario, *where) in enumerate(listed, 1):
            parts.append(scenario(f"{scenario.__name__}_{k}", *where))
    parts.append("[traffic]\nvehicles = 60\npedestrians = 40\n")
    parts.append("[end]\ntimeout_s = 600.0\n")
    parts.append(
        "# At most 2 km with lights of a cycle of 50 s: a drive at half the speed limit takes 290 s, and six red lights\n"
        "# 162 s more. Everyone can be avoided as make.py says; a contact, a red light or the oncoming lane without a\n"
        "# reason are faults. Emergencies may need all of the brakes.\n"
        '[expect]\nverdict = "avoided"\nduration_s = { max = 500.0 }\nred_lights_passed = { max = 0 }\n'
        "min_distance_m = { min = 0.1 }\nroad_margin_m = { min = 0.0 }\ncomfort_share = { min = 0.9 }\n"
    )
    return "\n".join(parts)


def main():
    check = sys.argv[1:] == ["--check"]
    if sys.argv[1:] and not check:
        sys.exit(__doc__)
    folder, stale = Path(__file__).parent, []
    for number, (stops, target_mps, scenarios) in enumerate(ROUTES, 1):
        file, text = folder / f"{number:02}.toml", route(number, stops, target_mps, scenarios)
        if not check:
            file.write_text(text, encoding="utf-8", newline="\n")
        elif not file.exists() or file.read_bytes() != text.encode():
            stale.append(file.name)
    if stale:
        sys.exit(f"{', '.join(stale)}: not as make.py makes them: run it without --check")


if __name__ == "__main__":
    main()
