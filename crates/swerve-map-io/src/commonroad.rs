//! Reader of CommonRoad scenario files in XML, versions 2018b and 2020a: lanelets and the rules on them.
//!
//! **Read.** Lanelets: bounds, predecessors, successors, adjacent lanelets, type, speed limit, stop line. Traffic lights
//! with their cycles, traffic signs, intersections as junctions, lanelets for pedestrians across a road as crossings.
//! Obstacles and planning problems belong to scenarios and are skipped. Heights are slopes beside the flat map.
//!
//! **Lanes.** The identity of a lane is that of its lanelet. Its centre line runs through the middles of pairs of points
//! of the bounds. A link that only one of two lanelets names counts for both.
//!
//! **Source.** "CommonRoad: documentation of the XML format", versions 2018b and 2020a.

mod features;
mod lanelets;
mod rules;

use std::collections::BTreeSet;

use crate::assemble::{Assembled, assemble, with_features};
use crate::content::all;
use crate::lane_map::LaneMap;
use crate::problem::{Problems, quoted};
use crate::xml::{Element, Reader, parse};

pub use lanelets::Centers;
pub use rules::{Cycle, Light, Phase, Sign};

use lanelets::Lanelets;
use rules::Rules;

/// Versions that are read.
const VERSIONS: [&str; 2] = ["2018b", "2020a"];

/// Elements of the root.
const KNOWN: [&str; 13] = [
    "location",
    "scenarioTags",
    "lanelet",
    "trafficSign",
    "trafficLight",
    "intersection",
    "obstacle",
    "staticObstacle",
    "dynamicObstacle",
    "environmentObstacle",
    "phantomObstacle",
    "planningProblem",
    "geoTransformation",
];

/// Roads of a scenario.
#[derive(Clone, PartialEq, Debug)]
pub struct Commonroad {
    /// Lanes.
    pub lanes: LaneMap,
    /// Duration of a time step, seconds; `None` if the file has none.
    pub step_s: Option<f64>,
    /// Traffic lights in the order of the file; the signal in the map has the same identity.
    pub lights: Vec<Light>,
    /// Traffic signs in the order of the file.
    pub signs: Vec<Sign>,
}

/// Reads the roads of a scenario.
///
/// # Errors
/// All faults of the file, with its defects.
pub fn read(file: &str, text: &str, centers: Centers) -> Result<Commonroad, Problems> {
    let document = parse(file, text)?;
    let root = document.root_element();
    let mut xml = Reader::default();
    let version = root.attribute("commonRoadVersion").unwrap_or_default();
    check_root(&mut xml, root, version);
    let rules = Rules::read(&mut xml, root);
    let lanelets = Lanelets::read(&mut xml, root, &rules, centers);
    let (heights_m, types, contents) = (lanelets.heights_m, lanelets.types.clone(), rules.counts());
    let (drafts, statements) = lanelets.resolved(&mut xml, root);
    let names = drafts.iter().map(|(id, draft)| (*id, draft.name.clone())).collect();
    let made = if xml.faults() == 0 { assemble(&mut xml, drafts, root) } else { None };
    let made = made.and_then(|Assembled { map, gaps, profiles }| {
        let features = features::features(&map, &rules, &statements);
        Some((with_features(&mut xml, map, features, root)?, gaps, profiles))
    });
    let (faults, defects, unknown) = xml.finish(file, text);
    let Some((map, gaps, profiles)) = made.filter(|_| faults.count() == 0) else {
        return Err(faults.with(&defects));
    };
    let mut lanes = LaneMap {
        format: format!("CommonRoad {version}").trim_end().to_owned(),
        left_hand: false,
        map,
        names,
        types,
        contents,
        heights_m,
        profiles,
        gaps,
        defects,
        unknown,
    };
    lanes.names.retain(|lane, _| lanes.map.lane(*lane).is_some());
    let Rules { step_s, lights, signs, .. } = rules;
    Ok(Commonroad { lanes, step_s, lights, signs })
}

fn check_root(xml: &mut Reader, root: Element<'_>, version: &str) {
    if root.tag_name().name() != "commonRoad" {
        xml.fault(root, || "expected the element `commonRoad`".to_owned());
        return;
    }
    if version.is_empty() {
        xml.defect(root, || format!("`commonRoadVersion` is missing: read as {}", VERSIONS[1]));
    } else if !VERSIONS.contains(&version) {
        xml.fault(root, || {
            format!("`commonRoadVersion`: expected one of {}, found {}", VERSIONS.join(", "), quoted(version))
        });
    }
    let _elements = xml.children(root, &KNOWN);
    if all(root, "lanelet").next().is_none() {
        xml.fault(root, || "expected lanelets, found none".to_owned());
    }
    let mut ids = BTreeSet::new();
    let with_identity =
        root.children().filter(|child| child.is_element() && KNOWN.contains(&child.tag_name().name()));
    for (element, id) in with_identity.filter_map(|element| Some((element, element.attribute("id")?))) {
        if !ids.insert(id) {
            xml.fault_in(element, "id", || {
                format!("expected an identity that no other element has, found {} again", quoted(id))
            });
        }
    }
}

#[cfg(test)]
pub(crate) mod tests;
