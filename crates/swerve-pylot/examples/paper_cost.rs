//! Fits the run time per unit of work of the paper presets: the 99th percentile over the `avoid*` problems of a problem
//! file is matched to the paper's (Pylot, Table I). `configs/paper.toml` contains the printed values.
//!
//! `cargo run --release -p swerve-pylot --example paper_cost -- FILE`

use core::f64::consts::PI;
use std::error::Error;

use swerve_planning::Unlimited;
use swerve_pylot::Preset;
use swerve_pylot::posed::{HybridAstarProblem, ProblemFile, RrtStarConfig, fot, hybrid_astar, rrt_star};

/// Random trees per problem.
const SEEDS: u64 = 200;

#[expect(clippy::print_stdout, reason = "an example prints")]
fn main() -> Result<(), Box<dyn Error>> {
    let path = std::env::args().nth(1).ok_or("expected a problem file")?;
    let file: ProblemFile = serde_json::from_str(&std::fs::read_to_string(path)?)?;
    let fot_work = |config: &str| -> Option<Vec<u64>> {
        let config = file.configs.fot.get(config)?;
        let posed = file.problems.fot.iter().filter(|p| p.group.starts_with("avoid"));
        Some(posed.map(|p| fot::solve(p, config, Preset::Paper).work).collect())
    };
    let rrt_work = |config: &str| -> Option<Vec<u64>> {
        let config = *file.configs.rrt_star.get(config)?;
        Some(rrt_star_work(&file, config))
    };
    let hybrid_work = |config: &str| -> Option<Vec<u64>> {
        let config = file.configs.hybrid_astar.get(config)?;
        let posed = file.problems.hybrid_astar.iter().filter(|p| p.group.starts_with("avoid"));
        // The heading of the paper's town is pi.
        let mut solver = hybrid_astar::Solver::default();
        solver.heading_of_road_rad = PI;
        let work = |p: &HybridAstarProblem| {
            solver.search(p, config, Preset::Paper, &mut Unlimited::default());
            solver.work()
        };
        Some(posed.map(work).collect())
    };
    for (name, paper_ms, work) in [
        ("fot.fast", 30.0, fot_work("pylot_fast")),
        ("fot.slow", 550.0, fot_work("pylot_slow")),
        ("rrt_star.fast", 15.0, rrt_work("pylot_fast")),
        ("rrt_star.slow", 76.0, rrt_work("pylot_slow")),
        ("hybrid_astar.fast", 25.0, hybrid_work("pylot_s6_r075")),
        ("hybrid_astar.slow", 760.0, hybrid_work("pylot_s3_r025")),
    ] {
        let mut work = work.ok_or("the file lacks a configuration")?;
        work.sort_unstable();
        let p99 = work[((work.len() as f64 * 0.99).ceil() as usize).clamp(1, work.len()) - 1];
        println!(
            "{name}: {} calls, p99 {p99} units, {:.2} us per unit",
            work.len(),
            paper_ms * 1e3 / p99 as f64
        );
    }
    Ok(())
}

fn rrt_star_work(file: &ProblemFile, config: RrtStarConfig) -> Vec<u64> {
    let mut work = Vec::new();
    let mut solver = rrt_star::Solver::default();
    for problem in file.problems.rrt_star.iter().filter(|p| p.group.starts_with("avoid")) {
        for seed in 0..SEEDS {
            solver.seed = seed;
            solver.search(problem, &config, Preset::Paper, &mut Unlimited::default());
            work.push(solver.work());
        }
    }
    work
}
