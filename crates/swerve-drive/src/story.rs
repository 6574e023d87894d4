//! Story picture of a run, filled during the run.

use swerve_core::{Span, Time};
use swerve_eval::{Metrics, Why};
use swerve_geom::Point2;
use swerve_map::{Lane, Side};
use swerve_report::story::Story;
use swerve_scenario::{Course, Scenario, Slippery};
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
    if let Course::Map(course) = &scenario.road.course {
        story.lanes =
            course.map.lanes().iter().filter(|lane| lane.kind.is_drivable()).map(outline_of).collect();
    }
    story.slippery = scenario.slippery.iter().map(Slippery::outline).collect();
    story
}

/// Records the result of the run and its cause, and the lights along the last route.
pub fn conclude(story: &mut Story, scenario: &Scenario, metrics: &Metrics, why: Option<&Why>) {
    let until = Time::ZERO + Span::from_secs(scenario.end.timeout_s);
    story.lights = light_courses(&scenario.road, &story.route, until);
    story.conclude(metrics, why);
}

/// Outline of a lane: its left border, and back along the right one.
fn outline_of(lane: &Lane) -> Vec<Point2> {
    let right = lane.border_points(Side::Right);
    lane.border_points(Side::Left).into_iter().chain(right.into_iter().rev()).collect()
}
