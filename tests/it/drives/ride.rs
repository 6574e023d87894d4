//! Comfort with an estimated pose: as smooth as with the true one, or a stop with a stated reason.

use swerve_eval::Verdict;
use swerve_log::Log;
use swerve_msg::{EgoState, LocalPose, Plan, PlanStatus};
use swerve_stack::Registry;
use swerve_why::Logged;

use crate::common;

/// A lane with a bend to either side, 0.9 m/s² each.
const ROAD: &str = r#"name = "bends"

[road]
segments = [
  { length_m = 50.0 },
  { length_m = 50.0, curvature_1pm = 0.011 },
  { length_m = 50.0, curvature_1pm = -0.011 },
  { length_m = 150.0 },
]
lane_width_m = 4.0

[ego]
target_speed_mps = 9.0
end_m = 230.0

[end]
timeout_s = 40.0
"#;

const UNIT: &str = "sensing.imu={ accel_noise_mps2 = 0.05, accel_bias_mps2 = 0.02, gyro_noise_radps = 0.002, gyro_bias_radps = 0.0005 }";

fn set<'a>(seed: &'a str, gnss: &'a str) -> [&'a str; 4] {
    ["localization.localizer=eskf", UNIT, seed, gnss]
}

#[test]
fn ride_with_corrected_fixes_keeps_the_limits_of_comfort() {
    let folder = tempfile::tempdir().unwrap();
    let [road, path] = ["road.toml", "log.mcap"].map(|name| folder.path().join(name));
    std::fs::write(&road, ROAD).unwrap();
    for seed in ["seed=1", "seed=2", "seed=3", "seed=4"] {
        let config = common::config(&set(seed, "sensing.gnss={ noise_m = 0.02, bias_m = 0 }"));
        let metrics = common::record(&config, &road, &path, 1).metrics;
        assert_eq!(metrics.verdict, Verdict::Completed, "{seed}");
        // The limit of `planning.comfort`, which also limits the controller's steering rate.
        let jerk_mps3 = metrics.lateral_jerk.raw_max_mps3.unwrap();
        assert!(jerk_mps3 < 5.0, "{seed}: {jerk_mps3}");
        assert_eq!(metrics.plans.counts.pose_uncertain, 0, "{seed}");
    }
}

#[test]
fn odometry_continues_smoothly_while_fixes_move_the_pose() {
    let folder = tempfile::tempdir().unwrap();
    let [road, path] = ["road.toml", "log.mcap"].map(|name| folder.path().join(name));
    std::fs::write(&road, ROAD).unwrap();
    let config = common::config(&set("seed=1", "sensing.gnss={ noise_m = 0.3, bias_m = 0.1 }"));
    let _ = common::record(&config, &road, &path, 1);
    let log = Log::read(&path).unwrap();
    let states: Vec<EgoState> = log.publications("localizer.state").map(|p| p.decode().unwrap()).collect();
    let local: Vec<LocalPose> = log.publications("localizer.local").map(|p| p.decode().unwrap()).collect();
    assert!(states.len() == local.len() && states.len() > 2000, "{} {}", states.len(), local.len());
    let mut jump_m: f64 = 0.0;
    for (state, local) in states.windows(2).zip(local.windows(2)) {
        let dt_s = (state[1].stamp - state[0].stamp).as_secs();
        // Distance in 10 ms at the mean speed of the two states, in the odometry frame; tyre slip adds almost nothing.
        let moved_m = local[1].odom.point().distance(local[0].odom.point());
        let ahead_m = 0.5 * (state[0].speed_mps + state[1].speed_mps) * dt_s;
        assert!((moved_m - ahead_m).abs() < 1e-4, "{moved_m} {state:?}");
        let expected = state[0].pose_after(dt_s).point();
        jump_m = jump_m.max(expected.distance(state[1].pose.point()));
        // The control pose is close to the estimate: at most 0.3 m in each direction.
        let lag_m = local[1].to_map(local[1].odom).point().distance(state[1].pose.point());
        assert!(lag_m < 0.3 * f64::sqrt(2.0) + 1e-9, "{lag_m}");
    }
    assert!(jump_m > 0.05, "fixes of this noise move the pose: {jump_m}");
}

#[test]
fn car_stops_where_its_pose_is_too_uncertain_for_the_lane_and_reports_it() {
    let folder = tempfile::tempdir().unwrap();
    let [road, path] = ["road.toml", "log.mcap"].map(|name| folder.path().join(name));
    std::fs::write(&road, ROAD).unwrap();
    // Two standard deviations of the bias alone, 2 x 0.6 m, exceed the one metre beside the car.
    let config = common::config(&set("seed=1", "sensing.gnss={ noise_m = 0.1, bias_m = 0.6 }"));
    let metrics = common::record(&config, &road, &path, 1).metrics;
    assert_eq!(metrics.verdict, Verdict::Stopped);
    assert!(metrics.drive.speed_end_mps.abs() < 0.1 && metrics.left_road_at_s.is_none());
    // The stop is planned with 2.5 m/s2.
    assert!(metrics.drive.deceleration_max_mps2 < 4.0, "{:?}", metrics.drive);
    let log = Log::read(&path).unwrap();
    let plans = log.publications("planner").map(|p| p.decode::<Plan>().unwrap().status);
    assert_eq!(plans.last(), Some(PlanStatus::PoseUncertain));
    let why = Logged::read(&path, &Registry::standard(), None).unwrap().why(&metrics).unwrap();
    assert!(why.sentence.starts_with("it stopped because its pose was too uncertain"), "{}", why.sentence);
    // Without the required margin to the edge, the same car continues.
    let config = common::config(
        &[&set("seed=1", "sensing.gnss={ noise_m = 0.1, bias_m = 0.6 }")[..], &["planning.lane_sigmas=0"]]
            .concat(),
    );
    let metrics = common::record(&config, &road, &path, 1).metrics;
    assert!(metrics.plans.counts.pose_uncertain == 0 && metrics.drive.path_length_m > 150.0);
}

/// A slow car ahead, on a country road at 112 km/h.
const OVERTAKING: &str = r#"name = "overtaking"
road = { segments = [{ length_m = 1200.0 }], lane_width_m = 3.75, left_m = 5.625, right_m = 1.875 }
ego = { target_speed_mps = 31.0, end_m = 900.0 }
end = { timeout_s = 60.0 }

[[actor]]
name = "slow"
kind = "car"
s_m = 170.0
d_m = 0.0
motion = [{ drive = { along = "road", speed_mps = 19.0, distance_m = 1000.0 } }]
"#;

#[test]
fn overtaking_at_high_speed_keeps_the_limits_of_comfort() {
    let folder = tempfile::tempdir().unwrap();
    let [road, path] = ["road.toml", "log.mcap"].map(|name| folder.path().join(name));
    std::fs::write(&road, OVERTAKING).unwrap();
    for planner in ["planning.planner=fot", "planning.planner=rrt_star"] {
        let metrics = common::record(&common::config(&[planner]), &road, &path, 1).metrics;
        assert_eq!(metrics.verdict, Verdict::Avoided, "{planner}");
        // Plans keep 2.5 m/s2 and 5 m/s3; the car exceeds them by at most half.
        let (jerk, across) = (metrics.lateral_jerk.raw_max_mps3, metrics.drive.lateral_accel_max_mps2);
        assert!(jerk.is_some_and(|jerk| jerk < 7.5) && across < 3.75, "{planner}: {jerk:?} {across}");
        assert!(metrics.min_distance_m.is_some_and(|least_m| least_m > 0.9), "{planner}");
    }
}
