//! Detectors and labels of pixels for the images of cameras: by name or from files, rungs, and what these take.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::LazyLock;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_geom::Point;
use swerve_msg::CameraInfo;
use swerve_text::{did_you_mean, list, read_bytes};
use swerve_vision::acf::{Ground, Rung, Weights, WeightsError};
use swerve_vision::{segmentation, shipped};

/// The longest file of weights, bytes.
pub(super) const WEIGHTS_MAX: u64 = 256 << 20;

use super::execution::Runtime;
use super::{Config, OperatorConfig};

/// The detector of this name, or the one in this file.
///
/// # Errors
/// There is none, or the file holds none that is whole.
pub fn weights(name: &str) -> Result<Weights, String> {
    stored("detector", name, (shipped::detector(name), shipped::names().collect()), Weights::read)
}

/// The weights that label pixels, of this name, or those in this file.
///
/// # Errors
/// There are none, or the file holds none that are whole.
pub fn segmentation(name: &str) -> Result<segmentation::Weights, String> {
    let in_program = (shipped::segmentation(name), shipped::segmentations().collect());
    stored("segmentation", name, in_program, segmentation::Weights::read)
}

/// What of this name is in the program, beside all names there, or what is in the file of this name.
fn stored<T>(
    what: &str,
    name: &str,
    (in_program, names): (Option<Result<T, WeightsError>>, Vec<&str>),
    read: impl FnOnce(&[u8]) -> Result<T, WeightsError>,
) -> Result<T, String> {
    if let Some(weights) = in_program {
        return weights.map_err(|error| error.to_string());
    }
    let path = Path::new(name);
    if !path.exists() {
        let near = did_you_mean(name, names.iter().copied());
        return Err(format!("no {what} `{name}`{near}; expected {}, or a file of weights", list(&names)));
    }
    let bytes = read_bytes(path, WEIGHTS_MAX).map_err(|error| format!("reading {name}: {error}"))?;
    read(&bytes).map_err(|error| format!("{name}: {error}"))
}

/// The rung of this name.
///
/// # Errors
/// There is none.
pub fn rung<'a>(weights: &'a Weights, name: &str) -> Result<&'a Rung, String> {
    weights.rungs.iter().find(|rung| rung.name == name).ok_or_else(|| {
        let names: Vec<&str> = weights.rungs.iter().map(|rung| rung.name.as_str()).collect();
        format!("no rung `{name}`{}; expected {}", did_you_mean(name, names.iter().copied()), list(&names))
    })
}

/// Where a camera has flat ground.
pub fn ground(camera: &CameraInfo) -> Ground {
    let (lens, ego_from_camera) = (&camera.intrinsics, camera.ego_from_camera);
    let [at, ahead] = [0.0, 1.0].map(|z| (ego_from_camera * Point::new(0.0, 0.0, z)).coords);
    let axis = ahead - at;
    let level = (axis.x * axis.x + axis.y * axis.y).sqrt();
    Ground { horizon_px: lens.cy_px + lens.fy_px * axis.z / level, focal_px: lens.fx_px, height_m: at.z }
}

/// Of each rung pairs of percentile and milliseconds.
type Percentiles = BTreeMap<String, Vec<[f64; 2]>>;

/// What a rung of a detector that is in the program was measured to take, on one core; none for others.
pub fn run_time(detector: &str, rung: &str) -> Option<Runtime> {
    static ALL: LazyLock<BTreeMap<String, Percentiles>> =
        LazyLock::new(|| swerve_text::built_in(shipped::RUN_TIMES));
    let percentiles_ms = ALL.get(detector)?.get(rung).cloned();
    percentiles_ms.map(|all| Runtime { percentiles_ms: Some(all), ..Runtime::default() })
}

/// Keys of an operator of the kind `camera_objects`.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CameraObjectsTable {
    /// A detector that is in the program, or a file of weights.
    pub detector: String,
    /// The way to use it.
    pub rung: String,
    /// Whether it gives way to faster rungs where it would not be done by its deadline.
    pub ladder: bool,
    /// Boxes with a lower score are not reported.
    pub score_min: f64,
    /// What rungs take, ms, where that is not what was measured for the detectors in the program.
    pub run_times_ms: BTreeMap<String, f64>,
}

impl Default for CameraObjectsTable {
    fn default() -> Self {
        Self {
            detector: "street".into(),
            rung: "ground".into(),
            ladder: false,
            score_min: 0.3,
            run_times_ms: BTreeMap::new(),
        }
    }
}

impl CameraObjectsTable {
    /// That of an operator; the defaults where it is not as it should be, which is told where the keys are checked.
    pub fn of(config: &Config, operator: &str) -> Self {
        let keys = config.operator.get(operator).map(|own| &own.keys);
        keys.and_then(|keys| swerve_text::read(keys).ok()).unwrap_or_default()
    }

    /// That of the first such operator of a configuration that is not taken out.
    pub fn first(config: &Config) -> Option<Self> {
        let is_one = |(name, own): &(&String, &OperatorConfig)| {
            own.kind.as_ref().unwrap_or(name) == "camera_objects" && own.enabled != Some(false)
        };
        config.operator.iter().find(is_one).map(|(name, _)| Self::of(config, name))
    }

    /// What a rung takes.
    pub fn run_time(&self, rung: &str) -> Option<Runtime> {
        let own = self.run_times_ms.get(rung).map(|ms| Runtime::fixed(*ms));
        own.or_else(|| run_time(&self.detector, rung))
    }
}

#[cfg(test)]
mod tests {
    use swerve_msg::Intrinsics;

    use super::*;

    #[test]
    fn every_rung_of_a_calibrated_detector_has_a_measured_time() {
        for name in shipped::names() {
            let weights = weights(name).unwrap();
            for rung in weights.rungs.iter().filter(|rung| !rung.calibrations.is_empty()) {
                let time = run_time(name, &rung.name).unwrap_or_else(|| panic!("{name} {}", rung.name));
                assert!(time.model().is_ok() && time.typical_ms() > 0.0, "{name} {}", rung.name);
            }
        }
        assert_eq!(run_time("street", "ground floor"), None);
    }

    #[test]
    fn what_is_no_detector_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("my.weights");
        let path = path.to_str().unwrap();
        let whole = weights("street").unwrap().write();
        let mut damaged = whole.clone();
        *damaged.last_mut().unwrap() ^= 1;
        let mut newer = whole.clone();
        newer[8] = 9;
        for (bytes, expected) in [
            (&b"no weights"[..], "no weights of a detector: expected a file that begins with `SWERVDET`"),
            (&[], "no weights of a detector"),
            (&whole[..whole.len() / 2], "damaged weights"),
            (&damaged, "damaged weights: their digest is"),
            (&newer, "weights of version 9, expected 2"),
        ] {
            std::fs::write(path, bytes).unwrap();
            let said = weights(path).unwrap_err();
            assert!(said.starts_with(&format!("{path}: ")) && said.contains(expected), "{said}");
        }
        std::fs::write(path, &whole).unwrap();
        assert!(rung(&weights(path).unwrap(), "fasst").unwrap_err().contains("did you mean \"fast\"?"));
        assert!(weights("stret").unwrap_err().contains("did you mean \"street\"?"));
    }

    #[test]
    fn a_camera_that_looks_down_has_its_horizon_higher() {
        let row = |pitch_rad| {
            let intrinsics =
                Intrinsics { fx_px: 60.0, fy_px: 60.0, cx_px: 32.0, cy_px: 24.0, ..Intrinsics::default() };
            let ego_from_camera = swerve_camera::mount([1.0, 0.0, 1.35], 0.0, pitch_rad, 0.0);
            ground(&CameraInfo { intrinsics, ego_from_camera })
        };
        assert_eq!((row(0.0).horizon_px.round(), row(0.0).height_m), (24.0, 1.35));
        let down = row(0.1).horizon_px;
        assert!((down - (24.0 - 60.0 * swerve_geom::math::tan(0.1))).abs() < 1e-6, "{down}");
    }
}
