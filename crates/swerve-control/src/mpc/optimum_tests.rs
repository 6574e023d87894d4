//! Comparison of the optimum with Clarabel's.

use super::stages::{STEERING, Stage, Values, left_sides};
use super::*;
use swerve_core::Rng;
use swerve_geom::Pose2;

const WHEELBASE_M: f64 = 2.85;

fn bounds(scale: f64) -> Bounds {
    Bounds {
        steering_max_rad: 0.6 * scale,
        steering_rate_max_radps: 0.7 * scale,
        accel_min_mps2: -8.0 * scale,
        accel_max_mps2: 3.0 * scale,
        jerk_max_mps3: 30.0 * scale,
        speed_max_mps: 15.0 * scale,
    }
}

/// Clarabel's settings at its highest accuracy.
fn tight() -> DefaultSettings<f64> {
    DefaultSettings {
        max_iter: 200,
        tol_gap_abs: 1e-11,
        tol_gap_rel: 1e-11,
        tol_feas: 1e-11,
        iterative_refinement_reltol: 1e-13,
        iterative_refinement_abstol: 1e-13,
        ..settings()
    }
}

/// A path that bends at random, and a start beside it; all lateral distances are multiplied by `aside`.
fn draw(rng: &mut Rng, horizon: usize, aside: f64) -> (State, Vec<Knot>) {
    let mut state = State { speed_mps: rng.uniform(2.0, 14.0), ..State::default() };
    let mut knots = Vec::new();
    for _ in 0..=horizon {
        let rates = model::Rates {
            steering_radps: rng.uniform(-0.2, 0.2),
            jerk_mps3: rng.uniform(-3.0, 3.0) - state.accel_mps2,
        };
        state = model::step(&state, rates, WHEELBASE_M, 0.1);
        // Knots are a path, which need not satisfy the model exactly.
        let pose = Pose2::new(
            state.pose.x_m + rng.uniform(-0.02, 0.02),
            state.pose.y_m + rng.uniform(-0.02, 0.02),
            state.pose.heading_rad + rng.uniform(-0.01, 0.01),
        );
        knots.push(Knot {
            state: State { pose, ..state },
            wanted_along_m: rng.uniform(-1.0, 1.0),
            wanted_speed_mps: state.speed_mps + rng.uniform(-3.0, 3.0),
            wanted_accel_mps2: rng.uniform(-2.0, 2.0),
            left_m: rng.uniform(-0.2, 1.2) + 1e3 * (1.0 - aside),
            right_m: rng.uniform(-0.2, 1.2) + 1e3 * (1.0 - aside),
        });
    }
    let z = [
        rng.uniform(-0.5, 0.5),
        rng.uniform(-1.5, 1.5),
        rng.uniform(-0.3, 0.3),
        rng.uniform(-2.0, 2.0),
        rng.uniform(-0.2, 0.2),
        rng.uniform(-3.0, 3.0),
    ];
    (model::deviated(&knots[0].state, &z), knots)
}

/// Objective of a point.
fn cost(stages: &Stages, point: impl Iterator<Item = (Values, f64)>) -> f64 {
    let step = |((x, slack_m), stage): ((Values, f64), &Stage)| {
        let squares =
            |cost: &[f64], x: &[f64]| -> f64 { cost.iter().zip(x).map(|(c, x)| 0.5 * c * x * x).sum() };
        let pulled: f64 = stage.pull.iter().zip(&x.states).map(|(pull, x)| pull * x).sum();
        let slack = stages.slack * slack_m + 0.5 * stages.slack_squared * slack_m * slack_m;
        squares(&stage.cost.inputs, &x.inputs) + squares(&stage.cost.states, &x.states) + pulled + slack
    };
    point.zip(&stages.steps).map(step).sum()
}

/// Largest difference between the two solutions, including their slacks.
fn difference(optimum: &Optimum, peer: &Program) -> f64 {
    let mut worst = 0.0f64;
    for ((ours, slack_m), (theirs, peer_slack_m)) in optimum.solution().zip(peer.solution()) {
        worst = ours.inputs.iter().zip(&theirs.inputs).fold(worst, |worst, (a, b)| worst.max((a - b).abs()));
        worst = ours.states.iter().zip(&theirs.states).fold(worst, |worst, (a, b)| worst.max((a - b).abs()));
        worst = worst.max((slack_m - peer_slack_m).abs());
    }
    worst
}

#[test]
fn optimum_without_active_bounds_equals_clarabel() {
    let mut rng = Rng::keyed(1, "unbounded", &[]);
    for horizon in [1, 5, 20, 40] {
        let mut stages = Stages::new(horizon, 0.1, WHEELBASE_M, &Weights::default(), &bounds(1e3));
        let (mut optimum, mut peer) = (Optimum::new(horizon), Program::new(&stages, tight()));
        for case in 0..20 {
            let (start, knots) = draw(&mut rng, horizon, 0.0);
            stages.fill(&start, &knots);
            assert!(optimum.unbounded(&stages), "N = {horizon}, case {case}");
            let (status, _) = peer.solve(&stages);
            assert_eq!(status, SolverStatus::Solved, "N = {horizon}, case {case}");
            let off = difference(&optimum, &peer);
            assert!(off < 1e-6, "N = {horizon}, case {case}: {off}");
        }
    }
}

#[test]
fn bounds_are_checked_exactly() {
    let mut rng = Rng::keyed(2, "checked", &[]);
    let mut stages = Stages::new(20, 0.1, WHEELBASE_M, &Weights::default(), &bounds(1e3));
    let mut optimum = Optimum::new(20);
    let (start, knots) = draw(&mut rng, 20, 0.0);
    stages.fill(&start, &knots);
    assert!(optimum.unbounded(&stages));
    let at_optimum: Vec<_> = optimum.solution().map(|(values, _)| left_sides(&values, 0.0)).collect();
    for (k, left) in at_optimum.iter().enumerate() {
        // The last inequality is that of the slack, which is 0.
        for (i, &left) in left[..11].iter().enumerate() {
            let limit = std::mem::replace(&mut stages.steps[k].limits[i], left);
            assert!(optimum.unbounded(&stages), "step {k}, bound {i}: met with equality");
            stages.steps[k].limits[i] = left.next_down();
            assert!(!optimum.unbounded(&stages), "step {k}, bound {i}: broken by the last bit");
            stages.steps[k].limits[i] = limit;
        }
    }
}

#[test]
fn optimum_with_active_bounds_equals_clarabel() {
    let mut rng = Rng::keyed(3, "bounded", &[]);
    for horizon in [1, 5, 20, 40] {
        let mut stages = Stages::new(horizon, 0.1, WHEELBASE_M, &Weights::default(), &bounds(1.0));
        let (mut optimum, mut peer) = (Optimum::new(horizon), Program::new(&stages, tight()));
        let (mut active, mut most) = (0, 0);
        for case in 0..60 {
            let (start, knots) = draw(&mut rng, horizon, 1.0);
            stages.fill(&start, &knots);
            if optimum.unbounded(&stages) {
                continue;
            }
            active += 1;
            let iterations = optimum.bounded(&stages);
            assert!(iterations.is_some(), "N = {horizon}, case {case}");
            most = most.max(iterations.unwrap());
            let (status, _) = peer.solve(&stages);
            assert!(matches!(status, SolverStatus::Solved | SolverStatus::AlmostSolved), "{status:?}");
            for ((ours, slack_m), stage) in optimum.solution().zip(&stages.steps) {
                let met = left_sides(&ours, slack_m).iter().zip(&stage.limits).all(|(a, b)| *a <= b + 1e-7);
                assert!(met, "N = {horizon}, case {case}");
            }
            // Within the bounds and no more expensive: the unique optimum.
            let (ours, theirs) = (cost(&stages, optimum.solution()), cost(&stages, peer.solution()));
            assert!(
                ours < theirs + 1e-6 * (1.0 + theirs.abs()),
                "N = {horizon}, case {case}: {ours} {theirs}"
            );
            for ((ours, _), (theirs, _)) in optimum.solution().zip(peer.solution()) {
                let off = (ours.states[STEERING] - theirs.states[STEERING]).abs();
                assert!(off < 1e-5, "N = {horizon}, case {case}: {off} rad");
            }
        }
        eprintln!("N = {horizon}: {active} of 60 with active bounds, at most {most} iterations");
        assert!(active >= 30, "{active}");
    }
}

#[test]
fn clarabel_takes_over_without_convergence() {
    let knots: Vec<Knot> = (0..=20).map(|k| Knot::straight(f64::from(k), 10.0)).collect();
    // Outside the corridor of 1 m.
    let start = State { pose: Pose2::new(0.0, 1.6, 0.0), speed_mps: 9.0, ..State::default() };
    let mut mpc = Mpc::new(Params::default(), WHEELBASE_M, &Limits::default());
    let first = mpc.step(Time::ZERO, &start, &knots);
    mpc.optimum.limit_iterations(2);
    let second = mpc.step(Time::ZERO, &start, &knots);
    assert_eq!((first.report.ending, second.report.ending), (Ending::Solved, Ending::Solved));
    assert!((first.steering_rad - second.steering_rad).abs() < 1e-4);
    assert!((first.accel_mps2 - second.accel_mps2).abs() < 1e-3);
    assert!((first.report.slack_max_m - second.report.slack_max_m).abs() < 1e-4);
}

/// Calls of a recorded drive, as written by `cargo bench -p swerve-benches --bench control -- record`.
#[derive(Deserialize)]
struct Drive {
    name: String,
    emergency: bool,
    calls: Vec<Call>,
}

#[derive(Deserialize)]
struct Call {
    start: [f64; 6],
    knots: Vec<[f64; 10]>,
}

fn state([x_m, y_m, heading_rad, speed_mps, steering_rad, accel_mps2]: [f64; 6]) -> State {
    State { pose: Pose2::new(x_m, y_m, heading_rad), speed_mps, steering_rad, accel_mps2 }
}

fn knot([x, y, heading, speed, steering, along, wanted, accel, left_m, right_m]: [f64; 10]) -> Knot {
    Knot {
        state: state([x, y, heading, speed, steering, 0.0]),
        wanted_along_m: along,
        wanted_speed_mps: wanted,
        wanted_accel_mps2: accel,
        left_m,
        right_m,
    }
}

/// Largest differences of commands: (steering, radians; acceleration, m/s²).
fn commands_apart(
    settings: DefaultSettings<f64>,
    drives: &[Drive],
    mut count: impl FnMut(&Drive, u32),
) -> (f64, f64) {
    let (mut steering_rad, mut accel_mps2) = (0.0f64, 0.0f64);
    for drive in drives {
        let mut mpc = Mpc::new(Params::default(), WHEELBASE_M, &Limits::default());
        let mut peer = Program::new(&mpc.stages, settings.clone());
        for call in &drive.calls {
            let (start, knots) =
                (state(call.start), call.knots.iter().copied().map(knot).collect::<Vec<_>>());
            let ours = mpc.step(Time::ZERO, &start, &knots);
            count(drive, ours.report.iterations);
            let (status, _) = peer.solve(&mpc.stages);
            assert!(matches!(status, SolverStatus::Solved | SolverStatus::AlmostSolved), "{status:?}");
            mpc.optimum.adopt(peer.solution());
            mpc.keep(Time::ZERO, &start, &knots);
            let theirs = mpc.command(Time::ZERO, ours.report);
            steering_rad = steering_rad.max((ours.steering_rad - theirs.steering_rad).abs());
            accel_mps2 = accel_mps2.max((ours.accel_mps2 - theirs.accel_mps2).abs());
        }
    }
    (steering_rad, accel_mps2)
}

#[test]
fn commands_in_recorded_drives_equal_clarabels() {
    let text = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/reference/mpc/drives.json"));
    let drives: Vec<Drive> = serde_json::from_str(text).unwrap();
    // Calls with and without an active bound, in calm drives and in emergencies.
    let mut calls = [[0; 2]; 2];
    let count = |drive: &Drive, iterations: u32| {
        assert!(iterations < 25, "{}: {iterations} iterations, so near the most", drive.name);
        calls[usize::from(drive.emergency)][usize::from(iterations > 0)] += 1;
    };
    let exact = commands_apart(tight(), &drives, count);
    let loose = commands_apart(settings(), &drives, |_, _| ());
    eprintln!("calls {calls:?}; off tight tolerances {exact:?}, off the controller's {loose:?}");
    assert!(exact.0 < 1e-6 && exact.1 < 1e-5, "{exact:?}");
    assert!(loose.0 < 1e-4 && loose.1 < 1e-2, "{loose:?}");
    assert!(calls[0][0] > 9 * calls[0][1], "most calls of calm drives have no active bound: {calls:?}");
    assert!(calls[1][1] > 0, "{calls:?}");
}
