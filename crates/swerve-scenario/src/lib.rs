//! swerve-scenario
