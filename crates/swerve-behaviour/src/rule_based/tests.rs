mod among_traffic;
mod creep;
mod drive;
mod merge;
mod posed;
mod property;
mod trust;

use core::f64::consts::PI;
use std::sync::Arc;

use swerve_geom::{Pose2, math};
use swerve_map::{LaneId, Map, StopLine, StopSign};
use swerve_msg::{ActorKind, Decision, DrivingState, StopReason, TrafficLight, TrafficLights};

use super::*;
use posed::{Posed, map_with_crossing, on_arm};

/// Headings of traffic that drives into a crossing from the west, south, east and north, in quarters.
pub(super) const FROM_WEST: i32 = 0;
pub(super) const FROM_SOUTH: i32 = 1;
pub(super) const FROM_EAST: i32 = 2;
pub(super) const FROM_NORTH: i32 = 3;

/// The ego from one arm of a crossing to the heading of another, its front at a distance before the junction.
fn at_crossing(file: &str, [from, to]: [i32; 2], before_m: f64, speed_mps: f64) -> Posed {
    let posed = Posed::on(file).route(on_arm(from, -80.0), on_arm(to, 60.0));
    posed.ego(on_arm(from, -11.0), before_m, speed_mps)
}

fn causes(decision: &Decision) -> Vec<StopReason> {
    decision.stops.iter().map(|stop| stop.cause).collect()
}

fn ids(decision: &Decision) -> [Vec<u32>; 2] {
    let expected = decision.expected_to_yield.iter().map(|one| one.id.0).collect();
    [decision.yields.iter().map(|id| id.0).collect(), expected]
}

#[test]
fn gives_way_to_the_right_and_expects_it_from_the_left() {
    let straight = [FROM_WEST, FROM_WEST];
    let ego = || at_crossing("crossing_right_first.xodr", straight, 20.0, 9.0);
    let right = ego().car(on_arm(FROM_SOUTH, -30.0), 9.0).decide();
    assert_eq!((causes(&right), ids(&right)), (vec![StopReason::GiveWay], [vec![1], vec![]]));
    assert_eq!((right.state, right.because), (Some(DrivingState::GiveWay), Some(ActorId(1))));
    let left = ego().car(on_arm(FROM_NORTH, -30.0), 9.0).decide();
    assert_eq!((causes(&left), ids(&left)), (vec![], [vec![], vec![1]]));
    assert_eq!(left.state, Some(DrivingState::Cruise));
    // It stops before the ego's lane, which is 1.75 m beyond the middle: where bodies of 5.6 m by 2.2 m touch.
    assert!((left.expected_to_yield[0].after_m - (30.0 + 1.75 - 3.9)).abs() < 1.0, "{left:?}");
    // Once the car from the right has passed, the way is free.
    assert_eq!(causes(&ego().car(on_arm(FROM_SOUTH, 12.0), 9.0).decide()), []);
}

#[test]
fn stop_holds_while_the_ego_slows_down_far_from_it() {
    let straight = [FROM_WEST, FROM_WEST];
    let mut posed = at_crossing("crossing_right_first.xodr", straight, 30.0, 9.0);
    posed = posed.car(on_arm(FROM_SOUTH, -45.0), 9.0);
    assert_eq!(causes(&posed.decide()), [StopReason::GiveWay]);
    posed.speed_mps = 1.0;
    assert_eq!(causes(&posed.decide_after(1.0)), [StopReason::GiveWay]);
}

#[test]
fn car_from_the_left_that_cannot_stop_is_let_through() {
    let straight = [FROM_WEST, FROM_WEST];
    let mut posed = at_crossing("crossing_right_first.xodr", straight, 12.0, 7.0);
    posed = posed.car(on_arm(FROM_NORTH, -25.0), 14.0);
    let decision = posed.decide();
    assert_eq!((causes(&decision), ids(&decision)), (vec![StopReason::GiveWay], [vec![1], vec![]]));
}

#[test]
fn stop_is_at_the_line_or_before_the_first_zone() {
    let straight = [FROM_SOUTH, FROM_SOUTH];
    for (file, before_m) in [("crossing_priority.xodr", 0.5), ("crossing.xodr", 2.0)] {
        let mut posed = at_crossing(file, straight, 20.0, 9.0).car(on_arm(FROM_EAST, -6.0), 0.0);
        let line_m = posed.front_m + 20.0 - before_m;
        let stop_m = posed.decide().stops[0].s_m;
        assert!((stop_m - line_m).abs() < 0.1, "{file}: {stop_m} instead of {line_m}");
    }
    let mut posed = at_crossing("crossing_right_first.xodr", straight, 20.0, 9.0);
    posed = posed.car(on_arm(FROM_EAST, -30.0), 9.0);
    let over_m = posed.decide().stops[0].s_m - (posed.front_m + 20.0);
    assert!((0.0..9.0).contains(&over_m), "{over_m}");
}

#[test]
fn left_turn_waits_for_oncoming_traffic_and_goes_in_a_gap() {
    let turn = [FROM_WEST, FROM_SOUTH];
    let waiting = |gap_s: f64| {
        let mut posed = at_crossing("crossing.xodr", turn, 2.2, 0.0);
        // From the place where its body would touch the ego's way.
        posed = posed.car(on_arm(FROM_EAST, -4.5 - 10.0 * gap_s), 10.0);
        causes(&posed.decide_after(1.0))
    };
    assert_eq!(waiting(3.0), [StopReason::GiveWay]);
    assert_eq!(waiting(4.5), [StopReason::GiveWay]);
    assert_eq!(waiting(6.0), []);
    assert_eq!(waiting(-1.5), []);
}

#[test]
fn after_long_waiting_a_smaller_gap_suffices() {
    let turn = [FROM_WEST, FROM_SOUTH];
    let mut posed = at_crossing("crossing.xodr", turn, 2.2, 0.0).car(on_arm(FROM_EAST, -46.0), 10.0);
    assert_eq!(causes(&posed.decide_after(19.0)), [StopReason::GiveWay]);
    assert_eq!(causes(&posed.decide_after(2.0)), []);
    // While the ego starts, the gap may shrink by half a second.
    posed.aim(1, on_arm(FROM_EAST, -32.0), 10.0);
    assert_eq!(causes(&posed.decide()), []);
    posed.aim(1, on_arm(FROM_EAST, -24.0), 10.0);
    assert_eq!(causes(&posed.decide()), [StopReason::GiveWay]);
}

#[test]
fn accepted_gap_is_not_refused_while_it_closes() {
    let mut posed = at_crossing("crossing.xodr", [FROM_WEST, FROM_SOUTH], 2.2, 0.0);
    posed = posed.car(on_arm(FROM_EAST, -30.0), 10.0);
    assert_eq!(causes(&posed.decide_after(21.0)), [StopReason::GiveWay]);
    let (mut goes, mut car_m) = (false, -50.0);
    for _ in 0..25 {
        posed.aim(1, on_arm(FROM_EAST, car_m), 10.0);
        let stops = causes(&posed.decide());
        assert!(!goes || stops.is_empty(), "{car_m} m, {} m/s", posed.speed_mps);
        goes = stops.is_empty();
        posed.speed_mps += if goes { 0.2 } else { 0.0 };
        posed.front_m += 0.1 * posed.speed_mps;
        car_m += 1.0;
    }
    assert!(goes);
}

#[test]
fn ego_on_the_priority_road_does_not_stop() {
    let straight = [FROM_WEST, FROM_WEST];
    for from in [FROM_SOUTH, FROM_NORTH] {
        let mut posed = at_crossing("crossing_priority.xodr", straight, 20.0, 9.0);
        posed = posed.car(on_arm(from, -35.0), 9.0);
        let decision = posed.decide();
        assert_eq!((causes(&decision), ids(&decision)), (vec![], [vec![], vec![1]]));
    }
    // One that should brake by now, and does not, is not expected to.
    let mut posed = at_crossing("crossing_priority.xodr", straight, 10.0, 9.0);
    posed = posed.car(on_arm(FROM_SOUTH, -20.0), 9.0);
    assert!(ids(&posed.decide())[1].is_empty());
    for k in 0..10 {
        let k = f64::from(k);
        posed.aim(1, on_arm(FROM_SOUTH, -20.0 + 0.8 * k), 9.0 - 0.35 * k);
        posed.decide();
    }
    assert_eq!(ids(&posed.decide())[1], [1]);
}

#[test]
fn entry_of_a_roundabout_waits_for_traffic_in_it() {
    let on_ring = |degrees: f64| {
        let rad = degrees * PI / 180.0;
        Pose2::new(16.0 * math::cos(rad), 16.0 * math::sin(rad), rad + 0.5 * PI)
    };
    let entry = |degrees: f64| {
        let posed = Posed::on("roundabout.xodr").route(on_arm(FROM_WEST, -80.0), on_arm(FROM_WEST, 60.0));
        let mut posed = posed.ego(on_arm(FROM_WEST, -24.0), 6.0, 5.0).car(on_ring(degrees), 6.0);
        causes(&posed.decide())
    };
    // The entry from the west begins at 180 degrees; traffic in the ring turns to the left.
    assert_eq!(entry(150.0), [StopReason::GiveWay]);
    assert_eq!(entry(120.0), [StopReason::GiveWay]);
    assert_eq!(entry(270.0), []);
}

#[test]
fn merge_waits_for_the_car_behind_and_follows_the_one_ahead() {
    let turn = [FROM_SOUTH, FROM_WEST];
    let merges = |ahead_m: f64| {
        let mut posed = at_crossing("crossing_priority.xodr", turn, 1.0, 3.0);
        posed = posed.car(on_arm(FROM_WEST, ahead_m), 9.0);
        causes(&posed.decide())
    };
    assert_eq!(merges(-30.0), [StopReason::GiveWay]);
    assert_eq!(merges(-100.0), []);
    assert_eq!(merges(10.0), []);
}

#[test]
fn blocked_exit_keeps_the_ego_out_of_the_junction() {
    let straight = [FROM_WEST, FROM_WEST];
    let stands_at = |ahead_m: f64| {
        let mut posed = at_crossing("crossing_priority.xodr", straight, 15.0, 7.0);
        posed = posed.car(on_arm(FROM_WEST, ahead_m), 0.0);
        posed.decide()
    };
    let decision = stands_at(14.0);
    assert_eq!((causes(&decision), decision.because), (vec![StopReason::NoRoom], Some(ActorId(1))));
    assert_eq!(decision.state, Some(DrivingState::WaitForRoom));
    assert_eq!(causes(&stands_at(25.0)), []);
    let mut posed = at_crossing("crossing_priority.xodr", straight, 0.5, 0.0);
    posed = posed.car(on_arm(FROM_WEST, 14.0), 0.0);
    assert_eq!(causes(&posed.decide_after(55.0)), [StopReason::NoRoom]);
    assert_eq!(causes(&posed.decide_after(10.0)), []);
}

#[test]
fn cars_at_red_do_not_count_but_oncoming_ones_do() {
    let turn = [FROM_WEST, FROM_SOUTH];
    let mut posed = at_crossing("crossing.xodr", turn, 2.2, 0.0);
    posed = posed.car(on_arm(FROM_SOUTH, -15.8), 0.0).car(on_arm(FROM_NORTH, -15.8), 0.0);
    let line_m = posed.front_m + 0.2;
    let light =
        |signal| TrafficLight { signal: Some(signal), stop_s_m: Some(line_m), ..TrafficLight::default() };
    posed.lights = Some(TrafficLights { lights: vec![light(Signal::Green)], ..TrafficLights::default() });
    assert_eq!(causes(&posed.decide_after(1.0)), []);
    posed = posed.car(on_arm(FROM_EAST, -30.0), 9.0);
    assert_eq!(ids(&posed.decide_after(1.0))[0], [3]);
    // Without lights, the car from the right has priority.
    posed.lights = Some(TrafficLights { lights: vec![light(Signal::Off)], ..TrafficLights::default() });
    assert_eq!(ids(&posed.decide_after(1.0))[0], [1, 3]);
    posed.lights = Some(TrafficLights { lights: vec![light(Signal::Red)], ..TrafficLights::default() });
    posed.front_m -= 5.0;
    let red = posed.decide_after(1.0);
    assert_eq!((causes(&red), red.state), (vec![StopReason::TrafficLight], Some(DrivingState::WaitAtLight)));
}

#[test]
fn stop_sign_takes_a_second_at_rest() {
    let (lanes, mut features) = Map::clone(&Posed::on("crossing_right_first.xodr").map).into_parts();
    // Lane 14 leads in from the south.
    features.stop_lines.push(StopLine { sign: Some(StopSign::Stop), ..StopLine::new(LaneId(14), 148.0) });
    let posed = Posed::with(Arc::new(Map::with_features(lanes, features).unwrap()));
    let posed = posed.route(on_arm(FROM_SOUTH, -80.0), on_arm(FROM_SOUTH, 60.0));
    let mut posed = posed.ego(on_arm(FROM_SOUTH, -13.0), 20.0, 8.0);
    let decision = posed.decide();
    assert_eq!(
        (causes(&decision), decision.state),
        (vec![StopReason::StopSign], Some(DrivingState::StopSign))
    );
    (posed.front_m, posed.speed_mps) = (posed.front_m + 18.5, 0.0);
    assert_eq!(causes(&posed.decide_after(0.5)), [StopReason::StopSign]);
    assert_eq!(causes(&posed.decide_after(1.5)), []);
    posed.speed_mps = 1.0;
    assert_eq!(causes(&posed.decide()), []);
}

#[test]
fn pedestrian_on_a_crossing_or_about_to_use_it_stops_the_ego() {
    let map = map_with_crossing("crossing_right_first.xodr", [(-34.0, -6.0), (-30.0, 6.0)]);
    let walks = |y_m: f64, heading_rad: f64, speed_mps: f64| {
        let posed = Posed::with(Arc::clone(&map)).route(on_arm(FROM_WEST, -100.0), on_arm(FROM_WEST, 60.0));
        let posed = posed.ego(on_arm(FROM_WEST, -34.0), 20.0, 8.0);
        let pose = Pose2::new(-32.0, y_m, heading_rad);
        let mut posed = posed.other(ActorKind::Pedestrian, pose, speed_mps);
        (posed.decide(), posed.front_m + 18.5)
    };
    let [north, south] = [0.5 * PI, -0.5 * PI];
    let (decision, stop_m) = walks(-5.0, north, 1.4);
    assert_eq!((causes(&decision), decision.because), (vec![StopReason::Crossing], Some(ActorId(1))));
    assert_eq!(decision.state, Some(DrivingState::WaitForPedestrian));
    assert!((decision.stops[0].s_m - stop_m).abs() < 0.6, "{decision:?}");
    for (y_m, heading_rad, speed_mps, stops) in [
        // On the ego's lane; beside the crossing towards it; away from it; standing on the pavement; already past.
        (-1.75, north, 1.4, true),
        (-7.0, north, 1.4, true),
        (-7.0, south, 1.4, false),
        (-7.0, north, 0.0, false),
        (1.0, north, 1.4, false),
        (4.0, south, 1.4, true),
    ] {
        let found = !causes(&walks(y_m, heading_rad, speed_mps).0).is_empty();
        assert_eq!(found, stops, "at {y_m} m with {speed_mps} m/s to {heading_rad}");
    }
}

#[test]
fn of_two_that_wait_for_each_other_one_goes() {
    let waits = |own: i32| {
        let mut posed = at_crossing("crossing_right_first.xodr", [own, own], -3.0, 0.0);
        for from in [FROM_WEST, FROM_SOUTH, FROM_EAST, FROM_NORTH] {
            if from != own {
                posed = posed.car(on_arm(from, -11.5), 0.0);
            }
        }
        assert_eq!(causes(&posed.decide_after(4.0)), [StopReason::GiveWay]);
        causes(&posed.decide_after(8.0)).is_empty()
    };
    let going = [FROM_WEST, FROM_SOUTH, FROM_EAST, FROM_NORTH].map(waits);
    // Each waits for the one to its right: those go that are farther to the west and south than that one.
    assert_eq!(going, [true, true, false, false]);
}

#[test]
fn cars_that_queue_before_a_line_are_not_passed_and_parked_ones_are() {
    let straight = [FROM_WEST, FROM_WEST];
    let queue = |places_m: [f64; 3], speed_mps: f64, stands_s: f64| {
        let mut posed = at_crossing("crossing.xodr", straight, 60.0, 0.0);
        for place_m in places_m {
            posed = posed.car(on_arm(FROM_WEST, place_m), speed_mps);
        }
        posed.decide_after(stands_s).waiting.iter().map(|id| id.0).collect::<Vec<_>>()
    };
    // The stop line is 11 to 13 m before the centre of the crossing.
    assert_eq!(queue([-16.0, -23.0, -32.0], 0.0, 1.0), [1, 2, 3]);
    assert_eq!(queue([-16.0, -23.0, -32.0], 2.0, 0.0), [1, 2, 3]);
    // The third is 16 m behind the second, or the first 20 m before the line, or they drive.
    assert_eq!(queue([-16.0, -23.0, -44.0], 0.0, 1.0), [1, 2]);
    assert_eq!(queue([-35.0, -43.0, -50.0], 0.0, 1.0), [0; 0]);
    assert_eq!(queue([-16.0, -23.0, -32.0], 8.0, 0.0), [0; 0]);
    // In the junction, nobody waits before its line.
    assert_eq!(queue([0.0, -16.0, -23.0], 0.0, 1.0), [2, 3]);
    assert_eq!(queue([-16.0, -23.0, -32.0], 0.0, 121.0), [0; 0]);
}
