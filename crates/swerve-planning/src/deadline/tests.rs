use proptest::prelude::*;
use swerve_core::Span;
use swerve_geom::{Point2, Polyline};
use swerve_msg::{ActorKind, Extent, PredictedPose};

use super::*;

const OVERHEAD: Overhead = Overhead { seen_s: 0.2, hidden_s: 0.4 };

fn route() -> Route {
    let line = Polyline::new(&[Point2::new(0.0, 0.0), Point2::new(500.0, 0.0)]).unwrap();
    Route::uniform(line, 6.0, 2.0)
}

/// An object 0.5 m across, or a truck, that moves from (s, d) with a velocity for 5 s.
fn thing(kind: ActorKind, (s_m, d_m): (f64, f64), (along_mps, left_mps): (f64, f64)) -> Prediction {
    let extent = match kind {
        ActorKind::Truck => Extent { length_m: 5.2, width_m: 2.6, height_m: 2.5 },
        ActorKind::Static => Extent { length_m: 0.5, width_m: 8.0, height_m: 1.8 },
        _ => Extent { length_m: 0.5, width_m: 0.5, height_m: 1.8 },
    };
    let place = |k: i64| {
        let t_s = k as f64 * 0.1;
        let pose = Pose2::new(s_m + along_mps * t_s, d_m + left_mps * t_s, 0.0);
        PredictedPose { at: Time::from_ms(100 * k), pose }
    };
    let id = ActorId(7);
    Prediction::single(id, kind, extent, (0..=50).map(place).collect())
}

fn hazard_at(speed_mps: f64, things: &[Prediction]) -> Option<Hazard> {
    hazard_by(&Params::default(), speed_mps, things)
}

/// Hazard in the way, without hidden ones.
fn seen_at(speed_mps: f64, things: &[Prediction]) -> Option<Hazard> {
    hazard_by(&Params { reach_m: 0.0, ..Params::default() }, speed_mps, things)
}

fn hazard_by(params: &Params, speed_mps: f64, things: &[Prediction]) -> Option<Hazard> {
    let (route, shape, limits) = (route(), Shape::default(), Limits::default());
    let ego = EgoState { speed_mps, ..EgoState::default() };
    let situation = Situation {
        now: Time::ZERO,
        ego: &ego,
        route: &route,
        shape: &shape,
        limits: &limits,
        predictions: things,
    };
    nearest_hazard(params, &situation, OVERHEAD)
}

fn total_s(speed_mps: f64, things: &[Prediction]) -> f64 {
    respond(&Params::default(), hazard_at(speed_mps, things), OVERHEAD, things.len()).total_s
}

/// Distance from the ego origin to its bumper, metres.
fn front_m() -> f64 {
    Shape::default().center_ahead_m() + 0.5 * Shape::default().length_m
}

#[test]
fn time_left_is_the_gap_over_the_speed_less_the_braking_time() {
    // A wall across the whole road.
    let row = [thing(ActorKind::Static, (50.0, 2.0), (0.0, 0.0))];
    let gap_m = 50.0 - 0.25 - front_m();
    let hazard = seen_at(12.0, &row).unwrap();
    assert!(!hazard.hidden);
    assert!((hazard.left_s - ((gap_m - 1.0) / 12.0 - 12.0 / 15.2)).abs() < 1e-9, "{hazard:?}");
}

#[test]
fn at_high_speed_a_swerve_may_begin_later_than_braking() {
    let person = [thing(ActorKind::Pedestrian, (60.0, 0.0), (0.0, 0.0))];
    let limits = Limits::default();
    let hazard = hazard_at(24.0, &person).unwrap();
    let y_m = 0.25 + 0.5 * Shape::default().width_m + 0.3;
    let swerve_s = 2.0 * (y_m / limits.lateral_accel_max_mps2).sqrt();
    assert!(swerve_s < 24.0 / 15.2);
    let gap_m = 60.0 - 0.25 - front_m() - 1.0;
    assert!((hazard.left_s - (gap_m / 24.0 - swerve_s)).abs() < 1e-9, "{hazard:?}");
}

#[test]
fn hazard_hidden_behind_a_truck_counts_as_standing_at_its_end() {
    let truck = [thing(ActorKind::Truck, (40.0, 4.0), (0.0, 0.0))];
    let hazard = hazard_at(12.0, &truck).unwrap();
    let gap_m = 40.0 + 2.6 - front_m() - 1.0;
    assert!(hazard.hidden && (hazard.left_s - (gap_m / 12.0 - 12.0 / 15.2)).abs() < 1e-9, "{hazard:?}");
    // Far beside, behind, or a person, who hides nobody.
    assert_eq!(hazard_at(12.0, &[thing(ActorKind::Truck, (40.0, 7.0), (0.0, 0.0))]), None);
    assert_eq!(hazard_at(12.0, &[thing(ActorKind::Truck, (0.0, 4.0), (0.0, 0.0))]), None);
    assert_eq!(hazard_at(12.0, &[thing(ActorKind::Pedestrian, (40.0, 4.0), (0.0, 0.0))]), None);
    // The same for a truck that drifts into the way, far ahead.
    let drifts = hazard_at(12.0, &[thing(ActorKind::Truck, (40.0, 4.0), (0.5, -0.3))]).unwrap();
    assert_eq!(drifts, hazard);
    // A person who walks onto the strip is in the way.
    let walks = hazard_at(12.0, &[thing(ActorKind::Pedestrian, (40.0, 4.0), (0.0, -1.5))]).unwrap();
    assert!(!walks.hidden);
}

#[test]
fn lead_at_the_same_speed_leaves_the_longest_response_time() {
    assert_eq!(seen_at(12.0, &[thing(ActorKind::Static, (30.0, 0.0), (12.0, 0.0))]), None);
    assert_eq!(seen_at(0.0, &[thing(ActorKind::Static, (5.0, 0.0), (0.0, 0.0))]), None);
    let slower = seen_at(12.0, &[thing(ActorKind::Static, (30.0, 0.0), (6.0, 0.0))]).unwrap();
    let standing = seen_at(12.0, &[thing(ActorKind::Static, (30.0, 0.0), (0.0, 0.0))]).unwrap();
    assert!(slower.left_s > standing.left_s);
    assert_eq!(total_s(12.0, &[]), 0.270 + 0.309);
}

#[test]
fn a_full_scene_gives_the_planner_more() {
    let params = Params::default();
    let [empty, full, fuller] = [0, 10, 100].map(|n| respond(&params, None, OVERHEAD, n));
    assert!(empty.planner_s < full.planner_s && full == fuller);
    assert_eq!(empty.total_s, full.total_s);
}

#[test]
fn invalid_parameters_are_rejected() {
    let refused = |params: Params| params.validate().unwrap_err().key;
    let good = Params::default();
    assert_eq!(good.validate(), Ok(()));
    assert_eq!(refused(Params { brake_mps2: 0.0, ..good }), "brake_mps2");
    assert_eq!(refused(Params { detector_max_s: 0.01, ..good }), "detector_max_s");
    assert_eq!(refused(Params { planner_max_s: f64::NAN, ..good }), "planner_max_s");
    assert_eq!(refused(Params { planner_share_full: 0.1, ..good }), "planner_share_full");
    assert_eq!(refused(Params { full_at: 0, ..good }), "full_at");
}

proptest! {
    #[test]
    fn response_time_falls_with_speed_and_grows_with_distance(
        speed_mps in 1.0..30.0_f64,
        faster_mps in 0.0..5.0_f64,
        s_m in 6.0..200.0_f64,
        further_m in 0.0..50.0_f64,
        d_m in -3.0..5.0_f64,
        kind in prop::sample::select(vec![ActorKind::Pedestrian, ActorKind::Truck]),
    ) {
        let at = |s_m| [thing(kind, (s_m, d_m), (0.0, 0.0))];
        let here_s = total_s(speed_mps, &at(s_m));
        prop_assert!(total_s(speed_mps + faster_mps, &at(s_m)) <= here_s + 1e-9);
        // Compare only hazards that are still ahead: a passed object is not a hazard.
        if hazard_at(speed_mps, &at(s_m)).is_some() {
            prop_assert!(total_s(speed_mps, &at(s_m + further_m)) >= here_s - 1e-9);
        }
    }

    #[test]
    fn shares_are_within_their_bounds_and_sum_up_to_the_total(
        left_s in -2.0..3.0_f64,
        hidden in any::<bool>(),
        obstacles in 0_usize..30,
    ) {
        let params = Params::default();
        let hazard = Some(Hazard { id: ActorId(1), hidden, left_s });
        let Response { total_s, detector_s, planner_s } = respond(&params, hazard, OVERHEAD, obstacles);
        let slack = 1e-12;
        prop_assert!((params.detector_min_s - slack..=params.detector_max_s + slack).contains(&detector_s));
        prop_assert!((params.planner_min_s - slack..=params.planner_max_s + slack).contains(&planner_s));
        prop_assert!((total_s - detector_s - planner_s).abs() < slack);
        prop_assert!(Span::from_secs(total_s) >= Span::from_ms(50));
    }
}
