use super::*;
use proptest::prelude::*;
use swerve_core::Span;
use swerve_geom::Pose2;
use swerve_msg::{ActorId, ActorKind, Extent, PredictedPose};

fn car(x: f64, y: f64, h: f64) -> Obb {
    Obb::new(Pose2::new(x, y, h), 4.93, 1.86)
}

/// A person who walks along -y at 2 m/s from (20, 4).
fn walker() -> Prediction {
    let path = (0..=20)
        .map(|k| PredictedPose {
            at: Time::ZERO + Span::from_ms(250) * k,
            pose: Pose2::new(20.0, 4.0 - 0.5 * k as f64, -1.57),
        })
        .collect();
    let extent = Extent { length_m: 0.5, width_m: 0.5, height_m: 1.8 };
    Prediction::single(ActorId(1), ActorKind::Pedestrian, extent, path)
}

/// The same pedestrian, who turns back half way.
fn wanderer() -> Prediction {
    let mut prediction = walker();
    for (k, p) in prediction.path.iter_mut().enumerate() {
        let back = k.saturating_sub(10) as f64;
        p.pose.x_m += 0.3 * back;
        p.pose.y_m += back;
        p.pose.heading_rad += 0.1 * back;
    }
    prediction
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]
    #[test]
    fn distance_matches_the_direct_computation(
        x in -9.0..9.0, y in -9.0..9.0, h in -3.0..3.0, g in -3.0..3.0, l in 0.0..5.0, w in 0.0..3.0,
    ) {
        let (a, b) = (car(0.0, 0.0, g), Obb::new(Pose2::new(x, y, h), l, w));
        let (p, q) = (Solid::from(&a), Solid::from(&b));
        prop_assert!((p.distance_m(&q) - a.distance(&b)).abs() < 1e-9);
        let all = Obstacles::from_boxes(&[b]);
        prop_assert!((all.clearance_m(&a, Time::ZERO) - a.distance(&b)).abs() < 1e-9);
        prop_assert_eq!(all.free(&a, Time::ZERO, 0.5), p.distance_m(&q) >= 0.5);
    }

    /// A pedestrian who may stop occupies every place reached up to the instant, and nothing beyond.
    #[test]
    fn pedestrian_that_may_stop_occupies_all_places_up_to_the_instant(x in 10.0..30.0, y in -9.0..9.0, h in -3.0..3.0, ms in 0_i64..6000) {
        let (footprint, at) = (car(x, y, h), Time::from_ms(ms));
        for (who, straight) in [(walker(), true), (wanderer(), false)] {
            let timed = Obstacles::new(core::slice::from_ref(&who), CollisionMode::TimeIndexed);
            let may_stop = Obstacles::new(&[who], CollisionMode::MayStop);
            let stopped_m = (0..=ms / 10)
                .map(|k| timed.clearance_m(&footprint, Time::from_ms(10 * k)))
                .fold(timed.clearance_m(&footprint, at), f64::min);
            let all_m = may_stop.clearance_m(&footprint, at);
            prop_assert!(all_m <= stopped_m + 1e-9, "{} {}", all_m, stopped_m);
            prop_assert!(!straight || all_m >= stopped_m - 0.02, "{} {}", all_m, stopped_m);
        }
    }

    /// Compares the bisection with a fine sampling.
    #[test]
    fn motions_agree_with_fine_sampling(
        x in -9.0..9.0, y in -9.0..9.0, h in -1.0..1.0, to_x in -9.0..30.0, to_y in -9.0..9.0, to_h in -1.0..1.0,
    ) {
        let boxes = Obstacles::from_boxes(&[Obb::new(Pose2::new(10.0, 1.0, 0.3), 1.0, 0.5), Obb::new(Pose2::new(4.0, -5.0, 0.0), 0.1, 0.1)]);
        let path = [(Pose2::new(x, y, h), Time::ZERO), (Pose2::new(to_x, to_y, to_h), Time::from_ms(1000))];
        let outline = |pose: Pose2| Obb::new(pose.ahead(1.4), 4.93, 1.86);
        let sampled = boxes.path_clearance_m(outline, &path, 0.005);
        let free = boxes.path_free(outline, &path, 0.3);
        if sampled < 0.29 { prop_assert!(!free); }
        if sampled > 0.31 { prop_assert!(free); }
    }
}

#[test]
fn time_indexed_person_occupies_its_place_at_the_instant() {
    let all = Obstacles::new(&[walker()], CollisionMode::TimeIndexed);
    let ahead = car(20.0, 0.0, 0.0);
    assert!(all.free(&ahead, Time::ZERO, 0.5));
    assert!(!all.free(&ahead, Time::from_ms(2000), 0.0));
    assert!(all.free(&ahead, Time::from_ms(4000), 0.5));
    let swept = Obstacles::new(&[walker()], CollisionMode::SweptStatic);
    assert!(!swept.free(&ahead, Time::ZERO, 0.0));
    assert!(!swept.free(&ahead, Time::from_ms(4000), 0.0));
    let mut n = 0;
    swept.for_each_at(Time::ZERO, |_| n += 1);
    assert_eq!(n, 11, "places are at least a metre apart");
}

#[test]
fn standing_pedestrians_and_vehicles_stay_time_indexed_under_may_stop() {
    let mut stands = walker();
    let first = stands.path[0].pose;
    stands.path.iter_mut().for_each(|p| p.pose = first);
    let rolls = Prediction { kind: ActorKind::Cyclist, ..walker() };
    for prediction in [stands, rolls] {
        let timed = Obstacles::new(core::slice::from_ref(&prediction), CollisionMode::TimeIndexed);
        let may_stop = Obstacles::new(&[prediction], CollisionMode::MayStop);
        assert!(!may_stop.any_may_stop());
        for ms in (0..6000).step_by(100) {
            let (footprint, at) = (car(20.0, 0.0, 0.4), Time::from_ms(ms));
            assert_eq!(may_stop.clearance_m(&footprint, at), timed.clearance_m(&footprint, at));
        }
    }
    let mut obstacles = Obstacles::new(&[walker()], CollisionMode::MayStop);
    assert!(obstacles.any_may_stop());
    obstacles.set(&[walker()], CollisionMode::TimeIndexed);
    assert!(!obstacles.any_may_stop());
}

#[test]
fn obstacles_never_tunnel_between_poses() {
    // A thin post between two poses 20 m apart, and a person that crosses the gap in between.
    let post = Obstacles::from_boxes(&[Obb::new(Pose2::new(10.0, 0.0, 0.0), 0.01, 0.01)]);
    let (a, b) = ((Pose2::new(0.0, 0.0, 0.0), Time::ZERO), (Pose2::new(20.0, 0.0, 0.0), Time::from_ms(1000)));
    let outline = |pose: Pose2| Obb::new(pose, 1.0, 1.0);
    assert!(!post.path_free(outline, &[a, b], 0.0));
    let standing =
        [(Pose2::new(20.0, 0.0, 0.0), Time::ZERO), (Pose2::new(20.0, 0.0, 0.0), Time::from_ms(5000))];
    assert!(!Obstacles::new(&[walker()], CollisionMode::TimeIndexed).path_free(outline, &standing, 0.0));
    assert!(!Obstacles::new(&[walker()], CollisionMode::MayStop).path_free(outline, &standing, 0.0));
}

#[test]
fn containment_is_a_collision_and_no_obstacles_are_free() {
    let all = Obstacles::from_boxes(&[Obb::new(Pose2::new(0.0, 0.0, 0.0), 50.0, 50.0)]);
    assert_eq!(all.clearance_m(&car(1.0, 1.0, 0.5), Time::ZERO), 0.0);
    assert!(!all.free(&car(1.0, 1.0, 0.5), Time::ZERO, 0.0));
    let none = Obstacles::new(&[], CollisionMode::TimeIndexed);
    assert!(none.free(&car(0.0, 0.0, 0.0), Time::ZERO, 9.0));
    assert_eq!(none.clearance_m(&car(0.0, 0.0, 0.0), Time::ZERO), f64::INFINITY);
}

/// A drift of 4 cm at 45 degrees to a square outline of 2.5 m, whose diagonal is 3.5 m.
#[test]
fn ground_of_a_small_drift_is_not_turned_against_the_outline() {
    let mut stands = walker();
    stands.extent = Extent { length_m: 2.5, width_m: 2.5, height_m: 1.8 };
    for (k, p) in stands.path.iter_mut().enumerate() {
        let drift_m = 0.04 / 2f64.sqrt() * k as f64 / 20.0;
        p.pose = Pose2::new(20.0 + drift_m, 4.0 - drift_m, 0.0);
    }
    let may_stop = Obstacles::new(&[stands], CollisionMode::MayStop);
    let clearance_m = may_stop.clearance_m(&car(20.0, 0.0, 0.0), Time::from_ms(5000));
    assert!((clearance_m - (4.0 - 0.04 / 2f64.sqrt() - 1.25 - 0.93)).abs() < 1e-9, "{clearance_m}");
}
