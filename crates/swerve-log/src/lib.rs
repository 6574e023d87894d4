//! swerve-log
