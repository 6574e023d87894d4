//! Perception between the sensors and the predictor: `[perception]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_perception::detector::{self, Sensing};
use swerve_perception::image_box::ImageCamera;
use swerve_perception::tracker;
use swerve_text::{KeyProblem, did_you_mean, overridden};

use super::camera::CameraConfig;
use super::detectors::{find, fits, published};
use crate::problems::{outside, within};

/// Detector name for no detector: obstacles as the sensor sees them.
pub const TRUTH: &str = "truth";

/// Detector name for a custom emulation, defined by `params`.
pub const CUSTOM: &str = "custom";

/// Perception.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct PerceptionConfig {
    /// `truth`: the tracker gets the obstacle sensor's objects. The name of a published detector
    /// (`efficientdet-d3@v100`): emulates its accuracy and run time, and tracks its boxes. `custom`: an emulation
    /// defined by `params`.
    pub detector: String,
    /// Camera whose pose, field of view and image the emulated detector uses; 640 x 360 pixels and 90 degrees behind
    /// the windscreen when absent. Lidar detectors have none unless it is named: they see what the obstacle sensor
    /// sees.
    pub camera: Option<String>,
    /// Switches to a faster detector of the same ladder (the same suffix) where the named one would miss its deadline.
    /// `params` then apply to all of them; the tracker's noise is that of the named one.
    pub ladder: bool,
    /// Parameters of the emulation that differ from the named detector's.
    #[schemars(with = "detector::Params")]
    pub params: toml::Table,
    /// Tracker behind a detector: `algorithm`, `sort` when absent, or `ab3dmot`; and its parameters that differ from
    /// its defaults. The measurement noise of `sort` is the detector's.
    #[schemars(with = "tracker::Params")]
    pub tracker: toml::Table,
}

impl Default for PerceptionConfig {
    fn default() -> Self {
        Self {
            detector: TRUTH.into(),
            camera: None,
            ladder: false,
            params: toml::Table::new(),
            tracker: toml::Table::new(),
        }
    }
}

/// An emulated detector, resolved.
#[derive(Clone, PartialEq, Debug)]
pub struct Emulated {
    /// Parameters of its errors.
    pub params: detector::Params,
    /// Sensor that it uses.
    pub sensing: Sensing,
    /// Published run time, ms; `None` for a custom one.
    pub ms: Option<f64>,
}

impl PerceptionConfig {
    /// Returns true if a detector is emulated.
    pub fn emulates(&self) -> bool {
        self.detector != TRUTH
    }

    /// Published run time of the emulated detector, ms.
    pub fn published_ms(&self) -> Option<f64> {
        find(&self.detector).map(|published| published.ms)
    }

    /// The emulated detector; `None` if there is none.
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
}

/// Camera model that boxes are drawn with; `None` if its parameters are invalid or its projection is orthographic.
pub fn image_camera(config: &CameraConfig) -> Option<ImageCamera> {
    let camera = config.camera(0).ok().filter(|camera| !camera.is_orthographic())?;
    let (fx_px, fy_px, cx_px, cy_px) = camera.focal_px();
    // Boxes are in a rectified image.
    let intrinsics =
        swerve_msg::Intrinsics { fx_px, fy_px, cx_px, cy_px, distortion: [0.0; 5], is_parallel: false };
    let info = swerve_msg::CameraInfo { intrinsics, ego_from_camera: config.ego_from_camera() };
    Some(ImageCamera { info, width_px: config.width_px, height_px: config.height_px })
}

fn unknown(name: &str) -> String {
    let names = || [TRUTH, CUSTOM].into_iter().chain(published().iter().map(|d| d.name.as_str()));
    let near = did_you_mean(name, names());
    match near.is_empty() {
        false => format!("unknown detector `{name}`{near}"),
        true => {
            format!("unknown detector `{name}`, expected one of {}", names().collect::<Vec<_>>().join(", "))
        }
    }
}

#[cfg(test)]
mod tests {
    use swerve_perception::{Tracker, ab3dmot};

    use super::*;
    use crate::Setup;
    use crate::config::PlanningConfig;
    use crate::config::tests::config;
    use crate::trackers::{NamedTracker as _, TrackerSetup};

    #[test]
    fn detector_name_sets_accuracy_and_run_time() {
        let config = config("[perception]\ndetector = \"efficientdet-d3@v100\"\n", &[]).unwrap();
        let emulated = config.perception.emulated().unwrap().unwrap();
        assert_eq!((emulated.ms, emulated.sensing), (Some(28.0), Sensing::Camera));
        let error_level = fits()["efficientdet-d3@v100"].error_level;
        assert_eq!(emulated.params, detector::Params::of_error_level(Sensing::Camera, error_level));
        assert!(config.expected_ms() >= 28.0);
        assert_eq!(Setup::default().perception.emulated(), Ok(None));
        assert_eq!(Setup::default().expected_ms(), PlanningConfig::default().expected_ms());
    }

    #[test]
    fn operator_keys_override_parameters_that_override_the_name() {
        let text = "[perception]\ndetector = \"efficientdet-d3@v100\"\ntracker = { hits_min = 4 }\n\
                    [perception.params]\nscore_separation = 9\nmisses = { period_s = 1.5 }\n\
                    [operator.detector]\nruntime = { fixed_ms = 5 }\n";
        let config = config(text, &["operator.planner.runtime={ zero = true }"]).unwrap();
        let emulated = config.perception.emulated().unwrap().unwrap();
        assert_eq!((emulated.params.score_separation, emulated.params.misses.period_s), (9.0, 1.5));
        let of = TrackerSetup { behind: &emulated.params, sightings_max: 7 };
        let defaults = Tracker::defaults(of);
        assert_eq!(defaults.sightings_max, 7);
        assert_eq!(defaults.range_noise_share, emulated.params.range_noise_share);
        let tracker = config.perception.built_tracker(&config.registry, of).unwrap();
        assert_eq!(tracker.hits_min(), 4);
        assert!((config.expected_ms() - config.planning.expected_ms() - 5.0).abs() < 1e-9);
    }

    #[test]
    fn tracker_is_chosen_by_its_name() {
        let hits_min = |tracker: &str| {
            let config = config(&format!("[perception]\ntracker = {tracker}\n"), &[]).unwrap();
            let of = TrackerSetup { behind: &Default::default(), sightings_max: 7 };
            config.perception.built_tracker(&config.registry, of).unwrap().hits_min()
        };
        assert_eq!(hits_min("{ algorithm = \"ab3dmot\" }"), ab3dmot::Params::default().pedestrian.birth);
        assert_eq!(hits_min("{ algorithm = \"ab3dmot\", pedestrian = { birth = 9 } }"), 9);
        assert_eq!(hits_min("{ hits_min = 6 }"), 6);
        for (tracker, told) in [
            ("{ algorithm = \"ab3dmt\" }", "did you mean `ab3dmot`?"),
            ("{ algorithm = 3 }", "expected one of \"sort\", \"ab3dmot\", found 3"),
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
    fn invalid_perception_is_reported_with_the_nearest_name() {
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
