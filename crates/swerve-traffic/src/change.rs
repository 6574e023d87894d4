//! Lane changes by MOBIL.

use swerve_map::{Map, Side};
use swerve_road_user::mobil::{Accelerations, Mobil};

use crate::car::{CHANGE_S, Car, Change};
use crate::net::{Meeting, Net, may_change};
use crate::scene::{On, Scene};

/// Time between two changes of a driver, seconds.
const BETWEEN_S: f64 = 6.0;
/// Length that must be left on both lanes in addition to that of the change, metres.
const LEFT_M: f64 = 20.0;
/// Distance before the end of a lane from which a driver prefers lanes that go on, metres, and the preference, m/s².
const ENDS_M: f64 = 250.0;
const ENDS_MPS2: f64 = 3.0;
/// Slowest speed at which a driver changes lanes, m/s: a vehicle does not move sideways at rest.
const SPEED_MIN_MPS: f64 = 2.0;

/// Time gap to those who merge into the same lane from its other side, seconds.
const MERGE_S: f64 = 1.0;

/// Input of a tick of lane changes.
pub(crate) struct Changes<'a> {
    pub(crate) map: &'a Map,
    pub(crate) net: &'a Net,
    pub(crate) scene: &'a Scene,
    pub(crate) mobil: &'a Mobil,
    pub(crate) seed: u64,
}

/// A lane to change to, and the place on it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Target {
    pub(crate) lane: usize,
    pub(crate) s_m: f64,
    d_m: f64,
}

impl Changes<'_> {
    /// Lane that a driver wants to change to.
    pub(crate) fn wanted(&self, cars: &[Car], who: usize) -> Option<Target> {
        let car = &cars[who];
        let is_free = car.change.is_none() && car.granted_m() < car.x_m && !car.cycles && !car.is_hit;
        if !is_free || car.since_change_s < BETWEEN_S || car.speed_mps < SPEED_MIN_MPS {
            return None;
        }
        let sides = [(0, Side::Left), (1, Side::Right)];
        let options = sides.into_iter().filter_map(|(k, side)| self.option(cars, who, k, side));
        options.reduce(|a, b| if b.0 > a.0 { b } else { a }).map(|(_, target)| target)
    }

    /// Incentive and target of a change to one side, if it is lawful, safe and worth it.
    fn option(&self, cars: &[Car], who: usize, k: usize, side: Side) -> Option<(f64, Target)> {
        let car = &cars[who];
        let (lane, s_m) = (self.net.lane(car.lane()), car.s_m());
        let target = lane.beside[k]?;
        let onto = self.net.lane(target);
        let along_m = car.speed_mps * CHANGE_S + LEFT_M;
        let place = onto.line.project_near(lane.line.at(s_m).pose.point(), s_m, 30.0);
        let ends_m = [s_m + along_m, place.s_m + along_m];
        if lane.in_junction || onto.in_junction || ends_m[0] > lane.length_m || ends_m[1] > onto.length_m {
            return None;
        }
        let lawful = may_change(self.map.lane(lane.id)?, side, [s_m, ends_m[0]]);
        let in_zone = |lane: usize, s_m: f64, end_m: f64| {
            let zones = self.net.lane(lane).zones.iter().filter(|zone| zone.meeting != Meeting::Fork);
            zones.into_iter().any(|zone| zone.at_m[0] < end_m && zone.at_m[1] > s_m - car.half_m())
        };
        if !lawful || in_zone(car.lane(), s_m, ends_m[0]) || in_zone(target, place.s_m, ends_m[1]) {
            return None;
        }
        if onto.beside[k].is_some_and(|entry| self.merges_beside(car, who, (target, place.s_m), entry)) {
            return None;
        }
        let end_m = lane.closed_m.unwrap_or(lane.length_m);
        let bias_mps2 = self.bias_mps2(car, end_m - s_m, target)?;
        let with = self.accelerations(cars, who, (target, place.s_m))?;
        let incentive_mps2 = self.mobil.incentive_mps2(&with, bias_mps2);
        let target = Target { lane: target, s_m: place.s_m, d_m: place.d_m };
        self.mobil.changes(&with, bias_mps2).then_some((incentive_mps2, target))
    }

    /// True if somebody beside the place on the target is on a lane that ends: they will change to the target, too.
    fn merges_beside(&self, car: &Car, who: usize, (target, s_m): (usize, f64), entry: usize) -> bool {
        if !self.net.ends(entry) {
            return false;
        }
        let [from, to] = [target, entry].map(|lane| &self.net.lane(lane).line);
        let s_m = to.project_near(from.at(s_m).pose.point(), s_m, 30.0).s_m;
        let is_near = |ahead: On, behind: On| {
            let gap_m = ahead.s_m - ahead.half_m - behind.s_m - behind.half_m;
            gap_m < car.idm.stand_gap_m + MERGE_S * behind.speed_mps
        };
        let own = On { s_m, half_m: car.half_m(), speed_mps: car.speed_mps, who };
        self.scene.leader(self.net, (entry, s_m), who).is_some_and(|ahead| is_near(ahead, own))
            || self.scene.follower(self.net, (entry, s_m), who).is_some_and(|behind| is_near(own, behind))
    }

    /// Preference of lanes that go on; `None` for a lane that ends while the present one does not.
    fn bias_mps2(&self, car: &Car, left_m: f64, target: usize) -> Option<f64> {
        match (self.net.ends(car.lane()), self.net.ends(target)) {
            (false, true) => None,
            (true, false) if left_m < ENDS_M => Some(ENDS_MPS2),
            _ => Some(0.0),
        }
    }

    fn accelerations(&self, cars: &[Car], who: usize, (target, s_m): (usize, f64)) -> Option<Accelerations> {
        let car = &cars[who];
        let gain_at = |speed_mps: f64, car: &Car, lane: usize, lead: Option<(f64, f64)>| {
            let desired_mps = (self.net.lane(lane).limit_mps * car.share).min(car.top_mps);
            car.idm.acceleration_mps2(speed_mps, desired_mps, lead)
        };
        let gain = |car: &Car, lane: usize, lead| gain_at(car.speed_mps, car, lane, lead);
        let own_lead = self.scene.lead(self.net, car, who).map(|lead| (lead.gap_m, lead.speed_mps));
        let gap_m = |ahead: On, behind_m: f64, half_m: f64| ahead.s_m - ahead.half_m - behind_m - half_m;
        let lead = self.scene.leader(self.net, (target, s_m), who);
        let new_lead = lead.map(|lead| (gap_m(lead, s_m, car.half_m()), lead.speed_mps));
        if new_lead.is_some_and(|(gap_m, _)| gap_m < car.idm.stand_gap_m) {
            return None;
        }
        let mut with = Accelerations {
            own_mps2: [gain(car, car.lane(), own_lead), gain(car, target, new_lead)],
            ..Accelerations::default()
        };
        if let Some(behind) = self.scene.follower(self.net, (target, s_m), who) {
            // A body that is not ours is expected to follow as this driver does.
            let follower = cars.get(behind.who).unwrap_or(car);
            let to_own = (s_m - car.half_m() - behind.s_m - behind.half_m, car.speed_mps);
            if to_own.0 < car.idm.stand_gap_m {
                return None;
            }
            let to_lead = lead.map(|lead| (gap_m(lead, behind.s_m, behind.half_m), lead.speed_mps));
            let follows = |lead| gain_at(behind.speed_mps, follower, target, lead);
            with.new_follower_mps2 = [follows(to_lead), follows(Some(to_own))];
        }
        let own = On { s_m: car.s_m(), half_m: car.half_m(), speed_mps: car.speed_mps, who };
        let behind = self.scene.follower(self.net, (car.lane(), own.s_m), who);
        if let Some((follower, body)) = behind.and_then(|body| Some((cars.get(body.who)?, body))) {
            let to_own = (gap_m(own, body.s_m, body.half_m), own.speed_mps);
            let to_lead = own_lead.map(|(gap_m, mps)| (to_own.0 + gap_m + car.extent.length_m, mps));
            with.old_follower_mps2 =
                [gain(follower, car.lane(), Some(to_own)), gain(follower, car.lane(), to_lead)];
        }
        Some(with)
    }

    /// Begins a change.
    pub(crate) fn begin(&self, car: &mut Car, target: Target) {
        let (from, s_m) = (car.lane(), car.s_m());
        car.change = Some(Change {
            from,
            offset_m: s_m - car.x_m,
            begin_d_m: target.d_m + car.beside_m,
            since_s: 0.0,
        });
        car.since_change_s = 0.0;
        car.way.clear();
        car.way.push_back((target.lane, car.x_m - target.s_m));
        car.blocks.clear();
        car.grants.clear();
        car.plan(self.net, self.seed);
    }
}
