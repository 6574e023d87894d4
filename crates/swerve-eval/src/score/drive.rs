//! All driving scores of one drive over a route.

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::bench2drive::{self, Motion, SPEED_CHECKPOINTS, YawAccel};
use super::leaderboard::{Counts, RouteRecord, Version};
use super::nuplan::{self, ClosedLoopScore, Progress, Step};
use super::{Ending, JudgedRoute, RouteJudge, StepFacts};

/// Driving scores of one drive over a route.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct DrivingScores {
    /// Driving score of Leaderboard 2.1, 0 to 100.
    pub driving_score: f64,
    /// Length of the route, metres.
    pub route_length_m: f64,
    /// Scores and records by version of the Leaderboard: `1.0`, `2.0`, `2.1`.
    pub leaderboard: BTreeMap<String, LeaderboardScore>,
    /// Score of nuPlan's closed loop; absent for a drive of less than 0.4 s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nuplan: Option<ClosedLoopScore>,
    /// Metrics of Bench2Drive for this route.
    pub bench2drive: RouteBench2Drive,
    /// Share of the time outside emergencies in which all quantities are within nuPlan's comfort limits, 0 to 1; absent
    /// if there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub comfort_share: Option<f64>,
    /// Time of emergencies, seconds.
    pub emergency_s: f64,
}

/// Score of a route by one version of the Leaderboard, with the record that it is computed from.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct LeaderboardScore {
    /// Route completion, percent.
    pub route_completion: f64,
    /// Infraction penalty, 0 to 1.
    pub penalty: f64,
    /// Driving score, 0 to 100.
    pub driving_score: f64,
    /// Status in the words of the Leaderboard.
    pub status: String,
    /// Number of infractions by kind.
    pub infractions: Counts,
    /// Share of the completed route that was driven outside its lanes, percent.
    pub outside_route_lanes_percent: f64,
    /// Mean speed in each completed section of the route, percent of that of the traffic (2.x).
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub min_speed_checkpoints_percent: Vec<f64>,
}

impl LeaderboardScore {
    fn of(record: &RouteRecord, version: Version) -> Self {
        let score = record.score(version);
        Self {
            route_completion: score.route_completion,
            penalty: score.penalty,
            driving_score: score.driving_score,
            status: score.status.to_string(),
            infractions: record.counts,
            outside_route_lanes_percent: record.outside_route_lanes_percent,
            min_speed_checkpoints_percent: record.min_speed_checkpoints_percent.clone(),
        }
    }
}

/// Metrics of Bench2Drive for one route.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct RouteBench2Drive {
    /// Driving score: that of Leaderboard 2.0 without the minimum speed.
    pub driving_score: f64,
    /// True if the route was completed without any infraction other than of the minimum speed.
    pub success: bool,
    /// Mean speed at the checkpoints, percent of that of the traffic; absent without a checkpoint.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub efficiency_percent: Option<f64>,
    /// Share of pieces of 2 s within the limits, 0 to 1, as published; absent for a drive of less than 0.3 s.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub comfort_share: Option<f64>,
}

impl DrivingScores {
    /// Record of the route in one version, from which scores over several routes are computed.
    pub fn record(&self, version: Version) -> RouteRecord {
        let of = self.leaderboard.get(version.name());
        RouteRecord {
            route_length_m: self.route_length_m,
            route_completion: of.map_or(0.0, |of| of.route_completion),
            counts: of.map_or_else(Counts::default, |of| of.infractions),
            outside_route_lanes_percent: of.map_or(0.0, |of| of.outside_route_lanes_percent),
            min_speed_checkpoints_percent: of
                .map_or_else(Vec::new, |of| of.min_speed_checkpoints_percent.clone()),
            failure: None,
        }
    }
}

/// Facts of one sample of a drive, every 100 ms.
#[derive(Clone, PartialEq, Debug)]
pub struct DriveFacts {
    /// Facts for nuPlan's score.
    pub step: Step,
    /// Yaw rate, rad/s.
    pub yaw_rate_radps: f64,
    /// True in an emergency, which does not count for the share of comfort.
    pub is_emergency: bool,
}

/// Judge of one drive over a route, for all scores.
#[derive(Clone, Debug)]
pub struct DriveJudge {
    route: JudgedRoute,
    /// One for 1.0, one for 2.x, whose records are the same, and one with the checkpoints of Bench2Drive.
    judges: [RouteJudge; 3],
    steps: Vec<Step>,
    yaw_rates_radps: Vec<f64>,
    emergencies: Vec<bool>,
}

impl DriveJudge {
    /// Creates a judge for a route of this length, metres.
    pub fn new(length_m: f64) -> Self {
        let route = JudgedRoute::of_length(length_m);
        let checked = JudgedRoute { speed_checkpoints: SPEED_CHECKPOINTS as u32, ..route };
        let judges = [(Version::V1_0, route), (Version::V2_1, route), (Version::V2_0, checked)];
        Self {
            route,
            judges: judges.map(|(version, route)| RouteJudge::new(version, route)),
            steps: Vec::new(),
            yaw_rates_radps: Vec::new(),
            emergencies: Vec::new(),
        }
    }

    /// Adds a step, every 50 ms and at each contact; returns how the route ended in 1.0 and in 2.x, if it has.
    pub fn take(&mut self, facts: &StepFacts<'_>) -> [Option<Ending>; 2] {
        let [first, second, checked] = &mut self.judges;
        let _same = checked.take(facts);
        [first.take(facts), second.take(facts)]
    }

    /// Adds a sample.
    pub fn sample(&mut self, facts: DriveFacts) {
        self.steps.push(facts.step);
        self.yaw_rates_radps.push(facts.yaw_rate_radps);
        self.emergencies.push(facts.is_emergency);
    }

    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.steps.len()
    }

    /// Scores so far; `expert_m` is the progress of nuPlan's expert in the same time, `ego_m` that of the ego.
    pub fn scores(&self, progress: Progress) -> DrivingScores {
        let [first, second, checked] = self.judges.each_ref().map(RouteJudge::record);
        let of = |version: Version| {
            let record = if version.is_second() { &second } else { &first };
            (version.name().to_owned(), LeaderboardScore::of(record, version))
        };
        let (comfort_share, emergency_s) = self.comfort();
        DrivingScores {
            driving_score: second.score(Version::V2_1).driving_score,
            route_length_m: self.route.length_m,
            leaderboard: Version::ALL.into_iter().map(of).collect(),
            nuplan: nuplan::closed_loop(&self.steps, progress),
            bench2drive: RouteBench2Drive {
                driving_score: bench2drive::route_score(&checked).driving_score,
                success: bench2drive::is_success(&checked),
                efficiency_percent: bench2drive::efficiency_percent(&checked),
                comfort_share: bench2drive::comfort(&self.motions(), YawAccel::SmoothedYawRate),
            },
            comfort_share,
            emergency_s,
        }
    }

    /// Share of comfort outside emergencies, and the time of emergencies, seconds.
    fn comfort(&self) -> (Option<f64>, f64) {
        let emergencies = self.emergencies.iter().filter(|is_one| **is_one).count();
        let outside = self.emergencies.len() - emergencies;
        let share = nuplan::comfortable(&self.steps).filter(|_| outside > 0).map(|within| {
            let kept = within.iter().zip(&self.emergencies).filter(|(within, is_one)| **within && !**is_one);
            kept.count() as f64 / outside as f64
        });
        (share, nuplan::PERIOD_S * emergencies as f64)
    }

    fn motions(&self) -> Vec<Motion> {
        let motion = |(step, yaw_rate_radps): (&Step, &f64)| Motion {
            lon_accel_mps2: step.ego.lon_accel_mps2,
            lat_accel_mps2: step.ego.lat_accel_mps2,
            yaw_rate_radps: *yaw_rate_radps,
        };
        self.steps.iter().zip(&self.yaw_rates_radps).map(motion).collect()
    }
}
