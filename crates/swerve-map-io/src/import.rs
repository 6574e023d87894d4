//! Conversion of a network to a lane map on the flat projection.
//!
//! Every lane of every lane section whose type has a [`LaneKind`] is a lane of the map, in its direction of travel.
//! Lanes of types without one (medians, borders, kerbs, rails, `none`) are left out; so are lanes shorter than a
//! micrometre, whose neighbours along the road are joined with each other. Junctions, traffic lights, stop lines,
//! crossings and areas refer to these lanes.
//!
//! **Resampling** is within lane sections only, never across their borders, where widths may jump. All records of the
//! section's geometry begin at a vertex. Between them, vertices are as dense as a chord error of [`CHORD_M`] needs, and
//! at most [`STEP_M`] apart: a millimetre is the gap that lane ends are held to, and the largest step bounds the
//! stretch before a curve on which a polyline interpolates heading and curvature.

mod junctions;
mod marks;
mod objects;
mod places;
mod signals;
pub(crate) mod vertices;

use std::collections::{BTreeMap, BTreeSet};

use swerve_geom::{Polyline, PolylineError};
use swerve_map::{Features, LaneId, LaneKind, Map, MapError, Neighbour};

use crate::links::{LaneEnd, Links, named};
use crate::opendrive::{Contact, LaneType, Network, Road};

/// Largest distance of a vertex from the true line between two vertices, metres.
pub const CHORD_M: f64 = 1e-3;

/// Largest distance of two vertices along the road, metres.
pub const STEP_M: f64 = 5.0;

/// Largest gap of lane ends that is not listed, metres.
pub const JOINED_M: f64 = 1e-3;

/// Largest gap of lane ends that are joined, metres: the one that [`Map`] accepts.
const JOINABLE_M: f64 = 0.1;

/// Most vertices of a map, of which one takes about 400 bytes with its index and picture.
const VERTICES_MAX: usize = 3_000_000;

/// Most references to lanes from junctions, signals and objects together.
const REFERENCES_MAX: usize = 2_000_000;

/// Most lanes that are too short in a row.
const SHORT_MAX: usize = 64;

/// A map, and the lanes of the network that it is made of.
#[derive(Clone, PartialEq, Debug)]
pub struct Imported {
    /// The map, on the flat projection, in the projected frame of the network: metres, x east, y north.
    pub map: Map,
    /// The lane of the network for each [`LaneId`], by its number.
    pub lanes: Vec<LaneSource>,
    /// Lane ends that the file links and that are apart by more than [`JOINED_M`].
    pub gaps: Vec<Gap>,
}

/// A lane of the network.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct LaneSource {
    /// Index of the road.
    pub road: usize,
    /// Lane section of the road, from 0.
    pub section: usize,
    /// Identity in the section.
    pub lane: i32,
    /// Ends of the section along the road, metres.
    pub span_m: [f64; 2],
    /// True if traffic runs in the direction of s.
    pub forward: bool,
}

/// Lane ends that are linked and apart.
#[derive(Clone, PartialEq, Debug)]
pub struct Gap {
    /// Both ends, by road, section and lane.
    pub ends: String,
    /// Distance in the ground plane, metres.
    pub gap_m: f64,
    /// True if the map joins them all the same.
    pub joined: bool,
}

/// Error of a conversion.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum ImportError {
    /// The map would take too much memory.
    #[error("expected a map of at most {VERTICES_MAX} vertices; road {0} is beyond them")]
    TooLarge(String),
    /// The elements beside the lanes would take too much memory.
    #[error("expected at most {REFERENCES_MAX} references to lanes from junctions, signals and objects")]
    TooManyReferences,
    /// A lane is not a line.
    #[error("road {road} section {section} lane {lane}: {error}")]
    Line {
        /// Identity of the road.
        road: String,
        /// Lane section.
        section: usize,
        /// Identity of the lane.
        lane: i32,
        /// Its error.
        error: PolylineError,
    },
    /// The lanes are not a map.
    #[error(transparent)]
    Map(#[from] MapError),
}

/// Kind of a lane in a map; `None` for types that no kind describes.
pub fn kind_of(kind: &LaneType) -> Option<LaneKind> {
    use LaneType as T;
    Some(match kind {
        T::Driving | T::Exit | T::Entry | T::OnRamp | T::OffRamp | T::ConnectingRamp | T::SlipLane => {
            LaneKind::Driving
        }
        T::Bidirectional | T::Bus | T::Taxi | T::Hov | T::MotorwayEntry | T::MotorwayExit | T::Shared => {
            LaneKind::Driving
        }
        T::Shoulder | T::Stop => LaneKind::Shoulder,
        T::Biking => LaneKind::Cycling,
        T::Sidewalk | T::Walking => LaneKind::Walking,
        T::Parking => LaneKind::Parking,
        _ => return None,
    })
}

/// Result of the conversion of a lane.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Slot {
    Lane(LaneId),
    Short,
}

type Key = (usize, usize, i32);

/// Converts a network.
///
/// # Errors
/// If the map would be too large, or a lane is not a line.
pub fn import(network: &Network, links: &Links) -> Result<Imported, ImportError> {
    let mut build = Build::default();
    for (index, road) in network.roads.iter().enumerate() {
        for section in 0..road.sections.len() {
            build.section(network, index, road, section)?;
        }
    }
    build.neighbours(network);
    build.successors(network, links);
    let features = build.features(network)?;
    let map = Map::with_features(build.lanes, features)?;
    Ok(Imported { map, lanes: build.sources, gaps: build.gaps })
}

#[derive(Default)]
struct Build {
    lanes: Vec<swerve_map::Lane>,
    sources: Vec<LaneSource>,
    slots: BTreeMap<Key, Slot>,
    vertices: usize,
    gaps: Vec<Gap>,
}

impl Build {
    fn section(
        &mut self,
        network: &Network,
        index: usize,
        road: &Road,
        at: usize,
    ) -> Result<(), ImportError> {
        let section = &road.sections[at];
        let Some(span_m) = road.section_span_m(at) else { return Ok(()) };
        let stations = vertices::stations(road, section, span_m);
        let Some(stations) = stations else { return Err(ImportError::TooLarge(road.id.clone())) };
        self.vertices += (section.left.len() + section.right.len() + 1) * stations.len();
        if self.vertices > VERTICES_MAX {
            return Err(ImportError::TooLarge(road.id.clone()));
        }
        if section.lanes().all(|lane| kind_of(&lane.kind).is_none()) {
            return Ok(());
        }
        let strips = vertices::strips(network, road, section, &stations);
        for (lane, strip) in section.left.iter().chain(&section.right).zip(strips) {
            let Some(kind) = kind_of(&lane.kind) else { continue };
            let forward = road.runs_forward(lane.id);
            let line = match Polyline::new(&strip.points(forward)) {
                Ok(line) => line,
                Err(PolylineError::TooShort) => {
                    self.slots.insert((index, at, lane.id), Slot::Short);
                    continue;
                }
                Err(error) => {
                    let road = road.id.clone();
                    return Err(ImportError::Line { road, section: at, lane: lane.id, error });
                }
            };
            let id = LaneId(self.lanes.len() as u32);
            self.slots.insert((index, at, lane.id), Slot::Lane(id));
            self.sources.push(LaneSource { road: index, section: at, lane: lane.id, span_m, forward });
            self.lanes.push(swerve_map::Lane {
                kind,
                marks: marks::marks(section, lane, &strip, span_m, forward),
                speed_limit_mps: lane.speed_mps(span_m).or_else(|| road.type_speed_mps(span_m)),
                ..swerve_map::Lane::new(id, line, strip.borders(forward))
            });
        }
        Ok(())
    }

    /// Elements beside the lanes, once the lanes have their successors.
    fn features(&self, network: &Network) -> Result<Features, ImportError> {
        let places = places::Places::new(network, self);
        let junctions = junctions::junctions(&places)?;
        let (signals, stop_lines) = signals::signals(&places)?;
        let (crossings, areas) = objects::objects(&places)?;
        Ok(Features { junctions, signals, stop_lines, crossings, areas })
    }

    fn lane_at(&self, key: Key) -> Option<LaneId> {
        match self.slots.get(&key) {
            Some(Slot::Lane(id)) => Some(*id),
            _ => None,
        }
    }

    /// Lanes beside each other in a section, the centre lane left out.
    fn neighbours(&mut self, network: &Network) {
        for (k, source) in self.sources.iter().enumerate() {
            let &LaneSource { road, section, lane, forward, .. } = source;
            let beside = |step: i32| {
                let other = if lane + step == 0 { step } else { lane + step };
                let id = self.lane_at((road, section, other))?;
                Some(Neighbour { lane: id, opposite: network.roads[road].runs_forward(other) != forward })
            };
            // Identities grow to the left of the road.
            let (left, right) = (beside(1), beside(-1));
            let (left, right) = if forward { (left, right) } else { (right, left) };
            (self.lanes[k].left, self.lanes[k].right) = (left, right);
        }
    }

    fn successors(&mut self, network: &Network, links: &Links) {
        // In the direction of travel; a link says nothing about direction.
        let mut next: BTreeMap<Key, BTreeSet<(Key, bool)>> = BTreeMap::new();
        for link in &links.all {
            let ends = [(link.from, link.to), (link.to, link.from)];
            let along = |(from, to): &(LaneEnd, LaneEnd)| leaves(network, *from) && !leaves(network, *to);
            let Some((from, to)) = ends.into_iter().find(along) else { continue };
            let joined = link.gap_m <= JOINABLE_M;
            let is_kept = [from, to].iter().all(|end| self.slots.contains_key(&key(*end)));
            if link.gap_m > JOINED_M && is_kept {
                let ends = format!("{} and {}", named(network, link.from), named(network, link.to));
                self.gaps.push(Gap { ends, gap_m: link.gap_m, joined });
            }
            next.entry(key(from)).or_default().insert((key(to), joined));
        }
        for k in 0..self.sources.len() {
            let LaneSource { road, section, lane, .. } = self.sources[k];
            self.lanes[k].successors = self.beyond(&next, (road, section, lane));
        }
    }

    /// Lanes that continue a lane, through lanes that are too short.
    fn beyond(&self, next: &BTreeMap<Key, BTreeSet<(Key, bool)>>, from: Key) -> Vec<LaneId> {
        let (mut found, mut open) = (BTreeSet::new(), vec![from]);
        let mut seen = BTreeSet::new();
        while let Some(at) = open.pop() {
            for (to, joined) in next.get(&at).into_iter().flatten().filter(|(_, joined)| *joined) {
                match self.slots.get(to) {
                    Some(Slot::Lane(id)) if *joined => drop(found.insert(*id)),
                    Some(Slot::Short) if seen.len() < SHORT_MAX && seen.insert(*to) => open.push(*to),
                    _ => {}
                }
            }
        }
        found.into_iter().collect()
    }
}

fn key(end: LaneEnd) -> Key {
    (end.road, end.section, end.lane)
}

/// True if traffic leaves its lane at this end.
fn leaves(network: &Network, end: LaneEnd) -> bool {
    network.roads[end.road].runs_forward(end.lane) == (end.end == Contact::End)
}

#[cfg(test)]
mod tests;
