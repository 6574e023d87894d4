//! Detectors and segmentations that are in the program.

use crate::acf::{Weights, WeightsError};
use crate::segmentation;

/// Names and files.
const DETECTORS: [(&str, &[u8]); 4] = [
    ("street", include_bytes!("../detectors/street.weights")),
    ("hog_street", include_bytes!("../detectors/hog_street.weights")),
    ("acf_inria", include_bytes!("../detectors/acf_inria.weights")),
    ("ldcf_inria", include_bytes!("../detectors/ldcf_inria.weights")),
];
const SEGMENTATIONS: [(&str, &[u8]); 1] = [("street", include_bytes!("../segmentations/street.weights"))];

/// Names of the detectors that are in the program.
pub fn names() -> impl Iterator<Item = &'static str> {
    DETECTORS.iter().map(|(name, _)| *name)
}

/// A detector that is in the program; none of another name.
pub fn detector(name: &str) -> Option<Result<Weights, WeightsError>> {
    DETECTORS.iter().find(|(of, _)| *of == name).map(|(_, bytes)| Weights::read(bytes))
}

/// What the rungs of these detectors take, as TOML: a table a detector, of each rung pairs of percentile and milliseconds.
pub const RUN_TIMES: &str = include_str!("../detectors/run_times.toml");

/// Names of the segmentations that are in the program.
pub fn segmentations() -> impl Iterator<Item = &'static str> {
    SEGMENTATIONS.iter().map(|(name, _)| *name)
}

/// A segmentation that is in the program; none of another name.
pub fn segmentation(name: &str) -> Option<Result<segmentation::Weights, WeightsError>> {
    SEGMENTATIONS.iter().find(|(of, _)| *of == name).map(|(_, bytes)| segmentation::Weights::read(bytes))
}
