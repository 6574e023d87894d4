//! Localization: where the vehicle is, how it stands and moves, and how sure that is.
//!
//! [`Eskf`] is the filter, [`Localizer`] what stands around it: start, gates, constraints of a car, measurements that come
//! late, modes. [`flat`] puts a satellite fix on the map.
//!
//! Absences: no engine, no simulator, no file, no clock, no truth, no message type. No memory is asked for once a
//! [`Localizer`] is made. No product of large matrices from nalgebra: it picks instructions by the processor, and bits
//! with them.

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
