//! Stops of the controller, with noisy and with missing states.

use super::*;
use crate::bicycle::{self, curve, ego, lane_change, road, slalom};
use crate::{LinearPedals, SlipParams};
use swerve_core::Rng;
use swerve_geom::Polyline;

const DRIVE: LinearPedals = LinearPedals { accel_max_mps2: 3.0, brake_max_mps2: 8.0 };
const LAWS: [Law; 4] = [Law::Pid, Law::PurePursuit, Law::Stanley, Law::Mpc];

/// Pedals and accelerations of a stop after an expired plan, from 8 m/s: the measured speed is that of a car that
/// follows its pedals, plus noise.
fn stop(law: Law, noise_mps: f64) -> Vec<(Status, Command, Option<f64>)> {
    let params = Params { law, ..Params::default() };
    let limits = Limits::default();
    let mut controller = LawController::new(params, Shape::default(), limits, Box::new(DRIVE));
    let plan = curve(|_| (0.0, 0.0, 0.0), 8.0, 0.5);
    let (mut speed_mps, mut x_m) = (8.0_f64, 0.0);
    let mut rng = Rng::keyed(7, "noise of the speed", &[]);
    let step = |k: i64| {
        let now = plan.end() + Span::from_ms(10 * (k + 1));
        let ego = EgoState {
            stamp: now,
            pose: Pose2::new(x_m, 0.0, 0.0),
            speed_mps: speed_mps + noise_mps * rng.normal(),
            ..EgoState::default()
        };
        let output = controller.step(&Input { now, ego: &ego, plan: Some(&plan), route: &road() });
        let Command { throttle, brake, .. } = output.command;
        speed_mps = (speed_mps + 0.01 * (3.0 * throttle - 8.0 * brake)).max(0.0);
        x_m += 0.01 * speed_mps;
        (output.status, output.command, output.accel_mps2)
    };
    (0..1000).map(step).collect()
}

#[test]
fn a_stop_of_the_controller_never_presses_the_accelerator() {
    for law in LAWS {
        for noise_mps in [0.0, 0.1, 0.5, 2.0] {
            let steps = stop(law, noise_mps);
            for (k, (status, command, accel_mps2)) in steps.iter().enumerate() {
                assert_eq!(*status, Status::Stopping(StopReason::PlanExpired));
                assert_eq!(command.throttle, 0.0, "{law:?} {noise_mps} {k}");
                assert!(accel_mps2.is_none_or(|accel| accel <= 0.0), "{law:?} {noise_mps} {k}");
            }
            // 8 m/s at 2 to 3 m/s² take at most 4 s; from then on the car is held: 3 m/s² of 8.
            let held = steps[500..].iter().all(|(_, command, _)| command.brake >= 3.0 / 8.0);
            assert!(held, "{law:?} {noise_mps}");
        }
    }
}

fn controller(law: Law) -> LawController {
    let mut params = Params { law, ..Params::default() };
    params.slip = SlipParams::NONE;
    (params.pure_pursuit.preview_s, params.stanley.preview_s, params.stanley.yaw_damping_s) = (0.0, 0.0, 0.0);
    LawController::new(params, Shape::default(), Limits::default(), Box::new(DRIVE))
}

/// Without a state the car comes to rest along its plan, and the brake holds it.
#[test]
fn a_stop_without_a_state_ends_on_the_path() {
    let wide = Route::uniform(road().line().clone(), 6.0, 6.0);
    for (plan, speed_mps, from_s, most_off_m) in [
        (curve(slalom, 8.0, 20.0), 8.0, [2.0, 3.1, 5.0], 0.25),
        (curve(lane_change, 15.0, 8.0), 15.0, [1.5, 2.5, 4.0], 1.0),
    ] {
        for (law, from_s) in LAWS.into_iter().flat_map(|law| from_s.map(|from_s| (law, from_s))) {
            let mut controller = controller(law);
            let mut state = ego(plan.points[0].pose, speed_mps);
            let mut seen = state;
            let mut commands = Vec::new();
            for k in 0..1400 {
                let now = Time::from_ms(10 * k);
                if now.as_secs() < from_s {
                    seen = state;
                }
                let output = controller.step(&Input { now, ego: &seen, plan: Some(&plan), route: &wide });
                if output.status == Status::Blind {
                    commands.push(output.command);
                }
                bicycle::drive(&mut state, output.command, Span::from_ms(10));
            }
            assert!(commands.iter().all(|c| c.throttle == 0.0 && c.brake >= 3.0 / 8.0 - 1e-9), "{law:?}");
            // 0.3 s in which the constant state lets the law accelerate, then 3 m/s².
            let way_m = state.pose.point().distance(seen.pose.point());
            let most_m = speed_mps * 0.35 + 0.5 * speed_mps * speed_mps / 3.0;
            assert!(state.speed_mps < 0.01 && way_m < most_m + 4.0, "{law:?}: {way_m} m");
            let points: Vec<_> = plan.points.iter().map(|p| p.pose.point()).collect();
            let off_m = swerve_geom::Polyline::smooth(&points, 0.05).unwrap().project(state.pose.point()).d_m;
            assert!(off_m.abs() < most_off_m, "{law:?} from {from_s} s: {off_m} m");
        }
    }
}

/// A state that is not finite, or older than 0.3 s, is unusable. The stop resets the integrals.
#[test]
fn unusable_state_is_no_longer_used() {
    let plan = curve(slalom, 10.0, 20.0);
    let spoil: [fn(&mut EgoState); 5] = [
        |e| e.pose.x_m = f64::NAN,
        |e| e.speed_mps = f64::INFINITY,
        |e| e.pose.heading_rad = f64::NAN,
        |e| e.yaw_rate_radps = f64::NAN,
        |e| e.stamp = e.stamp - Span::from_ms(2000),
    ];
    for (law, spoil) in LAWS.into_iter().flat_map(|law| spoil.map(|spoil| (law, spoil))) {
        let mut controller = controller(law);
        // 2 m/s slower than planned.
        let good = |ms: i64| EgoState {
            stamp: Time::from_ms(ms),
            ..ego(plan.at(Time::from_ms(ms)).unwrap().pose, 8.0)
        };
        let mut step_by = |now_ms: i64, ego: &EgoState, plan: &Plan| {
            let now = Time::from_ms(now_ms);
            controller.step(&Input { now, ego, plan: Some(plan), route: &road() })
        };
        let mut step = |now_ms: i64, ego: &EgoState| step_by(now_ms, ego, &plan);
        let mut bad = good(1000);
        spoil(&mut bad);
        let never = step(1000, &bad);
        assert!(never.status == Status::Blind && never.command.throttle == 0.0 && never.command.brake > 0.3);
        let first = step(1000, &good(1000));
        assert!(first.status == Status::Plan && first.command.throttle > 0.0, "{law:?}");
        for now_ms in (1010..=3000).step_by(10) {
            let output = step(now_ms, &bad);
            assert_eq!(output.status, Status::Blind, "{law:?} at {now_ms} ms");
            let Command { steering_rad, throttle, brake } = output.command;
            assert!(throttle == 0.0 && brake > 0.3 && steering_rad.abs() < 0.2, "{law:?}: {steering_rad}");
        }
        // States resume: the car brakes until there is a plan made from them.
        let last = step(3000, &bad).command;
        for now_ms in (3010..=3100).step_by(10) {
            let Output { status, command, .. } = step(now_ms, &good(now_ms));
            assert_eq!(status, Status::Stopping(StopReason::PlanOutdated), "{law:?} at {now_ms} ms");
            assert!(command.throttle == 0.0, "{law:?} at {now_ms} ms: {command:?}");
            let turned_rad = (command.steering_rad - last.steering_rad).abs();
            assert!(law == Law::Pid || turned_rad < 0.04, "{law:?} at {now_ms} ms: {turned_rad} rad");
        }
        let renewed = Plan { stamp: Time::from_ms(3010), ..plan.clone() };
        let again = step_by(3110, &good(3110), &renewed);
        assert_eq!(again.status, Status::Plan, "and goes on afterwards");
        assert!(again.command.throttle <= first.command.throttle + 0.1, "{law:?}: {:?}", again.command);
    }
}

#[test]
fn state_expires_after_its_maximum_age() {
    let plan = curve(slalom, 10.0, 20.0);
    for law in LAWS {
        let mut controller = controller(law);
        let seen = EgoState { stamp: Time::from_ms(1000), ..ego(Pose2::new(9.0, 1.0, 0.3), 10.0) };
        for now_ms in (1000..=2000).step_by(10) {
            let now = Time::from_ms(now_ms);
            let output = controller.step(&Input { now, ego: &seen, plan: Some(&plan), route: &road() });
            assert_eq!(output.status == Status::Blind, now_ms > 1300, "{law:?} at {now_ms} ms");
        }
    }
}

/// A plan that brakes at 6 m/s² is followed as hard without a state.
#[test]
fn a_stop_without_a_state_is_no_softer_than_planned() {
    let mut plan = curve(|_| (0.0, 0.0, 0.0), 12.0, 8.0);
    for point in &mut plan.points {
        let braked_s = (point.at.as_secs() - 1.0).clamp(0.0, 2.0);
        point.pose.x_m = 12.0 * point.at.as_secs().min(1.0) + (12.0 - 3.0 * braked_s) * braked_s;
        point.speed_mps = 12.0 - 6.0 * braked_s;
        point.accel_mps2 = if (1.0..3.0).contains(&point.at.as_secs()) { -6.0 } else { 0.0 };
    }
    for law in LAWS {
        let mut controller = controller(law);
        let mut state = ego(plan.points[0].pose, 12.0);
        let mut seen = state;
        for k in 0..600 {
            let now = Time::from_ms(10 * k);
            // The last state is from 1.1 s: just before the plan brakes hard.
            if k <= 110 {
                seen = state;
            }
            let output = controller.step(&Input { now, ego: &seen, plan: Some(&plan), route: &road() });
            bicycle::drive(&mut state, output.command, Span::from_ms(10));
        }
        // 12 m at 12 m/s, then 12 m at 6 m/s²; at 3 m/s² it would be 12 m more.
        assert!(state.speed_mps < 0.01 && state.pose.x_m < 27.0, "{law:?}: {}", state.pose.x_m);
    }
}

/// States, 10 ms apart, of a drive along a plan from its start at 10 m/s, with delayed states as input.
fn driven_late(law: Law, late_ms: usize, plan: &Plan, route: &Route, steps: i64) -> Vec<EgoState> {
    let mut controller = controller(law);
    let mut states = vec![EgoState { steering_rad: 0.0, ..ego(plan.points[0].pose, 10.0) }];
    for k in 0..steps {
        let known = states.len() - 1 - (late_ms / 10).min(states.len() - 1);
        let input = Input { now: Time::from_ms(10 * k), ego: &states[known], plan: Some(plan), route };
        let command = controller.step(&input).command;
        let mut next = states[states.len() - 1];
        bicycle::drive(&mut next, command, Span::from_ms(10));
        states.push(next);
    }
    states
}

/// A late state is extrapolated with the commands since then: the ego neither lags nor speeds up.
#[test]
fn late_states_do_not_increase_the_speed() {
    let plan = curve(|_| (0.0, 0.0, 0.0), 10.0, 20.0);
    for law in LAWS {
        for late_ms in [0, 50, 100, 200, 250] {
            let states = driven_late(law, late_ms, &plan, &road(), 1500);
            let off = states.iter().map(|state| (state.speed_mps - 10.0).abs()).fold(0.0, f64::max);
            let behind_m = (states[1500].pose.x_m - 150.0).abs();
            assert!(off < 0.4 && behind_m < 1.0, "{law:?}, {late_ms} ms: {off} m/s, {behind_m} m");
        }
    }
}

/// Without dead reckoning, a state that is 0.2 s late makes the steering oscillate more and more.
#[test]
fn slalom_is_tracked_with_late_states() {
    let plan = curve(slalom, 10.0, 12.0);
    let points: Vec<_> = plan.points.iter().map(|p| p.pose.point()).collect();
    let line = Polyline::smooth(&points, 0.05).unwrap();
    let wide = Route::uniform(road().line().clone(), 6.0, 6.0);
    for law in LAWS {
        for late_ms in [0, 100, 200, 290] {
            let states = driven_late(law, late_ms, &plan, &wide, 1150);
            let aside_m = states
                .iter()
                .zip(0..)
                .map(|(state, k)| line.project_near(state.pose.point(), 0.1 * f64::from(k), 10.0).d_m.abs());
            let aside_m = aside_m.fold(0.0, f64::max);
            assert!(aside_m < 0.35, "{law:?}, {late_ms} ms: {aside_m} m");
        }
    }
}

/// Without a state, every law turns the wheels of a slipping car as a steady bend under braking requires.
#[test]
fn stop_without_a_state_steers_as_the_bend_requires() {
    let (radius_m, from_mps) = (120.0, 15.0);
    let arc = |x: f64| {
        let root = (radius_m * radius_m - x * x).sqrt();
        (radius_m - root, x / root, radius_m * radius_m / (root * root * root))
    };
    let plan = curve(arc, from_mps, 6.0);
    let params = Params::default();
    let SlipParams { rear_s2pm, understeer_s2pm, braking_s4pm2 } = params.slip;
    let wheels = |v: f64, decel_mps2: f64| {
        let gradient_s2pm = understeer_s2pm - braking_s4pm2 * decel_mps2;
        math::atan(Shape::default().wheelbase_m / radius_m) + gradient_s2pm * v * v / radius_m
    };
    for law in LAWS {
        let params = Params { law, ..params };
        let mut controller = LawController::new(params, Shape::default(), Limits::default(), Box::new(DRIVE));
        // The nose points into the bend; the rear axle follows it.
        let on_plan = |now: Time| {
            let mut pose = plan.at(now).unwrap().pose;
            pose.heading_rad += rear_s2pm * from_mps * from_mps / radius_m;
            EgoState { stamp: now, yaw_rate_radps: from_mps / radius_m, ..ego(pose, from_mps) }
        };
        for now_ms in (500..3000).step_by(10) {
            let now = Time::from_ms(now_ms);
            let seen = on_plan(now.min(Time::from_ms(1000)));
            let output = controller.step(&Input { now, ego: &seen, plan: Some(&plan), route: &road() });
            // Half a second for the decay of earlier steering.
            if output.status == Status::Blind && now_ms > 1800 {
                let needed = wheels(from_mps - 3.0 * (now_ms - 1310) as f64 * 1e-3, 3.0);
                let steering_rad = output.command.steering_rad;
                assert!(
                    (steering_rad - needed).abs() < 0.003,
                    "{law:?} at {now_ms} ms: {steering_rad} for {needed}"
                );
            }
        }
    }
}
