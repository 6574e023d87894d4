//! Measuring of perception, tracking, localization and prediction: results in files against the ground truth
//! (`swerve eval`, `swerve track`, `swerve map`), and what that needs of images, labels and recorded tracks; driving
//! scores from the records of routes.
//!
//! Excluded: the metrics themselves, which are in `swerve-eval` and know no files, and training.

pub mod evaluate;
pub mod labels;
pub mod map;
pub mod picture;
pub mod track;
pub mod worlds;
