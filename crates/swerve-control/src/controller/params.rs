//! Parameters of the controller.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::lateral::{PurePursuitParams, StanleyParams, WaypointParams};
use crate::{SlipParams, mpc, pid, speed};

/// How a plan is followed.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Following {
    /// From the place of the plan that is nearest to the ego; passed points are trimmed, times are ignored, as in
    /// Pylot.
    Projection,
    /// The ego should be where the plan is at the present instant.
    #[default]
    Time,
}

/// Which laws steer and drive.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Law {
    /// Pylot's PID on speed and its steering by the angle to a waypoint.
    Pid,
    /// Pure pursuit and the speed law with feed-forward.
    PurePursuit,
    /// Stanley and the speed law with feed-forward.
    #[default]
    Stanley,
    /// Model predictive control of steering and acceleration.
    Mpc,
}

/// Parameters of a [`Controller`](crate::Controller).
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Which laws steer and drive.
    pub law: Law,
    /// How plans are followed.
    pub following: Following,
    /// The stop when there is nothing to follow any more.
    pub stop: StopParams,
    /// Pylot's speed controller.
    pub pid: pid::Params,
    /// Pylot's steering.
    pub waypoint: WaypointParams,
    /// Pure pursuit.
    pub pure_pursuit: PurePursuitParams,
    /// Stanley.
    pub stanley: StanleyParams,
    /// Speed law of the path trackers.
    pub speed: speed::Params,
    /// Correction of the place when following by time.
    pub along: AlongParams,
    /// Slip of the tyres, which adds to the geometry; not used by [`Law::Pid`].
    pub slip: SlipParams,
    /// Model predictive control.
    pub mpc: mpc::Params,
    /// Most lateral jerk that is steered with while the plan is a comfortable one, m/s³; not with [`Law::Pid`].
    pub comfort_jerk_mps3: f64,
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
            mpc: mpc::Params::default(),
            comfort_jerk_mps3: 6.5,
        }
    }
}

/// How the ego stops when there is nothing to follow.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct StopParams {
    /// Deceleration of a comfortable stop, m/s² (positive).
    pub decel_mps2: f64,
    /// Deceleration of a stop without a usable state of the ego, m/s² (positive): firm, as that of the safety gate.
    pub blind_decel_mps2: f64,
    /// A state of the ego that is older than this is unusable, seconds: a speed that does not answer to the pedals makes
    /// the speed control press the throttle ever more.
    pub blind_after_s: f64,
}

impl Default for StopParams {
    fn default() -> Self {
        Self { decel_mps2: 2.0, blind_decel_mps2: 3.0, blind_after_s: 0.3 }
    }
}

/// Correction of being early or late when following by time.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct AlongParams {
    /// Speed per metre of lag, 1/s.
    pub gain_ps: f64,
    /// Largest change of speed for that, m/s.
    pub speed_max_mps: f64,
    /// The ego is looked for on the plan within this distance of where it should be, metres.
    pub reach_m: f64,
}

impl Default for AlongParams {
    fn default() -> Self {
        Self { gain_ps: 0.5, speed_max_mps: 2.0, reach_m: 15.0 }
    }
}
