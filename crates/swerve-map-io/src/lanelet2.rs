//! Reader of Lanelet2 maps in OSM files, as Autoware and JOSM write them.
//!
//! **Positions.** The tags `local_x` and `local_y` of nodes if a node has them; else latitude and longitude on the plane
//! that touches the Earth at the first node of the file, metres east and north of it. `ele` is the height.
//!
//! **Lanes.** A relation of type `lanelet` is a lane between its left and its right way. Both are turned into the
//! direction of travel, as Lanelet2 does. Lanes that share a way are neighbours; lanes that begin at the nodes at which
//! another ends are its successors. A driving lane with `one_way=no` is two lanes, one for each direction. Lanes are
//! numbered in the order of the identities of their relations, those against the direction of a lanelet at the end.
//!
//! **Marks.** Those of a lane are the types of its ways. `lane_change` permits or forbids to cross them.
//!
//! **Rules.** Traffic lights are signals, with the lanelets that name their regulatory element and stop lines at its
//! `ref_line`. Signs that stop traffic or make it give way, rights of way, stops of all ways and crosswalks put rules at
//! stop lines. Lanelets with the same `intersection_area`, or of one right of way, are a junction. Ways with `area=yes`,
//! parking spaces and multipolygons are areas. Other regulatory elements are counted.
//!
//! **Source.** Poggenhans et al., "Lanelet2: a high-definition map framework for the future of automated driving", 2018,
//! and the pages on tagging of Lanelet2 and of Autoware's extensions.

mod areas;
mod beside;
mod features;
mod junctions;
mod lanelets;
mod lanes;
mod marks;
mod osm;
mod rules;
mod stops;
mod tags;
mod tangent;

use std::collections::BTreeMap;

use swerve_map::LaneId;

use crate::assemble::{Assembled, assemble, with_features};
use crate::draft::Drafts;
use crate::lane_map::LaneMap;
use crate::problem::Problems;
use crate::xml::{Reader, parse};

use lanes::Lanes;
use osm::Osm;
use rules::Rules;

/// A Lanelet2 map.
#[derive(Clone, PartialEq, Debug)]
pub struct Lanelet2 {
    /// Lanes.
    pub lanes: LaneMap,
    /// Latitude and longitude of the origin of the frame, degrees; `None` if the file has local coordinates.
    pub origin_deg: Option<[f64; 2]>,
}

/// Reads a map.
///
/// # Errors
/// All faults of the file, with its defects.
pub fn read(file: &str, text: &str) -> Result<Lanelet2, Problems> {
    let document = parse(file, text)?;
    let root = document.root_element();
    let mut xml = Reader::default();
    if root.tag_name().name() != "osm" {
        xml.fault(root, || "expected the element `osm`".to_owned());
    }
    let osm = Osm::read(&mut xml, root);
    let rules = Rules::read(&mut xml, &osm);
    let mut types = BTreeMap::new();
    let mut lanes = lanelets::lanelets(&mut xml, &osm, &rules.speeds_mps, &mut types);
    if types.is_empty() && xml.faults() == 0 {
        xml.fault(root, || "expected relations of type `lanelet`, found none".to_owned());
    }
    beside::neighbours(&mut xml, &osm, &mut lanes);
    beside::successors(&mut xml, &mut lanes);
    let of_lanes: Vec<(i64, LaneId)> =
        lanes.iter().enumerate().map(|(k, lane)| (lane.relation, lanelets::lane_id(k))).collect();
    let drafts: Drafts<'_> =
        lanes.into_iter().enumerate().map(|(k, lane)| (lanelets::lane_id(k), lane.draft)).collect();
    let names = drafts.iter().map(|(id, draft)| (*id, draft.name.clone())).collect();
    let made = if xml.faults() == 0 { assemble(&mut xml, drafts, root) } else { None };
    let made = made.and_then(|Assembled { map, gaps, profiles }| {
        let lanes = Lanes::new(&osm, &map, &of_lanes);
        let features = features::features(&mut xml, &osm, &map, &rules, &lanes);
        Some((with_features(&mut xml, map, features, root)?, gaps, profiles))
    });
    let (faults, defects, unknown) = xml.finish(file, text);
    let Some((map, gaps, profiles)) = made.filter(|_| faults.count() == 0) else {
        return Err(faults.with(&defects));
    };
    let heights = osm.nodes.values().filter_map(|node| node.z_m);
    let heights_m = heights.fold(None, |range: Option<[f64; 2]>, z_m| {
        let [low, high] = range.unwrap_or([z_m, z_m]);
        Some([low.min(z_m), high.max(z_m)])
    });
    let format = if osm.origin_deg.is_some() { "Lanelet2" } else { "Lanelet2, local coordinates" }.to_owned();
    let contents = rules.counts;
    let mut lanes = LaneMap {
        format,
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
    Ok(Lanelet2 { lanes, origin_deg: osm.origin_deg })
}

#[cfg(test)]
mod tests;
