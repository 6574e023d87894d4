//! Limits and times of the gate.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::param::{ParamError, require_all_within};
use swerve_vehicle::VehicleParams;

/// Limits and times of a [`SafetyGate`](super::SafetyGate).
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct GateParams {
    /// A command older than this is none, seconds (Autoware: 0.5).
    pub command_timeout_s: f64,
    /// A report of the vehicle older than this is none, seconds.
    pub report_timeout_s: f64,
    /// The same numbers under new stamps for longer than this, while the car moves, are no command, seconds; 0 for no
    /// bound. A controller that measures never says the same for long, as ours does not; what is known to say only what it
    /// wants, such as a constant speed along a straight lane, may.
    pub repeat_max_s: f64,
    /// A command is refused whose newest sensor frame is older than this, seconds; 0 for no bound. What follows a plan
    /// of long ago is new itself, and blind.
    pub origin_timeout_s: f64,
    /// How far the stamp of a command may be ahead of now, seconds: clocks differ a little.
    pub ahead_max_s: f64,
    /// Largest angle of the front road wheels, radians.
    pub steering_max_rad: f64,
    /// Largest rate of that angle, rad/s.
    pub steering_rate_max_radps: f64,
    /// Largest lateral acceleration of a car without slip, m/s²: limits the angle at speed (Autoware: 4 to 5).
    pub lateral_accel_max_mps2: f64,
    /// Distance between the axles, metres.
    pub wheelbase_m: f64,
    /// Highest speed, m/s (Autoware: 25).
    pub speed_max_mps: f64,
    /// Highest speed backwards, m/s (positive); 0 for none.
    pub reverse_max_mps: f64,
    /// Largest acceleration, m/s².
    pub accel_max_mps2: f64,
    /// Largest deceleration that the stack may ask for, m/s² (positive).
    pub decel_max_mps2: f64,
    /// Largest rate at which the acceleration changes while driving, m/s³.
    pub jerk_max_mps3: f64,
    /// Deceleration of a controlled stop, m/s² (positive; Autoware: 1.5).
    pub stop_decel_mps2: f64,
    /// Deceleration of an emergency stop, m/s² (positive).
    pub emergency_decel_mps2: f64,
    /// Deceleration that is asked for at standstill, so that the car stays where it is, m/s² (positive).
    pub hold_decel_mps2: f64,
    /// Room to either side of the car in its lane, metres: how far an error of the pose may take a car aside before it
    /// stands. Bounds how far the pose may move otherwise than the wheels; 0 for no comparison of the two.
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
    /// Those of a car whose own numbers are known.
    ///
    /// A gate is no second planner: its limits stand where the car itself ends, so that what a sound stack asks for
    /// in an emergency passes, and only what no sound stack asks for is cut. Angle, its rate and the brakes are the
    /// actuators' own (full brakes as fast as they build up); a tyre holds about 1 g to the side; comfort is not
    /// the gate's. A stop without a stack is blind, so it is a firm one: 3 m/s² (UN R157 allows a minimal risk
    /// manoeuvre 4); an emergency stop is the most that a plan may ask for.
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
    /// Whether all of them are finite and of a plausible size.
    ///
    /// # Errors
    /// The first that is not.
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
