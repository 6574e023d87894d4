//! The ground of a scenario on a map.

use std::sync::Arc;

use swerve_geom::Point2;
use swerve_map::router::{Navigator, Stop};
use swerve_map::{LaneKind, LanePlace, Map};
use swerve_msg::Route;

use super::KERB_M;
use crate::MapText;

/// A map, and the ego's route over it.
#[derive(Clone, PartialEq, Debug)]
pub struct MapCourse {
    /// File as named in the scenario.
    pub file: String,
    /// Text of the file.
    pub text: MapText,
    /// The map.
    pub map: Arc<Map>,
    /// First route from the start to the goal and beyond.
    pub route: Route,
    /// Start, places on the way, and goal.
    pub stops: Vec<Stop>,
    /// Places that are closed to traffic, and reported to be.
    pub closures: Vec<Closure>,
    /// Properties of the way that drives on the map neglect: slopes that are not small, and traffic that keeps to the
    /// left.
    pub warnings: Vec<String>,
}

/// A place on a lane that is closed to traffic.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Closure {
    /// The place.
    pub at: Stop,
    /// Time from which the closure is reported, seconds.
    pub reported_s: f64,
}

/// Largest gap between lanes that is ground too, metres: where their ends are not side by side.
const GAP_M: f64 = 0.35;

impl MapCourse {
    /// Returns true if a point is on a drivable lane, or in a gap between lanes.
    pub fn is_ground(&self, point: Point2) -> bool {
        let is_drivable = |lane| self.map.lane(lane).is_some_and(|lane| lane.kind.is_drivable());
        let aside = [[0.0, 0.0], [GAP_M, 0.0], [-GAP_M, 0.0], [0.0, GAP_M], [0.0, -GAP_M]];
        let places = aside.map(|[x_m, y_m]| Point2::new(point.x_m + x_m, point.y_m + y_m));
        places.iter().any(|place| self.map.at(*place).any(|at| is_drivable(at.lane)))
    }

    /// Height of the ground: that of a pavement on lanes for pedestrians that no other lane overlaps.
    pub(super) fn ground_m(&self, point: Point2) -> f64 {
        let is_walk =
            |at: LanePlace| self.map.lane(at.lane).is_some_and(|lane| lane.kind == LaneKind::Walking);
        let mut walks = self.map.at(point).map(is_walk).peekable();
        if walks.peek().is_some() && walks.all(|is_walk| is_walk) { KERB_M } else { 0.0 }
    }

    /// Returns true if a point is on the lane of the destination, at it or beyond.
    pub fn is_at_goal(&self, point: Point2) -> bool {
        let Some(goal) = self.stops.last() else { return false };
        let place = self.map.lane(goal.lane).and_then(|lane| lane.place_of(point));
        place.is_some_and(|place| place.s_m >= goal.s_m)
    }

    /// Length of the ego's routes beyond the goal, metres, so that planners know the road ahead.
    pub const BEYOND_GOAL_M: f64 = 200.0;

    /// Keeps the route of the ego during a drive at `speed_mps` at most.
    pub fn navigator(&self, speed_mps: f64) -> Navigator {
        let map = Arc::clone(&self.map);
        Navigator::new(map, self.route.clone(), &self.stops, Self::BEYOND_GOAL_M, speed_mps)
    }
}
