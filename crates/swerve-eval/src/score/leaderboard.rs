//! Driving score of the CARLA Leaderboard in its versions 1.0, 2.0 and 2.1.
//!
//! Source: `carla-simulator/leaderboard`, file `leaderboard/utils/statistics_manager.py`, branches `leaderboard-1.0`
//! (2165f5e), `leaderboard-2.0` (a87a341) and `leaderboard-2.1` (cfecdc8). Rules about which events count are in
//! [`Collisions`] and [`RouteJudge`](super::RouteJudge).

mod collisions;
mod record;
#[cfg(test)]
mod tests;
mod total;

use serde::{Deserialize, Serialize};

pub use collisions::{Collisions, Contact, Struck};
pub use record::{Counts, Failure, RouteRecord, Status};
pub use total::{Rates, TotalScore, total};

use super::rounded;

/// Decimals of scores and of their means in 2.x.
const SCORE_DECIMALS: usize = 6;
/// Decimals of standard deviations and of rates in 2.x.
const OTHER_DECIMALS: usize = 3;

/// Version of the Leaderboard.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Serialize, Deserialize)]
pub enum Version {
    /// Branch `leaderboard-1.0`.
    #[serde(rename = "1.0")]
    V1_0,
    /// Branch `leaderboard-2.0`.
    #[serde(rename = "2.0")]
    V2_0,
    /// Branch `leaderboard-2.1`.
    #[serde(rename = "2.1")]
    V2_1,
}

impl Version {
    /// All versions, the oldest first.
    pub const ALL: [Self; 3] = [Self::V1_0, Self::V2_0, Self::V2_1];

    /// Name: `1.0`, `2.0` or `2.1`.
    pub fn name(self) -> &'static str {
        match self {
            Self::V1_0 => "1.0",
            Self::V2_0 => "2.0",
            Self::V2_1 => "2.1",
        }
    }

    /// Returns true for 2.0 and 2.1, which differ in the penalty only.
    pub fn is_second(self) -> bool {
        self != Self::V1_0
    }
}

/// Score of one route.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct RouteScore {
    /// Route completion, percent (`score_route`).
    pub route_completion: f64,
    /// Infraction penalty, 0 to 1 (`score_penalty`).
    pub penalty: f64,
    /// Driving score, 0 to 100 (`score_composed`).
    pub driving_score: f64,
    /// Status of the route.
    pub status: Status,
}

impl RouteRecord {
    /// Score of this route. 2.x rounds each number to six decimals, the driving score before its factors are rounded.
    pub fn score(&self, version: Version) -> RouteScore {
        self.scored(version, self.penalty(version))
    }

    /// Same as [`score`](Self::score), with another penalty.
    pub(super) fn scored(&self, version: Version, penalty: f64) -> RouteScore {
        let kept = |value: f64| if version.is_second() { rounded(value, SCORE_DECIMALS) } else { value };
        RouteScore {
            route_completion: kept(self.route_completion),
            penalty: kept(penalty),
            driving_score: kept((self.route_completion * penalty).max(0.0)),
            status: self.status(version),
        }
    }

    /// Infraction penalty, not rounded.
    fn penalty(&self, version: Version) -> f64 {
        let inside = 1.0 - self.outside_route_lanes_percent / 100.0;
        let short = |percent: &f64| 1.0 - percent / 100.0;
        let slow = self.min_speed_checkpoints_percent.iter().filter(|percent| **percent < 100.0).map(short);
        match version {
            Version::V1_0 => self.counts.product(false) * inside,
            Version::V2_0 => {
                self.counts.product(true) * inside * slow.map(|short| 1.0 - 0.3 * short).product::<f64>()
            }
            Version::V2_1 => inside / (1.0 + self.counts.sum() + slow.map(|short| 0.4 * short).sum::<f64>()),
        }
    }

    /// Penalty of 2.0 without minimum speed, as Bench2Drive uses it.
    pub(super) fn penalty_without_min_speed(&self) -> f64 {
        self.counts.product(true) * (1.0 - self.outside_route_lanes_percent / 100.0)
    }
}

impl Counts {
    /// Product of the factors of 1.0, with those that 2.0 added if `is_second`.
    fn product(&self, is_second: bool) -> f64 {
        let added = |count: u32| if is_second { count } else { 0 };
        [
            (0.5, self.collisions_pedestrian),
            (0.6, self.collisions_vehicle),
            (0.65, self.collisions_layout),
            (0.7, self.red_light),
            (0.8, self.stop_infraction),
            (0.7, added(self.scenario_timeouts)),
            (0.7, added(self.yield_emergency_vehicle_infractions)),
        ]
        .into_iter()
        .map(power)
        .product()
    }

    /// Sum of the coefficients of 2.1.
    fn sum(&self) -> f64 {
        [
            (1.0, self.collisions_pedestrian),
            (0.7, self.collisions_vehicle),
            (0.6, self.collisions_layout),
            (0.4, self.red_light),
            (0.25, self.stop_infraction),
            (0.4, self.scenario_timeouts),
            (0.4, self.yield_emergency_vehicle_infractions),
        ]
        .into_iter()
        .map(|(coefficient, count)| coefficient * f64::from(count))
        .sum()
    }
}

/// Power by repeated multiplication, as the Leaderboard's; it ends at zero, however large the count.
fn power((factor, count): (f64, u32)) -> f64 {
    let mut power = 1.0;
    for _ in 0..count {
        power *= factor;
        if power == 0.0 {
            break;
        }
    }
    power
}
