//! The route at a speed that people and vehicles ahead reduce: the baseline without a search.
//!
//! As Pylot's waypoint planner: everything predicted gives a stop factor by its distance and its angle off
//! the route's direction; the target speed is multiplied by the least of them. Pylot's angles are in a
//! left-handed frame; here they are positive to the left. Its lane filter needs a map and is left out.

use serde::{Deserialize, Serialize};
use swerve_geom::angle_between;
use swerve_msg::{ActorKind, Plan, PlanStatus, Prediction};
use swerve_vehicle::Limits;

use crate::params::{InvalidParam, require_positive};
use crate::request::{Budget, Goes, Planner, Request};
use crate::world::{SpeedProfile, brake_along, route_path, route_pose_ahead, timed_points};

/// Parameters. Source of all defaults but the last four: Pylot's flags.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Persons within this slow the ego down, metres.
    pub person_distance_m: f64,
    /// ... if they are within this angle of the route's direction, radians.
    pub person_angle_rad: f64,
    /// Persons within this stop the ego, metres.
    pub person_emergency_distance_m: f64,
    /// ... if they are within this angle of the route's direction, radians.
    pub person_emergency_angle_rad: f64,
    /// Vehicles within this slow the ego down, metres.
    pub vehicle_distance_m: f64,
    /// ... if they are within this angle to the right of the route's direction, radians. To the left the
    /// angle is `0.5 / coast_factor` of it, as oncoming traffic is there.
    pub vehicle_angle_rad: f64,
    /// How much further away than their distances obstacles begin to count, and how much softer.
    pub coast_factor: f64,
    /// Number of predicted places that count, from the first on.
    pub predicted_places: u32,
    /// The route's direction is taken towards its point this far ahead, metres. Source: ours.
    pub direction_ahead_m: f64,
    /// Deceleration while slowing down, m/s²; stops brake fully. Source: ours.
    pub comfort_brake_mps2: f64,
    /// Length of the plan, seconds. Source: ours.
    pub horizon_s: f64,
    /// Reductions below this share of the target speed are stops. Source: ours.
    pub stop_below: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            person_distance_m: 35.0,
            person_angle_rad: 0.15,
            person_emergency_distance_m: 15.0,
            person_emergency_angle_rad: 0.5,
            vehicle_distance_m: 18.0,
            vehicle_angle_rad: 0.4,
            coast_factor: 1.75,
            predicted_places: 10,
            direction_ahead_m: 9.0,
            comfort_brake_mps2: 4.0,
            horizon_s: 5.0,
            stop_below: 0.05,
        }
    }
}

impl Params {
    /// Checks all ranges.
    pub fn validate(&self) -> Result<(), InvalidParam> {
        for (key, value) in [
            ("person_distance_m", self.person_distance_m),
            ("person_angle_rad", self.person_angle_rad),
            ("person_emergency_distance_m", self.person_emergency_distance_m),
            ("person_emergency_angle_rad", self.person_emergency_angle_rad),
            ("vehicle_distance_m", self.vehicle_distance_m),
            ("vehicle_angle_rad", self.vehicle_angle_rad),
            ("coast_factor", self.coast_factor),
            ("predicted_places", f64::from(self.predicted_places)),
            ("direction_ahead_m", self.direction_ahead_m),
            ("comfort_brake_mps2", self.comfort_brake_mps2),
            ("horizon_s", self.horizon_s),
            ("stop_below", self.stop_below),
        ] {
            require_positive(key, value)?;
        }
        Ok(())
    }

    /// Share of the target speed that a person allows, at `distance_m` and `angle_rad` off the route.
    pub fn person_factor(&self, distance_m: f64, angle_rad: f64) -> f64 {
        let angle = angle_rad.abs();
        if angle <= self.person_emergency_angle_rad && distance_m <= self.person_emergency_distance_m {
            return 0.0;
        }
        if angle <= self.person_angle_rad && distance_m <= self.person_distance_m {
            return (distance_m / (self.coast_factor * self.person_distance_m)).min(1.0);
        }
        1.0
    }

    /// Share of the target speed that a vehicle allows, at `distance_m` and `angle_rad` off the route.
    pub fn vehicle_factor(&self, distance_m: f64, angle_rad: f64) -> f64 {
        let (reach_m, angle, coast) = (self.vehicle_distance_m, self.vehicle_angle_rad, self.coast_factor);
        let within = |far_m: f64, right: f64, left: f64| {
            distance_m <= far_m && angle_rad >= -right && angle_rad <= left
        };
        let near = within(reach_m, angle, 0.5 * angle / coast);
        let far = within(reach_m * coast, angle / coast, 0.5 * angle / coast);
        let beside = within(reach_m / coast, angle * coast, 0.5 * angle * coast);
        if near || far || beside { (distance_m / (coast * reach_m)).min(1.0) } else { 1.0 }
    }
}

/// The planner.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Waypoint {
    params: Params,
}

impl Waypoint {
    /// With valid parameters.
    pub fn new(params: Params) -> Result<Self, InvalidParam> {
        params.validate()?;
        Ok(Self { params })
    }

    /// The least factor over the places of one obstacle that count.
    fn factor(&self, request: &Request<'_>, direction_rad: f64, prediction: &Prediction) -> f64 {
        let p = &self.params;
        let ego = request.shape.center(request.start.pose);
        prediction.path.iter().take(p.predicted_places as usize).fold(1.0, |least, place| {
            let to = place.pose.point() - ego;
            let angle_rad = angle_between(direction_rad, to.heading());
            let factor = match prediction.kind {
                ActorKind::Pedestrian | ActorKind::Cyclist => p.person_factor(to.norm(), angle_rad),
                _ => p.vehicle_factor(to.norm(), angle_rad),
            };
            f64::min(least, factor)
        })
    }
}

impl Planner for Waypoint {
    fn plan(&mut self, request: &Request<'_>, budget: &mut dyn Budget) -> Plan {
        let line = &request.route.line;
        let target = route_pose_ahead(line, request.start.pose, self.params.direction_ahead_m);
        let direction_rad = (target.point() - request.start.pose.point()).heading();
        let (mut factor, mut work) = (1.0_f64, 0);
        for prediction in request.predictions {
            work += 1;
            if budget.spend(1) == Goes::Stop {
                break;
            }
            factor = factor.min(self.factor(request, direction_rad, prediction));
        }
        let speed_mps = request.target_speed_mps.max(0.0) * factor;
        let fastest_mps = speed_mps.max(request.start.speed_mps).max(1.0);
        let path = route_path(line, request.start.pose, fastest_mps * self.params.horizon_s);
        if factor < self.params.stop_below {
            return Plan { work, ..brake_along(request, &path, PlanStatus::Route) };
        }
        let brake_max_mps2 = self.params.comfort_brake_mps2.min(request.limits.brake_max_mps2);
        let limits = Limits { brake_max_mps2, ..*request.limits };
        let points = timed_points(&path, &request.start, speed_mps, SpeedProfile::Limited, &limits);
        Plan { stamp: request.stamp, status: PlanStatus::Route, points, work }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::request::Unlimited;
    use crate::testing::{World, conformance};

    fn last_speed(world: &World) -> f64 {
        let mut planner = Waypoint::new(Params::default()).unwrap();
        let plan = planner.plan(&world.request(), &mut Unlimited::default());
        plan.points[plan.points.len() - 1].speed_mps
    }

    #[test]
    fn conforms() {
        conformance(&|| Waypoint::new(Params::default()).unwrap(), false);
    }

    #[test]
    fn factors_are_the_originals() {
        let p = Params::default();
        assert_eq!(p.person_factor(30.0, 0.1), 30.0 / 61.25);
        assert_eq!(p.person_factor(30.0, 0.2), 1.0);
        assert_eq!(p.person_factor(14.0, -0.4), 0.0);
        assert_eq!(p.vehicle_factor(17.0, -0.39), 17.0 / 31.5);
        assert_eq!(p.vehicle_factor(17.0, 0.2), 1.0);
        assert_eq!(p.vehicle_factor(30.0, -0.2), 30.0 / 31.5);
        assert_eq!(p.vehicle_factor(30.0, -0.3), 1.0);
        assert_eq!(p.vehicle_factor(9.0, -0.6), 9.0 / 31.5);
        assert_eq!(p.vehicle_factor(9.0, 0.3), 9.0 / 31.5);
    }

    #[test]
    fn slows_for_what_is_ahead_only() {
        assert_eq!(last_speed(&World::straight(10.0)), 10.0);
        let ahead = World::straight(10.0).with_person((30.0, 0.0), (0.0, 0.0));
        assert!((last_speed(&ahead) - 10.0 * (30.0 - 1.425) / 61.25).abs() < 1e-6);
        let close = World::straight(10.0).with_person((12.0, 3.0), (0.0, 0.0));
        assert_eq!(last_speed(&close), 0.0);
        let behind = World::straight(10.0).with_person((-12.0, 0.0), (0.0, 0.0));
        assert_eq!(last_speed(&behind), 10.0);
        let oncoming = World::straight(10.0).with(ActorKind::Car, (4.5, 1.9), (15.0, 4.0), (0.0, 0.0));
        assert_eq!(last_speed(&oncoming), 10.0);
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let wrong = Waypoint::new(Params { coast_factor: f64::NAN, ..Params::default() }).unwrap_err();
        assert_eq!(wrong.key, "coast_factor");
    }
}
