//! From the lanes of a file to a map.

use std::collections::BTreeMap;

use swerve_geom::{Point2, Polyline};
use swerve_map::{Features, Lane, LaneId, Map, Neighbour};

use crate::draft::{Center, Draft, Drafts, marks_along};
use crate::import::Gap;
use crate::joints::close;
use crate::opendrive::LENGTH_MAX_M;
use crate::slope::Profile;
use crate::strip::{centered, dense, is_swapped, length_m, measured, middles, rounded};
use crate::xml::{Element, Reader};

/// Most vertices of a map.
const VERTICES_MAX: usize = 3_000_000;

/// Map of the lanes of a file, and what the file says about them.
pub(crate) struct Assembled {
    pub(crate) map: Map,
    /// Gaps between lane ends.
    pub(crate) gaps: Vec<Gap>,
    /// Slopes of lanes that are not level.
    pub(crate) profiles: BTreeMap<LaneId, Profile>,
}

/// Makes the map. `None` after faults.
pub(crate) fn assemble(xml: &mut Reader, mut drafts: Drafts<'_>, root: Element<'_>) -> Option<Assembled> {
    let along_m: f64 = drafts.values().map(|draft| length_m(&draft.left).max(length_m(&draft.right))).sum();
    if along_m > LENGTH_MAX_M {
        xml.fault(root, || {
            format!("expected lanes of at most {LENGTH_MAX_M} m together, found {along_m:.0} m")
        });
        return None;
    }
    let mut centers = BTreeMap::new();
    for (id, draft) in &drafts {
        let center = match &draft.center {
            Center::Middles => middles(&draft.left, &draft.right),
            Center::RoundedMiddles => dense(&middles(&draft.left, &draft.right)),
            Center::Between => dense(&centered(&draft.left, &draft.right, None)),
            Center::Given(line) => dense(&centered(&draft.left, &draft.right, Some(line))),
        };
        if center.len() < 2 {
            xml.defect(draft.element, || "it has no length: left out".to_owned());
            continue;
        }
        centers.insert(*id, center);
    }
    drafts.retain(|id, _| centers.contains_key(id));
    let profile = |(id, draft): (&LaneId, &Draft<'_>)| {
        let [left, right] = draft.raised.as_ref()?;
        Some((*id, Profile::between(left, right)?))
    };
    let profiles = drafts.iter().filter_map(profile).collect();
    neighbours(xml, &mut drafts);
    let gaps = close(&mut drafts, &mut centers);
    let (mut lanes, mut vertices) = (Vec::new(), 0);
    for (id, draft) in &drafts {
        let center = match draft.center {
            Center::Middles => centers[id].iter().map(|vertex| vertex.at).collect(),
            _ => rounded(&centers[id]),
        };
        vertices += center.len() + draft.left.len() + draft.right.len();
        if vertices > VERTICES_MAX {
            xml.fault(draft.element, || format!("expected a map of at most {VERTICES_MAX} vertices"));
            return None;
        }
        lanes.extend(lane(xml, *id, draft, &center));
    }
    match Map::new(lanes) {
        Ok(map) => Some(Assembled { map, gaps, profiles }),
        Err(error) => {
            xml.fault(root, || error.to_string());
            None
        }
    }
}

/// The map with elements beside its lanes. `None` after faults.
pub(crate) fn with_features(
    xml: &mut Reader,
    map: Map,
    features: Features,
    root: Element<'_>,
) -> Option<Map> {
    let (lanes, _) = map.into_parts();
    Map::with_features(lanes, features).map_err(|error| xml.fault(root, || error.to_string())).ok()
}

fn lane(xml: &mut Reader, id: LaneId, draft: &Draft<'_>, center: &[Point2]) -> Option<Lane> {
    let line = match Polyline::new(center) {
        Ok(line) => line,
        Err(error) => {
            xml.fault(draft.element, || error.to_string());
            return None;
        }
    };
    if is_swapped(center, &draft.left, &draft.right) {
        xml.defect(draft.element, || "its left border is not to the left of its right border".to_owned());
    }
    Some(Lane {
        kind: draft.kind,
        marks: marks_along(draft.marks),
        speed_limit_mps: draft.speed_limit_mps,
        left: draft.beside[0],
        right: draft.beside[1],
        successors: draft.successors.iter().copied().collect(),
        ..Lane::new(id, line, measured(center, &draft.left, &draft.right))
    })
}

/// Keeps neighbours that both lanes can have. If only one of them names the other, both have it.
fn neighbours(xml: &mut Reader, drafts: &mut Drafts<'_>) {
    let ids: Vec<LaneId> = drafts.keys().copied().collect();
    for id in ids {
        for side in [0, 1] {
            let Some(Neighbour { lane, opposite }) = drafts[&id].beside[side] else { continue };
            let back = Neighbour { lane: id, opposite };
            // A lane to the left has this one to its right, or to its left if it runs the other way.
            let of_other = if opposite { side } else { 1 - side };
            let mutual = match drafts.get_mut(&lane).filter(|_| lane != id) {
                Some(other) => *other.beside[of_other].get_or_insert(back) == back,
                None => false,
            };
            if !mutual {
                let Some(draft) = drafts.get_mut(&id) else { continue };
                draft.beside[side] = None;
                let name = if side == 0 { "left" } else { "right" };
                let element = draft.element;
                xml.defect(element, || {
                    format!(
                        "the lane to its {name} is missing, or has another lane beside it: not neighbours"
                    )
                });
            }
        }
    }
}
