use swerve_geom::Point2;
use swerve_msg::{EgoState, Route};
use swerve_vehicle::{Limits, Shape};

use super::*;

fn full_mps2() -> f64 {
    Limits::default().brake_max_mps2
}

fn hold(lines: &mut LightStops, lights: &TrafficLights, [front_s_m, speed_mps]: [f64; 2]) {
    let length_m = Shape::default().length_m;
    let car = Car { front_s_m, length_m, speed_mps, accel_mps2: 0.0, brake_max_mps2: full_mps2() };
    lines.hold(lights, car);
}

/// One light with its line at 300 m.
fn shows(ms: i64, signal: Signal) -> TrafficLights {
    let light = TrafficLight { signal: Some(signal), stop_s_m: Some(300.0), ..TrafficLight::default() };
    TrafficLights { stamp: Time::from_ms(ms), lights: vec![light] }
}

/// Returns true if the ego stops at a light that turns yellow when the line is this far ahead of its front.
fn stops_at_yellow(speed_mps: f64, ahead_m: f64) -> bool {
    let mut lines = LightStops::new(FollowRouteParams::default());
    hold(&mut lines, &shows(0, Signal::Yellow), [300.0 - ahead_m, speed_mps]);
    !lines.held.is_empty()
}

#[test]
fn ego_stops_at_yellow_where_3_mps2_suffice() {
    // 14 m/s: 14² / 6 + 0.5 s * 14 = 39.7 m. From 32.6 m the tail is a metre past the line within 2.75 s, before red is
    // possible; between the two the ego brakes harder.
    assert!(stops_at_yellow(14.0, 40.0) && stops_at_yellow(14.0, 33.0) && !stops_at_yellow(14.0, 32.0));
    // 8 m/s: 14.7 m; from there the tail is past it in time.
    assert!(stops_at_yellow(8.0, 15.0) && !stops_at_yellow(8.0, 14.0));
}

/// 20 m/s: the tail is a metre past the line after 5.93 m more than the front. From 49.1 to 76.7 m the ego is late for
/// three seconds of yellow, less the reserve, and needs more than 3 m/s².
#[test]
fn ego_always_stops_or_passes_at_yellow() {
    assert!(stops_at_yellow(20.0, 77.0) && stops_at_yellow(20.0, 50.0) && !stops_at_yellow(20.0, 49.0));
    for tenths in 1..=300 {
        let speed_mps = 0.1 * f64::from(tenths);
        for ahead_m in 1..=250 {
            let ahead_m = f64::from(ahead_m);
            let over_m = ahead_m + Shape::default().length_m + BEHIND_M;
            let passes = over_m <= (YELLOW_MIN_S - EARLY_S) * speed_mps;
            assert!(passes || stops_at_yellow(speed_mps, ahead_m), "{speed_mps} m/s {ahead_m} m");
        }
    }
}

#[test]
fn ego_that_slows_down_for_a_turn_stops_at_yellow_earlier() {
    // From 8.6 m/s, 2.75 s are 23.7 m, and 20.6 m with 0.8 m/s². The tail is a metre past the line 5.93 m behind it.
    let stops = |accel_mps2, ahead_m: f64| {
        let mut lines = LightStops::new(FollowRouteParams::default());
        let (length_m, brake_max_mps2) = (Shape::default().length_m, full_mps2());
        let front_s_m = 300.0 - ahead_m;
        lines.hold(
            &shows(0, Signal::Yellow),
            Car { front_s_m, length_m, speed_mps: 8.6, accel_mps2, brake_max_mps2 },
        );
        !lines.held.is_empty()
    };
    assert_eq!([-0.8, 0.0, 0.8].map(|accel_mps2| stops(accel_mps2, 15.0)), [true, false, false]);
    assert!(!stops(-0.8, 14.0));
}

#[test]
fn decision_at_yellow_holds_while_the_line_comes_nearer() {
    let mut lines = LightStops::new(FollowRouteParams::default());
    // 2 % slower than at the decision, which the reserve covers.
    for tenth in 0..28 {
        let front_m = 300.0 - 32.5 + 1.372 * f64::from(tenth);
        let speed_mps = if tenth == 0 { 14.0 } else { 13.72 };
        hold(&mut lines, &shows(100 * i64::from(tenth), Signal::Yellow), [front_m, speed_mps]);
        assert!(lines.held.is_empty(), "{tenth}");
    }
}

#[test]
fn light_that_goes_off_does_not_hold() {
    let mut lines = LightStops::new(FollowRouteParams::default());
    for (signal, is_held) in [(Signal::Off, false), (Signal::Red, true), (Signal::Off, false)] {
        hold(&mut lines, &shows(0, signal), [250.0, 8.0]);
        assert_eq!(!lines.held.is_empty(), is_held, "{signal:?}");
    }
}

#[test]
fn red_holds_until_green_and_where_full_brake_suffices() {
    let full_m = 14.0 * 14.0 / (2.0 * full_mps2());
    let held = |ahead_m: f64| {
        let mut lines = LightStops::new(FollowRouteParams::default());
        hold(&mut lines, &shows(0, Signal::Red), [300.0 - ahead_m, 14.0]);
        lines.held.len()
    };
    assert_eq!((held(full_m + 0.5), held(full_m - 0.5)), (1, 0));
    let mut lines = LightStops::new(FollowRouteParams::default());
    hold(&mut lines, &shows(0, Signal::Red), [240.0, 14.0]);
    // Too close for full braking, by an inaccurate report: the stop is kept.
    hold(&mut lines, &shows(100, Signal::Red), [298.0, 14.0]);
    assert_eq!(lines.held, [300.0]);
    hold(&mut lines, &TrafficLights { stamp: Time::from_ms(200), lights: Vec::new() }, [298.0, 0.0]);
    assert_eq!(lines.held, [300.0], "out of sight is not green");
    hold(&mut lines, &shows(300, Signal::Green), [298.0, 0.0]);
    assert!(lines.held.is_empty());
}

#[test]
fn held_line_moves_to_a_new_route_and_is_dropped_off_it() {
    let route = |from: Point2, to: Point2| Route::uniform(Polyline::new(&[from, to]).unwrap(), 6.0, 2.0);
    let first = route(Point2::new(0.0, 0.0), Point2::new(500.0, 0.0));
    let longer = route(Point2::new(-50.0, 0.0), Point2::new(500.0, 0.0));
    let beside = route(Point2::new(0.0, 8.0), Point2::new(500.0, 8.0));
    let ego = EgoState { speed_mps: 10.0, ..EgoState::default() };
    let (shape, limits) = (Shape::default(), Limits::default());
    let red = shows(0, Signal::Red);
    let mut lines = LightStops::new(FollowRouteParams::default());
    let mut held = |number, route: &Route, lights| {
        let place = route.project(ego.pose.point());
        lines
            .update(&Situation {
                stamp: Time::ZERO,
                ego: &ego,
                route,
                number,
                place,
                cruise_mps: 10.0,
                roads: None,
                predictions: &[],
                lights,
                shape: &shape,
                limits: &limits,
            })
            .to_vec()
    };
    assert_eq!(held(0, &first, Some(&red)), [300.0]);
    assert_eq!(held(1, &longer, None), [350.0]);
    assert_eq!(held(2, &beside, None), [] as [f64; 0]);
}
