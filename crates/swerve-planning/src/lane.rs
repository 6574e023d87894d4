//! The ego's own lane: its blockages, and the way back to its centre.

use swerve_core::Span;
use swerve_geom::{Pose2, math};
use swerve_map::Borders;
use swerve_msg::{EgoState, PlanPoint};
use swerve_vehicle::Shape;

use crate::following::{STEP_S, Step};
use crate::fot::line::{Line, Node, OnLine};
use crate::fot::poly::Quintic;
use crate::traffic::Knot;

/// Duration of the return to the centre, seconds, and its smallest length, metres.
const RETURN_S: f64 = 4.0;
const RETURN_MIN_M: f64 = 10.0;

/// Duration of the rest of a move out to an offset, seconds.
const OUT_S: f64 = 2.0;

/// Additional length per square root of the offset from the centre: bounds the curvature.
const RETURN_PER_ROOT_M: f64 = 12.0;

/// On a shorter way to rest than this the ego does not steer, metres.
const REST_WAY_M: f64 = 1.0;

/// Largest curvature of a quintic from offset to offset, relative to their distance over its length squared.
pub(crate) const QUINTIC_BEND: f64 = 5.78;

/// Below this speed the yaw rate does not determine the curvature, m/s.
const TURNS_MPS: f64 = 0.5;

/// Beyond the line by more than this the ego is in the other lane, metres.
const OVER_LINE_M: f64 = 0.1;

/// The ego's lane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lane<'a> {
    /// Borders of the lane beside the line.
    pub(crate) borders: &'a Borders,
    /// Width of the ego, metres.
    pub(crate) width_m: f64,
    /// Distance to keep when passing, metres.
    pub(crate) clearance_m: f64,
    /// True if the ego keeps to the line.
    pub(crate) on_line: bool,
}

impl Lane<'_> {
    /// Returns true if the ego's outline is over the left line with its origin at this place.
    pub(crate) fn is_over(&self, s_m: f64, d_m: f64) -> bool {
        d_m + 0.5 * self.width_m > self.borders.left_m(s_m) + OVER_LINE_M
    }

    /// Returns true if a road user there leaves no room to pass it within the lane.
    pub(crate) fn is_blocked(&self, knot: &Knot) -> bool {
        let needed_m = self.width_m + self.clearance_m;
        if self.on_line {
            let half_m = 0.5 * self.width_m + self.clearance_m;
            return knot.right_m < half_m && knot.left_m > -half_m;
        }
        let s_m = 0.5 * (knot.from_m + knot.to_m);
        let (left_m, right_m) = (self.borders.left_m(s_m), self.borders.right_m(s_m));
        let overlaps = knot.right_m < left_m && knot.left_m > -right_m;
        overlaps && (left_m - knot.left_m).max(knot.right_m + right_m) < needed_m
    }
}

/// Points along the line at the steps of a profile, from an offset back to its centre.
pub(crate) fn back_to_centre(
    line: &Line,
    place: &OnLine,
    start: &EgoState,
    steps: &[Step],
    shape: &Shape,
) -> Vec<PlanPoint> {
    aside(line, place, start, steps, (shape, Aside { to_m: 0.0, length_m: return_m(place, start) }))
}

/// Length of a return to the centre, metres.
fn return_m(place: &OnLine, start: &EgoState) -> f64 {
    (RETURN_S * start.speed_mps.max(0.0)).max(RETURN_MIN_M).max(RETURN_PER_ROOT_M * place.d_m.abs().sqrt())
}

/// Points along the line at the steps of a profile that comes to rest before a return to the centre ends: to rest along
/// the line, as near to its centre as the lateral acceleration, m/s², and the curvature, 1/m, allow. `None` for other
/// profiles.
pub(crate) fn towards_centre(
    line: &Line,
    place: &OnLine,
    start: &EgoState,
    steps: &[Step],
    (shape, lateral_mps2, curvature_1pm): (&Shape, f64, f64),
) -> Option<Vec<PlanPoint>> {
    let last = steps.last().filter(|last| last.speed_mps < TURNS_MPS)?;
    let length_m = last.s_m - place.s_m;
    if length_m > return_m(place, start) || length_m < REST_WAY_M {
        return None;
    }
    let v = start.speed_mps.max(TURNS_MPS);
    let bend_1pm = curvature_1pm.min(lateral_mps2 / (v * v));
    let over_m = bend_1pm * length_m * length_m / QUINTIC_BEND;
    let to_m = place.d_m.signum() * (place.d_m.abs() - over_m).max(0.0);
    Some(aside(line, place, start, steps, (shape, Aside { to_m, length_m })))
}

/// Points along the line at the steps of a profile: out to an offset, then from step `k` on back to the centre.
pub(crate) fn aside_then_back(
    line: &Line,
    place: &OnLine,
    start: &EgoState,
    (steps, k): (&[Step], usize),
    (shape, to_m): (&Shape, f64),
) -> Vec<PlanPoint> {
    let length_m = steps[k].s_m - place.s_m;
    if length_m < RETURN_MIN_M {
        return back_to_centre(line, place, start, steps, shape);
    }
    let length_m = length_m.min((OUT_S * start.speed_mps).max(RETURN_MIN_M));
    let mut points = aside(line, place, start, &steps[..=k], (shape, Aside { to_m, length_m }));
    let Some(end) = points.pop() else { return points };
    let s_m = steps[k].s_m;
    let then = OnLine { s_m, d_m: to_m, node: line.at(s_m), turn_rad: 0.0 };
    let yaw_rate_radps = end.speed_mps * end.curvature_1pm;
    let start =
        EgoState { stamp: end.at, pose: end.pose, speed_mps: end.speed_mps, yaw_rate_radps, ..*start };
    points.extend(back_to_centre(line, &then, &start, &steps[k..], shape));
    points
}

/// Length at the ego's offset per metre of the line.
pub(crate) fn stretch(place: &OnLine) -> f64 {
    (1.0 - place.node.curvature_1pm * place.d_m).max(0.1)
}

/// A lateral move.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Aside {
    /// End offset, metres to the left.
    pub(crate) to_m: f64,
    /// Length along the line, metres.
    pub(crate) length_m: f64,
}

/// Points along the line at the steps of a profile, from the ego's place to another offset.
///
/// The offset is a quintic over arc length, so that it is independent of the speed and holds at standstill (Werling
/// 2010, section V.C); headings and curvatures are those of the motion (ibid., appendix I).
pub(crate) fn aside(
    line: &Line,
    place: &OnLine,
    start: &EgoState,
    steps: &[Step],
    (shape, Aside { to_m, length_m }): (&Shape, Aside),
) -> Vec<PlanPoint> {
    let speed_mps = start.speed_mps.max(0.0);
    let curvature_1pm =
        if speed_mps > TURNS_MPS { start.yaw_rate_radps / speed_mps } else { place.node.curvature_1pm };
    let tightest_1pm = 1.0 / shape.wheelbase_m;
    let Node { curvature_1pm: line_1pm, bend_1pm2, .. } = place.node;
    let stretch = stretch(place);
    let tan = math::tan(place.turn_rad.clamp(-1.0, 1.0));
    let cos = 1.0 / (1.0 + tan * tan).sqrt();
    let slope = stretch * tan;
    let turning = curvature_1pm.clamp(-tightest_1pm, tightest_1pm) * stretch / cos - line_1pm;
    let bend_1pm = turning * stretch / (cos * cos) - (bend_1pm2 * place.d_m + line_1pm * slope) * tan;
    let offset = Quintic::new([place.d_m, slope, bend_1pm], [to_m, 0.0, 0.0], length_m);
    let point = |(k, step): (usize, &Step)| {
        let d = offset.at((step.s_m - place.s_m).clamp(0.0, length_m));
        let node = line.at(step.s_m);
        let stretch = (1.0 - node.curvature_1pm * d.x).max(0.1);
        let tan = d.v / stretch;
        let cos = 1.0 / (1.0 + tan * tan).sqrt();
        let turning = node.bend_1pm2 * d.x + node.curvature_1pm * d.v;
        let curvature_1pm =
            ((d.a + turning * tan) * cos * cos / stretch + node.curvature_1pm) * cos / stretch;
        PlanPoint {
            at: start.stamp + Span::from_secs(k as f64 * STEP_S),
            pose: Pose2::new(
                node.x_m - node.sin * d.x,
                node.y_m + node.cos * d.x,
                math::atan2(node.sin, node.cos) + math::atan(tan),
            ),
            curvature_1pm,
            speed_mps: step.speed_mps * stretch / cos,
            accel_mps2: step.accel_mps2 * stretch / cos,
        }
    };
    steps.iter().enumerate().map(point).collect()
}
