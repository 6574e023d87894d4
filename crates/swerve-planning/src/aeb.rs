//! Automatic emergency braking: the route at the target speed, and full brake below a time to collision.
//!
//! The time to collision is simulated step by step: the ego's outline moves along the route at constant speed,
//! everything else as predicted, until the two touch.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Span;
use swerve_core::param::{ParamError, Ranges, require};
use swerve_geom::{FrenetPoint, Pose2};
use swerve_msg::{Plan, PlanStatus};

use crate::brake::{brake_along, brake_length_m};
use crate::collision::{CollisionMode, Obstacles, Solid};
use crate::path::route::{follow_route, route_path};
use crate::path::speed::SpeedProfile;
use crate::request::{Budget, Counted, Planner, Progress, Request};

/// Parameters of automatic emergency braking.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Full brake below this time to collision, seconds. Source: ours: a little over the 1.2 s needed to stop from 18
    /// m/s before standing traffic.
    #[schemars(range(min = 0.01, max = 60.0))]
    pub time_to_collision_s: f64,
    /// Braking continues until the time to collision exceeds `time_to_collision_s` by this factor, or the ego is at
    /// rest. Source: ours.
    #[schemars(range(min = 1.0, max = 10.0))]
    pub release_factor: f64,
    /// Distance below which a pass counts as a collision, metres. Source: ours.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub clearance_m: f64,
    /// Time step of the collision check, seconds; motion between steps is covered. Source: ours.
    #[schemars(range(min = 0.001, max = 1.0))]
    pub step_s: f64,
    /// Length of the plan, seconds. Source: ours.
    #[schemars(range(min = 0.1, max = 60.0))]
    pub horizon_s: f64,
    /// Treatment of predicted motion in the collision check. Source: ours.
    pub collision: CollisionMode,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            time_to_collision_s: 1.5,
            release_factor: 1.5,
            clearance_m: 0.2,
            step_s: 0.05,
            horizon_s: 5.0,
            collision: CollisionMode::TimeIndexed,
        }
    }
}

impl Params {
    /// Checks all ranges.
    pub fn validate(&self) -> Result<(), ParamError> {
        self.check_ranges()?;
        let least_s = self.time_to_collision_s * self.release_factor / STEPS_MAX;
        let expected = format!("at least {least_s}, {STEPS_MAX} steps to the time to collision");
        require("step_s", self.step_s, self.step_s >= least_s, expected)
    }
}

/// Largest number of steps of one collision check.
const STEPS_MAX: f64 = 10_000.0;

/// Automatic emergency braking, with storage that is reused between calls.
#[derive(Clone, Debug)]
pub struct Aeb {
    params: Params,
    obstacles: Obstacles,
}

impl Aeb {
    /// Creates the planner from valid parameters.
    pub fn new(params: Params) -> Result<Self, ParamError> {
        params.validate()?;
        Ok(Self { params, obstacles: Obstacles::default() })
    }

    /// Time until the ego on the route touches something, seconds, if below `within_s`; each step checked counts as one
    /// unit of work.
    fn time_to_collision_s(
        &self,
        request: &Request<'_>,
        within_s: f64,
        budget: &mut Counted<'_>,
    ) -> Option<f64> {
        let line = request.route.line();
        let start = &request.start;
        let FrenetPoint { s_m, d_m } = request.place();
        let speed_mps = start.speed_mps.max(0.0);
        let outline = |t_s: f64| {
            let on_line = line.at(s_m + speed_mps * t_s).pose;
            let beside = on_line.point() + on_line.direction().left() * d_m;
            let pose = Pose2::new(beside.x_m, beside.y_m, on_line.heading_rad);
            Solid::from(&request.shape.footprint(pose))
        };
        let steps = (within_s / self.params.step_s).ceil().max(1.0) as usize;
        for k in 0..steps {
            if budget.spend(1) == Progress::Stop {
                return None;
            }
            let from_s = k as f64 * self.params.step_s;
            let mut place = |u: f64| {
                let t_s = from_s + u * self.params.step_s;
                (outline(t_s), start.stamp + Span::from_secs(t_s))
            };
            // In bends the corners move faster than the origin; twice its distance is a safe upper bound.
            let travel_m = 2.0 * speed_mps * self.params.step_s;
            if !self.obstacles.motion_free(&mut place, travel_m, self.params.clearance_m) {
                return Some(from_s);
            }
        }
        None
    }
}

impl Planner for Aeb {
    fn plan(&mut self, request: &Request<'_>, budget: &mut dyn Budget) -> Plan {
        self.obstacles.set(request.predictions, self.params.collision.in_order()[0]);
        let braking = request.previous.is_some_and(|p| p.status == PlanStatus::Brake);
        let factor = if braking { self.params.release_factor } else { 1.0 };
        let within_s = self.params.time_to_collision_s * factor;
        let mut counted = Counted::new(budget);
        let plan = match self.time_to_collision_s(request, within_s, &mut counted) {
            Some(_) => {
                let path = route_path(request.route.line(), request.place().s_m, brake_length_m(request));
                brake_along(request, &path, PlanStatus::Brake)
            }
            None => follow_route(request, SpeedProfile::Limited, self.params.horizon_s, PlanStatus::Route),
        };
        Plan { work: counted.spent, ..plan }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::request::Unlimited;
    use crate::testing::{World, conformance};

    fn plan(world: &World) -> Plan {
        Aeb::new(Params::default()).unwrap().plan(&world.request(), &mut Unlimited::default())
    }

    #[test]
    fn conforms() {
        conformance(&|| Aeb::new(Params::default()).unwrap(), false);
    }

    #[test]
    fn aeb_brakes_at_the_time_to_collision_and_not_before() {
        // Front at 3.89 m, person's near side 0.25 m before its centre, 0.2 m clearance: 1.5 s at 10 m/s.
        let touch_m = 15.0 + 3.89 + 0.25 + 0.2;
        let near = World::straight(10.0).with_person((touch_m - 0.6, 0.0), (0.0, 0.0));
        assert_eq!(plan(&near).status, PlanStatus::Brake);
        let far = World::straight(10.0).with_person((touch_m + 0.6, 0.0), (0.0, 0.0));
        assert_eq!(plan(&far).status, PlanStatus::Route);
    }

    #[test]
    fn person_gone_before_arrival_does_not_trigger_braking() {
        let gone = World::straight(10.0).with_person((15.0, 0.5), (0.0, -3.0));
        assert_eq!(plan(&gone).status, PlanStatus::Route);
        let coming = World::straight(10.0).with_person((15.0, 4.0), (0.0, -3.0));
        assert_eq!(plan(&coming).status, PlanStatus::Brake);
    }

    #[test]
    fn braking_is_held_up_to_the_release_factor() {
        let world = World::straight(10.0).with_person((21.0, 0.0), (0.0, 0.0));
        assert_eq!(plan(&world).status, PlanStatus::Route);
        let before = Plan { status: PlanStatus::Brake, ..Plan::default() };
        let request = Request { previous: Some(&before), ..world.request() };
        let mut planner = Aeb::new(Params::default()).unwrap();
        assert_eq!(planner.plan(&request, &mut Unlimited::default()).status, PlanStatus::Brake);
    }
}
