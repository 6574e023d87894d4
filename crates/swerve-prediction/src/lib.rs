//! swerve-prediction
