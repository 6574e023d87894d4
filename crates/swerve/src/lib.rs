//! swerve

pub mod timing;
