//! swerve
