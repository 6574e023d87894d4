//! Stop signs run (`RunningStopTest`).

use super::{Ego, RoutePlace, STANDS_MPS, StopSign, alignment};
use crate::score::leaderboard::Version;

/// Cosine of 100 degrees, and the speed in m/s, below which the ego faces or drives against its lane (2.x).
const AGAINST: f64 = -0.17;

/// Search for signs.
#[derive(Clone, Debug)]
struct Search {
    /// Distance of signs, metres.
    near_m: f64,
    /// Points of the lane ahead that are compared with the area of a sign: distance in metres, and number.
    step_m: f64,
    steps: u32,
    /// Length of the area, as a multiple.
    length: f64,
}

impl Search {
    fn finds(&self, sign: &StopSign) -> bool {
        let grown_m = 0.5 * (self.length - 1.0) * (sign.to_m - sign.from_m);
        let is_inside = |at_m: f64| sign.from_m - grown_m < at_m && at_m < sign.to_m + grown_m;
        sign.distance_m <= self.near_m && (0..=self.steps).any(|k| is_inside(self.step_m * f64::from(k)))
    }
}

#[derive(Clone, Debug)]
pub(super) struct StopSigns {
    version: Version,
    search: Search,
    /// The sign in whose effect the ego is.
    target: Option<u64>,
    has_stopped: bool,
    /// True if the ego was inside the area.
    was_inside: bool,
    /// The last sign that was run; 2.x does not count it twice running.
    last: Option<u64>,
}

impl StopSigns {
    pub(super) fn new(version: Version) -> Self {
        let search = if version.is_second() {
            Search { near_m: 4.0, step_m: 0.5, steps: 8, length: 1.2 }
        } else {
            Search { near_m: 50.0, step_m: 1.0, steps: 20, length: 1.0 }
        };
        Self { version, search, target: None, has_stopped: false, was_inside: false, last: None }
    }

    /// Number of signs run in this step: at most one.
    pub(super) fn take(&mut self, ego: &Ego, place: &RoutePlace, signs: &[StopSign]) -> u32 {
        let Some(target) = self.target else {
            let found = |sign: &&StopSign| self.search.finds(sign);
            let is_along = self.is_along(ego, place);
            self.target = signs.iter().filter(|_| is_along).find(found).map(|sign| sign.id);
            return 0;
        };
        self.has_stopped |= ego.speed_mps < STANDS_MPS;
        let sign = signs.iter().find(|sign| sign.id == target);
        self.was_inside |= sign.is_some_and(|sign| sign.from_m < 0.0 && 0.0 < sign.to_m);
        if sign.is_some_and(|sign| self.search.finds(sign)) {
            return 0;
        }
        let counts = match self.version.is_second() {
            true => self.last != Some(target),
            false => self.was_inside,
        };
        let is_run = !self.has_stopped && counts;
        self.last = if is_run { Some(target) } else { self.last };
        (self.target, self.has_stopped, self.was_inside) = (None, false, false);
        u32::from(is_run)
    }

    fn is_along(&self, ego: &Ego, place: &RoutePlace) -> bool {
        let along = alignment(ego.center, place.lane_heading_rad);
        match self.version.is_second() {
            true => along >= AGAINST && ego.forward_mps >= AGAINST,
            false => along > 0.0,
        }
    }
}
