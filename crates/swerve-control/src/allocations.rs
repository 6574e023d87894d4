//! Counts the allocations of a control step.

use crate::{Controller as _, Following, Input, Law, LawController, LinearPedals, Params, mpc};
use swerve_core::{Span, Time};
use swerve_geom::{Point2, Polyline, Pose2};
use swerve_msg::{EgoState, Plan, PlanPoint, Route};
use swerve_vehicle::{Limits, Shape};

fn plan() -> Plan {
    let points = (0..200)
        .map(|k| PlanPoint {
            at: Time::from_ms(50 * k),
            pose: Pose2::new(0.5 * k as f64, 0.0, 0.0),
            speed_mps: 10.0,
            ..Default::default()
        })
        .collect();
    Plan { points, ..Default::default() }
}

/// Largest number of allocations of one step `aside_m` off the plan, after a few steps that fill the buffers.
fn worst(law: Law, horizon: usize, aside_m: f64) -> u64 {
    let params = Params {
        law,
        following: Following::Time,
        mpc: mpc::Params { horizon, ..Default::default() },
        ..Default::default()
    };
    let drive = Box::new(LinearPedals { accel_max_mps2: 3.0, brake_max_mps2: 8.0 });
    let mut controller = LawController::new(params, Shape::default(), Limits::default(), drive);
    let line = Polyline::new(&[Point2::new(-10.0, 0.0), Point2::new(500.0, 0.0)]).expect("two points");
    let (plan, route) = (plan(), Route::uniform(line, 6.0, 2.0));
    let mut worst = 0;
    for k in 0..20 {
        let now = Time::ZERO + Span::from_ms(10 * k);
        let pose = Pose2::new(0.1 * k as f64, aside_m - 0.01 * k as f64, 0.0);
        let ego = EgoState { stamp: now, pose, speed_mps: 9.8, ..Default::default() };
        let stepped = allocation_counter::measure(|| {
            let output = controller.step(&Input { now, ego: &ego, plan: Some(&plan), route: &route });
            assert!(output.mpc.is_none_or(|report| report.source == mpc::Source::Solution));
        });
        if k >= 5 {
            worst = worst.max(stepped.count_total);
        }
    }
    worst
}

#[test]
fn steps_do_not_allocate() {
    for law in [Law::Pid, Law::PurePursuit, Law::Stanley] {
        assert_eq!(worst(law, 20, 0.3), 0, "{law:?}");
    }
    // Beyond 1.2 m the corridor of the predictive law is an active bound.
    for (horizon, aside_m) in [(20, 0.3), (40, 0.3), (20, 2.0), (40, 2.0)] {
        assert_eq!(worst(Law::Mpc, horizon, aside_m), 0, "horizon {horizon}, {aside_m} m aside");
    }
}
