//! Scores over several routes.

use std::collections::BTreeMap;

use serde::Serialize;

use super::{OTHER_DECIMALS, RouteRecord, RouteScore, SCORE_DECIMALS, Status, Version};
use crate::score::rounded;

/// Infractions per kilometre by kind; `outside_route_lanes` is a rate in 1.0 and kilometres in 2.x.
pub type Rates = BTreeMap<&'static str, f64>;

/// Scores over several routes.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct TotalScore {
    /// Scores of the routes, in order.
    pub routes: Vec<RouteScore>,
    /// Mean driving score.
    pub driving_score: f64,
    /// Mean route completion, percent.
    pub route_completion: f64,
    /// Mean infraction penalty.
    pub penalty: f64,
    /// Standard deviation of the driving score over n - 1; for a single route 0 in 2.x and missing in 1.0.
    pub std_dev: Option<f64>,
    /// Worst status of the routes.
    pub status: Status,
    /// Infractions per kilometre driven.
    pub per_km: Rates,
}

/// Scores over several routes; `None` without any.
pub fn total(records: &[RouteRecord], version: Version) -> Option<TotalScore> {
    if records.is_empty() {
        return None;
    }
    let routes: Vec<RouteScore> = records.iter().map(|record| record.score(version)).collect();
    let mean = |of: fn(&RouteScore) -> f64| mean(routes.iter().map(of), version);
    let driving_score = mean(|route| route.driving_score);
    Some(TotalScore {
        driving_score,
        route_completion: mean(|route| route.route_completion),
        penalty: mean(|route| route.penalty),
        std_dev: deviation(&routes, driving_score, version),
        status: worst(routes.iter().map(|route| route.status)),
        per_km: match version {
            Version::V1_0 => rates_of_each(records),
            Version::V2_0 | Version::V2_1 => rates_of_all(records),
        },
        routes,
    })
}

/// 1.0 divides the sum, 2.x sums the quotients and rounds.
fn mean(values: impl ExactSizeIterator<Item = f64>, version: Version) -> f64 {
    let n = values.len() as f64;
    match version {
        Version::V1_0 => values.sum::<f64>() / n,
        Version::V2_0 | Version::V2_1 => rounded(values.map(|value| value / n).sum(), SCORE_DECIMALS),
    }
}

fn deviation(routes: &[RouteScore], mean: f64, version: Version) -> Option<f64> {
    let squares = routes.iter().map(|route| (route.driving_score - mean) * (route.driving_score - mean));
    let sum: f64 = squares.sum();
    match (version, routes.len()) {
        (Version::V1_0, 1) => None,
        (_, 1) => Some(0.0),
        (Version::V1_0, n) => Some((sum / (n - 1) as f64).sqrt()),
        (_, n) => Some(rounded((sum / (n - 1) as f64).sqrt(), OTHER_DECIMALS)),
    }
}

/// Reasons of failures belong to single routes.
fn worst(of: impl Iterator<Item = Status>) -> Status {
    of.fold(Status::Perfect, |worst, status| match (worst, status) {
        (Status::Failed(_), _) | (_, Status::Failed(_)) => Status::Failed(None),
        (Status::Perfect, Status::Perfect) => Status::Perfect,
        _ => Status::Completed,
    })
}

/// 1.0: the sum of the rates of each route. Routes without progress have no rate and are left out.
fn rates_of_each(records: &[RouteRecord]) -> Rates {
    let mut rates = Rates::new();
    for record in records {
        let km = record.completed_km();
        let outside = ("outside_route_lanes", u32::from(record.outside_route_lanes_percent > 0.0));
        for (kind, count) in record.counts.each().into_iter().chain([outside]) {
            if !ADDED_IN_2.contains(&kind) {
                *rates.entry(kind).or_default() += if km > 0.0 { f64::from(count) / km } else { 0.0 };
            }
        }
    }
    rates
}

/// Kinds that 1.0 does not have.
const ADDED_IN_2: [&str; 2] = ["scenario_timeouts", "yield_emergency_vehicle_infractions"];

/// 2.x: all infractions over all kilometres, which are at least 0.001.
fn rates_of_all(records: &[RouteRecord]) -> Rates {
    let km = records.iter().map(RouteRecord::completed_km).sum::<f64>().max(0.001);
    let mut counts = Rates::new();
    for record in records {
        let slow = record.min_speed_checkpoints_percent.iter().filter(|percent| **percent < 100.0).count();
        for (kind, count) in record.counts.each().into_iter().chain([("min_speed_infractions", slow as u32)])
        {
            *counts.entry(kind).or_default() += f64::from(count);
        }
    }
    let mut rates: Rates =
        counts.into_iter().map(|(kind, count)| (kind, rounded(count / km, OTHER_DECIMALS))).collect();
    // The Leaderboard reads the metres from a message that has three decimals.
    let outside_km = |record: &RouteRecord| {
        rounded(record.completed_km() * 1000.0 * record.outside_route_lanes_percent / 100.0, 3) / 1000.0
    };
    let outside = rounded(records.iter().map(outside_km).sum(), OTHER_DECIMALS);
    rates.insert("outside_route_lanes_km", outside);
    rates
}
