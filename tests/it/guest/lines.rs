//! Lines as scenarios.

use swerve_drive::Line;
use swerve_geom::{Point2, math};

fn points(of: impl Fn(f64) -> (f64, f64), count: usize) -> Vec<Point2> {
    (0..count).map(|k| of(k as f64)).map(|(x_m, y_m)| Point2::new(x_m, y_m)).collect()
}

#[test]
fn route_of_a_line_leads_through_its_points() {
    let straight = points(|k| (100.0 - 50.0 * k, 7.0), 5);
    // A circle of 60 m radius in steps of 6 m, from a place far from the origin.
    let circle = points(|k| (500.0 + 60.0 * math::sin(0.1 * k), 60.0 * (1.0 - math::cos(0.1 * k))), 25);
    let bends = points(|k| (5.0 * k, 10.0 * math::sin(0.1 * k)), 60);
    for (line, exact_m) in [(straight, 1e-6), (circle, 0.02), (bends, 0.03)] {
        let last = line[line.len() - 1];
        let scenario = Line::new(line.clone(), 10.0).scenario().unwrap();
        let route = scenario.road.route();
        for point in &line[1..line.len() - 1] {
            let place = route.project(*point);
            assert!(place.d_m.abs() < exact_m, "{place:?} of {point:?}");
            assert!((route.left_m(place.s_m) - 1.75).abs() < 0.02, "{}", route.left_m(place.s_m));
            assert!((route.right_m(place.s_m) - 1.75).abs() < 0.02);
        }
        let end = route.line().at(scenario.ego.end_m).pose.point();
        assert!((end.distance(last) - 0.5).abs() < 0.05, "{end:?} {last:?}");
        assert!(scenario.ego.s_m < 1.0 && scenario.actors.is_empty());
    }
}

#[test]
fn lanes_beside_a_line_are_ground() {
    let line = points(|k| (20.0 * k, 0.0), 6);
    let line = Line { lane_width_m: 4.0, lanes_left: 1, lanes_right: 2, ..Line::new(line, 25.0) };
    let scenario = line.scenario().unwrap();
    let route = scenario.road.route();
    assert!((route.left_m(50.0) - 6.0).abs() < 0.01, "{}", route.left_m(50.0));
    assert!((route.right_m(50.0) - 10.0).abs() < 0.01, "{}", route.right_m(50.0));
    assert!((scenario.road.lane_width_m(50.0) - 4.0).abs() < 0.01);
    assert_eq!(scenario.ego.target_speed_mps, 25.0);
}

#[test]
fn lines_that_cannot_be_followed_are_refused() {
    let of = |points: Vec<Point2>| Line::new(points, 10.0).scenario();
    let refused = |line: Vec<Point2>, words: &str| {
        let error = format!("{:#}", of(line).unwrap_err());
        assert!(error.contains(words), "{error}");
    };
    let at = Point2::new;
    refused(vec![at(0.0, 0.0)], "route: 1 points: expected two or more");
    refused(vec![at(0.0, 0.0), at(0.0, f64::NAN)], "route: point 1 is (0, NaN)");
    refused(vec![at(0.0, 0.0), at(0.0, 0.0)], "route: points 0 and 1 are the same");
    refused(vec![at(0.0, 0.0), at(2.0, 0.0)], "route: 2.0 m long");
    refused(vec![at(0.0, 0.0), at(20.0, 0.0), at(20.0, 20.0)], "turns by 1.57 rad at point 1");
    let wide = Line { lane_width_m: 50.0, ..Line::new(vec![at(0.0, 0.0), at(50.0, 0.0)], 10.0) };
    assert!(format!("{:#}", wide.scenario().unwrap_err()).contains("expected 1 to 20 lanes of 1 to 20 m"));
    let fast = Line::new(vec![at(0.0, 0.0), at(50.0, 0.0)], 1e9);
    assert!(format!("{:#}", fast.scenario().unwrap_err()).contains("target_speed_mps"));
}
