//! Parameters of the tracker.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::param::{ParamError, require_all_within};
use swerve_msg::ActorKind;

/// How things of a kind move.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Motion {
    /// Standard deviation of each part of the velocity of one that is first seen, m/s.
    pub speed_mps: f64,
    /// Spectral density of the acceleration, m²/s³: after a second without sight each part of the velocity has the
    /// square root of this as additional deviation, m/s.
    pub accel_density: f64,
    /// Standard deviation of a sudden change of each part of the velocity, m/s: what tracks and boxes that found none
    /// otherwise are tried with.
    pub change_mps: f64,
}

/// Parameters of the tracker.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Boxes with a lower score are ignored.
    pub score_min: f64,
    /// Squared distance in standard deviations from which on a box is not taken for a track's; 9.21 holds 99 % of
    /// those that are (chi-squared with two degrees of freedom).
    pub gate: f64,
    /// Frames in which a track must have been seen to be reported. SORT: 3.
    pub hits_min: usize,
    /// One that is not reported yet ends when it has not been seen for longer than this, seconds: zero asks for frames in
    /// a row, as SORT does. Where lists come from sensors in turn, the period of the slowest.
    pub probation_s: f64,
    /// A reported track ends when it has not been seen for longer than this, seconds. SORT: one frame.
    pub forget_after_s: f64,
    /// Past positions reported, the present one included.
    pub sightings_max: usize,
    /// Least weight of a new box's size and heading; the first ones are averaged.
    pub shape_gain: f64,
    /// Standard deviation of a box's distance, metres.
    pub range_noise_m: f64,
    /// The same, as a share of the distance, on top.
    pub range_noise_share: f64,
    /// Standard deviation of its bearing, radians.
    pub bearing_noise_rad: f64,
    /// Standard deviation of its place in any direction, on top, metres: poses of the ego have errors too. With more,
    /// velocities come later.
    pub floor_noise_m: f64,
    /// How people on foot and on bicycles move.
    pub person: Motion,
    /// How motor vehicles move.
    pub vehicle: Motion,
    /// How what cannot move moves.
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
    /// How things of a kind move.
    pub fn motion(&self, kind: ActorKind) -> Motion {
        match kind {
            ActorKind::Pedestrian | ActorKind::Cyclist => self.person,
            ActorKind::Car | ActorKind::Truck | ActorKind::Motorcycle => self.vehicle,
            ActorKind::Static => self.fixed,
        }
    }

    /// The first parameter outside its range.
    ///
    /// # Errors
    /// There is one.
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
            // Above zero, or a filter could become certain.
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
