//! Simulation of all vehicles by the intelligent driver model.

use std::collections::BTreeSet;

use swerve_geom::math;
use swerve_map::LaneId;
use swerve_road_user::idm::{Idm, STAND_GAP_M};

use super::place::{Along, Position, walks};
use crate::past::Past;
use crate::predictor::{Horizon, Tracked};

/// Largest acceleration and comfortable deceleration, m/s².
const GAIN_MPS2: f64 = 1.0;
const BRAKE_MPS2: f64 = 1.0;
/// Time gap that drivers return to and its time constant, seconds, and bounds of the present gap.
const HEADWAY_S: f64 = 1.0;
const HEADWAY_SETTLES_S: f64 = 5.0;
const HEADWAYS_S: [f64; 2] = [0.3, 2.2];
/// Ratio of desired to present speed in free traffic.
const WANTED_SHARE: f64 = 1.05;
/// Desired speed of a driver behind a lead: a factor on the present speed, and an addition in m/s.
const HELD_UP: [f64; 2] = [2.4, 3.0];
/// Time gap at which that effect is halved, seconds.
const HELD_UP_S: f64 = 6.5;
/// Largest lateral acceleration in a bend, m/s².
const LATERAL_MPS2: f64 = 3.0;
/// Time over which the present acceleration is estimated, seconds, the share of it that is used initially, and the
/// time constant with which it changes to the model's, seconds.
const GAIN_WINDOW_S: f64 = 2.8;
const GAIN_SHARE: f64 = 0.6;
const GAIN_FADES_S: f64 = 1.6;
/// Largest distance of a lead, metres.
const AHEAD_MAX_M: f64 = 100.0;
/// Largest deceleration with which a vehicle stops for a stop line, m/s²; beyond, it passes.
const STOP_MPS2: f64 = 4.0;
/// Largest deceleration, m/s².
const BRAKE_MAX_MPS2: f64 = 8.0;
/// Integration step, seconds.
const STEP_S: f64 = 0.2;

/// A vehicle on one of its paths.
pub(super) struct Driver<'a> {
    along: &'a Along<'a>,
    /// Lead on the path: index and bumper-to-bumper gap, metres.
    leader: Option<(usize, f64)>,
    /// Distance to a red stop line, metres.
    red_m: Option<f64>,
    speed_mps: f64,
    wanted_mps: f64,
    headway_s: f64,
    /// Initial acceleration, m/s².
    first_mps2: f64,
    /// Distance covered, metres.
    on_m: f64,
}

/// Simulated motion of all actors.
pub(super) struct Rolled {
    /// Number of actors.
    count: usize,
    /// Distance covered (m) and speed (m/s), by step, then by actor.
    states: Vec<(f64, f64)>,
    /// Requested instants, in steps.
    at: Vec<f64>,
}

/// Decay factors at one step.
#[derive(Clone, Copy)]
struct Fading {
    gain: f64,
    headway: f64,
}

impl Fading {
    fn after(step: usize) -> Self {
        let t_s = step as f64 * STEP_S;
        Self { gain: math::exp(-t_s / GAIN_FADES_S), headway: math::exp(-t_s / HEADWAY_SETTLES_S) }
    }
}

impl<'a> Driver<'a> {
    pub(super) fn of(
        one: &Tracked,
        along: &'a Along<'a>,
        (places, seen, k): (&[Position<'_>], &[Tracked], usize),
        red: &BTreeSet<LaneId>,
    ) -> Self {
        let speed_mps = places[k].velocity_mps.norm();
        // Pedestrians have no lead and keep their speed; they only act as leads.
        let leader = if walks(one) { None } else { leader(along, places, seen, k) };
        let gap_s = leader.map_or(f64::INFINITY, |(_, gap_m)| (gap_m - STAND_GAP_M) / speed_mps.max(1.0));
        let apart = gap_s.max(0.0) / HELD_UP_S;
        let held_up = 1.0 / (1.0 + apart * apart * apart * apart);
        let alone_mps = speed_mps * WANTED_SHARE + 0.1;
        let held_mps = speed_mps * HELD_UP[0] + HELD_UP[1];
        let red_m = along.stop().filter(|(_, lane)| red.contains(lane)).and_then(|(stop_m, _)| {
            let front_m = stop_m - 0.5 * one.track.extent.length_m;
            let stops = speed_mps * speed_mps < 2.0 * STOP_MPS2 * front_m;
            (stops && front_m > 0.0).then_some(front_m)
        });
        let first_mps2 = if walks(one) { 0.0 } else { GAIN_SHARE * gain_mps2(&one.past).clamp(-5.0, 3.0) };
        Self {
            along,
            leader,
            red_m,
            speed_mps,
            wanted_mps: alone_mps + (held_mps - alone_mps).max(0.0) * held_up,
            headway_s: gap_s.clamp(HEADWAYS_S[0], HEADWAYS_S[1]),
            first_mps2,
            on_m: 0.0,
        }
    }

    /// Acceleration behind a lead with this distance covered (m) and speed (m/s), m/s².
    fn gain_mps2(&self, leader: Option<(f64, f64)>, fading: Fading) -> f64 {
        let curvature_1pm = self.along.curvature_1pm(self.on_m + self.speed_mps).abs();
        let bend_mps = (LATERAL_MPS2 / curvature_1pm.max(1e-6)).sqrt();
        let headway_s = HEADWAY_S + (self.headway_s - HEADWAY_S) * fading.headway;
        let driver =
            Idm { gain_mps2: GAIN_MPS2, brake_mps2: BRAKE_MPS2, headway_s, stand_gap_m: STAND_GAP_M };
        let behind =
            |next| driver.acceleration_mps2(self.speed_mps, self.wanted_mps.min(bend_mps).max(0.1), next);
        let gap = self.leader.zip(leader).map(|((_, gap_m), (on_m, mps))| (gap_m + on_m - self.on_m, mps));
        let mut model_mps2 = behind(gap);
        if let Some(red_m) = self.red_m {
            // The standstill gap applies to a lead, not to a stop line.
            model_mps2 = model_mps2.min(behind(Some((red_m + STAND_GAP_M - self.on_m, 0.0))));
        }
        let model_mps2 = model_mps2.max(-BRAKE_MAX_MPS2);
        model_mps2 + (self.first_mps2 - model_mps2) * fading.gain
    }

    /// Advances by a step at this acceleration.
    fn on(&mut self, gain_mps2: f64) {
        let next_mps = (self.speed_mps + gain_mps2 * STEP_S).max(0.0);
        self.on_m += 0.5 * (self.speed_mps + next_mps) * STEP_S;
        self.speed_mps = next_mps;
    }
}

/// Lead of vehicle `k` on a path, and the gap to it.
fn leader(along: &Along<'_>, places: &[Position<'_>], seen: &[Tracked], k: usize) -> Option<(usize, f64)> {
    let (own, mut next) = (&places[k], None::<(usize, f64)>);
    for (j, other) in places.iter().enumerate() {
        let is_near = own.point.distance(other.point) < AHEAD_MAX_M;
        if j == k || !is_near || other.velocity_mps.dot(own.velocity_mps) < 0.0 {
            continue;
        }
        let Some((ahead_m, beside_m)) = along.ahead_of(other) else { continue };
        let (a, b) = (seen[k].track.extent, seen[j].track.extent);
        if ahead_m <= 0.0 || beside_m.abs() >= 0.5 * (a.width_m + b.width_m) {
            continue;
        }
        let gap_m = (ahead_m - 0.5 * (a.length_m + b.length_m)).max(0.1);
        if next.is_none_or(|(_, least_m)| gap_m < least_m) {
            next = Some((j, gap_m));
        }
    }
    next
}

/// Acceleration along the motion, by a parabola through the last sightings, m/s²; 0 for too few of them.
fn gain_mps2(past: &Past) -> f64 {
    let last = past.last();
    let from = past.sightings.iter().position(|one| (last.at - one.at).as_secs() <= GAIN_WINDOW_S + 1e-6);
    let window = &past.sightings[from.unwrap_or(0)..];
    let along = last.point - window[0].point;
    if window.len() < 4 || along.norm() < 0.1 {
        return 0.0;
    }
    let (unit, n) = (along * (1.0 / along.norm()), window.len() as f64);
    let since = |k: usize| (window[k].at - last.at).as_secs();
    let mean_s = (0..window.len()).map(since).sum::<f64>() / n;
    // The square of time, orthogonalised against constant and linear terms: its coefficient is half the acceleration.
    let (mut second, mut third) = (0.0, 0.0);
    for k in 0..window.len() {
        let t = since(k) - mean_s;
        second += t * t;
        third += t * t * t;
    }
    let (mut way, mut size) = (0.0, 0.0);
    for (k, one) in window.iter().enumerate() {
        let t = since(k) - mean_s;
        let square = t * t - third / second * t - second / n;
        way += square * unit.dot(one.point - last.point);
        size += square * square;
    }
    2.0 * way / size
}

impl Rolled {
    /// Simulates all actors, each on its likeliest path.
    pub(super) fn all(mut drivers: Vec<Driver<'_>>, horizon: &Horizon) -> Self {
        let step = horizon.step.as_secs() / STEP_S;
        let at: Vec<f64> = (0..=horizon.steps).map(|k| step * k as f64).collect();
        let steps = at[horizon.steps].ceil() as usize;
        let count = drivers.len();
        let mut states = Vec::with_capacity(count * (steps + 1));
        states.extend(drivers.iter().map(|driver| (driver.on_m, driver.speed_mps)));
        for n in 0..steps {
            let fading = Fading::after(n);
            for driver in &mut drivers {
                let leader = driver.leader.map(|(j, _)| states[n * count + j]);
                driver.on(driver.gain_mps2(leader, fading));
                states.push((driver.on_m, driver.speed_mps));
            }
        }
        Self { count, states, at }
    }

    /// Distance covered by actor `k`, at each instant.
    pub(super) fn of(&self, k: usize) -> Vec<f64> {
        self.at.iter().map(|at| between(*at, |n| self.states[n * self.count + k])).collect()
    }

    /// Distance covered by an actor on another path, with all other actors unchanged.
    pub(super) fn beside(&self, mut driver: Driver<'_>) -> Vec<f64> {
        let steps = self.states.len() / self.count.max(1);
        let mut own = vec![(driver.on_m, driver.speed_mps)];
        for n in 0..steps - 1 {
            let leader = driver.leader.map(|(j, _)| self.states[n * self.count + j]);
            driver.on(driver.gain_mps2(leader, Fading::after(n)));
            own.push((driver.on_m, driver.speed_mps));
        }
        self.at.iter().map(|at| between(*at, |n| own[n])).collect()
    }
}

/// Distance covered between two steps, at constant acceleration.
fn between(at: f64, state: impl Fn(usize) -> (f64, f64)) -> f64 {
    let n = at.floor();
    let (share, (on_m, speed_mps)) = (at - n, state(n as usize));
    if share == 0.0 {
        return on_m;
    }
    let next_mps = state(n as usize + 1).1;
    on_m + STEP_S * share * (speed_mps + 0.5 * share * (next_mps - speed_mps))
}
