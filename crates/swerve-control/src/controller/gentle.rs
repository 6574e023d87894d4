//! Limits of the acceleration on plans.

use swerve_msg::PlanStatus;

use super::{ComfortAccelParams, Input, LawController, Status};

/// Below this speed an ego may set off at once: its brake only holds it, m/s.
const AT_REST_MPS: f64 = 0.3;

impl Input<'_> {
    /// Returns true if the plan keeps the limits of comfort.
    pub(super) fn is_gentle(&self) -> bool {
        let is_gentle = |status| matches!(status, PlanStatus::Comfortable | PlanStatus::PoseUncertain);
        self.plan.is_some_and(|plan| is_gentle(plan.status))
    }
}

/// Acceleration from which a rise is counted.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(super) struct Rise {
    from_mps2: f64,
    /// True if the last command followed a comfortable plan.
    is_limited: bool,
}

impl Rise {
    /// Advances by `dt_s` after the command of `last_mps2`: falls with the command, and rises at the rate of comfort,
    /// or with the command if that did not follow a comfortable plan.
    pub(super) fn advance(
        &mut self,
        input: &Input<'_>,
        params: &ComfortAccelParams,
        last_mps2: f64,
        dt_s: f64,
    ) {
        let rises_mps2 = self.from_mps2 + params.rise_mps3 * dt_s;
        self.from_mps2 = if self.is_limited { rises_mps2.min(last_mps2) } else { last_mps2 };
        if input.ego.speed_mps.abs() < AT_REST_MPS {
            self.from_mps2 = self.from_mps2.max(0.0);
        }
        self.is_limited = input.is_gentle();
    }
}

impl LawController {
    /// Largest acceleration to command where the plan has `planned_mps2`, m/s²; infinite without a plan.
    pub(super) fn accel_most_mps2(&self, input: &Input<'_>, status: Status, planned_mps2: f64) -> f64 {
        let params = &self.params.comfort_accel;
        let most_mps2 = params.most_mps2.max(planned_mps2);
        match status {
            Status::Plan if input.is_gentle() => most_mps2.min(self.rise.from_mps2 + params.at_once_mps2),
            Status::Plan => most_mps2,
            Status::Route | Status::Stopping(_) | Status::Blind => f64::INFINITY,
        }
    }
}

#[cfg(test)]
mod tests {
    use swerve_core::{Span, Time};
    use swerve_geom::Pose2;
    use swerve_msg::{EgoState, Plan, PlanPoint};
    use swerve_vehicle::{Limits, Shape};

    use super::*;
    use crate::bicycle::{DRIVE, road};
    use crate::{Controller as _, Law, Params};

    const TICK_S: f64 = 0.01;
    /// Lag of the drivetrain, seconds.
    const LAG_S: f64 = 0.2;

    /// A straight plan with an acceleration for half a second, then with a rise of 5 m/s³ to 2 m/s².
    fn sets_off(mut speed_mps: f64, mut accel_mps2: f64, status: PlanStatus) -> Plan {
        let (mut x_m, step_s) = (0.0, 0.05);
        let points = (0..120)
            .map(|k| {
                let at = Time::from_ms(50 * k);
                let pose = Pose2::new(x_m, 0.0, 0.0);
                let point = PlanPoint { at, pose, speed_mps, accel_mps2, ..PlanPoint::default() };
                let rise_mps3 = if k < 10 { 0.0 } else { 5.0 };
                let next_mps2 = (accel_mps2 + rise_mps3 * step_s).min(2.0);
                let next_mps = (speed_mps + 0.5 * (accel_mps2 + next_mps2) * step_s).max(0.0);
                x_m += 0.5 * (speed_mps + next_mps) * step_s;
                (speed_mps, accel_mps2) = (next_mps, next_mps2);
                point
            })
            .collect();
        Plan { status, points, ..Plan::default() }
    }

    /// Accelerations of a car that lags its commands, m/s², one per tick, and its speed lag at the end, m/s.
    fn driven(law: Law, plan: &Plan) -> (Vec<f64>, f64) {
        let params = Params { law, ..Params::default() };
        let mut controller = LawController::new(params, Shape::default(), Limits::default(), Box::new(DRIVE));
        let first = plan.points[0];
        let start =
            EgoState { speed_mps: first.speed_mps, accel_mps2: first.accel_mps2, ..EgoState::default() };
        let (mut ego, mut felt) = (start, Vec::new());
        for _ in 0..500 {
            let input = Input { now: ego.stamp, ego: &ego, plan: Some(plan), route: &road() };
            let command = controller.step(&input).command;
            let wanted_mps2 = DRIVE.accel_max_mps2 * command.throttle - DRIVE.brake_max_mps2 * command.brake;
            ego.accel_mps2 += (wanted_mps2 - ego.accel_mps2) * TICK_S / LAG_S;
            if ego.speed_mps == 0.0 {
                ego.accel_mps2 = ego.accel_mps2.max(0.0);
            }
            ego.speed_mps = (ego.speed_mps + ego.accel_mps2 * TICK_S).max(0.0);
            ego.pose = ego.pose.ahead(ego.speed_mps * TICK_S);
            ego.stamp += Span::from_secs(TICK_S);
            felt.push(ego.accel_mps2);
        }
        (felt, plan.at(ego.stamp).unwrap().speed_mps - ego.speed_mps)
    }

    fn largest(felt: &[f64]) -> f64 {
        felt.iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }

    /// Largest rise over half a second, m/s³.
    fn rise_mps3(felt: &[f64]) -> f64 {
        felt.windows(51).map(|half| (half[50] - half[0]) / 0.5).fold(0.0, f64::max)
    }

    #[test]
    fn catching_up_with_a_plan_keeps_the_limits_of_comfort() {
        for law in [Law::Stanley, Law::PurePursuit, Law::Mpc] {
            for (speed_mps, accel_mps2, late_mps) in [(0.0, 0.0, 0.3), (4.0, 0.0, 0.3), (8.0, -3.0, 1.2)] {
                let plan = sets_off(speed_mps, accel_mps2, PlanStatus::Comfortable);
                let (felt, lag_mps) = driven(law, &plan);
                let (most_mps2, rise_mps3) = (largest(&felt), rise_mps3(&felt));
                let from = format!("{law:?} from {speed_mps} m/s: {most_mps2} {rise_mps3} {lag_mps}");
                assert!((1.9..=2.2 + 1e-9).contains(&most_mps2), "{from}");
                assert!(rise_mps3 < 4.0 && lag_mps.abs() < late_mps, "{from}");
            }
        }
    }

    #[test]
    fn other_plans_may_raise_the_acceleration_faster() {
        let plan = sets_off(8.0, -3.0, PlanStatus::Found);
        let (felt, _) = driven(Law::Stanley, &plan);
        assert!(rise_mps3(&felt) > 4.2 && largest(&felt) <= 2.2 + 1e-9, "{}", rise_mps3(&felt));
    }

    #[test]
    fn a_plan_with_more_acceleration_is_followed() {
        let mut plan = sets_off(4.0, 2.0, PlanStatus::Comfortable);
        for (k, point) in plan.points.iter_mut().enumerate() {
            let t_s = 0.05 * k as f64;
            (point.speed_mps, point.accel_mps2) = (4.0 + 2.8 * t_s, 2.8);
            point.pose = Pose2::new(4.0 * t_s + 1.4 * t_s * t_s, 0.0, 0.0);
        }
        let (felt, lag_mps) = driven(Law::Stanley, &plan);
        assert!((largest(&felt) - 2.8).abs() < 0.01, "{} {lag_mps}", largest(&felt));
    }

    #[test]
    fn a_rise_is_counted_from_the_end_of_an_emergency() {
        let (params, ego) =
            (ComfortAccelParams::default(), EgoState { speed_mps: 8.0, ..EgoState::default() });
        let route = road();
        let gentle = sets_off(8.0, -3.0, PlanStatus::Comfortable);
        let hard = Plan { status: PlanStatus::Found, ..gentle.clone() };
        let mut rise = Rise::default();
        let mut advance = |plan: &Plan, last_mps2: f64| {
            let input = Input { now: ego.stamp, ego: &ego, plan: Some(plan), route: &route };
            rise.advance(&input, &params, last_mps2, TICK_S);
            rise.from_mps2
        };
        assert_eq!([advance(&hard, -8.0), advance(&hard, -4.0), advance(&gentle, -3.5)], [-8.0, -4.0, -3.5]);
        assert!((advance(&gentle, -3.3) - (-3.5 + params.rise_mps3 * TICK_S)).abs() < 1e-12);
        assert_eq!(advance(&gentle, -5.0), -5.0);
    }
}
