//! Drivable paths: geometry, speeds, collision checks and shortening.
//!
//! Poses are of the ego origin in the map. A path is a list of [`piece::Piece`]s from a start pose, or of
//! [`points::PathPoint`]s; [`speed::timed_points`] turns it into the points of a plan.

pub mod dubins;
pub mod ground;
pub mod piece;
pub mod points;
pub(crate) mod replanner;
pub mod route;
pub mod shorten;
pub mod speed;

use swerve_geom::Pose2;

/// Start, goal and bounds of a search.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Ends {
    /// Start pose.
    pub start: Pose2,
    /// Goal pose.
    pub goal: Pose2,
    /// Bounds of all poses: x_min, y_min, x_max, y_max, metres.
    pub bounds: [f64; 4],
}
