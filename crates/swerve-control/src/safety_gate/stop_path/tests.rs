use swerve_core::{Span, Time};
use swerve_geom::{Pose2, math};
use swerve_msg::{EgoState, GateMode, MotionCommand, Plan, PlanPoint, StopCause, VehicleReport};

use super::super::{GateInput, GateParams, SafetyGate};

const SPEED_MPS: f64 = 8.0;

/// A straight plan along y = 0, for 5 s.
fn straight() -> Plan {
    let point = |k: i64| PlanPoint {
        at: Time::from_ms(100 * k),
        pose: Pose2::new(0.1 * k as f64 * SPEED_MPS, 0.0, 0.0),
        speed_mps: SPEED_MPS,
        ..PlanPoint::default()
    };
    Plan { points: (0..200).map(point).collect(), ..Plan::default() }
}

/// Drives a car with a heading drift of the pose from 3 s on, rad/s, and a stack that keeps the pose on the line. The
/// gate stops the car with or without the plan. Returns the car's largest distance from the line, metres, and the cause
/// of the stop.
fn off_line_m(drift_radps: f64, has_plan: bool) -> (f64, StopCause) {
    let params = GateParams { lane_margin_m: 0.85, stop_decel_mps2: 3.0, ..GateParams::default() };
    let mut gate = SafetyGate::new(params).unwrap();
    let plan = straight();
    let (mut car, mut pose) = (EgoState { speed_mps: SPEED_MPS, ..EgoState::default() }, Pose2::default());
    let (mut worst_m, mut cause) = (0.0_f64, None);
    for ms in (0..12_000_i64).step_by(10) {
        let now = Time::from_ms(ms);
        let steering_rad = -0.5 * pose.y_m - 1.0 * pose.heading_rad;
        let input = GateInput {
            now,
            command: Some(MotionCommand { stamp: now, steering_rad, speed_mps: SPEED_MPS, accel_mps2: 0.0 }),
            report: Some(VehicleReport {
                stamp: now,
                speed_mps: car.speed_mps,
                steering_rad: car.steering_rad,
                driver_active: false,
            }),
            enable: ms > 100,
            pose: Some(EgoState { stamp: now, pose, ..car }),
            plan: has_plan.then_some(&plan),
            ..GateInput::default()
        };
        let output = gate.step(&input);
        if let GateMode::Stopping(why) = output.mode {
            cause.get_or_insert(why);
        }
        car.steering_rad = output.command.steering_rad;
        car.speed_mps = (car.speed_mps + 0.01 * output.command.accel_mps2).max(0.0);
        car.yaw_rate_radps = car.speed_mps * math::tan(car.steering_rad) / params.wheelbase_m;
        car.pose = car.pose_after(0.01);
        let drifts = if now > Time::ZERO + Span::from_ms(3000) { drift_radps } else { 0.0 };
        pose = EgoState { pose, yaw_rate_radps: car.yaw_rate_radps + drifts, ..car }.pose_after(0.01);
        worst_m = worst_m.max(car.pose.y_m.abs());
    }
    assert!(car.speed_mps < 0.01, "it stands");
    (worst_m, cause.expect("a stop"))
}

#[test]
fn a_stop_for_a_wrong_pose_stays_within_the_margin_of_the_lane() {
    for drift_radps in [0.08, -0.2, 0.5] {
        let (worst_m, cause) = off_line_m(drift_radps, true);
        assert_eq!(cause, StopCause::PoseImplausible);
        assert!(worst_m < 0.85, "{drift_radps}: {worst_m}");
        let (held_m, _) = off_line_m(drift_radps, false);
        assert!(held_m > worst_m, "{drift_radps}: {held_m} with the wheel held, {worst_m}");
    }
}
