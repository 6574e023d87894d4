//! Parameters of the SORT tracker.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{ParamError, Ranges};
use swerve_msg::ActorKind;

/// Motion model of a group of object kinds.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields)]
pub struct Motion {
    /// Standard deviation of each velocity component of a new track, m/s.
    #[schemars(range(min = 1e-3, max = 100.0))]
    pub speed_mps: f64,
    /// Spectral density of the acceleration, m²/s³: one second without a box adds its square root, in m/s, as standard
    /// deviation of each velocity component.
    #[schemars(range(min = 1e-6, max = 1e3))]
    pub accel_density: f64,
    /// Standard deviation of a sudden change of each velocity component, m/s; used in a second attempt to pair
    /// unmatched tracks and boxes.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub change_mps: f64,
}

/// Parameters of the SORT tracker.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Score below which boxes are ignored, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub score_min: f64,
    /// Gate on the squared Mahalanobis distance of a box from a track; 9.21 contains 99 % of correct pairs (chi-squared
    /// with two degrees of freedom).
    #[schemars(range(min = 0.1, max = 1e3))]
    pub gate: f64,
    /// Number of frames with a box after which a track is reported. SORT: 3.
    #[schemars(range(min = 1, max = 100))]
    pub hits_min: usize,
    /// Time without a box after which an unreported track ends, seconds. Zero requires boxes in consecutive frames, as
    /// in SORT; if sensors report in turn, use the period of the slowest.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub probation_s: f64,
    /// Time without a box after which a reported track ends, seconds. SORT: one frame.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub forget_after_s: f64,
    /// The same for a reported track that stands at most `near_m` ahead of the ego, seconds, if that is longer: an image
    /// shows only a part of an object right ahead.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub near_forget_after_s: f64,
    /// Largest distance of such a track from the ego's origin, metres.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub near_m: f64,
    /// Number of positions in a track's reported history, including the current one.
    #[schemars(range(min = 1, max = 1000))]
    pub sightings_max: usize,
    /// Smallest weight of a new box's size and heading; the first boxes are averaged.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub shape_gain: f64,
    /// Constant standard deviation of a box's distance, metres.
    #[schemars(range(min = 0.0, max = 50.0))]
    pub range_noise_m: f64,
    /// Additional standard deviation of a box's distance, as a share of it.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub range_noise_share: f64,
    /// Standard deviation of a box's bearing, radians.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub bearing_noise_rad: f64,
    /// Additional isotropic standard deviation of a box's position, metres, for errors of the ego pose. Larger values
    /// delay the velocity estimate.
    // Above zero, so that the covariance does not vanish.
    #[schemars(range(min = 1e-3, max = 10.0))]
    pub floor_noise_m: f64,
    /// Standard deviation of a radial speed measured by a radar, m/s; 0: such speeds are ignored.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub radial_noise_mps: f64,
    /// Number of standard deviations by which reported velocities are reduced: a component `v` with the standard deviation
    /// `s` is reported as `v max(0, 1 - (n s / v)²)` (the non-negative garrote; Breiman 1995). 0: none.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub velocity_doubt: f64,
    /// Motion model of pedestrians and cyclists.
    #[ranges(nested)]
    pub person: Motion,
    /// Motion model of motor vehicles.
    #[ranges(nested)]
    pub vehicle: Motion,
    /// Motion model of static objects.
    #[ranges(nested)]
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
            near_forget_after_s: 0.0,
            near_m: 10.0,
            sightings_max: 10,
            shape_gain: 0.1,
            range_noise_m: 0.0,
            range_noise_share: 0.03,
            bearing_noise_rad: 0.002,
            floor_noise_m: 0.02,
            radial_noise_mps: 0.5,
            velocity_doubt: 0.0,
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
        self.check_ranges()
    }
}
