//! swerve-geom
