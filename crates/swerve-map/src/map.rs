//! Lane maps.

mod cells;
mod path;

use swerve_geom::{FrenetPoint, Point2, Polyline};

use crate::conflict::Found;
use crate::features::{FeatureError, Features};
use crate::{Area, Crossing, Junction, JunctionId, Lane, LaneId, Neighbour, Signal, SignalId, StopLine};

use cells::Cells;
pub use path::LanePath;
use path::Paths;

/// Largest gap between the end of a lane and the start of its successor, metres.
const JOINT_M: f64 = 0.1;

/// A consistent set of lanes, and the junctions, signals, stop lines, crossings and areas on them.
///
/// Its text form is the list of lanes if there is nothing else, and a table otherwise. [`paths`](Self::paths) from a
/// lane are computed when they are first used, and kept.
#[derive(Clone, PartialEq, Debug)]
pub struct Map {
    /// Ordered by identity.
    lanes: Vec<Lane>,
    /// Axis-aligned bounding box of each lane.
    bounds: Vec<Bounds>,
    cells: Cells,
    /// Predecessors of each lane, ordered by identity.
    predecessors: Vec<Vec<LaneId>>,
    features: Features,
    /// Pairs of a lane and the index of a junction that it is inside or leads into, sorted.
    junctions_of: Vec<(LaneId, usize)>,
    /// Pairs of a lane and the index of a signal that its traffic obeys, sorted.
    signals_of: Vec<(LaneId, usize)>,
    paths: Paths,
    pub(crate) conflicts: Found,
}

/// A lane and a position along it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct LanePlace {
    /// The lane.
    pub lane: LaneId,
    /// Position along its centre line.
    pub place: FrenetPoint,
}

/// Error of constructing a map from lanes.
#[derive(Clone, Copy, PartialEq, Debug, thiserror::Error)]
pub enum MapError {
    /// Two lanes have the same identity.
    #[error("lane {} is there twice", .0.0)]
    Twice(LaneId),
    /// A neighbour or successor is not in the map.
    #[error("lane {} names lane {}, which is not there", .lane.0, .named.0)]
    Missing {
        /// The lane.
        lane: LaneId,
        /// Identity that is missing.
        named: LaneId,
    },
    /// The neighbour does not list the lane on the matching side.
    #[error("lane {} has lane {} beside it, but not the other way round", .lane.0, .neighbour.0)]
    OneSided {
        /// The lane.
        lane: LaneId,
        /// Its neighbour.
        neighbour: LaneId,
    },
    /// The start of a successor is not at the end of the lane.
    #[error("lane {} begins {gap_m:.2} m from where lane {} ends", .successor.0, .lane.0)]
    Gap {
        /// The lane.
        lane: LaneId,
        /// Its successor.
        successor: LaneId,
        /// Distance between the two, metres.
        gap_m: f64,
    },
    /// The left border is to the right of the right border.
    #[error("the borders of lane {} cross at {s_m:.1} m", .lane.0)]
    Width {
        /// The lane.
        lane: LaneId,
        /// Arc length along the lane, metres.
        s_m: f64,
    },
    /// An element beside the lanes is inconsistent.
    #[error(transparent)]
    Feature(#[from] FeatureError),
}

#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Bounds {
    low: Point2,
    high: Point2,
}

impl Bounds {
    /// Bounds of the lane between its borders.
    fn around(lane: &Lane) -> Self {
        Self::beside(&lane.line, lane.borders.farthest_m().max(0.0))
    }

    /// Bounds of a line and the ground up to `beside_m` beside it.
    fn beside(line: &Polyline, beside_m: f64) -> Self {
        let ends = |f: fn(f64, f64) -> f64, first: f64| {
            let points = line.points().iter();
            points.fold((first, first), |(x, y), p| (f(x, p.x_m), f(y, p.y_m)))
        };
        let (low, high) = (ends(f64::min, f64::INFINITY), ends(f64::max, f64::NEG_INFINITY));
        Self {
            low: Point2::new(low.0 - beside_m, low.1 - beside_m),
            high: Point2::new(high.0 + beside_m, high.1 + beside_m),
        }
    }

    fn is_near(&self, other: &Self, within_m: f64) -> bool {
        let apart = |low: f64, high: f64| low - within_m > high;
        !(apart(self.low.x_m, other.high.x_m)
            || apart(other.low.x_m, self.high.x_m)
            || apart(self.low.y_m, other.high.y_m)
            || apart(other.low.y_m, self.high.y_m))
    }

    /// Returns true if a point is inside, or outside by at most `within_m` along each axis.
    pub(crate) fn has(&self, point: Point2, within_m: f64) -> bool {
        (self.low.x_m - within_m..=self.high.x_m + within_m).contains(&point.x_m)
            && (self.low.y_m - within_m..=self.high.y_m + within_m).contains(&point.y_m)
    }

    /// Distance from a point, metres; zero inside.
    fn distance_m(&self, point: Point2) -> f64 {
        let nearest = Point2::new(
            point.x_m.max(self.low.x_m).min(self.high.x_m),
            point.y_m.max(self.low.y_m).min(self.high.y_m),
        );
        nearest.distance(point)
    }
}

impl Map {
    /// Creates a map of these lanes, in any order.
    ///
    /// The first of: a duplicate identity, a reference to a missing lane, a neighbour on one side only, a successor
    /// that starts elsewhere, borders that cross.
    pub fn new(lanes: Vec<Lane>) -> Result<Self, MapError> {
        Self::with_features(lanes, Features::default())
    }

    /// Creates a map of these lanes and the elements on them, in any order.
    ///
    /// # Errors
    /// As [`new`](Self::new); then the first of: a duplicate identity, a reference to a missing lane or signal, a stop
    /// line beyond its lane, a right of way between other lanes than the junction's, an outline that is no polygon,
    /// coordinates that are not finite.
    pub fn with_features(mut lanes: Vec<Lane>, mut features: Features) -> Result<Self, MapError> {
        features.sort();
        lanes.sort_by_key(|lane| lane.id);
        if let Some(two) = lanes.windows(2).find(|two| two[0].id == two[1].id) {
            return Err(MapError::Twice(two[0].id));
        }
        let bounds: Vec<Bounds> = lanes.iter().map(Bounds::around).collect();
        let mut predecessors = vec![Vec::new(); lanes.len()];
        for lane in &lanes {
            for next in &lane.successors {
                if let Ok(index) = lanes.binary_search_by_key(next, |lane| lane.id) {
                    predecessors[index].push(lane.id);
                }
            }
        }
        let junctions = features.junctions.iter().map(|one| one.lanes.iter().chain(&one.incoming));
        let junctions_of = by_lane(junctions);
        let signals_of = by_lane(features.signals.iter().map(|signal| signal.lanes.iter()));
        let paths = Paths::default();
        let cells = Cells::new(&bounds);
        let conflicts = Found::default();
        let map =
            Self { lanes, bounds, cells, predecessors, features, junctions_of, signals_of, paths, conflicts };
        map.lanes.iter().try_for_each(|lane| map.check(lane))?;
        map.features.check(&map.lanes)?;
        Ok(map)
    }

    /// Lanes and the elements on them, which can be changed and made a map again.
    pub fn into_parts(self) -> (Vec<Lane>, Features) {
        (self.lanes, self.features)
    }

    fn check(&self, lane: &Lane) -> Result<(), MapError> {
        let named = |named: LaneId| self.lane(named).ok_or(MapError::Missing { lane: lane.id, named });
        for (is_left, neighbour) in [(true, lane.left), (false, lane.right)] {
            let Some(Neighbour { lane: id, opposite }) = neighbour else { continue };
            let other = named(id)?;
            // A lane to the left has this one to its right, or to its left if it runs the other way.
            let back = if is_left == opposite { other.left } else { other.right };
            if back != Some(Neighbour { lane: lane.id, opposite }) {
                return Err(MapError::OneSided { lane: lane.id, neighbour: id });
            }
        }
        let end = lane.line.points()[lane.line.points().len() - 1];
        for &successor in &lane.successors {
            let gap_m = named(successor)?.line.points()[0].distance(end);
            if gap_m > JOINT_M {
                return Err(MapError::Gap { lane: lane.id, successor, gap_m });
            }
        }
        let (left, right) = (lane.borders.left().stations(), lane.borders.right().stations());
        let mut places = left.iter().chain(right).map(|x| x.s_m).chain([0.0, lane.line.length()]);
        match places.find(|&s_m| lane.width_m(s_m) < 0.0) {
            Some(s_m) => Err(MapError::Width { lane: lane.id, s_m }),
            None => Ok(()),
        }
    }

    /// All lanes, ordered by identity.
    pub fn lanes(&self) -> &[Lane] {
        &self.lanes
    }

    /// Lane with this identity.
    pub fn lane(&self, id: LaneId) -> Option<&Lane> {
        self.index(id).map(|index| &self.lanes[index])
    }

    /// Lanes that have this one as a successor, ordered by identity.
    pub fn predecessors(&self, id: LaneId) -> &[LaneId] {
        self.index(id).map_or(&[], |index| &self.predecessors[index])
    }

    /// Elements beside the lanes, sorted.
    pub fn features(&self) -> &Features {
        &self.features
    }

    /// Junctions, ordered by identity.
    pub fn junctions(&self) -> &[Junction] {
        &self.features.junctions
    }

    /// Junction with this identity.
    pub fn junction(&self, id: JunctionId) -> Option<&Junction> {
        let junctions = &self.features.junctions;
        junctions.binary_search_by_key(&id, |one| one.id).ok().map(|index| &junctions[index])
    }

    /// Junctions that a lane is inside or leads into, ordered by identity.
    pub fn junctions_of(&self, lane: LaneId) -> impl Iterator<Item = &Junction> {
        of_lane(&self.junctions_of, lane).map(|index| &self.features.junctions[index])
    }

    /// Returns true if a lane is inside a junction.
    pub fn is_in_junction(&self, lane: LaneId) -> bool {
        self.junctions_of(lane).any(|junction| junction.lanes.binary_search(&lane).is_ok())
    }

    /// Traffic signals, ordered by identity.
    pub fn signals(&self) -> &[Signal] {
        &self.features.signals
    }

    /// Traffic signal with this identity.
    pub fn signal(&self, id: SignalId) -> Option<&Signal> {
        let signals = &self.features.signals;
        signals.binary_search_by_key(&id, |one| one.id).ok().map(|index| &signals[index])
    }

    /// Traffic signals that a lane's traffic obeys, ordered by identity.
    pub fn signals_of(&self, lane: LaneId) -> impl Iterator<Item = &Signal> {
        of_lane(&self.signals_of, lane).map(|index| &self.features.signals[index])
    }

    /// Stop lines, ordered by lane and arc length.
    pub fn stop_lines(&self) -> &[StopLine] {
        &self.features.stop_lines
    }

    /// Stop lines of a lane, ordered by arc length.
    pub fn stop_lines_of(&self, lane: LaneId) -> &[StopLine] {
        let lines = &self.features.stop_lines;
        let begin = lines.partition_point(|line| line.lane < lane);
        let count = lines[begin..].partition_point(|line| line.lane == lane);
        &lines[begin..begin + count]
    }

    /// Crossings, ordered by identity.
    pub fn crossings(&self) -> &[Crossing] {
        &self.features.crossings
    }

    /// Areas, ordered by identity.
    pub fn areas(&self) -> &[Area] {
        &self.features.areas
    }

    fn index(&self, id: LaneId) -> Option<usize> {
        self.lanes.binary_search_by_key(&id, |lane| lane.id).ok()
    }

    /// Lanes whose bounding boxes are within `within_m` of that of a lane, itself included, ordered by identity.
    pub(crate) fn near(&self, lane: &Lane, within_m: f64) -> impl Iterator<Item = (&Lane, &Bounds)> {
        let own = Bounds::around(lane);
        self.lanes.iter().zip(&self.bounds).filter(move |(_, other)| own.is_near(other, within_m))
    }

    /// Lanes that contain a point, ordered by identity: several where lanes cross, merge or share a border.
    pub fn at(&self, point: Point2) -> impl Iterator<Item = LanePlace> + '_ {
        let near = self.cells.at(point).iter().map(|k| *k as usize);
        let near = near.filter(move |k| self.bounds[*k].has(point, 0.0)).map(|k| &self.lanes[k]);
        near.filter_map(move |lane| lane.place_of(point).map(|place| LanePlace { lane: lane.id, place }))
    }

    /// Lane with the nearest centre line to a point, at any distance; the first of equally near ones. `None` only for
    /// a map without lanes.
    pub fn nearest(&self, point: Point2) -> Option<LanePlace> {
        let mut nearest: Option<(f64, LanePlace)> = None;
        for (lane, bounds) in self.lanes.iter().zip(&self.bounds) {
            let reach_m = nearest.map_or(f64::INFINITY, |(distance_m, _)| distance_m);
            if bounds.distance_m(point) >= reach_m {
                continue;
            }
            let place = lane.line.project(point);
            // The line is extended straight beyond its ends; the lane is not.
            let on_lane = lane.line.at(place.s_m.clamp(0.0, lane.line.length())).pose.point();
            let distance_m = on_lane.distance(point);
            if distance_m < reach_m {
                nearest = Some((distance_m, LanePlace { lane: lane.id, place }));
            }
        }
        nearest.map(|(_, place)| place)
    }
}

/// Pairs of a lane and the index of an element that refers to it, sorted and once each.
fn by_lane<'m>(elements: impl Iterator<Item = impl Iterator<Item = &'m LaneId>>) -> Vec<(LaneId, usize)> {
    let mut pairs: Vec<_> =
        elements.enumerate().flat_map(|(index, lanes)| lanes.map(move |lane| (*lane, index))).collect();
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}

/// Indices of the elements of a lane in sorted pairs.
fn of_lane(pairs: &[(LaneId, usize)], lane: LaneId) -> impl Iterator<Item = usize> {
    let begin = pairs.partition_point(|pair| pair.0 < lane);
    pairs[begin..].iter().take_while(move |pair| pair.0 == lane).map(|pair| pair.1)
}

#[cfg(test)]
mod tests;
