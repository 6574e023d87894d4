//! Stops that the controller makes by itself, under reports with noise.

use super::*;
use crate::LinearPedals;
use crate::bicycle::{curve, road};
use swerve_core::Rng;

const DRIVE: LinearPedals = LinearPedals { accel_max_mps2: 3.0, brake_max_mps2: 8.0 };
const LAWS: [Law; 4] = [Law::Pid, Law::PurePursuit, Law::Stanley, Law::Mpc];

/// Pedals and accelerations of a stop after an expired plan, from 8 m/s: the measured speed has noise about the speed of
/// a car that follows its pedals.
fn stop(law: Law, noise_mps: f64) -> Vec<(Status, Command, Option<f64>)> {
    let params = Params { law, ..Params::default() };
    let limits = Limits::default();
    let mut controller = Controller::new(params, Shape::default(), limits, Box::new(DRIVE));
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
            // 8 m/s at 2 to 3 m/s² are 4 s at most; from then on it is held: 3 m/s² of 8.
            let held = steps[500..].iter().all(|(_, command, _)| command.brake >= 3.0 / 8.0);
            assert!(held, "{law:?} {noise_mps}");
        }
    }
}
