//! Conflict zones: the parts of two lanes on which vehicles would touch each other, and who gives way there.
//!
//! [`Conflicts`] finds them for all lanes of a map that vehicles use: those for motor vehicles and for bicycles. Places
//! are those of vehicle centres: a vehicle whose centre is outside a zone touches nobody whose centre is on the other
//! lane. The length of vehicles is therefore in the zones already. Lanes beside each other, and lanes that continue each
//! other, have no zones: there, vehicles follow each other.
//!
//! Who gives way is decided by the first of these rules that does: rights of way of the map; a stop or yield sign on one
//! of the two ways; a left turn gives way to oncoming traffic; traffic from the right goes first; the way that turns less
//! goes first; the lane with the smaller identity. Right-hand traffic is assumed.

mod priority;
mod zones;

use core::fmt;
use std::sync::OnceLock;

use swerve_geom::Polyline;

use crate::{Lane, LaneId, LaneKind, Map, StopLine};

/// Relation of two lanes with a zone.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Meeting {
    /// They cross, or touch in passing.
    Cross,
    /// They end in the same lane.
    Merge,
    /// All traffic of both comes from the same lane, which ends shortly before.
    Fork,
}

/// A conflict zone of a lane.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Zone {
    /// Part of this lane, metres; it may begin before the lane and end beyond it.
    pub at_m: [f64; 2],
    /// The other lane.
    pub other: LaneId,
    /// Part of the other lane, metres.
    pub other_m: [f64; 2],
    /// Relation of the two lanes.
    pub meeting: Meeting,
    /// For lanes that part shortly before, the place on this lane that is as far from there as the begin of the other
    /// one, metres.
    pub shift_m: Option<f64>,
    /// True if traffic of this lane gives way to that of the other. False for both at a fork.
    pub yields: bool,
}

/// Conflict zones of all lanes of a map.
#[derive(Clone, PartialEq, Debug)]
pub struct Conflicts {
    /// Ordered by identity.
    lanes: Vec<(LaneId, Vec<Zone>)>,
}

/// Zones of a map, found at first use. Maps with equal lanes and features have equal ones.
#[derive(Clone, Default)]
pub(crate) struct Found(OnceLock<Conflicts>);

impl PartialEq for Found {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl fmt::Debug for Found {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Found")
    }
}

impl Map {
    /// Conflict zones of its lanes, found at first use and kept.
    pub fn conflicts(&self) -> &Conflicts {
        self.conflicts.0.get_or_init(|| Conflicts::new(self))
    }
}

impl Conflicts {
    /// Finds the zones of a map.
    pub fn new(map: &Map) -> Self {
        let used = used(map);
        let mut zones = zones::zones(&used, map);
        priority::assign(&used, map, &mut zones);
        Self { lanes: used.iter().map(|lane| lane.id).zip(zones).collect() }
    }

    /// Zones of a lane, ordered by begin; empty for lanes that vehicles do not use.
    pub fn zones_of(&self, lane: LaneId) -> &[Zone] {
        let found = self.lanes.binary_search_by_key(&lane, |(id, _)| *id);
        found.map_or(&[], |index| &self.lanes[index].1)
    }
}

/// A lane that vehicles use.
struct Used<'m> {
    id: LaneId,
    cycling: bool,
    line: &'m Polyline,
    length_m: f64,
    in_junction: bool,
    stops: &'m [StopLine],
    /// Lanes after it and before it, by index.
    next: Vec<usize>,
    before: Vec<usize>,
}

/// Lanes that vehicles use, ordered by identity.
fn used<'m>(map: &'m Map) -> Vec<Used<'m>> {
    let is_used = |lane: &&Lane| matches!(lane.kind, LaneKind::Driving | LaneKind::Cycling);
    let lanes: Vec<&'m Lane> = map.lanes().iter().filter(is_used).collect();
    let indices = |ids: &[LaneId]| {
        ids.iter().filter_map(|id| lanes.binary_search_by_key(id, |lane| lane.id).ok()).collect()
    };
    let used = |lane: &&'m Lane| Used {
        id: lane.id,
        cycling: lane.kind == LaneKind::Cycling,
        length_m: lane.line.length(),
        in_junction: map.is_in_junction(lane.id),
        stops: map.stop_lines_of(lane.id),
        next: indices(&lane.successors),
        before: indices(map.predecessors(lane.id)),
        line: &lane.line,
    };
    lanes.iter().map(used).collect()
}

#[cfg(test)]
mod tests;
