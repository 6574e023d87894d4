use super::*;
use swerve_core::Rng;
use swerve_geom::Point2;
use swerve_msg::{ActorId, ActorKind, Extent, Sighting};

/// A track with sightings `(ms, x, y)`, newest last, reported to move at 1 m/s along x.
fn track(seen: &[(i64, f64, f64)]) -> TrackList {
    let history: Vec<Sighting> =
        seen.iter().map(|&(ms, x, y)| Sighting { at: Time::from_ms(ms), point: Point2::new(x, y) }).collect();
    let &(ms, x, y) = seen.last().unwrap();
    let track = Track {
        id: ActorId(3),
        kind: ActorKind::Pedestrian,
        pose: Pose2::new(x, y, 1.0),
        extent: Extent { length_m: 0.5, width_m: 0.5, height_m: 1.8 },
        velocity_mps: Vector2::new(1.0, 0.0),
        history,
    };
    TrackList { stamp: Time::from_ms(ms), tracks: vec![track] }
}

fn only(tracks: &TrackList, params: &Params) -> Prediction {
    predict(tracks, params).predictions.remove(0)
}

/// Parameters by which obstacles with a single sighting stay at their position.
fn standing() -> Params {
    Params { single_sighting: SingleSighting::Static, ..Params::default() }
}

/// Velocity between the first two predicted poses.
fn velocity(prediction: &Prediction) -> (f64, f64) {
    let (a, b) = (&prediction.path[0], &prediction.path[1]);
    let moved = b.pose.point() - a.pose.point();
    let dt = (b.at - a.at).as_secs();
    (moved.x / dt, moved.y / dt)
}

#[test]
fn straight_motion_is_continued_exactly_from_uneven_stamps() {
    let at = |ms: i64| (ms, 5.0 + 3.0 * ms as f64 * 1e-3, 2.0 - 4.0 * ms as f64 * 1e-3);
    let prediction = only(&track(&[at(0), at(50), at(200), at(210), at(400)]), &standing());
    assert_eq!(prediction.path.len(), 41);
    for (k, predicted) in prediction.path.iter().enumerate() {
        let ms = 400 + 50 * k as i64;
        assert_eq!(predicted.at, Time::from_ms(ms));
        let (_, x, y) = at(ms);
        assert!(predicted.pose.point().distance(Point2::new(x, y)) < 1e-9);
        assert!(
            (predicted.pose.heading_rad - Vector2::<swerve_geom::Map>::new(3.0, -4.0).heading()).abs() < 1e-9
        );
    }
    assert_eq!(prediction.path[40].at - prediction.path[0].at, Span::from_ms(2000));
}

#[test]
fn fit_uses_only_the_last_positions() {
    let seen =
        [(0, 99.0, -7.0), (50, 0.0, 0.0), (100, 0.1, 0.0), (150, 0.2, 0.0), (200, 0.3, 0.0), (250, 0.4, 0.0)];
    let (vx, vy) = velocity(&only(&track(&seen), &Params::default()));
    assert!((vx - 2.0).abs() < 1e-9 && vy.abs() < 1e-9);
}

#[test]
fn single_sighting_moves_as_reported_or_stays() {
    let seen = track(&[(70, 4.0, 5.0)]);
    let moves = only(&seen, &Params::default());
    for (k, predicted) in moves.path.iter().enumerate() {
        let want = Point2::new(4.0 + 0.05 * k as f64, 5.0);
        assert!(predicted.pose.point().distance(want) < 1e-12 && predicted.pose.heading_rad == 0.0);
    }
    let stands = only(&seen, &standing());
    assert!(stands.path.iter().all(|p| p.pose == Pose2::new(4.0, 5.0, 1.0)), "heading is kept too");
    let mut bare = seen;
    bare.tracks[0].history.clear();
    assert_eq!(only(&bare, &Params::default()), moves);
}

/// Least squares over five positions: after a person sets off at `v`, the fitted velocity is 0.2, 0.5, 0.8 and then
/// 1.0 of `v`, so the prediction is correct only four frames later.
#[test]
fn fit_lags_behind_a_person_who_sets_off() {
    let v = 2.75;
    for (frames_walking, share) in [(0, 0.0), (1, 0.2), (2, 0.5), (3, 0.8), (4, 1.0), (5, 1.0)] {
        let seen: Vec<(i64, f64, f64)> = (0..10)
            .map(|k| {
                let walked = (k + frames_walking - 9).max(0) as f64 * 0.05 * v;
                (50 * k, 117.0, 4.5 - walked)
            })
            .collect();
        let (vx, vy) = velocity(&only(&track(&seen), &standing()));
        assert!(vx.abs() < 1e-9);
        assert!((vy + share * v).abs() < 1e-9, "{frames_walking} frames: {vy}");
    }
}

/// With independent noise of deviation `sigma` on each of n positions `h` apart, the fitted velocity has the
/// deviation `sigma / (h sqrt(n (n^2 - 1) / 12))`: for n = 5 that is `sigma / (h sqrt 10)`.
#[test]
fn fitted_velocity_has_the_theoretical_deviation() {
    let (sigma, h, runs) = (0.05, 0.05, 4000);
    let mut rng = Rng::keyed(7, "noise", &[]);
    let mut squares = 0.0;
    for _ in 0..runs {
        let seen: Vec<(i64, f64, f64)> =
            (0..5).map(|k| (50 * k, h * k as f64 + sigma * rng.normal(), 0.0)).collect();
        let (vx, _) = velocity(&only(&track(&seen), &Params::default()));
        squares += (vx - 1.0) * (vx - 1.0) / f64::from(runs);
    }
    let want = sigma / (h * 10f64.sqrt());
    assert!((squares.sqrt() / want - 1.0).abs() < 0.05, "{} against {want}", squares.sqrt());
}

#[test]
fn still_obstacle_keeps_its_heading() {
    let prediction = only(&track(&[(0, 1.0, 1.0), (50, 1.0, 1.001), (100, 1.0, 1.0)]), &Params::default());
    assert!(prediction.path.iter().all(|p| p.pose.heading_rad == 1.0));
}

#[test]
fn track_last_seen_before_the_stamp_is_extrapolated_to_it() {
    let mut tracks = track(&[(0, 0.0, 0.0), (50, 0.1, 0.0)]);
    tracks.stamp = Time::from_ms(150);
    let prediction = only(&tracks, &Params::default());
    assert_eq!(prediction.path[0].at, Time::from_ms(150));
    assert!((prediction.path[0].pose.x_m - 0.3).abs() < 1e-9);
}

#[test]
fn equal_stamps_do_not_divide_by_zero() {
    let prediction = only(&track(&[(50, 0.0, 0.0), (50, 1.0, 0.0)]), &standing());
    assert!(prediction.path.iter().all(|p| p.pose == Pose2::new(1.0, 0.0, 1.0)));
}

#[test]
fn standing_vehicle_is_not_turned_by_pose_errors() {
    // 0.2 m/s sideways, as at the onset of a swerve of the ego.
    let seen: Vec<(i64, f64, f64)> = (0..5).map(|k| (50 * k, 4.0, 5.0 + 0.01 * k as f64)).collect();
    let prediction = only(&track(&seen), &Params::default());
    assert!(prediction.path.iter().all(|p| p.pose.heading_rad == 1.0), "{prediction:?}");
    // At walking pace the heading is the direction of motion.
    let seen: Vec<(i64, f64, f64)> = (0..5).map(|k| (50 * k, 4.0, 5.0 + 0.06 * k as f64)).collect();
    let prediction = only(&track(&seen), &Params::default());
    let across_rad = core::f64::consts::FRAC_PI_2;
    assert!(prediction.path.iter().all(|p| (p.pose.heading_rad - across_rad).abs() < 1e-9), "{prediction:?}");
}

#[test]
fn parameters_out_of_range_are_named() {
    assert_eq!(standing().check_ranges(), Ok(()));
    let error = Params { step_s: 0.0, ..Params::default() }.check_ranges().unwrap_err();
    assert_eq!(error.to_string(), "`step_s` is 0, expected 0.001 to 10");
    assert!(Params { past_steps: 0, ..Params::default() }.check_ranges().is_err());
    assert!(Params { heading_speed_min_mps: f64::NAN, ..Params::default() }.check_ranges().is_err());
}

/// A vehicle with sightings every 50 ms over `window_s`: `m(t)` along x at `t` seconds before now (negative).
fn vehicle(kind: ActorKind, window_s: f64, mut m: impl FnMut(f64) -> f64) -> TrackList {
    let count = (window_s / 0.05).round() as i64;
    let seen: Vec<(i64, f64, f64)> =
        (0..=count).map(|k| (1000 + 50 * k, m(-0.05 * (count - k) as f64), 0.0)).collect();
    let mut tracks = track(&seen);
    tracks.tracks[0].kind = kind;
    tracks
}

#[test]
fn braking_vehicle_is_predicted_to_stop_and_stay() {
    // 8 m/s and 4 m/s² now: at rest after 2 s and 8 m.
    let place_m = |t: f64| 8.0 * t - 2.0 * t * t;
    let at = |prediction: &Prediction, s: f64| prediction.path[(s / 0.05).round() as usize].pose.point().x_m;
    let params = Params { future_steps: 80, ..Params::default() };
    for kind in [ActorKind::Car, ActorKind::Truck, ActorKind::Motorcycle, ActorKind::Cyclist] {
        let prediction = only(&vehicle(kind, 0.6, place_m), &params);
        for (s, wanted_m) in [(0.0, 0.0), (1.0, 6.0), (2.0, 8.0), (4.0, 8.0)] {
            assert!((at(&prediction, s) - wanted_m).abs() < 1e-6, "{kind:?} {s}: {}", at(&prediction, s));
        }
    }
    // Pedestrians keep the speed of the last five sightings, as do all obstacles in the paper's predictor.
    let paper = Params { brake_window_s: 0.0, ..params };
    for (kind, params) in [(ActorKind::Pedestrian, params), (ActorKind::Car, paper)] {
        assert!(at(&only(&vehicle(kind, 0.6, place_m), &params), 4.0) > 30.0, "{kind:?}");
    }
}

#[test]
fn noise_and_acceleration_are_not_taken_for_braking() {
    let mut braking = 0;
    for seed in 0..200 {
        let mut rng = Rng::keyed(seed, "noise", &[]);
        let noisy = vehicle(ActorKind::Car, 0.6, |t| 12.0 * t + 0.05 * rng.normal());
        let path = only(&noisy, &Params::default()).path;
        let [first, last] = [
            path[1].pose.point().x_m - path[0].pose.point().x_m,
            path[40].pose.point().x_m - path[39].pose.point().x_m,
        ];
        braking += i32::from(first - last > 1e-6);
    }
    // Three standard deviations on one side are one in 740; estimated from twelve residuals, the deviation is less
    // certain.
    assert!(braking <= 6, "{braking} of 200");
    let faster = only(&vehicle(ActorKind::Car, 0.6, |t| 8.0 * t + 2.0 * t * t), &Params::default());
    let steps: Vec<f64> = faster.path.windows(2).map(|p| p[1].pose.x_m - p[0].pose.x_m).collect();
    assert!(steps.iter().all(|step| (step - steps[0]).abs() < 1e-9));
}
