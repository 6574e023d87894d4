"""Two Lanelet2 maps, and what Lanelet2 itself makes of them: `python make.py`, with lanelet2 1.2.3 and numpy 2.4.6.

Writes `crates/swerve-map-io/maps/junction.osm` (in Autoware's form, with local coordinates), `alley.osm` (in JOSM's form,
with latitude and longitude) and `golden.json` beside this file.
"""

import json
import math
from pathlib import Path

import lanelet2
from lanelet2.core import BasicPoint3d
from lanelet2.geometry import follows, leftOf, length2d
from lanelet2.io import Origin, loadRobust
from lanelet2.projection import LocalCartesianProjector

HERE = Path(__file__).parent
MAPS = HERE / "../../../crates/swerve-map-io/maps"
ORIGIN = (35.68, 139.69)


class File:
    """Elements of a map, in metres from its origin."""

    def __init__(self, sign):
        self.sign, self.last = sign, 0
        self.nodes, self.ways, self.relations = {}, {}, {}
        self.at = {}

    def new(self):
        self.last += 1
        return self.sign * self.last

    def node(self, x, y, z=0.0, **tags):
        key = (round(x, 4), round(y, 4), z)
        if key not in self.at or tags:
            self.at[key] = self.new()
            self.nodes[self.at[key]] = (*key, tags)
        return self.at[key]

    def way(self, points, reverse=False, **tags):
        nodes = [self.node(*point) for point in points]
        way = self.new()
        self.ways[way] = (nodes[::-1] if reverse else nodes, tags)
        return way

    def line(self, points, reverse=False, subtype="solid"):
        return self.way(points, reverse, type="line_thin", subtype=subtype)

    def relation(self, members, **tags):
        relation = self.new()
        self.relations[relation] = (members, tags)
        return relation

    def lanelet(self, left, right, subtype="road", rules=(), center=None, **tags):
        members = [("way", "left", left), ("way", "right", right)]
        members += [("way", "centerline", center)] if center else []
        members += [("relation", "regulatory_element", rule) for rule in rules]
        return self.relation(members, type="lanelet", subtype=subtype, **tags)

    def rule(self, subtype, members, **tags):
        return self.relation(members, type="regulatory_element", subtype=subtype, **tags)


def arc(cx, cy, radius, from_deg, to_deg, count):
    angles = [math.radians(from_deg + (to_deg - from_deg) * k / count) for k in range(count + 1)]
    return [(cx + radius * math.cos(a), cy + radius * math.sin(a)) for a in angles]


def junction():
    """A road from west to east with traffic lights, and one from the south that gives way."""
    f = File(1)
    road = {"location": "urban", "one_way": "yes", "participant:vehicle": "yes"}
    # Arms. The middle lines run east and north; some borders run against the traffic.
    w_mid, e_mid = f.line([(-80, 0), (-40, 0), (-15, 0)], subtype="dashed"), f.line([(15, 0), (80, 0)])
    w_south = f.line([(-80, -3.5), (-15, -3.5)], reverse=True)
    w_north = f.line([(-80, 3.5), (-50, 3.5), (-15, 3.5)])
    e_south, e_north = f.line([(15, -3.5), (80, -3.5)]), f.line([(15, 3.5), (80, 3.5)], reverse=True)
    s_mid = f.line([(0, -80), (0, -15)])
    s_east, s_west = f.line([(3.5, -80), (3.5, -15)]), f.line([(-3.5, -80), (-3.5, -15)])
    # Furniture.
    lamp = f.way([(16, -5, 5.0), (16, -5.8, 5.0)], type="traffic_light", subtype="red_yellow_green", height="0.45")
    bulbs = [f.node(16, -5 - 0.25 * k, 5.2, color=color) for k, color in enumerate(("red", "yellow", "green"))]
    bulb_way = f.new()
    f.ways[bulb_way] = (bulbs, {"type": "light_bulbs", "traffic_light_id": str(lamp)})
    w_stop = f.way([(-16, 0), (-16, -3.5)], type="stop_line", subtype="solid")
    s_stop = f.way([(0, -23), (3.5, -23)], type="stop_line", subtype="solid")
    e_stop = f.way([(18, 3.5), (18, 0)], type="stop_line", subtype="solid")
    sign = f.way([(4.2, -23, 2.0), (4.8, -23, 2.0)], type="traffic_sign", subtype="stop_sign")
    zebra = f.way([(-4.5, -20), (4.5, -20), (4.5, -17), (-4.5, -17)], type="crosswalk_polygon", area="yes")
    box = f.way([(-15, -15), (15, -15), (15, 3.5), (-15, 3.5)], type="intersection_area", area="yes")
    watched = f.way([(40, 0), (60, 0), (60, 3.5), (40, 3.5)], type="detection_area", area="yes")
    no_stop = f.way([(-10, -3.5), (10, -3.5), (10, 0), (-10, 0)], type="no_stopping_area", area="yes")
    f.way([(-70, 6), (-50, 6), (-50, 12), (-70, 12)], type="parking_lot", area="yes")
    f.way([(-65, 6), (-65, 11)], type="parking_space", width="2.5")
    outer = f.way([(20, -6), (40, -6), (40, -16), (20, -16), (20, -6)], type="curbstone", subtype="high")
    f.relation([("way", "outer", outer)], type="multipolygon", subtype="parking", location="urban")
    # Rules of the arms.
    light = f.rule("traffic_light", [("way", "refers", lamp), ("way", "ref_line", w_stop), ("way", "light_bulbs", bulb_way)])
    slow = f.rule("speed_limit", [], sign_type="30 km/h")
    marked = f.rule("road_marking", [("way", "refers", e_stop)])
    detect = f.rule("detection_area", [("way", "refers", watched), ("way", "ref_line", e_stop)])
    keep_free = f.rule("no_stopping_area", [("way", "refers", no_stop), ("way", "ref_line", w_stop)])
    bump = f.rule("speed_bump", [("way", "refers", no_stop)])
    stop = f.rule("traffic_sign", [("way", "refers", sign), ("way", "ref_line", s_stop)])
    # Lanes of the arms.
    names = {}
    names["w_in"] = f.lanelet(w_mid, w_south, rules=[light], speed_limit="50", **road)
    names["w_out"] = f.lanelet(w_mid, w_north, speed_limit="50 km/h", **road)
    names["e_out"] = f.lanelet(e_mid, e_south, rules=[slow, bump], speed_limit="50", turn_direction="straight", **road)
    names["e_in"] = f.lanelet(e_mid, e_north, rules=[marked, detect], speed_limit="30 mph", **road)
    names["s_out"] = f.lanelet(s_mid, s_west, speed_limit="13.9 m/s", **road)
    # Lanes of the junction.
    mid = f.line([(-15, 0), (15, 0)])
    north = f.line([(-15, 3.5), (15, 3.5)])
    south = f.line([(-15, -3.5), (15, -3.5)])
    names["w_e"] = f.lanelet(mid, south, rules=[keep_free], turn_direction="straight", **road)
    names["e_w"] = f.lanelet(mid, north, **road)
    names["w_s"] = f.lanelet(
        f.line(arc(-15, -15, 15, 90, 0, 14)), f.line(arc(-15, -15, 11.5, 90, 0, 9)), turn_direction="right", **road
    )
    names["s_e"] = f.lanelet(
        f.line(arc(15, -15, 15, 180, 90, 14)), f.line(arc(15, -15, 11.5, 180, 90, 9), reverse=True), **road
    )
    names["s_w"] = f.lanelet(
        f.line(arc(-15, -15, 15, 0, 90, 12)),
        f.line([(3.5, -15), *arc(-15, -15, 18.5, 10, 80, 11), (-15, 3.5)]),
        turn_direction="left",
        **road,
    )
    names["e_s"] = f.lanelet(
        f.line(arc(15, -15, 15, 90, 180, 12), reverse=True),
        f.line([(15, 3.5), *arc(15, -15, 18.5, 100, 170, 11), (-3.5, -15)]),
        **road,
    )
    crossing_sides = [f.line([(-4.5, -20), (4.5, -20)]), f.line([(-4.5, -17), (4.5, -17)])]
    people = {"location": "urban", "one_way": "no", "participant:pedestrian": "yes"}
    names["crossing"] = f.lanelet(crossing_sides[1], crossing_sides[0], subtype="crosswalk", **people)
    f_give = f.rule(
        "right_of_way",
        [("relation", "yield", names[lane]) for lane in ("s_e", "s_w")]
        + [("relation", "right_of_way", names[lane]) for lane in ("w_e", "e_w")]
        + [("way", "ref_line", s_stop)],
    )
    walk = f.rule(
        "crosswalk",
        [("way", "ref_line", s_stop), ("way", "crosswalk_polygon", zebra), ("relation", "refers", names["crossing"])],
    )
    names["s_in"] = f.lanelet(s_mid, s_east, rules=[stop, f_give, walk], speed_limit="", **road)
    for lane in ("w_e", "e_w", "s_e", "s_w"):
        f.relations[names[lane]][0].append(("relation", "regulatory_element", f_give))
    f.relations[names["w_e"]][1]["intersection_area"] = str(box)
    # Beside the arms.
    names["shoulder"] = f.lanelet(w_north, f.line([(-80, 5.5), (-15, 5.5)]), subtype="road_shoulder", location="urban")
    names["bicycles"] = f.lanelet(e_south, f.line([(15, -5), (80, -5)]), subtype="bicycle_lane", location="urban")
    ends = [f.line([(4.5, -20), (12, -22)]), f.line([(4.5, -17), (12, -17)])]
    names["walkway"] = f.lanelet(ends[1], ends[0], subtype="walkway", **people)
    return f, names


def alley():
    """Two pieces with traffic in both directions, one with a centre line of its own; a third that begins 0.3 m off."""
    f = File(-1)
    tags = {"location": "nonurban", "one_way": "no", "participant:vehicle": "yes"}
    north, south = arc(0, 60, 58, -90, -40, 11), arc(0, 60, 62, -90, -40, 17)
    names = {"first": f.lanelet(f.line(north), f.line(south, reverse=True), **tags)}
    (x, y), (u, v) = north[-1], south[-1]
    ahead = (-(v - y) / 4.0, (u - x) / 4.0)
    on = lambda point, along, aside=0.0: (
        point[0] + along * ahead[0] + aside * ahead[1],
        point[1] + along * ahead[1] - aside * ahead[0],
    )
    left, right = [(x, y), on((x, y), 20), on((x, y), 45)], [(u, v), on((u, v), 45)]
    middle = on((0.5 * (x + u), 0.5 * (y + v)), 0)
    center = f.way([on(middle, 45), on(middle, 20, 0.3), middle], type="virtual")
    names["second"] = f.lanelet(f.line(left, reverse=True), f.line(right), center=center, **tags)
    begin = [on(left[-1], 0.3), on(right[-1], 0.3)]
    far = [on(begin[0], 30), on(begin[1], 30, 1.0)]
    one_way = {**tags, "one_way": "yes"}
    names["third"] = f.lanelet(f.line([begin[0], far[0]]), f.line([begin[1], far[1]]), subtype="highway", **one_way)
    return f, names


def lat_lon(projector, x, y):
    place = projector.reverse(BasicPoint3d(x, y, 0.0))
    return f"{place.lat:.11f}", f"{place.lon:.11f}"


def autoware(f):
    projector = LocalCartesianProjector(Origin(*ORIGIN, 0.0))
    out = ['<?xml version="1.0" encoding="UTF-8"?>', '<osm generator="VMB">', '  <MetaInfo format_version="1" map_version="1"/>']
    tag = lambda key, value: f'    <tag k="{key}" v="{value}"/>'
    for node, (x, y, z, tags) in f.nodes.items():
        lat, lon = lat_lon(projector, x, y)
        own = {"mgrs_code": "54SUE000000", "local_x": f"{x:.4f}", "local_y": f"{y:.4f}", "ele": f"{z:.4f}", **tags}
        out += [f'  <node id="{node}" lat="{lat}" lon="{lon}">', *(tag(*one) for one in own.items()), "  </node>"]
    for way, (nodes, tags) in f.ways.items():
        out += [f'  <way id="{way}">', *(f'    <nd ref="{node}"/>' for node in nodes)]
        out += [*(tag(*one) for one in tags.items()), "  </way>"]
    for relation, (members, tags) in f.relations.items():
        out.append(f'  <relation id="{relation}">')
        out += [f'    <member type="{kind}" role="{role}" ref="{id}"/>' for kind, role, id in members]
        out += [*(tag(*one) for one in tags.items()), "  </relation>"]
    return "\n".join([*out, "</osm>", ""])


def josm(f):
    projector = LocalCartesianProjector(Origin(*ORIGIN, 0.0))
    out = ["<?xml version='1.0' encoding='UTF-8'?>", "<osm version='0.6' generator='JOSM'>"]
    state = "action='modify' visible='true'"
    tag = lambda key, value: f"    <tag k='{key}' v='{value}' />"
    for node, (x, y, _, _) in f.nodes.items():
        lat, lon = lat_lon(projector, x, y)
        out.append(f"  <node id='{node}' {state} lat='{lat}' lon='{lon}' />")
    out.append("  <node id='-9999' action='delete' visible='true' lat='0' lon='0' />")
    for way, (nodes, tags) in f.ways.items():
        out += [f"  <way id='{way}' {state}>", *(f"    <nd ref='{node}' />" for node in nodes)]
        out += [*(tag(*one) for one in tags.items()), "  </way>"]
    for relation, (members, tags) in f.relations.items():
        out.append(f"  <relation id='{relation}' {state}>")
        out += [f"    <member type='{kind}' ref='{id}' role='{role}' />" for kind, role, id in members]
        out += [*(tag(*one) for one in tags.items()), "  </relation>"]
    return "\n".join([*out, "</osm>", ""])


def golden(path, origin, names):
    """Values of Lanelet2 for each lanelet."""
    lanelets, _ = loadRobust(str(path), LocalCartesianProjector(Origin(*origin, 0.0)))
    of = {lanelet.id: lanelet for lanelet in lanelets.laneletLayer}
    assert set(of) == set(names.values())
    pairs = lambda points: [[round(p.x, 7), round(p.y, 7)] for p in points]
    found = {}
    for name, id in names.items():
        lanelet = of[id]
        other = lambda is_so: sorted(str(id) for id, other in of.items() if id != lanelet.id and is_so(other))
        found[name] = {
            "id": str(id),
            "left": pairs(lanelet.leftBound),
            "right": pairs(lanelet.rightBound),
            "center": pairs(lanelet.centerline),
            "length_m": round(length2d(lanelet), 6),
            "followers": other(lambda other: follows(lanelet, other)),
            "left_of_it": other(lambda other: leftOf(other, lanelet)),
            "right_of_it": other(lambda other: leftOf(lanelet, other)),
            "left_against_it": other(lambda other: leftOf(other.invert(), lanelet)),
            "right_against_it": other(lambda other: leftOf(lanelet, other.invert())),
        }
    return found


def main():
    written = {}
    for name, (f, names), form in (("junction", junction(), autoware), ("alley", alley(), josm)):
        path = MAPS / f"{name}.osm"
        path.write_text(form(f))
        first = next(iter(f.nodes.values()))
        place = lat_lon(LocalCartesianProjector(Origin(*ORIGIN, 0.0)), *first[:2])
        origin = ORIGIN if name == "junction" else [float(part) for part in place]
        written[name] = golden(path, origin, names)
    (HERE / "golden.json").write_text(json.dumps(written) + "\n")


if __name__ == "__main__":
    print(f"lanelet2 {getattr(lanelet2, '__version__', '')}")
    main()
