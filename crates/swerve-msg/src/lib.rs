//! swerve-msg
