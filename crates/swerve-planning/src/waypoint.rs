//! Waypoint planner: follows the route at a speed reduced for people and vehicles ahead, without a search.
//!
//! As in Pylot's waypoint planner, every prediction gives a stop factor by its distance and its angle off the route's
//! direction; the target speed is multiplied by the smallest one. Pylot's angles are in a left-handed frame; here they
//! are positive to the left. Its lane filter needs a map and is omitted.
//!
//! Pylot's factors for vehicles never reach zero, so it creeps until it touches the obstacle. This planner stops before
//! every obstacle that is, or will be, in the ego's corridor along the route: Pylot's factors, and a speed profile that
//! ends at zero there. A `standstill_gap_m` of zero leaves the factors alone.

use std::f64::consts::PI;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{ParamError, Ranges};
use swerve_geom::{angle_between, math};
use swerve_msg::{ActorKind, Plan, PlanStatus, Prediction};
use swerve_vehicle::Limits;

use crate::brake::brake_along;
use crate::path::points::PathPoint;
use crate::path::route::{PATH_STEP_M, route_path};
use crate::path::speed::{SpeedProfile, timed_points};
use crate::request::{Budget, Planner, Progress, Request};

/// Parameters of the waypoint planner. Source of all defaults unless stated otherwise: Pylot's flags.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Distance within which persons slow the ego down, metres.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub person_distance_m: f64,
    /// Largest angle to the route's direction at which persons slow the ego down, radians.
    #[schemars(range(min = 0.001, max = PI))]
    pub person_angle_rad: f64,
    /// Distance within which persons stop the ego, metres.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub person_emergency_distance_m: f64,
    /// Largest angle to the route's direction at which persons stop the ego, radians.
    #[schemars(range(min = 0.001, max = PI))]
    pub person_emergency_angle_rad: f64,
    /// Distance within which vehicles slow the ego down, metres.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub vehicle_distance_m: f64,
    /// Largest angle to the right of the route's direction at which vehicles slow the ego down, radians. To the left it
    /// is multiplied by `0.5 / coast_factor`, because of oncoming traffic.
    #[schemars(range(min = 0.001, max = PI))]
    pub vehicle_angle_rad: f64,
    /// Factor by which distances are extended (at a narrower angle) and speed reductions softened.
    #[schemars(range(min = 0.1, max = 100.0))]
    pub coast_factor: f64,
    /// Number of predicted places that are used, from the first on.
    #[schemars(range(min = 1, max = 10_000))]
    pub predicted_places: u32,
    /// Distance ahead of the route point that defines the route's direction, metres. Source: ours.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub direction_ahead_m: f64,
    /// Deceleration while slowing down, m/s²; stops use full brake. Source: ours.
    #[schemars(range(min = 0.1, max = 20.0))]
    pub comfort_brake_mps2: f64,
    /// Length of the plan, seconds. Source: ours.
    #[schemars(range(min = 0.1, max = 60.0))]
    pub horizon_s: f64,
    /// Speed reductions below this fraction of the target speed are stops. Source: ours.
    #[schemars(range(min = 0.001, max = 1.0))]
    pub stop_below: f64,
    /// Gap at standstill to an obstacle in the corridor, bumper to outline, metres; zero uses the stop factors alone,
    /// as in Pylot. Source: ours.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub standstill_gap_m: f64,
    /// Margin of the corridor on either side of the ego, metres. Source: ours.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub corridor_margin_m: f64,
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
            standstill_gap_m: 4.0,
            corridor_margin_m: 0.3,
        }
    }
}

impl Params {
    /// Fraction of the target speed allowed by a person at `distance_m` and `angle_rad` off the route.
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

    /// Fraction of the target speed allowed by a vehicle at `distance_m` and `angle_rad` off the route.
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

/// The waypoint planner.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Waypoint {
    params: Params,
}

impl Waypoint {
    /// Creates the planner from valid parameters.
    pub fn new(params: Params) -> Result<Self, ParamError> {
        params.check_ranges()?;
        Ok(Self { params })
    }

    /// The smallest factor over the used places of one obstacle.
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

    /// Distance that the ego may drive before one obstacle, metres: to the standstill gap before the first predicted
    /// place in the ego's corridor, plus the obstacle's own full-brake distance from there. `None` if it is never in
    /// the corridor ahead of the ego.
    fn way_before_m(&self, request: &Request<'_>, prediction: &Prediction) -> Option<f64> {
        let shape = request.shape;
        let half_m = 0.5 * shape.width_m + self.params.corridor_margin_m;
        let front_m = request.place().s_m + shape.length_m - shape.rear_overhang_m;
        let in_the_way = |k: &usize| {
            Extents::new(request, prediction, *k).is_some_and(|e| e.right_m < half_m && e.left_m > -half_m)
        };
        let first = (0..prediction.path.len()).find(in_the_way)?;
        let at = Extents::new(request, prediction, first)?;
        if at.to_m <= front_m {
            return None;
        }
        let speed_mps = Extents::new(request, prediction, first + 1).map_or(0.0, |next| {
            let dt_s = (prediction.path[first + 1].at - prediction.path[first].at).as_secs();
            ((next.from_m - at.from_m) / dt_s.max(1e-3)).max(0.0)
        });
        let rolls_m = speed_mps * speed_mps / (2.0 * request.limits.brake_max_mps2);
        Some((at.from_m - front_m - self.params.standstill_gap_m + rolls_m).max(0.0))
    }

    /// Plan along the route at `speed_mps` with a stop after `way_m`: gentle braking if that suffices.
    fn stopping(&self, request: &Request<'_>, path: &[PathPoint], speed_mps: f64, way_m: f64) -> Plan {
        let start_mps = request.start.speed_mps.max(0.0);
        let needed_mps2 = start_mps * start_mps / (2.0 * way_m.max(1e-6));
        if needed_mps2 >= request.limits.brake_max_mps2 {
            return brake_along(request, path, PlanStatus::Route);
        }
        let line = request.route.line();
        let end = line.at(request.place().s_m + way_m);
        let before = (way_m / PATH_STEP_M).ceil().max(1.0) as usize;
        let mut path = path[..before.min(path.len())].to_vec();
        path.push(PathPoint { pose: end.pose, curvature_1pm: end.curvature_1pm });
        let brake_max_mps2 =
            self.params.comfort_brake_mps2.max(needed_mps2).min(request.limits.brake_max_mps2);
        let limits = Limits { brake_max_mps2, ..*request.limits };
        let points = timed_points(&path, &request.start, speed_mps, SpeedProfile::LimitedToStop, &limits);
        Plan { stamp: request.stamp, status: PlanStatus::Route, points, work: 0 }
    }
}

/// Look-ahead time of the obstacle search along the route, seconds.
const LOOK_AHEAD_S: f64 = 8.0;

/// Extent of an obstacle along and beside the route, metres.
struct Extents {
    from_m: f64,
    to_m: f64,
    right_m: f64,
    left_m: f64,
}

impl Extents {
    /// Extent at place `k` of a prediction; `None` beyond its last.
    fn new(request: &Request<'_>, prediction: &Prediction, k: usize) -> Option<Self> {
        let pose = prediction.path.get(k)?.pose;
        let line = request.route.line();
        let at = request
            .place_of(pose.point(), LOOK_AHEAD_S * request.start.speed_mps.max(request.target_speed_mps));
        let (sin, cos) = math::sin_cos(pose.heading_rad - line.at(at.s_m).pose.heading_rad);
        let (length_m, width_m) = (prediction.extent.length_m, prediction.extent.width_m);
        let along_m = 0.5 * (length_m * cos.abs() + width_m * sin.abs());
        let across_m = 0.5 * (length_m * sin.abs() + width_m * cos.abs());
        Some(Self {
            from_m: at.s_m - along_m,
            to_m: at.s_m + along_m,
            right_m: at.d_m - across_m,
            left_m: at.d_m + across_m,
        })
    }
}

impl Planner for Waypoint {
    fn plan(&mut self, request: &Request<'_>, budget: &mut dyn Budget) -> Plan {
        let line = request.route.line();
        let target = line.at(request.place().s_m + self.params.direction_ahead_m).pose;
        let direction_rad = (target.point() - request.start.pose.point()).heading();
        let (mut factor, mut work) = (1.0_f64, 0);
        for prediction in request.predictions {
            work += 1;
            if budget.spend(1) == Progress::Stop {
                break;
            }
            factor = factor.min(self.factor(request, direction_rad, prediction));
        }
        let speed_mps = request.target_speed_mps.max(0.0) * factor;
        let fastest_mps = speed_mps.max(request.start.speed_mps).max(1.0);
        let path = route_path(line, request.place().s_m, fastest_mps * self.params.horizon_s);
        if factor < self.params.stop_below {
            return Plan { work, ..brake_along(request, &path, PlanStatus::Route) };
        }
        if self.params.standstill_gap_m > 0.0 {
            let looked_at = request.predictions.iter().take(work as usize);
            let ways_m = looked_at.filter_map(|prediction| self.way_before_m(request, prediction));
            let way_m = ways_m.fold(f64::INFINITY, f64::min);
            if way_m < (path.len() - 1) as f64 * PATH_STEP_M {
                return Plan { work, ..self.stopping(request, &path, speed_mps, way_m) };
            }
        }
        let brake_max_mps2 = self.params.comfort_brake_mps2.min(request.limits.brake_max_mps2);
        let limits = Limits { brake_max_mps2, ..*request.limits };
        let points = timed_points(&path, &request.start, speed_mps, SpeedProfile::Limited, &limits);
        Plan { stamp: request.stamp, status: PlanStatus::Route, points, work }
    }
}

#[cfg(test)]
mod tests {
    use swerve_vehicle::Shape;

    use super::*;
    use crate::request::Unlimited;
    use crate::testing::{World, conformance};

    /// Parameters without the stop before obstacles.
    fn factors_alone() -> Params {
        Params { standstill_gap_m: 0.0, ..Params::default() }
    }

    fn last_speed(world: &World) -> f64 {
        let mut planner = Waypoint::new(factors_alone()).unwrap();
        let plan = planner.plan(&world.request(), &mut Unlimited::default());
        plan.points[plan.points.len() - 1].speed_mps
    }

    #[test]
    fn factors_match_the_originals() {
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
    fn waypoint_slows_only_for_obstacles_ahead() {
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

    fn planned(world: &World) -> Plan {
        let mut planner = Waypoint::new(Params::default()).unwrap();
        planner.plan(&world.request(), &mut Unlimited::default())
    }

    /// Stopping position of the front bumper, metres ahead of its current position.
    fn stop_m(world: &World) -> f64 {
        let plan = planned(world);
        let last = plan.points[plan.points.len() - 1];
        assert!(last.speed_mps < 1e-5);
        last.pose.x_m - world.start.pose.x_m
    }

    #[test]
    fn conforms() {
        conformance(&|| Waypoint::new(Params::default()).unwrap(), false);
    }

    #[test]
    fn waypoint_stops_at_its_gap_before_standing_obstacles() {
        // Bumper to tail: 40 - 2.25 minus the front overhang and wheelbase; 4 m of that are kept.
        let shape = Shape::default();
        let front_m = shape.length_m - shape.rear_overhang_m;
        let car = (ActorKind::Car, (4.5, 1.9));
        let ahead = World::straight(10.0).with(car.0, car.1, (40.0, 0.0), (0.0, 0.0));
        assert!((stop_m(&ahead) - (40.0 - 2.25 - front_m - 4.0)).abs() < 1e-6);
        // The corridor is half the ego's width plus 0.3 m: just inside, and just outside.
        let edge_m = 0.5 * shape.width_m + 0.3 + 0.5 * 1.9;
        let inside = World::straight(10.0).with(car.0, car.1, (40.0, -edge_m + 0.01), (0.0, 0.0));
        assert!((stop_m(&inside) - stop_m(&ahead)).abs() < 1e-6);
        let beside = World::straight(10.0).with(car.0, car.1, (40.0, -edge_m - 0.01), (0.0, 0.0));
        assert!(planned(&beside).points.iter().all(|p| p.speed_mps > 1.0));
        let behind = World::straight(10.0).with(car.0, car.1, (-8.0, 0.0), (0.0, 0.0));
        assert!(planned(&behind).points.iter().all(|p| p.speed_mps == 10.0));
    }

    #[test]
    fn waypoint_brakes_as_hard_as_necessary() {
        let front_m = Shape::default().length_m - Shape::default().rear_overhang_m;
        // 10 m/s within 10 m: 5 m/s², between comfort and full brake.
        let ahead = World::straight(10.0).with(ActorKind::Car, (4.0, 1.9), (front_m + 16.0, 0.0), (0.0, 0.0));
        assert!((stop_m(&ahead) - 10.0).abs() < 1e-6);
        let plan = planned(&ahead);
        let hardest = plan.points.iter().map(|p| p.accel_mps2).fold(0.0, f64::min);
        assert!((hardest + 5.0).abs() < 1e-6, "{hardest}");
        // Within 5 m that is impossible: full brake, v² / 2b.
        let near = World::straight(10.0).with(ActorKind::Car, (4.0, 1.9), (front_m + 11.0, 0.0), (0.0, 0.0));
        let b = near.limits.brake_max_mps2;
        assert!((stop_m(&near) - 100.0 / (2.0 * b)).abs() < 1e-6);
    }

    #[test]
    fn waypoint_accounts_for_the_braking_distance_of_a_lead() {
        let front_m = Shape::default().length_m - Shape::default().rear_overhang_m;
        let lead = |v: f64| {
            let world =
                World::straight(10.0).with(ActorKind::Car, (4.0, 1.9), (front_m + 20.0, 0.0), (v, 0.0));
            (stop_m(&world), world.limits.brake_max_mps2)
        };
        let ((standing_m, _), (moving_m, b)) = (lead(0.0), lead(6.0));
        assert!((moving_m - standing_m - 36.0 / (2.0 * b)).abs() < 1e-6);
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let wrong = Waypoint::new(Params { coast_factor: f64::NAN, ..Params::default() }).unwrap_err();
        assert_eq!(wrong.key, "coast_factor");
    }
}
