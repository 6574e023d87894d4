//! Radar parameters.

use core::f64::consts::{PI, TAU};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Span;
use swerve_core::param::{ParamError, Ranges, require};
use swerve_geom::math;

use super::decibel::{decibels, ratio};

/// Cross-section to which [`RadarParams::half_range_m`] refers, dBsm: about that of a car from behind.
const HALF_RANGE_RCS_DBSM: f64 = 10.0;

/// Radar class.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum RadarPreset {
    /// Faces forward from the front bumper, long range on the axis and short range to the sides: 250 m, 120 degrees; in
    /// the class of Continental's ARS 408.
    #[default]
    LongRange,
    /// Faces outwards from a corner of the car: 100 m, 150 degrees, finer range resolution; in the class of
    /// Continental's SRR 520.
    Corner,
}

impl RadarPreset {
    /// Parameters of this class.
    pub fn params(self) -> RadarParams {
        match self {
            Self::LongRange => RadarParams {
                range_min_m: 0.2,
                range_max_m: 250.0,
                fov_rad: 120.0_f64.to_radians(),
                elevation_fov_rad: 16.0_f64.to_radians(),
                range_rate_max_mps: 70.0,
                half_range_m: 230.0,
                edge_loss_db: 24.0,
                false_alarm_probability: 1e-6,
                range_resolution_m: 1.0,
                range_rate_resolution_mps: 0.1,
                azimuth_resolution_rad: 2.5_f64.to_radians(),
                range_noise_m: 0.2,
                range_rate_noise_mps: 0.03,
                azimuth_noise_rad: 0.2_f64.to_radians(),
                elevation_noise_rad: 0.0,
                clutter_per_scan: 4.0,
                false_alarms_per_scan: 0.2,
                measures_elevation: false,
                occlusion: true,
            },
            Self::Corner => RadarParams {
                range_max_m: 100.0,
                fov_rad: 150.0_f64.to_radians(),
                half_range_m: 95.0,
                edge_loss_db: 12.0,
                range_resolution_m: 0.4,
                azimuth_resolution_rad: 6.0_f64.to_radians(),
                range_noise_m: 0.1,
                azimuth_noise_rad: 0.6_f64.to_radians(),
                clutter_per_scan: 6.0,
                ..Self::LongRange.params()
            },
        }
    }

    /// Interval between two scans: whole simulation steps at the default step.
    pub fn period(self) -> Span {
        match self {
            Self::LongRange => Span::from_ms(70),
            Self::Corner => Span::from_ms(50),
        }
    }
}

/// Declares [`RadarParams`] and its file format: every key may be omitted and then has the value of the preset named by
/// the key `preset`.
macro_rules! params {
    ($($(#[$doc:meta])* $name:ident: $number:ty,)*) => {
        /// Limits, accuracy and errors of a radar. In files, omitted keys have the values of the `preset`.
        #[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
        #[serde(from = "Keys")]
        pub struct RadarParams {
            $($(#[$doc])* pub $name: $number,)*
        }

        #[derive(Deserialize, JsonSchema)]
        #[serde(deny_unknown_fields, default)]
        #[derive(Default)]
        struct Keys {
            /// Radar class that sets the defaults of omitted keys.
            preset: RadarPreset,
            $($(#[$doc])* $name: Option<$number>,)*
        }

        impl From<Keys> for RadarParams {
            fn from(keys: Keys) -> Self {
                let preset = keys.preset.params();
                Self { $($name: keys.$name.unwrap_or(preset.$name),)* }
            }
        }
    };
}

params! {
    /// Minimum range of detections, metres.
    #[schemars(range(min = 0.01, max = 1_000.0))]
    range_min_m: f64,
    /// Maximum range of detections, metres.
    #[schemars(range(min = 0.1, max = 10_000.0))]
    range_max_m: f64,
    /// Full horizontal field of view, radians.
    #[schemars(range(min = 1e-3, max = TAU))]
    fov_rad: f64,
    /// Full vertical field of view, radians.
    #[schemars(range(min = 1e-3, max = PI))]
    elevation_fov_rad: f64,
    /// Maximum absolute range rate of detections, m/s.
    #[schemars(range(min = 0.1, max = 1_000.0))]
    range_rate_max_mps: f64,
    /// Distance at which 10 dBsm on the axis are detected in every second scan, metres.
    #[schemars(range(min = 0.1, max = 10_000.0))]
    half_range_m: f64,
    /// Two-way loss of an echo at the left and right edges of the field of view, decibels; grows with the square of the
    /// angle from the axis.
    #[schemars(range(min = 0.0, max = 100.0))]
    edge_loss_db: f64,
    /// Probability that noise alone exceeds the detection threshold.
    #[schemars(range(min = 1e-12, max = 0.1))]
    false_alarm_probability: f64,
    /// Range resolution, metres: echoes closer to each other than the three resolutions (range, range rate, azimuth)
    /// are merged.
    #[schemars(range(min = 0.0, max = 100.0))]
    range_resolution_m: f64,
    /// Range rate resolution, m/s; see `range_resolution_m`.
    #[schemars(range(min = 0.0, max = 100.0))]
    range_rate_resolution_mps: f64,
    /// Azimuth resolution, radians; see `range_resolution_m`.
    #[schemars(range(min = 0.0, max = TAU))]
    azimuth_resolution_rad: f64,
    /// Standard deviation of the range, metres.
    #[schemars(range(min = 0.0, max = 100.0))]
    range_noise_m: f64,
    /// Standard deviation of the range rate, m/s.
    #[schemars(range(min = 0.0, max = 100.0))]
    range_rate_noise_mps: f64,
    /// Standard deviation of the azimuth, radians.
    #[schemars(range(min = 0.0, max = 1.0))]
    azimuth_noise_rad: f64,
    /// Standard deviation of the elevation, radians.
    #[schemars(range(min = 0.0, max = 1.0))]
    elevation_noise_rad: f64,
    /// Mean number of clutter echoes per scan, from objects beside and on the road that are not actors.
    #[schemars(range(min = 0.0, max = 500.0))]
    clutter_per_scan: f64,
    /// Mean number of false alarms per scan, caused by noise.
    #[schemars(range(min = 0.0, max = 500.0))]
    false_alarms_per_scan: f64,
    /// True if elevation is reported.
    measures_elevation: bool,
    /// True if bodies occlude the view.
    occlusion: bool,
}

impl Default for RadarParams {
    fn default() -> Self {
        RadarPreset::default().params()
    }
}

impl RadarParams {
    /// Detection threshold, power over noise.
    pub(super) fn threshold(&self) -> f64 {
        -math::ln(self.false_alarm_probability)
    }

    /// Signal-to-noise ratio at which every second echo is detected.
    fn half_snr(&self) -> f64 {
        self.threshold() / core::f64::consts::LN_2 - 1.0
    }

    /// Mean signal-to-noise ratio of one square metre.
    fn snr_per_m2(&self, range_m: f64, azimuth_rad: f64) -> f64 {
        let off_axis = 2.0 * azimuth_rad / self.fov_rad;
        let loss_db = self.edge_loss_db * off_axis * off_axis + HALF_RANGE_RCS_DBSM;
        let (nearer, over_m2) = (self.half_range_m / range_m.max(1e-3), ratio(-loss_db));
        self.half_snr() * nearer * nearer * nearer * nearer * over_m2
    }

    /// Mean signal-to-noise ratio of a cross-section at a position.
    pub fn mean_snr(&self, rcs_dbsm: f64, range_m: f64, azimuth_rad: f64) -> f64 {
        self.snr_per_m2(range_m, azimuth_rad) * ratio(rcs_dbsm)
    }

    /// Probability that one scan detects an unoccluded cross-section at a position.
    pub fn detection_probability(&self, rcs_dbsm: f64, range_m: f64, azimuth_rad: f64) -> f64 {
        math::exp(-self.threshold() / (1.0 + self.mean_snr(rcs_dbsm, range_m, azimuth_rad)))
    }

    /// Cross-section that gives this signal-to-noise ratio at a position, dBsm.
    pub(super) fn rcs_of_snr_dbsm(&self, snr: f64, range_m: f64, azimuth_rad: f64) -> f64 {
        decibels(snr / self.snr_per_m2(range_m, azimuth_rad))
    }

    /// Reports every parameter out of range.
    pub fn problems(&self) -> Vec<ParamError> {
        let mut problems = self.out_of_range();
        if self.range_min_m >= self.range_max_m {
            let below = "a number below range_max_m";
            problems.extend(require("range_min_m", self.range_min_m, false, below).err());
        }
        problems
    }
}
