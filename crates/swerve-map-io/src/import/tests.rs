mod marks;
mod published;
mod scenarios;

use std::path::Path;

use swerve_geom::{FrenetPoint, Point2};
use swerve_map::{LaneIndex, Route};
use swerve_tests::data_or_skip;

use super::*;

fn imported(text: &str) -> (Network, Imported) {
    let network = Network::read("m.xodr", text).unwrap_or_else(|problems| panic!("{problems}"));
    let imported = import(&network, &Links::of(&network)).unwrap();
    (network, imported)
}

fn published(path: &str) -> Option<(Network, Imported)> {
    let path = data_or_skip(&format!("external/{path}"))?;
    Some(imported(&std::fs::read_to_string(Path::new(&path)).unwrap()))
}

/// Identity of a lane in the map.
fn id(network: &Network, imported: &Imported, (road, section, lane): (&str, usize, i32)) -> LaneId {
    let is = |source: &&LaneSource| {
        network.roads[source.road].id == road && source.section == section && source.lane == lane
    };
    LaneId(imported.lanes.iter().position(|source| is(&source)).unwrap() as u32)
}

/// Two roads of 100 m, joined at (100, 0), each with a lane each way; a sidewalk and a median at the right.
fn two_roads(rule: &str) -> String {
    let road = |id: &str, x: f64, link: &str, lane_link: [&str; 2]| {
        let lane = |id: &str, kind: &str, width: f64, link: &str| {
            format!(
                r#"<lane id="{id}" type="{kind}"><link>{link}</link><width sOffset="0" a="{width}" b="0" c="0" d="0"/></lane>"#
            )
        };
        let [left, right] = lane_link;
        format!(
            r#"<road id="{id}" length="100" junction="-1" {rule}><link>{link}</link><planView>
            <geometry s="0" x="{x}" y="0" hdg="0" length="100"><line/></geometry></planView><lanes><laneSection s="0">
            <left>{}</left><right>{}{}{}</right></laneSection></lanes></road>"#,
            lane("1", "driving", 3.0, left),
            lane("-1", "driving", 4.0, right),
            lane("-2", "median", 1.0, ""),
            lane("-3", "sidewalk", 2.0, "")
        )
    };
    let next = r#"<successor elementType="road" elementId="b" contactPoint="start"/>"#;
    let before = r#"<predecessor elementType="road" elementId="a" contactPoint="end"/>"#;
    // Each pair is linked by one side only.
    let a = road("a", 0.0, next, ["", r#"<successor id="-1"/>"#]);
    let b = road("b", 100.0, before, [r#"<predecessor id="1"/>"#, ""]);
    format!(r#"<OpenDRIVE><header revMajor="1" revMinor="6"/>{a}{b}</OpenDRIVE>"#)
}

#[test]
fn lanes_run_in_their_direction_of_travel() {
    let ends = |map: &Map, id: LaneId| {
        let points = map.lane(id).unwrap().line.points().to_vec();
        let (first, last) = (points[0], points[points.len() - 1]);
        [first.x_m, last.x_m].map(f64::round)
    };
    for (rule, right_hand) in [("", true), (r#"rule="LHT""#, false)] {
        let (network, imported) = imported(&two_roads(rule));
        let of = |road, lane| id(&network, &imported, (road, 0, lane));
        let (map, (a, b)) = (&imported.map, (of("a", -1), of("b", -1)));
        let (c, d) = (of("a", 1), of("b", 1));
        assert_eq!(ends(map, a), if right_hand { [0.0, 100.0] } else { [100.0, 0.0] });
        assert_eq!(ends(map, d), if right_hand { [200.0, 100.0] } else { [100.0, 200.0] });
        let followers = [a, b, c, d].map(|id| map.lane(id).unwrap().successors.clone());
        let expected =
            if right_hand { [vec![b], vec![], vec![], vec![c]] } else { [vec![], vec![a], vec![d], vec![]] };
        assert_eq!(followers, expected);
        // Across the centre line: to the left where traffic keeps to the right.
        let beside = Some(Neighbour { lane: c, opposite: true });
        let lane = map.lane(a).unwrap();
        assert_eq!((lane.left, lane.right), if right_hand { (beside, None) } else { (None, beside) });
        assert_eq!((lane.borders.left_m(3.0), lane.borders.right_m(50.0)), (2.0, 2.0));
        assert_eq!(map.lane(of("a", -3)).unwrap().kind, LaneKind::Walking);
        assert_eq!(map.lanes().len(), 6, "medians are left out");
        assert!(imported.gaps.is_empty());
    }
}

#[test]
fn gaps_are_listed_and_wide_ones_are_not_joined() {
    for (x, joined) in [("100.05", true), ("100.5", false)] {
        let (network, imported) = imported(&two_roads("").replace(r#"x="100""#, &format!(r#"x="{x}""#)));
        assert_eq!(imported.gaps.len(), 2);
        assert!(imported.gaps.iter().all(|gap| gap.joined == joined), "{:?}", imported.gaps);
        let a = id(&network, &imported, ("a", 0, -1));
        assert_eq!(!imported.map.lane(a).unwrap().successors.is_empty(), joined);
    }
}

#[test]
fn lanes_of_published_maps_follow_the_exact_lines_and_borders() {
    for path in
        ["carla/Town01.xodr", "esmini/resources/xodr/fabriksgatan.xodr", "esmini/resources/xodr/e6mini.xodr"]
    {
        let Some((network, imported)) = published(path) else { return };
        assert!(imported.gaps.is_empty(), "{path}: {:?}", imported.gaps);
        let (mut off_line, mut off_border) = (0.0_f64, 0.0_f64);
        for (lane, source) in imported.map.lanes().iter().zip(&imported.lanes) {
            let road = &network.roads[source.road];
            let [from_m, to_m] = source.span_m;
            for share in (1..40).map(|k| f64::from(k) / 40.0) {
                let at_m = from_m + share * (to_m - from_m);
                let section = &road.sections[source.section];
                let (_, edges) = road
                    .edges(section, source.lane > 0, at_m)
                    .find(|(lane, _)| lane.id == source.lane)
                    .unwrap();
                let point = |t_m: f64| {
                    let [x, y, _] = network.place(road, at_m, t_m).position_m;
                    Point2::new(x, y)
                };
                off_line = off_line.max(lane.line.project(point(edges.center().t_m)).d_m.abs());
                for t_m in [edges.inner.t_m, edges.outer.t_m] {
                    let FrenetPoint { s_m, d_m } = lane.line.project(point(t_m));
                    let border_m =
                        if d_m > 0.0 { lane.borders.left_m(s_m) } else { lane.borders.right_m(s_m) };
                    let within = 0.0 <= s_m && s_m <= lane.line.length();
                    // Beyond the centre of a curve, a border runs backwards.
                    let turns = 1.0 - road.pose(at_m).curvature_1pm * t_m < 0.2;
                    off_border =
                        off_border.max(if within && !turns { (d_m.abs() - border_m).abs() } else { 0.0 });
                }
            }
        }
        println!("{path}: lines within {:.2} mm, borders within {:.2} mm", 1e3 * off_line, 1e3 * off_border);
        assert!(off_line < 1.2e-3 && off_border < 1.2e-3, "{path}: {off_line} {off_border}");
    }
}

#[test]
fn lanes_of_a_published_town_form_routes_and_are_found_by_their_points() {
    let Some((_, imported)) = published("carla/Town01.xodr") else { return };
    let map = &imported.map;
    let driving: Vec<_> = map.lanes().iter().filter(|lane| lane.kind == LaneKind::Driving).collect();
    assert!(driving.iter().all(|lane| !lane.successors.is_empty()), "a town without dead ends");
    let mut way = vec![driving[0].id];
    while way.len() < 20 {
        way.push(map.lane(way[way.len() - 1]).unwrap().successors[0]);
    }
    assert!(Route::along(map, &way).unwrap().line().length() > 100.0);
    let index = LaneIndex::new(map);
    for lane in driving {
        let point = lane.line.at(0.5 * lane.line.length()).pose.point();
        let found = index.nearest(point).unwrap();
        assert!(found.place.d_m.abs() < 1e-6, "{found:?}");
    }
    let distance_m = |found: swerve_map::LanePlace, point: Point2| {
        let line = &map.lane(found.lane).unwrap().line;
        line.at(found.place.s_m.clamp(0.0, line.length())).pose.point().distance(point)
    };
    for k in 0..2000 {
        let point = Point2::new(f64::from(k * 37 % 500) - 40.0, f64::from(k * 71 % 450) - 40.0);
        let (all, one) = (map.nearest(point).unwrap(), index.nearest(point).unwrap());
        assert!((distance_m(all, point) - distance_m(one, point)).abs() < 1e-9, "{point:?}: {all:?} {one:?}");
    }
}
