use swerve_core::{Span, Time};
use swerve_geom::{Polyline, Pose2, math};
use swerve_map::router::{self, Stop};
use swerve_map::{Borders, Neighbour};
use swerve_msg::{ActorId, Extent};

use super::*;
use crate::{PredictorName, predict};

/// Constant velocity on whatever ground.
struct Constant;

impl Predictor for Constant {
    fn predict(&mut self, tracks: &TrackList, horizon: &Horizon, ground: Ground<'_>) -> PredictionList {
        predict(PredictorName::ConstantVelocity, tracks, horizon, ground)
    }
}

fn lane(id: u32, points: &[(f64, f64)], successors: &[u32]) -> Lane {
    let points: Vec<Point2> = points.iter().map(|&(x, y)| Point2::new(x, y)).collect();
    let successors = successors.iter().map(|id| LaneId(*id)).collect();
    Lane { successors, ..Lane::new(LaneId(id), Polyline::new(&points).unwrap(), Borders::constant(2.0, 2.0)) }
}

/// A ring of 20 m radius, in quarters 0 to 3 from (20, 0) on, and an exit at (0, 20), straight to the west.
fn ring() -> Arc<Map> {
    let quarter = |k: u32| {
        let at = |j: u32| {
            let (sin, cos) =
                math::sin_cos(core::f64::consts::FRAC_PI_2 * (f64::from(k) + f64::from(j) / 20.0));
            (20.0 * cos, 20.0 * sin)
        };
        let points: Vec<(f64, f64)> = (0..=20).map(at).collect();
        let next = (k + 1) % 4;
        lane(k, &points, if k == 0 { &[4, 1][..] } else { core::slice::from_ref(&next) })
    };
    let mut lanes: Vec<Lane> = (0..4).map(quarter).collect();
    lanes.push(lane(4, &[(0.0, 20.0), (-80.0, 20.0)], &[]));
    Arc::new(Map::new(lanes).unwrap())
}

fn predicted(map: &Arc<Map>, place: (f64, f64), velocity_mps: (f64, f64)) -> Vec<Point2> {
    let far = Polyline::new(&[Point2::new(500.0, 0.0), Point2::new(600.0, 0.0)]).unwrap();
    beside(&Route::uniform(far, 2.0, 2.0), map, place, velocity_mps)
}

/// Prediction of a car beside an ego on this route.
fn beside(ego: &Route, map: &Arc<Map>, (x, y): (f64, f64), (vx, vy): (f64, f64)) -> Vec<Point2> {
    let velocity_mps = Vector2::new(vx, vy);
    let pose = Pose2::new(x, y, velocity_mps.heading());
    let extent = Extent { length_m: 4.5, width_m: 1.8, height_m: 1.5 };
    let history = Vec::new();
    let track = Track { id: ActorId(7), kind: ActorKind::Car, pose, velocity_mps, extent, history };
    let tracks = TrackList { stamp: Time::ZERO, tracks: vec![track] };
    let horizon = Horizon { steps: 20, step: Span::from_ms(200) };
    let list = LaneFollowing::new(Arc::clone(map)).predict(&mut Constant, &tracks, &horizon, ego);
    let [only] = &list.predictions[..] else { panic!("{list:?}") };
    only.path.iter().map(|place| place.pose.point()).collect()
}

#[test]
fn vehicle_on_a_ring_is_expected_to_go_around() {
    // 4 s at 8 m/s are 32 m, a quarter of the ring.
    let places = predicted(&ring(), (20.0, 0.1), (0.0, 8.0));
    for place in &places {
        assert!((math::hypot(place.x_m, place.y_m) - 20.0).abs() < 0.5, "{place:?}");
    }
    let end = places[places.len() - 1];
    assert!(end.distance(Point2::new(0.0, 20.0)) < 1.0, "{end:?}");
    let later = predicted(&ring(), (0.5, 20.0), (-8.0, 0.1));
    assert!(later[20].distance(Point2::new(-20.0, 0.0)) < 2.0, "past the exit: {:?}", later[20]);
}

#[test]
fn vehicle_on_the_exit_leaves() {
    let end = predicted(&ring(), (-12.0, 20.0), (-8.0, 0.0))[20];
    assert!(end.distance(Point2::new(-44.0, 20.0)) < 0.5, "{end:?}");
}

#[test]
fn vehicle_beside_all_lanes_goes_straight_on() {
    let end = predicted(&ring(), (40.0, 40.0), (-8.0, 0.0))[20];
    assert!(end.distance(Point2::new(8.0, 40.0)) < 0.5, "{end:?}");
}

#[test]
fn oncoming_car_keeps_its_lane_where_the_route_of_the_ego_turns() {
    let turn: Vec<(f64, f64)> = (0..=8)
        .map(|k| {
            let (sin, cos) = math::sin_cos(core::f64::consts::FRAC_PI_2 * f64::from(k) / 8.0);
            (10.0 * sin, -12.0 + 10.0 * cos)
        })
        .collect();
    let lanes = [
        lane(0, &[(-50.0, -2.0), (0.0, -2.0)], &[1]),
        lane(1, &turn, &[2]),
        lane(2, &[(10.0, -12.0), (10.0, -60.0)], &[]),
        lane(3, &[(60.0, 2.0), (-60.0, 2.0)], &[]),
    ];
    let map = Arc::new(Map::new(lanes.to_vec()).unwrap());
    let ego = Route::along(&map, &[0, 1, 2].map(LaneId)).unwrap();
    for k in 0..60 {
        let x_m = 20.0 - 0.5 * f64::from(k);
        for place in beside(&ego, &map, (x_m, 2.0), (-10.0, 0.0)) {
            assert!((place.y_m - 2.0).abs() < 0.05, "from {x_m}: {place:?}");
        }
    }
    // A car ahead on the ego's lanes turns with them.
    let end = beside(&ego, &map, (-10.0, -2.0), (8.0, 0.0))[20];
    assert!((end.x_m - 10.0).abs() < 1.0 && end.y_m < -12.0, "{end:?}");
}

#[test]
fn cars_keep_their_lanes_where_the_route_of_the_ego_changes_lanes() {
    // Two lanes to the east, 4 m apart; the right one ends after 200 m if it is an entry.
    let beside = |lane| Some(Neighbour { lane: LaneId(lane), opposite: false });
    let two_lanes = |is_entry: bool| {
        let right = Lane {
            left: beside(1),
            speed_limit_mps: Some(20.0),
            ..lane(0, &[(0.0, -4.0), (200.0, -4.0)], if is_entry { &[] } else { &[2] })
        };
        let left = Lane {
            right: beside(0),
            speed_limit_mps: Some(20.0),
            ..lane(1, &[(0.0, 0.0), (200.0, 0.0)], &[3])
        };
        let mut lanes = vec![right, left, lane(3, &[(200.0, 0.0), (600.0, 0.0)], &[])];
        if !is_entry {
            lanes.push(lane(2, &[(200.0, -4.0), (600.0, -4.0)], &[]));
        }
        Arc::new(Map::new(lanes).unwrap())
    };
    let end_at = |is_entry, (x_m, y_m), left_mps| {
        let map = two_lanes(is_entry);
        let [from, to] = [(0, 0.0), (3, 300.0)].map(|(lane, s_m)| Stop { lane: LaneId(lane), s_m });
        let way = router::find(&map, from, to, &[]).unwrap();
        let ego = Route::over(&map, &way, 50.0, 20.0).unwrap().0;
        assert_eq!(ego.lane_changes(&map).len(), 1);
        super::tests::beside(&ego, &map, (x_m, y_m), (20.0, left_mps))[20].y_m
    };
    let end_y_m = |is_entry, place| end_at(is_entry, place, 0.0);
    for x_m in [2.0, 20.0, 60.0, 100.0] {
        assert!(end_y_m(true, (x_m, 0.0)).abs() < 0.1, "in the left lane, {x_m}");
        assert!((end_y_m(false, (x_m, -4.0)) + 4.0).abs() < 0.1, "in the right lane, {x_m}");
    }
    // One that changes itself ends in the middle of its new lane.
    assert!((end_at(false, (20.0, -1.0), -0.8) + 4.0).abs() < 0.1, "{}", end_at(false, (20.0, -1.0), -0.8));
    assert!(end_at(false, (20.0, -0.2), -0.2).abs() < 0.5);
    // On an entry that ends within 4 s, a car changes as the route does.
    assert!(end_y_m(true, (150.0, -4.0)).abs() < 4.1);
}
