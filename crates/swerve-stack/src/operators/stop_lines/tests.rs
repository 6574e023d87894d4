use swerve_geom::{Point2, Polyline};

use super::*;

fn lines() -> StopLines {
    let line = Polyline::new(&[Point2::new(0.0, 0.0), Point2::new(500.0, 0.0)]).unwrap();
    StopLines::on(Table::default(), Route::uniform(line, 6.0, 2.0), &VehicleParams::default())
}

/// One light with its line at 300 m.
fn shows(ms: i64, signal: Signal) -> TrafficLights {
    let light = TrafficLight { signal: Some(signal), stop_s_m: Some(300.0), ..TrafficLight::default() };
    TrafficLights { stamp: Time::from_ms(ms), lights: vec![light] }
}

/// Returns true if the ego stops at a light that turns yellow when the line is this far ahead of its front.
fn stops_at_yellow(speed_mps: f64, ahead_m: f64) -> bool {
    let mut lines = lines();
    lines.hold(&shows(0, Signal::Yellow), 300.0 - ahead_m, speed_mps);
    !lines.held.is_empty()
}

#[test]
fn ego_stops_at_yellow_where_3_mps2_suffice() {
    // 14 m/s: 14² / 6 + 0.5 s * 14 = 39.7 m; from 38.5 m the line is reached within 2.75 s, before red is possible.
    assert!(stops_at_yellow(14.0, 40.0) && !stops_at_yellow(14.0, 38.0));
    assert!(stops_at_yellow(8.0, 15.0) && !stops_at_yellow(8.0, 14.0));
}

/// 20 m/s: from 55 to 76.7 m the ego is late for three seconds of yellow, less the reserve, and needs more than 3 m/s².
#[test]
fn ego_always_stops_or_passes_at_yellow() {
    assert!(stops_at_yellow(20.0, 77.0) && stops_at_yellow(20.0, 56.0) && !stops_at_yellow(20.0, 54.0));
    for tenths in 1..=300 {
        let speed_mps = 0.1 * f64::from(tenths);
        for ahead_m in 1..=250 {
            let ahead_m = f64::from(ahead_m);
            let passes = ahead_m <= (YELLOW_MIN_S - EARLY_S) * speed_mps;
            assert!(passes || stops_at_yellow(speed_mps, ahead_m), "{speed_mps} m/s {ahead_m} m");
        }
    }
}

#[test]
fn decision_at_yellow_holds_while_the_line_comes_nearer() {
    let mut lines = lines();
    // 2 % slower than at the decision, which the reserve covers.
    for tenth in 0..28 {
        let front_m = 300.0 - 38.0 + 1.372 * f64::from(tenth);
        lines.hold(
            &shows(100 * i64::from(tenth), Signal::Yellow),
            front_m,
            if tenth == 0 { 14.0 } else { 13.72 },
        );
        assert!(lines.held.is_empty(), "{tenth}");
    }
}

#[test]
fn light_that_goes_off_does_not_hold() {
    let mut lines = lines();
    for (signal, is_held) in [(Signal::Off, false), (Signal::Red, true), (Signal::Off, false)] {
        lines.hold(&shows(0, signal), 250.0, 8.0);
        assert_eq!(!lines.held.is_empty(), is_held, "{signal:?}");
    }
}

#[test]
fn red_holds_until_green_and_where_full_brake_suffices() {
    let full_m = 14.0 * 14.0 / (2.0 * VehicleParams::default().limits.brake_max_mps2);
    let held = |ahead_m: f64| {
        let mut lines = lines();
        lines.hold(&shows(0, Signal::Red), 300.0 - ahead_m, 14.0);
        lines.held.len()
    };
    assert_eq!((held(full_m + 0.5), held(full_m - 0.5)), (1, 0));
    let mut lines = lines();
    lines.hold(&shows(0, Signal::Red), 240.0, 14.0);
    // Too close for full braking, by an inaccurate report: the stop is kept.
    lines.hold(&shows(100, Signal::Red), 298.0, 14.0);
    assert_eq!(lines.held, [300.0]);
    lines.hold(&TrafficLights { stamp: Time::from_ms(200), lights: Vec::new() }, 298.0, 0.0);
    assert_eq!(lines.held, [300.0], "out of sight is not green");
    lines.hold(&shows(300, Signal::Green), 298.0, 0.0);
    assert!(lines.held.is_empty());
}

#[test]
fn wall_begins_at_the_line_and_spans_the_ground() {
    let wall = wall(ActorId(LAST_ID), 300.0, &lines().route, Time::ZERO);
    let corners = wall.extent.footprint(wall.path[0].pose).corners();
    let [mut near_m, mut right_m, mut left_m] = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY];
    for corner in corners {
        (near_m, right_m, left_m) = (near_m.min(corner.x_m), right_m.min(corner.y_m), left_m.max(corner.y_m));
    }
    assert!((near_m - 300.0).abs() < 1e-9 && (right_m + 2.0).abs() < 1e-9 && (left_m - 6.0).abs() < 1e-9);
}

#[test]
fn stop_line_keys_out_of_range_are_reported() {
    let keys: Vec<String> = StopLines::problems(&Table { brake_mps2: 0.0, reaction_s: -1.0 })
        .into_iter()
        .map(|(key, _)| key)
        .collect();
    assert_eq!(keys, ["brake_mps2", "reaction_s"]);
}
