//! Parameters of the safety gate.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::param::{ParamError, require_all_within};
use swerve_vehicle::VehicleParams;

/// Limits and timeouts of a [`SafetyGate`](super::SafetyGate).
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GateParams {
    /// Age at which a command of the stack expires, seconds (Autoware: 0.5).
    pub command_timeout_s: f64,
    /// Age at which a report of the vehicle expires, seconds.
    pub report_timeout_s: f64,
    /// Time after which commands with equal values under new stamps count as frozen while the car moves, seconds; 0
    /// disables the check. A controller that uses measurements never repeats its values for long; a source that only
    /// sends target values, such as a constant speed along a straight lane, may do so.
    pub repeat_max_s: f64,
    /// Largest age of the latest sensor frame behind a command, seconds; older commands are refused; 0 disables the
    /// check. A command that follows an old plan is new itself, but blind.
    pub origin_timeout_s: f64,
    /// Largest lead of a command's stamp over the current time, seconds: clocks differ slightly.
    pub ahead_max_s: f64,
    /// Largest angle of the front road wheels, radians.
    pub steering_max_rad: f64,
    /// Largest rate of that angle, rad/s.
    pub steering_rate_max_radps: f64,
    /// Largest lateral acceleration of a car without slip, m/s²: limits the steering angle at speed (Autoware: 4 to 5).
    pub lateral_accel_max_mps2: f64,
    /// Distance between the axles, metres.
    pub wheelbase_m: f64,
    /// Highest speed, m/s (Autoware: 25).
    pub speed_max_mps: f64,
    /// Highest reverse speed, m/s (positive); 0 disables reversing.
    pub reverse_max_mps: f64,
    /// Largest acceleration, m/s².
    pub accel_max_mps2: f64,
    /// Largest deceleration that the stack may command, m/s² (positive).
    pub decel_max_mps2: f64,
    /// Largest jerk while driving, m/s³.
    pub jerk_max_mps3: f64,
    /// Deceleration of a controlled stop, m/s² (positive; Autoware: 1.5).
    pub stop_decel_mps2: f64,
    /// Deceleration of an emergency stop, m/s² (positive).
    pub emergency_decel_mps2: f64,
    /// Deceleration commanded at standstill to hold the car, m/s² (positive).
    pub hold_decel_mps2: f64,
    /// Room on either side of the car in its lane, metres: the lateral error that a wrong pose may cause before the car
    /// stands. Bounds the difference between the motions of pose and wheels; 0 disables the comparison.
    pub lane_margin_m: f64,
}

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
        require_all_within(&[
            ("command_timeout_s", self.command_timeout_s, [0.01, 10.0]),
            ("report_timeout_s", self.report_timeout_s, [0.01, 10.0]),
            ("repeat_max_s", self.repeat_max_s, [0.0, 60.0]),
            ("origin_timeout_s", self.origin_timeout_s, [0.0, 60.0]),
            ("ahead_max_s", self.ahead_max_s, [0.0, 10.0]),
            ("steering_max_rad", self.steering_max_rad, [0.01, 1.5]),
            ("steering_rate_max_radps", self.steering_rate_max_radps, [0.01, 10.0]),
            ("lateral_accel_max_mps2", self.lateral_accel_max_mps2, [0.1, 30.0]),
            ("wheelbase_m", self.wheelbase_m, [0.1, 20.0]),
            ("speed_max_mps", self.speed_max_mps, [0.1, 150.0]),
            ("reverse_max_mps", self.reverse_max_mps, [0.0, 20.0]),
            ("accel_max_mps2", self.accel_max_mps2, [0.1, 20.0]),
            ("decel_max_mps2", self.decel_max_mps2, [0.1, 20.0]),
            ("jerk_max_mps3", self.jerk_max_mps3, [0.1, 1000.0]),
            ("stop_decel_mps2", self.stop_decel_mps2, [0.1, 20.0]),
            ("emergency_decel_mps2", self.emergency_decel_mps2, [0.1, 20.0]),
            ("hold_decel_mps2", self.hold_decel_mps2, [0.1, 20.0]),
            ("lane_margin_m", self.lane_margin_m, [0.0, 10.0]),
        ])
    }
}
