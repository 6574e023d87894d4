//! What stands between the sensors and the predictor: `[perception]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::param::require_all_within;
use swerve_perception::detector::{self, Sensing};
use swerve_perception::image_box::ImageCamera;
use swerve_perception::{Algorithm, GroundParams, ab3dmot, tracker};
use swerve_text::{KeyProblem, nearest, overridden};

use super::camera::CameraConfig;
use super::detectors::{Measure, find, fits, published};
use super::planner::{outside, within};
use super::{Config, PlanningConfig};
use crate::assembly::scheduled_operator;
use crate::kind::Scheduled;

/// The detector's name for none: obstacles as the sensor sees them.
pub const TRUTH: &str = "truth";

/// The detector's name for one of one's own: all of it in `params`.
pub const CUSTOM: &str = "custom";

/// Perception.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PerceptionConfig {
    /// `truth`: the tracker is given what the obstacle sensor sees. The name of a published detector
    /// (`efficientdet-d3@v100`): one of its accuracy and run time is emulated, and tracked. `custom`: one with `params`.
    pub detector: String,
    /// Camera whose place, field of view and image the emulated detector has; 640 x 360 pixels and 90 degrees behind
    /// the windscreen when absent. Detectors by lidar have none unless it is named: they see what the obstacle sensor sees.
    pub camera: Option<String>,
    /// Whether the detector gives way to a faster one of its ladder (the same suffix) where it would not be done by its
    /// deadline. `params` then go for all of them; the tracker's noise is that of the one named.
    pub ladder: bool,
    /// Parameters of the emulation that differ from the named detector's.
    #[schemars(with = "detector::Params")]
    pub params: toml::Table,
    /// The tracker behind a detector, `algorithm`: `sort` when absent, or `ab3dmot`; and its parameters that differ from
    /// its defaults. The measurement noise of `sort` is that of the detector.
    #[schemars(with = "tracker::Params")]
    pub tracker: toml::Table,
    /// Where `params` come from, where `swerve calibrate detector` wrote them; nothing reads it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub calibration: Option<Calibration>,
}

/// What a calibration of the emulation came to.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Calibration {
    /// Average precision that was to be met, 0 to 1.
    pub target_ap: f64,
    /// Average precision that was met, over the frames that the parameters were fitted to.
    pub ap: f64,
    /// The same with random numbers that they were not fitted to.
    pub ap_held_out: f64,
    /// What it is measured by.
    pub measure: Measure,
    /// Which member of the family of parameters that is, from 0 (no errors) up.
    pub error_level: f64,
    /// Only what is nearer counts, m.
    pub within_m: f64,
    /// Scenarios, by name.
    pub scenarios: Vec<String>,
    /// Seeds of the drives.
    pub seeds: Vec<u64>,
    /// Seed of the detector's draws.
    pub draws_seed: u64,
    /// Frames.
    pub frames: usize,
    /// Objects in them that count.
    pub objects: u64,
}

impl Calibration {
    fn problems(&self) -> Vec<KeyProblem> {
        let share = [0.0, 1.0];
        let checked = require_all_within(&[
            ("target_ap", self.target_ap, share),
            ("ap", self.ap, share),
            ("ap_held_out", self.ap_held_out, share),
            ("error_level", self.error_level, [0.0, 1000.0]),
            ("within_m", self.within_m, [0.1, 10_000.0]),
        ]);
        checked.err().map(outside).unwrap_or_default()
    }
}

impl Default for PerceptionConfig {
    fn default() -> Self {
        Self {
            detector: TRUTH.into(),
            camera: None,
            ladder: false,
            params: toml::Table::new(),
            tracker: toml::Table::new(),
            calibration: None,
        }
    }
}

/// An emulated detector, resolved.
#[derive(Clone, PartialEq, Debug)]
pub struct Emulated {
    /// What it gets wrong.
    pub params: detector::Params,
    /// What it looks with.
    pub sensing: Sensing,
    /// Its published run time, ms; none for one of one's own.
    pub ms: Option<f64>,
}

impl PerceptionConfig {
    /// Whether a detector is emulated.
    pub fn emulates(&self) -> bool {
        self.detector != TRUTH
    }

    /// The published run time of the detector that is emulated, ms.
    pub fn published_ms(&self) -> Option<f64> {
        find(&self.detector).map(|published| published.ms)
    }

    /// The detector that is emulated, if one is.
    ///
    /// # Errors
    /// Problems by their keys in `perception`.
    pub fn emulated(&self) -> Result<Option<Emulated>, Vec<KeyProblem>> {
        let (family, sensing, ms) = match self.detector.as_str() {
            TRUTH => return Ok(None),
            CUSTOM => (detector::Params::default(), Sensing::Camera, None),
            name => {
                let published = find(name).ok_or_else(|| vec![("detector".into(), unknown(name))])?;
                let error_level = fits().get(name).map_or(1.0, |fit| fit.error_level);
                let family = detector::Params::of_error_level(published.sensing, error_level);
                (family, published.sensing, Some(published.ms))
            }
        };
        let params: detector::Params =
            overridden(&family, &self.params).map_err(|found| within("params", found))?;
        params.validate().map_err(|error| within("params", outside(error)))?;
        Ok(Some(Emulated { params, sensing, ms }))
    }

    /// The tracker behind a detector.
    ///
    /// # Errors
    /// Problems by their keys in `perception`.
    pub(super) fn tracker(
        &self,
        behind: &detector::Params,
        sightings_max: usize,
    ) -> Result<GroundParams, Vec<KeyProblem>> {
        let told = |found| within("tracker", found);
        let mut own = self.tracker.clone();
        let named = own.remove("algorithm").map_or(Ok(Algorithm::Sort), algorithm);
        let params = match named.map_err(|message| vec![("tracker.algorithm".into(), message)])? {
            Algorithm::Sort => {
                let defaults = tracker::Params {
                    sightings_max,
                    range_noise_m: behind.range_noise_m,
                    range_noise_share: behind.range_noise_share,
                    bearing_noise_rad: behind.bearing_noise_rad,
                    ..tracker::Params::default()
                };
                GroundParams::Sort(overridden(&defaults, &own).map_err(told)?)
            }
            Algorithm::Ab3dmot => {
                let defaults = ab3dmot::Params { sightings_max, ..ab3dmot::Params::default() };
                GroundParams::Ab3dmot(overridden(&defaults, &own).map_err(told)?)
            }
        };
        params.validate().map_err(|error| told(outside(error)))?;
        Ok(params)
    }
}

/// The tracker of a name.
fn algorithm(name: toml::Value) -> Result<Algorithm, String> {
    let told = format!("expected \"sort\" or \"ab3dmot\", found {name}");
    let near = name.as_str().map_or_else(String::new, |name| hint(name, ["sort", "ab3dmot"]));
    name.try_into().map_err(|_| told + &near)
}

impl Config {
    /// The camera of the emulated detector, if it has one.
    pub fn detector_camera(&self, sensing: Sensing) -> Option<CameraConfig> {
        match (&self.perception.camera, sensing) {
            (Some(name), _) => self.camera.get(name).cloned(),
            (None, Sensing::Camera) => Some(CameraConfig::default()),
            (None, Sensing::Lidar) => None,
        }
    }

    /// Expected time from a sensor frame to its plan's first effect, ms: the detector's and the planner's.
    pub fn expected_ms(&self) -> f64 {
        let PlanningConfig { expected_ms, .. } = self.planning;
        let detector_ms = scheduled_operator(self, Scheduled::Detector).flatten().unwrap_or(0.0);
        expected_ms.unwrap_or_else(|| self.planning.expected_ms() + detector_ms)
    }

    pub(super) fn check_perception(&self, told: &mut Vec<(String, String)>) {
        let perception = &self.perception;
        if let Some(calibration) = &perception.calibration {
            told.extend(within("perception.calibration", calibration.problems()));
        }
        let mut tell = |(key, message): (&str, String)| told.push((format!("perception.{key}"), message));
        if let Some(name) = perception.camera.as_ref().filter(|name| !self.camera.contains_key(*name)) {
            let names: Vec<&str> = self.camera.keys().map(String::as_str).collect();
            let near = hint(name, names.iter().copied());
            tell((
                "camera",
                format!("unknown camera `{name}`, expected one of [{}]{near}", names.join(", ")),
            ));
        }
    }
}

/// A camera as boxes are drawn in it; `None` where its numbers make none, or its rays are parallel.
pub fn image_camera(config: &CameraConfig) -> Option<ImageCamera> {
    let camera = config.camera(0).ok().filter(|camera| !camera.is_orthographic())?;
    let (fx_px, fy_px, cx_px, cy_px) = camera.focal_px();
    // Boxes are those of a rectified image.
    let intrinsics =
        swerve_msg::Intrinsics { fx_px, fy_px, cx_px, cy_px, distortion: [0.0; 5], is_parallel: false };
    let info = swerve_msg::CameraInfo { intrinsics, ego_from_camera: config.ego_from_camera() };
    Some(ImageCamera { info, width_px: config.width_px, height_px: config.height_px })
}

fn unknown(name: &str) -> String {
    let names = || [TRUTH, CUSTOM].into_iter().chain(published().iter().map(|d| d.name.as_str()));
    let near = hint(name, names());
    match near.is_empty() {
        false => format!("unknown detector `{name}`{near}"),
        true => {
            format!("unknown detector `{name}`, expected one of {}", names().collect::<Vec<_>>().join(", "))
        }
    }
}

fn hint<'a>(name: &str, names: impl IntoIterator<Item = &'a str>) -> String {
    nearest(name, names).map_or_else(String::new, |near| format!(" (did you mean `{near}`?)"))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::tests::config;

    #[test]
    fn a_name_sets_accuracy_and_run_time() {
        let config = config("[perception]\ndetector = \"efficientdet-d3@v100\"\n", &[]).unwrap();
        let emulated = config.perception.emulated().unwrap().unwrap();
        assert_eq!((emulated.ms, emulated.sensing), (Some(28.0), Sensing::Camera));
        let error_level = fits()["efficientdet-d3@v100"].error_level;
        assert_eq!(emulated.params, detector::Params::of_error_level(Sensing::Camera, error_level));
        assert!(config.expected_ms() >= 28.0);
        assert_eq!(Config::default().perception.emulated(), Ok(None));
        assert_eq!(Config::default().expected_ms(), PlanningConfig::default().expected_ms());
    }

    #[test]
    fn parameters_come_before_the_name_and_the_operator_before_both() {
        let text = "[perception]\ndetector = \"efficientdet-d3@v100\"\ntracker = { hits_min = 4 }\n\
                    [perception.params]\nscore_gap = 9\nmisses = { period_s = 1.5 }\n\
                    [operator.detector]\nruntime = { fixed_ms = 5 }\n";
        let config = config(text, &["operator.planner.runtime={ zero = true }"]).unwrap();
        let emulated = config.perception.emulated().unwrap().unwrap();
        assert_eq!((emulated.params.score_separation, emulated.params.misses.period_s), (9.0, 1.5));
        let GroundParams::Sort(tracker) = config.perception.tracker(&emulated.params, 7).unwrap() else {
            panic!("another tracker than the usual one")
        };
        assert_eq!((tracker.hits_min, tracker.sightings_max), (4, 7));
        assert_eq!(tracker.range_noise_share, emulated.params.range_noise_share);
        assert!((config.expected_ms() - config.planning.expected_ms() - 5.0).abs() < 1e-9);
    }

    #[test]
    fn the_tracker_is_chosen_by_its_name() {
        let text = "[perception]\ntracker = { algorithm = \"ab3dmot\", vehicle = { death = 5 } }\n";
        let config = config(text, &[]).unwrap();
        let GroundParams::Ab3dmot(tracker) = config.perception.tracker(&Default::default(), 7).unwrap()
        else {
            panic!("the usual one")
        };
        assert_eq!((tracker.vehicle.death, tracker.vehicle.birth, tracker.cyclist.death), (5, 3, 4));
        for (tracker, told) in [
            ("{ algorithm = \"ab3dmt\" }", "did you mean `ab3dmot`?"),
            ("{ algorithm = 3 }", "expected \"sort\" or \"ab3dmot\", found 3"),
            ("{ algorithm = \"ab3dmot\", gate = 3 }", "gate"),
            (
                "{ algorithm = \"ab3dmot\", pedestrian = { limit = -2 } }",
                "perception.tracker.pedestrian.limit: expected -1 to 1, found -2",
            ),
        ] {
            let said = self::config(&format!("[perception]\ntracker = {tracker}\n"), &[]).unwrap_err();
            assert!(said.contains("perception.tracker") && said.contains(told), "{tracker}: {said}");
        }
    }

    #[test]
    fn what_cannot_be_is_told_with_the_nearest_name() {
        let said = config("[perception]\ndetector = \"efficientdet-d9@v100\"\n", &[]).unwrap_err();
        assert!(
            said.starts_with("c.toml:2: perception.detector: unknown detector `efficientdet-d9@v100`"),
            "{said}"
        );
        assert!(said.contains("did you mean `efficientdet-d"), "{said}");
        let said = config("", &["perception.detector=qqq"]).unwrap_err();
        assert!(said.contains("expected one of truth, custom, efficientdet-d0@v100"), "{said}");
        let said = config("[perception]\ndetector = \"custom\"\nparams = { score_separatoin = 1 }\n", &[])
            .unwrap_err();
        assert!(said.contains("perception.params") && said.contains("score_separation"), "{said}");
        let said =
            config("[perception]\ndetector = \"custom\"\nparams = { recall_best = 2 }\n", &[]).unwrap_err();
        assert!(said.contains("perception.params.recall_best: expected 0 to 1, found 2"), "{said}");
        let said = config("[camera.eye]\n[perception]\ncamera = \"eyes\"\n", &[]).unwrap_err();
        assert!(said.contains("did you mean `eye`"), "{said}");
    }
}
