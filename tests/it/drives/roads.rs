//! Roads that cross themselves, and bends that require braking.

use swerve_drive::drive;
use swerve_eval::Verdict;
use swerve_msg::truth::EndReason;
use swerve_scenario::Scenario;

use crate::common::config;

/// A lane of segments (length, curvature), driven to 5 m before its end.
fn road(segments: &[(f64, f64)], speed_mps: f64, timeout_s: f64) -> Scenario {
    road_with(segments, speed_mps, timeout_s, ["", ""])
}

/// Same as [`road`], with additional road keys and tables.
fn road_with(segments: &[(f64, f64)], speed_mps: f64, timeout_s: f64, [keys, tables]: [&str; 2]) -> Scenario {
    let length_m: f64 = segments.iter().map(|segment| segment.0).sum();
    let one = |&(length_m, curvature_1pm): &(f64, f64)| {
        format!("{{ length_m = {length_m:?}, curvature_1pm = {curvature_1pm:?} }}")
    };
    let segments = segments.iter().map(one).collect::<Vec<_>>().join(", ");
    let text = format!(
        "name = \"road\"\n[road]\nsegments = [{segments}]\nlane_width_m = 4.0\n{keys}[ego]\ntarget_speed_mps = {speed_mps:?}\n\
         end_m = {:?}\n[end]\ntimeout_s = {timeout_s:?}\n{tables}",
        length_m - 5.0
    );
    Scenario::parse("road.toml", &text).unwrap_or_else(|problems| panic!("{problems:?}"))
}

/// Drives to the end; returns the distance driven, metres.
fn driven_m(scenario: &Scenario, sets: &[&str]) -> f64 {
    let metrics = drive(&config(sets), scenario).unwrap().metrics;
    assert_eq!(
        (metrics.verdict, metrics.end, metrics.left_road_at_s),
        (Verdict::Completed, Some(EndReason::Goal), None),
        "{sets:?}: {:?}",
        metrics.drive
    );
    metrics.drive.path_length_m
}

#[test]
fn closed_and_crossing_roads_are_driven_once() {
    let turn_m = core::f64::consts::TAU * 24.0;
    let (left, right) = (1.0 / 24.0, -1.0 / 24.0);
    let closed = road(&[(20.0, 0.0), (turn_m, left), (50.0, 0.0)], 7.0, 60.0);
    let spiral = road(&[(20.0, 0.0), (1.06 * turn_m, left), (50.0, 0.0)], 7.0, 60.0);
    let eight = road(&[(15.0, 0.0), (turn_m, left), (turn_m, right), (50.0, 0.0)], 7.0, 90.0);
    for (scenario, length_m) in
        [(&closed, 70.0 + turn_m), (&spiral, 70.0 + 1.06 * turn_m), (&eight, 65.0 + 2.0 * turn_m)]
    {
        for planner in ["fot", "rrt_star", "hybrid_astar", "waypoint"] {
            let way_m = driven_m(scenario, &[&format!("planning.planner={planner}")]);
            // The goal is 5 m before the end in arc length; cut corners shorten the path by less than 2 m per turn.
            assert!((length_m - 10.0..length_m + 2.0).contains(&way_m), "{planner}: {way_m} of {length_m}");
        }
    }
}

#[test]
fn ego_brakes_for_bends_too_fast_for_comfort() {
    // 40 m/s with a radius of 500 m would be 3.2 m/s², more than the 2.5 of comfort.
    let bend = road(&[(350.0, 0.0), (250.0, 0.002), (300.0, 0.0)], 40.0, 60.0);
    for planner in ["fot", "rrt_star", "hybrid_astar", "waypoint"] {
        let set = format!("planning.planner={planner}");
        let metrics = drive(&config(&[&set]), &bend).unwrap().metrics;
        assert_eq!((metrics.verdict, metrics.left_road_at_s), (Verdict::Completed, None), "{planner}");
        let (lateral, brake) = (metrics.drive.lateral_accel_max_mps2, metrics.drive.deceleration_max_mps2);
        assert!(lateral <= 2.75, "{planner}: {lateral}");
        // Braking for curves uses half of comfort's 3.5, and starts in time.
        assert!(brake <= 2.2, "{planner}: {brake}");
    }
}

/// Swerving out and back on the inside of a bend needs more curvature than the bend leaves at its own speed.
#[test]
fn standing_car_in_a_bend_is_passed_slower() {
    let car = "[[actor]]\nname = \"car\"\nkind = \"car\"\ns_m = 110.0\nd_m = 0.0\n";
    let scenario = road_with(&[(60.0, 0.0), (80.0, 0.02), (200.0, 0.0)], 11.9, 60.0, ["left_m = 6.0\n", car]);
    for seed in [3, 6, 7, 10] {
        let metrics = drive(&config(&[&format!("seed={seed}")]), &scenario).unwrap().metrics;
        assert_eq!((metrics.verdict, metrics.left_road_at_s), (Verdict::Avoided, None), "{seed}");
        assert!(metrics.drive.deceleration_max_mps2 < 2.0, "{seed}: {:?}", metrics.drive);
    }
}
