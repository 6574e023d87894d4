//! Where and when actors begin, at the start and after they have left.

use swerve_core::Rng;
use swerve_geom::{Obb, Pose2};
use swerve_msg::{ActorId, ActorKind};

use super::{Traffic, TrafficActor};
use crate::scene::Other;
use crate::spawn::{AT_START_M, Taken, vehicle};

/// Time at rest outside a red phase after which an actor counts as stuck, seconds.
const STUCK_S: f64 = 180.0;
/// Distance before the end of the map at which a vehicle leaves, metres.
const LEAVES_M: f64 = 25.0;
/// Distance of an entering vehicle from all others, metres, and seconds at their speed; distance from the ego, metres.
const CLEAR_M: f64 = 40.0;
const CLEAR_S: f64 = 3.0;
const EGO_M: f64 = 60.0;
/// Comfortable deceleration of an entering vehicle, m/s².
const BRAKE_MPS2: f64 = 1.0;
/// Ticks between two attempts to enter.
const RETRY_TICKS: i64 = 5;

impl Traffic {
    /// Places all actors.
    pub(super) fn populate(&mut self, reserved: &[Obb]) {
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
                let Some((lane, s_m, pose)) = entries.place(&self.net, &car, (&mut rng, &taken, AT_START_M))
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
        self.scene.update(&self.net, &self.cars, Vec::new());
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
    }

    /// Gives an entering vehicle the speed from which it stops comfortably wherever it may have to.
    fn set_off(&mut self, who: usize) {
        let car = &self.cars[who];
        let lead = self.scene.lead(&self.net, car, who);
        let mut free_m = lead.map_or(f64::INFINITY, |lead| lead.gap_m - 3.0);
        free_m = free_m.min(car.next_block().map_or(f64::INFINITY, |block| block.stop_m - car.x_m));
        free_m = free_m.min(car.dead_end_m(&self.net).map_or(f64::INFINITY, |end_m| end_m - 5.0 - car.x_m));
        for &(lane, begin_m) in &car.way {
            let stops = self.net.lane(lane).stops.iter().map(|stop| begin_m + stop.s_m);
            let crossings = self.net.lane(lane).crossings.iter().map(|(_, part)| begin_m + part[0]);
            for line_m in stops.chain(crossings).filter(|line_m| *line_m > car.x_m) {
                free_m = free_m.min(line_m - car.half_m() - 1.0 - car.x_m);
            }
        }
        let desired_mps = car.desired_mps(&self.net, self.setup.drivers.brake_mps2);
        self.cars[who].speed_mps = desired_mps.min((2.0 * BRAKE_MPS2 * free_m.max(0.0)).sqrt());
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
            let leaves = car.dead_end_m(&self.net).is_some_and(|end_m| end_m - front_m < LEAVES_M);
            // A lane that ends beside another one is left by a change of lanes, if that is possible.
            let lane = self.net.lane(car.lane());
            let may_change = lane.beside.iter().any(Option::is_some) && car.stands_s < 20.0;
            if car.is_hit || !is_due || !(is_stuck || leaves && !may_change) {
                continue;
            }
            self.re_enter(who, others, !is_stuck);
        }
    }

    fn re_enter(&mut self, who: usize, others: &[Other], counts: bool) {
        let apart = self
            .cars
            .iter()
            .enumerate()
            .filter(|(other, _)| *other != who)
            .map(|(_, car)| around(car.movement(&self.net, 0.0).0, car.speed_mps));
        let others_near = others.iter().map(|other| around(other.body.center, other.velocity_mps.norm()));
        let near: Vec<Obb> = apart.chain(others_near).collect();
        let egos: Vec<Obb> = others.iter().filter(|other| other.is_ego).map(|other| other.body).collect();
        let car = &self.cars[who];
        let name = if car.cycles { "traffic cyclist place" } else { "traffic car place" };
        let mut rng = Rng::keyed(self.seed, name, &[car.key, car.entries, self.ticks]);
        let taken = Taken { bodies: &near, reserved: &egos, reserve_m: EGO_M.max(self.setup.reserve_m) };
        let entries = &self.entries[usize::from(car.cycles)];
        let Some((lane, s_m, _)) = entries.place(&self.net, car, (&mut rng, &taken, [0.0; 2])) else {
            return;
        };
        self.cars[who].enter(&self.net, self.seed, (lane, s_m));
        let others = others.to_vec();
        self.scene.update(&self.net, &self.cars, others);
        self.set_off(who);
        self.counts.re_entries += u64::from(counts);
    }
}

/// Ground around a vehicle on which no other one enters.
fn around(center: Pose2, speed_mps: f64) -> Obb {
    let radius_m = CLEAR_M.max(CLEAR_S * speed_mps);
    Obb::new(center, 2.0 * radius_m, 2.0 * radius_m)
}
