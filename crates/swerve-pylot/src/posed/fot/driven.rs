//! Closed-loop drive of the car's dynamic model along a path.

use swerve_geom::{Point2, Polyline, Pose2, angle_between, math};
use swerve_vehicle::{SingleTrack, SingleTrackState, VehicleParams};

/// Steering of the test driver beyond the kinematic angle, per lateral acceleration, rad s²/m.
const UNDERSTEER_RADPMPS2: f64 = 0.0022;

/// Preview time of the test driver, seconds.
const PREVIEW_S: f64 = 0.15;

/// Largest distance of the car's dynamic single-track model from a path (x, y, heading, t) that it drives at the path's
/// own mean speed, reduced to keep 0.8 g; metres.
pub(super) fn driven_off_m(path: &[[f64; 4]]) -> f64 {
    let points: Vec<Point2> = path.iter().map(|p| Point2::new(p[0], p[1])).collect();
    let Ok(line) = Polyline::new(&points) else { return 0.0 };
    let mean_mps = line.length() / (path[path.len() - 1][3] - path[0][3]);
    let bends = |s_m: f64| line.at(s_m.clamp(0.5, (line.length() - 0.5).max(0.5))).curvature_1pm;
    let tightest = (0..=200).map(|k| bends(line.length() * f64::from(k) / 200.0).abs()).fold(0.0, f64::max);
    let speed_mps = mean_mps.min((0.8 * 9.81 / tightest.max(1e-6)).sqrt());
    let params = VehicleParams::default();
    let car = SingleTrack::new(&params, 1.0);
    let wheelbase_m = params.shape.wheelbase_m;
    // Feed-forward: the kinematic angle plus the tyres' slip; the gains below were found by a sweep.
    let steering = |curvature: f64, v: f64| {
        math::atan(curvature * wheelbase_m) + UNDERSTEER_RADPMPS2 * curvature * v * v
    };
    let mut state = SingleTrack::straight(Pose2::default(), speed_mps);
    for _ in 0..400 {
        state = car.step(state, steering(bends(0.0), speed_mps), 2.0 * (speed_mps - state.vx_mps), 0.005);
    }
    let drift =
        |s: &SingleTrackState| math::atan2(s.vy_mps - params.cg_to_rear_m() * s.yaw_rate_radps, s.vx_mps);
    state.pose = Pose2::new(points[0].x_m, points[0].y_m, path[0][2] - drift(&state));
    let (mut off_m, mut s_m) = (0.0_f64, 0.0);
    for _ in 0..4000 {
        let place = line.project_near(state.pose.point(), s_m, 5.0);
        s_m = place.s_m;
        if s_m >= line.length() {
            break;
        }
        off_m = off_m.max(place.d_m.abs());
        let course = state.pose.heading_rad + drift(&state);
        let ahead_m = PREVIEW_S * speed_mps;
        let ahead = line.at(s_m + ahead_m).pose.heading_rad - state.yaw_rate_radps * PREVIEW_S;
        let turn = angle_between(course, ahead);
        let back = 4.0 / speed_mps.max(4.0) * place.d_m;
        let wanted = steering(bends(s_m + ahead_m), speed_mps) + 1.5 * turn - back;
        state = car.step(state, wanted, 2.0 * (speed_mps - state.vx_mps), 0.005);
    }
    off_m
}
