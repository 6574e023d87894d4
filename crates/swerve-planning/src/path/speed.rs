//! Speeds and instants along a path.

use swerve_core::Span;
use swerve_msg::{EgoState, PlanPoint};
use swerve_vehicle::Limits;

use super::points::PathPoint;

/// Slowest mean speed that a stretch of a plan is timed with, m/s: keeps times finite at standstill.
pub(crate) const CREEP_MPS: f64 = 0.1;

/// How fast a path is driven.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum SpeedProfile {
    /// The target speed from the first point on, whatever the start: what Pylot does.
    Constant,
    /// From the start's speed within acceleration, braking and lateral limits.
    Limited,
    /// The same, and at rest in the path's last point.
    LimitedToStop,
}

/// A path driven from `start` (its stamp, its speed) towards `target_mps`; appends to `points`.
///
/// Under [`SpeedProfile::Limited`] speeds keep `limits`: lateral acceleration everywhere, braking before
/// curves, acceleration out of them; the start's speed is taken as it is, so where it is too high for what
/// follows the plan brakes as hard as it may.
pub fn timed_points(
    path: &[PathPoint],
    start: &EgoState,
    target_mps: f64,
    profile: SpeedProfile,
    limits: &Limits,
) -> Vec<PlanPoint> {
    let gaps_m: Vec<f64> = path.windows(2).map(|p| p[0].pose.point().distance(p[1].pose.point())).collect();
    let speeds_mps = match profile {
        SpeedProfile::Constant => vec![target_mps; path.len()],
        SpeedProfile::Limited | SpeedProfile::LimitedToStop => {
            let stops = profile == SpeedProfile::LimitedToStop;
            limited_speeds(path, &gaps_m, start.speed_mps, target_mps, stops, limits)
        }
    };
    let mut at = start.stamp;
    let mut points: Vec<PlanPoint> = Vec::with_capacity(path.len());
    for (i, p) in path.iter().enumerate() {
        let (mut accel_mps2, speed_mps) = (0.0, speeds_mps[i]);
        if let Some(gap_m) = gaps_m.get(i) {
            let next_mps = speeds_mps[i + 1];
            if *gap_m > 1e-9 {
                accel_mps2 = (next_mps * next_mps - speed_mps * speed_mps) / (2.0 * gap_m);
            }
        }
        if i > 0 {
            let mean_mps = (0.5 * (speeds_mps[i - 1] + speed_mps)).max(CREEP_MPS);
            at += Span::from_secs(gaps_m[i - 1] / mean_mps);
        }
        // Repeated poses give no time to pass: keep instants strictly increasing.
        if points.last().is_some_and(|last| at <= last.at) {
            continue;
        }
        points.push(PlanPoint { at, pose: p.pose, curvature_1pm: p.curvature_1pm, speed_mps, accel_mps2 });
    }
    points
}

/// Forward and backward pass over `v² = v0² + 2 a s`; where it `stops` the last speed is zero.
fn limited_speeds(
    path: &[PathPoint],
    gaps_m: &[f64],
    start_mps: f64,
    target_mps: f64,
    stops: bool,
    limits: &Limits,
) -> Vec<f64> {
    let mut speeds: Vec<f64> = path
        .iter()
        .map(|p| {
            let curve = p.curvature_1pm.abs().max(1e-9);
            target_mps.max(0.0).min((limits.lateral_accel_max_mps2 / curve).sqrt())
        })
        .collect();
    if let Some(last) = speeds.last_mut().filter(|_| stops) {
        *last = 0.0;
    }
    let reach = |from: f64, a: f64, gap: f64| (from * from + 2.0 * a * gap).max(0.0).sqrt();
    for i in (0..gaps_m.len()).rev() {
        speeds[i] = speeds[i].min(reach(speeds[i + 1], limits.brake_max_mps2, gaps_m[i]));
    }
    if let Some(first) = speeds.first_mut() {
        *first = start_mps.max(0.0);
    }
    for (i, &gap) in gaps_m.iter().enumerate() {
        let slowest = reach(speeds[i], -limits.brake_max_mps2, gap);
        let fastest = reach(speeds[i], limits.accel_max_mps2, gap);
        speeds[i + 1] = speeds[i + 1].clamp(slowest.min(fastest), fastest);
    }
    speeds
}

#[cfg(test)]
mod tests {
    use swerve_msg::PlanStatus;

    use super::*;
    use crate::path::route::follow_route;
    use crate::testing::World;

    #[test]
    fn speeds_keep_the_limits() {
        let world = World::bend(20.0, 25.0);
        let plan = follow_route(&world.request(), SpeedProfile::Limited, 5.0, PlanStatus::Route);
        let (mut slowed, limits) = (false, world.limits);
        for pair in plan.points.windows(2) {
            assert!(pair[0].accel_mps2 >= -limits.brake_max_mps2 - 1e-6, "{pair:?}");
            assert!(pair[0].accel_mps2 <= limits.accel_max_mps2 + 1e-6, "{pair:?}");
            slowed |= pair[1].speed_mps < 13.0;
        }
        assert!(slowed);
        let last = plan.points[plan.points.len() - 1];
        assert!(last.speed_mps * last.speed_mps * 0.05 <= limits.lateral_accel_max_mps2 * 1.01, "{last:?}");
        let constant = follow_route(&world.request(), SpeedProfile::Constant, 5.0, PlanStatus::Route);
        assert!(constant.points.iter().all(|p| p.speed_mps == 25.0));
    }
}
