#![no_main]
//! Problem files of `swerve plan`: any text is one, or is refused; problems of any size and place are solved within a
//! bounded search, or refused.

use swerve_fuzz::Limited;
use swerve_pylot::Preset;
use swerve_pylot::posed::{ProblemFile, fot, hybrid_astar, rrt_star};

/// Budget of a search.
const WORK: u64 = 200;

libfuzzer_sys::fuzz_target!(|text: &str| {
    let Ok(file) = serde_json::from_str::<ProblemFile>(text) else { return };
    let (configs, problems) = (&file.configs, &file.problems);
    if let (Some(config), Some(problem)) = (configs.fot.values().next(), problems.fot.first()) {
        let _solution = fot::solve(problem, config, Preset::Best);
    }
    for preset in [Preset::Paper, Preset::Best] {
        if let (Some(config), Some(problem)) = (configs.rrt_star.values().next(), problems.rrt_star.first()) {
            let _solution = rrt_star::solve(problem, config, preset, &mut Limited(WORK));
        }
        if let (Some(config), Some(problem)) =
            (configs.hybrid_astar.values().next(), problems.hybrid_astar.first())
        {
            let _solution = hybrid_astar::solve(problem, config, preset, &mut Limited(WORK));
        }
    }
});
