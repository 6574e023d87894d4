//! Closed-loop drives of the vehicle model along paths of arcs and straights.

use swerve_geom::{Pose2, angle_between, math};
use swerve_vehicle::{Kinematic, KinematicState};

use swerve_planning::path::piece::{Piece, advance};

/// Spacing of the tabulated places of the path, metres.
const STEP_M: f64 = 0.1;

/// Time step of the car, seconds.
const DT_S: f64 = 0.01;

/// Length over which the path's curvature is averaged for steering, metres.
const WINDOW_M: f64 = 2.0;

/// Distance over which an offset is corrected, metres.
const REACH_M: f64 = 4.0;

/// A pose on the path with the path's unwrapped heading, radians.
struct TurnedPose {
    pose: Pose2,
    turned_rad: f64,
}

fn places(start: Pose2, pieces: &[Piece]) -> Vec<TurnedPose> {
    let mut places = vec![TurnedPose { pose: start, turned_rad: 0.0 }];
    let (mut from, mut from_m, mut turned_rad) = (start, 0.0, 0.0);
    for piece in pieces {
        let end_m = from_m + piece.length_m;
        while places.len() as f64 * STEP_M <= end_m {
            let done_m = places.len() as f64 * STEP_M - from_m;
            places.push(TurnedPose {
                pose: advance(from, piece.curvature_1pm, done_m),
                turned_rad: turned_rad + piece.curvature_1pm * done_m,
            });
        }
        turned_rad += piece.curvature_1pm * piece.length_m;
        from = advance(from, piece.curvature_1pm, piece.length_m);
        from_m = end_m;
    }
    places
}

/// Largest distance of `car` from the path at a steady speed, metres; its wheels initially match the path.
///
/// It steers by the mean curvature around its place, and by its offset and heading.
pub(super) fn worst_offset_m(car: &Kinematic, start: Pose2, pieces: &[Piece], speed_mps: f64) -> f64 {
    let places = places(start, pieces);
    let last = places.len() - 1;
    let turned = |s_m: f64| places[((s_m / STEP_M).round().max(0.0) as usize).min(last)].turned_rad;
    let first_1pm = pieces.first().map_or(0.0, |piece| piece.curvature_1pm);
    let steering_rad = math::atan(car.wheelbase_m * first_1pm);
    let mut state = KinematicState { pose: start, speed_mps, steering_rad };
    let (mut at, mut worst_m) = (0, 0.0_f64);
    // A car that leaves its path for good never arrives: a successful drive needs less than twice the distance.
    let steps_max = 2.0 * (last as f64 + 1.0) * STEP_M / (speed_mps * DT_S);
    let mut steps = 0.0;
    while at < last && steps < steps_max {
        let away_m = |i: usize| places[i].pose.point().distance(state.pose.point());
        while at < last && away_m(at + 1) <= away_m(at) {
            at += 1;
        }
        let off = state.pose.point() - places[at].pose.point();
        let (sin, cos) = math::sin_cos(places[at].pose.heading_rad);
        let off_m = off.y * cos - off.x * sin;
        worst_m = worst_m.max(off_m.abs());
        let ahead_m = at as f64 * STEP_M + 2.0 * DT_S * speed_mps;
        let mean_1pm = (turned(ahead_m + 0.5 * WINDOW_M) - turned(ahead_m - 0.5 * WINDOW_M)) / WINDOW_M;
        let off_rad = angle_between(places[at].pose.heading_rad, state.pose.heading_rad);
        let curvature_1pm = mean_1pm - off_m / (REACH_M * REACH_M) - 1.4 * off_rad / REACH_M;
        state = car.step(state, math::atan(car.wheelbase_m * curvature_1pm), 0.0, DT_S);
        steps += 1.0;
    }
    if at < last { f64::INFINITY } else { worst_m }
}

#[cfg(test)]
mod tests {
    use swerve_vehicle::VehicleParams;

    use super::*;

    fn offset_m(pieces: &[[f64; 2]], speed_mps: f64) -> f64 {
        let car = Kinematic::new(&VehicleParams::default());
        let pieces: Vec<Piece> =
            pieces.iter().map(|&[curvature_1pm, length_m]| Piece { curvature_1pm, length_m }).collect();
        worst_offset_m(&car, Pose2::new(3.0, -2.0, 2.0), &pieces, speed_mps)
    }

    #[test]
    fn straights_and_circles_are_followed() {
        assert!(offset_m(&[[0.0, 30.0]], 10.0) < 1e-9);
        // More than a full turn, within 0.8 g.
        assert!(offset_m(&[[0.1, 80.0]], 6.0) < 0.05);
    }

    #[test]
    fn curves_too_tight_for_the_speed_are_left() {
        // 0.1/m at 20 m/s is 40 m/s²: the car continues almost straight, 1 - cos(1) of the radius off within 10 m.
        assert!(offset_m(&[[0.0, 10.0], [0.1, 10.0]], 20.0) > 2.0);
    }

    #[test]
    fn short_pieces_are_cut_less_at_low_speed() {
        let wiggle = [[0.0, 5.0], [0.12, 2.0], [-0.12, 4.0], [0.12, 2.0], [0.0, 5.0]];
        assert!(offset_m(&wiggle, 2.0) < offset_m(&wiggle, 8.0));
    }
}
