//! swerve-flow
