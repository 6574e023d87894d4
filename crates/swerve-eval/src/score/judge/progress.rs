//! Rules that follow the progress along the route.

use super::{JudgedRoute, RoutePlace};
use crate::score::leaderboard::Version;
use crate::score::rounded;

/// Share of the route driven outside its lanes (`OutsideRouteLanesTest`).
#[derive(Clone, Debug)]
pub(super) struct OutsideLanes {
    /// Distance from the lanes that is allowed, metres.
    allowed_m: f64,
    total_m: f64,
    outside_m: f64,
}

impl OutsideLanes {
    pub(super) fn new(version: Version) -> Self {
        let allowed_m = if version.is_second() { 0.5 } else { 1.3 };
        Self { allowed_m, total_m: 0.0, outside_m: 0.0 }
    }

    pub(super) fn take(&mut self, place: &RoutePlace, advance_m: f64) {
        self.total_m += advance_m;
        if place.off_lanes_m > self.allowed_m || place.against_traffic {
            self.outside_m += advance_m;
        }
    }

    pub(super) fn percent(&self) -> f64 {
        if self.outside_m > 0.0 { self.outside_m / self.total_m * 100.0 } else { 0.0 }
    }
}

/// Distance from the route that ends it at once, metres.
const OFF_MAX_M: f64 = 30.0;
/// Distance from the route from which on the way counts, metres.
const OFF_SAFE_M: f64 = 15.0;
/// Share of the route that may be driven beyond that distance, percent.
const OFF_PERCENT: f64 = 30.0;

/// Deviation from the route (`InRouteTest`).
#[derive(Clone, Debug)]
pub(super) struct Deviation {
    length_m: f64,
    off_m: f64,
}

impl Deviation {
    pub(super) fn new(length_m: f64) -> Self {
        Self { length_m, off_m: 0.0 }
    }

    /// Returns true if the ego has left the route.
    pub(super) fn take(&mut self, off_route_m: f64, advance_m: f64) -> bool {
        if off_route_m >= OFF_SAFE_M {
            self.off_m += advance_m;
        }
        off_route_m >= OFF_MAX_M || 100.0 * self.off_m / self.length_m > OFF_PERCENT
    }
}

/// Time for the route: in 1.0 by its length, in 2.x by the progress and the speed limits (`RouteTimeoutBehavior`).
#[derive(Clone, Debug)]
pub(super) struct Timeout {
    version: Version,
    limit_s: f64,
}

impl Timeout {
    pub(super) fn new(version: Version, length_m: f64) -> Self {
        let limit_s = if version.is_second() { 300.0 } else { 0.8 * length_m + 5.0 };
        Self { version, limit_s }
    }

    /// Returns true if the time is over.
    pub(super) fn take(&mut self, at_s: f64, advance_m: f64, limit_mps: f64) -> bool {
        if self.version.is_second() && limit_mps > 0.0 {
            self.limit_s += advance_m / (0.1 * limit_mps);
        }
        at_s > self.limit_s
    }
}

/// Share of the route from which on the last section counts.
const LAST_SECTION: f64 = 0.95;

/// Speed of the ego in each section of the route, compared with that of the traffic (`MinimumSpeedRouteTest`).
#[derive(Clone, Debug)]
pub(super) struct MinSpeed {
    length_m: f64,
    section_m: f64,
    /// Arc length at which the current section began, metres.
    from_m: f64,
    ego_mps: f64,
    traffic_mps: f64,
    samples: u32,
    percentages: Vec<f64>,
}

impl MinSpeed {
    pub(super) fn new(route: &JudgedRoute) -> Self {
        Self {
            length_m: route.length_m,
            section_m: route.length_m / f64::from(route.speed_checkpoints.max(1)),
            from_m: 0.0,
            ego_mps: 0.0,
            traffic_mps: 0.0,
            samples: 0,
            percentages: Vec::new(),
        }
    }

    pub(super) fn take(&mut self, s_m: f64, ego_mps: f64, traffic_mps: Option<f64>) {
        if s_m - self.from_m > self.section_m {
            self.percentages.push(self.percentage());
            self.from_m = s_m;
            (self.ego_mps, self.traffic_mps, self.samples) = (0.0, 0.0, 0);
        }
        if let Some(traffic_mps) = traffic_mps {
            self.ego_mps += ego_mps;
            self.traffic_mps += traffic_mps;
            self.samples += 1;
        }
    }

    /// Percentages of all sections, with that of the last one if the ego has come close enough to the end.
    pub(super) fn percentages(&self, s_m: f64) -> Vec<f64> {
        let last = (s_m / self.length_m > LAST_SECTION).then(|| self.percentage());
        self.percentages.iter().copied().chain(last).collect()
    }

    fn percentage(&self) -> f64 {
        if self.samples == 0 || self.traffic_mps == 0.0 {
            return 100.0;
        }
        let n = f64::from(self.samples);
        rounded((self.ego_mps / n) / (self.traffic_mps / n) * 100.0, 2)
    }
}
