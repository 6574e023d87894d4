//! Scenarios among the test data, against a second, simple reading of them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use roxmltree::{Document, Node};
use swerve_geom::Point2;
use swerve_map::{Aspect, LaneId, Signal};
use swerve_tests::data_or_skip;

use crate::commonroad::{Centers, Commonroad, read};
use crate::strip::tests::worst_m;

/// Scenarios without roads.
const WITHOUT_LANES: [&str; 2] = ["test_reading_obstacles.xml.gz", "test_reading_planning_problem.xml.gz"];

/// Scenarios with corners of lanelets that are sharper than their width allows, and the largest error there, metres.
const SHARP_M: [(&str, f64); 2] = [("ITA_Siderno-1_3_T-1.xml.gz", 0.015), ("ZAM_Tjunction-1_", 0.0013)];

/// Text of a file packed by gzip without optional fields but its name.
pub(crate) fn unpacked(path: &Path) -> String {
    let bytes = std::fs::read(path).unwrap();
    let name =
        if bytes[3] & 8 == 0 { 0 } else { bytes[10..].iter().position(|byte| *byte == 0).unwrap() + 1 };
    let plain = miniz_oxide::inflate::decompress_to_vec(&bytes[10 + name..]).unwrap();
    String::from_utf8(plain).unwrap()
}

fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files(&path, found);
        } else if path.to_string_lossy().ends_with(".xml.gz") {
            found.push(path);
        }
    }
}

fn named<'a, 'n>(of: Node<'a, 'a>, name: &'n str) -> impl Iterator<Item = Node<'a, 'a>> + use<'a, 'n> {
    of.children().filter(move |child| child.has_tag_name(name))
}

pub(crate) fn points(lanelet: Node<'_, '_>, bound: &str) -> Vec<Point2> {
    let number = |point: Node<'_, '_>, name: &str| -> f64 {
        named(point, name).next().unwrap().text().unwrap().trim().parse().unwrap()
    };
    let bound = lanelet.children().find(|child| child.has_tag_name(bound)).unwrap();
    bound
        .children()
        .filter(|child| child.has_tag_name("point"))
        .map(|point| {
            let point = point.document().get_node(point.id()).unwrap();
            Point2::new(number(point, "x"), number(point, "y"))
        })
        .collect()
}

fn whole(of: Node<'_, '_>, name: &str) -> u32 {
    of.attribute(name).unwrap().parse().unwrap()
}

/// Checks a scenario; returns the number of lanes and the largest error of a border, metres.
fn check(name: &str, text: &str) -> (usize, f64) {
    let Commonroad { lanes, lights, signs, .. } =
        read(name, text, Centers::Rounded).unwrap_or_else(|problems| panic!("{problems}"));
    let document = Document::parse(text).unwrap();
    let root = document.root_element();
    let count = |name: &str| root.children().filter(|child| child.has_tag_name(name)).count();
    let features = lanes.map.features();
    let found = [lanes.map.lanes().len(), lights.len(), signs.len(), features.junctions.len()];
    assert_eq!(found, ["lanelet", "trafficLight", "trafficSign", "intersection"].map(count), "{name}");
    let lanelets = || root.children().filter(|child| child.has_tag_name("lanelet"));
    let lines =
        lanelets().flat_map(|one| one.children()).filter(|child| child.has_tag_name("stopLine")).count();
    assert_eq!(features.stop_lines.len(), lines, "{name}");
    assert_eq!(features.signals.len(), lights.len(), "{name}");
    assert_programs(name, root, &features.signals);
    let (mut successors, mut worst) = (BTreeSet::new(), 0.0_f64);
    for lanelet in lanelets() {
        let id = whole(lanelet, "id");
        for child in lanelet.children().filter(Node::is_element) {
            match child.tag_name().name() {
                "successor" => successors.extend([(id, whole(child, "ref"))]),
                "predecessor" => successors.extend([(whole(child, "ref"), id)]),
                _ => {}
            }
        }
        let lane = lanes.map.lane(LaneId(id)).unwrap();
        let [left, right] = ["leftBound", "rightBound"].map(|bound| points(lanelet, bound));
        worst = worst.max(worst_m(&lane.line, &lane.borders, [&left, &right]));
    }
    let mut apart = lanes.gaps.iter().filter(|gap| !gap.joined).count();
    let is_there = |id: u32| lanes.map.lane(LaneId(id)).is_some();
    let dangling = successors.iter().filter(|(from, to)| !(is_there(*from) && is_there(*to))).count();
    apart += dangling;
    let joined: usize = lanes.map.lanes().iter().map(|lane| lane.successors.len()).sum();
    assert_eq!(joined + apart, successors.len(), "{name}");
    let gaps: BTreeMap<&str, f64> = lanes.gaps.iter().map(|gap| (&*gap.ends, gap.gap_m)).collect();
    println!(
        "{name}: {}, {} lanes, {joined} successors, worst border {:.3} mm; {gaps:?} {} defects\n{}",
        lanes.format,
        lanes.map.lanes().len(),
        1e3 * worst,
        lanes.defects.count(),
        lanes.defects.first(3)
    );
    (lanes.map.lanes().len(), worst)
}

/// The program of each light has the colours and durations of the file; a colour that follows itself counts once.
fn assert_programs(name: &str, root: Node<'_, '_>, signals: &[Signal]) {
    let text = |of: Node<'_, '_>, name: &str| {
        of.children()
            .find(|child| child.has_tag_name(name))
            .and_then(|child| child.text())
            .unwrap()
            .trim()
            .to_owned()
    };
    for light in root.children().filter(|child| child.has_tag_name("trafficLight")) {
        let signal = signals.iter().find(|signal| signal.id.0 == whole(light, "id")).unwrap();
        let program = signal.program.as_ref().unwrap();
        let elements: Vec<_> = light.descendants().filter(|node| node.has_tag_name("cycleElement")).collect();
        let elements = elements.iter().map(|one| (text(*one, "color"), text(*one, "duration")));
        let shown = program.phases.iter().map(|phase| {
            let color = match phase.aspect {
                Aspect::Green => "green",
                Aspect::Yellow => "yellow",
                Aspect::Red => "red",
                Aspect::RedYellow => "redYellow",
                Aspect::Off => "inactive",
            };
            (color.to_owned(), format!("{:.0}", phase.duration_s * 10.0))
        });
        assert_eq!(shown.collect::<Vec<_>>(), elements.collect::<Vec<_>>(), "{name} {}", signal.name);
    }
}

#[test]
fn shared_scenarios_load_and_agree_with_a_second_reading() {
    let Some(folder) = data_or_skip("worlds/commonroad") else { return };
    let mut found = Vec::new();
    files(&folder, &mut found);
    found.sort();
    let (mut scenarios, mut lanes, mut worst) = (0, 0, 0.0_f64);
    for path in found {
        let text = unpacked(&path);
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if text.contains("<CommonRoadSolution") {
            continue;
        }
        if WITHOUT_LANES.contains(&&*name) {
            assert!(
                read(&name, &text, Centers::Rounded)
                    .unwrap_err()
                    .to_string()
                    .ends_with("expected lanelets, found none")
            );
            continue;
        }
        let (count, worst_m) = check(&name, &text);
        let within_m =
            SHARP_M.iter().find(|(sharp, _)| name.starts_with(sharp)).map_or(1e-3, |(_, within_m)| *within_m);
        assert!(worst_m < within_m, "{name}: {worst_m}");
        (scenarios, lanes, worst) = (scenarios + 1, lanes + count, worst.max(worst_m));
    }
    println!("{scenarios} scenarios, {lanes} lanes, worst border {:.3} mm", 1e3 * worst);
    assert_eq!((scenarios, lanes), (55, 1850));
}
