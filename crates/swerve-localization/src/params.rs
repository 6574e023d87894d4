//! Parameters of a localizer: sensors and vehicle.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{ParamError, Ranges};

/// Interpolation of readings of the inertial unit.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Hold {
    /// A reading applies until the next one: it is a mean over the time after its stamp.
    Previous,
    /// Between two readings their mean applies: each is instantaneous.
    #[default]
    Mean,
}

/// Parameters of sensors, constraints and limits. Deviations are standard deviations; 0 disables the associated
/// model.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Interpolation of readings of the inertial unit.
    pub hold: Hold,
    /// Reading of the accelerometer's z axis at rest, m/s².
    #[schemars(range(min = -20.0, max = 20.0))]
    pub gravity_mps2: f64,
    /// Noise density of the accelerometers along x, y, z, m/s²/√Hz: the deviation of a reading over the root of the
    /// rate.
    #[schemars(inner(range(min = 0.0, max = 10.0)))]
    pub accel_noise: [f64; 3],
    /// Noise density of the gyroscopes about x, y, z, rad/s/√Hz.
    #[schemars(inner(range(min = 0.0, max = 1.0)))]
    pub gyro_noise: [f64; 3],
    /// Initial deviation of the bias of each accelerometer, m/s².
    #[schemars(range(min = 0.0, max = 10.0))]
    pub accel_bias_mps2: f64,
    /// Random walk of the accelerometer biases, m/s² per root second.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub accel_bias_walk: f64,
    /// Initial deviation of the bias of each gyroscope, rad/s.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub gyro_bias_radps: f64,
    /// Random walk of the gyroscope biases, rad/s per root second.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub gyro_bias_walk: f64,
    /// Scale error of the gyroscopes, as a share. It is not estimated: turns of up to two radians increase the
    /// attitude's uncertainty by its largest effect.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub gyro_scale: f64,
    /// Common offset of all fixes, east and north, metres.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub offset_m: f64,
    /// Correlation time of the offset of fixes, seconds; 0 for constant.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub offset_time_s: f64,
    /// Initial deviation of the wheel scale, as a share: one millimetre of tread is 0.003.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub wheel_scale: f64,
    /// Random walk of the wheel scale, per root second.
    #[schemars(range(min = 0.0, max = 0.5))]
    pub wheel_scale_walk: f64,
    /// Noise of the wheel speed as a mean over `wheel_span_s`, m/s; 0 to ignore the wheels.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub wheel_noise_mps: f64,
    /// Time over which wheel readings are averaged, seconds: encoders count whole teeth.
    #[schemars(range(min = 0.0, max = 2.0))]
    pub wheel_span_s: f64,
    /// Position of the inertial unit in the ego frame, metres.
    #[schemars(inner(range(min = -20.0, max = 20.0)))]
    pub imu_at_m: [f64; 3],
    /// Position of the satellite antenna in the ego frame, metres: the reference point of fixes.
    #[schemars(inner(range(min = -20.0, max = 20.0)))]
    pub antenna_at_m: [f64; 3],
    /// Deviation of the lateral and vertical velocity of the rear axle from zero, m/s; 0 disables the constraint.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub non_holonomic_mps: f64,
    /// Deviation of the slip angle of the rear axle, radians per m/s² of lateral acceleration.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub slip_rad_per_mps2: f64,
    /// Period of the vehicle constraints, seconds.
    #[schemars(range(min = 0.001, max = 10.0))]
    pub constraint_period_s: f64,
    /// Deviation of the velocity from zero while the wheels are at rest, m/s; 0 disables the constraint.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub zero_velocity_mps: f64,
    /// Time with zero wheel speed after which the vehicle is taken to be at rest, seconds.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub standing_s: f64,
    /// Gate of innovations: a measurement is refused if only one in this many valid ones would exceed its innovation
    /// (10, 100 or 1000); 0 refuses none.
    #[schemars(range(min = 0, max = 1000))]
    pub gate_one_in: u32,
    /// Largest delay of a measurement, seconds.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub horizon_s: f64,
    /// Time without a reading after which the inertial unit is silent, seconds. Steering angle, wheels and fixes then
    /// carry the pose; without one of them the pose is lost.
    #[schemars(range(min = 0.001, max = 10.0))]
    pub imu_timeout_s: f64,
    /// Time without an accepted fix after which the mode is coasting, seconds.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub coasting_after_s: f64,
    /// Time after which refused positions that agree with each other replace the filter's, seconds: reflections of
    /// satellite signals are shorter.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub believed_after_s: f64,
    /// Deviation of the position along its worst direction above which the pose is lost, metres.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub lost_sigma_m: f64,
    /// Deviation of roll and pitch when starting in motion, radians.
    #[schemars(range(min = 1e-4, max = 1.0))]
    pub level_rad: f64,
    /// First error of the paper: attitude corrections in radians are applied as if they were degrees.
    pub degrees_error: bool,
    /// Second error of the paper: the Jacobian of velocity by attitude uses the acceleration without gravity.
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
    /// Filter of Pylot as in the paper: 9 states, Q = 0.5 dt² of accelerations and turn rates, readings every
    /// `period_s`, and no vehicle constraints. Its errors are separate switches.
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

    /// Variance of each coordinate of a fix in Pylot's filter, m².
    pub const PAPER_FIX_M2: f64 = 0.1;

    /// Largest accepted normalised innovation squared of `dof` numbers (1 to 3): a quantile of chi-square.
    pub(crate) fn gate(&self, dof: usize) -> f64 {
        let quantiles = match self.gate_one_in {
            0 => return f64::INFINITY,
            1..=10 => [2.706, 4.605, 6.251],
            11..=100 => [6.635, 9.210, 11.345],
            _ => [10.828, 13.816, 16.266],
        };
        quantiles[dof - 1]
    }

    /// Checks that all parameters are in range.
    ///
    /// # Errors
    /// The first parameter that is out of its range.
    pub fn validate(&self) -> Result<(), ParamError> {
        self.check_ranges()
    }
}
