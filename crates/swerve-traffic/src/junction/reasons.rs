//! Reasons why a driver may not enter a block of zones now.

use swerve_road_user::travel::time_s;

use super::{CLEAR_S, Junctions, REST_MPS};
use crate::car::{Block, Car};
use crate::net::{Meeting, Zone};
use crate::scene::Coming;

/// Acceleration that others are expected to have, m/s².
const GAIN_MPS2: f64 = 1.5;
/// Deceleration that an impatient driver imposes on others, m/s².
const IMPOSED_MPS2: f64 = 1.5;
/// Length beyond a block that is looked at for room, metres, and the length that a vehicle in a queue takes in addition to
/// its gap.
const ROOM_M: f64 = 100.0;
const SLACK_M: f64 = 0.5;
/// Length before the end of a block in which others are about to leave it, metres.
const NEAR_M: f64 = 40.0;
/// Length beyond a block on which the ways that leave it are one, metres.
const BEYOND_M: f64 = 4.0;
/// Speed below which a vehicle may be about to stop, m/s.
const CRAWLS_MPS: f64 = 1.0;
/// Speed below which a body that is not ours counts as one that stays, m/s.
const STAYS_MPS: f64 = 0.5;
/// Speed up to which such a body waits although it moves, m/s.
const CREEPS_MPS: f64 = 2.0;

/// Reason of a refusal.
#[derive(Clone, PartialEq, Eq, Debug)]
pub(crate) enum Refusal {
    /// A vehicle ahead is not through.
    Behind,
    /// There is no room beyond.
    Room,
    /// Someone with a grant, or a body that is not ours, is in the zone or will be.
    Taken,
    /// Cars with priority are coming.
    GivesWay(Vec<usize>),
}

impl Junctions<'_> {
    /// Reason why a driver may not enter the next block; `None` if it may.
    pub(super) fn refusal(&self, cars: &[Car], who: usize, can: &[bool]) -> Option<Refusal> {
        let car = &cars[who];
        let block = car.next_block()?;
        if let Some(lead) = self.scene.lead(self.net, car, who).filter(|lead| lead.place_m < block.begin_m) {
            let Some(ahead) = cars.get(lead.who) else { return Some(Refusal::Behind) };
            let until_m = block.begin_m - lead.place_m + 3.0;
            if ahead.next_block().is_some_and(|other| other.begin_m - ahead.x_m < until_m) {
                return Some(Refusal::Behind);
            }
        }
        let mut to = Vec::new();
        for (begin_m, zone) in &block.zones {
            let at_m = zone.at_m.map(|s_m| begin_m + s_m);
            let (in_s, out_s) = self.own_passage_s(car, at_m);
            for coming in self.scene.coming(zone.other).iter().filter(|coming| coming.who != who) {
                let [other_in_m, other_out_m] =
                    zone.other_m.map(|s_m| coming.begin_m + s_m - self.x_m(cars, coming.who));
                if other_out_m < 0.0 {
                    continue;
                }
                let (other_in_s, other_out_s) = self.passage_s(cars, coming, zone);
                let Some(other) = cars.get(coming.who) else {
                    if self.waits_outside(coming, zone, other_in_m) {
                        continue;
                    }
                    let moves = self.speed_mps(cars, coming.who) > STAYS_MPS;
                    let is_in = other_in_m <= 0.0;
                    let comes = moves && other_in_s - self.params.margin_s - CLEAR_S < out_s;
                    if (is_in || comes) && other_out_s + CLEAR_S > in_s {
                        return Some(Refusal::Taken);
                    }
                    continue;
                };
                let has_grant =
                    other_in_m <= 0.0 || other.grant_at(coming.begin_m + zone.other_m[0]).is_some();
                if has_grant {
                    let follows =
                        zone.meeting == Meeting::Merge && self.follows(cars, who, (*begin_m, zone), coming);
                    if !follows && other_out_s + CLEAR_S > in_s {
                        return Some(Refusal::Taken);
                    }
                } else if zone.yields && can[coming.who] && !self.may_impose(cars, who, other, other_in_m) {
                    // A faster car behind needs room to adapt its speed.
                    let merges = zone.meeting == Meeting::Merge;
                    let adapts_s =
                        if merges { other.speed_mps / (2.0 * self.params.brake_mps2) * 0.5 } else { 0.0 };
                    if other_in_s - self.params.margin_s - adapts_s < out_s && !to.contains(&coming.who) {
                        to.push(coming.who);
                    }
                }
            }
        }
        if !to.is_empty() {
            return Some(Refusal::GivesWay(to));
        }
        (!self.has_room(cars, who, block)).then_some(Refusal::Room)
    }

    /// True if a driver may merge behind another one without braking hard.
    fn follows(&self, cars: &[Car], who: usize, own: (f64, &Zone), coming: &Coming) -> bool {
        let [v, other] = [cars[who].speed_mps, self.speed_mps(cars, coming.who)];
        let brakes_m = ((v * v - other * other) / (2.0 * self.params.brake_mps2)).max(0.0);
        self.merge_gap_m(cars, who, own, coming) > cars[who].idm.stand_gap_m + brakes_m
    }

    /// Gap to a vehicle that a driver follows through a merge; `None` if it waits before the merge.
    pub(super) fn follows_merging(
        &self,
        cars: &[Car],
        who: usize,
        own: (f64, &Zone),
        coming: &Coming,
    ) -> Option<f64> {
        let (begin_m, zone) = own;
        let car = &cars[who];
        // In the merge, there is no place left to wait.
        let least_m = if car.x_m < begin_m + zone.at_m[0] { car.idm.stand_gap_m } else { 0.0 };
        let gap_m = self.merge_gap_m(cars, who, own, coming);
        (zone.meeting == Meeting::Merge && gap_m > least_m).then_some(gap_m)
    }

    /// True if a driver who has waited long may make another brake comfortably.
    fn may_impose(&self, cars: &[Car], who: usize, other: &Car, other_in_m: f64) -> bool {
        let (v, waits_s) = (other.speed_mps, cars[who].waits_s);
        let brakes = other_in_m > v * v / (2.0 * IMPOSED_MPS2) + v + 3.0;
        // Of two who wait, the one who has waited for longer goes first.
        let waits_less = v < REST_MPS && other.waits_s < waits_s;
        waits_s > self.params.patience_s && (brakes || waits_less)
    }

    /// True if there is room beyond a block for this driver and all who go there before it, also if everybody there
    /// closes up behind the next place to wait.
    fn has_room(&self, cars: &[Car], who: usize, block: &Block) -> bool {
        let car = &cars[who];
        let end_m = block.end_m;
        let Some(at) = car.way.iter().rposition(|(_, begin_m)| *begin_m <= end_m) else { return true };
        let next = car.blocks.iter().find(|next| next.begin_m > end_m).map(|next| next.stop_m + car.half_m());
        let to_m = next.unwrap_or(f64::INFINITY).min(end_m + ROOM_M);
        let (mut free_m, mut moving_m) = (to_m - end_m, 0.0);
        'bodies: for &(lane, begin_m) in car.way.iter().skip(at).take_while(|(_, begin_m)| *begin_m < to_m) {
            let on = self.scene.between(lane, [end_m - begin_m, to_m - begin_m]);
            for body in on.filter(|body| body.who != who) {
                if body.speed_mps < CRAWLS_MPS {
                    // It may stay where it is.
                    free_m = free_m.min(begin_m + body.s_m - body.half_m - end_m);
                    break 'bodies;
                }
                moving_m += 2.0 * body.half_m + car.idm.stand_gap_m + SLACK_M;
            }
        }
        // Ways that meet do so shortly after their last zones at the latest.
        let beyond = car.way.iter().rposition(|(_, begin_m)| *begin_m <= end_m + BEYOND_M).unwrap_or(at);
        let (lane, begin_m) = car.way[beyond];
        let s_m = end_m - begin_m;
        let before = self.scene.coming(lane).iter().filter_map(|coming| {
            let other = cars.get(coming.who).filter(|_| coming.who != who)?;
            let place_m = coming.begin_m + s_m;
            let is_near = (0.0..NEAR_M).contains(&(place_m - other.x_m));
            // No block holds it before that place.
            let goes_there = is_near && other.next_block().is_none_or(|held| held.begin_m > place_m - 1.0);
            goes_there.then_some(other.extent.length_m + other.idm.stand_gap_m + SLACK_M)
        });
        let taken_m = moving_m + before.sum::<f64>();
        free_m - taken_m >= car.half_m() + car.idm.stand_gap_m + 2.0 * SLACK_M
    }

    pub(super) fn x_m(&self, cars: &[Car], who: usize) -> f64 {
        cars.get(who).map_or(0.0, |car| car.x_m)
    }

    pub(super) fn speed_mps(&self, cars: &[Car], who: usize) -> f64 {
        match cars.get(who) {
            Some(car) => car.speed_mps,
            None => self.scene.others[who - self.scene.cars].velocity_mps.norm(),
        }
    }

    fn half_m(&self, cars: &[Car], who: usize) -> f64 {
        match cars.get(who) {
            Some(car) => car.half_m(),
            None => self.scene.others[who - self.scene.cars].body.half_length_m,
        }
    }

    /// True if another vehicle goes first in a zone and has not left it: one in the zone, one with a lower number, a
    /// body that is not ours and moves towards it.
    pub(super) fn goes_first(&self, cars: &[Car], coming: &Coming, zone: &Zone, own: u64) -> bool {
        let [in_m, out_m] = zone.other_m.map(|s_m| coming.begin_m + s_m - self.x_m(cars, coming.who));
        if out_m < 0.0 {
            return false;
        }
        match cars.get(coming.who) {
            Some(other) => {
                let number = other.grant_at(coming.begin_m + zone.other_m[0].max(0.0));
                number.is_some_and(|number| number < own) || (in_m <= 0.0 && number.is_none())
            }
            None if self.waits_outside(coming, zone, in_m) => false,
            None => in_m <= 0.0 || (self.speed_mps(cars, coming.who) > STAYS_MPS && in_m < 30.0),
        }
    }

    /// True if a body that is not ours has to give way, and stands, or moves up slowly before the zone. Where it is on a
    /// lane, it is a vehicle ahead.
    fn waits_outside(&self, coming: &Coming, zone: &Zone, in_m: f64) -> bool {
        let other = coming.who.checked_sub(self.scene.cars).and_then(|k| self.scene.others.get(k));
        let waits = |v: f64| v < STAYS_MPS || (in_m > 0.0 && v < CREEPS_MPS);
        !zone.yields && other.is_some_and(|other| waits(other.velocity_mps.norm()))
    }

    /// Gap to another vehicle if both were on the lane in which the two lanes end, metres; negative if this one is
    /// ahead or beside it.
    pub(super) fn merge_gap_m(&self, cars: &[Car], who: usize, own: (f64, &Zone), coming: &Coming) -> f64 {
        let (begin_m, zone) = own;
        let car = &cars[who];
        // Lengths of lanes that merge differ; their ends are at one place.
        let own_m = begin_m + zone.at_m[1] - car.x_m;
        let other_m = coming.begin_m + zone.other_m[1] - self.x_m(cars, coming.who);
        own_m - other_m - car.half_m() - self.half_m(cars, coming.who)
    }

    /// Instants at which another vehicle enters a zone at the earliest, and has left it, seconds from now.
    pub(super) fn passage_s(&self, cars: &[Car], coming: &Coming, zone: &Zone) -> (f64, f64) {
        let x_m = self.x_m(cars, coming.who);
        let [in_m, out_m] = zone.other_m.map(|s_m| coming.begin_m + s_m - x_m);
        match cars.get(coming.who) {
            Some(other) => {
                let lane = self.net.lane(zone.other);
                let cruise_mps = (lane.slowest_mps() * other.share).min(other.top_mps);
                let v = other.speed_mps;
                (time_s(in_m, v, cruise_mps.max(v), GAIN_MPS2), time_s(out_m, v, cruise_mps, GAIN_MPS2))
            }
            None => {
                let v = self.speed_mps(cars, coming.who).max(0.01);
                (in_m.max(0.0) / v, out_m / v)
            }
        }
    }

    /// The same for a driver and a part of its way.
    pub(super) fn own_passage_s(&self, car: &Car, [in_m, out_m]: [f64; 2]) -> (f64, f64) {
        let on = car.way.iter().rev().find(|(_, begin_m)| *begin_m <= out_m);
        let lane_mps = on.map_or(f64::INFINITY, |(lane, _)| self.net.lane(*lane).slowest_mps());
        // The model approaches its desired speed ever more slowly.
        let cruise_mps = 0.9 * (lane_mps * car.share).min(car.top_mps);
        let v = car.speed_mps;
        let gain_mps2 = 0.8 * car.idm.gain_mps2;
        (
            time_s(in_m - car.x_m, v, cruise_mps.max(v), gain_mps2),
            time_s(out_m - car.x_m, v, cruise_mps, gain_mps2),
        )
    }
}
