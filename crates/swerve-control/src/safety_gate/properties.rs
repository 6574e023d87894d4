use proptest::prelude::*;

use super::*;

/// Arbitrary numbers: mostly plausible, some at the extremes.
fn number() -> impl Strategy<Value = f64> {
    prop_oneof![6 => -40.0..40.0, 1 => any::<f64>(), 1 => Just(f64::NAN), 1 => Just(f64::INFINITY)]
}

/// Stamps near and far from now, ms.
fn stamp() -> impl Strategy<Value = i64> {
    prop_oneof![6 => -100_i64..50, 2 => -2000_i64..2000, 1 => Just(i64::MIN / 4_000_000), 1 => Just(i64::MAX / 4_000_000)]
}

prop_compose! {
    fn any_command()(stamp in stamp(), steering in number(), speed in number(), accel in number()) -> (i64, [f64; 3]) {
        (stamp, [steering, speed, accel])
    }
}

prop_compose! {
    fn any_tick()(
        dt_ms in prop_oneof![8 => 0_i64..40, 1 => -500_i64..2000],
        command in prop::option::weighted(0.9, any_command()),
        report in prop::option::weighted(0.9, (stamp(), number(), number(), prop::bool::weighted(0.05))),
        enable in prop::bool::weighted(0.8),
        emergency in prop::bool::weighted(0.03),
    ) -> (i64, Option<(i64, [f64; 3])>, Option<(i64, f64, f64, bool)>, bool, bool) {
        (dt_ms, command, report, enable, emergency)
    }
}

/// Faults of transport, localization or pose: mostly none.
fn any_fault() -> impl Strategy<Value = (Option<StopCause>, Option<PoseMode>, Option<[f64; 3]>)> {
    let alarm = prop_oneof![
        Just(StopCause::SecondWriter),
        Just(StopCause::ClockJump),
        Just(StopCause::TransportLost)
    ];
    let mode = prop_oneof![4 => Just(PoseMode::Good), 1 => Just(PoseMode::Noisy), 1 => Just(PoseMode::Coasting), 1 => Just(PoseMode::Lost)];
    let alarm = prop::option::weighted(0.02, alarm);
    (alarm, prop::option::weighted(0.1, mode), prop::option::weighted(0.05, [number(), number(), number()]))
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, rng_seed: proptest::test_runner::RngSeed::Fixed(11), ..ProptestConfig::default() })]

    /// No sequence of inputs passes a non-finite number, an old command, or a value beyond a limit.
    #[test]
    fn gate_never_passes_unsafe_commands(ticks in prop::collection::vec(any_tick(), 1..120)) {
        let p = GateParams::default();
        let mut gate = SafetyGate::new(p).unwrap();
        let (mut now_ms, mut latest_ms) = (10_000_i64, i64::MIN);
        let mut before: Option<(Time, GateOutput)> = None;
        let mut enable_before = true;
        // Stamps of the finite input commands.
        let mut sound: Vec<Time> = Vec::new();
        for (dt_ms, command, report, enable, emergency) in ticks {
            now_ms += dt_ms;
            latest_ms = latest_ms.max(now_ms);
            let (now, latest) = (Time::from_ms(now_ms), Time::from_ms(latest_ms));
            let at = |ms: i64| Time::from_ms(now_ms.saturating_add(ms));
            let command = command.map(|(stamp, [steering_rad, speed_mps, accel_mps2])| {
                MotionCommand { stamp: at(stamp), steering_rad, speed_mps, accel_mps2 }
            });
            let report = report.map(|(stamp, speed_mps, steering_rad, driver_active)| {
                VehicleReport { stamp: at(stamp), speed_mps, steering_rad, driver_active }
            });
            sound.extend(command.filter(|c| c.steering_rad.is_finite() && c.speed_mps.is_finite() && c.accel_mps2.is_finite()).map(|c| c.stamp));
            let output = gate.step(&GateInput { now, command, report, enable, emergency, ..GateInput::default() });
            let c = output.command;
            prop_assert!(c.steering_rad.is_finite() && c.speed_mps.is_finite() && c.accel_mps2.is_finite(), "{output:?}");
            prop_assert!(c.steering_rad.abs() <= p.steering_max_rad);
            prop_assert!((-p.reverse_max_mps..=p.speed_max_mps).contains(&c.speed_mps));
            prop_assert!(c.accel_mps2.abs() <= p.decel_max_mps2);
            if report.is_some_and(|r| r.driver_active) {
                prop_assert!(!output.engaged);
            }
            if output.mode == GateMode::Driving {
                let oldest = latest - Span::from_secs(p.command_timeout_s);
                prop_assert!(sound.iter().any(|stamp| *stamp >= oldest), "no sound command is young enough");
                prop_assert!(!emergency && enable);
            }
            if let Some((then, last)) = before {
                let rising = enable && !enable_before;
                if output.mode == GateMode::Driving && last.mode != GateMode::Driving {
                    prop_assert!(rising, "it began to drive without an act");
                }
                if output.engaged && last.engaged {
                    let dt_s = (latest - then).min(STEP_MAX).as_secs();
                    let turn = (c.steering_rad - last.command.steering_rad).abs();
                    prop_assert!(turn <= p.steering_rate_max_radps * dt_s + 1e-9, "{turn} in {dt_s}");
                }
                prop_assert_eq!(output.heartbeat, last.heartbeat.wrapping_add(1));
            }
            before = Some((latest, output));
            enable_before = enable;
        }
    }

    /// In `stopping` and `holding` the gate outputs the brake alone, for any report, command, pose or fault, and only
    /// the documented events end these modes.
    #[test]
    fn a_stop_is_never_an_acceleration(
        ticks in prop::collection::vec((any_tick(), any_fault()), 1..200),
        measured_mps in number(),
    ) {
        let p = GateParams { lane_margin_m: 0.85, repeat_max_s: 1.0, ..GateParams::default() };
        let vehicle = VehicleParams::default();
        let mut gate = SafetyGate::new(p).unwrap();
        let mut now_ms = 10_000_i64;
        let mut enable_before = true;
        let mut before: Option<GateOutput> = None;
        for ((dt_ms, command, report, enable, emergency), (alarm, quality, pose)) in ticks {
            now_ms += dt_ms.max(0);
            let now = Time::from_ms(now_ms);
            let at = |ms: i64| Time::from_ms(now_ms.saturating_add(ms));
            let command = command.map(|(stamp, [steering_rad, speed_mps, accel_mps2])| {
                MotionCommand { stamp: at(stamp), steering_rad, speed_mps, accel_mps2 }
            });
            let report = report.map(|(stamp, speed_mps, steering_rad, driver_active)| {
                VehicleReport { stamp: at(stamp), speed_mps, steering_rad, driver_active }
            });
            let quality = quality.map(|mode| PoseQuality { stamp: now, mode, ..PoseQuality::default() });
            let pose = pose.map(|[x_m, y_m, heading_rad]| {
                EgoState { stamp: now, pose: swerve_geom::Pose2::new(x_m, y_m, heading_rad), ..EgoState::default() }
            });
            let input = GateInput { now, command, report, enable, emergency, alarm, quality, pose, ..GateInput::default() };
            let output = gate.step(&input);
            let takes_over = report.is_some_and(|report| report.driver_active);
            let acts = enable && !enable_before && !emergency && alarm.is_none();
            if output.mode.brakes() {
                let Longitudinal::Brake(decel) = output.longitudinal() else { panic!("{output:?}") };
                // Built up from zero, or kept from before.
                let least = match (output.mode, before) {
                    (GateMode::Holding(_), _) => p.hold_decel_mps2,
                    (GateMode::Stopping(StopCause::Emergency), _) => p.emergency_decel_mps2,
                    (_, Some(last)) if last.mode.brakes() => p.stop_decel_mps2.min(-last.command.accel_mps2),
                    _ => 0.0,
                };
                prop_assert!(decel >= least - 1e-12, "{decel} {least} {output:?}");
                prop_assert!(output.command.accel_mps2 <= 0.0 && output.command.speed_mps == 0.0, "{output:?}");
                prop_assert_eq!(output.motion(), output.command);
                for speed_mps in [measured_mps, -measured_mps, 0.0, f64::NAN] {
                    let pedals = pedals(&vehicle, &output, speed_mps);
                    prop_assert!(pedals.throttle == 0.0 && pedals.brake >= 0.0, "{pedals:?}");
                    prop_assert!(decel == 0.0 || pedals.brake > 0.0, "{pedals:?}");
                }
            }
            match (before.map(|last| last.mode), output.mode) {
                (Some(GateMode::Stopping(_)), GateMode::Driving) => panic!("a stop ends at a standstill"),
                (Some(GateMode::Holding(_)), GateMode::Driving) => prop_assert!(acts, "released without the act"),
                (Some(GateMode::Stopping(_) | GateMode::Holding(_)), GateMode::Manual) => prop_assert!(takes_over),
                _ => {}
            }
            (before, enable_before) = (Some(output), enable);
        }
    }
}
