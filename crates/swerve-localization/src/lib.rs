//! Localization: pose and velocity of the vehicle, with their uncertainty.
//!
//! [`Eskf`] is the filter. [`Localizer`] adds initialisation, gating, vehicle constraints, late measurements and
//! modes. [`flat`] projects satellite fixes onto the map.
//!
//! Excluded: engine, simulator, files, clocks, ground truth, message types. A [`Localizer`] allocates no memory after
//! construction. Products of large matrices do not use nalgebra, which selects instructions, and thereby bits, by
//! processor.

pub mod centred;
pub mod dead_reckoning;
mod eigen;
pub mod eskf;
pub mod flat;
mod grid;
pub mod icp;
mod lanes;
pub mod lateral_velocity;
mod localizer;
pub mod map_file;
pub mod matcher;
pub mod ndt;
pub mod npz;
pub mod odometry;
mod params;
pub mod ply;
pub mod recorded;
pub mod sweep;
pub mod voxels;

pub use eskf::{Eskf, Innovation};
pub use grid::downsampled;
pub use localizer::{Estimate, Initial, Localizer, Mode, Sensed, Source, Taken, Tally, UnitHealth};
pub use params::{Hold, Params};
