//! Moving up in a junction: while the ego waits, it drives slowly to just before the first zone of those with priority.

use swerve_msg::SpeedLimit;

use super::block::{Block, RouteCrossing, RouteZone, ZONE_GAP_M};
use super::entry::Entry;
use super::others::{REST_MPS, Vehicle};
use super::{Held, STOP_SIGN_S};

/// Shortest way that is worth it, metres.
const LEAST_M: f64 = 3.0;
/// Distance before the new place to wait within which the ego has arrived once it is at rest, metres.
const ARRIVED_M: f64 = 2.5;
/// Time at rest after which an ego that may move up waits where it is, seconds: something else is in its way.
const STARTS_S: f64 = 2.0;
/// Distance kept behind the vehicle ahead, metres.
const BEHIND_M: f64 = 2.0;

/// Bounds of moving up, apart from zones.
#[derive(Clone, Copy)]
pub(super) struct Around<'a> {
    /// Crossings of the route, the nearest first.
    pub(super) crossings: &'a [(RouteCrossing, Held)],
    /// Place of the rear of the vehicle ahead, metres.
    pub(super) lead_m: Option<f64>,
}

impl Entry<'_> {
    /// Place to which the front of the ego may move up in a block in which others have to pass first, metres.
    pub(super) fn creep_m(&self, block: &Block, around: Around<'_>) -> Option<f64> {
        let mut ahead = block.zones.iter().filter(|zone| zone.at_m[0] > self.own.center_m);
        let mut to_m = ahead.find(|zone| self.is_closed(zone))?.at_m[0] + self.own.half_m - ZONE_GAP_M;
        let length_m = 2.0 * self.own.half_m;
        for (crossing, _) in around.crossings.iter().rev() {
            if to_m > crossing.stop_m && to_m - length_m < crossing.at_m[1] {
                to_m = crossing.stop_m;
            }
        }
        let is_behind = around.lead_m.is_some_and(|lead_m| lead_m - BEHIND_M < to_m);
        (!is_behind).then_some(to_m)
    }

    /// True if vehicles with priority use a zone, or somebody comes to it, or stays in it.
    fn is_closed(&self, zone: &RouteZone) -> bool {
        let there_s = (zone.at_m[0] - self.own.center_m) / self.params.creep_mps.max(REST_MPS);
        let is_in_way = |other: &Vehicle| {
            let leaves = |out_m: f64| other.speed_mps > REST_MPS && out_m / other.speed_mps < there_s;
            self.way_m(other, zone).is_some_and(|[in_m, out_m]| in_m > 0.0 || !leaves(out_m))
        };
        zone.zone.yields || self.vehicles.iter().any(is_in_way)
    }
}

impl Held {
    /// Place before which the ego waits, metres.
    pub(super) fn stop_m(&self, block: &Block) -> f64 {
        self.creep_m.unwrap_or(block.stop_m)
    }

    /// Moves the place to wait while others have to pass first.
    pub(super) fn move_up(&mut self, block: &Block, entry: &Entry<'_>, around: Around<'_>) {
        let own = entry.own;
        let stop_m = self.stop_m(block);
        let to_m = entry.creep_m(block, around).map_or(block.stop_m, |to_m| to_m.max(block.stop_m));
        let may_begin = entry.params.creep_mps > 0.0 && block.light_m.is_none();
        if to_m < stop_m {
            // Somebody comes: the ego stays where it is.
            self.creep_m = Some(to_m.max(own.front_m));
        } else if to_m > stop_m.max(own.front_m) + LEAST_M && self.stands_s >= STOP_SIGN_S && may_begin {
            (self.creep_m, self.creeps, self.stands_s) = (Some(to_m), true, 0.0);
        }
        let left_m = self.stop_m(block) - own.front_m;
        let may_start = left_m > ARRIVED_M && self.stands_s < STARTS_S;
        self.creeps &= own.speed_mps >= REST_MPS || may_start;
    }
}

/// Limits with which the ego moves up to a place.
pub(super) fn slow(limits: &[SpeedLimit], [from_m, to_m]: [f64; 2], speed_mps: f64) -> Vec<SpeedLimit> {
    let beyond = limits.iter().rev().find(|limit| limit.from_m <= to_m).or(limits.first());
    let beyond = beyond.map(|limit| SpeedLimit { from_m: to_m, ..*limit });
    let slow = SpeedLimit { from_m, speed_mps };
    let rest = limits.iter().copied().filter(|limit| limit.from_m > to_m);
    [slow].into_iter().chain(beyond).chain(rest).collect()
}
