//! Passage of conflict zones.
//!
//! A driver passes a block of zones under a *grant*. Grants are numbered; of two drivers with grants for conflicting
//! zones, the one with the lower number goes first, and the other waits before the zone. As numbers are in one order,
//! nobody waits in a circle. Grants are given in order of arrival, and withdrawn at each tick from drivers who can still
//! stop before their stop line: a driver with the right of way who comes into sight is thereby respected.

mod reasons;

use swerve_core::Time;
use swerve_map::Aspect;

use crate::car::{Car, Grant, LINE_GAP_M};
use crate::lights::Lights;
use crate::net::{Meeting, Net};
use crate::scene::Scene;
use crate::setup::DriverParams;

pub(crate) use reasons::Refusal;

/// Largest deceleration for a light that turns yellow, m/s².
const YELLOW_MPS2: f64 = 3.0;
/// Deceleration with which a driver waits for another in a junction, m/s².
const WAIT_MPS2: f64 = 3.0;
/// Time between the passages of two drivers, seconds.
const CLEAR_S: f64 = 0.5;
/// Speed below which a driver waits, m/s, and time at rest before a stop sign, seconds.
const REST_MPS: f64 = 0.3;
const STOP_SIGN_S: f64 = 1.0;
/// Time at rest after which a driver goes although there is no room beyond, seconds. Roads that are full in a circle
/// move on by that.
const FULL_S: f64 = 60.0;
/// Seconds of arrival that a second of waiting counts for in the order of drivers.
const WAITING_SHARE: f64 = 0.1;

/// Input of a tick of all junctions.
pub(crate) struct Junctions<'a> {
    pub(crate) net: &'a Net,
    pub(crate) scene: &'a Scene,
    pub(crate) lights: &'a Lights,
    pub(crate) params: &'a DriverParams,
    pub(crate) now: Time,
    pub(crate) dt_s: f64,
}

/// Result of a tick.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Granted {
    /// Circles of drivers who gave way to each other, resolved.
    pub(crate) circles: u64,
    /// Drivers who went although there was no room beyond, to resolve circles of full roads.
    pub(crate) full_roads: u64,
}

impl Junctions<'_> {
    /// Withdraws and gives grants. `number` is the last one given.
    pub(crate) fn grant(&self, cars: &mut [Car], reds: &[Option<f64>], number: &mut u64) -> Granted {
        let mut can = vec![false; cars.len()];
        let mut order: Vec<(f64, usize)> = Vec::new();
        for (who, car) in cars.iter_mut().enumerate().filter(|(_, car)| !car.is_hit) {
            self.withdraw(car, reds[who]);
            let Some(block) = car.next_block() else { continue };
            let to_m = block.stop_m - car.x_m;
            let v = car.speed_mps;
            if to_m > v * v / 3.0 + 1.5 * v + 8.0 {
                car.waits_s = 0.0;
                continue;
            }
            let is_red = reds[who].is_some_and(|red_m| red_m < block.end_m);
            let must_stop = block.has_stop_sign && !(car.stands_s >= STOP_SIGN_S && to_m < 3.0);
            can[who] = !is_red && !must_stop && !car.is_held;
            if !is_red && !must_stop {
                order.push((to_m.max(0.0) / v.max(5.0) - WAITING_SHARE * car.waits_s, who));
            }
        }
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut waiting: Vec<(usize, Vec<usize>)> = Vec::new();
        let mut without_room: Option<usize> = None;
        for (_, who) in order {
            let refusal = self.refusal(cars, who, &can);
            let car = &mut cars[who];
            car.is_held = matches!(refusal, Some(Refusal::Room | Refusal::Behind));
            match refusal {
                None => self.give(car, number),
                Some(Refusal::GivesWay(to)) => {
                    let stop_m = car.next_block().map_or(f64::INFINITY, |block| block.stop_m);
                    if car.speed_mps < REST_MPS && stop_m - car.x_m < 4.0 {
                        waiting.push((who, to));
                    }
                    car.waits_s += self.dt_s;
                }
                Some(Refusal::Behind) => {}
                Some(Refusal::Taken) => car.waits_s += self.dt_s,
                Some(Refusal::Room) => {
                    car.waits_s += self.dt_s;
                    if car.waits_s > FULL_S && car.stands_s > FULL_S && !car.at_red {
                        without_room = without_room.into_iter().chain([who]).min();
                    }
                }
            }
        }
        let mut granted = Granted::default();
        if let Some(first) = circle(waiting) {
            self.give(&mut cars[first], number);
            granted.circles = 1;
        }
        if let Some(first) = without_room {
            self.give(&mut cars[first], number);
            granted.full_roads = 1;
        }
        granted
    }

    /// Takes back grants of a driver who can still stop, or whom a red light holds.
    fn withdraw(&self, car: &mut Car, red_m: Option<f64>) {
        let v = car.speed_mps;
        let stops_m = v * v / (2.0 * self.params.brake_mps2) + 0.3;
        let is_void = |grant: &Grant| {
            grant.stop_m - car.x_m > stops_m || red_m.is_some_and(|red_m| grant.until_m > red_m)
        };
        while car.grants.back().is_some_and(is_void) {
            car.grants.pop_back();
        }
    }

    fn give(&self, car: &mut Car, number: &mut u64) {
        let Some(block) = car.next_block() else { return };
        let (until_m, stop_m) = (block.end_m, block.stop_m);
        *number += 1;
        car.grants.push_back(Grant { until_m, stop_m, number: *number });
        car.waits_s = 0.0;
    }

    /// Place before which a red light holds a driver, by the decision at yellow.
    pub(crate) fn red_m(&self, car: &mut Car) -> Option<f64> {
        let v = car.speed_mps;
        for &(lane, begin_m) in &car.way {
            if begin_m > car.x_m + 120.0 {
                break;
            }
            for (k, stop) in self.net.lane(lane).stops.iter().enumerate() {
                let place_m = begin_m + stop.s_m - car.half_m() - LINE_GAP_M;
                // A front beyond the line has passed it.
                let line = Some((lane, k));
                if place_m + LINE_GAP_M < car.x_m {
                    car.passes = car.passes.filter(|passes| Some(*passes) != line);
                    continue;
                }
                if stop.signals.is_empty() || place_m > car.x_m + 120.0 {
                    continue;
                }
                match self.lights.strictest(&stop.signals, self.now) {
                    Aspect::Green | Aspect::Off => {
                        // The next change to yellow is decided anew.
                        car.stops = car.stops.filter(|stops| Some(*stops) != line);
                        car.passes = car.passes.filter(|passes| Some(*passes) != line);
                    }
                    aspect => {
                        // A red light takes the grant: zones that begin before the line are then waited for, too.
                        let grant = car.grants.iter().find(|grant| grant.until_m > place_m);
                        let zones_m = grant.map(|grant| grant.stop_m).filter(|stop_m| *stop_m > car.x_m);
                        let stop_m = zones_m.map_or(place_m, |stop_m| stop_m.min(place_m));
                        let need_mps2 = v * v / (2.0 * (stop_m - car.x_m).max(0.01));
                        let can_stop = need_mps2 <= YELLOW_MPS2;
                        if car.stops == line || (car.passes != line && (can_stop || v < 1.0)) {
                            car.stops = line;
                            return Some(place_m);
                        }
                        // A light without yellow that turns red is passed if there is no way to stop.
                        if aspect != Aspect::Yellow && car.passes != line && need_mps2 < 8.0 {
                            car.stops = line;
                            return Some(place_m);
                        }
                        car.passes = line;
                    }
                }
            }
        }
        None
    }

    /// Nearest place at which a driver with grants waits for others who go first.
    pub(crate) fn wait_m(&self, cars: &[Car], who: usize) -> Option<f64> {
        let car = &cars[who];
        let v = car.speed_mps;
        let mut nearest: Option<f64> = None;
        for block in car.blocks.iter().filter(|block| block.begin_m <= car.granted_m()) {
            for (begin_m, zone) in &block.zones {
                let [in_m, out_m] = zone.at_m.map(|s_m| begin_m + s_m);
                if out_m < car.x_m || in_m - LINE_GAP_M < car.x_m - 0.1 {
                    continue;
                }
                let Some(own) = car.grant_at(in_m) else { continue };
                for coming in self.scene.coming(zone.other) {
                    if coming.who == who || !self.goes_first(cars, coming, zone, own) {
                        continue;
                    }
                    if self.follows_merging(cars, who, (*begin_m, zone), coming).is_some() {
                        continue;
                    }
                    let (other_in_s, other_out_s) = self.passage_s(cars, coming, zone);
                    let (own_in_s, own_out_s) = self.own_passage_s(car, [in_m, out_m]);
                    // A body that is not of the traffic has no grants: only its movement counts.
                    if coming.who >= cars.len() && own_out_s + CLEAR_S < other_in_s {
                        continue;
                    }
                    let stops_m = v * v / (2.0 * WAIT_MPS2) + 1.0;
                    if other_out_s + CLEAR_S < own_in_s && in_m - car.x_m > stops_m {
                        continue;
                    }
                    let place_m = in_m - LINE_GAP_M;
                    nearest = Some(nearest.map_or(place_m, |nearest: f64| nearest.min(place_m)));
                }
            }
        }
        nearest
    }

    /// Vehicle that a driver follows through a merge: its distance and speed.
    pub(crate) fn merge_leads(&self, cars: &[Car], who: usize) -> Option<(f64, f64)> {
        let car = &cars[who];
        let mut nearest: Option<(f64, f64)> = None;
        for block in car.blocks.iter().filter(|block| block.begin_m <= car.granted_m()) {
            for (begin_m, zone) in block.zones.iter().filter(|(_, zone)| zone.meeting == Meeting::Merge) {
                let in_m = begin_m + zone.at_m[0];
                let Some(own) = car.grant_at(in_m.max(car.x_m)) else { continue };
                for coming in self.scene.coming(zone.other) {
                    if coming.who == who || !self.goes_first(cars, coming, zone, own) {
                        continue;
                    }
                    let gap_m = self.follows_merging(cars, who, (*begin_m, zone), coming);
                    if let Some(gap_m) = gap_m
                        && nearest.is_none_or(|(nearest_m, _)| gap_m < nearest_m)
                    {
                        nearest = Some((gap_m, self.speed_mps(cars, coming.who)));
                    }
                }
            }
        }
        nearest
    }
}

/// The driver with the lowest index of those who wait for each other in circles.
fn circle(mut waiting: Vec<(usize, Vec<usize>)>) -> Option<usize> {
    loop {
        let who: Vec<usize> = waiting.iter().map(|one| one.0).collect();
        let before = waiting.len();
        waiting.retain(|(_, to)| to.iter().all(|other| who.contains(other)));
        if waiting.len() == before {
            return who.into_iter().min();
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lowest_of_a_circle_goes_first() {
        for (waiting, first) in [
            (vec![(4, vec![2]), (2, vec![7]), (7, vec![4])], Some(2)),
            // The last of the chain waits for someone who does not wait.
            (vec![(4, vec![2]), (2, vec![7]), (7, vec![1])], None),
            (vec![(3, vec![4]), (4, vec![5]), (5, vec![4])], Some(3)),
            (vec![], None),
        ] {
            assert_eq!(circle(waiting), first);
        }
    }
}
