//! swerve-eval
