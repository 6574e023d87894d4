//! The behaviour planner without manoeuvres: along the route.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Ranges;
use swerve_msg::{Decision, StopPoint, StopReason};

use crate::along::along;
use crate::lights::LightStops;
use crate::{BehaviourPlanner, Situation};

/// Parameters of [`FollowRoute`].
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct FollowRouteParams {
    /// Deceleration for a stop at a yellow light, m/s²: if it takes more, the ego goes on, provided it reaches the line
    /// before the light can be red. Source: 10 ft/s² (ITE, Guidelines for Determining Traffic Signal Change and
    /// Clearance Intervals, 2020).
    #[schemars(range(min = 0.1, max = 20.0))]
    pub brake_mps2: f64,
    /// Time from the signal to the brakes, seconds. ITE has 1 s for people.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub reaction_s: f64,
}

impl Default for FollowRouteParams {
    fn default() -> Self {
        Self { brake_mps2: 3.0, reaction_s: 0.5 }
    }
}

/// Follows the route within its speed limits, stops at red lights, and overtakes nobody in junctions.
#[derive(Clone, Debug)]
pub struct FollowRoute {
    lights: LightStops,
}

impl FollowRoute {
    /// Creates the planner.
    pub fn new(params: FollowRouteParams) -> Self {
        Self { lights: LightStops::new(params) }
    }
}

impl BehaviourPlanner for FollowRoute {
    fn decide(&mut self, at: &Situation<'_>) -> Decision {
        let stop = |s_m: &f64| StopPoint { s_m: *s_m, cause: StopReason::TrafficLight };
        Decision { stops: self.lights.update(at).iter().map(stop).collect(), ..along(at) }
    }
}

#[cfg(test)]
mod tests;
