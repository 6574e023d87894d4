//! Limits of the commanded acceleration.

use swerve_msg::{EgoState, PlanStatus};

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

/// Acceleration of a car that lags its commands, from which a rise is limited.
///
/// Commands follow noisy speeds. A limit from command to command would cut off their rises and keep their falls, and so
/// slow the car down; the acceleration of the car has little of that noise.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(super) struct Rise {
    accel_mps2: f64,
}

impl Rise {
    /// Advances by `dt_s` under the command of `last_mps2`.
    pub(super) fn advance(&mut self, params: &ComfortAccelParams, ego: &EgoState, last_mps2: f64, dt_s: f64) {
        self.accel_mps2 += (last_mps2 - self.accel_mps2) * (dt_s / params.lag_s).min(1.0);
        if ego.speed_mps.abs() < AT_REST_MPS {
            self.accel_mps2 = self.accel_mps2.max(0.0);
        }
    }

    /// Largest command with which the acceleration rises at the rate of comfort, m/s².
    fn most_mps2(&self, params: &ComfortAccelParams) -> f64 {
        self.accel_mps2 + params.rise_mps3 * params.lag_s
    }
}

impl LawController {
    /// Largest acceleration to command where the plan has `planned_mps2`, m/s²; without a plan only grip bounds it.
    pub(super) fn accel_most_mps2(&self, input: &Input<'_>, status: Status, planned_mps2: f64) -> f64 {
        let params = &self.params.comfort_accel;
        let most_mps2 = params.most_mps2.max(planned_mps2);
        let most_mps2 = match status {
            Status::Plan if input.is_gentle() => most_mps2.min(self.rise.most_mps2(params)),
            Status::Plan => most_mps2,
            Status::Route | Status::Stopping(_) | Status::Blind => f64::INFINITY,
        };
        most_mps2.min(self.grip.accel_most_mps2())
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
    fn a_rise_is_limited_from_the_acceleration_of_the_car() {
        let params = ComfortAccelParams::default();
        let mut rise = Rise::default();
        let moving = EgoState { speed_mps: 8.0, ..EgoState::default() };
        (0..100).for_each(|_| rise.advance(&params, &moving, -6.0, TICK_S));
        let from_mps2 = rise.most_mps2(&params) - params.rise_mps3 * params.lag_s;
        assert!((from_mps2 + 6.0).abs() < 0.05, "after an emergency: {from_mps2}");
        rise.advance(&params, &EgoState::default(), -6.0, TICK_S);
        assert_eq!(rise.most_mps2(&params), params.rise_mps3 * params.lag_s, "at rest the brake only holds");
    }

    #[test]
    fn noise_of_the_speed_does_not_slow_the_car_down() {
        let mut controller =
            LawController::new(Params::default(), Shape::default(), Limits::default(), Box::new(DRIVE));
        let points = (0..400).map(|k| {
            let t_s = 0.05 * k as f64;
            let pose = Pose2::new(16.0 * t_s, 0.0, 0.0);
            PlanPoint { at: Time::from_ms(50 * k), pose, speed_mps: 16.0, ..PlanPoint::default() }
        });
        let plan = Plan { status: PlanStatus::Comfortable, points: points.collect(), ..Plan::default() };
        let mut rng = swerve_core::Rng::keyed(1, "noise", &[]);
        let (mut ego, mut accel_mps2) = (EgoState { speed_mps: 16.0, ..EgoState::default() }, 0.0);
        for _ in 0..1500 {
            let seen = EgoState { speed_mps: ego.speed_mps + 0.3 * rng.normal(), ..ego };
            let input = Input { now: ego.stamp, ego: &seen, plan: Some(&plan), route: &road() };
            let command = controller.step(&input).command;
            let wanted_mps2 = DRIVE.accel_max_mps2 * command.throttle - DRIVE.brake_max_mps2 * command.brake;
            accel_mps2 += (wanted_mps2 - accel_mps2) * TICK_S / LAG_S;
            ego.speed_mps += accel_mps2 * TICK_S;
            ego.pose = ego.pose.ahead(ego.speed_mps * TICK_S);
            ego.stamp += Span::from_secs(TICK_S);
        }
        let late_m = 16.0 * 15.0 - ego.pose.x_m;
        assert!(
            late_m.abs() < 1.0 && (ego.speed_mps - 16.0).abs() < 0.3,
            "{late_m} m, {} m/s",
            ego.speed_mps
        );
    }
}
