use swerve_geom::{FrenetPoint, Point2, Polyline};

use super::*;
use crate::router::find;
use crate::{Borders, Lane, Neighbour};

fn lane(id: u32, points: &[(f64, f64)], successors: &[u32]) -> Lane {
    let points: Vec<Point2> = points.iter().map(|&(x, y)| Point2::new(x, y)).collect();
    let successors = successors.iter().map(|id| LaneId(*id)).collect();
    let borders = Borders::constant(1.75, 1.75);
    Lane { successors, ..Lane::new(LaneId(id), Polyline::new(&points).unwrap(), borders) }
}

/// From lane 1, straight on over lane 2, or a little longer over lane 3, to lane 4.
fn fork() -> Arc<Map> {
    Arc::new(
        Map::new(vec![
            lane(1, &[(0.0, 0.0), (100.0, 0.0)], &[2, 3]),
            lane(2, &[(100.0, 0.0), (200.0, 0.0)], &[4]),
            lane(3, &[(100.0, 0.0), (150.0, 20.0), (200.0, 0.0)], &[4]),
            lane(4, &[(200.0, 0.0), (300.0, 0.0)], &[]),
        ])
        .unwrap(),
    )
}

fn stop(lane: u32, s_m: f64) -> Stop {
    Stop { lane: LaneId(lane), s_m }
}

fn navigator(via: &[Stop]) -> Navigator {
    let map = fork();
    let stops = [&[stop(1, 10.0)], via, &[stop(4, 50.0)]].concat();
    let (route, _) = Route::over(&map, &find_over(&map, &stops, &[]).unwrap(), 0.0, 15.0).unwrap();
    Navigator::new(map, route, &stops, 0.0, 15.0)
}

fn lanes(navigator: &Navigator) -> Vec<u32> {
    navigator.route().stretches().iter().map(|stretch| stretch.lane.0).collect()
}

fn at(x_m: f64, y_m: f64) -> Pose2 {
    Pose2::new(x_m, y_m, 0.0)
}

#[test]
fn ways_avoid_closed_places() {
    let map = fork();
    let lanes = |closed: &[Stop]| {
        let way = find(&map, stop(1, 10.0), stop(4, 50.0), closed)?;
        Some(way.lanes.iter().map(|(_, lane)| lane.0).collect::<Vec<_>>())
    };
    assert_eq!(lanes(&[]).unwrap(), [1, 2, 4]);
    assert_eq!(lanes(&[stop(2, 50.0)]).unwrap(), [1, 3, 4]);
    assert_eq!(lanes(&[stop(2, 50.0), stop(3, 1.0)]), None);
    // Behind the start and beyond the destination, nothing is passed.
    assert_eq!(lanes(&[stop(1, 5.0), stop(4, 60.0)]).unwrap(), [1, 2, 4]);
    assert_eq!(lanes(&[stop(1, 20.0)]), None);
    assert_eq!(lanes(&[stop(4, 40.0)]), None);
}

#[test]
fn closed_place_ahead_changes_the_route_once() {
    let mut navigator = navigator(&[]);
    assert!(!navigator.update(0.0, at(10.0, 0.0), 10.0));
    navigator.close(&[stop(2, 50.0)]);
    assert!(navigator.update(0.1, at(11.0, 0.0), 10.0));
    assert_eq!(lanes(&navigator), [1, 3, 4]);
    // The new route begins with the lane of the ego, as the old one did.
    assert_eq!(navigator.route().line().at(0.0).pose.point(), Point2::new(0.0, 0.0));
    navigator.close(&[stop(2, 50.0)]);
    assert!(!navigator.update(0.2, at(12.0, 0.0), 10.0));
}

#[test]
fn route_is_kept_where_no_other_one_leads_to_the_destination() {
    let mut navigator = navigator(&[]);
    navigator.close(&[stop(2, 50.0), stop(3, 50.0)]);
    assert!(!navigator.update(0.0, at(10.0, 0.0), 10.0));
    assert_eq!(lanes(&navigator), [1, 2, 4]);
}

#[test]
fn closed_place_behind_the_ego_or_beyond_the_destination_changes_nothing() {
    let mut navigator = navigator(&[]);
    navigator.close(&[stop(2, 10.0), stop(4, 60.0)]);
    assert!(!navigator.update(0.0, at(150.0, 0.0), 10.0));
}

/// 15 m/s need 15 m and 56 m: at 60 m, the route is kept beyond the fork, and with it the closed lane.
#[test]
fn route_parts_from_the_present_one_where_the_ego_can_slow_down() {
    let mut fast = navigator(&[]);
    fast.close(&[stop(2, 90.0)]);
    assert!(fast.update(0.0, at(20.0, 0.0), 15.0));
    assert_eq!(lanes(&fast), [1, 3, 4]);
    // No way leads on from lane 2: the last resort is a way from the ego itself.
    let mut late = navigator(&[]);
    late.close(&[stop(2, 90.0)]);
    assert!(late.update(0.0, at(60.0, 0.0), 15.0));
    assert_eq!(lanes(&late), [1, 3, 4]);
}

#[test]
fn ego_off_the_route_gets_a_route_from_its_lane_after_one_second() {
    let mut navigator = navigator(&[]);
    let middle = lane(3, &[(100.0, 0.0), (150.0, 20.0), (200.0, 0.0)], &[]).line;
    let pose = |s_m: f64| {
        let at = middle.at(s_m).pose;
        Pose2::new(at.x_m, at.y_m, at.heading_rad)
    };
    assert!(!navigator.update(0.0, at(90.0, 0.0), 10.0));
    let s_m = middle.project(Point2::new(125.0, 10.0)).s_m;
    assert!(!navigator.update(3.0, pose(s_m), 10.0));
    assert!(!navigator.update(3.9, pose(s_m + 9.0), 10.0));
    assert!(navigator.update(4.0, pose(s_m + 10.0), 10.0));
    assert_eq!(lanes(&navigator), [3, 4]);
    // Against the traffic, no route begins.
    let mut turned = self::navigator(&[]);
    let back = |s_m: f64| Pose2::new(pose(s_m).x_m, pose(s_m).y_m, 3.0);
    assert!(!turned.update(0.0, back(s_m), 5.0) && !turned.update(2.0, back(s_m - 5.0), 5.0));
}

/// Two lanes side by side on two roads, of which only the right one leads to the destination.
#[test]
fn ego_that_overtakes_keeps_its_route_until_the_lanes_part() {
    let beside = |mut lane: Lane, left: Option<u32>, right: Option<u32>| {
        let neighbour = |id: u32| Neighbour { lane: LaneId(id), opposite: false };
        (lane.left, lane.right) = (left.map(neighbour), right.map(neighbour));
        lane
    };
    let map = Map::new(vec![
        beside(lane(1, &[(0.0, 0.0), (300.0, 0.0)], &[2]), Some(11), None),
        beside(lane(11, &[(0.0, 3.5), (300.0, 3.5)], &[12]), None, Some(1)),
        beside(lane(2, &[(300.0, 0.0), (600.0, 0.0)], &[3]), Some(12), None),
        beside(lane(12, &[(300.0, 3.5), (600.0, 3.5)], &[13]), None, Some(2)),
        lane(3, &[(600.0, 0.0), (700.0, 0.0)], &[]),
        lane(13, &[(600.0, 3.5), (700.0, 10.0)], &[]),
    ]);
    let map = Arc::new(map.unwrap());
    let stops = [stop(1, 10.0), stop(3, 50.0)];
    let (route, _) = Route::over(&map, &find_over(&map, &stops, &[]).unwrap(), 0.0, 25.0).unwrap();
    let mut navigator = Navigator::new(map, route, &stops, 0.0, 25.0);
    // A change takes 75 m: from 525 m on, the ego does not return in time.
    let mut renewed =
        (0..560).filter(|s_m| navigator.update(f64::from(*s_m) / 25.0, at(f64::from(*s_m), 3.5), 25.0));
    assert_eq!(renewed.next(), Some(525));
    drop(renewed);
    assert_eq!(lanes(&navigator), [12, 2, 3]);
}

#[test]
fn places_on_the_way_are_kept_until_they_are_passed() {
    let via = stop(3, 30.0);
    let mut navigator = navigator(&[via]);
    assert_eq!(lanes(&navigator), [1, 3, 4]);
    // The way over lane 3 is demanded, and lane 3 is closed behind it.
    navigator.close(&[stop(3, 20.0)]);
    assert!(!navigator.update(0.0, at(10.0, 0.0), 5.0));
    let place = navigator.route().line().to_map(FrenetPoint { s_m: 140.0, d_m: 0.0 });
    assert!(!navigator.update(10.0, at(place.x_m, place.y_m), 5.0));
    assert_eq!(navigator.ahead.len(), 1);
}
