//! Drives that start at rest beside the line, and that continue after a stop.

use swerve_drive::drive;
use swerve_eval::Verdict;
use swerve_scenario::Scenario;
use swerve_stack::Setup;

use crate::common::config;

/// Start pose: offset from the line, metres; heading relative to it, radians; and curvature of the road, 1/m.
const STARTS: [[f64; 3]; 6] = [
    [0.03, 0.0, 0.0],
    [-0.9, 0.0, 0.0],
    [0.0, 0.02, 0.0],
    [0.6, -0.25, 0.0],
    [-0.5, 0.25, 0.05],
    [0.4, -0.2, -0.05],
];

/// Distance that a car at rest more than covers in five seconds at a third of the comfortable 2 m/s², metres.
const LEAST_M: f64 = 5.0;

fn road([d_m, heading_rad, curvature_1pm]: [f64; 3]) -> Scenario {
    let text = format!(
        r#"name = "setting_off"
[road]
segments = [{{ length_m = 5.0 }}, {{ length_m = 45.0, curvature_1pm = {curvature_1pm:?} }}, {{ length_m = 30.0 }}]
lane_width_m = 4.5
[ego]
s_m = 8.0
d_m = {d_m:?}
heading_rad = {heading_rad:?}
start_speed_mps = 0.0
target_speed_mps = 6.0
end_m = 75.0
[end]
timeout_s = 5.0
"#
    );
    Scenario::parse("setting_off.toml", &text).unwrap_or_else(|problems| panic!("{problems:?}"))
}

/// Reason why a drive of five seconds did not set off.
fn stays(config: &Setup, start: [f64; 3]) -> Option<String> {
    let outcome = drive(config, &road(start)).unwrap();
    let way_m = outcome.metrics.drive.path_length_m;
    let sets_off = way_m > LEAST_M && outcome.metrics.left_road_at_s.is_none();
    (!sets_off).then(|| {
        let (planning, control) = (&config.planning, &config.control);
        format!("{:?} {:?} from {start:?}: {way_m:.2} m", planning.planner, control.controller)
    })
}

#[test]
fn every_planner_and_controller_sets_off_from_beside_the_line() {
    let mut stay = Vec::new();
    for planner in ["fot", "rrt_star", "hybrid_astar", "waypoint"] {
        for comfort in [true, false] {
            for (k, start) in STARTS.into_iter().enumerate() {
                // Each controller is combined with each planner, and each start with every controller.
                let controllers = ["stanley", "pure_pursuit", "mpc", "pid"];
                let controller = controllers[(k + usize::from(comfort)) % controllers.len()];
                let config = config(&[
                    &format!("planning.planner={planner}"),
                    &format!("planning.comfort.enabled={comfort}"),
                    &format!("control.controller={controller}"),
                ]);
                stay.extend(stays(&config, start));
            }
        }
    }
    assert!(stay.is_empty(), "{}", stay.join("\n"));
}

#[test]
fn car_stopped_beside_the_line_continues() {
    let text = r#"name = "goes_on"
[road]
segments = [{ length_m = 200.0 }]
lane_width_m = 4.5
[ego]
s_m = 15.0
d_m = 0.6
target_speed_mps = 5.0
end_m = 90.0
[[actor]]
name = "walker"
kind = "pedestrian"
s_m = 34.0
d_m = 0.2
trigger = { time = { at_s = 9.0 } }
motion = [{ walk = { speed_mps = 1.4, distance_m = 7.0, direction = "right" } }]
[end]
timeout_s = 45.0
"#;
    let scenario = Scenario::parse("goes_on.toml", text).unwrap_or_else(|problems| panic!("{problems:?}"));
    for planner in ["fot", "waypoint"] {
        let outcome = drive(&config(&[&format!("planning.planner={planner}")]), &scenario).unwrap();
        assert_eq!(outcome.metrics.verdict, Verdict::Avoided, "{planner}");
    }
}
