//! Motion primitives of the search.

use crate::path::piece::Piece;

/// Curvatures relative to the largest one.
const SHARES: [f64; 5] = [0.0, 0.5, -0.5, 1.0, -1.0];

/// Straight, half and full curvature to either side, each `step_m` long.
pub fn fan(radius_m: f64, step_m: f64) -> [Piece; 5] {
    SHARES.map(|share| Piece { curvature_1pm: share / radius_m, length_m: step_m })
}
