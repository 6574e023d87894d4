//! Controllers: one quadratic program of the MPC, and one step of every control law.

use std::hint::black_box;
use std::path::Path;

use criterion::{BatchSize, Criterion, criterion_group};
use swerve_benches::{Goal, Rows, Sample, is_asked_to_measure, now};
use swerve_control::mpc::{self, Mpc};
use swerve_control::{Controller as _, Following, Input, Law, LawController, LinearPedals, Params};
use swerve_core::{Span, Time};
use swerve_geom::{Point2, Polyline, Pose2, math};
use swerve_msg::{EgoState, Plan, PlanPoint, Route};
use swerve_vehicle::{Limits, Shape};

mod control_record;
mod control_ticks;
use control_ticks::{Drive, WHEELBASE_M, ticks};

/// Calls of the MPC in drives, as written by `-- record`.
const DRIVES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../tests/reference/mpc/drives.json");

fn solver(horizon: usize) -> Mpc {
    Mpc::new(mpc::Params { horizon, ..Default::default() }, WHEELBASE_M, &Limits::default())
}

/// MPC alone: with new data in a reused solver, and with a new solver every time.
fn programs(criterion: &mut Criterion) {
    for horizon in [20, 40] {
        let ticks = ticks(200, horizon);
        let mut group = criterion.benchmark_group(format!("control/mpc_{horizon}"));
        let mut kept = solver(horizon);
        let mut k = 0;
        group.bench_function("update", |b| {
            b.iter(|| {
                k = (k + 1) % ticks.len();
                black_box(kept.step(Time::ZERO, &ticks[k].start, &ticks[k].knots))
            });
        });
        group.bench_function("new", |b| {
            b.iter(|| {
                k = (k + 1) % ticks.len();
                black_box(solver(horizon).step(Time::ZERO, &ticks[k].start, &ticks[k].knots))
            });
        });
        group.finish();
    }
}

/// A plan of 5 s along y = 2 sin(x / 12) at 10 m/s, a point every 50 ms.
fn plan() -> Plan {
    let points = (0..=100)
        .map(|k| {
            let x_m = 0.5 * f64::from(k) / 1.0138;
            let (sin, cos) = math::sin_cos(x_m / 12.0);
            PlanPoint {
                at: Time::from_ms(50 * i64::from(k)),
                pose: Pose2::new(x_m, 2.0 * sin, math::atan(cos / 6.0)),
                curvature_1pm: -sin / 72.0,
                speed_mps: 10.0,
                accel_mps2: 0.0,
            }
        })
        .collect();
    Plan { points, ..Plan::default() }
}

/// One step of each law including reference, projection and pedals.
fn laws(criterion: &mut Criterion) {
    let plan = plan();
    let line = Polyline::new(&[Point2::new(-50.0, 0.0), Point2::new(400.0, 0.0)]).expect("two points");
    let route = Route::uniform(line, 6.0, 6.0);
    let mut group = criterion.benchmark_group("control/step");
    for (name, law) in [
        ("pid", Law::Pid),
        ("pure_pursuit", Law::PurePursuit),
        ("stanley", Law::Stanley),
        ("mpc_20", Law::Mpc),
    ] {
        let params = Params { law, following: Following::Time, ..Params::default() };
        let drive = Box::new(LinearPedals { accel_max_mps2: 3.0, brake_max_mps2: 8.0 });
        let mut controller = LawController::new(params, Shape::default(), Limits::default(), drive);
        let mut tick = 0;
        group.bench_function(name, |b| {
            b.iter_batched(
                || {
                    tick = (tick + 1) % 200;
                    let now = Time::ZERO + Span::from_ms(10 * tick);
                    let here = plan.at(now).expect("the plan has points");
                    let pose = Pose2::new(here.pose.x_m - 0.2, here.pose.y_m + 0.1, here.pose.heading_rad);
                    EgoState { stamp: now, pose, speed_mps: 9.8, ..EgoState::default() }
                },
                |ego| {
                    let input = Input { now: ego.stamp, ego: &ego, plan: Some(&plan), route: &route };
                    black_box(controller.step(&input))
                },
                BatchSize::SmallInput,
            );
        });
    }
    group.finish();
}

/// Times of the calls of recorded drives, each the fastest of some repetitions: separately for calm drives and
/// emergencies, and for calls with and without active bounds.
fn drives(rows: &mut Rows) {
    const REPETITIONS: usize = 20;
    let mut mpc = solver(20);
    for emergency in [false, true] {
        let mut times_us: [Vec<f64>; 2] = Default::default();
        for drive in Drive::all(DRIVES).iter().filter(|drive| drive.emergency == emergency) {
            for tick in drive.ticks() {
                let (mut fastest_us, mut iterations) = (f64::INFINITY, 0);
                for _ in 0..REPETITIONS {
                    let began = now();
                    let step = black_box(mpc.step(Time::ZERO, &tick.start, &tick.knots));
                    fastest_us = fastest_us.min(began.elapsed().as_secs_f64() * 1e6);
                    iterations = step.report.iterations;
                }
                times_us[usize::from(iterations > 0)].push(fastest_us);
            }
        }
        for (times_us, bounds) in times_us.into_iter().zip(["no bound active", "a bound active"]) {
            let kind = if emergency { "emergencies" } else { "calm drives" };
            let what = format!("{kind}, {bounds}: a call at N = 20, {} calls", times_us.len());
            if times_us.is_empty() {
                rows.skipped(&what, "none recorded");
                continue;
            }
            let times_us = Sample::new(times_us);
            rows.row(&what, times_us.median(), &times_us.text(1, "us"), Goal::None);
        }
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(40).measurement_time(std::time::Duration::from_secs(3));
    targets = programs, laws
}

/// Median of criterion's estimates for a benchmark, milliseconds.
fn median_ms(group: &str, name: &str) -> Option<f64> {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("../criterion").join(group.replace('/', "_"));
    let text = std::fs::read_to_string(folder.join(name).join("new/estimates.json")).ok()?;
    let estimates: serde_json::Value = serde_json::from_str(&text).ok()?;
    Some(estimates["median"]["point_estimate"].as_f64()? * 1e-6)
}

fn main() -> anyhow::Result<()> {
    if std::env::args().any(|argument| argument == "record") {
        return control_record::write();
    }
    benches();
    Criterion::default().configure_from_args().final_summary();
    if !is_asked_to_measure() {
        return Ok(());
    }
    let mut rows = Rows::new(env!("CARGO_TARGET_TMPDIR"), "control");
    for (group, name, goal) in [
        ("control/mpc_20", "update", Goal::Most(0.25)),
        ("control/mpc_40", "update", Goal::None),
        ("control/step", "pid", Goal::None),
        ("control/step", "stanley", Goal::None),
        ("control/step", "mpc_20", Goal::None),
    ] {
        let what = format!("{group} {name}, median");
        match median_ms(group, name) {
            Some(ms) => rows.row(&what, ms, &format!("{ms:.4} ms"), goal),
            None => rows.skipped(&what, "not measured"),
        }
    }
    drives(&mut rows);
    rows.finish();
    Ok(())
}
