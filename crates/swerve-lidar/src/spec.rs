//! Lidar specifications and their validation.

use core::f64::consts::{FRAC_PI_2, PI};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::param::{ParamError, Ranges, require};

/// Largest number of beams.
const BEAMS_MAX: usize = 512;
/// Largest number of shots per turn: beams times columns.
const SHOTS_MAX: usize = 1 << 22;
/// Angular difference below which beams are duplicates, radians.
const SAME_ANGLE_RAD: f64 = 1e-6;

/// Laser beam of a lidar.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields)]
pub struct Beam {
    /// Angle of the beam above the plane of rotation, radians.
    #[schemars(range(min = -FRAC_PI_2, max = FRAC_PI_2))]
    pub elevation_rad: f64,
    /// Azimuth offset of the beam from its column, counter-clockwise seen from above, radians.
    #[serde(default)]
    #[schemars(range(min = -PI, max = PI))]
    pub azimuth_rad: f64,
}

/// Specification of a lidar; [`crate::Sweeper::new`] checks it.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(default, deny_unknown_fields)]
pub struct LidarSpec {
    /// Laser beams; a point's ring is the index of its beam in this list. Presets are sorted from the lowest to the
    /// highest.
    #[ranges(nested)]
    pub beams: Vec<Beam>,
    /// Number of columns per turn, evenly spaced in angle and time.
    #[schemars(range(min = 1, max = 16_384))]
    pub columns: u32,
    /// Turns per second, Hz.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub rate_hz: f64,
    /// Azimuth of the first column, counter-clockwise from x, radians.
    #[schemars(range(min = -2.0 * PI, max = 2.0 * PI))]
    pub first_azimuth_rad: f64,
    /// True for clockwise rotation seen from above, as usual.
    pub is_clockwise: bool,
    /// Smallest range of a return, metres.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub range_min_m: f64,
    /// Largest range of a return, metres.
    #[schemars(range(min = 0.1, max = 1e4))]
    pub range_max_m: f64,
    /// Range at which a 10 % target facing the sensor in clear air is detected nine times of ten, metres.
    #[schemars(range(min = 0.1, max = 1e6))]
    pub reach_m: f64,
    /// Standard deviation of the range noise, metres.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub range_sigma_m: f64,
    /// Range resolution, metres; ranges are multiples of it. 0 disables quantisation.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub range_step_m: f64,
    /// Share of returns lost at random, independent of the target, 0 to 1.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub dropout: f64,
    /// Range at which a white surface facing the sensor reaches full-scale intensity, metres.
    #[schemars(range(min = 0.1, max = 1e4))]
    pub intensity_full_m: f64,
    /// Seed of the noise.
    pub seed: u64,
}

impl LidarSpec {
    /// Removes noise, quantisation and dropout, for tests and ideal sensors.
    #[must_use]
    pub fn without_noise(self) -> Self {
        Self { range_sigma_m: 0.0, range_step_m: 0.0, dropout: 0.0, reach_m: 1e6, ..self }
    }

    /// Checks that all fields are valid.
    ///
    /// # Errors
    /// The first field that is not finite or out of its range, or a duplicate beam.
    pub fn check(&self) -> Result<(), ParamError> {
        self.check_ranges()?;
        self.check_beams()?;
        let shots = self.beams.len() * self.columns as usize;
        require("beams x columns", shots, shots <= SHOTS_MAX, "at most 4194304 shots per turn")?;
        let (near, far) = (self.range_min_m, self.range_max_m);
        require("range_min_m", near, near < far, "less than range_max_m")
    }

    fn check_beams(&self) -> Result<(), ParamError> {
        let count = self.beams.len();
        require("beams", "empty", count > 0, "at least one beam")?;
        require("beams", format!("a table of {count}"), count <= BEAMS_MAX, "at most 512 beams")?;
        let same = |a: &Beam, b: &Beam| {
            (a.elevation_rad - b.elevation_rad).abs() < SAME_ANGLE_RAD
                && (a.azimuth_rad - b.azimuth_rad).abs() < SAME_ANGLE_RAD
        };
        let twin = |k: usize| (0..k).find(|&j| same(&self.beams[j], &self.beams[k]));
        let Some((k, j)) = (1..count).find_map(|k| Some((k, twin(k)?))) else { return Ok(()) };
        let twins = (1..count).filter(|&k| twin(k).is_some()).count();
        let value = format!("at the angles of beams[{j}] ({twins} of {count} beams repeat another)");
        require(format!("beams[{k}]"), value, false, "beams that differ in elevation or azimuth offset")
    }
}
