//! What can be driven from any pose.

use core::f64::consts::TAU;

use super::dubins::Piece;

/// Curvatures in units of the largest.
const SHARES: [f64; 5] = [0.0, 0.5, -0.5, 1.0, -1.0];

/// Straight, half and full curvature to either side, each `step_m` long.
pub(crate) fn fan(radius_m: f64, step_m: f64) -> [Piece; 5] {
    SHARES.map(|share| Piece { curvature_1pm: share / radius_m, length_m: step_m })
}

/// The original's motions: straight, and arcs of the one radius to either side whose angle is `step_m / r`, for `r`
/// from `-low` to `high` (metres) in steps of `scan_step`.
///
/// The original scans around the absolute heading, so that what the car can do depends on where north is; here
/// the scan is around zero. Arcs beyond a full turn come to where they have been and are left out.
pub(crate) fn scan(
    radius_m: f64,
    step_m: f64,
    (low, high): (f64, f64),
    scan_step: f64,
    motions: &mut Vec<Piece>,
) {
    motions.clear();
    motions.push(Piece { curvature_1pm: 0.0, length_m: step_m });
    let steps = ((high + low) / scan_step).floor().clamp(0.0, 1000.0) as usize;
    for k in 0..=steps {
        let r = -low + scan_step * k as f64;
        let angle = (step_m / r).abs();
        if angle < TAU {
            for side in [1.0, -1.0] {
                motions.push(Piece { curvature_1pm: side / radius_m, length_m: radius_m * angle });
            }
        }
    }
}
