//! Solutions of arcs and straights, timed at a steady speed.

use swerve_geom::{Point2, Pose2, math};
use swerve_planning::path::piece::{Piece, advance, walk};
use swerve_vehicle::{Kinematic, VehicleParams};

use super::drive::worst_offset_m;
use super::{CLEARANCE_CAP_M, Solution};

/// Spacing of the points of a solution's path, metres.
const POINT_M: f64 = 0.25;

/// Sampling distance for a solution's clearance, metres.
const CLEARANCE_STEP_M: f64 = 0.1;

/// Largest lateral acceleration at a solution's speed: 0.8 g, m/s².
const LATERAL_MPS2: f64 = 0.8 * 9.81;

/// Largest distance of the driven car from a solution's path, metres.
const OFF_MAX_M: f64 = 0.25;

/// Largest speed at which a solution is timed, m/s.
const SPEED_MAX_MPS: f64 = 20.0;

/// Approximate lower bound on the speed at which a solution is timed, m/s.
const SPEED_MIN_MPS: f64 = 0.5;

/// Factor by which the speed is reduced while the car leaves the path.
const SLOWER: f64 = 0.9;

/// Speed at which the Lincoln follows `pieces` from `start`, m/s: within 0.8 g in the tightest turn, and with the
/// driven vehicle model within [`OFF_MAX_M`].
fn drivable_mps(start: Pose2, pieces: &[Piece]) -> f64 {
    let car = Kinematic::new(&VehicleParams::default());
    let bends = pieces.iter().map(|piece| piece.curvature_1pm.abs().max(1e-9));
    let fastest_mps = bends.map(|bend_1pm| (LATERAL_MPS2 / bend_1pm).sqrt()).fold(SPEED_MAX_MPS, f64::min);
    let mut speed_mps = fastest_mps;
    while speed_mps > SPEED_MIN_MPS && worst_offset_m(&car, start, pieces, speed_mps) > OFF_MAX_M {
        speed_mps *= SLOWER;
    }
    speed_mps
}

/// The solution along `pieces`, timed at a steady speed at which the car can follow it.
pub(super) fn solution(
    id: &str,
    start: Pose2,
    pieces: &[Piece],
    distance_m: impl Fn(Point2, [f64; 2]) -> f64,
) -> Solution {
    let curvature_max = pieces.iter().map(|p| p.curvature_1pm.abs()).fold(0.0, f64::max);
    let speed_mps = drivable_mps(start, pieces);
    let mut path = vec![[start.x_m, start.y_m, start.heading_rad, 0.0]];
    let (sin, cos) = math::sin_cos(start.heading_rad);
    let mut clearance_m = distance_m(start.point(), [cos, sin]).min(CLEARANCE_CAP_M);
    let (mut from, mut s_m) = (start, 0.0);
    for &piece in pieces {
        let n = (piece.length_m / POINT_M).ceil().max(1.0);
        for k in 1..=n as usize {
            let done_m = piece.length_m * k as f64 / n;
            let at = advance(from, piece.curvature_1pm, done_m);
            path.push([at.x_m, at.y_m, at.heading_rad, (s_m + done_m) / speed_mps]);
        }
        walk(from, piece, CLEARANCE_STEP_M, |point, direction, _| {
            clearance_m = clearance_m.min(distance_m(point, direction));
            true
        });
        from = advance(from, piece.curvature_1pm, piece.length_m);
        s_m += piece.length_m;
    }
    Solution {
        id: id.to_owned(),
        found: true,
        length_m: s_m,
        cost: s_m,
        clearance_m,
        curvature_max,
        path,
        ..Solution::default()
    }
}
