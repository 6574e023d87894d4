//! Crossings and areas of the map, which are objects in the file.

use swerve_map::{Area, AreaId, AreaKind, Crossing, CrossingId, LaneKind};

use super::ImportError;
use super::places::{Places, Scope};
use crate::opendrive::Object;

/// Lanes that a crossing crosses.
const CROSSED: [LaneKind; 3] = [LaneKind::Driving, LaneKind::Cycling, LaneKind::Shoulder];

/// Crossings and areas, numbered in the order of the file. An object with several outlines is several of them.
pub(super) fn objects(places: &Places<'_>) -> Result<(Vec<Crossing>, Vec<Area>), ImportError> {
    let (mut crossings, mut areas) = (Vec::new(), Vec::new());
    for (road, of) in places.network.roads.iter().enumerate() {
        for object in &of.objects {
            let name = || object.id.clone();
            if object.kind == "crosswalk" {
                let Object { s_m, validity, .. } = object;
                let scope = Scope { road, s_m: *s_m, orientation: "", validity, kinds: &CROSSED };
                for outline in places.outlines(road, object) {
                    let id = CrossingId(crossings.len() as u32);
                    let lanes = places.in_scope(scope)?;
                    crossings.push(Crossing { id, name: name(), outline, lanes });
                }
            } else if let Some(kind) = area_kind(object) {
                for outline in places.outlines(road, object) {
                    areas.push(Area { id: AreaId(areas.len() as u32), name: name(), kind, outline });
                }
            }
        }
    }
    Ok((crossings, areas))
}

fn area_kind(object: &Object) -> Option<AreaKind> {
    Some(match &*object.kind {
        "parkingSpace" => AreaKind::Parking,
        "trafficIsland" => AreaKind::NoEntry,
        _ => return None,
    })
}
