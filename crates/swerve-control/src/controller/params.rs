//! Parameters of the controller.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Ranges;

use crate::lateral::{PurePursuitParams, StanleyParams, WaypointParams};
use crate::{GripParams, SlipParams, mpc, pid, speed};

/// Time reference when following a plan.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Following {
    /// By projection: from the place of the plan nearest to the ego; passed points are trimmed and times ignored, as in
    /// Pylot.
    Projection,
    /// By time: the ego should be where the plan is now.
    #[default]
    Time,
}

/// Laws for steering and speed.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Law {
    /// Pylot's PID on speed, and its steering by the angle to a waypoint.
    Pid,
    /// Pure pursuit, and the speed law with feed-forward.
    PurePursuit,
    /// Stanley, and the speed law with feed-forward.
    #[default]
    Stanley,
    /// Model predictive control of steering and acceleration.
    Mpc,
}

/// Parameters of a [`LawController`](crate::LawController).
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Control laws for steering and speed.
    pub law: Law,
    /// Time reference when following a plan.
    pub following: Following,
    /// Stop of the controller when there is no usable plan or state.
    #[ranges(nested)]
    pub stop: StopParams,
    /// Parameters of Pylot's speed controller.
    #[ranges(nested)]
    pub pid: pid::Params,
    /// Parameters of Pylot's steering.
    #[ranges(nested)]
    pub waypoint: WaypointParams,
    /// Parameters of pure pursuit.
    #[ranges(nested)]
    pub pure_pursuit: PurePursuitParams,
    /// Parameters of the Stanley law.
    #[ranges(nested)]
    pub stanley: StanleyParams,
    /// Speed law of the path trackers.
    #[ranges(nested)]
    pub speed: speed::Params,
    /// Correction of longitudinal errors when following by time.
    #[ranges(nested)]
    pub along: AlongParams,
    /// Tyre slip, added to the geometric steering; not used by [`Law::Pid`].
    #[ranges(nested)]
    pub slip: SlipParams,
    /// Acceleration while the front tyres slide; not used by [`Law::Pid`].
    #[ranges(nested)]
    pub grip: GripParams,
    /// Parameters of model predictive control.
    #[ranges(nested)]
    pub mpc: mpc::Params,
    /// Largest lateral jerk from steering while the plan is comfortable, m/s³; not used by [`Law::Pid`].
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub comfort_jerk_mps3: f64,
    /// Largest acceleration on a plan, and its rise while the plan is comfortable; not used by [`Law::Pid`].
    #[ranges(nested)]
    pub comfort_accel: ComfortAccelParams,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            law: Law::default(),
            following: Following::default(),
            stop: StopParams::default(),
            pid: pid::Params::default(),
            waypoint: WaypointParams::default(),
            pure_pursuit: PurePursuitParams::default(),
            stanley: StanleyParams::default(),
            speed: speed::Params::default(),
            along: AlongParams::default(),
            slip: SlipParams::default(),
            grip: GripParams::default(),
            mpc: mpc::Params::default(),
            comfort_jerk_mps3: 6.5,
            comfort_accel: ComfortAccelParams::default(),
        }
    }
}

/// Bounds on the commanded acceleration: a car lags its plan, and does not exceed comfort to catch up. Braking is not
/// bounded.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct ComfortAccelParams {
    /// Largest acceleration, m/s², unless the plan has more. Source: within nuPlan's 2.40, above the planner's 2.
    #[schemars(range(min = 0.1, max = 20.0))]
    pub most_mps2: f64,
    /// Largest rate at which the acceleration rises while the plan is comfortable, m/s³. Source: within nuPlan's 4.13.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub rise_mps3: f64,
    /// Time constant with which the car's acceleration follows its commands, seconds. Source: 0.2 s of the drivetrain.
    #[schemars(range(min = 0.001, max = 5.0))]
    pub lag_s: f64,
}

impl Default for ComfortAccelParams {
    fn default() -> Self {
        Self { most_mps2: 2.2, rise_mps3: 3.6, lag_s: 0.2 }
    }
}

/// Stop of the controller without a usable plan or state.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct StopParams {
    /// Deceleration of a comfortable stop, m/s² (positive).
    #[schemars(range(min = 0.1, max = 20.0))]
    pub decel_mps2: f64,
    /// Deceleration of a stop without a usable ego state, m/s² (positive): firm, as that of the safety gate.
    #[schemars(range(min = 0.1, max = 20.0))]
    pub blind_decel_mps2: f64,
    /// Age above which an ego state is unusable, seconds: while the measured speed does not respond to the pedals, the
    /// speed control presses the throttle further and further.
    #[schemars(range(min = 0.001, max = 60.0))]
    pub blind_after_s: f64,
}

impl Default for StopParams {
    fn default() -> Self {
        Self { decel_mps2: 2.0, blind_decel_mps2: 3.0, blind_after_s: 0.3 }
    }
}

/// Correction of longitudinal errors when following by time.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct AlongParams {
    /// Speed correction per metre of lag, 1/s.
    #[schemars(range(min = 0.001, max = 100.0))]
    pub gain_ps: f64,
    /// Largest speed correction, m/s.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub speed_max_mps: f64,
    /// Search radius for the ego on the plan around its target place, metres.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub reach_m: f64,
}

impl Default for AlongParams {
    fn default() -> Self {
        Self { gain_ps: 0.5, speed_max_mps: 2.0, reach_m: 15.0 }
    }
}
