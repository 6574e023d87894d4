//! Every shipped scenario under every pipeline with an expectation.

use std::path::{Path, PathBuf};

use swerve_drive::{drive, read_scenario};
use swerve_scenario::Scenario;
use swerve_stack::Setup;
use swerve_stack::config::Config;

use crate::common::{config, root};

/// All scenarios but the routes, which take minutes each: `swerve suite routes` drives them.
fn files() -> Vec<PathBuf> {
    let mut files = swerve_report::files::toml_files(&root().join("scenarios")).unwrap();
    files.retain(|file| !file.parent().unwrap().ends_with("routes"));
    assert!(files.len() >= 34, "only {} scenarios found", files.len());
    files
}

/// Pipeline by its name in scenarios.
fn named(name: &str) -> Setup {
    let (preset, planner) = match name.strip_prefix("paper_") {
        Some(planner) => ("paper", planner),
        None => ("best", name),
    };
    let config = config(&[&format!("planning.preset={preset}"), &format!("planning.planner={planner}")]);
    assert_eq!(config.pipeline_name(), name);
    config
}

/// Deviations of a run of `file` under `config` from the expected result.
fn broken(file: &Path, config: &Setup) -> Vec<String> {
    let scenario = read_scenario(file).unwrap();
    let pipeline = config.pipeline_name();
    let expected = scenario
        .expectation(&pipeline)
        .unwrap_or_else(|| panic!("{} expects nothing of {pipeline}", scenario.name));
    assert!(!expected.bounds.is_empty(), "{}: a verdict alone hardly tests a drive", scenario.name);
    let outcome = drive(config, &scenario).unwrap();
    outcome.broken(expected).into_iter().map(|b| format!("{} under {pipeline}: {b}", scenario.name)).collect()
}

#[test]
fn default_pipeline_meets_the_expectation_of_every_scenario() {
    let broken: Vec<String> = files().iter().flat_map(|file| broken(file, &Setup::default())).collect();
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

#[test]
fn every_pipeline_named_in_a_scenario_meets_its_expectation() {
    let default = Setup::default().pipeline_name();
    let (mut runs, mut all_broken) = (0, Vec::new());
    for file in files() {
        let expect = read_scenario(&file).unwrap().expect;
        for name in expect.into_iter().filter_map(|e| e.pipeline).filter(|name| *name != default) {
            runs += 1;
            all_broken.extend(broken(&file, &named(&name)));
        }
    }
    assert!(all_broken.is_empty(), "{}", all_broken.join("\n"));
    assert!(runs >= 7, "only {runs} expectations name a pipeline");
}

/// Each file of `scenarios/everyday/` states the correct result for any planner.
#[test]
fn everyday_scenarios_hold_under_every_planner() {
    let everyday: Vec<PathBuf> =
        files().into_iter().filter(|file| file.parent().unwrap().ends_with("everyday")).collect();
    assert!(everyday.len() >= 24, "only {} everyday scenarios found", everyday.len());
    let planners = ["rrt_star", "hybrid_astar", "waypoint"].map(named);
    let all = everyday.iter().flat_map(|file| planners.iter().flat_map(|config| broken(file, config)));
    let broken: Vec<String> = all.collect();
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

/// The situations of `scenarios/nhtsa/` need a driver: an ego that stands, or that sees nobody, does not meet the
/// expectation. In one of them nobody else is there.
#[test]
fn nhtsa_scenarios_are_met_neither_by_standing_nor_by_blind_egos() {
    let nhtsa: Vec<PathBuf> =
        files().into_iter().filter(|file| file.parent().unwrap().ends_with("nhtsa")).collect();
    assert!(nhtsa.len() >= 30, "only {} of NHTSA's types found", nhtsa.len());
    let (standing, blind) = (config(&["ego.speed_mps=0"]), config(&["sensing.range_m=0.1"]));
    for file in &nhtsa {
        assert!(!broken(file, &standing).is_empty(), "{} is met by standing", file.display());
        let is_alone = read_scenario(file).unwrap().actors.is_empty();
        assert_eq!(broken(file, &blind).is_empty(), is_alone, "{} by a blind ego", file.display());
    }
}

/// The outcome of `scenarios/seeing/` depends on when the actor `hazard` is seen: a car that is blind to it collides with
/// it, and so does one whose plans are late.
#[test]
fn seeing_scenarios_are_met_neither_by_blind_nor_by_late_egos() {
    let seeing: Vec<PathBuf> =
        files().into_iter().filter(|file| file.parent().unwrap().ends_with("seeing")).collect();
    assert!(seeing.len() >= 8, "only {} scenarios found", seeing.len());
    let blind = config(&["sensing.unseen=[\"hazard\"]"]);
    let late = config(&["planning.added_latency_ms=1500"]);
    for file in &seeing {
        let scenario = read_scenario(file).unwrap();
        let hazard = scenario.actors.iter().find(|actor| actor.name == "hazard").map(|actor| actor.id);
        for config in [&blind, &late] {
            let hit = drive(config, &scenario).unwrap().metrics.impact.map(|impact| impact.actor);
            assert!(hit.is_some() && hit == hazard, "{}: hit {hit:?}", scenario.name);
        }
    }
}

#[test]
fn other_seeds_give_the_same_result() {
    for (name, seeds) in [("person_behind_truck", 2..5), ("person_behind_parked_car", 2..4)] {
        for seed in seeds {
            let config = Setup::from(Config { seed, ..Config::default() });
            let broken = broken(&crate::common::scenario_file(name), &config);
            assert!(broken.is_empty(), "seed {seed}: {}", broken.join("; "));
        }
    }
}

#[test]
fn search_planners_avoid_the_person_behind_the_truck_at_18_mps() {
    let scenario = read_scenario(&crate::common::scenario_file("person_behind_truck")).unwrap();
    for planner in ["rrt_star", "hybrid_astar"] {
        // Those that were hit, and one more.
        for seed in [1, 3, 5, 6] {
            let sets = ["planning.discretisation=fast", "ego.speed_mps=18"].map(str::to_owned);
            let sets = [&sets[..], &[format!("planning.planner={planner}"), format!("seed={seed}")]].concat();
            let config = config(&sets.iter().map(String::as_str).collect::<Vec<_>>());
            let metrics = drive(&config, &scenario).unwrap().metrics;
            let broken = (metrics.impact, metrics.left_road_at_s);
            assert_eq!(broken, (None, None), "{planner}, seed {seed}");
        }
    }
}

#[test]
fn presets_slow_for_people_who_stop_in_the_lane() {
    for name in ["people_crossing", "person_crossing"] {
        let scenario = read_scenario(&crate::common::scenario_file(name)).unwrap();
        for planner in ["fot", "rrt_star", "hybrid_astar", "aeb"] {
            for seed in 1..4 {
                let config = config(&[&format!("planning.planner={planner}"), &format!("seed={seed}")]);
                let metrics = drive(&config, &scenario).unwrap().metrics;
                let broken = (metrics.impact, metrics.left_road_at_s);
                assert_eq!(broken, (None, None), "{name} under {planner}, seed {seed}");
            }
        }
    }
}

/// Number of drives of a scenario, one per seed, that end without a collision and on the road.
fn good(scenario: &Scenario, seeds: u64, sets: &[&str]) -> u64 {
    let ends_well = |seed: &u64| {
        let mut config = config(sets);
        config.seed = *seed;
        let metrics = drive(&config, scenario).unwrap().metrics;
        metrics.impact.is_none() && metrics.left_road_at_s.is_none()
    };
    (1..=seeds).filter(ends_well).count() as u64
}

/// Latency studies must not measure the controller instead: the defaults are near-optimal at any latency, and the cost
/// of latency increases step by step. `SWERVE_SEEDS=20` checks the full requirement in three minutes.
#[test]
fn latency_costs_only_the_unavoidable_with_the_defaults() {
    let shipped = crate::common::scenario_file("person_behind_truck");
    let mut cases = vec![(shipped, "ego.speed_mps=16")];
    if let Some(runner) = swerve_tests::data_or_skip("scenarios/runner_two_trucks.toml") {
        cases.push((runner, "ego.speed_mps=14"));
    }
    let seeds = std::env::var("SWERVE_SEEDS").map_or(4, |seeds| seeds.parse().unwrap());
    let (latencies_ms, others): (&[_], &[_]) = match seeds {
        0..20 => (&[0, 100, 160, 240, 300], &["pure_pursuit"]),
        _ => (&[0, 100, 200, 300], &["pure_pursuit", "mpc"]),
    };
    for (file, speed) in cases {
        let scenario = read_scenario(&file).unwrap();
        let mut before = seeds;
        for latency_ms in latencies_ms {
            let added = format!("planning.added_latency_ms={latency_ms}");
            let by_default = good(&scenario, seeds, &[speed, &added]);
            let other =
                |name: &&str| good(&scenario, seeds, &[speed, &added, &format!("control.controller={name}")]);
            let best = others.iter().map(other).max().unwrap();
            let told = format!("{} at {latency_ms} ms: {by_default}, others {best}", scenario.name);
            assert!(by_default + seeds / 10 >= best, "{told}");
            assert!(by_default <= before + seeds / 10, "{told}, {before} with less");
            assert!(before - before.min(by_default) <= seeds / 2, "{told}, {before} with less: a jump");
            before = by_default;
        }
    }
}
