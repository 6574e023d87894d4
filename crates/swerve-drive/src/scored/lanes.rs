//! Place of the ego on the lanes of a map.

use std::sync::Arc;

use swerve_eval::score::nuplan::LaneFacts;
use swerve_geom::{Obb, Point2, Pose2, angle_between, math};
use swerve_map::{Lane, LaneId, LaneIndex, LaneKind, LanePlace, Map};
use swerve_scenario::MapCourse;

/// Lanes of a map for driving or parking.
#[derive(Debug)]
pub(super) struct Lanes {
    course: Arc<MapCourse>,
    index: LaneIndex,
}

/// The lane at a pose, or the nearest one.
#[derive(Clone, Copy, Debug)]
pub(super) struct AtLane {
    /// Distance from the lane, metres; zero inside.
    pub(super) off_m: f64,
    /// True if it has the opposite direction; false in junctions.
    pub(super) is_against: bool,
    pub(super) heading_rad: f64,
    pub(super) limit_mps: Option<f64>,
}

fn is_for_cars(lane: &Lane) -> bool {
    matches!(lane.kind, LaneKind::Driving | LaneKind::Parking)
}

impl Lanes {
    pub(super) fn new(course: &Arc<MapCourse>) -> Self {
        Self { course: Arc::clone(course), index: LaneIndex::of(&course.map, is_for_cars) }
    }

    pub(super) fn map(&self) -> &Map {
        &self.course.map
    }

    /// Lanes that contain a point.
    fn inside(&self, point: Point2) -> impl Iterator<Item = (&Lane, LanePlace)> {
        let of = |at: LanePlace| Some((self.map().lane(at.lane)?, at));
        self.map().at(point).filter_map(of).filter(|(lane, _)| is_for_cars(lane))
    }

    /// The lane that contains the pose; of several, that with the nearest heading.
    fn own(&self, pose: Pose2) -> Option<(&Lane, LanePlace)> {
        let turn = |(lane, at): &(&Lane, LanePlace)| angle_between(pose.heading_rad, heading(lane, at)).abs();
        self.inside(pose.point()).min_by(|a, b| turn(a).total_cmp(&turn(b)))
    }

    /// The lane that contains the pose, or the nearest one.
    pub(super) fn nearest(&self, pose: Pose2) -> Option<(&Lane, LanePlace)> {
        let found = || {
            let at = self.index.nearest(pose.point())?;
            Some((self.map().lane(at.lane)?, at))
        };
        self.own(pose).or_else(found)
    }

    pub(super) fn at(&self, pose: Pose2) -> AtLane {
        let Some((lane, at)) = self.nearest(pose) else {
            // No map of a drive is without lanes.
            return AtLane { off_m: f64::INFINITY, is_against: false, heading_rad: 0.0, limit_mps: None };
        };
        let heading_rad = heading(lane, &at);
        let is_turned = math::cos(angle_between(pose.heading_rad, heading_rad)) < 0.0;
        AtLane {
            off_m: off_m(lane, &at),
            is_against: is_turned
                && !self.is_in_junction(pose.point())
                && !self.map().is_in_junction(lane.id),
            heading_rad,
            limit_mps: lane.speed_limit_mps,
        }
    }

    fn is_in_junction(&self, point: Point2) -> bool {
        self.inside(point).any(|(lane, _)| self.map().is_in_junction(lane.id))
    }

    /// Facts for nuPlan's score.
    pub(super) fn facts(&self, rear_axle: Pose2, outline: &Obb) -> LaneFacts {
        let own = self.own(outline.center);
        let corners = outline.corners();
        let corner_outside_m = |corner: Point2| match self.course.is_ground(corner) {
            true => 0.0,
            false => {
                let at = self.index.nearest(corner);
                let off = at.and_then(|at| Some(off_m(self.map().lane(at.lane)?, &at)));
                off.unwrap_or(f64::INFINITY)
            }
        };
        LaneFacts {
            lane: own.map(|(lane, at)| (u64::from(lane.id.0), at.place.s_m)),
            limits_mps: own.map_or_else(Vec::new, |(lane, _)| self.limits(lane)),
            in_one_lane: self.is_in_one_lane(outline.center.point(), &corners),
            in_intersection: self.is_in_junction(rear_axle.point()),
            corner_outside_m: corners.into_iter().map(corner_outside_m).fold(0.0, f64::max),
        }
    }

    /// Speed limit of a lane; in a junction, those of the lanes before and after, zero where unknown.
    fn limits(&self, lane: &Lane) -> Vec<f64> {
        if !self.map().is_in_junction(lane.id) {
            return lane.speed_limit_mps.into_iter().collect();
        }
        let beside = self.map().predecessors(lane.id).iter().chain(&lane.successors);
        let limit = |id: &LaneId| self.map().lane(*id)?.speed_limit_mps;
        beside.map(|id| limit(id).unwrap_or(0.0)).collect()
    }

    /// True if all points are in one of the lanes at the centre, or in lanes before or after it.
    fn is_in_one_lane(&self, center: Point2, corners: &[Point2]) -> bool {
        let lanes_at =
            |point: Point2| -> Vec<LaneId> { self.inside(point).map(|(lane, _)| lane.id).collect() };
        let corners: Vec<Vec<LaneId>> = corners.iter().map(|corner| lanes_at(*corner)).collect();
        self.inside(center).any(|(lane, _)| {
            let before = self.map().predecessors(lane.id);
            let is_of = |id: &LaneId| *id == lane.id || lane.successors.contains(id) || before.contains(id);
            corners.iter().all(|lanes| lanes.iter().any(is_of))
        })
    }
}

fn heading(lane: &Lane, at: &LanePlace) -> f64 {
    lane.line.at(at.place.s_m).pose.heading_rad
}

/// Distance of a place from its lane, metres; zero inside.
fn off_m(lane: &Lane, at: &LanePlace) -> f64 {
    let swerve_geom::FrenetPoint { s_m, d_m } = at.place;
    let along_m = s_m.clamp(0.0, lane.line.length());
    let border_m = if d_m > 0.0 { lane.borders.left_m(along_m) } else { lane.borders.right_m(along_m) };
    math::hypot((d_m.abs() - border_m).max(0.0), s_m - along_m)
}
