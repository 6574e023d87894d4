//! What a localizer knows of its sensors and of the car.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::param::{ParamError, require_all_within, require_within};

/// How long a reading of the inertial unit holds.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Hold {
    /// Until the next one: it is a mean over the time that follows its stamp.
    Previous,
    /// Up to the next one the mean of both counts: each is of an instant.
    #[default]
    Mean,
}

/// Sensors, constraints and limits. Deviations are standard deviations; 0 switches off what they belong to.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// How long a reading of the inertial unit holds.
    pub hold: Hold,
    /// What the accelerometer's z reads at rest, m/s².
    pub gravity_mps2: f64,
    /// Noise of the accelerometers along x, y, z, m/s²/√Hz: of each reading over the root of the rate.
    pub accel_noise: [f64; 3],
    /// Noise of the gyroscopes about x, y, z, rad/s/√Hz.
    pub gyro_noise: [f64; 3],
    /// Bias of each accelerometer at the start, m/s².
    pub accel_bias_mps2: f64,
    /// Walk of that bias, m/s² per root second.
    pub accel_bias_walk: f64,
    /// Bias of each gyroscope at the start, rad/s.
    pub gyro_bias_radps: f64,
    /// Walk of that bias, rad/s per root second.
    pub gyro_bias_walk: f64,
    /// Error of the gyroscopes' scale, as a share. It is no state: turns of up to two radians make the attitude as
    /// uncertain as it can.
    pub gyro_scale: f64,
    /// Offset of fixes east and north, metres: what all of them have in common.
    pub offset_m: f64,
    /// Time over which that offset is forgotten, seconds; 0 for never.
    pub offset_time_s: f64,
    /// Scale of the wheels at the start, as a share: a millimetre of tread is 0.003.
    pub wheel_scale: f64,
    /// Walk of that scale, per root second.
    pub wheel_scale_walk: f64,
    /// Noise of the speed by the wheels as a mean over `wheel_span_s`, m/s; 0 where no wheels are read.
    pub wheel_noise_mps: f64,
    /// Time over which readings of the wheels are taken together, seconds: encoders count whole teeth.
    pub wheel_span_s: f64,
    /// Place of the inertial unit in the ego frame, metres.
    pub imu_at_m: [f64; 3],
    /// Place of the satellite antenna in the ego frame, metres; of the point that fixes are told for.
    pub antenna_at_m: [f64; 3],
    /// A car's rear axle moves neither to the side nor up, but for this, m/s; 0 to not suppose that.
    pub non_holonomic_mps: f64,
    /// The angle at which the rear axle slips, as a deviation, radians per m/s² of lateral acceleration.
    pub slip_rad_per_mps2: f64,
    /// How often that is supposed, seconds.
    pub constraint_period_s: f64,
    /// While the wheels stand, the car does, but for this, m/s; 0 to not suppose that.
    pub zero_velocity_mps: f64,
    /// The wheels stand when they told nothing else for this long, seconds.
    pub standing_s: f64,
    /// Measurements whose innovation only one in this many sound ones has are refused (10, 100 or 1000); 0 refuses none.
    pub gate_one_in: u32,
    /// How late a measurement may come, seconds.
    pub horizon_s: f64,
    /// Without a reading of the inertial unit for longer than this it is silent, seconds. Steering angle, wheels and fixes
    /// carry the pose then; without one of them the vehicle is lost.
    pub imu_timeout_s: f64,
    /// Without an accepted fix for longer than this it is coasting, seconds.
    pub coasting_after_s: f64,
    /// Places that are refused for this long, and agree with each other, are believed in the place of the filter, seconds:
    /// reflections of satellite signals last for less.
    pub believed_after_s: f64,
    /// Above this deviation of the position, along the worst direction, it is lost, metres.
    pub lost_sigma_m: f64,
    /// Deviation of roll and pitch at a start in motion, radians.
    pub level_rad: f64,
    /// The paper's first error: corrections of the attitude are in degrees where radians are meant.
    pub degrees_error: bool,
    /// The paper's second error: the velocity follows the attitude by the acceleration without gravity.
    pub gravity_free_jacobian: bool,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            hold: Hold::Mean,
            gravity_mps2: 9.81,
            accel_noise: [0.01; 3],
            gyro_noise: [0.001; 3],
            accel_bias_mps2: 0.05,
            accel_bias_walk: 1e-3,
            gyro_bias_radps: 2e-3,
            gyro_bias_walk: 1e-5,
            gyro_scale: 0.0,
            offset_m: 0.5,
            offset_time_s: 0.0,
            wheel_scale: 0.003,
            wheel_scale_walk: 0.0,
            wheel_noise_mps: 0.07,
            wheel_span_s: 0.1,
            imu_at_m: [0.0; 3],
            antenna_at_m: [0.0; 3],
            non_holonomic_mps: 0.1,
            slip_rad_per_mps2: 0.01,
            constraint_period_s: 0.1,
            zero_velocity_mps: 0.02,
            standing_s: 0.3,
            gate_one_in: 1000,
            horizon_s: 1.0,
            imu_timeout_s: 0.2,
            coasting_after_s: 2.0,
            believed_after_s: 10.0,
            lost_sigma_m: 2.0,
            level_rad: 0.03,
            degrees_error: false,
            gravity_free_jacobian: false,
        }
    }
}

impl Params {
    /// The filter of the paper's Pylot: 9 states with Q = 0.5 dt² of accelerations and turn rates, read every `period_s`,
    /// and nothing supposed of the car. Its errors are switches of their own.
    ///
    /// Source: `pylot/localization/localization_operator.py`.
    pub fn paper(period_s: f64) -> Self {
        let density = (0.5 * period_s).sqrt();
        Self {
            hold: Hold::Previous,
            accel_noise: [density; 3],
            gyro_noise: [density; 3],
            accel_bias_mps2: 0.0,
            accel_bias_walk: 0.0,
            gyro_bias_radps: 0.0,
            gyro_bias_walk: 0.0,
            offset_m: 0.0,
            wheel_scale: 0.0,
            wheel_noise_mps: 0.0,
            non_holonomic_mps: 0.0,
            zero_velocity_mps: 0.0,
            gate_one_in: 0,
            ..Self::default()
        }
    }

    /// Variance of a coordinate of a fix that Pylot's filter takes for granted, m².
    pub const PAPER_FIX_M2: f64 = 0.1;

    /// The largest square of an innovation of `dof` numbers (1 to 3) that is taken: a quantile of chi-square.
    pub(crate) fn gate(&self, dof: usize) -> f64 {
        let quantiles = match self.gate_one_in {
            0 => return f64::INFINITY,
            1..=10 => [2.706, 4.605, 6.251],
            11..=100 => [6.635, 9.210, 11.345],
            _ => [10.828, 13.816, 16.266],
        };
        quantiles[dof - 1]
    }

    /// Whether a localizer can be made with them.
    ///
    /// # Errors
    /// The first that is out of its range.
    pub fn validate(&self) -> Result<(), ParamError> {
        let axes = |key: &'static str, of: [f64; 3], most: f64| {
            of.into_iter().try_for_each(|x| require_within(key, x, [0.0, most]))
        };
        axes("accel_noise", self.accel_noise, 10.0)?;
        axes("gyro_noise", self.gyro_noise, 1.0)?;
        axes("imu_at_m", self.imu_at_m.map(f64::abs), 20.0)?;
        axes("antenna_at_m", self.antenna_at_m.map(f64::abs), 20.0)?;
        require_all_within(&[
            ("gravity_mps2", self.gravity_mps2, [-20.0, 20.0]),
            ("accel_bias_mps2", self.accel_bias_mps2, [0.0, 10.0]),
            ("accel_bias_walk", self.accel_bias_walk, [0.0, 10.0]),
            ("gyro_bias_radps", self.gyro_bias_radps, [0.0, 1.0]),
            ("gyro_bias_walk", self.gyro_bias_walk, [0.0, 1.0]),
            ("gyro_scale", self.gyro_scale, [0.0, 0.5]),
            ("offset_m", self.offset_m, [0.0, 1000.0]),
            ("offset_time_s", self.offset_time_s, [0.0, 1e6]),
            ("wheel_scale", self.wheel_scale, [0.0, 0.5]),
            ("wheel_scale_walk", self.wheel_scale_walk, [0.0, 0.5]),
            ("wheel_noise_mps", self.wheel_noise_mps, [0.0, 10.0]),
            ("wheel_span_s", self.wheel_span_s, [0.0, 2.0]),
            ("non_holonomic_mps", self.non_holonomic_mps, [0.0, 10.0]),
            ("slip_rad_per_mps2", self.slip_rad_per_mps2, [0.0, 1.0]),
            ("constraint_period_s", self.constraint_period_s, [0.001, 10.0]),
            ("zero_velocity_mps", self.zero_velocity_mps, [0.0, 10.0]),
            ("standing_s", self.standing_s, [0.0, 10.0]),
            ("gate_one_in", f64::from(self.gate_one_in), [0.0, 1000.0]),
            ("horizon_s", self.horizon_s, [0.0, 10.0]),
            ("imu_timeout_s", self.imu_timeout_s, [0.001, 10.0]),
            ("coasting_after_s", self.coasting_after_s, [0.01, 1000.0]),
            ("believed_after_s", self.believed_after_s, [0.1, 1000.0]),
            ("lost_sigma_m", self.lost_sigma_m, [0.01, 1000.0]),
            ("level_rad", self.level_rad, [1e-4, 1.0]),
        ])
    }
}
