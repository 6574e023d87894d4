//! Where and when actors begin, at the start and after they have left.

use swerve_core::Rng;
use swerve_geom::{Obb, Pose2};
use swerve_msg::{ActorId, ActorKind};

use super::slots::Slots;
use super::{Traffic, TrafficActor};
use crate::net::End;
use crate::scene::Other;
use crate::spawn::{AT_START_M, Taken, vehicle};

/// Time at rest outside a red phase after which an actor counts as stuck, seconds.
const STUCK_S: f64 = 180.0;
/// Distance before an end inside the map, or before a closed place, at which a vehicle leaves, metres. At the edge of the
/// map, it leaves beyond the end.
const LEAVES_M: f64 = 25.0;
/// Time at rest after which a vehicle leaves before a closed place, or before the end of a lane beside others, seconds.
const WAITS_S: f64 = 20.0;
/// Distance of an entering vehicle from others on its lane and those before and after it, metres, and seconds at the speed
/// of those behind; distance from all others, and from the ego, metres.
const CLEAR_M: f64 = 40.0;
const CLEAR_S: f64 = 3.0;
const BESIDE_M: f64 = 12.0;
const EGO_M: f64 = 60.0;
/// Comfortable deceleration of an entering vehicle, m/s².
const BRAKE_MPS2: f64 = 1.0;
/// Ticks between two attempts to enter.
const RETRY_TICKS: i64 = 5;

impl Traffic {
    /// Places all actors.
    pub(super) fn populate(&mut self, others: &[Other]) {
        let reserved: Vec<Obb> = others.iter().map(|other| other.body).collect();
        let reserved = &reserved[..];
        let setup = self.setup.clone();
        let (cars, walkers, cyclists) = (setup.vehicles, setup.pedestrians, setup.cyclists);
        let id = |n: usize| ActorId(setup.first_id + n as u32);
        let mut bodies: Vec<Obb> = Vec::new();
        let kinds = [(false, cars, 0), (true, cyclists, cars + walkers)];
        for (cycles, count, from) in kinds {
            for key in 0..count {
                let mut car = vehicle(&setup, self.seed, cycles, key, id(from + key));
                let name = if cycles { "traffic cyclist place" } else { "traffic car place" };
                let mut rng = Rng::keyed(self.seed, name, &[car.key, 0]);
                let taken = Taken { bodies: &bodies, reserved, reserve_m: setup.reserve_m };
                let entries = &self.entries[usize::from(cycles)];
                let Some((lane, s_m, pose)) =
                    entries.place(&self.net, &car, (&mut rng, &taken, AT_START_M), |_, _| true)
                else {
                    self.counts.left_out += 1;
                    continue;
                };
                bodies.push(car.extent.footprint(pose));
                car.enter(&self.net, self.seed, (lane, s_m));
                self.cars.push(car);
            }
        }
        self.counts.left_out +=
            self.walkers.populate(&setup, self.seed, (reserved, &bodies), |key| id(cars + key));
        self.scene.update(&self.net, &self.cars, others.to_vec());
        for who in 0..self.cars.len() {
            self.set_off(who);
        }
        let vehicles = self.cars.iter().map(|car| TrafficActor {
            id: car.id,
            kind: if car.cycles { ActorKind::Cyclist } else { ActorKind::Car },
            extent: car.extent,
        });
        self.actors = vehicles.chain(self.walkers.actors()).collect();
        self.actors.sort_by_key(|actor| actor.id);
        let (cars, walkers) =
            (self.cars.iter().map(|car| car.id), self.walkers.actors().map(|actor| actor.id));
        self.slots = Slots::new(self.setup.first_id, cars, walkers);
    }

    /// Gives an entering vehicle the speed from which it stops comfortably wherever it may have to.
    fn set_off(&mut self, who: usize) {
        let car = &self.cars[who];
        let lead = self.scene.lead(&self.net, car, who);
        let mut free_m = f64::INFINITY;
        free_m = free_m.min(car.next_block().map_or(f64::INFINITY, |block| block.stop_m - car.x_m));
        free_m = free_m.min(car.end(&self.net).map_or(f64::INFINITY, |end| end.wall_m() - 5.0 - car.x_m));
        for &(lane, begin_m) in &car.way {
            let stops = self.net.lane(lane).stops.iter().map(|stop| begin_m + stop.s_m);
            let crossings = self.net.lane(lane).crossings.iter().map(|(_, part)| begin_m + part[0]);
            for line_m in stops.chain(crossings).filter(|line_m| *line_m > car.x_m) {
                free_m = free_m.min(line_m - car.half_m() - 1.0 - car.x_m);
            }
        }
        let desired_mps = car.desired_mps(&self.net, self.setup.drivers.brake_mps2);
        let from_mps =
            |there_mps: f64, free_m: f64| (there_mps * there_mps + 2.0 * BRAKE_MPS2 * free_m.max(0.0)).sqrt();
        let behind_mps = lead.map_or(f64::INFINITY, |lead| from_mps(lead.speed_mps, lead.gap_m - 3.0));
        self.cars[who].speed_mps = desired_mps.min(from_mps(0.0, free_m)).min(behind_mps);
    }

    /// Lets vehicles leave at the end of the map, or where they are stuck, and enter elsewhere.
    pub(super) fn renew(&mut self, others: &[Other]) {
        let is_due = (self.ticks % RETRY_TICKS) == 0;
        for who in 0..self.cars.len() {
            let car = &mut self.cars[who];
            let is_stuck = car.stands_s > STUCK_S;
            if is_stuck && !car.counted {
                car.counted = true;
                self.counts.deadlocks += 1;
            }
            let front_m = car.x_m + car.half_m();
            // A lane that ends beside another one is left by a change of lanes, if that is possible.
            let mut beside = self.net.lane(car.lane()).beside.iter().flatten();
            let may_change = beside.any(|lane| !self.net.ends(*lane)) && car.stands_s < WAITS_S;
            let leaves = match car.end(&self.net) {
                Some(End::Open(end_m)) => {
                    // Beyond the edge of the map, it waits for room to enter.
                    car.stands_s = if front_m > end_m { 0.0 } else { car.stands_s };
                    front_m > end_m
                }
                Some(End::Dead(end_m)) => end_m - front_m < LEAVES_M && !may_change,
                Some(End::Closed(end_m)) => end_m - front_m < LEAVES_M && car.stands_s > WAITS_S,
                None => false,
            };
            if car.is_hit || !is_due || !(is_stuck || leaves) {
                continue;
            }
            self.re_enter(who, others, !is_stuck);
        }
    }

    fn re_enter(&mut self, who: usize, others: &[Other], counts: bool) {
        self.scene.update(&self.net, &self.cars, others.to_vec());
        let apart = self.cars.iter().enumerate().filter(|(other, _)| *other != who);
        let apart = apart.map(|(_, car)| around(car.movement(&self.net, 0.0).0, BESIDE_M));
        let others_near = others.iter().map(|other| {
            let radius_m = CLEAR_M.max(CLEAR_S * other.velocity_mps.norm());
            around(other.body.center, radius_m)
        });
        let near: Vec<Obb> = apart.chain(others_near).collect();
        let egos: Vec<Obb> = others.iter().filter(|other| other.is_ego).map(|other| other.body).collect();
        let car = &self.cars[who];
        let name = if car.cycles { "traffic cyclist place" } else { "traffic car place" };
        let mut rng = Rng::keyed(self.seed, name, &[car.key, car.entries, self.ticks]);
        let taken = Taken { bodies: &near, reserved: &egos, reserve_m: EGO_M.max(self.setup.reserve_m) };
        let entries = &self.entries[usize::from(car.cycles)];
        let has_room = |lane: usize, s_m: f64| {
            let behind = self.scene.follower(&self.net, (lane, s_m), who);
            let ahead = self.scene.leader(&self.net, (lane, s_m), who);
            behind.is_none_or(|body| s_m - body.s_m > CLEAR_M.max(CLEAR_S * body.speed_mps))
                && ahead.is_none_or(|body| body.s_m - s_m > CLEAR_M)
        };
        let place = entries.place(&self.net, car, (&mut rng, &taken, [0.0; 2]), has_room);
        let Some((lane, s_m, _)) = place else { return };
        self.cars[who].enter(&self.net, self.seed, (lane, s_m));
        self.scene.update(&self.net, &self.cars, others.to_vec());
        self.set_off(who);
        self.counts.re_entries += u64::from(counts);
    }
}

/// Ground around a vehicle on which no other one enters.
fn around(center: Pose2, radius_m: f64) -> Obb {
    Obb::new(center, 2.0 * radius_m, 2.0 * radius_m)
}
