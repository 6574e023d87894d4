//! Texts of scenarios made of CommonRoad's.

use super::*;

const SMALL: &str = include_str!("../read/tests/small.xml");

#[test]
fn text_has_start_goal_and_recorded_road_users() {
    let scenario = Scenario::read("small.xml", SMALL).unwrap();
    let text = scenario.to_toml("small.xml").unwrap();
    for part in [
        "name = \"ZAM_Small-1_1_T-1\"",
        "start = { lane = \"1\", s_m = 20.0 }",
        "goal = { lane = \"1\", s_m = 99.8 }",
        "d_m = 0.0",
        "start_speed_mps = 10.0",
        "timeout_s = 2.0",
        "kind = \"static\"",
        "track = { from_s = 0.0, step_s = 0.1, at = [[10.0, 1.5], [11.0, 1.5], [12.0, 1.5]], heading_rad = [0.0, 0.0, 0.0] }",
    ] {
        assert!(text.contains(part), "{part}:\n{text}");
    }
    assert!(!text.contains("obstacle_6"), "a set of occupied space is no motion");
}

#[test]
fn scenario_without_a_start_on_a_lanelet_is_refused() {
    let beside = SMALL.replace("<x>20</x><y>1.5</y>", "<x>20</x><y>15</y>");
    let scenario = Scenario::read("small.xml", &beside).unwrap();
    assert_eq!(scenario.to_toml("small.xml"), Err(NoWay::OffLanelets));
}

#[test]
fn scenario_with_a_road_user_beyond_the_world_is_refused_once() {
    let mut scenario = Scenario::read("small.xml", SMALL).unwrap();
    scenario.obstacles[1].initial.position.x_m = 2e5;
    assert_eq!(scenario.to_toml("small.xml"), Err(NoWay::Far));
}

#[test]
fn ego_is_at_the_goal_in_the_middle_of_its_time_but_late() {
    let mut scenario = Scenario::read("small.xml", SMALL).unwrap();
    for (steps, expected_s) in [([18.0, 20.0], 1.9), ([0.0, 20.0], 1.7), ([20.0, 20.0], 2.0)] {
        for goal in &mut scenario.problems[0].goals {
            goal.steps = crate::Interval { from: steps[0], to: steps[1] };
        }
        let arrives_s = scenario.arrives_s(&scenario.problems[0], 2.0);
        assert!((arrives_s - expected_s).abs() < 1e-9, "{steps:?}: {arrives_s}");
    }
}
