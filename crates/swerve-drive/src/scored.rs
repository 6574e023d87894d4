//! Driving scores of a drive on a map, from its world states.
//!
//! The route is the first one of the ego, from its start to the goal. Facts about lanes, lights and signs are those of
//! the map; nothing is taken from the stack.

mod lanes;
mod stops;
#[cfg(test)]
mod tests;

use std::collections::BTreeSet;

use swerve_core::{Span, Time};
use swerve_eval::comfort::limits;
use swerve_eval::score::leaderboard::Struck;
use swerve_eval::score::nuplan::{self, FreeDriver, Progress, Step, Track, TrackKind, expert_progress_m};
use swerve_eval::score::{DriveFacts, DriveJudge, DrivingScores, Ego, RoutePlace, StepFacts, Touch};
use swerve_geom::{Obb, Point2, Pose2, Vector2};
use swerve_msg::truth::{Actor, WorldState};
use swerve_msg::{ActorId, ActorKind, Route};
use swerve_scenario::{Course, Scenario, Slippery};
use swerve_vehicle::Shape;

use lanes::Lanes;
use stops::Stops;

/// Interval of the steps that the Leaderboard's rules see: its simulation has 20 Hz.
const STEP: Span = Span::from_ms(50);
/// Interval of nuPlan's samples.
const SAMPLE: Span = Span::from_ms(100);
/// Distance of outlines up to which a contact lasts, metres.
const CONTACT_M: f64 = 0.05;
/// First identity of the scenarios of patches, above those of all actors.
const FIRST_PATCH: u64 = 1 << 32;
/// Distance beyond the start of a scripted actor, or the end of a patch, at which its scenario is passed, metres.
const PASSED_M: f64 = 20.0;
/// Speed above which a scripted actor has begun to move, m/s.
const MOVES_MPS: f64 = 0.1;
/// Distance of road users that can touch the ego within 1 s, above which the time to collision costs nothing, metres.
const TRACKS_M: f64 = 80.0;
/// Time after its cause for which an emergency lasts, seconds: a stop from 50 km/h with 8 m/s² takes 1.7 s.
const EMERGENCY_S: f64 = 2.0;
/// Search range for the ego along the route in one step, metres: who leaves the route does not come to a later part of it.
const REACH_M: f64 = 15.0;
/// Search range along the route for points ahead of the ego, metres.
const AHEAD_M: f64 = 60.0;

/// Judge of one ego's drive.
#[derive(Debug)]
pub(crate) struct Scored {
    judge: DriveJudge,
    lanes: Lanes,
    stops: Stops,
    route: Route,
    start_m: f64,
    length_m: f64,
    start_mps: f64,
    target_mps: f64,
    /// Arc length along the route, metres.
    s_m: f64,
    shape: Shape,
    /// Identities of the background traffic.
    background: core::ops::Range<u32>,
    running: Vec<Running>,
    /// Parties that the ego touches.
    touching: BTreeSet<ActorId>,
    next_step: Time,
    next_sample: Time,
    emergency_until: Option<Time>,
    now: Time,
}

/// A scenario on the route that the ego has not passed.
#[derive(Clone, Debug)]
struct Running {
    /// Identity among the scenarios.
    id: u64,
    cause: Cause,
    /// Position of the start of its actor, or of the end of its patch, along the route, metres.
    s_m: f64,
    /// Instant at which it began, seconds.
    since_s: Option<f64>,
}

/// Event that begins a scenario on the route.
#[derive(Clone, Debug)]
enum Cause {
    /// First motion of an actor with a trigger.
    Actor(ActorId),
    /// First contact of the ego with a slippery patch.
    Patch(Slippery),
}

impl Cause {
    fn has_begun(&self, world: &WorldState, outline: &Obb) -> bool {
        match self {
            Self::Actor(id) => world.actor(*id).is_some_and(|actor| actor.velocity_mps.norm() > MOVES_MPS),
            Self::Patch(patch) => outline.corners().iter().any(|corner| patch.contains(*corner)),
        }
    }
}

/// Arc length of the place of a route that is nearest to a point. Its first and last lanes are not continued beyond their
/// ends, as [`Route::project`] does: on the way around a block such a line may come nearer.
fn place_on(route: &Route, point: Point2) -> f64 {
    let half_m = 0.5 * route.line().length();
    let places = route.line().places_near(point, half_m, half_m);
    let on_route = places.filter(|place| (0.0..=2.0 * half_m).contains(&place.s_m));
    let nearest = on_route.min_by(|a, b| a.d_m.abs().total_cmp(&b.d_m.abs()));
    nearest.unwrap_or_else(|| route.project(point)).s_m
}

/// Scenarios on a route: actors with a trigger, and slippery patches.
fn scenarios_on(route: &Route, scenario: &Scenario) -> Vec<Running> {
    let line = scenario.road.line();
    let triggered = scenario.actors.iter().filter(|actor| actor.trigger.is_some());
    let actors = triggered.map(|actor| {
        // A route may pass a place twice: an actor that has a place along it is there.
        let s_m = match actor.line {
            None => actor.s_m,
            Some(_) => place_on(route, actor.pose(&line).point()),
        };
        Running { id: u64::from(actor.id.0), cause: Cause::Actor(actor.id), s_m, since_s: None }
    });
    let patches = (FIRST_PATCH..).zip(&scenario.slippery).map(|(id, patch)| {
        let end = patch.line.at(patch.line.length()).pose.point();
        Running { id, cause: Cause::Patch(patch.clone()), s_m: place_on(route, end), since_s: None }
    });
    actors.chain(patches).collect()
}

impl Scored {
    /// Judges the ego of a scenario on its first route; `None` without a map.
    pub(crate) fn new(scenario: &Scenario, route: &Route, shape: Shape) -> Option<Self> {
        let Course::Map(course) = &scenario.road.course else { return None };
        let start = &scenario.ego;
        let length_m = start.end_m - start.s_m;
        if length_m <= 0.0 {
            return None;
        }
        let background = scenario.traffic.map_or(0..0, |traffic| {
            traffic.first_id.0..traffic.first_id.0.saturating_add(traffic.count() as u32)
        });
        Some(Self {
            judge: DriveJudge::new(length_m),
            lanes: Lanes::new(course),
            stops: Stops::new(&course.map, &scenario.road.lights, route),
            start_m: start.s_m,
            length_m,
            start_mps: start.start_speed(),
            target_mps: start.target_speed_mps,
            s_m: start.s_m,
            shape,
            background,
            running: scenarios_on(route, scenario),
            route: route.clone(),
            touching: BTreeSet::new(),
            next_step: Time::ZERO,
            next_sample: Time::ZERO,
            emergency_until: None,
            now: Time::ZERO,
        })
    }

    /// Adds the world state after one step.
    pub(crate) fn take(&mut self, world: &WorldState) {
        self.now = world.stamp;
        let outline = self.shape.footprint(world.ego.state.pose);
        let hit_mps = world.collisions_of_ego().map(|(_, hit)| hit.speeds_mps[0]).reduce(f64::max);
        let is_step = world.stamp >= self.next_step;
        if is_step {
            self.next_step = world.stamp + STEP;
        }
        if is_step || hit_mps.is_some() || world.ended.is_some() {
            self.step(world, &outline, hit_mps);
        }
        if world.stamp >= self.next_sample {
            self.next_sample = world.stamp + SAMPLE;
            self.sample(world, &outline);
        }
    }

    /// Scores so far.
    pub(crate) fn scores(&self) -> DrivingScores {
        let limit =
            |limit_mps: Option<f64>| limit_mps.map_or(self.target_mps, |mps| mps.min(self.target_mps));
        let stretches = self.route.stretches().iter();
        let limits: Vec<(f64, f64)> =
            stretches.map(|at| (at.begin_m - self.start_m, limit(at.speed_limit_mps))).collect();
        let motion = (self.start_mps, self.now.as_secs());
        let expert_m = expert_progress_m(self.length_m, &limits, motion, FreeDriver::default());
        self.judge.scores(Progress { ego_m: self.s_m - self.start_m, expert_m })
    }

    fn step(&mut self, world: &WorldState, outline: &Obb, hit_mps: Option<f64>) {
        let touches = self.touches(world, outline);
        let place = self.place(outline.center);
        let at_s = world.stamp.as_secs();
        let scenarios = self.scenarios(world, outline, at_s);
        let forward_mps = world.ego.state.speed_mps;
        let ego = Ego {
            center: outline.center,
            half_length_m: outline.half_length_m,
            // A contact is judged by the speed before it.
            speed_mps: hit_mps.map_or(forward_mps.abs(), f64::abs),
            forward_mps,
        };
        let own_s_m = self.s_m;
        let facts = StepFacts {
            at_s,
            ego,
            place,
            touches: &touches,
            red_lights: &self.stops.red_lights(world.stamp, &ego, &self.lanes),
            stop_signs: &self.stops.signs(outline.center, own_s_m),
            traffic_mps: self.traffic_mps(world),
            scenarios: &scenarios,
        };
        let _endings = self.judge.take(&facts);
    }

    /// Contacts: those that begin, and those that last.
    fn touches(&mut self, world: &WorldState, outline: &Obb) -> Vec<Touch> {
        self.touching.retain(|id| world.actor(*id).is_some_and(|actor| actor.gap_m(outline) <= CONTACT_M));
        self.touching.extend(world.collisions_of_ego().map(|(id, _)| id));
        let touch = |id: &ActorId| {
            let kind = match world.actor(*id)?.kind {
                ActorKind::Pedestrian => Struck::Pedestrian,
                ActorKind::Static => Struck::Layout,
                _ => Struck::Vehicle,
            };
            Some(Touch { other: Some(u64::from(id.0)), kind })
        };
        self.touching.iter().filter_map(touch).collect()
    }

    fn place(&mut self, center: Pose2) -> RoutePlace {
        let point = center.point();
        self.s_m = self.route.project_near(point, self.s_m, REACH_M).s_m;
        let on_route = self.route.line().at(self.s_m).pose.point();
        let end = self.route.line().at(self.start_m + self.length_m).pose.point();
        let lane = self.lanes.at(center);
        RoutePlace {
            s_m: self.s_m - self.start_m,
            off_route_m: on_route.distance(point),
            to_end_m: end.distance(point),
            off_lanes_m: lane.off_m,
            against_traffic: lane.is_against,
            lane_heading_rad: lane.heading_rad,
            limit_mps: lane.limit_mps.unwrap_or(self.target_mps),
        }
    }

    /// Scenarios that are running: from the first motion of their actor, or contact with their patch, until the ego has
    /// passed them.
    fn scenarios(&mut self, world: &WorldState, outline: &Obb, at_s: f64) -> Vec<(u64, f64)> {
        let own_m = self.s_m;
        self.running.retain(|one| own_m <= one.s_m + PASSED_M);
        for one in self.running.iter_mut().filter(|one| one.since_s.is_none()) {
            one.since_s = one.cause.has_begun(world, outline).then_some(at_s);
        }
        self.running.iter().filter_map(|one| Some((one.id, one.since_s?))).collect()
    }

    /// Mean speed of the vehicles of the background traffic, m/s.
    fn traffic_mps(&self, world: &WorldState) -> Option<f64> {
        let is_one = |actor: &&Actor| {
            self.background.contains(&actor.id.0)
                && !matches!(actor.kind, ActorKind::Pedestrian | ActorKind::Static)
        };
        let speeds = world.actors.iter().filter(is_one).map(|actor| actor.velocity_mps.norm());
        let (sum, count) = speeds.fold((0.0, 0_u32), |(sum, count), speed| (sum + speed, count + 1));
        (count > 0).then(|| sum / f64::from(count))
    }

    fn sample(&mut self, world: &WorldState, outline: &Obb) {
        let state = &world.ego.state;
        if self.is_emergency(world, outline) {
            self.emergency_until = Some(world.stamp + Span::from_secs(EMERGENCY_S));
        }
        let near = |actor: &&Actor| actor.pose.point().distance(outline.center.point()) <= TRACKS_M;
        let tracks = world.actors.iter().filter(near).map(track).collect();
        let ego = nuplan::EgoState {
            rear_axle: state.pose,
            outline: *outline,
            speed_mps: state.speed_mps.abs(),
            lon_accel_mps2: state.accel_mps2,
            lat_accel_mps2: state.lateral_accel_mps2,
        };
        self.judge.sample(DriveFacts {
            step: Step { ego, tracks, lane: self.lanes.facts(state.pose, outline) },
            yaw_rate_radps: state.yaw_rate_radps,
            is_emergency: self.emergency_until.is_some_and(|until| world.stamp <= until),
        });
    }

    /// True if the ego touches an actor, or would do so at constant velocities while still in its lane, unless one of
    /// the two slows down by more than is comfortable.
    fn is_emergency(&self, world: &WorldState, outline: &Obb) -> bool {
        let own = world.ego.velocity_mps.coords;
        let own = Vector2::new(own.x, own.y);
        let [comfortable_mps2, _] = limits::LON_ACCEL;
        let needs_more = |actor: &Actor| {
            let Some(left_s) = actor.time_to_contact_s(outline, own) else { return false };
            let closing_mps = (actor.velocity_mps - own).norm();
            if closing_mps <= 2.0 * left_s * -comfortable_mps2 {
                return false;
            }
            let there = outline.center.point() + own * left_s;
            self.route.lane().contains(self.route.project_near(there, self.s_m, AHEAD_M))
        };
        !self.touching.is_empty() || world.actors.iter().any(needs_more)
    }
}

fn track(actor: &Actor) -> Track {
    let kind = match actor.kind {
        ActorKind::Pedestrian | ActorKind::Cyclist => TrackKind::Vru,
        ActorKind::Static => TrackKind::Object,
        _ => TrackKind::Vehicle,
    };
    Track {
        id: u64::from(actor.id.0),
        kind,
        outline: actor.footprint(),
        speed_mps: actor.velocity_mps.norm(),
    }
}
