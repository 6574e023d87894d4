//! swerve-planning
