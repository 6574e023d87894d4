//! Lane maps.

use serde::{Deserialize, Serialize};
use swerve_geom::{FrenetPoint, Point2};

use crate::{Lane, LaneId, Neighbour};

/// Largest gap between the end of a lane and the start of its successor, metres.
const JOINT_M: f64 = 0.1;

/// A consistent set of lanes. Its text form is the list of lanes.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(try_from = "Vec<Lane>", into = "Vec<Lane>")]
pub struct Map {
    /// Ordered by identity.
    lanes: Vec<Lane>,
    /// Axis-aligned bounding box of each lane.
    bounds: Vec<Bounds>,
    /// Predecessors of each lane, ordered by identity.
    predecessors: Vec<Vec<LaneId>>,
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
}

#[derive(Clone, Copy, PartialEq, Debug)]
struct Bounds {
    low: Point2,
    high: Point2,
}

impl Bounds {
    /// Bounds of the lane between its borders.
    fn around(lane: &Lane) -> Self {
        let ends = |f: fn(f64, f64) -> f64, first: f64| {
            let points = lane.line.points().iter();
            points.fold((first, first), |(x, y), p| (f(x, p.x_m), f(y, p.y_m)))
        };
        let beside_m = lane.borders.farthest_m().max(0.0);
        let (low, high) = (ends(f64::min, f64::INFINITY), ends(f64::max, f64::NEG_INFINITY));
        Self {
            low: Point2::new(low.0 - beside_m, low.1 - beside_m),
            high: Point2::new(high.0 + beside_m, high.1 + beside_m),
        }
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

impl TryFrom<Vec<Lane>> for Map {
    type Error = MapError;
    fn try_from(lanes: Vec<Lane>) -> Result<Self, MapError> {
        Self::new(lanes)
    }
}

impl From<Map> for Vec<Lane> {
    fn from(map: Map) -> Self {
        map.lanes
    }
}

impl Map {
    /// Creates a map of these lanes, in any order.
    ///
    /// The first of: a duplicate identity, a reference to a missing lane, a neighbour on one side only, a successor
    /// that starts elsewhere, borders that cross.
    pub fn new(mut lanes: Vec<Lane>) -> Result<Self, MapError> {
        lanes.sort_by_key(|lane| lane.id);
        if let Some(two) = lanes.windows(2).find(|two| two[0].id == two[1].id) {
            return Err(MapError::Twice(two[0].id));
        }
        let bounds = lanes.iter().map(Bounds::around).collect();
        let mut predecessors = vec![Vec::new(); lanes.len()];
        for lane in &lanes {
            for next in &lane.successors {
                if let Ok(index) = lanes.binary_search_by_key(next, |lane| lane.id) {
                    predecessors[index].push(lane.id);
                }
            }
        }
        let map = Self { lanes, bounds, predecessors };
        map.lanes.iter().try_for_each(|lane| map.check(lane))?;
        Ok(map)
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

    fn index(&self, id: LaneId) -> Option<usize> {
        self.lanes.binary_search_by_key(&id, |lane| lane.id).ok()
    }

    /// Lanes that contain a point, ordered by identity: several where lanes cross, merge or share a border.
    pub fn at(&self, point: Point2) -> impl Iterator<Item = LanePlace> + '_ {
        let near = self.lanes.iter().zip(&self.bounds).filter(move |(_, b)| b.distance_m(point) == 0.0);
        near.filter_map(move |(lane, _)| lane.place_of(point).map(|place| LanePlace { lane: lane.id, place }))
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

#[cfg(test)]
mod tests;
