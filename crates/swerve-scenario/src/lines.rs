//! Lines painted along the ego's route.

use swerve_map::{Border, Borders};
use swerve_msg::{RoadLine, Route};

use crate::road::ONE_LINE_M;

/// Lines along the ego's route: the edges of the drivable ground, and the borders of the ego's lane where the ground
/// extends beyond them. Inside junctions there are none.
#[derive(Clone, PartialEq, Debug)]
pub struct RoadLines {
    lane: Borders,
    ground: Borders,
    /// Ranges along the route inside junctions, metres.
    junctions: Vec<[f64; 2]>,
}

impl RoadLines {
    /// All lines, from right to left.
    pub const ALL: [RoadLine; 4] =
        [RoadLine::RightEdge, RoadLine::LaneRight, RoadLine::LaneLeft, RoadLine::LeftEdge];

    pub(crate) fn of(route: &Route) -> Self {
        let stretches = route.stretches();
        let ends = stretches.iter().skip(1).map(|next| next.begin_m).chain([f64::INFINITY]);
        let inside = stretches.iter().zip(ends).filter(|(stretch, _)| stretch.in_junction);
        Self {
            lane: route.lane().clone(),
            ground: route.borders().clone(),
            junctions: inside.map(|(stretch, end_m)| [stretch.begin_m, end_m]).collect(),
        }
    }

    /// Offset of a line to the left of the route's line at arc length `s_m`, metres; `None` if there is none.
    pub fn offset_m(&self, line: RoadLine, s_m: f64) -> Option<f64> {
        if self.junctions.iter().any(|[from_m, to_m]| (*from_m..*to_m).contains(&s_m)) {
            return None;
        }
        let between = |lane_m: f64, ground_m: f64| (lane_m < ground_m - ONE_LINE_M).then_some(lane_m);
        let (lane, ground) = (&self.lane, &self.ground);
        match line {
            RoadLine::RightEdge => Some(-ground.right_m(s_m)),
            RoadLine::LaneRight => between(lane.right_m(s_m), ground.right_m(s_m)).map(|right_m| -right_m),
            RoadLine::LaneLeft => between(lane.left_m(s_m), ground.left_m(s_m)),
            RoadLine::LeftEdge => Some(ground.left_m(s_m)),
        }
    }

    /// Offsets of the lane's borders that are within the ground somewhere, as functions of arc length.
    pub fn inner(&self) -> Vec<Border> {
        let (lane, ground) = (&self.lane, &self.ground);
        let sides = [(lane.right(), ground.right(), -1.0), (lane.left(), ground.left(), 1.0)];
        let is_inner = |(own, edge, _): &(&Border, &Border, f64)| {
            let stations = own.stations().iter().chain(edge.stations()).map(|station| station.s_m);
            stations.chain([0.0]).any(|s_m| own.at(s_m) < edge.at(s_m) - ONE_LINE_M)
        };
        sides.into_iter().filter(is_inner).map(|(own, _, sign)| own.scaled(sign)).collect()
    }

    /// Offsets of all lines at arc length `s_m`, from right to left.
    pub fn at(&self, s_m: f64) -> impl Iterator<Item = (RoadLine, f64)> + '_ {
        Self::ALL.into_iter().filter_map(move |line| Some((line, self.offset_m(line, s_m)?)))
    }
}

#[cfg(test)]
mod tests {
    use swerve_geom::{Point2, Polyline};

    use super::*;

    #[test]
    fn lines_are_the_edges_and_the_lane_borders_between_them() {
        let lines = |half_m: f64, left_m: f64, right_m: f64| -> Vec<(RoadLine, f64)> {
            let line = Polyline::new(&[Point2::new(0.0, 0.0), Point2::new(100.0, 0.0)]).unwrap();
            let lane = Borders::constant(half_m.min(left_m), half_m.min(right_m));
            RoadLines::of(&Route::uniform(line, left_m, right_m).in_lane(lane)).at(50.0).collect()
        };
        let (right, lane_left, left) = (RoadLine::RightEdge, RoadLine::LaneLeft, RoadLine::LeftEdge);
        assert_eq!(lines(2.0, 6.0, 2.0), [(right, -2.0), (lane_left, 2.0), (left, 6.0)]);
        assert_eq!(lines(2.0, 2.0, 3.0), [(right, -3.0), (RoadLine::LaneRight, -2.0), (left, 2.0)]);
        // A lane wider than the drivable ground has no border within it.
        assert_eq!(lines(4.0, 2.0, 3.0), [(right, -3.0), (left, 2.0)]);
    }
}
