//! Metrics of Bench2Drive: driving score, success rate, efficiency, comfort.
//!
//! Source: `Thinklab-SJTU/Bench2Drive` (7ec25d1), `leaderboard/leaderboard/utils/statistics_manager.py`,
//! `tools/merge_reoute_json.py` and `tools/efficiency_smoothness_benchmark.py`.

#[cfg(test)]
mod tests;

use serde::Serialize;
use swerve_geom::math;

use super::leaderboard::{RouteRecord, RouteScore, Status, Version};
use super::rounded;
use crate::comfort::{Filter, limits};

/// Number of routes of the benchmark. Sums are always divided by it, so that missing routes count as zero.
pub const ROUTES: usize = 220;
/// Number of checkpoints of the minimum speed on a route.
pub const SPEED_CHECKPOINTS: usize = 20;
/// Percentage of the traffic's speed above which a checkpoint is left out.
const PERCENT_MAX: f64 = 1000.0;
/// Number of samples of a piece of the drive that is comfortable or not.
const PIECE: usize = 20;
/// Window of the Savitzky-Golay filters.
const WINDOW: usize = 7;

/// Metrics over the routes of the benchmark.
#[derive(Clone, Copy, PartialEq, Debug, Serialize)]
pub struct Bench2DriveScore {
    /// Sum of the driving scores over 220.
    pub driving_score: f64,
    /// Number of successful routes over 220.
    pub success_rate: f64,
    /// Mean over the routes of the ego's speed at the checkpoints, percent of that of the traffic; `None` without any
    /// checkpoint.
    pub efficiency_percent: Option<f64>,
}

/// Score of one route: that of Leaderboard 2.0 without the minimum speed. Its status is Completed instead of Perfect as
/// soon as there is a checkpoint, because Bench2Drive lists each of them as an infraction.
pub fn route_score(record: &RouteRecord) -> RouteScore {
    let mut score = record.scored(Version::V2_0, record.penalty_without_min_speed());
    if score.status == Status::Perfect && !record.min_speed_checkpoints_percent.is_empty() {
        score.status = Status::Completed;
    }
    score
}

/// Returns true if the route was completed without any infraction other than of the minimum speed.
pub fn is_success(record: &RouteRecord) -> bool {
    let without = RouteRecord { min_speed_checkpoints_percent: Vec::new(), ..record.clone() };
    without.status(Version::V2_0) == Status::Perfect
}

/// Mean percentage of the traffic's speed over the checkpoints of a route, each with two decimals. Values above 1000 are
/// left out; `None` if no checkpoint remains.
pub fn efficiency_percent(record: &RouteRecord) -> Option<f64> {
    let each = record.min_speed_checkpoints_percent.iter().map(|percent| rounded(*percent, 2));
    let kept: Vec<f64> = each.filter(|percent| *percent <= PERCENT_MAX).collect();
    (!kept.is_empty()).then(|| kept.iter().sum::<f64>() / kept.len() as f64)
}

/// Metrics over all routes driven.
pub fn bench2drive(records: &[RouteRecord]) -> Bench2DriveScore {
    let scores: f64 = records.iter().map(|record| route_score(record).driving_score).sum();
    let successes = records.iter().filter(|record| is_success(record)).count();
    let efficiencies: Vec<f64> = records.iter().filter_map(efficiency_percent).collect();
    let sum: f64 = efficiencies.iter().sum();
    Bench2DriveScore {
        driving_score: scores / ROUTES as f64,
        success_rate: successes as f64 / ROUTES as f64,
        efficiency_percent: (!efficiencies.is_empty()).then(|| sum / efficiencies.len() as f64),
    }
}

/// Series compared with the limit of the yaw acceleration.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum YawAccel {
    /// The smoothed yaw rate itself, as Bench2Drive publishes it: its code does not differentiate.
    SmoothedYawRate,
    /// The derivative of the smoothed yaw rate.
    Derived,
}

/// Motion of the ego at one sample; samples are 100 ms apart.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Motion {
    /// Acceleration along the heading, m/s².
    pub lon_accel_mps2: f64,
    /// Acceleration across the heading, m/s².
    pub lat_accel_mps2: f64,
    /// Yaw rate, rad/s.
    pub yaw_rate_radps: f64,
}

/// Share of the pieces of 20 samples in which all quantities are within nuPlan's limits, 0 to 1. The rest at the end
/// does not count; a drive of up to 20 samples is one piece. `None` for fewer than three samples, too few to smooth.
pub fn comfort(drive: &[Motion], yaw_accel: YawAccel) -> Option<f64> {
    if drive.len() < 3 {
        return None;
    }
    if drive.len() <= PIECE {
        return Some(if is_comfortable(drive, yaw_accel) { 1.0 } else { 0.0 });
    }
    let pieces = drive.chunks_exact(PIECE);
    let n = pieces.len();
    let comfortable = pieces.filter(|piece| is_comfortable(piece, yaw_accel)).count();
    Some(comfortable as f64 / n as f64)
}

fn is_comfortable(piece: &[Motion], yaw_accel: YawAccel) -> bool {
    let smooth = Filter { window: WINDOW, order: 2, derivative: 0 };
    let rate_of_change = Filter { derivative: 1, ..smooth };
    let series = |of: fn(&Motion) -> f64| smooth.of(&piece.iter().map(of).collect::<Vec<f64>>());
    let along = series(|motion| motion.lon_accel_mps2);
    let across = series(|motion| motion.lat_accel_mps2);
    let magnitude = series(|motion| math::hypot(motion.lon_accel_mps2, motion.lat_accel_mps2));
    let yaw_rate = smooth.of(&unwrapped(piece.iter().map(|motion| motion.yaw_rate_radps)));
    let yaw_accel = match yaw_accel {
        YawAccel::SmoothedYawRate => yaw_rate.clone(),
        YawAccel::Derived => rate_of_change.of(&yaw_rate),
    };
    let within = |series: &[f64], low: f64, high: f64| series.iter().all(|x| low < *x && *x < high);
    let inside = |series: &[f64], limit: f64| within(series, -limit, limit);
    let [low, high] = limits::LON_ACCEL;
    within(&along, low, high)
        && inside(&across, limits::LAT_ACCEL)
        && inside(&rate_of_change.of(&magnitude), limits::JERK)
        && inside(&rate_of_change.of(&along), limits::LON_JERK)
        && inside(&yaw_accel, limits::YAW_ACCEL)
        && inside(&yaw_rate, limits::YAW_RATE)
}

/// Removes jumps of a whole turn, as Bench2Drive does, although these are yaw rates and no angles.
fn unwrapped(rates: impl Iterator<Item = f64>) -> Vec<f64> {
    let (mut turns, mut last) = (0.0, None);
    rates
        .map(|rate| {
            turns += ((rate - last.unwrap_or(rate)) / core::f64::consts::TAU).round_ties_even();
            last = Some(rate);
            rate - core::f64::consts::TAU * turns
        })
        .collect()
}
