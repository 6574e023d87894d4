//! MPC compared with OSQP 0.6.3 and Clarabel 0.11 on the same quadratic programs.
//!
//! OSQP gets each program in sparse form, with set-up every tick (`new`) or with new data and its last solution as
//! start (`update`), to a tolerance of 1e-4. Its solutions are first compared with Swerve's. `-- synthetic` measures
//! only calls on a slalom, `-- drives` only those of recorded drives.

use std::hint::black_box;
use std::path::Path;

use criterion::Criterion;
use osqp::{CscMatrix, Settings};
use swerve_benches::{Goal, Rows, Sample, is_asked, is_asked_to_measure, now};
use swerve_control::mpc::{Mpc, Params, Problem};
use swerve_core::Time;
use swerve_vehicle::Limits;

#[path = "../../../control_ticks.rs"]
mod control_ticks;
mod posed;
use control_ticks::{Drive, Tick, WHEELBASE_M, ticks};
use posed::{Kept, Posed};

/// Calls of the MPC in drives.
const DRIVES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/reference/mpc/drives.json");

fn mpc(horizon: usize) -> Mpc {
    Mpc::new(Params { horizon, ..Params::default() }, WHEELBASE_M, &Limits::default())
}

fn matrix(nrows: usize, columns: &[usize], rows: &[usize], values: &[f64]) -> CscMatrix<'static> {
    CscMatrix {
        nrows,
        ncols: columns.len() - 1,
        indptr: columns.to_vec().into(),
        indices: rows.to_vec().into(),
        data: values.to_vec().into(),
    }
}

fn constraints(problem: &Problem) -> CscMatrix<'static> {
    matrix(problem.b.len(), &problem.columns, &problem.rows, &problem.values)
}

fn lower(problem: &Problem) -> Vec<f64> {
    let bound = |(row, &b): (usize, &f64)| if row < problem.equalities { b } else { f64::NEG_INFINITY };
    problem.b.iter().enumerate().map(bound).collect()
}

fn new(problem: &Problem) -> osqp::Problem {
    let n = problem.q.len();
    let columns: Vec<usize> = (0..=n).collect();
    let cost = matrix(n, &columns, &columns[..n], &problem.cost);
    let settings = Settings::default().verbose(false).eps_abs(1e-4).eps_rel(1e-4).max_iter(20_000);
    osqp::Problem::new(cost, &problem.q, constraints(problem), &lower(problem), &problem.b, &settings)
        .expect("a valid problem")
}

fn update(solver: &mut osqp::Problem, problem: &Problem, constraints: CscMatrix<'_>, lower: &[f64]) {
    solver.update_lin_cost(&problem.q);
    solver.update_A(constraints);
    solver.update_bounds(lower, &problem.b);
}

/// Largest difference between the first steering angles of both solvers, radians.
fn difference(mpc: &mut Mpc, ticks: &[Tick]) -> f64 {
    let steering = 2 + 4;
    let mut worst = 0.0f64;
    for tick in ticks {
        mpc.step(Time::ZERO, &tick.start, &tick.knots);
        let mut peer = new(&mpc.problem());
        let status = peer.solve();
        let x = status.x().expect("the peer solves it");
        let ours = mpc.solution()[1].steering_rad - tick.knots[1].state.steering_rad;
        worst = worst.max((x[steering] - ours).abs());
    }
    worst
}

/// Median of criterion's estimates for a finished benchmark, microseconds.
fn median_us(group: &str, name: &str) -> Option<f64> {
    let root = std::env::var("CARGO_TARGET_DIR").unwrap_or_else(|_| "target".into());
    let file = Path::new(&root).join("criterion").join(group).join(name).join("new/estimates.json");
    let text = std::fs::read_to_string(file).ok()?;
    let (_, after) = text.split_once("\"median\":")?;
    let (_, after) = after.split_once("\"point_estimate\":")?;
    let number: String = after.chars().take_while(|c| !",}".contains(*c)).collect();
    number.trim().parse::<f64>().ok().map(|ns| ns * 1e-3)
}

fn synthetic(criterion: &mut Criterion, rows: &mut Rows) {
    for horizon in [20, 40] {
        let ticks = ticks(200, horizon);
        let mut ours = mpc(horizon);
        let worst = difference(&mut ours, &ticks);
        let what = format!("horizon {horizon}: first steering angles of both solvers differ by at most");
        rows.row(&what, worst, &format!("{worst:.1e} rad"), Goal::None);
        let problems: Vec<Problem> = ticks
            .iter()
            .map(|tick| {
                ours.step(Time::ZERO, &tick.start, &tick.knots);
                ours.problem()
            })
            .collect();
        let name = format!("mpc_{horizon}");
        let mut group = criterion.benchmark_group(&name);
        let mut k = 0;
        let mut next = || {
            k = (k + 1) % ticks.len();
            k
        };
        group.bench_function("swerve_update", |b| {
            b.iter(|| {
                let tick = &ticks[next()];
                black_box(ours.step(Time::ZERO, &tick.start, &tick.knots))
            });
        });
        group.bench_function("swerve_new", |b| {
            b.iter(|| {
                let tick = &ticks[next()];
                black_box(mpc(horizon).step(Time::ZERO, &tick.start, &tick.knots))
            });
        });
        group.bench_function("osqp_new", |b| {
            b.iter(|| black_box(new(&problems[next()]).solve().x().map(|x| x[0])));
        });
        let mut peer = new(&problems[0]);
        group.bench_function("osqp_update", |b| {
            b.iter(|| {
                let problem = &problems[next()];
                update(&mut peer, problem, constraints(problem), &lower(problem));
                black_box(peer.solve().x().map(|x| x[0]))
            });
        });
        group.finish();
        for bench in ["swerve_update", "swerve_new", "osqp_update", "osqp_new"] {
            if let Some(us) = median_us(&name, bench) {
                let goal =
                    if (bench, horizon) == ("swerve_update", 20) { Goal::Most(250.0) } else { Goal::None };
                rows.row(&format!("horizon {horizon}: {bench}, median"), us, &format!("{us:.1} us"), goal);
            }
        }
    }
}

const SOLVERS: [&str; 4] = ["swerve", "osqp, kept", "clarabel, sparse, kept", "clarabel, condensed, kept"];
const KINDS: [&str; 4] = [
    "calm drives, no bound active",
    "calm drives, a bound active",
    "emergencies, no bound active",
    "emergencies, a bound active",
];

/// Times of each solver for the calls of each kind, microseconds, in one round.
type Round = [[Vec<f64>; SOLVERS.len()]; KINDS.len()];

/// Times one call.
fn timed<T>(times_us: &mut Vec<f64>, call: impl FnOnce() -> T) -> T {
    let began = now();
    let answer = black_box(call());
    times_us.push(began.elapsed().as_secs_f64() * 1e6);
    answer
}

/// Solves all calls of a drive in order with each solver. Swerve's time includes the linearisation; the peers get
/// precomputed matrices.
fn round(drive: &Drive, into: &mut Round, apart: &mut [f64; SOLVERS.len()]) {
    let ticks = drive.ticks();
    let mut ours = mpc(20);
    let mut posed = Vec::new();
    for tick in &ticks {
        let step = ours.step(Time::ZERO, &tick.start, &tick.knots);
        let rate = (ours.solution()[1].steering_rad - ours.solution()[0].steering_rad) / 0.1;
        posed.push((
            ours.problem(),
            2 * usize::from(drive.emergency) + usize::from(step.report.iterations > 0),
            rate,
        ));
    }
    let mut peer = new(&posed[0].0);
    let mut sparse = Kept::new(&posed.iter().map(|(problem, ..)| Posed::sparse(problem)).collect::<Vec<_>>());
    let mut condensed =
        Kept::new(&posed.iter().map(|(problem, ..)| Posed::condensed(problem)).collect::<Vec<_>>());
    for (k, (tick, (problem, kind, rate))) in ticks.iter().zip(&posed).enumerate() {
        let [by_us, by_osqp, by_sparse, by_condensed] = &mut into[*kind];
        timed(by_us, || ours.step(Time::ZERO, &tick.start, &tick.knots));
        let (a, lower) = (constraints(problem), lower(problem));
        let osqp = timed(by_osqp, || {
            update(&mut peer, problem, a, &lower);
            peer.solve().x().map_or(f64::NAN, |x| x[0])
        });
        let answers =
            [osqp, timed(by_sparse, || sparse.solve(k)), timed(by_condensed, || condensed.solve(k))];
        for (apart, answer) in apart[1..].iter_mut().zip(answers) {
            // Difference of the steering angle after the first step; NaN without a solution.
            *apart = apart.max(0.1 * (answer - rate).abs());
        }
    }
}

/// Calls of recorded drives: separately for calm drives and emergencies, and with and without active bounds.
fn drives(rows: &mut Rows) {
    const ROUNDS: usize = 7;
    let drives = Drive::all(DRIVES);
    let mut apart = [0.0; SOLVERS.len()];
    let rounds: Vec<Round> = (0..ROUNDS)
        .map(|_| {
            let mut times = Round::default();
            drives.iter().for_each(|drive| round(drive, &mut times, &mut apart));
            times
        })
        .collect();
    for (name, apart) in SOLVERS.iter().zip(apart).skip(1) {
        let what =
            format!("recorded drives: steering after the first step, {name}, differs from ours by at most");
        rows.row(&what, apart, &format!("{apart:.1e} rad"), Goal::None);
    }
    for (kind, of) in KINDS.iter().enumerate() {
        let calls = rounds[0][kind][0].len();
        if calls == 0 {
            rows.skipped(of, "none recorded");
            continue;
        }
        for (solver, name) in SOLVERS.iter().enumerate() {
            let times: Vec<f64> = rounds.iter().flat_map(|round| round[kind][solver].clone()).collect();
            let times = Sample::new(times);
            let reads = format!("{}, nine tenths <= {:.1}", times.text(1, "us"), times.at(0.9));
            rows.row(&format!("{of}: {name}, {calls} calls"), times.median(), &reads, Goal::None);
        }
        let sum = |round: &Round, solver: usize| round[kind][solver].iter().sum::<f64>();
        for (solver, name) in SOLVERS.iter().enumerate().filter(|(solver, _)| *solver != 1) {
            let ratios = rounds.iter().map(|round| sum(round, solver) / sum(round, 1)).collect();
            let ratios = Sample::new(ratios);
            let goal = match (solver, kind % 2) {
                (0, 0) => Goal::Most(0.25),
                (0, _) => Goal::Most(1.0),
                _ => Goal::None,
            };
            let what = format!("{of}: all calls, {name} over osqp");
            rows.row(&what, ratios.median(), &ratios.text(3, "x"), goal);
        }
    }
}

fn main() {
    if !is_asked_to_measure() {
        return;
    }
    let mut rows = Rows::new(env!("CARGO_TARGET_TMPDIR"), "mpc");
    if is_asked("synthetic") {
        let config = Criterion::default().sample_size(30).measurement_time(std::time::Duration::from_secs(4));
        synthetic(&mut config.without_plots(), &mut rows);
    }
    if is_asked("drives") {
        drives(&mut rows);
    }
    rows.finish();
}
