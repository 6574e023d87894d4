//! Published detectors by name, `NAME@SUFFIX`, and the fitted error level of each emulation.

use std::collections::BTreeMap;
use std::sync::LazyLock;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_eval::Recalls;
use swerve_perception::detector::Sensing;

/// Boxes whose overlap is measured.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Overlap {
    /// Rectangles in the image.
    Image,
    /// Footprints on the ground.
    Ground,
    /// Upright boxes.
    Volume,
}

/// Objects that are to be detected.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Kinds {
    /// All objects, in one ranking.
    All,
    /// Pedestrians; others are ignored.
    People,
}

/// Measure of accuracy: average precision at an overlap of 0.5.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Measure {
    /// Boxes whose overlap is measured.
    pub overlap: Overlap,
    /// Objects that are to be detected.
    pub kinds: Kinds,
    /// Recalls over which precision is averaged.
    pub recalls: Recalls,
}

/// COCO's measure, for a custom detector.
impl Default for Measure {
    fn default() -> Self {
        Self { overlap: Overlap::Image, kinds: Kinds::All, recalls: Recalls::Coco101 }
    }
}

/// One published detector.
#[derive(Clone, PartialEq, Debug)]
pub struct Published {
    /// Name, `NAME@SUFFIX`.
    pub name: String,
    /// Detector and hardware.
    pub title: String,
    /// Source of its numbers.
    pub source: String,
    /// The published measure, and how `ap` follows from it.
    pub accuracy: String,
    /// Accuracy as published, percent.
    pub published: f64,
    /// Target average precision for the calibration, 0 to 1.
    pub ap: f64,
    /// Published run time, ms.
    pub ms: f64,
    /// Sensor that it uses.
    pub sensing: Sensing,
    /// Measure of `ap`.
    pub measure: Measure,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Ladder {
    suffix: String,
    title: String,
    source: String,
    accuracy: String,
    sensing: Sensing,
    overlap: Overlap,
    kinds: Kinds,
    recalls: Recalls,
    rung: Vec<Rung>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Rung {
    name: String,
    published: f64,
    ap: Option<f64>,
    ms: f64,
}

/// Calibration result for a published detector.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fit {
    /// Member of the parameter family.
    pub error_level: f64,
    /// Average precision with that member, over the frames that it was fitted to.
    pub ap: f64,
    /// The same with random numbers that it was not fitted to.
    pub ap_held_out: f64,
}

/// All published detectors, ladder by ladder.
pub fn published() -> &'static [Published] {
    static ALL: LazyLock<Vec<Published>> = LazyLock::new(|| {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct File {
            ladder: Vec<Ladder>,
        }
        let file: File = swerve_text::built_in(include_str!("detectors.toml"));
        file.ladder.into_iter().flat_map(rungs).collect()
    });
    &ALL
}

fn rungs(ladder: Ladder) -> Vec<Published> {
    let Ladder { suffix, title, source, accuracy, sensing, overlap, kinds, recalls, rung } = ladder;
    let one = |rung: Rung| Published {
        name: format!("{}@{suffix}", rung.name),
        title: title.clone(),
        source: source.clone(),
        accuracy: accuracy.clone(),
        published: rung.published,
        ap: rung.ap.unwrap_or(rung.published / 100.0),
        ms: rung.ms,
        sensing,
        measure: Measure { overlap, kinds, recalls },
    };
    rung.into_iter().map(one).collect()
}

/// Published detector of this name.
pub fn find(name: &str) -> Option<&'static Published> {
    published().iter().find(|detector| detector.name == name)
}

/// The built-in fits, by name.
pub fn fits() -> &'static BTreeMap<String, Fit> {
    static ALL: LazyLock<BTreeMap<String, Fit>> =
        LazyLock::new(|| swerve_text::built_in(include_str!("detector_fits.toml")));
    &ALL
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_detectors_have_unique_names_and_valid_numbers() {
        let all = published();
        assert!(all.len() >= 40, "{}", all.len());
        for (k, d) in all.iter().enumerate() {
            assert!(all[..k].iter().all(|other| other.name != d.name), "{} twice", d.name);
            assert!((0.01..0.99).contains(&d.ap) && d.ms > 0.0 && d.published < 100.0, "{d:?}");
            assert!(!d.source.is_empty() && !d.accuracy.is_empty());
        }
        let d3 = find("efficientdet-d3@v100").unwrap();
        assert_eq!((d3.published, d3.ap, d3.ms), (47.5, 0.662, 28.0));
        assert_eq!(find("pointpillars@kitti-lidar").unwrap().sensing, Sensing::Lidar);
    }

    #[test]
    fn slower_rungs_of_one_family_are_more_accurate() {
        for suffix in ["@v100", "@d3"] {
            let family = |d: &&Published| d.name.ends_with(suffix) && !d.name.contains("640");
            let rungs: Vec<_> = published().iter().filter(family).collect();
            assert!(rungs.len() >= 6);
            assert!(rungs.windows(2).all(|w| w[0].ms < w[1].ms && w[0].ap < w[1].ap), "{suffix}");
        }
    }

    #[test]
    fn every_rung_is_fitted_within_two_hundredths() {
        for d in published() {
            let fit = fits().get(&d.name).unwrap_or_else(|| panic!("{} is not fitted", d.name));
            assert!((fit.ap - d.ap).abs() <= 0.02, "{}: {fit:?}, to meet {}", d.name, d.ap);
            // Eleven recalls are a coarser measure than a hundred and one.
            let spread = if d.measure.recalls == Recalls::Coco101 { 0.02 } else { 0.03 };
            assert!((fit.ap_held_out - d.ap).abs() <= spread, "{}: {fit:?}, to meet {}", d.name, d.ap);
        }
        assert_eq!(fits().len(), published().len());
    }
}
