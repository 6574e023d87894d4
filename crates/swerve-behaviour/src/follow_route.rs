//! The behaviour planner without manoeuvres: along the route.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Ranges;
use swerve_msg::{Decision, SpeedLimit, StopPoint, StopReason};

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
        let junction_m = at.route.to_junction_m(at.place.s_m);
        Decision {
            stamp: at.stamp,
            route: at.number,
            corridor: None,
            limits: limits(at),
            overtake_until_m: junction_m.is_finite().then_some(at.place.s_m + junction_m),
            stops: self.lights.update(at).iter().map(stop).collect(),
            yields: Vec::new(),
        }
    }
}

/// Speed limits of the route from the ego on, none above the speed on a free road.
fn limits(at: &Situation<'_>) -> Vec<SpeedLimit> {
    let stretches = at.route.stretches_from(at.place.s_m);
    let mut limits: Vec<SpeedLimit> = Vec::new();
    let mut add = |from_m, limit_mps: Option<f64>| {
        let speed_mps = limit_mps.map_or(at.cruise_mps, |limit_mps| limit_mps.min(at.cruise_mps));
        if limits.last().is_none_or(|last| last.speed_mps != speed_mps) {
            limits.push(SpeedLimit { from_m, speed_mps });
        }
    };
    if stretches.is_empty() {
        add(0.0, None);
    }
    stretches.iter().for_each(|stretch| add(stretch.begin_m, stretch.speed_limit_mps));
    limits
}

#[cfg(test)]
mod tests;
