//! Shares of planning problems that two trivial vehicles solve: one that goes straight on at its speed, and one that
//! brakes at once and stands. `cargo run --release -p swerve-commonroad --example baselines -- DIR` prints a line for
//! each scenario below the folder, and the sums.

#![expect(clippy::print_stdout, reason = "its output")]

use std::error::Error;
use std::path::{Path, PathBuf};

use swerve_commonroad::{CostFunction, Driven, Failure, Model, PlanningProblem, Scenario, Solution};
use swerve_commonroad::{SolutionState, VehicleKind, check};

/// Deceleration of the vehicle that stops, m/s².
const BRAKE_MPS2: f64 = 8.0;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = std::env::args().nth(1).ok_or("expected a folder")?;
    let mut files = Vec::new();
    collect(Path::new(&folder), &mut files)?;
    let mut solved = [0; 2];
    let mut from_behind = [0; 2];
    for file in &files {
        let text = swerve_text::unpacked(std::fs::read(file)?)?;
        let scenario = Scenario::read(&file.display().to_string(), &text)?;
        let Some(problem) = scenario.problems.first() else { continue };
        let verdicts = [0.0, BRAKE_MPS2].map(|brake_mps2| {
            let verdict = check(&scenario, &solution(&scenario, problem, brake_mps2));
            let is_hit = verdict
                .failures
                .iter()
                .any(|failure| matches!(failure, Failure::Obstacle { from_behind: true, .. }));
            (verdict.is_valid(), is_hit, verdict.official())
        });
        for (k, (is_valid, is_hit, _)) in verdicts.iter().enumerate() {
            solved[k] += usize::from(*is_valid);
            from_behind[k] += usize::from(*is_hit);
        }
        println!(
            "{}: straight on {}, standing {}",
            scenario.benchmark,
            word(verdicts[0].2),
            word(verdicts[1].2)
        );
    }
    for (name, k) in [("straight on", 0), ("standing", 1)] {
        println!("{name}: {} of {} solved; {} hit from behind", solved[k], files.len(), from_behind[k]);
    }
    Ok(())
}

fn word(official: &str) -> &str {
    if official.is_empty() { "valid" } else { official }
}

/// Scenario files below a folder, sorted.
fn collect(folder: &Path, files: &mut Vec<PathBuf>) -> std::io::Result<()> {
    let mut paths =
        std::fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect::<std::io::Result<Vec<_>>>()?;
    paths.sort();
    for path in paths {
        let name = path.to_string_lossy().into_owned();
        if path.is_dir() {
            collect(&path, files)?;
        } else if name.ends_with(".xml") || name.ends_with(".xml.gz") {
            files.push(path);
        }
    }
    Ok(())
}

/// Straight on from the initial state until the goal's last time step, with this deceleration, m/s².
fn solution(scenario: &Scenario, problem: &PlanningProblem, brake_mps2: f64) -> Solution {
    let first = problem.initial;
    let along = swerve_geom::Vector2::from_heading(first.heading_rad);
    let state = |step: u32| {
        let t_s = f64::from(step - first.step) * scenario.step_s;
        let moves_s = if brake_mps2 > 0.0 { t_s.min(first.speed_mps / brake_mps2) } else { t_s };
        let way_m = first.speed_mps * moves_s - 0.5 * brake_mps2 * moves_s * moves_s;
        SolutionState {
            step,
            position: first.position + along * way_m,
            heading_rad: first.heading_rad,
            speed_mps: first.speed_mps - brake_mps2 * moves_s,
            steering_rad: 0.0,
            yaw_rate_radps: 0.0,
            slip_rad: 0.0,
        }
    };
    let states: Vec<SolutionState> = (first.step..=problem.last_step()).map(state).collect();
    let goal = |state: &SolutionState| scenario.reaches(problem, state);
    let count = states.iter().position(goal).map_or(states.len(), |k| k + 1);
    let driven = Driven {
        problem: problem.id,
        model: Model::Ks,
        vehicle: VehicleKind::Bmw320i,
        cost: CostFunction::Sm1,
        states: states[..count].to_vec(),
    };
    Solution { benchmark: scenario.benchmark.clone(), driven: vec![driven] }
}
