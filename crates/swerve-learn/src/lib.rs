//! Learning from simulated drives: labelled data sets (`swerve dataset`), training of the built-in models
//! (`swerve train`), and run times and detectors fitted to measurements (`swerve calibrate`).
//!
//! Excluded: the models themselves, which are in the crates of perception, vision and prediction, and many runs of one
//! configuration, which are studies.

pub mod calibrate;
pub mod dataset;
pub mod train;
