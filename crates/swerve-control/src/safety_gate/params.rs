//! Parameters of the safety gate.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{ParamError, Ranges};
use swerve_vehicle::VehicleParams;

/// Limits and timeouts of a [`SafetyGate`](super::SafetyGate).
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct GateParams {
    /// Age at which a command of the stack expires, seconds (Autoware: 0.5).
    #[schemars(range(min = 0.01, max = 10.0))]
    pub command_timeout_s: f64,
    /// Age at which a report of the vehicle expires, seconds.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub report_timeout_s: f64,
    /// Time after which commands with equal values under new stamps count as frozen while the car moves, seconds; 0
    /// disables the check. A controller that uses measurements never repeats its values for long; a source that only
    /// sends target values, such as a constant speed along a straight lane, may do so.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub repeat_max_s: f64,
    /// Largest age of the latest sensor frame behind a command, seconds; older commands are refused; 0 disables the
    /// check. A command that follows an old plan is new itself, but blind.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub origin_timeout_s: f64,
    /// Largest lead of a command's stamp over the current time, seconds: clocks differ slightly.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub ahead_max_s: f64,
    /// Largest angle of the front road wheels, radians.
    #[schemars(range(min = 0.01, max = 1.5))]
    pub steering_max_rad: f64,
    /// Largest rate of that angle, rad/s.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub steering_rate_max_radps: f64,
    /// Largest lateral acceleration of a car without slip, m/s²: limits the steering angle at speed (Autoware: 4 to 5).
    #[schemars(range(min = 0.1, max = 30.0))]
    pub lateral_accel_max_mps2: f64,
    /// Distance between the axles, metres.
    #[schemars(range(min = 0.1, max = 20.0))]
    pub wheelbase_m: f64,
    /// Highest speed, m/s (Autoware: 25).
    #[schemars(range(min = 0.1, max = 150.0))]
    pub speed_max_mps: f64,
    /// Highest reverse speed, m/s (positive); 0 disables reversing.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub reverse_max_mps: f64,
    /// Largest acceleration, m/s².
    #[schemars(range(min = 0.1, max = 20.0))]
    pub accel_max_mps2: f64,
    /// Largest deceleration that the stack may command, m/s² (positive).
    #[schemars(range(min = 0.1, max = 20.0))]
    pub decel_max_mps2: f64,
    /// Largest jerk while driving, m/s³.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub jerk_max_mps3: f64,
    /// Deceleration of a controlled stop, m/s² (positive; Autoware: 1.5).
    #[schemars(range(min = 0.1, max = 20.0))]
    pub stop_decel_mps2: f64,
    /// Deceleration of an emergency stop, m/s² (positive).
    #[schemars(range(min = 0.1, max = 20.0))]
    pub emergency_decel_mps2: f64,
    /// Deceleration commanded at standstill to hold the car, m/s² (positive).
    #[schemars(range(min = 0.1, max = 20.0))]
    pub hold_decel_mps2: f64,
    /// Room on either side of the car in its lane, metres: the lateral error that a wrong pose may cause before the car
    /// stands. Bounds the difference between the motions of pose and wheels; 0 disables the comparison.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub lane_margin_m: f64,
    /// Time for which the reports of the vehicle may deviate from the commands, seconds; 0 disables the checks of
    /// steering, acceleration and speed. Acceleration is the slope of the reported speed over this time.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub ignored_after_s: f64,
    /// Time from a command to the full response of the vehicle, seconds: dead time, lag and build-up of the actuators.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub response_s: f64,
    /// Largest deviation of the reported steering angle from the commands of the last `response_s`, radians; 0 disables
    /// this check.
    #[schemars(range(min = 0.0, max = 1.5))]
    pub steering_error_rad: f64,
    /// Largest deviation of the measured acceleration from the commands, m/s²; 0 disables this check. A slope of 10 %
    /// changes it by 1 m/s².
    #[schemars(range(min = 0.0, max = 20.0))]
    pub accel_error_mps2: f64,
    /// Largest excess of the reported speed over `speed_max_mps`, m/s; 0 disables this check.
    #[schemars(range(min = 0.0, max = 50.0))]
    pub speed_excess_mps: f64,
}

/// Calibration error and compliance of a steering, radians.
const STEERING_ERROR_RAD: f64 = 0.05;

/// Reserve on the response of a vehicle, seconds: transport, periods of reports, a dead time that is not declared.
const RESPONSE_RESERVE_S: f64 = 0.3;

/// Number of time constants of a first-order lag until 95 % of its response.
const LAGS: f64 = 3.0;

/// Width of a narrow lane of a road with two directions, metres.
const LANE_WIDTH_M: f64 = 3.5;

impl Default for GateParams {
    fn default() -> Self {
        Self {
            command_timeout_s: 0.5,
            report_timeout_s: 0.5,
            repeat_max_s: 0.0,
            origin_timeout_s: 0.0,
            ahead_max_s: 0.1,
            steering_max_rad: 0.61,
            steering_rate_max_radps: 0.7,
            lateral_accel_max_mps2: 5.0,
            wheelbase_m: 2.85,
            speed_max_mps: 25.0,
            reverse_max_mps: 0.0,
            accel_max_mps2: 3.0,
            decel_max_mps2: 8.0,
            jerk_max_mps3: 40.0,
            stop_decel_mps2: 1.5,
            emergency_decel_mps2: 5.0,
            hold_decel_mps2: 1.5,
            lane_margin_m: 0.0,
            ignored_after_s: 1.0,
            response_s: 1.0,
            steering_error_rad: STEERING_ERROR_RAD,
            accel_error_mps2: 2.0,
            speed_excess_mps: 1.0,
        }
    }
}

impl GateParams {
    /// Parameters for a car with known limits.
    ///
    /// The gate does not plan: its limits are those of the car itself, so that sound commands pass even in an
    /// emergency, and only unsound ones are cut. Steering angle, its rate and the brakes are limited as the actuators
    /// are (full brakes as fast as they build up); a tyre holds about 1 g laterally; comfort is not a concern of the
    /// gate. A stop without a stack is blind and therefore firm: 3 m/s² (UN R157 allows 4 for a minimal risk
    /// manoeuvre); an emergency stop uses the largest deceleration that a plan may command.
    pub fn new(vehicle: &VehicleParams) -> Self {
        let brakes_mps2 =
            vehicle.brakes.torque_max_nm / (vehicle.wheel.radius_m * vehicle.effective_mass_kg());
        let limits = &vehicle.limits;
        let build_up_s = vehicle.brakes.build_up_s.max(0.02);
        let slowest_s = build_up_s.max(LAGS * vehicle.drivetrain.lag_s).max(LAGS * vehicle.steering.lag_s);
        let response_s = vehicle.dead_time_s + slowest_s + RESPONSE_RESERVE_S;
        // Wheels that turn by less than requested at speed deviate without a fault.
        let share = vehicle.steering.curve.iter().fold(1.0_f64, |least, [_, share]| least.min(*share));
        let steering_error_rad = STEERING_ERROR_RAD + (1.0 - share) * limits.steering_max_rad;
        Self {
            repeat_max_s: 1.0,
            origin_timeout_s: 1.0,
            steering_max_rad: limits.steering_max_rad,
            steering_rate_max_radps: limits.steering_rate_max_radps,
            lateral_accel_max_mps2: swerve_vehicle::GRAVITY_MPS2,
            wheelbase_m: vehicle.shape.wheelbase_m,
            accel_max_mps2: limits.accel_max_mps2.clamp(0.1, 20.0),
            decel_max_mps2: brakes_mps2.clamp(0.1, 20.0),
            jerk_max_mps3: (brakes_mps2 / build_up_s).clamp(0.1, 1000.0),
            stop_decel_mps2: 3.0,
            emergency_decel_mps2: limits.brake_max_mps2.clamp(0.1, 20.0),
            lane_margin_m: (0.5 * (LANE_WIDTH_M - vehicle.shape.width_m)).max(0.2),
            response_s: response_s.clamp(0.0, 20.0),
            steering_error_rad: steering_error_rad.clamp(0.0, 1.5),
            ..Self::default()
        }
    }
}

impl GateParams {
    /// Checks that all parameters are finite and plausible.
    ///
    /// # Errors
    /// The first parameter out of range.
    pub fn validate(&self) -> Result<(), ParamError> {
        self.check_ranges()
    }
}
