//! Solves and times posed problems.

use std::time::Instant;

use swerve_planning::Unlimited;
use swerve_pylot::Preset;
use swerve_pylot::posed::road::RoadProblem;
use swerve_pylot::posed::{FotProblem, ProblemFile, Solution, fot, hybrid_astar, rrt_star};

use super::read::{Named, Posed};

/// Repetitions of each problem. The fastest call counts, because the host's cores are shared.
pub const REPEATS: usize = 3;

/// Solves all problems of a planner, in file order.
///
/// The time is that of one planning call in a run: for RRT* and Hybrid A*, the search up to the finished path in a
/// solver that keeps its memory; for FOT, the whole call including everything it builds; for another planner, its
/// first call. Computing length, curvature and clearance of the result is timed for FOT only.
pub fn solve_all(file: &ProblemFile, posed: &Posed<'_>, preset: Preset) -> Vec<Solution> {
    let problems = &file.problems;
    match posed {
        Posed::Fot(config) => {
            problems.fot.iter().map(|p| timed(|| fot::solve(p, config, preset), |s| s)).collect()
        }
        Posed::RrtStar(config) => {
            let mut solver = rrt_star::Solver::default();
            let solve = |p| {
                let search = || solver.search(p, config, preset, &mut Unlimited::default());
                timed(search, |_| rrt_star::solve(p, config, preset, &mut Unlimited::default()))
            };
            problems.rrt_star.iter().map(solve).collect()
        }
        Posed::HybridAstar(config) => {
            let mut solver = hybrid_astar::Solver::default();
            let solve = |p| {
                let search = || solver.search(p, config, preset, &mut Unlimited::default());
                timed(search, |_| hybrid_astar::solve(p, config, preset, &mut Unlimited::default()))
            };
            problems.hybrid_astar.iter().map(solve).collect()
        }
        Posed::Named(named) => problems.fot.iter().map(|problem| on_road(problem, *named)).collect(),
    }
}

/// Solves one road problem with a planner of the registry; a new one for each call, so that calls are independent.
fn on_road(problem: &FotProblem, named: Named<'_>) -> Solution {
    let road = match RoadProblem::new(problem, named.road) {
        Ok(road) => road,
        Err(reason) => return Solution { invalid: true, ..Solution::not_found(&problem.id, &reason, 0) },
    };
    let mut planners = [(); REPEATS].map(|()| named.planner());
    let mut planners = planners.iter_mut();
    let plan = || {
        let planner = planners.next().expect("one per repetition");
        planner.plan(&road.request(), &mut Unlimited::default())
    };
    timed(plan, |plan| road.solution(problem, &plan))
}

/// Calls `call` [`REPEATS`] times; returns the solution that `finish` makes of the last result, with the fastest time.
fn timed<R>(mut call: impl FnMut() -> R, finish: impl FnOnce(R) -> Solution) -> Solution {
    let mut fastest_ms = f64::INFINITY;
    let mut result = None;
    for _ in 0..REPEATS {
        let began = now();
        result = Some(call());
        fastest_ms = fastest_ms.min(began.elapsed().as_secs_f64() * 1e3);
    }
    let result = result.expect("it is called at least once");
    Solution { time_ms: fastest_ms, ..finish(result) }
}

#[expect(clippy::disallowed_methods, reason = "the run time on this host is what is asked for")]
fn now() -> Instant {
    Instant::now()
}
