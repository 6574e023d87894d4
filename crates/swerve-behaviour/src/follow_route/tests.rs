use swerve_core::Time;
use swerve_geom::{FrenetPoint, Point2, Polyline};
use swerve_map::{Borders, Junction, JunctionId, Lane, LaneId, Map};
use swerve_msg::{EgoState, Route, SpeedLimit};
use swerve_vehicle::{Limits, Shape};

use super::*;

/// Three lanes of 100 m in a row: 10 m/s; 5 m/s, inside a junction; without a limit.
fn route() -> Route {
    let line =
        |k: f64| Polyline::new(&[Point2::new(100.0 * k, 0.0), Point2::new(100.0 * k + 100.0, 0.0)]).unwrap();
    let lane = |k: u32, limit_mps: Option<f64>| {
        let mut lane = Lane::new(LaneId(k), line(f64::from(k)), Borders::constant(2.0, 2.0));
        lane.speed_limit_mps = limit_mps;
        lane.successors = if k < 2 { vec![LaneId(k + 1)] } else { Vec::new() };
        lane
    };
    let (lanes, incoming) = (vec![LaneId(1)], vec![LaneId(0)]);
    let junction =
        Junction { id: JunctionId(1), name: String::new(), lanes, incoming, rights_of_way: Vec::new() };
    let features = swerve_map::Features { junctions: vec![junction], ..Default::default() };
    let lanes = vec![lane(0, Some(10.0)), lane(1, Some(5.0)), lane(2, None)];
    let map = Map::with_features(lanes, features).unwrap();
    Route::along(&map, &[LaneId(0), LaneId(1), LaneId(2)]).unwrap()
}

fn decide(route: &Route, s_m: f64) -> Decision {
    let (ego, shape, limits) = (EgoState::default(), Shape::default(), Limits::default());
    FollowRoute::new(FollowRouteParams::default()).decide(&Situation {
        stamp: Time::from_ms(50),
        ego: &ego,
        route,
        number: 4,
        place: FrenetPoint { s_m, d_m: 0.0 },
        cruise_mps: 8.0,
        roads: None,
        predictions: &[],
        lights: None,
        shape: &shape,
        limits: &limits,
    })
}

#[test]
fn limits_are_those_of_the_lanes_ahead_and_the_cruise_speed() {
    let limit = |from_m, speed_mps| SpeedLimit { from_m, speed_mps };
    let decision = decide(&route(), 20.0);
    assert_eq!((decision.stamp, decision.route), (Time::from_ms(50), 4));
    assert_eq!(decision.limits, [limit(0.0, 8.0), limit(100.0, 5.0), limit(200.0, 8.0)]);
    assert_eq!(decide(&route(), 150.0).limits, [limit(100.0, 5.0), limit(200.0, 8.0)]);
    let line = Polyline::new(&[Point2::new(0.0, 0.0), Point2::new(50.0, 0.0)]).unwrap();
    assert_eq!(decide(&Route::uniform(line, 2.0, 2.0), 20.0).limits, [limit(0.0, 8.0)]);
}

#[test]
fn overtaking_ends_at_the_next_junction() {
    let until = |s_m| decide(&route(), s_m).overtake_until_m;
    assert_eq!([until(20.0), until(150.0), until(250.0)], [Some(100.0), Some(150.0), None]);
}
