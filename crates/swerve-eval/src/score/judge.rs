//! From the facts of each step of a drive to the record of its route.
//!
//! Source: `srunner/scenariomanager/scenarioatomics/atomic_criteria.py` and `srunner/scenariomanager/timer.py` of
//! `carla-simulator/scenario_runner`, branches `leaderboard-1.0` and `leaderboard-2.0`. The Leaderboard measures progress
//! by the points of its route, about a metre apart, here it is an arc length; facts about lanes come from the caller.

mod facts;
mod progress;
mod red_light;
mod stop_sign;
#[cfg(test)]
mod tests;

use std::collections::BTreeSet;

use swerve_geom::{Point2, Pose2};

use super::leaderboard::{Collisions, Contact, Counts, RouteRecord, Version};
use super::rounded;

pub use facts::{
    Ego, EmergencyVehicle, Ending, JudgedRoute, RedLight, RoutePlace, StepFacts, StopSign, Touch,
};
use progress::{Deviation, MinSpeed, OutsideLanes, Timeout};
use red_light::RunLights;
use stop_sign::StopSigns;

/// Speed below which the ego stands, m/s.
const STANDS_MPS: f64 = 0.1;
/// Time of standing that is a block, seconds.
const BLOCKED_S: f64 = 180.0;
/// Time for a scenario on the route (2.x), seconds.
const SCENARIO_S: f64 = 240.0;
/// Share of the route from which on its end counts as reached, percent, and distance from the end, metres.
const REACHED: (f64, f64) = (99.0, 10.0);

/// Judge of one route by the rules of one version of the Leaderboard.
#[derive(Clone, Debug)]
pub struct RouteJudge {
    version: Version,
    route: JudgedRoute,
    counts: Counts,
    /// Largest arc length reached, metres.
    s_m: f64,
    collisions: Collisions,
    outside: OutsideLanes,
    red_lights: RunLights,
    stop_signs: StopSigns,
    min_speed: MinSpeed,
    deviation: Deviation,
    timeout: Timeout,
    /// Last instant at which the ego was not standing, seconds.
    moved_s: Option<f64>,
    /// Scenarios that took too long.
    late: BTreeSet<u64>,
    ending: Option<Ending>,
}

impl RouteJudge {
    /// Creates a judge for a route that has not begun.
    pub fn new(version: Version, route: JudgedRoute) -> Self {
        Self {
            version,
            route,
            counts: Counts::default(),
            s_m: 0.0,
            collisions: Collisions::new(version),
            outside: OutsideLanes::new(version),
            red_lights: RunLights::new(version),
            stop_signs: StopSigns::new(version),
            min_speed: MinSpeed::new(&route),
            deviation: Deviation::new(route.length_m),
            timeout: Timeout::new(version, route.length_m),
            moved_s: None,
            late: BTreeSet::new(),
            ending: None,
        }
    }

    /// Adds the next step; returns how the route ended, if it has. Steps after the end do not count.
    pub fn take(&mut self, facts: &StepFacts<'_>) -> Option<Ending> {
        if self.ending.is_some() {
            return self.ending;
        }
        let before_m = self.s_m;
        self.s_m = before_m.max(facts.place.s_m.clamp(0.0, self.route.length_m));
        let advance_m = self.s_m - before_m;
        self.contacts(facts);
        self.outside.take(&facts.place, advance_m);
        self.counts.red_light += self.red_lights.take(&facts.ego, facts.red_lights);
        self.counts.stop_infraction += self.stop_signs.take(&facts.ego, &facts.place, facts.stop_signs);
        self.min_speed.take(self.s_m, facts.ego.speed_mps, facts.traffic_mps);
        self.scenarios(facts);
        self.ending = self.ended(facts, advance_m);
        self.ending
    }

    /// Judges an emergency vehicle at the end of its scenario: the ego has let it pass unless it is still behind the ego.
    pub fn emergency_ends(&mut self, ego: Point2, vehicle: EmergencyVehicle) {
        let EmergencyVehicle(pose) = vehicle;
        if self.version.is_second() && pose.direction().dot(ego - pose.point()) > 0.0 {
            self.counts.yield_emergency_vehicle_infractions += 1;
        }
    }

    /// Record of the route so far, with the last section of the minimum speed if the ego has come close to the end.
    pub fn record(&self) -> RouteRecord {
        let percent = self.completed_percent();
        RouteRecord {
            route_length_m: if self.version.is_second() {
                rounded(self.route.length_m, 3)
            } else {
                self.route.length_m
            },
            route_completion: if self.ending == Some(Ending::Completed) { 100.0 } else { percent },
            counts: self.counts,
            outside_route_lanes_percent: self.outside.percent(),
            min_speed_checkpoints_percent: if self.version.is_second() {
                self.min_speed.percentages(self.s_m)
            } else {
                Vec::new()
            },
            failure: None,
        }
    }

    /// Share of the route driven, percent; 2.x rounds it to two decimals.
    fn completed_percent(&self) -> f64 {
        let percent = self.s_m / self.route.length_m * 100.0;
        if self.version.is_second() { rounded(percent, 2) } else { percent }
    }

    fn contacts(&mut self, facts: &StepFacts<'_>) {
        let Ego { center, speed_mps, .. } = facts.ego;
        self.collisions.step(facts.at_s, center.point());
        for touch in facts.touches {
            let contact = Contact {
                at_s: facts.at_s,
                other: touch.other,
                ego: center.point(),
                ego_speed_mps: speed_mps,
            };
            if self.collisions.counts(&contact) {
                touch.kind.count(&mut self.counts);
            }
        }
    }

    fn scenarios(&mut self, facts: &StepFacts<'_>) {
        if !self.version.is_second() {
            return;
        }
        for (id, since_s) in facts.scenarios {
            if facts.at_s - since_s > SCENARIO_S && self.late.insert(*id) {
                self.counts.scenario_timeouts += 1;
            }
        }
    }

    fn ended(&mut self, facts: &StepFacts<'_>, advance_m: f64) -> Option<Ending> {
        let (percent, near_m) = REACHED;
        if self.completed_percent() > percent && facts.place.to_end_m < near_m {
            return Some(Ending::Completed);
        }
        let moved_s = *self.moved_s.get_or_insert(facts.at_s);
        if facts.ego.speed_mps >= STANDS_MPS {
            self.moved_s = Some(facts.at_s);
        } else if facts.at_s - moved_s > BLOCKED_S {
            self.counts.vehicle_blocked += 1;
            return Some(Ending::Blocked);
        }
        if self.deviation.take(facts.place.off_route_m, advance_m) {
            self.counts.route_dev += 1;
            return Some(Ending::Deviated);
        }
        if self.timeout.take(facts.at_s, advance_m, facts.place.limit_mps) {
            self.counts.route_timeout += 1;
            return Some(Ending::TimedOut);
        }
        None
    }
}

/// Angle between the heading of a pose and a direction, as the cosine.
fn alignment(pose: Pose2, heading_rad: f64) -> f64 {
    swerve_geom::math::cos(swerve_geom::angle_between(pose.heading_rad, heading_rad))
}
