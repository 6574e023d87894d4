//! The picture of a drive of the real pipeline.

use swerve_drive::{drive_pipeline, read_scenario, story};
use swerve_report::story::draw;
use swerve_stack::pipeline::Pipeline;

use crate::common::{config, scenario_file};

fn drawn(assignments: &[&str]) -> String {
    let (config, scenario) =
        (config(assignments), read_scenario(&scenario_file("person_behind_truck")).unwrap());
    let pipeline = Pipeline::build(&config, &scenario).unwrap();
    let mut story = story(&config, &scenario, &pipeline);
    let outcome = drive_pipeline(pipeline, config.seed, 1, &mut [&mut story]).unwrap();
    story.conclude(&outcome.metrics, None);
    draw(&story).svg()
}

#[test]
fn a_real_run_has_its_story() {
    let svg = drawn(&[]);
    for part in ["first visible", "truck", "lateral acc.", "response time"] {
        assert!(svg.contains(part), "{part}");
    }
    assert!(!svg.contains("NaN") && svg.len() < 400_000, "{}", svg.len());
}

/// The person, whom the story is about, and the truck, which is nearer, are both named with their distances.
#[test]
fn an_ego_that_stands_far_away_has_one_outline_and_a_distance_to_each() {
    let svg = drawn(&["ego.speed_mps=0"]);
    let closest = svg.split("closest to person ").nth(1).unwrap().split('<').next().unwrap();
    let distance = closest.split(", ").nth(1).unwrap();
    assert!(svg.contains(&format!("m (truck), {distance} (person)")), "{closest}");
    assert_eq!(svg.matches("fill-opacity=\"0.1\"").count(), 1);
}
