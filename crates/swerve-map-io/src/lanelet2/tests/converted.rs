//! CommonRoad scenarios written as Lanelet2 maps: both readers find the same lanes.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use roxmltree::{Document, Node};
use swerve_geom::Point2;
use swerve_tests::data_or_skip;

use super::*;
use crate::commonroad::tests::shared::{points, unpacked};
use crate::commonroad::{self, Centers};

/// Scenarios.
const SCENARIOS: [&str; 5] = [
    "ngsim/USA_Lanker-2_2_T-1.xml.gz",
    "factory/PRI_Barceloneta-1_5_T-1.xml.gz",
    "factory/FRA_MoissyCramayel-2_1_T-1.xml.gz",
    "factory/HRV_Pula-8_2_T-1.xml.gz",
    "hand_crafted/ZAM_Tjunction-1_106_T-1.xml.gz",
];

/// An OSM file: equal points are one node, equal lines one way; every second way runs against its first lanelet.
#[derive(Default)]
struct Osm {
    nodes: BTreeMap<[i64; 2], usize>,
    ways: BTreeMap<Vec<usize>, usize>,
    text: String,
}

impl Osm {
    fn node(&mut self, at: Point2) -> usize {
        // Millimetres.
        let key = [at.x_m, at.y_m].map(|value| (1e3 * value).round() as i64);
        let id = self.nodes.len() + 1;
        *self.nodes.entry(key).or_insert_with(|| {
            let tag = |name: &str, value: f64| format!("<tag k=\"local_{name}\" v=\"{value}\"/>");
            let _infallible =
                write!(self.text, "<node id=\"{id}\">{}{}</node>", tag("x", at.x_m), tag("y", at.y_m));
            id
        })
    }

    fn way(&mut self, line: &[Point2]) -> usize {
        let mut nodes: Vec<usize> = line.iter().map(|at| self.node(*at)).collect();
        let reversed: Vec<usize> = nodes.iter().rev().copied().collect();
        if let Some(id) = self.ways.get(&nodes).or_else(|| self.ways.get(&reversed)) {
            return *id;
        }
        let id = self.ways.len() + 1;
        if id.is_multiple_of(2) {
            nodes = reversed;
        }
        let refs: String = nodes.iter().map(|node| format!("<nd ref=\"{node}\"/>")).collect();
        let _infallible = write!(self.text, "<way id=\"{id}\">{refs}</way>");
        self.ways.insert(nodes, id);
        id
    }
}

/// The lanelets of a scenario as a Lanelet2 map, with their identities.
fn converted(text: &str) -> String {
    let document = Document::parse(text).unwrap();
    let mut osm = Osm::default();
    for lanelet in
        document.root_element().children().filter(|child: &Node<'_, '_>| child.has_tag_name("lanelet"))
    {
        let [left, right] = ["leftBound", "rightBound"].map(|bound| osm.way(&points(lanelet, bound)));
        let member = |role: &str, way| format!("<member type=\"way\" role=\"{role}\" ref=\"{way}\"/>");
        let tags = "<tag k=\"type\" v=\"lanelet\"/><tag k=\"subtype\" v=\"road\"/>";
        let id = lanelet.attribute("id").unwrap();
        let members = [member("left", left), member("right", right)].concat();
        let _infallible = write!(osm.text, "<relation id=\"{id}\">{members}{tags}</relation>");
    }
    format!("<osm>{}</osm>", osm.text)
}

#[test]
fn scenarios_as_lanelet2_maps_have_the_same_lanes() {
    for path in SCENARIOS {
        let Some(file) = data_or_skip(&format!("worlds/commonroad/{path}")) else { return };
        let text = unpacked(&file);
        let roads = commonroad::read(path, &text, Centers::Rounded).unwrap().lanes;
        let map = good(&converted(&text)).lanes;
        assert_eq!(map.map.lanes().len(), roads.map.lanes().len(), "{path}");
        let (mut missing, mut more, mut apart_m) = (0, 0, 0.0_f64);
        for lane in roads.map.lanes() {
            let name = roads.name(lane.id);
            let other = map.map.lane(map.lane_named(name).unwrap()).unwrap();
            for at in other.line.points() {
                apart_m = apart_m.max(lane.line.project(*at).d_m.abs());
            }
            for end in [0.0, 1.0] {
                let [a, b] = [lane, other].map(|lane| lane.line.at(end * lane.line.length()).pose.point());
                assert!(a.distance(b) < 2e-3, "{path} {name}: {a:?} {b:?}");
            }
            let named = |names: &[LaneId], of: &crate::lane_map::LaneMap| -> Vec<String> {
                let mut names: Vec<String> = names.iter().map(|lane| of.name(*lane).to_owned()).collect();
                names.sort();
                names
            };
            let (expected, found) = (named(&lane.successors, &roads), named(&other.successors, &map));
            missing += expected.iter().filter(|name| !found.contains(name)).count();
            more += found.iter().filter(|name| !expected.contains(name)).count();
        }
        println!(
            "{path}: {} lanes, centre lines {apart_m:.3} m apart, {missing} successors missing, {more} more",
            map.map.lanes().len()
        );
        assert_eq!((missing, more), (0, 0), "{path}");
        // Pairs of CommonRoad are given; those at equal shares of the lengths are elsewhere where borders differ.
        assert!(apart_m < 0.4, "{path}: {apart_m}");
    }
}
