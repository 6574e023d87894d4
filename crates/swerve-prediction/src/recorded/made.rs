//! Synthetic recordings: a crossing with lights, cars by the intelligent driver model, and pedestrians who avoid each
//! other.
//!
//! Each of the four approaches has a lane in either direction. Cars drive straight on, left or right, keep their
//! distance, and stop for red lights and for road users on the road. Pedestrians walk between random places by
//! reciprocal avoidance, and occasionally stop or change their goal.

use std::collections::BTreeMap;

use swerve_core::{Rng, Span};
use swerve_geom::{Point2, Vector2, math};
use swerve_msg::{ActorId, ActorKind, Extent};
use swerve_road_user::idm::{Idm, STAND_GAP_M};

use super::{RecordedTrack, Recording};
use crate::predictor::orca::{self, Agent};

/// Step of the simulation, and number of steps between two recorded ones.
const STEP_S: f64 = 0.1;
const RECORDED_EVERY: i64 = 4;
/// Duration of a recording, and of the simulation before it, seconds.
const LONG_S: f64 = 60.0;
const BEFORE_S: f64 = 20.0;
/// Distance from the centre at which cars appear and leave, metres.
const FAR_M: f64 = 80.0;
/// Distance from the centre line of the road to that of a lane, and from the centre to the stop line, metres.
const LANE_M: f64 = 1.75;
const STOP_M: f64 = 8.0;
/// Duration of a phase of the lights, with two seconds of red for all, seconds.
const PHASE_S: f64 = 14.0;
/// Largest coordinate of the places between which pedestrians walk, metres.
const WALK_M: f64 = 22.0;

/// A simulated car.
struct Car {
    id: u32,
    /// Approach that it comes from, in quarter turns.
    side: i64,
    way: Way,
    s_m: f64,
    speed_mps: f64,
    wanted_mps: f64,
    headway_s: f64,
    /// Random walk of the driver's acceleration, m/s².
    mood_mps2: f64,
    extent: Extent,
}

#[derive(Clone, Copy, PartialEq)]
enum Way {
    On,
    Left,
    Right,
}

/// A simulated pedestrian.
struct Walker {
    id: u32,
    agent: Agent,
    goal: Point2,
    speed_mps: f64,
    stands_s: f64,
}

impl Way {
    /// Radius of its bend, and its side: 1 for left, -1 for right.
    fn bend(self) -> Option<(f64, f64)> {
        match self {
            Self::On => None,
            Self::Left => Some((STOP_M + LANE_M, 1.0)),
            Self::Right => Some((STOP_M - LANE_M, -1.0)),
        }
    }
}

impl Car {
    /// Position and direction, computed for the western approach and then rotated.
    fn place(&self) -> (Point2, Vector2) {
        let before_m = FAR_M - STOP_M;
        let straight =
            |s_m: f64| -> (Point2, Vector2) { (Point2::new(s_m - FAR_M, -LANE_M), Vector2::new(1.0, 0.0)) };
        let (point, ahead): (Point2, Vector2) = match self.way.bend() {
            Some((radius_m, side)) if self.s_m > before_m => {
                let quarter = core::f64::consts::FRAC_PI_2;
                let angle = ((self.s_m - before_m) / radius_m).min(quarter);
                let beyond_m = (self.s_m - before_m - quarter * radius_m).max(0.0);
                let (sin, cos) = math::sin_cos(angle);
                let ahead = Vector2::new(cos, side * sin);
                let bent = Point2::new(-STOP_M + radius_m * sin, -LANE_M + side * radius_m * (1.0 - cos));
                (bent + ahead * beyond_m, ahead)
            }
            _ => straight(self.s_m),
        };
        let mut at = (point.x_m, point.y_m, ahead.x, ahead.y);
        for _ in 0..self.side {
            at = (-at.1, at.0, -at.3, at.2);
        }
        (Point2::new(at.0, at.1), Vector2::new(at.2, at.3))
    }

    /// Acceleration for a gap (m) and speed (m/s) of the lead, m/s².
    fn gain_mps2(&self, next: Option<(f64, f64)>) -> f64 {
        let near_bend = (self.s_m - (FAR_M - STOP_M)).abs() < 12.0;
        let bend_mps = self.way.bend().filter(|_| near_bend).map(|(radius_m, _)| (2.0 * radius_m).sqrt());
        let free_mps = bend_mps.map_or(self.wanted_mps, |most| most.min(self.wanted_mps));
        let driver =
            Idm { gain_mps2: 1.5, brake_mps2: 2.0, headway_s: self.headway_s, stand_gap_m: STAND_GAP_M };
        (driver.acceleration_mps2(self.speed_mps, free_mps, next) + self.mood_mps2).clamp(-7.0, 2.5)
    }
}

/// Makes a recording of one minute from a seed, with about a dozen cars and `people` pedestrians at once.
pub fn made(seed: u64, people: usize) -> Recording {
    recorded(seed, people, RECORDED_EVERY)
}

/// As [`made`], recorded every 0.1 s.
pub fn made_finely(seed: u64, people: usize) -> Recording {
    recorded(seed, people, 1)
}

fn recorded(seed: u64, people: usize, every: i64) -> Recording {
    let mut world = World {
        rng: Rng::keyed(seed, "made", &[]),
        cars: Vec::new(),
        people: Vec::new(),
        next_id: 1,
        people_count: people,
    };
    let mut tracks: BTreeMap<u32, RecordedTrack> = BTreeMap::new();
    let (before, all) = ((BEFORE_S / STEP_S) as i64, ((BEFORE_S + LONG_S) / STEP_S) as i64);
    for step in 0..all {
        world.on(step as f64 * STEP_S);
        if step >= before && step % every == 0 {
            world.record((step - before) / every, &mut tracks);
        }
    }
    let step = Span::from_secs(STEP_S) * every;
    Recording { step, tracks: tracks.into_values().collect(), lanes: None }
}

struct World {
    rng: Rng,
    cars: Vec<Car>,
    people: Vec<Walker>,
    next_id: u32,
    people_count: usize,
}

impl World {
    fn record(&self, step: i64, tracks: &mut BTreeMap<u32, RecordedTrack>) {
        let person = Extent { length_m: 0.5, width_m: 0.5, height_m: 1.8 };
        let cars = self.cars.iter().map(|one| (one.id, ActorKind::Car, one.extent, one.place().0));
        let people = self.people.iter().map(|one| (one.id, ActorKind::Pedestrian, person, one.agent.point));
        for (id, kind, extent, point) in cars.chain(people) {
            let empty = || RecordedTrack { id: ActorId(id), kind, extent, samples: Vec::new() };
            tracks.entry(id).or_insert_with(empty).samples.push((step, point));
        }
    }

    /// Advances the simulation by one step.
    fn on(&mut self, now_s: f64) {
        self.come();
        let gains: Vec<f64> = (0..self.cars.len()).map(|k| self.gain_mps2(k, now_s)).collect();
        for (car, gain) in self.cars.iter_mut().zip(gains) {
            let next_mps = (car.speed_mps + gain * STEP_S).max(0.0);
            car.s_m += 0.5 * (car.speed_mps + next_mps) * STEP_S;
            car.speed_mps = next_mps;
            car.mood_mps2 += -0.05 * car.mood_mps2 + 0.08 * self.rng.normal();
        }
        self.cars.retain(|car| {
            let (at, _) = car.place();
            at.x_m.abs() < FAR_M + 1.0 && at.y_m.abs() < FAR_M + 1.0
        });
        self.walk();
    }

    /// Adds cars at random, and pedestrians in place of those who have left.
    fn come(&mut self) {
        for side in 0..4 {
            let free = self.cars.iter().all(|car| car.side != side || car.s_m > 20.0);
            if free && self.rng.unit() < 0.015 {
                let way = [Way::On, Way::On, Way::Left, Way::Right][self.rng.below(4)];
                let wanted_mps = self.rng.uniform(8.0, 15.0);
                let extent = Extent { length_m: self.rng.uniform(3.8, 5.0), width_m: 1.8, height_m: 1.5 };
                self.cars.push(Car {
                    id: self.next_id,
                    side,
                    way,
                    s_m: 0.0,
                    speed_mps: 0.8 * wanted_mps,
                    wanted_mps,
                    headway_s: self.rng.uniform(0.8, 2.0),
                    mood_mps2: 0.0,
                    extent,
                });
                self.next_id += 1;
            }
        }
        while self.people.len() < self.people_count {
            let (from, goal) = (self.spot(), self.spot());
            let speed_mps = (1.34 + 0.26 * self.rng.normal()).clamp(0.5, 2.2);
            let agent = Agent {
                point: from,
                velocity_mps: Vector2::default(),
                wanted_mps: Vector2::default(),
                radius_m: orca::RADIUS_M,
                fixed: false,
            };
            self.people.push(Walker { id: self.next_id, agent, goal, speed_mps, stands_s: 0.0 });
            self.next_id += 1;
        }
    }

    /// A random position beside the road.
    fn spot(&mut self) -> Point2 {
        let mut beside = || {
            let off_m = self.rng.uniform(4.5, WALK_M);
            if self.rng.unit() < 0.5 { off_m } else { -off_m }
        };
        Point2::new(beside(), beside())
    }

    /// Acceleration of car `k`, from its lead, a red light, and pedestrians on the road ahead.
    fn gain_mps2(&self, k: usize, now_s: f64) -> f64 {
        let car = &self.cars[k];
        let (at, ahead) = car.place();
        let phase = now_s / PHASE_S;
        let red = (phase.floor() as i64 + car.side) % 2 == 0 || phase.fract() * PHASE_S > PHASE_S - 2.0;
        let to_line_m = FAR_M - STOP_M - 0.5 * car.extent.length_m - car.s_m;
        let can_stop = to_line_m > car.speed_mps * car.speed_mps / 8.0;
        let line = (red && to_line_m > 0.0 && can_stop).then_some((to_line_m + 2.0, 0.0));
        let before = |to: Point2, reach_m: f64, beside_m: f64| {
            let apart = to - at;
            let on_m = ahead.dot(apart);
            (on_m > 0.0 && on_m < reach_m && ahead.cross(apart).abs() < beside_m).then_some(on_m)
        };
        let cars = self.cars.iter().enumerate().filter(|(j, _)| *j != k).filter_map(|(_, other)| {
            let (there, way) = other.place();
            let on_m = before(there, 60.0, 1.6)?;
            let speed_mps = other.speed_mps * ahead.dot(way).max(0.0);
            Some((on_m - 0.5 * (car.extent.length_m + other.extent.length_m), speed_mps))
        });
        let people = self.people.iter().filter_map(|walker| {
            let on_m = before(walker.agent.point + walker.agent.velocity_mps, 25.0, 2.2)?;
            Some((on_m - 0.5 * car.extent.length_m, 0.0))
        });
        let gains = line.into_iter().chain(cars).chain(people).map(|next| car.gain_mps2(Some(next)));
        gains.fold(car.gain_mps2(None), f64::min)
    }

    fn walk(&mut self) {
        for walker in &mut self.people {
            let to = walker.goal - walker.agent.point;
            walker.stands_s -= STEP_S;
            if walker.stands_s <= 0.0 && self.rng.unit() < 0.003 {
                walker.stands_s = self.rng.uniform(1.0, 6.0);
            }
            if self.rng.unit() < 0.003 {
                let turn: Vector2 = Vector2::from_heading(self.rng.uniform(-1.5, 1.5));
                let on = Vector2::new(turn.x * to.x - turn.y * to.y, turn.x * to.y + turn.y * to.x);
                walker.goal = walker.agent.point + on;
            }
            let speed_mps = if walker.stands_s > 0.0 { 0.0 } else { walker.speed_mps };
            let wanted = to * (speed_mps / to.norm().max(1e-6));
            // Pedestrians change speed and direction gradually.
            let held = walker.agent.wanted_mps;
            let shaken = Vector2::new(self.rng.normal(), self.rng.normal()) * 0.03;
            walker.agent.wanted_mps = held + (wanted - held) * 0.2 + shaken;
        }
        let mut agents: Vec<Agent> = self.people.iter().map(|walker| walker.agent).collect();
        agents.extend(self.cars.iter().map(|car| {
            let (point, ahead) = car.place();
            let velocity_mps = ahead * car.speed_mps;
            Agent { point, velocity_mps, wanted_mps: velocity_mps, radius_m: 1.2, fixed: true }
        }));
        for (k, walker) in self.people.iter_mut().enumerate() {
            walker.agent.velocity_mps = orca::velocity(&agents, k, STEP_S);
            walker.agent.point = walker.agent.point + walker.agent.velocity_mps * STEP_S;
        }
        self.people.retain(|walker| walker.goal.distance(walker.agent.point) > 0.5);
    }
}
