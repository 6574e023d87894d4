//! swerve-sim
pub mod ego;
