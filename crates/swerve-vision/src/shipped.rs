//! Detectors and segmentations built into the program.

use crate::acf::{Weights, WeightsError};
use crate::segmentation;

/// Names and files of the built-in detectors.
const DETECTORS: [(&str, &[u8]); 4] = [
    ("street", include_bytes!("../detectors/street.weights")),
    ("hog_street", include_bytes!("../detectors/hog_street.weights")),
    ("acf_inria", include_bytes!("../detectors/acf_inria.weights")),
    ("ldcf_inria", include_bytes!("../detectors/ldcf_inria.weights")),
];
const SEGMENTATIONS: [(&str, &[u8]); 1] = [("street", include_bytes!("../segmentations/street.weights"))];

/// Names of the built-in detectors.
pub fn names() -> impl Iterator<Item = &'static str> {
    DETECTORS.iter().map(|(name, _)| *name)
}

/// Built-in detector of this name; `None` if there is no such detector.
pub fn detector(name: &str) -> Option<Result<Weights, WeightsError>> {
    DETECTORS.iter().find(|(of, _)| *of == name).map(|(_, bytes)| Weights::read(bytes))
}

/// Run times of the rungs of these detectors, as TOML: one table per detector with pairs of percentile and milliseconds
/// for each rung.
pub const RUN_TIMES: &str = include_str!("../detectors/run_times.toml");

/// Domains of the built-in models, as TOML: the conditions under which they were measured, and their figures there.
pub const DOMAINS: &str = include_str!("../domains.toml");

/// Classes of the built-in segmentation `street`, as TOML: its recipe.
pub const STREET_CLASSES: &str = include_str!("../segmentations/street.toml");

/// Names of the built-in segmentations.
pub fn segmentations() -> impl Iterator<Item = &'static str> {
    SEGMENTATIONS.iter().map(|(name, _)| *name)
}

/// Built-in segmentation of this name; `None` if there is no such segmentation.
pub fn segmentation(name: &str) -> Option<Result<segmentation::Weights, WeightsError>> {
    SEGMENTATIONS.iter().find(|(of, _)| *of == name).map(|(_, bytes)| segmentation::Weights::read(bytes))
}
