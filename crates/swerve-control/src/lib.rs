//! swerve-control
