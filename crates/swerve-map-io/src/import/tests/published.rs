//! Elements beside the lanes of published maps, against counts from their XML that the reader has no part in.

use std::collections::{BTreeMap, BTreeSet};

use roxmltree::{Document, Node};
use swerve_tests::data_or_skip;

use crate::import::import;
use crate::links::Links;
use crate::opendrive::Network;
use crate::testing::networks;

/// Types of lanes that are lanes of a map; those of the published maps.
const KINDS: [&str; 7] = ["driving", "entry", "exit", "onRamp", "offRamp", "shoulder", "sidewalk"];

fn all<'a>(root: Node<'a, 'a>, name: &str) -> Vec<Node<'a, 'a>> {
    root.descendants().filter(|node| node.has_tag_name(name)).collect()
}

fn is_kept(lane: &Node<'_, '_>) -> bool {
    lane.attribute("id") != Some("0") && lane.attribute("type").is_some_and(|kind| KINDS.contains(&kind))
}

/// Lanes of the roads in each junction.
fn lanes_inside<'a>(root: Node<'a, 'a>) -> BTreeMap<&'a str, usize> {
    let mut lanes = BTreeMap::new();
    for road in all(root, "road") {
        *lanes.entry(road.attribute("junction").unwrap()).or_default() +=
            all(road, "lane").iter().filter(|lane| is_kept(lane)).count();
    }
    lanes
}

#[test]
fn junctions_and_signals_of_published_maps_match_their_xml() {
    let Some(folder) = data_or_skip("external") else { return };
    let mut totals = [0; 4];
    for path in networks(&folder) {
        let text = std::fs::read_to_string(&path).unwrap();
        let name = path.file_name().unwrap().display().to_string();
        let document = Document::parse(&text).unwrap();
        let root = document.root_element();
        let network = Network::read(&name, &text).unwrap();
        let map = import(&network, &Links::of(&network)).unwrap().map;
        let inside = lanes_inside(root);
        let junctions = all(root, "junction");
        assert_eq!(map.junctions().len(), junctions.len(), "{name}");
        for (junction, element) in map.junctions().iter().zip(&junctions) {
            let id = element.attribute("id").unwrap();
            assert_eq!(
                (&*junction.name, junction.lanes.len()),
                (id, inside.get(id).copied().unwrap_or(0)),
                "{name}"
            );
            // Lanes with which connections begin, in the direction of right-hand traffic; some files list the others too.
            let begins = all(*element, "laneLink").into_iter().filter_map(|link| {
                let road = link.parent_element()?.attribute("incomingRoad")?;
                let is_one = |node: &&Node<'_, '_>| node.attribute("id") == Some(road);
                let element = *all(root, "road").iter().find(is_one)?;
                let from = link.attribute("from")?;
                let into = all(element, "successor").iter().chain(&all(element, "predecessor")).any(|end| {
                    let is_right = from.starts_with('-') == end.has_tag_name("successor");
                    end.attribute("elementId") == Some(id) && is_right
                });
                let is_from = |lane: &Node<'_, '_>| lane.attribute("id") == Some(from);
                let is_lane = all(element, "lane").iter().any(|lane| is_from(lane) && is_kept(lane));
                (into && is_lane).then_some((road, from))
            });
            let begins: BTreeSet<_> = begins.collect();
            assert_eq!(junction.incoming.len(), begins.len(), "{name} {id}: {begins:?}");
            totals[1] += junction.incoming.len();
        }
        let is_light = |node: &&Node<'_, '_>| {
            let kind = node.attribute("type").unwrap().replace('.', "");
            node.attribute("dynamic") == Some("yes") && kind.starts_with("10000")
        };
        let lights = all(root, "signal").iter().filter(is_light).count();
        assert_eq!(map.signals().len(), lights, "{name}");
        let crosswalks =
            all(root, "object").iter().filter(|one| one.attribute("type") == Some("crosswalk")).count();
        assert_eq!((map.crossings().len(), map.areas().len()), (crosswalks, 0), "{name}");
        totals[0] += map.junctions().len();
        totals[2] += map.signals().len();
        totals[3] += map.stop_lines().len();
    }
    println!("junctions, incoming lanes, signals, stop lines: {totals:?}");
    assert_eq!(totals, [26, 92, 4, 2]);
}
