//! Score of nuPlan's closed-loop challenges.
//!
//! Source: `motional/nuplan-devkit` (e924167), `nuplan/planning/metrics/evaluation_metrics/common/` and
//! `nuplan/planning/script/config/simulation_metric/`. The facts of maps, which nuPlan takes from its own, are part of
//! the input ([`LaneFacts`]).

mod collision;
mod expert;
#[cfg(test)]
mod tests;
mod time_to_collision;

use serde::{Deserialize, Serialize};
use swerve_geom::{Obb, Pose2};

use crate::comfort::{Comfort, ComfortMetrics};

pub use collision::{AtFault, Impact, Impacts, impacts};
pub use expert::{FreeDriver, expert_progress_m};
pub use time_to_collision::times_to_collision_s;

/// Sampling interval of nuPlan's simulation, seconds.
pub const PERIOD_S: f64 = 0.1;
/// Distance of a corner from the drivable area from which on it is a violation, metres.
const CORNER_OUTSIDE_M: f64 = 0.3;
/// Number of steps whose progress counts as that of one second. The window holds both ends: 11 steps.
const DIRECTION_STEPS: usize = 10;
/// Backward progress in one second below which the driving direction is kept, and below which half of the score remains,
/// metres.
const BACKWARD_M: [f64; 2] = [2.0, 6.0];
/// Least progress of ego and expert in their ratio, metres.
const PROGRESS_MIN_M: f64 = 2.0;
/// Ratio of progress from which on the ego makes progress.
const MAKING_PROGRESS: f64 = 0.2;
/// Excess of the speed limit over the whole drive that makes the score zero, m/s.
const OVERSPEED_MPS: f64 = 2.23;
/// Time to collision that every step must exceed, seconds.
const LEAST_TTC_S: f64 = 0.95;

/// Kind of another road user or object.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum TrackKind {
    /// A pedestrian or cyclist.
    Vru,
    /// A motor vehicle.
    Vehicle,
    /// A cone, barrier or other object, which never moves.
    Object,
}

/// A road user or object at one instant.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Track {
    /// Identity over the drive.
    pub id: u64,
    /// Kind.
    pub kind: TrackKind,
    /// Outline; its heading is the direction of motion.
    pub outline: Obb,
    /// Speed, m/s.
    pub speed_mps: f64,
}

impl Track {
    /// Returns true if it does not move.
    fn stands(&self) -> bool {
        self.kind == TrackKind::Object || self.speed_mps <= 5e-3
    }
}

/// The ego at one instant.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct EgoState {
    /// Pose of the rear axle.
    pub rear_axle: Pose2,
    /// Outline.
    pub outline: Obb,
    /// Speed, m/s.
    pub speed_mps: f64,
    /// Acceleration along the heading, m/s².
    pub lon_accel_mps2: f64,
    /// Acceleration across the heading, m/s².
    pub lat_accel_mps2: f64,
}

/// Place of the ego on the map at one instant.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct LaneFacts {
    /// Lane or connector in which the centre of the ego is, and arc length of its projection to the centre line, metres.
    /// `None` outside of all.
    pub lane: Option<(u64, f64)>,
    /// Speed limit of the lane, or of all lanes before and after a connector, m/s; empty if unknown.
    pub limits_mps: Vec<f64>,
    /// True if centre and corners are in one lane or in lanes that continue each other; nuPlan's `common or connected
    /// route objects`.
    pub in_one_lane: bool,
    /// True if the rear axle is in an intersection.
    pub in_intersection: bool,
    /// Largest distance of a corner from the drivable area, metres; zero inside.
    pub corner_outside_m: f64,
}

/// One step of a drive.
#[derive(Clone, PartialEq, Debug)]
pub struct Step {
    /// The ego.
    pub ego: EgoState,
    /// All others.
    pub tracks: Vec<Track>,
    /// Place of the ego on the map.
    pub lane: LaneFacts,
}

/// Progress of the ego and of an expert along the expert's route, metres.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Progress {
    /// The ego's.
    pub ego_m: f64,
    /// The expert's. nuPlan's is the recorded driver; [`expert_progress_m`] is that of a driver on a free road.
    pub expert_m: f64,
}

/// Components of the score, each from 0 to 1, and the score.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct ClosedLoopScore {
    /// No collisions at fault (multiplier): 0, 0.5 or 1.
    pub no_collisions: f64,
    /// Drivable area compliance (multiplier): 0 or 1.
    pub drivable_area: f64,
    /// Making progress (multiplier): 0 or 1.
    pub making_progress: f64,
    /// Driving direction compliance (multiplier): 0, 0.5 or 1.
    pub direction: f64,
    /// Progress along the expert's route (weight 5).
    pub progress: f64,
    /// Time to collision within bound (weight 5): 0 or 1.
    pub time_to_collision: f64,
    /// Speed limit compliance (weight 4).
    pub speed: f64,
    /// Comfort (weight 2): 0 or 1.
    pub comfort: f64,
    /// The score.
    pub score: f64,
}

/// Score of a drive sampled every 100 ms; `None` for fewer than four steps, too few to smooth accelerations.
pub fn closed_loop(steps: &[Step], progress: Progress) -> Option<ClosedLoopScore> {
    let is_comfortable = comfort(steps)?.share_within == 1.0;
    let impacts = impacts(steps);
    let least_s = times_to_collision_s(steps, &impacts).into_iter().flatten().fold(f64::INFINITY, f64::min);
    let ratio = progress_ratio(progress);
    let one_if = |holds: bool| if holds { 1.0 } else { 0.0 };
    let mut score = ClosedLoopScore {
        no_collisions: impacts.at_fault().factor(),
        drivable_area: drivable_area(steps),
        making_progress: one_if(ratio >= MAKING_PROGRESS),
        direction: direction(steps),
        progress: ratio,
        time_to_collision: one_if(least_s > LEAST_TTC_S),
        speed: speed(steps),
        comfort: one_if(is_comfortable),
        score: 0.0,
    };
    let multipliers = score.no_collisions * score.drivable_area * score.making_progress * score.direction;
    let weighted =
        5.0 * score.progress + 5.0 * score.time_to_collision + 4.0 * score.speed + 2.0 * score.comfort;
    score.score = multipliers * weighted / 16.0;
    Some(score)
}

/// Mean score over scenarios; `None` without any.
pub fn mean(scores: &[ClosedLoopScore]) -> Option<f64> {
    let sum: f64 = scores.iter().map(|score| score.score).sum();
    (!scores.is_empty()).then(|| sum / scores.len() as f64)
}

/// Smoothed accelerations, jerks and yaw motion; comfortable if all are always within the limits.
pub fn comfort(steps: &[Step]) -> Option<ComfortMetrics> {
    comfort_of(steps).metrics()
}

/// For each step, true if all quantities are within the limits; `None` for fewer than four steps.
pub(super) fn comfortable(steps: &[Step]) -> Option<Vec<bool>> {
    comfort_of(steps).within()
}

fn comfort_of(steps: &[Step]) -> Comfort {
    let mut comfort = Comfort::default();
    for Step { ego, .. } in steps {
        comfort.push(ego.lon_accel_mps2, ego.lat_accel_mps2, ego.rear_axle.heading_rad);
    }
    comfort
}

/// Zero if a corner was at least 0.3 m outside the drivable area, else one.
pub fn drivable_area(steps: &[Step]) -> f64 {
    let is_far = |step: &Step| step.lane.corner_outside_m >= CORNER_OUTSIDE_M;
    if steps.iter().any(is_far) { 0.0 } else { 1.0 }
}

/// Driving direction compliance, by the largest backward progress along the lane within one second: below 2 m one,
/// below 6 m one half, else zero.
pub fn direction(steps: &[Step]) -> f64 {
    let progress = progress_in_lane(steps);
    let windows =
        (0..progress.len()).map(|i| progress[i.saturating_sub(DIRECTION_STEPS)..=i].iter().sum::<f64>());
    let backward_m = -windows.fold(0.0, f64::min);
    match BACKWARD_M {
        [kept_m, _] if backward_m < kept_m => 1.0,
        [_, half_m] if backward_m < half_m => 0.5,
        _ => 0.0,
    }
}

/// Progress of each step along the centre line of its lane, metres; zero for the first two steps in a lane, and outside
/// of all lanes.
fn progress_in_lane(steps: &[Step]) -> Vec<f64> {
    let mut lane = steps.first().and_then(|step| step.lane.lane).map(|(id, _)| id);
    let mut last_m: Option<f64> = None;
    let along = |step: &Step| {
        let (id, s_m) = step.lane.lane?;
        if lane != Some(id) {
            (lane, last_m) = (Some(id), None);
            return None;
        }
        // A projection to the very start is no progress there.
        let made_m = last_m.filter(|_| s_m != 0.0).map(|last_m| s_m - last_m);
        last_m = Some(s_m);
        made_m
    };
    steps.iter().map(along).map(Option::unwrap_or_default).collect()
}

/// Ratio of the progress of ego and expert, 0 to 1. Both are at least 2 m; zero if the ego went back by more than that.
pub fn progress_ratio(progress: Progress) -> f64 {
    if progress.ego_m < -PROGRESS_MIN_M {
        return 0.0;
    }
    (progress.ego_m.max(PROGRESS_MIN_M) / progress.expert_m.max(PROGRESS_MIN_M)).min(1.0)
}

/// Speed limit compliance: one less the mean excess over 2.23 m/s. Steps without known limit have no excess.
pub fn speed(steps: &[Step]) -> f64 {
    let over = |step: &Step| {
        let limits = &step.lane.limits_mps;
        let is_known = limits.iter().all(|limit| *limit > 0.0);
        let highest = limits.iter().copied().filter(|_| is_known).reduce(f64::max);
        highest.map_or(0.0, |limit| (step.ego.speed_mps - limit).max(0.0))
    };
    let duration_s = PERIOD_S * steps.len().saturating_sub(1) as f64;
    if duration_s <= 0.0 {
        return 1.0;
    }
    let sum: f64 = steps.iter().map(over).sum();
    (1.0 - sum * PERIOD_S / (OVERSPEED_MPS * duration_s)).max(0.0)
}
