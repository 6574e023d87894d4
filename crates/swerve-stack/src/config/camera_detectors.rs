//! Detectors and pixel labelling for camera images, by name or from files; their rungs and run times.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::LazyLock;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Ranges;
use swerve_geom::Point;
use swerve_msg::CameraInfo;
use swerve_text::{did_you_mean, list, read_bytes};
use swerve_vision::acf::{Ground, Rung, Weights, WeightsError};
use swerve_vision::{segmentation, shipped};

/// Size limit for a file of weights, bytes.
pub(crate) const WEIGHTS_MAX: u64 = 256 << 20;

use super::execution::Runtime;
use super::{Config, OperatorConfig};

/// Rung of an operator that names none, if its detector has one of this name; otherwise the detector's last rung.
pub(crate) const DEFAULT_RUNG: &str = "ground";

/// Detector without neural networks of this name, or the one in this file.
///
/// # Errors
/// There is neither, or the file is damaged.
pub fn weights(name: &str) -> Result<Weights, String> {
    stored("detector", name, (shipped::detector(name), shipped::names().collect()), Weights::read)
}

/// Segmentation weights of this name, or those in this file.
///
/// # Errors
/// There are neither, or the file is damaged.
pub fn segmentation(name: &str) -> Result<segmentation::Weights, String> {
    let in_program = (shipped::segmentation(name), shipped::segmentations().collect());
    stored("segmentation", name, in_program, segmentation::Weights::read)
}

/// Error message for a rung that a detector lacks.
pub(crate) fn no_rung<'a>(name: &str, rungs: impl Iterator<Item = &'a str>) -> String {
    let names: Vec<&str> = rungs.collect();
    format!("no rung `{name}`{}; expected {}", did_you_mean(name, names.iter().copied()), list(&names))
}

/// The built-in item of this name, else the one in the file of this name; the built-in names are for the error message.
pub(crate) fn stored<T>(
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

/// Rung of this name.
///
/// # Errors
/// There is no such rung.
pub fn rung<'a>(weights: &'a Weights, name: &str) -> Result<&'a Rung, String> {
    let rung = weights.rungs.iter().find(|rung| rung.name == name);
    rung.ok_or_else(|| no_rung(name, weights.rungs.iter().map(|rung| rung.name.as_str())))
}

/// Flat ground in a camera's image.
pub fn ground(camera: &CameraInfo) -> Ground {
    let (lens, ego_from_camera) = (&camera.intrinsics, camera.ego_from_camera);
    let [at, ahead] = [0.0, 1.0].map(|z| (ego_from_camera * Point::new(0.0, 0.0, z)).coords);
    let axis = ahead - at;
    let level = (axis.x * axis.x + axis.y * axis.y).sqrt();
    Ground { horizon_px: lens.cy_px + lens.fy_px * axis.z / level, focal_px: lens.fx_px, height_m: at.z }
}

/// Pairs of percentile and milliseconds, by rung.
type Percentiles = BTreeMap<String, Vec<[f64; 2]>>;

/// Measured run time of a rung of a built-in detector, on one core; `None` for others.
pub fn run_time(detector: &str, rung: &str) -> Option<Runtime> {
    static ALL: LazyLock<BTreeMap<String, Percentiles>> =
        LazyLock::new(|| swerve_text::built_in(shipped::RUN_TIMES));
    let percentiles_ms = ALL.get(detector)?.get(rung).cloned();
    percentiles_ms.map(|all| Runtime { percentiles_ms: Some(all), ..Runtime::default() })
}

/// Keys of an operator of the kind `camera_objects`.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct CameraObjectsTable {
    /// A built-in detector, one that a program with a custom registry adds, or a file of weights.
    pub detector: String,
    /// Rung of the detector: the way to use it. A detector without a rung `ground` uses its last one by default.
    pub rung: String,
    /// Parameters of a custom detector that differ from its defaults.
    #[serde(skip_serializing_if = "toml::Table::is_empty")]
    #[schemars(with = "crate::config::AnyTable")]
    pub params: toml::Table,
    /// Switches to faster rungs where this one would miss its deadline.
    pub ladder: bool,
    /// Score below which boxes are not reported.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub score_min: f64,
    /// Run times of rungs, ms, in place of those measured for the built-in detectors.
    pub run_times_ms: BTreeMap<String, f64>,
}

impl Default for CameraObjectsTable {
    fn default() -> Self {
        Self {
            detector: "street".into(),
            rung: DEFAULT_RUNG.into(),
            params: toml::Table::new(),
            ladder: false,
            score_min: 0.3,
            run_times_ms: BTreeMap::new(),
        }
    }
}

impl CameraObjectsTable {
    /// Keys of an operator; the defaults if they are invalid, which is reported where the keys are checked.
    pub fn of(config: &Config, operator: &str) -> Self {
        let keys = config.operator.get(operator).map(|own| &own.keys);
        keys.and_then(|keys| swerve_text::read(keys).ok()).unwrap_or_default()
    }

    /// Keys of the first enabled operator of this kind.
    pub fn first(config: &Config) -> Option<Self> {
        let is_one = |(name, own): &(&String, &OperatorConfig)| {
            own.kind.as_ref().unwrap_or(name) == "camera_objects" && own.enabled != Some(false)
        };
        config.operator.iter().find(is_one).map(|(name, _)| Self::of(config, name))
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
    fn missing_and_damaged_detectors_are_reported() {
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
        assert!(rung(&weights(path).unwrap(), "fasst").unwrap_err().contains("did you mean `fast`?"));
        assert!(weights("stret").unwrap_err().contains("did you mean `street`?"));
    }

    #[test]
    fn downward_pitch_raises_the_horizon() {
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
