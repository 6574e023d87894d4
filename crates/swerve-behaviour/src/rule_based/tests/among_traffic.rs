//! Drives of the ego among simulated traffic: it follows the vehicle ahead and stops where it is told to.

use swerve_core::{Span, Time};
use swerve_geom::{Obb, Transform, Vector};
use swerve_map::Aspect;
use swerve_msg::truth::{EgoTruth, WorldState};
use swerve_msg::{EgoState, PredictedPose, Prediction};
use swerve_road_user::idm::Idm;
use swerve_traffic::{Lights, Traffic, TrafficActor, TrafficSetup};

use super::posed::Posed;
use super::*;

const DRIVER: Idm = Idm { gain_mps2: 1.5, brake_mps2: 2.0, headway_s: 1.2, stand_gap_m: 2.0 };
/// Distance of the ego's front before a place to stop at which it comes to rest, metres.
const BEFORE_M: f64 = 0.7;
const TICK_S: f64 = 0.1;
/// Deceleration that counts as hard, m/s².
const HARD_MPS2: f64 = 4.0;
/// Half of the width of the ego's way, metres.
const HALF_WAY_M: f64 = 1.3;
/// Distance from the ego within which others are looked at, metres.
const NEAR_M: f64 = 30.0;

/// Aspect of a light: green for 15 s of 40 s, in turn for the two axes of the map.
fn aspect(heading_rad: f64, now: Time) -> Aspect {
    let along_y = math::sin(heading_rad).abs() > 0.7;
    match (now.as_secs() + if along_y { 20.0 } else { 0.0 }) % 40.0 {
        s if s < 15.0 => Aspect::Green,
        s if s < 18.0 => Aspect::Yellow,
        _ => Aspect::Red,
    }
}

#[derive(Debug, Default)]
struct Outcome {
    took_s: f64,
    /// Ticks in which the ego touches somebody, and those in which it brakes harder than 4 m/s².
    touches: usize,
    hard: usize,
    changes: usize,
    /// Ticks in which somebody near the ego brakes harder than 4 m/s².
    forced: usize,
    /// Number of times that the ego moves up.
    creeps: usize,
    /// Time of all drives, seconds.
    total_s: f64,
}

struct Ride {
    posed: Posed,
    traffic: Traffic,
    now: Time,
    /// True if it obeys all stops, false if only those at lights.
    obeys: bool,
}

impl Ride {
    fn new(file: &str, way: [i32; 2], seed: u64, obeys: bool, creep_mps: f64) -> Self {
        let mut posed = Posed::on(file).route(on_arm(way[0], -130.0), on_arm(way[1], 100.0));
        posed = posed.ego(on_arm(way[0], -110.0), 0.0, 8.0);
        posed.planner = RuleBased::new(RuleBasedParams { creep_mps, ..RuleBasedParams::default() });
        let map = Arc::clone(&posed.map);
        let of_map = Arc::clone(&map);
        let lights = Lights::new(move |id, at| {
            of_map.signal(id).map_or(Aspect::Off, |signal| aspect(signal.heading_rad, at))
        });
        let setup = TrafficSetup { vehicles: 20, first_id: 1, ..TrafficSetup::default() };
        let reserved = Obb::new(posed.route.line().at(posed.front_m - 2.5).pose, 40.0, 3.0);
        let traffic = Traffic::new(map, &setup, lights, seed, &[reserved]);
        Self { posed, traffic, now: Time::ZERO, obeys }
    }

    fn body(&self) -> Obb {
        let shape = swerve_vehicle::Shape::default();
        let pose = self.posed.route.line().at(self.posed.front_m - 0.5 * shape.length_m).pose;
        Obb::new(pose, shape.length_m, shape.width_m)
    }

    /// Everybody else, at constant speed along their headings.
    fn predictions(&self) -> Vec<Prediction> {
        let predicted = |actor: &TrafficActor| {
            let movement = self.traffic.movement(actor.id, self.now)?;
            let at = |k: i64| PredictedPose {
                at: self.now + Span::from_ms(200 * k),
                pose: movement.pose.ahead(movement.velocity_mps.norm() * 0.2 * k as f64),
            };
            Some(Prediction::single(actor.id, actor.kind, actor.extent, (0..10).map(at).collect()))
        };
        self.traffic.actors().iter().filter_map(predicted).collect()
    }

    fn lights(&self) -> TrafficLights {
        let seen = |signal: &swerve_map::Signal| TrafficLight {
            signal: Some(match aspect(signal.heading_rad, self.now) {
                Aspect::Green => Signal::Green,
                Aspect::Yellow => Signal::Yellow,
                _ => Signal::Red,
            }),
            stop_s_m: self.posed.route.stop_s_m(&self.posed.map, signal),
            ..TrafficLight::default()
        };
        TrafficLights { stamp: self.now, lights: self.posed.map.signals().iter().map(seen).collect() }
    }

    /// Gap to the nearest vehicle ahead of which a corner is on the ego's way, and its speed: one that drives along or
    /// stands.
    fn lead(&self) -> Option<(f64, f64)> {
        let ahead = self.posed.others.iter().filter_map(|one| {
            let pose = one.path[0].pose;
            let route = &self.posed.route;
            let near = |point| route.project_near(point, self.posed.front_m, 60.0);
            let (place, speed_mps) = (near(pose.point()), others::speed_mps(one));
            let line_rad = route.line().at(place.s_m).pose.heading_rad;
            let is_along = swerve_geom::angle_between(line_rad, pose.heading_rad).abs() < 0.8;
            let corners = one.extent.footprint(pose).corners().map(near);
            let on = corners.iter().chain([&place]).filter(|at| at.d_m.abs() < HALF_WAY_M);
            let first_m = on.map(|at| at.s_m).fold(f64::INFINITY, f64::min);
            let is_ahead = place.s_m > self.posed.front_m && first_m.is_finite();
            let gap_m = (first_m - self.posed.front_m).max(0.1);
            (is_ahead && (is_along || speed_mps < REST_MPS)).then_some((gap_m, speed_mps))
        });
        ahead.min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Speed that bends ahead allow, m/s.
    fn free_mps(&self) -> f64 {
        let line = self.posed.route.line();
        let bend_mps = |k: usize| {
            let bend_1pm = line.at(self.posed.front_m + f64::from(k as u32)).curvature_1pm.abs();
            (2.5 / bend_1pm.max(1e-3)).sqrt().max(3.0)
        };
        (0..12).map(bend_mps).fold(9.0, f64::min)
    }

    fn drive(mut self) -> Outcome {
        let mut outcome = Outcome::default();
        let end_m = self.posed.route.project(self.posed.end.point()).s_m - 40.0;
        let (mut stopped, mut crept) = (false, false);
        while self.posed.front_m < end_m && outcome.took_s < 240.0 {
            let before: Vec<f64> = self.posed.others.iter().map(others::speed_mps).collect();
            self.posed.others = self.predictions();
            let body = self.body();
            let brakes = |(v, one): &(&f64, &Prediction)| {
                let is_near = one.path[0].pose.point().distance(body.center.point()) < NEAR_M;
                is_near && *v - others::speed_mps(one) > HARD_MPS2 * TICK_S
            };
            outcome.forced += before.iter().zip(&self.posed.others).filter(brakes).count();
            self.posed.lights = Some(self.lights());
            let decision = self.posed.decide();
            let obeyed = |stop: &&StopPoint| self.obeys || stop.cause == StopReason::TrafficLight;
            let stop = decision.stops.iter().find(obeyed);
            outcome.changes += usize::from(stop.is_some() != stopped);
            stopped = stop.is_some();
            let creeps = decision.state == Some(DrivingState::Creep);
            outcome.creeps += usize::from(creeps && !crept);
            crept = creeps;
            let v = self.posed.speed_mps;
            let wall = stop.map(|stop| (stop.s_m - BEFORE_M - self.posed.front_m + DRIVER.stand_gap_m, 0.0));
            let free_mps = self.free_mps().min(decision.speed_mps(self.posed.front_m, 2.0));
            let gain = |next| DRIVER.acceleration_mps2(v, free_mps, next);
            let gain_mps2 = gain(self.lead()).min(gain(wall)).clamp(-8.0, 1.5);
            outcome.hard += usize::from(gain_mps2 < -HARD_MPS2);
            self.posed.speed_mps = (v + TICK_S * gain_mps2).max(0.0);
            self.posed.front_m += TICK_S * self.posed.speed_mps;
            self.now += Span::from_ms(100);
            outcome.took_s += TICK_S;
            self.observe(&mut outcome);
        }
        outcome
    }

    /// Lets the traffic see the ego, and looks who touches it.
    fn observe(&mut self, outcome: &mut Outcome) {
        let body = self.body();
        let velocity = body.center.direction() * self.posed.speed_mps;
        let world = WorldState {
            stamp: self.now,
            ego: EgoTruth {
                id: ActorId::EGO,
                map_from_ego: Transform::new(
                    swerve_geom::Point::new(body.center.x_m, body.center.y_m, 0.0),
                    Default::default(),
                ),
                state: EgoState { stamp: self.now, pose: body.center, ..EgoState::default() },
                velocity_mps: Vector::new(velocity.x, velocity.y, 0.0),
                specific_force_mps2: Vector::new(0.0, 0.0, 0.0),
                angular_velocity_radps: Vector::new(0.0, 0.0, 0.0),
            },
            actors: Vec::new(),
            collisions: Vec::new(),
            infractions: Vec::new(),
            ended: None,
        };
        self.traffic.observe(&world, body);
        let touches = |actor: &TrafficActor| {
            let movement = self.traffic.movement(actor.id, self.now);
            movement.is_some_and(|movement| actor.extent.footprint(movement.pose).overlaps(&body))
        };
        outcome.touches += self.traffic.actors().iter().filter(|actor| touches(actor)).count();
    }
}

/// Drives over four maps; the sums of their outcomes, with the longest time.
fn rides(obeys: bool, creep_mps: f64) -> Outcome {
    let files = ["crossing_right_first.xodr", "crossing_priority.xodr", "crossing.xodr", "roundabout.xodr"];
    let straight = [FROM_NORTH, FROM_NORTH];
    let ways = [[FROM_WEST, FROM_WEST], straight, [FROM_SOUTH, FROM_EAST], [FROM_SOUTH, FROM_WEST]];
    let mut sums = Outcome::default();
    for file in files {
        for (seed, way) in (1..=2).flat_map(|seed| ways.map(|way| (seed, way))) {
            let outcome = Ride::new(file, way, seed, obeys, creep_mps).drive();
            sums.forced += outcome.forced;
            sums.creeps += outcome.creeps;
            sums.total_s += outcome.took_s;
            sums.took_s = sums.took_s.max(outcome.took_s);
            sums.touches += outcome.touches;
            sums.hard += outcome.hard;
            sums.changes += outcome.changes;
        }
    }
    sums
}

#[test]
fn ego_passes_junctions_in_dense_traffic_without_contact() {
    let outcome = rides(true, RuleBasedParams::default().creep_mps);
    assert_eq!(outcome.touches, 0, "{outcome:?}");
    assert!(outcome.took_s < 150.0, "{outcome:?}");
    // 32 drives: about one stop and start each.
    assert!(outcome.changes < 32 * 4, "{outcome:?}");
    // From where it has moved up to, it goes earlier, and nobody brakes harder for it.
    let stays = rides(true, 0.0);
    assert!(outcome.creeps > 8 && stays.creeps == 0, "{outcome:?} and {stays:?}");
    assert!(outcome.total_s < stays.total_s, "{outcome:?} and {stays:?}");
    assert!(outcome.forced <= stays.forced, "{outcome:?} and {stays:?}");
    // An ego that stops at lights alone brakes hard for those with priority.
    let regardless = rides(false, 0.0);
    assert!(2 * outcome.hard < regardless.hard, "{outcome:?} and {regardless:?}");
}
