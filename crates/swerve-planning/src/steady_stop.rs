//! Steady braking along a path until the ego stands.

use swerve_core::{Span, Time};
use swerve_geom::Pose2;
use swerve_msg::{Plan, PlanPoint, PlanStatus};

use crate::collision::Obstacles;
use crate::path::points::{Measured, PathPoint, with_curvature};
use crate::request::Request;
use swerve_vehicle::Shape;

/// Distances and jerk of a stop.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Demands {
    /// Gaps ahead, metres: the first one that fits is used.
    pub(crate) gaps_m: [f64; 2],
    /// Clearance to all obstacles, metres.
    pub(crate) clearance_m: f64,
    /// True if it brakes as hard as possible when neither gap can be kept.
    pub(crate) hardest: bool,
    /// Jerk at which the deceleration grows, m/s³.
    pub(crate) jerk_mps3: f64,
}

/// Returns true if the poses of a plan may be driven.
pub(crate) type Usable<'a> = &'a dyn Fn(&[(Pose2, Time)]) -> bool;

/// The gentlest steady braking along `way` that comes to rest before obstacles in it, if one is free: with the first of
/// `gaps_m` that can be kept, otherwise with `clearance_m`. `brakes_mps2` are tried in their order; `usable` is true
/// for the poses of each returned plan.
///
/// A quintic that ends at rest peaks at one and a half times its mean deceleration; where that is too much, a steady
/// stop may still be possible.
pub(crate) fn stop(
    request: &Request<'_>,
    way: &[Pose2],
    obstacles: &Obstacles,
    brakes_mps2: impl Iterator<Item = f64>,
    (Demands { gaps_m, clearance_m, hardest, jerk_mps3 }, usable): (Demands, Usable<'_>),
) -> Option<Plan> {
    let lateral_accel_max_mps2 = request.limits.lateral_accel_max_mps2;
    let path = with_curvature(way);
    let path = Measured::new(&path);
    let lateral = |p: &PlanPoint| p.curvature_1pm.abs() * p.speed_mps * p.speed_mps;
    // The gap is kept ahead only: road users that pass beside the ego are nearer.
    let free = |poses: &[(Pose2, Time)], gap_m: f64| {
        let longer = Shape { length_m: request.shape.length_m + gap_m - clearance_m, ..*request.shape };
        obstacles.path_free(|pose| longer.footprint(pose), poses, clearance_m)
    };
    let mut too_near = Vec::new();
    for brake_mps2 in brakes_mps2 {
        let plan = braking(request, &path, brake_mps2, jerk_mps3);
        if !plan.points.iter().all(|p| lateral(p) <= lateral_accel_max_mps2) {
            continue;
        }
        let poses: Vec<(Pose2, Time)> = plan.points.iter().map(|p| (p.pose, p.at)).collect();
        // `usable` takes longer than the check of obstacles, so only plans that are free are asked for it.
        match free(&poses, gaps_m[0].max(clearance_m)) {
            true if usable(&poses) => return Some(plan),
            true => {}
            false => too_near.push((plan, poses)),
        }
    }
    let keeps =
        |gap_m: f64| move |(_, poses): &(Plan, Vec<(Pose2, Time)>)| free(poses, gap_m) && usable(poses);
    let next = too_near.iter().position(keeps(gaps_m[1].max(clearance_m)));
    let last = || match hardest {
        true => too_near.iter().rposition(keeps(clearance_m)),
        false => too_near.iter().position(keeps(clearance_m)),
    };
    next.or_else(last).map(|k| too_near.swap_remove(k).0)
}

/// Plan along `path` to rest: the deceleration grows to `brake_mps2` at `jerk_mps3`, fades before the end at
/// [`JERK_MPS3`], and the ego stands after that.
fn braking(request: &Request<'_>, path: &Measured<'_>, brake_mps2: f64, jerk_mps3: f64) -> Plan {
    let start = &request.start;
    let (mut s_m, mut speed_mps) = (0.0, start.speed_mps.max(0.0));
    let mut accel_mps2 = start.accel_mps2.clamp(-brake_mps2, request.limits.accel_max_mps2);
    let mut points = Vec::new();
    let mut at = start.stamp;
    let mut standing = 0;
    while standing < STAND_STEPS {
        let PathPoint { pose, curvature_1pm } = path.at(s_m);
        points.push(PlanPoint { at, pose, curvature_1pm, speed_mps, accel_mps2 });
        // Hard enough to fade until the ego stands, but never so gentle that it creeps.
        let wanted = -brake_mps2.min((2.0 * JERK_MPS3 * speed_mps).sqrt()).max(CREEP_BRAKE_MPS2);
        let next = wanted.max(accel_mps2 - jerk_mps3 * STEP_S);
        let next_mps = (speed_mps + 0.5 * (accel_mps2 + next) * STEP_S).max(0.0);
        s_m += 0.5 * (speed_mps + next_mps) * STEP_S;
        accel_mps2 = if next_mps > 0.0 { next } else { 0.0 };
        standing += u32::from(next_mps == 0.0);
        speed_mps = next_mps;
        at += Span::from_secs(STEP_S);
    }
    Plan { stamp: request.stamp, status: PlanStatus::Comfortable, points, work: 0 }
}

/// Jerk at which the deceleration of a steady stop grows and fades, m/s³.
pub(crate) const JERK_MPS3: f64 = 5.0;

/// Smallest deceleration of a stop, m/s².
const CREEP_BRAKE_MPS2: f64 = 0.3;

/// Time step of a stop, seconds, and number of standstill steps at its end.
pub(crate) const STEP_S: f64 = 0.1;
const STAND_STEPS: u32 = 20;
