//! Reasons why the ego may not pass zones now.

use swerve_map::conflict::Meeting;
use swerve_msg::ActorId;
use swerve_road_user::travel::time_s;

use super::block::{Block, RouteZone, ZONE_GAP_M};
use super::others::{REST_MPS, Vehicle};
use super::{Own, RuleBasedParams};

/// Time between the passages of two vehicles, seconds.
const CLEAR_S: f64 = 0.5;
/// Acceleration that others are expected to have at least and at most, m/s². Below this speed, m/s, somebody starts: others with
/// the largest one, the ego after a delay, seconds.
const GAIN_MPS2: [f64; 2] = [0.01, 1.5];
const STARTS_MPS: f64 = 4.0;
const START_S: f64 = 0.3;
/// Deceleration with which others cannot stop any more, m/s².
const STOPS_MPS2: f64 = 4.0;
/// Deceleration that an impatient ego imposes on others, m/s².
const IMPOSED_MPS2: f64 = 2.0;
/// Deceleration to the speed of others in a merge, m/s².
const ADAPTS_MPS2: f64 = 2.0;
/// Half of the length of the bodies of which zones are computed, metres.
const ZONE_HALF_M: f64 = 2.8;
/// Time at rest after which the ego and others resolve a circle, seconds, and that after which others are not expected
/// to move at all.
const CIRCLE_S: f64 = 5.0;
const OTHERS_REST_S: f64 = 3.0;
const NEVER_S: f64 = 30.0;
/// Difference of places that decides who goes first, metres.
const ORDER_M: f64 = 0.5;
/// Gap to the vehicle ahead beyond a block, metres, and the speed below which it may stay where it is, m/s.
const ROOM_GAP_M: f64 = 2.0;
const CRAWLS_MPS: f64 = 1.0;
/// Time at rest after which the ego goes although there is no room beyond, seconds: others may have parked there.
const FULL_S: f64 = 60.0;

/// Reason of a refusal.
#[derive(Clone, PartialEq, Debug)]
pub(super) enum Refusal {
    /// Vehicles with priority come, or others are in the way.
    GiveWay(Vec<ActorId>),
    /// There is no room beyond, because of this vehicle.
    NoRoom(ActorId),
}

/// Situation in which it is decided about blocks.
#[derive(Clone, Copy)]
pub(super) struct Entry<'a> {
    pub(super) own: Own,
    pub(super) params: &'a RuleBasedParams,
    pub(super) vehicles: &'a [Vehicle],
    /// Time for which the ego waits at rest, seconds.
    pub(super) waits_s: f64,
    /// Time for which it goes, seconds; 0 while it waits.
    pub(super) goes_s: f64,
    /// Share of all reserves that suffices.
    pub(super) share: f64,
    /// True if a light lets the ego pass: others have red, except for oncoming traffic.
    pub(super) has_green: bool,
    /// True if the ego has moved up into the block.
    pub(super) has_moved_up: bool,
}

/// Passage of the ego through a zone.
#[derive(Clone, Copy)]
struct Passage {
    /// Instants at which it enters and has left the zone, seconds from now.
    in_s: f64,
    out_s: f64,
    /// Speed with which it leaves, m/s.
    merge_mps: f64,
}

impl<'a> Entry<'a> {
    /// Reason why the ego may not enter a block; `None` if it may.
    pub(super) fn refusal(&self, block: &Block) -> Option<Refusal> {
        let mut to: Vec<ActorId> = Vec::new();
        // Where the ego stands already, others wait for it.
        let is_ahead = |zone: &&RouteZone| !self.has_moved_up || zone.at_m[0] > self.own.center_m;
        for zone in block.zones.iter().filter(is_ahead) {
            let passage = self.passage(block, zone);
            let in_way = self.vehicles.iter().filter(|other| self.is_in_way(other, zone, passage));
            to.extend(in_way.map(|other| other.id));
        }
        to.sort_unstable();
        to.dedup();
        if !to.is_empty() {
            return Some(Refusal::GiveWay(to));
        }
        self.without_room(block).filter(|_| self.waits_s < FULL_S).map(Refusal::NoRoom)
    }

    /// Place before a zone of a block that the ego is in at which its front stops for others, and they.
    pub(super) fn stop_inside(&self, block: &Block) -> Option<(f64, Vec<ActorId>)> {
        let ahead = block.zones.iter().filter(|zone| zone.at_m[0] > self.own.center_m);
        let (zone, to) = ahead.clone().find_map(|zone| {
            let passage = self.passage(block, zone);
            let in_way = self.vehicles.iter().filter(|other| self.is_in_way(other, zone, passage));
            let to: Vec<ActorId> = in_way.map(|other| other.id).collect();
            (!to.is_empty()).then_some((zone, to))
        })?;
        let center_m = zone.at_m[0] - ZONE_GAP_M;
        let to_m = center_m - self.own.center_m;
        let can_stop = self.own.speed_mps * self.own.speed_mps <= 2.0 * STOPS_MPS2 * to_m;
        // In a zone of others with priority the ego does not stay.
        let blocks = block.zones.iter().any(|other| {
            let is_in = other.at_m[0] < center_m && center_m < other.at_m[1];
            let comes = |vehicle: &Vehicle| self.way_m(vehicle, other).is_some_and(|[_, out_m]| out_m > 0.0);
            is_in && other.zone.yields && self.vehicles.iter().any(comes)
        });
        (can_stop && !blocks).then_some((center_m + self.own.half_m, to))
    }

    /// Vehicles that must give way to the ego in all zones of a block that they may come to, and their ways to the
    /// nearest one, metres.
    pub(super) fn must_yield(&self, block: &Block) -> Vec<(&'a Vehicle, f64)> {
        let stop_m = |other: &'a Vehicle| {
            let gives_way = |zone: &RouteZone| !zone.zone.yields || self.has_red(other, zone);
            let mut nearest_m = f64::INFINITY;
            for zone in block.zones.iter().filter(|zone| zone.at_m[1] > self.own.center_m) {
                let Some([in_m, _]) = self.way_m(other, zone) else { continue };
                nearest_m = if gives_way(zone) { nearest_m.min(in_m) } else { return None };
            }
            nearest_m.is_finite().then_some((other, nearest_m))
        };
        self.vehicles.iter().filter(|other| !other.kind.is_person()).filter_map(stop_m).collect()
    }

    /// Passage of the ego through a zone.
    fn passage(&self, block: &Block, zone: &RouteZone) -> Passage {
        let Own { center_m, speed_mps: v, cruise_mps, .. } = self.own;
        let cruise_mps = block.cruise_mps.min(cruise_mps);
        let begins_s = START_S * (1.0 - v / STARTS_MPS).max(0.0);
        let [in_m, out_m] = zone.at_m.map(|s_m| s_m - center_m);
        let gain_mps2 = self.params.gain_mps2;
        let gained_mps = (v * v + 2.0 * gain_mps2 * out_m.max(0.0)).sqrt();
        Passage {
            in_s: begins_s + time_s(in_m, v, cruise_mps.max(v), gain_mps2),
            out_s: begins_s + time_s(out_m, v, cruise_mps, gain_mps2),
            merge_mps: gained_mps.min(cruise_mps),
        }
    }

    /// Ways of a vehicle to its begin and end of a zone, metres; `None` if it does not come there, or drives before or
    /// behind the ego on its way.
    pub(super) fn way_m(&self, other: &Vehicle, zone: &RouteZone) -> Option<[f64; 2]> {
        let is_on_way = other.route_m.is_some_and(|s_m| s_m < zone.at_m[1]);
        let reach = other.reach(zone.zone.other).filter(|_| !is_on_way)?;
        let longer_m = (other.half_m - ZONE_HALF_M).max(0.0);
        let [in_m, out_m] = zone.zone.other_m;
        let way_m = [reach.to_m + in_m - longer_m, reach.to_m + out_m + longer_m];
        (way_m[1] > 0.0).then_some(way_m)
    }

    /// True if a red light holds a vehicle, because the ego has green.
    fn has_red(&self, other: &Vehicle, zone: &RouteZone) -> bool {
        let has_light = other.reach(zone.zone.other).is_some_and(|reach| reach.has_light);
        self.has_green && !zone.is_oncoming && has_light
    }

    /// True if the ego would get into the way of a vehicle, or the other way round, where it does not have to wait.
    fn is_in_way(&self, other: &Vehicle, zone: &RouteZone, passage: Passage) -> bool {
        let Passage { in_s: own_in_s, out_s: own_out_s, merge_mps } = passage;
        let Some([in_m, out_m]) = self.way_m(other, zone) else { return false };
        let v = other.speed_mps;
        let is_in = in_m <= 0.0;
        let leaves_s = if v > REST_MPS { out_m / v } else { f64::INFINITY };
        if leaves_s + self.share * CLEAR_S <= own_in_s || (is_in && self.follows(other, zone, out_m)) {
            return false;
        }
        if is_in {
            return true;
        }
        let is_unable = other.needed_mps2(in_m) > STOPS_MPS2;
        if self.has_red(other, zone) || !zone.zone.yields {
            return is_unable && in_m / v - CLEAR_S < own_out_s;
        }
        if self.is_taken_to_stay(other) {
            return false;
        }
        // Somebody slow may speed up at any time, the less the faster they are.
        let [least_mps2, most_mps2] = GAIN_MPS2;
        let starts_mps2 = most_mps2 * (1.0 - v / STARTS_MPS);
        let gain_mps2 = other.gain_mps2.clamp(least_mps2, most_mps2).max(starts_mps2);
        // Others may be faster than the limit, but not faster than bends let them be.
        let comes_s = time_s(in_m, v, zone.other_mps, gain_mps2);
        // An accepted gap shrinks while the ego uses it.
        let imposed_mps2 = if self.goes_s > 0.0 { STOPS_MPS2 } else { IMPOSED_MPS2 };
        let accepts = comes_s + self.goes_s >= self.params.gap_s && needed_mps2(v, in_m) <= imposed_mps2;
        if accepts && self.waits_s > self.params.patience_s {
            return false;
        }
        // A faster vehicle behind needs room to adapt its speed.
        let is_merge = zone.zone.meeting == Meeting::Merge;
        let faster_mps = (v.min(zone.other_mps) - merge_mps).max(0.0);
        let adapts_s = if is_merge { faster_mps / (2.0 * ADAPTS_MPS2) } else { 0.0 };
        comes_s - self.share * (self.params.margin_s + adapts_s) < own_out_s
    }

    /// True if a vehicle in a merge is so far ahead that the ego follows it.
    fn follows(&self, other: &Vehicle, zone: &RouteZone, out_m: f64) -> bool {
        let own_m = zone.at_m[1] - self.own.center_m;
        let (v, lead_mps) = (self.own.speed_mps, other.speed_mps);
        let brakes_m = ((v * v - lead_mps * lead_mps) / (2.0 * self.params.brake_mps2)).max(0.0);
        let gap_m = own_m - out_m - self.own.half_m - other.half_m;
        zone.zone.meeting == Meeting::Merge && gap_m > ROOM_GAP_M + brakes_m
    }

    /// True if a vehicle with priority at rest is taken to stay there: of two that wait for each other, the one goes that
    /// is farther to the west and south. Nobody goes if that is not clear.
    fn is_taken_to_stay(&self, other: &Vehicle) -> bool {
        let order_m = |x_m: f64, y_m: f64| 0.8 * x_m + 0.6 * y_m;
        let is_first =
            order_m(self.own.x_m, self.own.y_m) < order_m(other.pose.x_m, other.pose.y_m) - ORDER_M;
        let rests = other.stands_s > OTHERS_REST_S;
        rests && ((self.waits_s > CIRCLE_S && is_first) || self.waits_s > NEVER_S)
    }

    /// The vehicle because of which there is no room beyond a block.
    fn without_room(&self, block: &Block) -> Option<ActorId> {
        let mut taken_m = self.own.half_m + ROOM_GAP_M;
        let mut ahead: Vec<(f64, &Vehicle)> = self
            .vehicles
            .iter()
            .filter_map(|other| Some((other.route_m?, other)))
            .filter(|(s_m, _)| *s_m > self.own.center_m && *s_m > block.begin_m)
            .collect();
        ahead.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.id.cmp(&b.1.id)));
        for (s_m, other) in ahead {
            if other.speed_mps < CRAWLS_MPS {
                return (s_m - other.half_m - block.end_m < taken_m).then_some(other.id);
            }
            taken_m += 2.0 * other.half_m + ROOM_GAP_M;
        }
        None
    }
}

/// Deceleration with which a vehicle stops within a distance, m/s².
pub(super) fn needed_mps2(speed_mps: f64, within_m: f64) -> f64 {
    if speed_mps == 0.0 { 0.0 } else { speed_mps * speed_mps / (2.0 * within_m.max(0.01)) }
}
