use super::*;
use crate::bicycle::{self, DRIVE, WHEELBASE_M, curve, ego, lane_change, road, slalom};
use crate::{AccelToPedals, Controller as _, Following, Input, Law, LawController};
use swerve_core::Rng;
use swerve_geom::{Polyline, Pose2};
use swerve_msg::{EgoState, Plan, Route};
use swerve_vehicle::Shape;

fn mpc(params: Params) -> Mpc {
    Mpc::new(params, WHEELBASE_M, &Limits::default())
}

/// A straight path along x at 10 m/s.
fn straight(horizon: usize) -> Vec<Knot> {
    (0..=horizon).map(|k| Knot::straight(k as f64, 10.0)).collect()
}

fn at(y_m: f64, speed_mps: f64) -> State {
    State { pose: Pose2::new(0.0, y_m, 0.0), speed_mps, ..State::default() }
}

#[derive(Deserialize)]
struct Reference {
    dt_s: f64,
    wheelbase_m: f64,
    weights: Weights,
    bounds: ReferenceBounds,
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct ReferenceBounds {
    steering: f64,
    steering_rate: f64,
    accel_min: f64,
    accel_max: f64,
    jerk: f64,
    speed: f64,
}

#[derive(Deserialize)]
struct Case {
    name: String,
    start: FlatState,
    knots: Vec<FlatKnot>,
    solution: Solution,
}

#[derive(Deserialize, Clone, Copy)]
struct FlatState {
    x_m: f64,
    y_m: f64,
    heading_rad: f64,
    speed_mps: f64,
    steering_rad: f64,
    accel_mps2: f64,
}

#[derive(Deserialize)]
struct FlatKnot {
    #[serde(flatten)]
    state: FlatState,
    wanted_along_m: f64,
    wanted_speed_mps: f64,
    wanted_accel_mps2: f64,
    left_m: f64,
    right_m: f64,
}

#[derive(Deserialize)]
struct Solution {
    states: Vec<[f64; 6]>,
    slack_m: Vec<f64>,
}

impl From<FlatState> for State {
    fn from(flat: FlatState) -> Self {
        Self {
            pose: Pose2::new(flat.x_m, flat.y_m, flat.heading_rad),
            speed_mps: flat.speed_mps,
            steering_rad: flat.steering_rad,
            accel_mps2: flat.accel_mps2,
        }
    }
}

/// The stored solutions come from another formulation (absolute states in the map, numerical derivatives) and another
/// solver: see `tests/reference/mpc/make.py`.
#[test]
fn mpc_solves_the_stored_problems_like_osqp() {
    let text = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/reference/mpc/problems.json"));
    let reference: Reference = serde_json::from_str(text).unwrap();
    let bounds = &reference.bounds;
    let limits = Limits {
        steering_max_rad: bounds.steering,
        steering_rate_max_radps: bounds.steering_rate,
        accel_max_mps2: bounds.accel_max,
        brake_max_mps2: -bounds.accel_min,
        ..Limits::default()
    };
    assert_eq!(reference.cases.len(), 4);
    for case in reference.cases {
        let params = Params {
            horizon: case.knots.len() - 1,
            dt_s: reference.dt_s,
            weights: reference.weights,
            jerk_max_mps3: bounds.jerk,
            speed_max_mps: bounds.speed,
            ..Params::default()
        };
        let knots: Vec<Knot> = case
            .knots
            .iter()
            .map(|knot| Knot {
                state: knot.state.into(),
                wanted_along_m: knot.wanted_along_m,
                wanted_speed_mps: knot.wanted_speed_mps,
                wanted_accel_mps2: knot.wanted_accel_mps2,
                left_m: knot.left_m,
                right_m: knot.right_m,
            })
            .collect();
        let mut mpc = Mpc::new(params, reference.wheelbase_m, &limits);
        let step = mpc.step(Time::ZERO, &case.start.into(), &knots);
        assert_eq!(step.report.ending, Ending::Solved, "{}", case.name);
        for (ours, want) in mpc.solution()[1..].iter().zip(&case.solution.states) {
            let State { pose, speed_mps, steering_rad, accel_mps2 } = *ours;
            let ours = [pose.x_m, pose.y_m, pose.heading_rad, speed_mps, steering_rad, accel_mps2];
            for (a, b) in ours.iter().zip(want) {
                assert!((a - b).abs() < 2e-4, "{}: {ours:?} against {want:?}", case.name);
            }
        }
        let slack = case.solution.slack_m.iter().copied().fold(0.0, f64::max);
        assert!((step.report.slack_max_m - slack).abs() < 1e-4, "{}", case.name);
    }
}

#[test]
fn start_outside_the_bounds_stays_feasible() {
    let params = Params { speed_max_mps: 8.0, ..Params::default() };
    let mut mpc = mpc(params);
    let knots = straight(20);
    let mut rng = Rng::keyed(1, "starts", &[]);
    for k in 0..150 {
        let start = State {
            pose: Pose2::new(rng.uniform(-3.0, 3.0), rng.uniform(-3.0, 3.0), rng.uniform(-0.6, 0.6)),
            speed_mps: rng.uniform(-1.0, 30.0),
            steering_rad: rng.uniform(-0.9, 0.9),
            accel_mps2: rng.uniform(-12.0, 6.0),
        };
        let step = mpc.step(Time::from_ms(k), &start, &knots);
        assert!(
            matches!(step.report.ending, Ending::Solved | Ending::AlmostSolved),
            "{start:?}: {:?}",
            step.report
        );
    }
    // Far above the bound it brakes as hard as jerk and acceleration allow.
    mpc.step(Time::ZERO, &at(0.0, 25.0), &knots);
    assert!(mpc.solution()[4].accel_mps2 < -7.9, "{:?}", mpc.solution()[4]);
}

#[test]
fn solutions_stay_within_the_bounds() {
    let limits = Limits::default();
    let mut mpc = mpc(Params { speed_max_mps: 10.5, ..Params::default() });
    let knots: Vec<Knot> =
        (0..=20).map(|k| Knot { wanted_speed_mps: 20.0, ..Knot::straight(f64::from(k), 10.0) }).collect();
    let step = mpc.step(Time::ZERO, &at(3.0, 10.0), &knots);
    assert_eq!(step.report.ending, Ending::Solved);
    let eps = 1e-4;
    for pair in mpc.solution().windows(2) {
        let rate = (pair[1].steering_rad - pair[0].steering_rad) / 0.1;
        let jerk = (pair[1].accel_mps2 - pair[0].accel_mps2) / 0.1;
        assert!(rate.abs() <= limits.steering_rate_max_radps + eps && jerk.abs() <= 30.0 + eps);
        assert!(pair[1].steering_rad.abs() <= limits.steering_max_rad + eps);
        assert!((-8.0 - eps..=3.0 + eps).contains(&pair[1].accel_mps2) && pair[1].speed_mps <= 10.5 + eps);
    }
    assert!(mpc.solution()[20].speed_mps > 10.4, "and the bound is used");
}

#[test]
fn an_impossible_corridor_is_left_as_little_as_possible() {
    let mut mpc = mpc(Params::default());
    let knots: Vec<Knot> =
        straight(20).into_iter().map(|k| Knot { left_m: -0.5, right_m: -0.5, ..k }).collect();
    let step = mpc.step(Time::ZERO, &at(0.0, 10.0), &knots);
    assert_eq!(step.report.ending, Ending::Solved);
    assert!((step.report.slack_max_m - 0.5).abs() < 1e-3, "{:?}", step.report);
    assert!(mpc.solution().iter().all(|s| s.pose.y_m.abs() < 1e-3));
}

#[test]
fn a_corridor_that_can_be_kept_is_kept() {
    let mut mpc = mpc(Params::default());
    let free = Knot { left_m: 0.3, ..Knot::straight(0.0, 10.0) };
    let knots: Vec<Knot> = (0..=20)
        .map(|k| {
            let right_m = if k > 10 { -0.25 } else { 1.0 };
            Knot { right_m, state: Knot::straight(f64::from(k), 10.0).state, ..free }
        })
        .collect();
    let step = mpc.step(Time::ZERO, &at(0.0, 10.0), &knots);
    assert!(step.report.slack_max_m < 1e-4, "{:?}", step.report);
    assert!(mpc.solution()[11..].iter().all(|s| s.pose.y_m > 0.249 && s.pose.y_m < 0.301));
}

#[test]
fn numbers_that_are_not_finite_never_reach_the_solver() {
    let mut mpc = mpc(Params::default());
    let good = straight(20);
    let refuse = |mpc: &mut Mpc, start: &State, knots: &[Knot]| {
        let step = mpc.step(Time::ZERO, start, knots);
        assert_eq!((step.report.ending, step.report.iterations), (Ending::Refused, 0));
        step
    };
    let step = refuse(&mut mpc, &at(f64::NAN, 10.0), &good);
    assert_eq!((step.report.source, step.accel_mps2, step.steering_rad), (Source::Brake, -5.0, 0.0));
    refuse(&mut mpc, &at(0.0, f64::INFINITY), &good);
    let mut knots = good.clone();
    knots[7].left_m = f64::NAN;
    refuse(&mut mpc, &at(0.0, 10.0), &knots);
    refuse(&mut mpc, &at(0.0, 10.0), &good[..20]);
    refuse(&mut mpc, &at(0.0, 10.0), &[]);
    let step = mpc.step(Time::ZERO, &at(0.0, 10.0), &good);
    assert_eq!(step.report.source, Source::Solution, "and the next good input is solved");
}

#[test]
fn failed_solve_continues_with_the_last_solution_and_then_brakes() {
    let mut mpc = mpc(Params { lead_s: 0.1, ..Params::default() });
    // Outside the corridor: a bound is active, and the solver iterates.
    let knots = straight(20);
    let first = mpc.step(Time::from_ms(1000), &at(1.6, 9.0), &knots);
    assert_eq!(first.report.source, Source::Solution);
    let planned = mpc.solution().to_vec();
    mpc.optimum.limit_iterations(1);
    mpc.program.limit_iterations(1);
    for (ms, k) in [(1100, 2), (1300, 4), (1500, 6)] {
        let step = mpc.step(Time::from_ms(ms), &at(1.6, 9.0), &knots);
        assert_eq!((step.report.source, step.report.ending), (Source::Shifted, Ending::Stalled));
        let State { steering_rad, accel_mps2, .. } = planned[k];
        assert!(
            (step.steering_rad - steering_rad).abs() < 1e-9 && (step.accel_mps2 - accel_mps2).abs() < 1e-9
        );
    }
    let held = planned[6].steering_rad;
    let step = mpc.step(Time::from_ms(1501), &at(1.6, 9.0), &knots);
    assert_eq!((step.report.source, step.accel_mps2), (Source::Brake, -5.0));
    assert!((step.steering_rad - held).abs() < 1e-9, "the wheels stay where they were");
    mpc.optimum.limit_iterations(30);
    mpc.program.limit_iterations(50);
    assert_eq!(mpc.step(Time::from_ms(1510), &at(1.6, 9.0), &knots).report.source, Source::Solution);
}

#[test]
fn a_solution_depends_on_its_problem_alone() {
    let knots = straight(20);
    let mut fresh = mpc(Params::default());
    let mut used = mpc(Params::default());
    for k in 0..5 {
        used.step(Time::from_ms(k), &at(0.3 * k as f64, 14.0), &knots);
    }
    let a = fresh.step(Time::from_ms(10), &at(0.7, 9.0), &knots);
    let b = used.step(Time::from_ms(10), &at(0.7, 9.0), &knots);
    assert_eq!(a, b);
    assert_eq!(fresh.solution(), used.solution());
    assert_eq!(fresh.problem(), used.problem());
}

#[test]
fn predictions_match_the_model() {
    let mut mpc = mpc(Params::default());
    mpc.step(Time::ZERO, &at(0.5, 10.0), &straight(20));
    let solution = mpc.solution();
    let mut state = solution[0];
    for next in &solution[1..] {
        let rates = model::Rates {
            steering_radps: (next.steering_rad - state.steering_rad) / 0.1,
            jerk_mps3: (next.accel_mps2 - state.accel_mps2) / 0.1,
        };
        state = model::step(&state, rates, WHEELBASE_M, 0.1);
    }
    let off = state.pose.point().distance(solution[20].pose.point());
    assert!(off < 0.05, "{off} m after 2 s");
}

#[test]
fn mpc_is_send() {
    fn sendable<T: Send>() {}
    sendable::<Mpc>();
    sendable::<LawController>();
}

/// Drives `plan` in a closed loop of one call per 100 ms, as in the reference measurements; returns the largest
/// distance from its path, metres.
fn drive(mpc_params: Params, limits: Limits, plan: &Plan, seconds: f64) -> f64 {
    let params = crate::Params {
        law: Law::Mpc,
        following: Following::Time,
        slip: crate::SlipParams::NONE,
        // The bicycle has no lag.
        mpc: Params { lead_s: mpc_params.dt_s, ..mpc_params },
        ..crate::Params::default()
    };
    let pedals: Box<dyn AccelToPedals> = Box::new(DRIVE);
    let mut controller = LawController::new(params, Shape::default(), limits, pedals);
    let route = Route::uniform(road().line().clone(), 9.0, 9.0);
    let points: Vec<_> = plan.points.iter().map(|p| p.pose.point()).collect();
    let line = Polyline::smooth(&points, 0.05).unwrap();
    let mut state: EgoState = ego(plan.points[0].pose, plan.points[0].speed_mps);
    let speed_mps = plan.points[0].speed_mps;
    let mut worst = 0.0f64;
    while state.stamp.as_secs() < seconds {
        let output =
            controller.step(&Input { now: state.stamp, ego: &state, plan: Some(plan), route: &route });
        assert_eq!(output.mpc.unwrap().source, Source::Solution);
        for _ in 0..10 {
            bicycle::drive(&mut state, output.command, Span::from_ms(10));
            worst = worst.max(
                line.project_near(state.pose.point(), speed_mps * state.stamp.as_secs(), 30.0).d_m.abs(),
            );
        }
    }
    worst
}

/// Reference controllers on the same curve, speed, limits and weights: 0.037 to 0.056 m.
#[test]
fn mpc_tracks_the_slalom_with_the_limits_and_weights_of_pylot() {
    let limits = Limits {
        steering_max_rad: 37.5f64.to_radians(),
        steering_rate_max_radps: 22.5f64.to_radians(),
        brake_max_mps2: 5.0,
        accel_max_mps2: 3.0,
        ..Limits::default()
    };
    let plan = curve(slalom, 10.0, 10.0);
    for horizon in [5, 20, 40] {
        let params = Params { horizon, weights: Weights::pylot(), speed_max_mps: 20.0, ..Params::default() };
        let worst = drive(params, limits, &plan, 6.5);
        eprintln!("pylot's weights, N = {horizon}: {worst:.4} m");
        assert!(worst < 0.06, "N = {horizon}: {worst}");
    }
}

#[test]
fn mpc_tracks_slalom_and_lane_change_with_our_weights() {
    for horizon in [20, 40] {
        let params = Params { horizon, ..Params::default() };
        let worst = drive(params, Limits::default(), &curve(slalom, 10.0, 10.0), 6.5);
        eprintln!("N = {horizon}: slalom {worst:.4} m");
        assert!(worst < 0.05, "slalom, N = {horizon}: {worst}");
        let params = Params { horizon, ..Params::default() };
        let worst = drive(params, Limits::default(), &curve(lane_change, 20.0, 10.0), 5.5);
        eprintln!("N = {horizon}: lane change {worst:.4} m");
        assert!(worst < 0.05, "lane change, N = {horizon}: {worst}");
    }
}
