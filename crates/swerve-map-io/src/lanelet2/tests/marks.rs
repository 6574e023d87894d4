//! Marks of lanes.

use swerve_map::{Mark, MarkColour, MarkKind, Side};

use super::*;

/// Two lanes to the east on both sides of way 12, which runs east (or west), and has these tags.
fn two_lanes(tags: &str, is_east: bool) -> [Lane; 2] {
    let mut text = "<osm version=\"0.6\">".to_owned();
    for (id, x, y) in [(1, 0, 3), (2, 20, 3), (3, 0, 0), (4, 20, 0), (5, 0, -3), (6, 20, -3)] {
        text += &format!(r#"<node id="{id}"><tag k="local_x" v="{x}"/><tag k="local_y" v="{y}"/></node>"#);
    }
    let middle = if is_east { [3, 4] } else { [4, 3] };
    let tag = |pair: &str| {
        let (key, value) = pair.split_once('=').unwrap();
        format!(r#"<tag k="{key}" v="{value}"/>"#)
    };
    let tags: String = tags.split_whitespace().map(tag).collect();
    for (id, [from, to], tags) in [(11, [1, 2], ""), (12, middle, &*tags), (13, [5, 6], "")] {
        text += &format!(r#"<way id="{id}"><nd ref="{from}"/><nd ref="{to}"/>{tags}</way>"#);
    }
    for (id, left, right) in [(21, 11, 12), (22, 12, 13)] {
        text += &format!(
            r#"<relation id="{id}"><member type="way" role="left" ref="{left}"/><member type="way" role="right" ref="{right}"/>
            <tag k="type" v="lanelet"/><tag k="subtype" v="road"/></relation>"#
        );
    }
    let map = good(&(text + "</osm>")).lanes.map;
    [map.lane(LaneId(0)).unwrap().clone(), map.lane(LaneId(1)).unwrap().clone()]
}

/// Marks of way 12 for the lane to its north and for that to its south.
fn marks(tags: &str, is_east: bool) -> [Option<Mark>; 2] {
    let [north, south] = two_lanes(tags, is_east);
    assert_eq!((north.marks.of(Side::Left), south.marks.of(Side::Right)), (&[][..], &[][..]));
    [north.marks.at(Side::Right, 0.0).copied(), south.marks.at(Side::Left, 0.0).copied()]
}

#[test]
fn types_of_ways_are_marks_of_the_lanes_on_both_sides() {
    use MarkKind as K;
    for (tags, north, south) in [
        ("type=line_thin subtype=solid", K::Solid, K::Solid),
        ("type=line_thin subtype=dashed", K::Broken, K::Broken),
        ("type=line_thin subtype=solid_solid", K::SolidSolid, K::SolidSolid),
        ("type=line_thin subtype=solid_dashed", K::SolidBroken, K::BrokenSolid),
        ("type=line_thin subtype=dashed_solid", K::BrokenSolid, K::SolidBroken),
        ("type=curbstone subtype=high", K::Kerb, K::Kerb),
        ("type=road_border", K::Edge, K::Edge),
        ("type=guard_rail", K::Barrier, K::Barrier),
        ("type=virtual", K::None, K::None),
    ] {
        let kinds = |is_east| marks(tags, is_east).map(|mark| mark.unwrap().kind);
        assert_eq!((kinds(true), kinds(false)), ([north, south], [south, north]), "{tags}");
    }
    for tags in ["", "type=line_thin", "type=line_thin subtype=wavy", "type=bike_marking"] {
        assert_eq!(marks(tags, true), [None, None], "{tags}");
    }
}

#[test]
fn colours_and_widths_are_those_of_the_tags() {
    let mark = |tags| marks(tags, true)[0].unwrap();
    let thick = mark("type=line_thick subtype=solid color=yellow");
    assert_eq!((thick.colour, thick.width_m), (MarkColour::Yellow, 0.25));
    let thin = mark("type=line_thin subtype=solid width=0.3");
    assert_eq!((thin.colour, thin.width_m), (MarkColour::White, 0.3));
}

#[test]
fn lane_change_permits_or_forbids_to_cross_in_its_direction() {
    for (tags, north, south) in [
        ("type=line_thin subtype=solid_dashed", false, true),
        ("type=line_thin subtype=solid lane_change=yes", true, true),
        ("type=line_thin subtype=dashed lane_change=no", false, false),
        ("type=line_thin subtype=solid lane_change:left=yes", false, true),
        ("type=line_thin subtype=dashed lane_change=yes lane_change:right=no", false, true),
    ] {
        let may = |is_east| {
            let [upper, lower] = two_lanes(tags, is_east);
            [upper.may_cross(Side::Right, 10.0), lower.may_cross(Side::Left, 10.0)]
        };
        assert_eq!((may(true), may(false)), ([north, south], [south, north]), "{tags}");
    }
}

#[test]
fn both_lanes_of_a_lanelet_have_the_marks_of_its_ways() {
    let text = ALLEY.replacen("v='solid'", "v='dashed_solid'", 1);
    let map = good(&text).lanes;
    let [there, back] = ["-33", "-33:backward"]
        .map(|name| map.map.lane(map.lane_named(name).unwrap()).unwrap().marks.clone());
    let kind = |mark: Option<&Mark>| mark.unwrap().kind;
    assert_eq!(there.at(Side::Left, 0.0), back.at(Side::Right, 0.0));
    assert_eq!(kind(there.at(Side::Left, 0.0)), MarkKind::SolidBroken);
    assert_eq!(there.at(Side::Right, 0.0), back.at(Side::Left, 0.0));
    assert_eq!(kind(back.at(Side::Left, 0.0)), MarkKind::Solid);
}
