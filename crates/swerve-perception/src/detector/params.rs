//! Error parameters of an emulated detector.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{ParamError, Ranges};
use swerve_geom::math;

use super::drift::Drift;

/// Sensor of a detector; determines the position errors.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Sensing {
    /// Single camera: accurate bearings, distances estimated from sizes.
    #[default]
    Camera,
    /// Lidar: measured distances.
    Lidar,
}

/// Parameters of the detector emulation.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Detection probability of a near and fully visible object, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub recall_best: f64,
    /// Distance from the ego origin at which the detection probability of a 1.7 m tall person is halved, metres;
    /// proportional to the height for other objects.
    #[schemars(range(min = 0.0, max = 1e5))]
    pub half_distance_m: f64,
    /// Scale of the logistic curve of detection over distance, metres: the probability falls from 73 to 27 % over twice
    /// this.
    #[schemars(range(min = 1e-3, max = 1e5))]
    pub distance_scale_m: f64,
    /// Visible share of an object at which the detection probability is halved, 0 to 1.
    #[schemars(range(min = -1.0, max = 2.0))]
    pub half_visibility: f64,
    /// Scale of the logistic curve of detection over visible share.
    #[schemars(range(min = 1e-3, max = 10.0))]
    pub visibility_scale: f64,
    /// Mean number of false positives per frame.
    #[schemars(range(min = 0.0, max = FALSE_POSITIVES_MAX))]
    pub false_positives_per_frame: f64,
    /// Difference of the mean logit scores of true and false positives, in standard deviations.
    #[schemars(range(min = 0.0, max = 50.0))]
    pub score_separation: f64,
    /// Constant standard deviation of the distance, metres.
    #[schemars(range(min = 0.0, max = 50.0))]
    pub range_noise_m: f64,
    /// Additional standard deviation of the distance, as a share of it.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub range_noise_share: f64,
    /// Standard deviation of the bearing, radians.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub bearing_noise_rad: f64,
    /// Standard deviation of length, width and height at close range, as a share of each; twice that at 30 m.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub size_noise_share: f64,
    /// Standard deviation of the heading at close range, radians; twice that at 30 m.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub heading_noise_rad: f64,
    /// Temporal correlation of misses and scores.
    #[ranges(nested)]
    pub misses: Drift,
    /// Temporal correlation of false positives; longer than that of misses, so that they last long enough to be
    /// tracked.
    #[ranges(nested)]
    pub false_positives: Drift,
    /// Temporal correlation of errors of position, size and heading.
    #[ranges(nested)]
    pub pose_errors: Drift,
}

/// Largest mean number of false positives per frame: one in every other cell.
pub(super) const FALSE_POSITIVES_MAX: f64 = 40.0;

impl Default for Params {
    fn default() -> Self {
        Self::of_error_level(Sensing::Camera, 1.0)
    }
}

impl Params {
    /// Parameters of a one-dimensional family for calibration: the error level, from 0 (no errors) up.
    ///
    /// One published number, an average precision, can determine one parameter. The ratios between the parameters are
    /// our choice: at error level 1 a person is detected with half probability at 70 m, every fifth frame contains a
    /// false positive, and position errors are typical of the sensor: 3 % of the distance for one camera, 5 cm plus 0.2
    /// % for a lidar.
    pub fn of_error_level(sensing: Sensing, error_level: f64) -> Self {
        let d = error_level.max(0.0);
        let root = d.sqrt();
        let half_distance_m = (70.0 / d.max(1e-3)).min(1e4);
        let (range_noise_m, range_noise_share, bearing_noise_rad) = match sensing {
            Sensing::Camera => (0.0, 0.03, 0.002),
            Sensing::Lidar => (0.05, 0.002, 0.001),
        };
        Self {
            recall_best: math::exp(-0.03 * d),
            half_distance_m,
            distance_scale_m: 0.15 * half_distance_m,
            half_visibility: 0.5 * (1.0 - math::exp(-0.5 * d)) - 0.2,
            visibility_scale: 0.08,
            false_positives_per_frame: (0.2 * d).min(FALSE_POSITIVES_MAX),
            score_separation: (4.0 / root.max(1e-2)).min(20.0),
            range_noise_m: range_noise_m * root,
            range_noise_share: range_noise_share * root,
            bearing_noise_rad: bearing_noise_rad * root,
            size_noise_share: (0.04 * root).min(0.2),
            heading_noise_rad: 0.05 * root,
            misses: Drift { correlation: 0.6, period_s: 0.4 },
            false_positives: Drift { correlation: 0.92, period_s: 0.4 },
            pose_errors: Drift { correlation: 0.8, period_s: 2.0 },
        }
    }

    /// Checks that all parameters are in range.
    ///
    /// # Errors
    /// The first parameter outside its range.
    pub fn validate(&self) -> Result<(), ParamError> {
        self.check_ranges()
    }
}
