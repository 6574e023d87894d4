//! Pedestrians.
//!
//! A pedestrian follows paths and chooses at each junction of them by a keyed draw. Social forces keep it away from
//! others, a force at the border on its path. Before a crossing it waits until the cars that come can stop, or have a
//! red light for as long as it takes; cars stop for those on the crossing.

mod crossing;
mod paths;

use swerve_core::{Rng, Time};
use swerve_geom::{FrenetPoint, Obb, Point2, Pose2, Vector2};
use swerve_map::Map;
use swerve_msg::{ActorId, ActorKind, Extent};
use swerve_road_user::social_force::{self, TOUCH_M};
use swerve_world::Movement;

use crate::car::Car;
use crate::lights::Lights;
use crate::net::Net;
use crate::scene::{Other, Scene};
use crate::setup::TrafficSetup;
use crate::spawn::Taken;
use crate::traffic::TrafficActor;
use paths::{Joint, Path};

/// Mean and deviation of walking speeds, and their range, m/s (Weidmann 1993).
const SPEED_MPS: [f64; 2] = [1.34, 0.26];
const SPEEDS_MPS: [f64; 2] = [0.8, 1.8];
/// Share of pedestrians who turn off where another path touches theirs.
const TURNS_OFF: f64 = 0.35;
/// Distance from a joint at which the next path begins, metres.
const REACHED_M: f64 = 0.7;
/// Fastest sideways walk back onto the path, m/s.
const BACK_MPS: f64 = 0.8;
/// Free ground around a pedestrian at the start, metres.
const FREE_M: f64 = 0.4;
const TRIES: usize = 100;

/// A pedestrian.
#[derive(Clone, Debug)]
struct Walker {
    id: ActorId,
    key: i64,
    extent: Extent,
    speed_mps: f64,
    path: usize,
    s_m: f64,
    /// 1 along the path, -1 against it.
    way: f64,
    /// Preferred place across the path, as a share of the half width.
    share: f64,
    /// Where it leaves the path; `None`: it turns around at the end.
    goal: Option<Joint>,
    point: Point2,
    velocity_mps: Vector2,
    heading_rad: f64,
    choices: i64,
    waits: bool,
    is_hit: bool,
}

/// All pedestrians of the traffic.
#[derive(Clone, Debug)]
pub(crate) struct Walkers {
    paths: Vec<Path>,
    walkers: Vec<Walker>,
    /// Crossings with someone on them.
    used: Vec<bool>,
    seed: u64,
}

impl Walkers {
    pub(crate) fn new(map: &Map, net: &Net) -> Self {
        let used = vec![false; map.crossings().len()];
        Self { paths: paths::paths(map, net), walkers: Vec::new(), used, seed: 0 }
    }

    /// Places the pedestrians; returns the number of those for whom there was no place.
    pub(crate) fn populate(
        &mut self,
        setup: &TrafficSetup,
        seed: u64,
        (reserved, vehicles): (&[Obb], &[Obb]),
        id: impl Fn(usize) -> ActorId,
    ) -> u64 {
        self.seed = seed;
        let mut bodies = vehicles.to_vec();
        let lengths =
            self.paths.iter().map(|path| if path.crossing.is_some() { 0.0 } else { path.line.length() });
        let lengths: Vec<f64> = lengths.collect();
        let total_m: f64 = lengths.iter().sum();
        for key in 0..setup.pedestrians {
            let mut rng = Rng::keyed(seed, "traffic pedestrian", &[key as i64]);
            let speed_mps = (SPEED_MPS[0] + SPEED_MPS[1] * rng.normal()).clamp(SPEEDS_MPS[0], SPEEDS_MPS[1]);
            let extent = Extent { length_m: 0.5, width_m: 0.5, height_m: rng.uniform(1.55, 1.9) };
            let (way, share) = (if rng.below(2) == 0 { 1.0 } else { -1.0 }, rng.uniform(-0.7, 0.7));
            let mut rng = Rng::keyed(seed, "traffic pedestrian place", &[key as i64]);
            for _ in 0..TRIES {
                let mut s_m = rng.uniform(0.0, total_m);
                let Some(path) = lengths.iter().position(|length_m| {
                    let is_here = s_m < *length_m;
                    s_m -= if is_here { 0.0 } else { *length_m };
                    is_here
                }) else {
                    break;
                };
                let on = &self.paths[path];
                let point = on.line.to_map(FrenetPoint { s_m, d_m: share * room_m(on) });
                let heading_rad = (on.line.at(s_m).pose.direction() * way).heading();
                let body = extent.footprint(Pose2::new(point.x_m, point.y_m, heading_rad));
                let taken = Taken { bodies: &bodies, reserved, reserve_m: setup.reserve_m };
                if !taken.is_free(&body, [FREE_M; 2]) {
                    continue;
                }
                bodies.push(body);
                let velocity_mps = Vector2::from_heading(heading_rad) * speed_mps;
                let mut walker = Walker {
                    id: id(key),
                    key: key as i64,
                    extent,
                    speed_mps,
                    path,
                    s_m,
                    way,
                    share,
                    goal: None,
                    point,
                    velocity_mps,
                    heading_rad,
                    choices: 0,
                    waits: false,
                    is_hit: false,
                };
                walker.choose(&self.paths, seed);
                self.walkers.push(walker);
                break;
            }
        }
        (setup.pedestrians - self.walkers.len()) as u64
    }

    pub(crate) fn actors(&self) -> impl Iterator<Item = TrafficActor> {
        let actor = |walker: &Walker| TrafficActor {
            id: walker.id,
            kind: ActorKind::Pedestrian,
            extent: walker.extent,
        };
        self.walkers.iter().map(actor)
    }

    /// Movement of a pedestrian a time after the last tick.
    pub(crate) fn movement(&self, k: usize, after_s: f64) -> Option<Movement> {
        let walker = Some(&self.walkers[k]).filter(|walker| !walker.is_hit)?;
        let point = walker.point + walker.velocity_mps * after_s;
        let pose = Pose2::new(point.x_m, point.y_m, walker.heading_rad);
        Some(Movement { pose, velocity_mps: walker.velocity_mps })
    }

    /// Gives a pedestrian up to physics.
    pub(crate) fn lose(&mut self, k: usize) {
        self.walkers[k].is_hit = true;
    }

    /// Moves all by a tick and lets those who have reached a joint choose a path.
    pub(crate) fn advance(&mut self, dt_s: f64) {
        for walker in self.walkers.iter_mut().filter(|walker| !walker.is_hit) {
            walker.point = walker.point + walker.velocity_mps * dt_s;
            let path = &self.paths[walker.path];
            walker.s_m = path.line.project_near(walker.point, walker.s_m, 4.0).s_m;
            let end_m = walker.end_m(&self.paths);
            if (end_m - walker.s_m) * walker.way < REACHED_M && !walker.waits {
                walker.turn(&self.paths, self.seed);
            }
        }
        self.used.fill(false);
        for walker in self.walkers.iter().filter(|walker| !walker.is_hit) {
            if let Some(crossing) = self.paths[walker.path].crossing {
                self.used[crossing] = true;
            }
        }
    }

    /// Decides the velocities of all for the next tick.
    pub(crate) fn decide(
        &mut self,
        net: &Net,
        cars: &[Car],
        scene: &Scene,
        lights: (&Lights, Time),
        dt_s: f64,
    ) {
        for k in 0..self.walkers.len() {
            let walker = &self.walkers[k];
            let crossing = walker.goal.and_then(|goal| self.paths[goal.to].crossing);
            let near = (walker.end_m(&self.paths) - walker.s_m) * walker.way
                < REACHED_M + 2.0 * walker.speed_mps * dt_s;
            let starts = crossing.filter(|_| near && self.paths[walker.path].crossing.is_none());
            let waits = starts.is_some_and(|crossing| {
                let line = &self.paths[walker.goal.map_or(walker.path, |goal| goal.to)].line;
                let takes_s = (line.length() + 2.0) / walker.speed_mps;
                !crossing::is_free(net, (cars, scene), crossing, lights, takes_s, line)
            });
            self.walkers[k].waits = waits;
        }
        let velocities: Vec<Vector2> =
            (0..self.walkers.len()).map(|k| self.velocity_mps(k, &scene.others, dt_s)).collect();
        for (walker, velocity_mps) in self.walkers.iter_mut().zip(velocities) {
            walker.velocity_mps = velocity_mps;
            if velocity_mps.norm() > 0.3 {
                walker.heading_rad = velocity_mps.heading();
            }
        }
    }

    fn velocity_mps(&self, k: usize, others: &[Other], dt_s: f64) -> Vector2 {
        let walker = &self.walkers[k];
        let wanted_mps = walker.wanted_mps(&self.paths);
        let mut push = Vector2::default();
        for (_, other) in self.walkers.iter().enumerate().filter(|(other, _)| *other != k) {
            let away = walker.point - other.point;
            if away.norm_squared() < social_force::REACH_M * social_force::REACH_M {
                push = push + social_force::push(away, wanted_mps, other.velocity_mps, 0.0);
            }
        }
        for other in others {
            let away = walker.point - other.body.center.point();
            let extra_m = (other.body.half_length_m - 0.5 * TOUCH_M).max(0.0);
            push = push + social_force::push(away, wanted_mps, other.velocity_mps, extra_m);
        }
        if walker.waits {
            return Vector2::default();
        }
        let drive = social_force::drive(walker.velocity_mps, wanted_mps);
        let velocity_mps = social_force::limited(walker.velocity_mps + (drive + push) * dt_s, wanted_mps);
        walker.kept(&self.paths, velocity_mps)
    }

    /// Draws of each pedestrian and its place.
    #[cfg(test)]
    pub(crate) fn draws(&self) -> Vec<(i64, Extent, f64, f64, Point2, Option<usize>)> {
        let draws = |walker: &Walker| {
            let Walker { key, extent, speed_mps, share, point, goal, .. } = walker;
            (*key, *extent, *speed_mps, *share, *point, goal.map(|goal| goal.to))
        };
        self.walkers.iter().map(draws).collect()
    }

    /// Places before crossings in use at which a vehicle stops, along its way, metres.
    pub(crate) fn stops_m(&self, net: &Net, car: &Car) -> Vec<f64> {
        if self.walkers.is_empty() {
            return Vec::new();
        }
        crossing::stops_m(net, car, &self.used)
    }
}

/// Room to each side of the middle of a path, metres.
fn room_m(path: &Path) -> f64 {
    (path.half_m - 0.3).max(0.1)
}

impl Walker {
    /// Place where it leaves the path, metres.
    fn end_m(&self, paths: &[Path]) -> f64 {
        let length_m = paths[self.path].line.length();
        self.goal.map_or(if self.way > 0.0 { length_m } else { 0.0 }, |goal| goal.s_m)
    }

    /// Desired velocity: along the path, and back to its preferred place across it.
    fn wanted_mps(&self, paths: &[Path]) -> Vector2 {
        let path = &paths[self.path];
        let ahead_m = (self.s_m + self.way).clamp(0.0, path.line.length());
        let along = path.line.at(ahead_m).pose.direction();
        let d_m = path.line.project_near(self.point, self.s_m, 4.0).d_m;
        let off_m = self.share * room_m(path) - d_m;
        let side_mps = (0.7 * off_m).clamp(-BACK_MPS, BACK_MPS);
        let wanted_mps = along * (self.way * self.speed_mps) + along.left() * side_mps;
        wanted_mps * (self.speed_mps / wanted_mps.norm().max(0.1))
    }

    /// A velocity that does not lead farther off the path.
    fn kept(&self, paths: &[Path], velocity_mps: Vector2) -> Vector2 {
        let path = &paths[self.path];
        let place = path.line.project_near(self.point, self.s_m, 4.0);
        let left = path.line.at(place.s_m).pose.direction().left();
        let outwards_mps = velocity_mps.dot(left) * place.d_m.signum();
        if place.d_m.abs() < room_m(path) || outwards_mps <= 0.0 {
            return velocity_mps;
        }
        velocity_mps + left * (-outwards_mps * place.d_m.signum())
    }

    /// Goes on along the path that it has chosen, or turns around.
    fn turn(&mut self, paths: &[Path], seed: u64) {
        match self.goal {
            Some(goal) => {
                self.path = goal.to;
                let line = &paths[goal.to].line;
                self.s_m = line.project_near(self.point, goal.to_m, 8.0).s_m.clamp(0.0, line.length());
                let from = [goal.to_m, line.length() - goal.to_m];
                self.way = if from[0] < 1.0 {
                    1.0
                } else if from[1] < 1.0 {
                    -1.0
                } else {
                    self.choices += 1;
                    let mut rng = Rng::keyed(seed, "traffic pedestrian way", &[self.key, self.choices]);
                    if rng.below(2) == 0 { 1.0 } else { -1.0 }
                };
            }
            None => self.way = -self.way,
        }
        self.choose(paths, seed);
    }

    /// Chooses where to leave the path: at one of the joints ahead.
    fn choose(&mut self, paths: &[Path], seed: u64) {
        self.choices += 1;
        let mut rng = Rng::keyed(seed, "traffic pedestrian turn", &[self.key, self.choices]);
        let path = &paths[self.path];
        let length_m = path.line.length();
        let ahead = |joint: &&Joint| (joint.s_m - self.s_m) * self.way > REACHED_M + 0.3;
        let is_end =
            |joint: &Joint| if self.way > 0.0 { joint.s_m > length_m - 1.0 } else { joint.s_m < 1.0 };
        let mut joints: Vec<Joint> = path.joints.iter().filter(ahead).copied().collect();
        if self.way < 0.0 {
            joints.reverse();
        }
        let passing = joints.iter().find(|joint| !is_end(joint) && rng.unit() < TURNS_OFF);
        let ends: Vec<&Joint> = joints.iter().filter(|joint| is_end(joint)).collect();
        let at_end = || ends.get(rng.below(ends.len())).copied();
        self.goal = passing.or_else(at_end).copied();
    }
}
