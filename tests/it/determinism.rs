//! Digests of equal runs are equal, whatever the load of the machine.

use swerve_core::Digest;
use swerve_drive::{drive_observed, drive_pipeline, read_scenario, record_run_times};
use swerve_log::Log;
use swerve_stack::Setup;
use swerve_stack::pipeline::Pipeline;

use crate::common::{config, record, scenario_file};

/// Plans that take longer than a frame, four at a time, with random run times: steps overlap on several threads and
/// finish out of order.
const OVERLAPPING: [&str; 2] = [
    "operator.planner.runtime={ normal_ms = [120, 40] }",
    "operator.planner.policy=\"pipelined(4, overtaking)\"",
];

fn digest(config: &Setup, threads: usize) -> Digest {
    let scenario = read_scenario(&scenario_file("person_crossing")).unwrap();
    drive_observed(config, &scenario, threads, &mut []).unwrap().digest
}

#[test]
fn digest_depends_on_the_seed_and_not_on_threads_or_repeats() {
    let config = config(&OVERLAPPING);
    let one = digest(&config, 1);
    for threads in [1, 2, 8, 8] {
        assert_eq!(digest(&config, threads), one, "{threads} threads");
    }
    let mut other = config;
    other.seed = 2;
    assert_ne!(digest(&other, 1), one);
    assert_eq!(digest(&other, 8), digest(&other, 1));
}

#[test]
fn random_planner_is_repeatable_on_any_number_of_threads() {
    let config = config(&[OVERLAPPING[0], OVERLAPPING[1], "planning.planner=rrt_star"]);
    assert_eq!(digest(&config, 2), digest(&config, 1));
}

#[test]
fn emulated_detector_is_repeatable_on_any_number_of_threads() {
    let of = |detector: &str| {
        config(&[OVERLAPPING[0], OVERLAPPING[1], &format!("perception.detector={detector}")])
    };
    let d3 = of("efficientdet-d3@v100");
    let one = digest(&d3, 1);
    assert_eq!(digest(&d3, 2), one);
    assert_ne!(digest(&of("efficientdet-d4@v100"), 1), one);
    let mut other = d3;
    other.seed = 2;
    assert_ne!(digest(&other, 1), one);
}

#[test]
fn recorded_run_times_reproduce_their_run() {
    let folder = tempfile::tempdir().unwrap();
    let file = scenario_file("person_crossing");
    let scenario = read_scenario(&file).unwrap();
    for (i, runtime) in
        ["{ fixed_ms = 70 }", "{ normal_ms = [60, 25] }", "{ cycle_ms = [20, 130] }"].iter().enumerate()
    {
        let log = folder.path().join(format!("{i}.mcap"));
        let assignment = format!("operator.planner.runtime={runtime}");
        let modelled = record(&config(&[&assignment]), &file, &log, 1);
        // Another model under the recorded times: it must not be used.
        let other = config(&["operator.planner.runtime={ fixed_ms = 1 }"]);
        let mut pipeline = Pipeline::build(&other, &scenario).unwrap();
        record_run_times(&mut pipeline, &Log::read(&log).unwrap(), |_| true);
        let recorded = drive_pipeline(pipeline, other.seed, 1, &mut []).unwrap();
        assert_eq!(recorded.digest, modelled.digest, "{runtime}");
        assert_ne!(digest(&other, 1), modelled.digest, "{runtime}: the run times do not show in the digest");
        let unrecorded: u64 = recorded.report.operators.iter().map(|o| o.unrecorded).sum();
        assert_eq!(unrecorded, 0, "{runtime}");
    }
}
