//! swerve-sim
