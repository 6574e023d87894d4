//! Every shipped scenario, under every pipeline that it expects something of.

use std::path::{Path, PathBuf};

use swerve_drive::{drive, read_scenario};
use swerve_stack::config::Config;

use crate::common::{config, root};

fn files() -> Vec<PathBuf> {
    let files = swerve_report::files::toml_files(&root().join("scenarios")).unwrap();
    assert!(files.len() >= 7, "only {} scenarios found", files.len());
    files
}

/// The pipeline that scenarios call `name`.
fn named(name: &str) -> Config {
    let (preset, planner) = match name.strip_prefix("paper_") {
        Some(planner) => ("paper", planner),
        None => ("best", name),
    };
    let config = config(&[&format!("planning.preset={preset}"), &format!("planning.planner={planner}")]);
    assert_eq!(config.pipeline_name(), name);
    config
}

/// In what way the run of `file` under `config` is not as the scenario expects.
fn broken(file: &Path, config: &Config) -> Vec<String> {
    let scenario = read_scenario(file).unwrap();
    let pipeline = config.pipeline_name();
    let expected = scenario
        .expectation(&pipeline)
        .unwrap_or_else(|| panic!("{} expects nothing of {pipeline}", scenario.name));
    let outcome = drive(config, &scenario).unwrap();
    outcome.broken(expected).into_iter().map(|b| format!("{} under {pipeline}: {b}", scenario.name)).collect()
}

#[test]
fn the_default_pipeline_does_as_every_scenario_expects() {
    let broken: Vec<String> = files().iter().flat_map(|file| broken(file, &Config::default())).collect();
    assert!(broken.is_empty(), "{}", broken.join("\n"));
}

#[test]
fn every_pipeline_that_a_scenario_names_does_as_it_expects() {
    let default = Config::default().pipeline_name();
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

#[test]
fn other_seeds_end_the_same_way() {
    for (name, seeds) in [("person_behind_truck", 2..5), ("person_behind_parked_car", 2..4)] {
        for seed in seeds {
            let config = Config { seed, ..Config::default() };
            let broken = broken(&crate::common::scenario_file(name), &config);
            assert!(broken.is_empty(), "seed {seed}: {}", broken.join("; "));
        }
    }
}

#[test]
fn our_presets_slow_for_people_who_stop_in_the_lane() {
    let best = root().join("configs/best.toml");
    for name in ["people_crossing", "person_crossing"] {
        let scenario = read_scenario(&crate::common::scenario_file(name)).unwrap();
        for planner in ["fot", "rrt_star", "hybrid_astar", "aeb"] {
            for seed in 1..4 {
                let set =
                    crate::common::sets(&[&format!("planning.planner={planner}"), &format!("seed={seed}")]);
                let config = Config::load(Some(&best), &set).unwrap();
                let metrics = drive(&config, &scenario).unwrap().metrics;
                let broken = (metrics.impact, metrics.left_road_at_s);
                assert_eq!(broken, (None, None), "{name} under {planner}, seed {seed}");
            }
        }
    }
}
