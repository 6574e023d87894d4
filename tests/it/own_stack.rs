//! Operators of an external package, `examples/own_stack`, with all functions that apply to operators.
#![expect(unreachable_pub, reason = "to a package of its own they are what it shows")]

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use swerve::Registry;
use swerve::replay::replay_with;
use swerve_core::Time;
use swerve_drive::{Outcome, drive_pipeline, read_scenario, run_start, set_up};
use swerve_flow::{Event, Observer};
use swerve_log::{Log, Recorder};
use swerve_stack::Setup;
use swerve_stack::pipeline::Pipeline;

use crate::common::{root, scenario_file, sets};

#[path = "../../examples/own_stack/src/barriers.rs"]
mod barriers;
#[path = "../../examples/own_stack/src/cautious.rs"]
mod cautious;
#[path = "../../examples/own_stack/src/clear_ahead.rs"]
mod clear_ahead;
#[path = "../../examples/own_stack/src/colourful.rs"]
mod colourful;
#[path = "../../examples/own_stack/src/fading.rs"]
mod fading;
#[path = "../../examples/own_stack/src/nearest_ahead.rs"]
mod nearest_ahead;
#[path = "../../examples/own_stack/src/nearest_box.rs"]
mod nearest_box;
#[path = "../../examples/own_stack/src/nearest_points.rs"]
mod nearest_points;
#[path = "../../examples/own_stack/src/pulled.rs"]
mod pulled;
#[path = "../../examples/own_stack/src/pursuit.rs"]
mod pursuit;
#[path = "../../examples/own_stack/src/slow_down.rs"]
mod slow_down;

// Planner of `swerve new`.
#[path = "../../crates/swerve/template/src/slow_down.rs"]
mod new_slow_down;

mod by_name;

use clear_ahead::ClearAhead;

fn registry() -> Registry {
    Registry::standard()
        .with::<nearest_ahead::NearestAhead>()
        .with::<slow_down::SlowDown>()
        .with::<barriers::Barriers>()
        .with_planner::<cautious::Cautious>()
        .with_controller::<pursuit::Pursuit>()
        .with_predictor::<fading::Fading>()
        .with_detector::<colourful::Colourful>()
        .with_lidar_detector::<nearest_points::NearestPoints>()
        .with_tracker::<nearest_box::NearestBox>()
        .with_localizer::<pulled::Pulled>()
        .with_view(clear_ahead::show)
}

fn config(assignments: &[&str]) -> Setup {
    let file = root().join("examples/own_stack/own_stack.toml");
    let config = Setup::load_with(&registry(), Some(&file), &sets(assignments));
    config.unwrap_or_else(|problems| panic!("{problems:?}"))
}

/// Values of the custom message with their stamps and publication times.
#[derive(Default)]
struct Recorded(Vec<(Time, Time, f64)>);

impl Observer for Recorded {
    fn event(&mut self, event: &Event<'_>) {
        let Event::Publication(publication) = event else { return };
        let payload = publication.payload.and_then(|payload| payload.downcast_ref::<ClearAhead>());
        if let Some(clear) = payload {
            self.0.push((clear.stamp, publication.visible_at, clear.distance_m));
        }
    }
}

fn drive(config: &Setup, threads: usize, log: Option<&Path>) -> (Recorded, Outcome) {
    let file = scenario_file("person_crossing");
    let mut pipeline = Pipeline::build(config, &read_scenario(&file).unwrap()).unwrap();
    pipeline.until = Time::from_ms(4000);
    let mut recorder =
        log.map(|log| Recorder::create(log, &run_start(config, &pipeline.scenario, &file)).unwrap());
    if let Some(recorder) = &mut recorder {
        set_up(recorder, config, &pipeline);
    }
    let mut seen = Recorded::default();
    let mut observers: Vec<&mut dyn Observer> = vec![&mut seen];
    observers.extend(recorder.as_mut().map(|recorder| recorder as &mut dyn Observer));
    let outcome = drive_pipeline(pipeline, config.seed, threads, &mut observers).unwrap();
    if let Some(recorder) = recorder {
        recorder.finish().unwrap();
    }
    (seen, outcome)
}

#[test]
fn custom_operators_drive_with_run_times_and_the_same_digest_on_any_threads() {
    let (seen, one) = drive(&config(&[]), 1, None);
    assert!(seen.0.len() > 60, "{}", seen.0.len());
    let after_ms = |(stamp, at, _): &(Time, Time, f64)| (*at - *stamp).ns() / 1_000_000;
    assert!(seen.0.iter().all(|message| after_ms(message) == 15), "the configured run time");
    assert!(seen.0.iter().any(|(_, _, distance_m)| *distance_m < 60.0), "somebody is ahead at some time");
    assert_eq!(drive(&config(&[]), 2, None).1.digest, one.digest);
    let farther = drive(&config(&["operator.clear_ahead.range_m=40"]), 1, None).1.digest;
    assert_ne!(farther, one.digest, "its own key counts");
}

#[test]
fn log_of_custom_operators_replays_and_can_be_recomputed_with_other_settings() {
    let folder = tempfile::tempdir().unwrap();
    let path: PathBuf = folder.path().join("log.mcap");
    drive(&config(&[]), 1, Some(&path));
    let log = Log::read(&path).unwrap();
    let again = |from: &str, assignments: &[&str]| {
        replay_with(&registry(), &log, from, &sets(assignments), 1).unwrap().is_same()
    };
    assert!(again("tracker", &[]) && again("clear_ahead", &[]) && again("planner", &[]));
    assert!(!again("planner", &["operator.planner.gap_m=30"]));
    let streams: BTreeMap<&str, usize> = log.all_publications().fold(BTreeMap::new(), |mut counts, p| {
        *counts.entry(p.stream.stream.as_str()).or_default() += 1;
        counts
    });
    assert!(streams["clear_ahead"] > 60, "{streams:?}");
    let summary = mcap::Summary::read(&std::fs::read(&path).unwrap()).unwrap().unwrap();
    let shown = summary.channels.values().find(|channel| channel.topic == "/view/clear_ahead");
    let count = summary.stats.unwrap().channel_message_counts[&shown.unwrap().id];
    assert_eq!(count, streams["clear_ahead"] as u64, "each is shown");
}

#[test]
fn faults_apply_to_inputs_of_custom_operators_and_wrong_keys_are_refused_with_their_line() {
    let (_, sound) = drive(&config(&[]), 1, None);
    let late = config(&["fault.late={ stream = \"obstacles\", delay_ms = 300 }"]);
    let (seen, faulty) = drive(&late, 1, None);
    assert_ne!(faulty.digest, sound.digest);
    assert!(seen.0.iter().all(|(stamp, at, _)| (*at - *stamp).ns() >= 315_000_000));
    let refused = Setup::load_with(
        &registry(),
        Some(&root().join("examples/own_stack/own_stack.toml")),
        &sets(&["operator.clear_ahead.rang_m=5"]),
    );
    let problems = refused.unwrap_err().iter().map(ToString::to_string).collect::<Vec<_>>();
    assert!(problems[0].contains("unknown key; did you mean `range_m`?"), "{problems:?}");
}

/// Planner of a new folder, without its package: building that is a slow test.
#[test]
fn planner_of_a_new_folder_drives_its_scenario() {
    let registry = Registry::standard().with::<new_slow_down::SlowDown>();
    let folder = root().join("crates/swerve/template");
    let config = Setup::load_with(&registry, Some(&folder.join("own.toml")), &[]).unwrap();
    let scenario = read_scenario(&folder.join("scenario.toml")).unwrap();
    let outcome =
        drive_pipeline(Pipeline::build(&config, &scenario).unwrap(), config.seed, 1, &mut []).unwrap();
    let expected = scenario.expectation(&config.pipeline_name()).unwrap();
    assert_eq!(outcome.broken(expected), Vec::<String>::new());
}

/// The scenario's own report of the closure is not read.
#[test]
fn operator_that_reads_map_and_route_makes_the_ego_drive_around_barriers_that_it_sees() {
    let file = root().join("examples/own_stack/barriers.toml");
    let config = Setup::load_with(&registry(), Some(&file), &[]).unwrap_or_else(|why| panic!("{why:?}"));
    let scenario = read_scenario(&scenario_file("maps/closed_road")).unwrap();
    let pipeline = Pipeline::build(&config, &scenario).unwrap();
    assert!(pipeline.assembly.operator("closures").is_none());
    let outcome = drive_pipeline(pipeline, config.seed, 1, &mut []).unwrap();
    let expected = scenario.expectation(&config.pipeline_name()).unwrap();
    assert_eq!(outcome.broken(expected), Vec::<String>::new());
}

/// Their README's statements on the drive that it shows.
#[test]
fn readme_states_the_result_of_its_drive() {
    let readme = std::fs::read_to_string(root().join("examples/own_stack/README.md")).unwrap();
    let config = config(&[]);
    let scenario = read_scenario(&scenario_file("person_crossing")).unwrap();
    let pipeline = Pipeline::build(&config, &scenario).unwrap();
    let outcome = drive_pipeline(pipeline, config.seed, 1, &mut []).unwrap();
    let expected = scenario.expectation(&config.pipeline_name()).unwrap();
    assert_eq!(outcome.broken(expected), Vec::<String>::new(), "`as the scenario expects`");
    let metrics = &outcome.metrics;
    let p50_ms = |name: &str| metrics.operators.iter().find(|o| o.operator == name).unwrap().p50_ms;
    for said in [
        format!("`{}` and `as the scenario expects`", metrics.verdict.name().to_uppercase()),
        format!("`clear_ahead` ({:.0} ms a step)", p50_ms("clear_ahead")),
        format!("`planner` ({:.0} ms or so)", p50_ms("planner")),
    ] {
        assert!(readme.contains(&said), "README does not say {said}");
    }
}

#[test]
fn each_of_their_files_is_short() {
    for name in [
        "barriers",
        "cautious",
        "clear_ahead",
        "colourful",
        "fading",
        "nearest_ahead",
        "nearest_box",
        "nearest_points",
        "pulled",
        "pursuit",
        "slow_down",
    ] {
        let text = std::fs::read_to_string(root().join(format!("examples/own_stack/src/{name}.rs"))).unwrap();
        assert!(text.lines().count() <= 60, "{name}");
    }
}
