//! Sides of lanes, and what is beside them.

use swerve_map::{Lane, LaneKind, Neighbour, Side};

/// True for lanes with asphalt.
pub(super) fn is_road(kind: LaneKind) -> bool {
    kind != LaneKind::Walking
}

/// Neighbour of a lane on a side.
pub(super) fn neighbour(lane: &Lane, side: Side) -> Option<Neighbour> {
    match side {
        Side::Left => lane.left,
        Side::Right => lane.right,
    }
}

/// Sign of offsets to a side.
pub(super) fn sign(side: Side) -> f64 {
    match side {
        Side::Left => 1.0,
        Side::Right => -1.0,
    }
}
