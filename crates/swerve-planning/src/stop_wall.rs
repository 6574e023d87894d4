//! Places to stop at as obstacles, for planners that know obstacles alone.

use swerve_core::Time;
use swerve_geom::{FrenetPoint, Pose2};
use swerve_msg::{ActorId, ActorKind, Extent, PredictedPose, Prediction, Route};

/// Thickness and height of the obstacle on a stop line, metres.
const WALL_M: [f64; 2] = [0.5, 1.0];

/// An obstacle across the drivable ground, from arc length `line_s_m` of the route on, for the whole prediction
/// horizon.
pub fn stop_wall(id: ActorId, line_s_m: f64, route: &Route, at: Time) -> Prediction {
    let [length_m, height_m] = WALL_M;
    let s_m = line_s_m + 0.5 * length_m;
    let [left_m, right_m] = [route.left_m(s_m), route.right_m(s_m)];
    let middle = route.unproject(FrenetPoint { s_m, d_m: 0.5 * (left_m - right_m) });
    let pose = Pose2::new(middle.x_m, middle.y_m, route.line().at(s_m).pose.heading_rad);
    let extent = Extent { length_m, width_m: left_m + right_m, height_m };
    Prediction::single(id, ActorKind::Static, extent, vec![PredictedPose { at, pose }])
}

#[cfg(test)]
mod tests {
    use swerve_geom::{Point2, Polyline};

    use super::*;

    #[test]
    fn wall_begins_at_the_line_and_spans_the_ground() {
        let line = Polyline::new(&[Point2::new(0.0, 0.0), Point2::new(500.0, 0.0)]).unwrap();
        let wall = stop_wall(ActorId(9), 300.0, &Route::uniform(line, 6.0, 2.0), Time::ZERO);
        let corners = wall.extent.footprint(wall.path[0].pose).corners();
        let [mut near_m, mut right_m, mut left_m] = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY];
        for corner in corners {
            (near_m, right_m, left_m) =
                (near_m.min(corner.x_m), right_m.min(corner.y_m), left_m.max(corner.y_m));
        }
        assert!((near_m - 300.0).abs() < 1e-9 && (right_m + 2.0).abs() < 1e-9 && (left_m - 6.0).abs() < 1e-9);
    }
}
