//! Story picture of a drive with the default pipeline.

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
fn default_run_has_a_story() {
    let svg = drawn(&[]);
    for part in ["first visible", "truck", "lateral acc.", "response time"] {
        assert!(svg.contains(part), "{part}");
    }
    assert!(!svg.contains("NaN") && svg.len() < 400_000, "{}", svg.len());
}

/// The deciding person and the truck, which is nearer, are both labelled with their distances.
#[test]
fn stationary_ego_has_one_outline_and_a_distance_to_each_actor() {
    let svg = drawn(&["ego.speed_mps=0"]);
    let closest = svg.split("closest to person ").nth(1).unwrap().split('<').next().unwrap();
    let distance = closest.split(", ").nth(1).unwrap();
    assert!(svg.contains(&format!("m (truck), {distance} (person)")), "{closest}");
    assert_eq!(svg.matches("fill-opacity=\"0.1\"").count(), 1);
}
