//! Junctions of the map.

use std::collections::{BTreeMap, BTreeSet};

use swerve_map::{Junction, JunctionId, LaneId, LaneKind, RightOfWay};

use super::places::Places;
use super::{ImportError, key, leaves};
use crate::links::LaneEnd;
use crate::opendrive::{self, Contact, JunctionKind, Target};

/// Junctions in the order of the file, which numbers them.
pub(super) fn junctions(places: &Places<'_>) -> Result<Vec<Junction>, ImportError> {
    let network = places.network;
    let index: BTreeMap<&str, usize> =
        network.junctions.iter().enumerate().map(|(k, junction)| (&*junction.id, k)).collect();
    let inside = |id: LaneId| {
        let road = &network.roads[places.source(id).road];
        index.get(road.junction.as_deref()?).copied()
    };
    let mut junctions: Vec<Junction> = network.junctions.iter().enumerate().map(empty).collect();
    for (lane, _) in places.lanes() {
        let own = inside(lane.id);
        if let Some(own) = own {
            junctions[own].lanes.push(lane.id);
        }
        for next in lane.successors.iter().filter_map(|next| inside(*next)) {
            if own != Some(next) {
                junctions[next].incoming.push(lane.id);
            }
        }
    }
    for (junction, of) in junctions.iter_mut().zip(&network.junctions) {
        if of.kind == JunctionKind::Direct {
            direct(places, of, junction)?;
        }
        rights_of_way(places, of, junction)?;
    }
    Ok(junctions)
}

fn empty((k, junction): (usize, &opendrive::Junction)) -> Junction {
    Junction {
        id: JunctionId(k as u32),
        name: junction.id.clone(),
        lanes: Vec::new(),
        incoming: Vec::new(),
        rights_of_way: Vec::new(),
    }
}

/// Lanes that lead into a direct junction, which has no lanes inside.
fn direct(places: &Places<'_>, of: &opendrive::Junction, junction: &mut Junction) -> Result<(), ImportError> {
    let network = places.network;
    for connection in &of.connections {
        for (road, at_contact) in [(&connection.incoming, false), (&connection.continuing, true)] {
            let Some(&road) = network.road_of.get(road) else { continue };
            let meets = |end: &Contact| {
                let link = network.roads[road].link_at(*end);
                link.is_some_and(|link| link.target == Target::Junction && link.id == of.id)
            };
            for end in [Contact::Start, Contact::End].into_iter().filter(meets) {
                let last = network.roads[road].sections.len().saturating_sub(1);
                let section = if end == Contact::Start { 0 } else { last };
                let lanes =
                    connection.lane_links.iter().map(|link| if at_contact { link.to } else { link.from });
                let ends = lanes.map(|lane| LaneEnd { road, section, lane, end });
                let into = ends.filter(|end| leaves(network, *end)).map(key);
                let found = into.filter_map(|(road, section, lane)| places.lane_at(road, section, lane));
                junction.incoming.extend(found);
            }
            places.count(connection.lane_links.len())?;
        }
    }
    Ok(())
}

/// Rights of way between the lanes of roads: those inside for a connecting road, else the incoming ones.
fn rights_of_way(
    places: &Places<'_>,
    of: &opendrive::Junction,
    junction: &mut Junction,
) -> Result<(), ImportError> {
    if of.priorities.is_empty() {
        return Ok(());
    }
    let mut lanes: BTreeMap<&str, BTreeSet<LaneId>> = BTreeMap::new();
    for &id in junction.lanes.iter().chain(&junction.incoming) {
        if matches!(places.lane(id).kind, LaneKind::Driving | LaneKind::Cycling) {
            lanes.entry(&places.network.roads[places.source(id).road].id).or_default().insert(id);
        }
    }
    for priority in &of.priorities {
        let [low, high] = [&priority.low, &priority.high].map(|road| lanes.get(&**road));
        let (Some(low), Some(high)) = (low, high) else { continue };
        places.count(low.len() * high.len())?;
        let pairs = low.iter().flat_map(|lane| high.iter().map(move |to| (*lane, *to)));
        junction.rights_of_way.extend(pairs.map(|(lane, to)| RightOfWay { lane, to }));
    }
    Ok(())
}
