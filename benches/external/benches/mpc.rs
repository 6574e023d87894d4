//! The predictive controller beside OSQP 0.6.3 on the same quadratic programs.
//!
//! OSQP gets each program as Clarabel does, with its set-up every tick (`new`) or with new data and its last
//! solution as start (`update`), to a tolerance of 1e-4. Its solutions are compared with ours first.

use std::hint::black_box;
use std::path::Path;

use criterion::{Criterion, criterion_group, criterion_main};
use osqp::{CscMatrix, Settings};
use swerve_benches::{Goal, Rows};
use swerve_control::mpc::{Mpc, Params, Problem};
use swerve_core::Time;
use swerve_vehicle::Limits;

#[path = "../../control_ticks.rs"]
mod control_ticks;
use control_ticks::{Tick, WHEELBASE_M, ticks};

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

fn update(solver: &mut osqp::Problem, problem: &Problem) {
    solver.update_lin_cost(&problem.q);
    solver.update_A(constraints(problem));
    solver.update_bounds(&lower(problem), &problem.b);
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

/// Median of criterion's estimate for a finished bench, microseconds.
fn median_us(group: &str, name: &str) -> Option<f64> {
    let root = std::env::var("CARGO_TARGET_DIR").unwrap_or_else(|_| "target".into());
    let file = Path::new(&root).join("criterion").join(group).join(name).join("new/estimates.json");
    let text = std::fs::read_to_string(file).ok()?;
    let (_, after) = text.split_once("\"median\":")?;
    let (_, after) = after.split_once("\"point_estimate\":")?;
    let number: String = after.chars().take_while(|c| !",}".contains(*c)).collect();
    number.trim().parse::<f64>().ok().map(|ns| ns * 1e-3)
}

fn bench(criterion: &mut Criterion) {
    let mut rows = Rows::new(env!("CARGO_TARGET_TMPDIR"), "mpc");
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
                update(&mut peer, &problems[next()]);
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
    rows.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(30).measurement_time(std::time::Duration::from_secs(4));
    targets = bench
}
criterion_main!(benches);
