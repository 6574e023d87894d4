//! Start state of a plan: the ego state predicted to when the plan is ready.

use swerve_core::{Span, Time};
use swerve_geom::{Ego, Point2, Pose2, angle_between, math};
use swerve_msg::{EgoState, Plan, PlanPoint};

/// State expected `ahead` after `measured`.
///
/// If the previous plan covers both instants, the ego moves as the plan does between them, keeping its current offset
/// from the plan; if the plan begins in between, the ego is assumed to be on it then; otherwise it continues with
/// constant speed and yaw rate.
pub fn predicted_start(measured: &EgoState, previous: Option<&Plan>, ahead: Span) -> EgoState {
    let stamp = measured.stamp + ahead;
    let steadily = moved_steadily(measured, ahead);
    let Some(plan) = previous.filter(|plan| stamp <= plan.end()) else { return steadily };
    let (Some(first), Some(then)) = (plan.points.first(), plan.at(stamp)) else { return steadily };
    if stamp < first.at {
        return steadily;
    }
    if measured.stamp < first.at {
        // The plan has not begun yet: its first point is the best estimate of where it will be entered.
        return moved_with_plan(&on_plan(measured, first), first, &then, stamp);
    }
    match plan.at(measured.stamp) {
        Some(now) => moved_with_plan(measured, &now, &then, stamp),
        None => steadily,
    }
}

fn on_plan(measured: &EgoState, p: &PlanPoint) -> EgoState {
    EgoState { stamp: p.at, pose: p.pose, speed_mps: p.speed_mps, ..*measured }
}

fn moved_with_plan(measured: &EgoState, now: &PlanPoint, then: &PlanPoint, stamp: Time) -> EgoState {
    let local: Point2<Ego> = now.pose.to_local(then.pose.point());
    let point = measured.pose.from_local(local);
    let turn = angle_between(now.pose.heading_rad, then.pose.heading_rad);
    let speed_mps = (measured.speed_mps + then.speed_mps - now.speed_mps).max(0.0);
    let yaw_rate_radps = speed_mps * then.curvature_1pm;
    EgoState {
        stamp,
        pose: Pose2::new(point.x_m, point.y_m, measured.pose.heading_rad + turn),
        speed_mps,
        accel_mps2: then.accel_mps2,
        lateral_accel_mps2: speed_mps * yaw_rate_radps,
        yaw_rate_radps,
        steering_rad: measured.steering_rad,
    }
}

/// Motion on the circle given by speed and yaw rate.
pub(crate) fn moved_steadily(measured: &EgoState, ahead: Span) -> EgoState {
    let (t, turn) = (ahead.as_secs(), measured.yaw_rate_radps * ahead.as_secs());
    // Chord of the arc: length v t sinc(turn / 2), direction half way through the turn.
    let half = 0.5 * turn;
    let sinc = if half.abs() < 1e-6 { 1.0 } else { math::sin(half) / half };
    let chord: Pose2 = Pose2::new(measured.pose.x_m, measured.pose.y_m, measured.pose.heading_rad + half)
        .ahead(measured.speed_mps * t * sinc);
    let pose = Pose2::new(chord.x_m, chord.y_m, measured.pose.heading_rad + turn);
    EgoState { stamp: measured.stamp + ahead, pose, ..*measured }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn start(speed_mps: f64, yaw_rate_radps: f64) -> EgoState {
        EgoState { stamp: Time::from_ms(500), speed_mps, yaw_rate_radps, ..EgoState::default() }
    }

    #[test]
    fn start_without_a_plan_continues_on_its_circle() {
        // A quarter circle of radius 10 m in one second.
        let quarter = core::f64::consts::FRAC_PI_2;
        let there = predicted_start(&start(10.0 * quarter, quarter), None, Span::from_ms(1000));
        assert!((there.pose.x_m - 10.0).abs() < 1e-9 && (there.pose.y_m - 10.0).abs() < 1e-9, "{there:?}");
        assert!((there.pose.heading_rad - quarter).abs() < 1e-12);
        assert_eq!(there.stamp, Time::from_ms(1500));
    }

    #[test]
    fn start_with_a_plan_moves_as_planned() {
        let point = |ms, x, speed_mps| PlanPoint {
            at: Time::from_ms(ms),
            pose: Pose2::new(x, 1.0, 0.0),
            speed_mps,
            ..PlanPoint::default()
        };
        let plan = Plan { points: vec![point(0, 0.0, 10.0), point(1000, 9.0, 8.0)], ..Plan::default() };
        let measured = EgoState { pose: Pose2::new(4.0, 0.5, 0.0), ..start(9.5, 0.0) };
        let there = predicted_start(&measured, Some(&plan), Span::from_ms(100));
        assert!((there.pose.x_m - 4.9).abs() < 1e-9 && (there.pose.y_m - 0.5).abs() < 1e-9, "{there:?}");
        assert!((there.speed_mps - 9.3).abs() < 1e-9);
        // A plan that begins later is used unchanged.
        let early = EgoState { stamp: Time::from_ms(-200), ..measured };
        let taken_up = predicted_start(&early, Some(&plan), Span::from_ms(300));
        assert!(
            (taken_up.pose.x_m - 0.9).abs() < 1e-9 && (taken_up.speed_mps - 9.8).abs() < 1e-9,
            "{taken_up:?}"
        );
        // The plan is undefined beyond its end.
        let beyond = predicted_start(&measured, Some(&plan), Span::from_ms(1000));
        assert!((beyond.pose.x_m - 13.5).abs() < 1e-9);
    }
}
