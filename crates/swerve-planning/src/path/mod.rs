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
