//! Published networks: their lane lengths by the file, and counts from their XML that the reader has no part in.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use roxmltree::{Document, Node};
use swerve_map::{Aspect, LaneIndex, LaneKind, Route};
use swerve_tests::data_or_skip;

use crate::sumo::{Net, read};

/// All networks of SUMO below a folder.
fn files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            files(&path, found);
        } else if path.to_string_lossy().ends_with(".net.xml") {
            found.push(path);
        }
    }
}

/// Names and texts of all networks.
fn nets() -> Option<Vec<(String, String)>> {
    let mut found = Vec::new();
    files(&data_or_skip("worlds")?, &mut found);
    found.sort();
    let name = |path: &PathBuf| path.file_name().unwrap().to_string_lossy().replace(".net.xml", "");
    Some(found.iter().map(|path| (name(path), std::fs::read_to_string(path).unwrap())).collect())
}

fn all<'a>(root: Node<'a, 'a>, name: &str) -> Vec<Node<'a, 'a>> {
    root.descendants().filter(|node| node.has_tag_name(name)).collect()
}

fn net(name: &str, text: &str) -> Net {
    read(name, text).unwrap_or_else(|problems| panic!("{problems}"))
}

/// Largest difference of the centimetres that a file rounds lengths and vertices to, metres.
const ROUNDED_M: f64 = 0.02;

#[test]
fn lane_lengths_of_published_networks_match_the_file() {
    let Some(nets) = nets() else { return };
    let mut counts = [0; 3];
    for (name, text) in &nets {
        let net = net(name, text);
        let document = Document::parse(text).unwrap();
        let edges = all(document.root_element(), "edge");
        let edges = edges.iter().filter_map(|edge| Some((edge.attribute("id")?, edge.attribute("length"))));
        let declared: BTreeMap<&str, Option<&str>> = edges.collect();
        let mut sums: BTreeMap<&str, (f64, f64)> = BTreeMap::new();
        for (lane, of) in net.sources.iter().zip(net.lanes.map.lanes()) {
            let sum = sums.entry(&lane.edge).or_default();
            *sum = (sum.0 + of.line.length(), sum.1 + 1.0);
        }
        for (lane, of) in net.sources.iter().zip(net.lanes.map.lanes()) {
            let (length_m, by_file_m) = (of.line.length(), lane.length_m.unwrap());
            let (sum_m, lanes) = sums[&*lane.edge];
            let explicit = declared[&*lane.edge].map(|text| text.parse::<f64>().unwrap());
            // SUMO has 0.1 m at least, lets users set the length of an edge, and averages over its lanes.
            let way = if (length_m.max(0.1) - by_file_m).abs() <= ROUNDED_M {
                0
            } else if explicit == Some(by_file_m) {
                1
            } else {
                assert!(
                    (sum_m / lanes - by_file_m).abs() <= 1.5 * ROUNDED_M,
                    "{name} {}: {length_m}",
                    net.lanes.name(of.id)
                );
                2
            };
            counts[way] += 1;
        }
    }
    println!("lanes by shape, by the edge's length, by the mean of the edge: {counts:?}");
    assert_eq!(nets.len(), 12);
    assert_eq!(counts, [919, 243, 272]);
}

#[test]
fn counts_of_published_networks_match_their_xml() {
    let Some(nets) = nets() else { return };
    for (name, text) in &nets {
        let net = net(name, text);
        assert_eq!(
            (net.lanes.defects.count(), net.lanes.unknown.len()),
            (0, 0),
            "{name}: {}",
            net.lanes.defects
        );
        let document = Document::parse(text).unwrap();
        let root = document.root_element();
        let count = |name: &str| all(root, name).len();
        let (edges, lanes) = (all(root, "edge"), all(root, "lane"));
        let contents = |name: &str| net.lanes.contents.get(name).copied().unwrap_or(0);
        assert_eq!(contents("edges"), edges.len(), "{name}");
        assert_eq!(net.lanes.types.values().sum::<usize>(), lanes.len(), "{name}");
        let of_edges = |name: &str| net.lanes.types.get(name).copied().unwrap_or(0);
        let (found, expected) = (contents("connections"), count("connection"));
        assert_eq!((found, net.programs.len()), (expected, count("tlLogic")), "{name}");
        let phases: usize = net.programs.iter().map(|program| program.phases.len()).sum();
        assert_eq!(phases, count("phase"), "{name}");
        assert_programs_match_states(name, &net, root);
        let is_kept = |node: &&Node<'_, '_>| !matches!(node.attribute("type"), Some("internal" | "dead_end"));
        let junctions = all(root, "junction");
        assert_eq!(net.lanes.map.junctions().len(), junctions.iter().filter(is_kept).count(), "{name}");
        let mut links: Vec<_> = all(root, "connection")
            .iter()
            .filter_map(|node| Some((node.attribute("tl")?, node.attribute("linkIndex")?)))
            .collect();
        links.sort_unstable();
        links.dedup();
        assert_eq!(net.lanes.map.signals().len(), links.len(), "{name}");
        // Every set bit of a response is a right of way, as none of these files has crossings.
        let bits: usize = all(root, "request")
            .iter()
            .map(|node| node.attribute("response").unwrap().matches('1').count())
            .sum();
        let rights: usize =
            net.lanes.map.junctions().iter().map(|junction| junction.rights_of_way.len()).sum();
        let is_short = of_edges("normal") + of_edges("internal") - net.lanes.map.lanes().len();
        assert!(rights == bits || is_short > 0, "{name}: {rights} of {bits}");
        // Every connection between lanes of the map is a successor, and nothing else is.
        let lane = |node: &Node<'_, '_>, edge, index| {
            let edge = edges.iter().find(|one| one.attribute("id") == node.attribute(edge)).unwrap();
            all(*edge, "lane")[node.attribute(index).unwrap().parse::<usize>().unwrap()]
                .attribute("id")
                .unwrap()
        };
        let on_foot = |node: &Node<'_, '_>, edge| {
            let name = node.attribute(edge).unwrap();
            let edge = edges.iter().find(|one| one.attribute("id") == Some(name)).unwrap();
            edge.attribute("function") == Some("walkingarea")
        };
        let connections = all(root, "connection");
        let on_road = connections.iter().filter(|node| !on_foot(node, "from") && !on_foot(node, "to"));
        let pairs = on_road.map(|node| {
            (
                lane(node, "from", "fromLane"),
                node.attribute("via").unwrap_or_else(|| lane(node, "to", "toLane")),
            )
        });
        let mut pairs: Vec<_> = pairs.collect();
        pairs.sort_unstable();
        pairs.dedup();
        let successors: usize = net.lanes.map.lanes().iter().map(|lane| lane.successors.len()).sum();
        assert!(successors == pairs.len() || is_short > 0, "{name}: {successors} of {}", pairs.len());
        for (from, to) in pairs {
            let (Some(from), Some(to)) = (net.lanes.lane_named(from), net.lanes.lane_named(to)) else {
                continue;
            };
            assert!(net.lanes.map.lane(from).unwrap().successors.contains(&to), "{name}");
        }
        assert!(net.lanes.gaps.is_empty(), "{name}: {:?}", net.lanes.gaps);
    }
}

/// Each signal shows the state of its link in the file in the middle of each phase, counted from the offset.
fn assert_programs_match_states(name: &str, net: &Net, root: Node<'_, '_>) {
    for signal in net.lanes.map.signals() {
        let (light, link) = signal.name.rsplit_once(':').unwrap();
        let logic = all(root, "tlLogic").into_iter().find(|one| one.attribute("id") == Some(light)).unwrap();
        let number = |node: &Node<'_, '_>, name| node.attribute(name).unwrap().parse::<f64>().unwrap();
        let program = signal.program.as_ref().unwrap();
        assert_eq!(program.offset_s, 0.0 - number(&logic, "offset"), "{name} {}", signal.name);
        let mut begin_s = 0.0;
        for phase in all(logic, "phase") {
            let duration_s = number(&phase, "duration");
            let mut left_s = begin_s + 0.5 * duration_s;
            let shown = program.phases.iter().find(|phase| {
                left_s -= phase.duration_s;
                left_s < 0.0
            });
            let expected = match phase.attribute("state").unwrap().as_bytes()[link.parse::<usize>().unwrap()]
            {
                b'G' | b'g' => Aspect::Green,
                b'y' => Aspect::Yellow,
                other => {
                    assert_eq!(other, b'r', "{name}");
                    Aspect::Red
                }
            };
            assert_eq!(shown.unwrap().aspect, expected, "{name} {} at {begin_s} s", signal.name);
            begin_s += duration_s;
        }
    }
}

#[test]
fn lanes_of_an_edge_are_beside_each_other_on_both_sides() {
    let Some(nets) = nets() else { return };
    let (mut pairs, mut wide) = (0, 0);
    for (name, text) in &nets {
        let net = net(name, text);
        for lane in net.lanes.map.lanes() {
            let Some(right) = lane.right else { continue };
            pairs += 1;
            // The neighbour's start is to the right, at the distance of the half widths where lanes are parallel.
            let other = net.lanes.map.lane(right.lane).unwrap();
            let place = lane.line.project(other.line.at(0.5 * other.line.length()).pose.point());
            assert!(place.d_m < 0.0, "{name}: {}", net.lanes.name(lane.id));
            let apart_m = 0.5 * (lane.width_m(0.0) + other.width_m(0.0));
            wide += usize::from((-place.d_m - apart_m).abs() > 0.5);
        }
    }
    println!("{pairs} pairs, {wide} of them not at the distance of their widths");
    assert_eq!((pairs, wide), (441, 9));
}

#[test]
fn towns_have_routes_in_the_frame_of_their_projection() {
    let Some(nets) = nets() else { return };
    let town = &nets.iter().find(|(name, _)| name == "town01").unwrap().1;
    let net = net("town01", town);
    assert_eq!(net.net_offset_m, [0.06, 328.61]);
    let map = &net.lanes.map;
    let index = LaneIndex::of(map, |lane| lane.kind == LaneKind::Driving);
    let mut way = vec![map.lanes().iter().find(|lane| lane.line.length() > 100.0).unwrap().id];
    while way.len() < 20 {
        way.push(*map.lane(way[way.len() - 1]).unwrap().successors.first().unwrap());
    }
    assert!(Route::along(map, &way).unwrap().line().length() > 300.0);
    // The road network that it was made of has the same lanes in the same places.
    let Some(path) = data_or_skip("external/carla/Town01.xodr") else { return };
    let text = std::fs::read_to_string(path).unwrap();
    let network = crate::opendrive::Network::read("Town01", &text).unwrap();
    let links = crate::links::Links::of(&network);
    let carla = crate::import::import(&network, &links).unwrap().map;
    let mut off: Vec<f64> = carla
        .lanes()
        .iter()
        .filter(|lane| lane.kind == LaneKind::Driving && lane.line.length() > 50.0)
        .map(|lane| {
            index.nearest(lane.line.at(0.5 * lane.line.length()).pose.point()).unwrap().place.d_m.abs()
        })
        .collect();
    off.sort_by(f64::total_cmp);
    println!("{} lanes, median {:.3} m, largest {:.3} m", off.len(), off[off.len() / 2], off[off.len() - 1]);
    assert!(off[off.len() - 1] < 0.2);
}
