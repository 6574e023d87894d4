//! Story picture of a run, filled during the run.

use swerve_report::story::Story;
use swerve_scenario::Scenario;
use swerve_stack::config::Config;
use swerve_stack::pipeline::Pipeline;

use crate::lights::light_courses;
use crate::measured::outline;

/// Title of the picture.
pub fn title(config: &Config, scenario: &Scenario) -> String {
    format!(
        "{}: {} at {:.0} m/s, seed {}",
        scenario.name.replace('_', " "),
        config.pipeline_name(),
        config.ego.speed_mps.unwrap_or(scenario.ego.target_speed_mps),
        config.seed
    )
}

/// Creates the picture of a run, to be filled during the run.
pub fn story(config: &Config, scenario: &Scenario, pipeline: &Pipeline) -> Story {
    let lane_width_m = Some(scenario.road.lane_width_m(scenario.ego.s_m));
    let mut story = Story::new(
        title(config, scenario),
        pipeline.route.clone(),
        lane_width_m,
        outline(&pipeline.vehicle.shape),
    );
    story.lights = light_courses(&scenario.road, &pipeline.route, pipeline.until);
    story
}
