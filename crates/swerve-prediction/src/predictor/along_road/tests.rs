use swerve_core::Span;
use swerve_geom::Polyline;
use swerve_msg::{ActorId, Extent, PredictionList};

use super::*;
use crate::predictor::{Ground, Horizon, PredictorName, predict};

const THREE_SECONDS: Horizon = Horizon { steps: 30, step: Span::from_ms(100) };
/// Bend radius of the road's line, metres.
const RADIUS_M: f64 = 80.0;

/// A bend to the left, with an oncoming lane of 4 m on the inside.
fn bend() -> Route {
    let at = |k: i32| {
        let (sin, cos) = math::sin_cos(f64::from(k) / RADIUS_M);
        Point2::new(RADIUS_M * sin, RADIUS_M * (1.0 - cos))
    };
    Route::uniform(Polyline::new(&(0..=200).map(at).collect::<Vec<_>>()).unwrap(), 6.0, 2.0)
}

fn straight() -> Route {
    Route::uniform(Polyline::new(&[Point2::new(0.0, 0.0), Point2::new(200.0, 0.0)]).unwrap(), 6.0, 2.0)
}

/// An oncoming road user with sightings over three seconds at `speed_mps`, now at (100 m, `d_m`).
fn oncoming(route: &Route, kind: ActorKind, speed_mps: f64, d_m: f64) -> TrackList {
    let at = |k: i64| {
        let share = 1.0 - route.line().at(100.0).curvature_1pm * d_m;
        let s_m = 100.0 - speed_mps / share * 0.05 * k as f64;
        Sighting { at: Time::from_ms(50 * k), point: route.unproject(FrenetPoint { s_m, d_m }) }
    };
    let history: Vec<Sighting> = (-60..=0).map(at).collect();
    let velocity_mps = (history[60].point - history[59].point) * 20.0;
    let point = history[60].point;
    let pose = Pose2::new(point.x_m, point.y_m, velocity_mps.heading());
    let extent = Extent { length_m: 4.5, width_m: 1.8, height_m: 1.5 };
    let track = Track { id: ActorId(1), kind, pose, extent, velocity_mps, history };
    TrackList { stamp: Time::ZERO, tracks: vec![track] }
}

/// Probability of each mode, and its smallest and largest offset from the line.
fn offsets(
    name: PredictorName,
    tracks: &TrackList,
    ground: Ground<'_>,
    route: &Route,
) -> Vec<(f64, [f64; 2])> {
    let list = predict(name, tracks, &THREE_SECONDS, ground);
    let of = |mode: &Prediction| {
        let d_m = mode.path.iter().map(|one| route.project(one.pose.point()).d_m);
        (mode.probability, [d_m.clone().fold(f64::INFINITY, f64::min), d_m.fold(f64::NEG_INFINITY, f64::max)])
    };
    list.modes_of(ActorId(1)).iter().map(of).collect()
}

/// All predictors with a motion model.
const OF_MOTION: [PredictorName; 8] = [
    PredictorName::Linear,
    PredictorName::ConstantVelocity,
    PredictorName::Kalman,
    PredictorName::Ctra,
    PredictorName::Imm,
    PredictorName::SocialForce,
    PredictorName::Orca,
    PredictorName::LaneIdm,
];

/// A car ahead at 15 m/s has braked with 6 m/s² for three seconds: it stops after another 15² / 12 = 18.75 m. At
/// constant speed it would cover 45 m in three seconds.
#[test]
fn braking_vehicle_is_predicted_to_stop() {
    let route = straight();
    let at = |k: i64| {
        let t_s = 0.05 * k as f64;
        Sighting { at: Time::from_ms(50 * k), point: Point2::new(100.0 + 15.0 * t_s - 3.0 * t_s * t_s, 0.5) }
    };
    let mut tracks = oncoming(&route, ActorKind::Car, 10.0, 0.5);
    let track = &mut tracks.tracks[0];
    track.history = (-60..=0).map(at).collect();
    (track.velocity_mps, track.pose) = (Vector2::new(15.0, 0.0), Pose2::new(100.0, 0.5, 0.0));
    for name in [
        PredictorName::Linear,
        PredictorName::ConstantVelocity,
        PredictorName::Kalman,
        PredictorName::SocialForce,
        PredictorName::Orca,
    ] {
        let list = predict(name, &tracks, &THREE_SECONDS, Ground::Road(&route));
        let last = list.predictions[0].path[30].pose;
        assert!((last.x_m - 118.75).abs() < 0.2, "{name:?}: {last:?}");
    }
    let open = predict(PredictorName::ConstantVelocity, &tracks, &THREE_SECONDS, Ground::Open);
    assert!(open.predictions[0].path[30].pose.x_m > 145.0, "constant velocity off the road");
}

/// An oncoming car of 1.8 m width drifts with 1 m/s, its centre at 2.5 m, its side 0.4 m over the line at 2 m. It
/// settles at 2.5 - 1 / 6 = 2.33 m; a lane change would end at 1.5 m. Predictors with a lag may be 0.15 m off.
#[test]
fn oncoming_car_over_the_line_steers_back_for_every_predictor() {
    let route = straight().in_lane(swerve_map::Borders::constant(2.0, 2.0));
    let at = |k: i64| {
        let t_s = 0.05 * k as f64;
        Sighting { at: Time::from_ms(50 * k), point: Point2::new(100.0 - 12.0 * t_s, 2.5 - t_s) }
    };
    let mut tracks = oncoming(&route, ActorKind::Car, 12.0, 2.5);
    let track = &mut tracks.tracks[0];
    track.history = (-60..=0).map(at).collect();
    track.velocity_mps = Vector2::new(-12.0, -1.0);
    for name in OF_MOTION {
        for (_, [low_m, high_m]) in offsets(name, &tracks, Ground::Road(&route), &route) {
            assert!(
                (2.33 - 0.15..=2.5 + 0.15).contains(&low_m) && high_m < 2.65,
                "{name:?}: {low_m} {high_m}"
            );
        }
    }
}

#[test]
fn oncoming_car_keeps_its_lane_in_a_bend() {
    let route = bend();
    for (kind, speed_mps) in [(ActorKind::Car, 10.0), (ActorKind::Truck, 14.0), (ActorKind::Cyclist, 5.0)] {
        let tracks = oncoming(&route, kind, speed_mps, 4.0);
        for name in OF_MOTION {
            for (probability, [low_m, high_m]) in offsets(name, &tracks, Ground::Road(&route), &route) {
                assert!(low_m > 3.7 && high_m < 4.3, "{name:?} {kind:?}: {probability} {low_m} {high_m}");
            }
        }
    }
    // On the map, the chord of the last half second, 2.5 / 76 rad off the tangent, leads out of the bend: after 30 m
    // it is at a radius of √(77² + 30²) = 82.6 m, beyond the ego's lane.
    let tracks = oncoming(&route, ActorKind::Car, 10.0, 4.0);
    let [(_, [low_m, _])] = offsets(PredictorName::ConstantVelocity, &tracks, Ground::Open, &route)[..]
    else {
        panic!("one mode");
    };
    assert!((low_m - (80.0 - 82.6)).abs() < 0.1, "{low_m}");
}

/// A filter observes the same motion on the straightened road as on a straight one, so that turning has the same
/// probability.
#[test]
fn mode_probabilities_in_a_bend_equal_those_on_a_straight_road() {
    let [bend, straight] = [bend(), straight()];
    let weights = |route: &Route, ground: Ground<'_>| {
        let tracks = oncoming(route, ActorKind::Car, 10.0, 4.0);
        let modes = offsets(PredictorName::Imm, &tracks, ground, route);
        modes.iter().map(|(probability, _)| *probability).collect::<Vec<f64>>()
    };
    let wanted = weights(&straight, Ground::Open);
    for (a, b) in weights(&bend, Ground::Road(&bend)).iter().zip(&wanted) {
        assert!((a - b).abs() < 0.01, "{a} {b}");
    }
}

#[test]
fn pedestrians_and_crossing_vehicles_are_predicted_on_the_map() {
    let route = bend();
    let mut tracks = oncoming(&route, ActorKind::Pedestrian, 1.4, 4.0);
    let mut crosses = oncoming(&straight(), ActorKind::Car, 8.0, 4.0).tracks.remove(0);
    let turned = |point: Point2| Point2::new(60.0 - point.y_m, point.x_m - 60.0);
    crosses.history.iter_mut().for_each(|one| one.point = turned(one.point));
    let point = turned(crosses.pose.point());
    (crosses.id, crosses.velocity_mps) = (ActorId(2), Vector2::new(0.0, -8.0));
    crosses.pose = Pose2::new(point.x_m, point.y_m, crosses.velocity_mps.heading());
    tracks.tracks.push(crosses);
    for name in [PredictorName::Imm, PredictorName::Multipath, PredictorName::Kalman] {
        let of = |ground| predict(name, &tracks, &THREE_SECONDS, ground);
        assert_eq!(of(Ground::Road(&route)), of(Ground::Open), "{name:?}");
    }
    // In the presence of a vehicle that follows the road.
    tracks.tracks.extend(oncoming(&route, ActorKind::Car, 10.0, 4.0).tracks);
    let of = |ground| predict(PredictorName::Imm, &tracks, &THREE_SECONDS, ground);
    let (road, open) = (of(Ground::Road(&route)), of(Ground::Open));
    let modes =
        |list: &PredictionList, k: usize| Prediction::by_actor(&list.predictions).nth(k).unwrap().to_vec();
    for k in 0..2 {
        assert_eq!(modes(&road, k), modes(&open, k));
    }
    assert_ne!(modes(&road, 2), modes(&open, 2));
}

#[test]
fn modes_that_leave_the_ground_are_removed_and_renormalised() {
    let route = straight();
    let mode = |probability: f64, to_m: f64| {
        let at = |k: i64| PredictedPose {
            at: Time::from_ms(1000 * k),
            pose: Pose2::new(100.0 - 10.0 * k as f64, 4.0 + (to_m - 4.0) * k as f64 / 3.0, 0.0),
        };
        let extent = Extent { length_m: 4.5, width_m: 1.8, height_m: 1.5 };
        Prediction {
            id: ActorId(1),
            kind: ActorKind::Car,
            extent,
            probability,
            path: (0..=3).map(at).collect(),
            covariances_m2: vec![[1.0, 0.0, 1.0]; 4],
        }
    };
    // The ground ends at 6 and -2 m.
    let mut modes = vec![mode(0.6, 4.0), mode(0.2, 9.0), mode(0.1, -6.0), mode(0.1, 3.0)];
    assert!(leave_out_off_road(&mut modes, &route));
    let left: Vec<f64> = modes.iter().map(|mode| mode.probability).collect();
    assert!(left.len() == 2 && (left[0] - 6.0 / 7.0).abs() < 1e-12 && (left[1] - 1.0 / 7.0).abs() < 1e-12);
    let mut all_leave = vec![mode(0.7, 9.0), mode(0.3, -6.0)];
    assert!(!leave_out_off_road(&mut all_leave, &route));
    assert_eq!(all_leave.len(), 2);
}
