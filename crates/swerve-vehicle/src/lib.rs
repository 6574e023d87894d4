//! swerve-vehicle
