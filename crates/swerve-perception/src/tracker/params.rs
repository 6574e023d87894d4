//! Parameters of the SORT tracker.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::param::{ParamError, require_all_within};
use swerve_msg::ActorKind;

/// Motion model of a group of object kinds.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Motion {
    /// Standard deviation of each velocity component of a new track, m/s.
    pub speed_mps: f64,
    /// Spectral density of the acceleration, m²/s³: one second without a box adds its square root, in m/s, as standard
    /// deviation of each velocity component.
    pub accel_density: f64,
    /// Standard deviation of a sudden change of each velocity component, m/s; used in a second attempt to pair
    /// unmatched tracks and boxes.
    pub change_mps: f64,
}

/// Parameters of the SORT tracker.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Score below which boxes are ignored, 0 to 1.
    pub score_min: f64,
    /// Gate on the squared Mahalanobis distance of a box from a track; 9.21 contains 99 % of correct pairs (chi-squared
    /// with two degrees of freedom).
    pub gate: f64,
    /// Number of frames with a box after which a track is reported. SORT: 3.
    pub hits_min: usize,
    /// Time without a box after which an unreported track ends, seconds. Zero requires boxes in consecutive frames, as
    /// in SORT; if sensors report in turn, use the period of the slowest.
    pub probation_s: f64,
    /// Time without a box after which a reported track ends, seconds. SORT: one frame.
    pub forget_after_s: f64,
    /// Number of positions in a track's reported history, including the current one.
    pub sightings_max: usize,
    /// Smallest weight of a new box's size and heading; the first boxes are averaged.
    pub shape_gain: f64,
    /// Constant standard deviation of a box's distance, metres.
    pub range_noise_m: f64,
    /// Additional standard deviation of a box's distance, as a share of it.
    pub range_noise_share: f64,
    /// Standard deviation of a box's bearing, radians.
    pub bearing_noise_rad: f64,
    /// Additional isotropic standard deviation of a box's position, metres, for errors of the ego pose. Larger values
    /// delay the velocity estimate.
    pub floor_noise_m: f64,
    /// Motion model of pedestrians and cyclists.
    pub person: Motion,
    /// Motion model of motor vehicles.
    pub vehicle: Motion,
    /// Motion model of static objects.
    pub fixed: Motion,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            score_min: 0.4,
            gate: 9.21,
            hits_min: 2,
            probation_s: 0.0,
            forget_after_s: 0.5,
            sightings_max: 10,
            shape_gain: 0.1,
            range_noise_m: 0.0,
            range_noise_share: 0.03,
            bearing_noise_rad: 0.002,
            floor_noise_m: 0.02,
            person: Motion { speed_mps: 2.0, accel_density: 2.0, change_mps: 3.0 },
            vehicle: Motion { speed_mps: 8.0, accel_density: 4.0, change_mps: 3.0 },
            fixed: Motion { speed_mps: 0.05, accel_density: 1e-4, change_mps: 0.05 },
        }
    }
}

impl Params {
    /// Motion model of a kind.
    pub fn motion(&self, kind: ActorKind) -> Motion {
        match kind {
            ActorKind::Pedestrian | ActorKind::Cyclist => self.person,
            ActorKind::Car | ActorKind::Truck | ActorKind::Motorcycle => self.vehicle,
            ActorKind::Static => self.fixed,
        }
    }

    /// Checks that all parameters are in range.
    ///
    /// # Errors
    /// The first parameter outside its range.
    pub fn validate(&self) -> Result<(), ParamError> {
        let all = [
            ("score_min", self.score_min, [0.0, 1.0]),
            ("gate", self.gate, [0.1, 1e3]),
            ("hits_min", self.hits_min as f64, [1.0, 100.0]),
            ("probation_s", self.probation_s, [0.0, 10.0]),
            ("forget_after_s", self.forget_after_s, [0.0, 60.0]),
            ("sightings_max", self.sightings_max as f64, [1.0, 1000.0]),
            ("shape_gain", self.shape_gain, [0.0, 1.0]),
            ("range_noise_m", self.range_noise_m, [0.0, 50.0]),
            ("range_noise_share", self.range_noise_share, [0.0, 1.0]),
            ("bearing_noise_rad", self.bearing_noise_rad, [0.0, 1.0]),
            // Above zero, so that the covariance does not vanish.
            ("floor_noise_m", self.floor_noise_m, [1e-3, 10.0]),
            ("person.speed_mps", self.person.speed_mps, [1e-3, 100.0]),
            ("person.accel_density", self.person.accel_density, [1e-6, 1e3]),
            ("person.change_mps", self.person.change_mps, [0.0, 100.0]),
            ("vehicle.speed_mps", self.vehicle.speed_mps, [1e-3, 100.0]),
            ("vehicle.accel_density", self.vehicle.accel_density, [1e-6, 1e3]),
            ("vehicle.change_mps", self.vehicle.change_mps, [0.0, 100.0]),
            ("fixed.speed_mps", self.fixed.speed_mps, [1e-3, 100.0]),
            ("fixed.accel_density", self.fixed.accel_density, [1e-6, 1e3]),
            ("fixed.change_mps", self.fixed.change_mps, [0.0, 100.0]),
        ];
        require_all_within(&all)
    }
}
