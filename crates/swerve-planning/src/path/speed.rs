//! Speeds and instants along a path.

use swerve_core::Span;
use swerve_msg::{EgoState, PlanPoint};
use swerve_vehicle::Limits;

use super::points::PathPoint;

/// Lower bound on the mean speed used for timing, m/s: keeps times finite at standstill.
pub(crate) const CREEP_MPS: f64 = 0.1;

/// Speed profile along a path.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum SpeedProfile {
    /// The target speed from the first point on, regardless of the start, as in Pylot.
    Constant,
    /// From the start's speed within acceleration, braking and lateral limits; decelerates to the target with at most 3
    /// m/s².
    Limited,
    /// As [`SpeedProfile::Limited`], but decelerates to the target with all of the braking.
    Braking,
    /// As [`SpeedProfile::Limited`], and at rest at the path's last point.
    LimitedToStop,
}

/// Largest deceleration to the target speed if nothing else requires more, m/s².
const EASE_MPS2: f64 = 3.0;

impl SpeedProfile {
    /// Largest deceleration to the target speed, m/s².
    pub(crate) fn ease_mps2(self, limits: &Limits) -> f64 {
        match self {
            Self::Braking => limits.brake_max_mps2,
            _ => EASE_MPS2.min(limits.brake_max_mps2),
        }
    }
}

/// Times a path driven from `start` (its stamp, its speed) towards `target_mps`; appends to `points`.
///
/// Except with [`SpeedProfile::Constant`], speeds respect `limits`: lateral acceleration everywhere, braking before
/// curves, acceleration out of them. The start's speed is not changed: if it is too high for the path, the plan brakes
/// as hard as allowed.
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
        SpeedProfile::Limited | SpeedProfile::Braking | SpeedProfile::LimitedToStop => {
            limited_speeds(path, &gaps_m, start.speed_mps, target_mps, profile, limits)
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
        // Repeated poses take no time: keep instants strictly increasing.
        if points.last().is_some_and(|last| at <= last.at) {
            continue;
        }
        points.push(PlanPoint { at, pose: p.pose, curvature_1pm: p.curvature_1pm, speed_mps, accel_mps2 });
    }
    points
}

/// Backward and forward pass over `v² = v0² + 2 a s`.
fn limited_speeds(
    path: &[PathPoint],
    gaps_m: &[f64],
    start_mps: f64,
    target_mps: f64,
    profile: SpeedProfile,
    limits: &Limits,
) -> Vec<f64> {
    let mut speeds: Vec<f64> = path
        .iter()
        .map(|p| {
            let curve = p.curvature_1pm.abs().max(1e-9);
            (limits.lateral_accel_max_mps2 / curve).sqrt()
        })
        .collect();
    if let Some(last) = speeds.last_mut().filter(|_| profile == SpeedProfile::LimitedToStop) {
        *last = 0.0;
    }
    let reach = |from: f64, a: f64, gap: f64| (from * from + 2.0 * a * gap).max(0.0).sqrt();
    for i in (0..gaps_m.len()).rev() {
        speeds[i] = speeds[i].min(reach(speeds[i + 1], limits.brake_max_mps2, gaps_m[i]));
    }
    if let Some(first) = speeds.first_mut() {
        *first = start_mps.max(0.0);
    }
    let ease_mps2 = profile.ease_mps2(limits);
    for (i, &gap) in gaps_m.iter().enumerate() {
        let eased = target_mps.max(0.0).max(reach(speeds[i], -ease_mps2, gap));
        speeds[i + 1] = speeds[i + 1].min(eased);
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
    fn speed_above_the_target_is_reduced_gently_unless_a_curve_requires_more() {
        // From 20 m/s to 14 m/s: by 3 of 8 m/s² within 204 / 6 = 34 m.
        let mut world = World::straight(20.0);
        world.target_speed_mps = 14.0;
        let hardest = |world: &World, profile| {
            let plan = follow_route(&world.request(), profile, 5.0, PlanStatus::Route);
            assert!(
                plan.points
                    .last()
                    .is_some_and(|end| (end.speed_mps - 14.0).abs() < 1e-9 || end.speed_mps < 14.0)
            );
            plan.points.iter().map(|p| -p.accel_mps2).fold(0.0, f64::max)
        };
        assert!((hardest(&world, SpeedProfile::Limited) - 3.0).abs() < 1e-6);
        assert!((hardest(&world, SpeedProfile::Braking) - 8.0).abs() < 1e-6);
        // A curve of 20 m radius from here on: full braking.
        let mut world = World::bend(20.0, 20.0);
        world.target_speed_mps = 14.0;
        assert!((hardest(&world, SpeedProfile::Limited) - world.limits.brake_max_mps2).abs() < 1e-6);
    }

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
