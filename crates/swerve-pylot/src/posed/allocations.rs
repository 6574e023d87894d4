//! Counts a search's allocations in steady state.

use crate::Preset;
use crate::posed::{HybridAstarProblem, Outcome, RrtStarConfig, RrtStarProblem, hybrid_astar, rrt_star};
use swerve_planning::Unlimited;

/// Allocations of the second call.
fn second(mut call: impl FnMut() -> Outcome) -> u64 {
    assert_eq!(call(), Outcome::Found);
    allocation_counter::measure(|| assert_eq!(call(), Outcome::Found)).count_total
}

#[test]
fn searches_do_not_allocate_in_steady_state() {
    let obstacles = vec![[13.75, -0.75, 14.25, 1.95], [20.0, -4.0, 22.0, -2.5]];
    let problem = RrtStarProblem {
        start: [0.0, 0.0],
        goal: [30.0, 0.0],
        obstacles: obstacles.clone(),
        ..Default::default()
    };
    let config = RrtStarConfig {
        step_size: 0.5,
        max_iterations: 2000,
        end_dist_threshold: 2.0,
        obstacle_clearance: 1.0,
        lane_width: 5.0,
    };
    for preset in [Preset::Paper, Preset::Best] {
        let mut solver = rrt_star::Solver::default();
        let count = second(|| solver.search(&problem, &config, preset, &mut Unlimited::default()));
        assert_eq!(count, 0, "RRT*, {preset:?}");
    }
    let problem = HybridAstarProblem {
        start: [0.0, 0.0, 0.0],
        goal: [30.0, 0.0, 0.0],
        obstacles,
        ..Default::default()
    };
    let config = hybrid_astar::tests::config();
    for preset in [Preset::Paper, Preset::Best] {
        let mut solver = hybrid_astar::Solver::default();
        let count = second(|| solver.search(&problem, &config, preset, &mut Unlimited::default()));
        assert_eq!(count, 0, "Hybrid A*, {preset:?}");
    }
}
