//! Paths that a car can drive: their geometry, their speeds, where they are free, how they are shortened.
//!
//! Poses are of the ego origin in the map. A path is a list of [`piece::Piece`]s from a start pose, or of
//! [`points::PathPoint`]s; [`speed::timed_points`] makes the points of a plan of it.

pub mod dubins;
pub mod ground;
pub mod piece;
pub mod points;
pub(crate) mod replanner;
pub mod route;
pub mod shorten;
pub mod speed;

use swerve_geom::Pose2;

/// From where to where a search goes.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Ends {
    /// The first pose.
    pub start: Pose2,
    /// The pose to reach.
    pub goal: Pose2,
    /// Poses lie within x_min, y_min, x_max, y_max, metres.
    pub bounds: [f64; 4],
}
