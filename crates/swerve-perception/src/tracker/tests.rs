use std::collections::BTreeMap;

use super::*;
use crate::detector::{self, Detector, Sensing};

use swerve_msg::Obstacle;
use swerve_msg::truth::Surroundings;

const PERSON: Extent = Extent { length_m: 0.5, width_m: 0.5, height_m: 1.7 };

fn found(kind: ActorKind, x_m: f64, y_m: f64) -> DetectedBox {
    DetectedBox {
        kind,
        score: 0.9,
        pose: Pose2::new(x_m, y_m, 0.0),
        bottom_m: 0.0,
        extent: PERSON,
        image_px: None,
        covariance_m2: None,
        radial_speed_mps: None,
    }
}

fn origin() -> Pose2<Map> {
    Pose2::new(0.0, 0.0, 0.0)
}

fn frame(ms: i64, boxes: Vec<DetectedBox>) -> Detections {
    Detections { stamp: Time::from_ms(ms), boxes }
}

fn tracker(params: Params) -> Tracker {
    Tracker::new(params).unwrap()
}

#[test]
fn tracks_are_reported_after_probation_and_end_after_the_timeout() {
    let mut tracker = tracker(Params { hits_min: 3, forget_after_s: 0.1, ..Params::default() });
    let mut reported = |ms: i64, boxes| tracker.update(&frame(ms, boxes), origin()).tracks.len();
    let person = || vec![found(ActorKind::Pedestrian, 10.0, 1.0)];
    assert_eq!([reported(0, person()), reported(50, person()), reported(100, person())], [0, 0, 1]);
    assert_eq!([reported(150, vec![]), reported(200, vec![]), reported(250, vec![])], [1, 1, 0]);
    // An unconfirmed track ends at the first frame without a box.
    assert_eq!([reported(300, person()), reported(350, vec![]), reported(400, person())], [0, 0, 0]);
    assert_eq!([reported(450, person()), reported(500, person())], [0, 1]);
}

/// A standing object right ahead stays for a second without boxes, without a velocity; one that stands further away or
/// behind, and one that moves, end as all others.
#[test]
fn standing_track_right_ahead_outlives_the_timeout() {
    let params = Params { forget_after_s: 0.1, near_forget_after_s: 1.0, near_m: 8.0, ..Params::default() };
    let unseen = |x_m: f64, speed_mps: f64, ms: i64| {
        let mut tracker = tracker(params);
        for k in 0..20 {
            let t_s = 0.05 * f64::from(k);
            let boxes = vec![found(ActorKind::Pedestrian, x_m + speed_mps * t_s, 0.0)];
            tracker.update(&frame(50 * i64::from(k), boxes), origin());
        }
        let mut list = TrackList::default();
        for at in (1000..=950 + ms).step_by(50) {
            list = tracker.update(&frame(at, vec![]), origin());
        }
        list.tracks.first().map(|track| track.velocity_mps.norm())
    };
    assert!(unseen(7.0, 0.0, 100).is_some() && unseen(7.0, 0.0, 150) == Some(0.0));
    assert_eq!((unseen(7.0, 0.0, 1000), unseen(7.0, 0.0, 1050)), (Some(0.0), None));
    assert_eq!((unseen(9.0, 0.0, 150), unseen(-7.0, 0.0, 150), unseen(4.0, 1.5, 150)), (None, None, None));
}

#[test]
fn tracks_estimate_velocity_and_history_from_a_turning_ego() {
    let mut tracker = tracker(Params::default());
    let mut tracks = TrackList::default();
    for k in 0..40 {
        let t = f64::from(k) * 0.05;
        let ego = Pose2::new(3.0 * t, -0.5 * t, 0.3 * t);
        let at = ego.to_local::<Ego>(Point2::new(20.0 - 1.0 * t, 3.0 - 1.5 * t));
        tracks = tracker
            .update(&frame(50 * i64::from(k), vec![found(ActorKind::Pedestrian, at.x_m, at.y_m)]), ego);
    }
    let track = &tracks.tracks[0];
    assert_eq!((tracks.tracks.len(), track.id, tracks.stamp), (1, ActorId(1), Time::from_ms(1950)));
    let v = track.velocity_mps;
    assert!((v.x + 1.0).abs() < 0.02 && (v.y + 1.5).abs() < 0.02, "{v:?}");
    assert_eq!(track.history.len(), Params::default().sightings_max);
    for sighting in &track.history {
        let t = sighting.at.as_secs();
        assert!(sighting.point.distance(Point2::new(20.0 - t, 3.0 - 1.5 * t)) < 0.02, "{sighting:?}");
    }
    assert!(track.history.windows(2).all(|w| w[0].at < w[1].at));
}

#[test]
fn crossing_tracks_keep_identities_and_kinds() {
    let mut tracker = tracker(Params::default());
    let mut tracks = TrackList::default();
    for k in 0..60 {
        let y = 3.0 - 0.1 * f64::from(k);
        let boxes = vec![
            found(ActorKind::Pedestrian, 15.0, y),
            found(ActorKind::Pedestrian, 15.2, -y),
            found(ActorKind::Car, 15.1, y),
        ];
        tracks = tracker.update(&frame(50 * i64::from(k), boxes), origin());
    }
    let ends: Vec<(u32, bool, ActorKind)> =
        tracks.tracks.iter().map(|t| (t.id.0, t.pose.y_m > 0.0, t.kind)).collect();
    assert_eq!(
        ends,
        [(1, false, ActorKind::Pedestrian), (2, true, ActorKind::Pedestrian), (3, false, ActorKind::Car)]
    );
}

#[test]
fn tracker_ignores_old_low_scoring_and_non_finite_boxes() {
    let mut tracker = tracker(Params { hits_min: 1, ..Params::default() });
    let before = tracker.update(&frame(100, vec![found(ActorKind::Car, 10.0, 0.0)]), origin());
    assert_eq!(before.tracks.len(), 1);
    let other = || vec![found(ActorKind::Car, 30.0, 5.0)];
    assert_eq!(tracker.update(&frame(100, other()), origin()), before);
    assert_eq!(tracker.update(&frame(50, other()), origin()), before);
    assert_eq!(tracker.update(&frame(150, other()), Pose2::new(f64::NAN, 0.0, 0.0)), before);
    let mut bad = [
        found(ActorKind::Car, f64::NAN, 0.0),
        found(ActorKind::Car, 30.0, 0.0),
        found(ActorKind::Car, 40.0, 0.0),
    ];
    bad[1].score = 0.1;
    bad[2].extent.width_m = f64::INFINITY;
    assert_eq!(tracker.update(&frame(150, bad.to_vec()), origin()).tracks.len(), 1);
    assert_eq!(
        Tracker::new(Params { floor_noise_m: 0.0, ..Params::default() }).unwrap_err().key,
        "floor_noise_m"
    );
}

/// Evaluation of a tracker against ground truth.
#[derive(Default, Debug)]
struct Score {
    matched: f64,
    missed: f64,
    ghosts: f64,
    switches: f64,
    squares: f64,
    speed_squares: f64,
    last: BTreeMap<ActorId, ActorId>,
}

impl Score {
    /// Adds a frame to CLEAR MOT (Bernardin and Stiefelhagen 2008) with pairs up to 3 m apart.
    fn take(&mut self, truth: &[Obstacle], tracks: &TrackList) {
        let distance = |o: usize, t: usize| {
            let (o, t) = (&truth[o], &tracks.tracks[t]);
            // An existing pair is kept.
            let kept = if self.last.get(&o.id) == Some(&t.id) { -3.0 } else { 0.0 };
            let off = o.pose.point().distance(t.pose.point());
            if off < 3.0 { off + kept } else { f64::INFINITY }
        };
        let pairs = assign(truth.len(), tracks.tracks.len(), 3.0, distance);
        for &(o, t) in &pairs {
            let (o, t) = (&truth[o], &tracks.tracks[t]);
            if self.last.insert(o.id, t.id).is_some_and(|before| before != t.id) {
                self.switches += 1.0;
            }
            self.squares += o.pose.point().distance(t.pose.point()).powi(2);
            self.speed_squares += (o.velocity_mps - t.velocity_mps).norm_squared();
        }
        self.matched += pairs.len() as f64;
        self.missed += (truth.len() - pairs.len()) as f64;
        self.ghosts += (tracks.tracks.len() - pairs.len()) as f64;
    }

    fn mota(&self) -> f64 {
        1.0 - (self.missed + self.ghosts + self.switches) / (self.matched + self.missed)
    }
}

/// Six people who walk back and forth in front of a car driving at 8 m/s, seen by a detector of this error level.
fn followed(difficulty: f64) -> Score {
    let params = detector::Params::of_error_level(Sensing::Camera, difficulty);
    let detector = Detector::new(params, None, 11, "detector").unwrap();
    let mut tracker = tracker(Params {
        range_noise_share: params.range_noise_share,
        bearing_noise_rad: params.bearing_noise_rad,
        ..Params::default()
    });
    let mut score = Score::default();
    for k in 0..100_i64 {
        let t = k as f64 * 0.05;
        let ego = Pose2::new(8.0 * t - 10.0, 0.0, 0.0);
        let person = |id: u32| {
            let (phase, x_m) = (f64::from(id), 34.0 + 4.0 * f64::from(id));
            let vy = if id.is_multiple_of(2) { 1.2 } else { -1.2 };
            Obstacle {
                id: ActorId(id),
                kind: ActorKind::Pedestrian,
                pose: Pose2::new(x_m, vy * (t - 2.5) + phase - 3.0, 0.0),
                extent: PERSON,
                velocity_mps: Vector2::new(0.0, vy),
                visible_share: 1.0,
            }
        };
        let obstacles: Vec<Obstacle> = (0..6).map(person).collect();
        let seen = Surroundings { stamp: Time::from_ms(50 * k), ego, obstacles };
        let tracks = tracker.update(&detector.detect(&seen), ego);
        if k >= 10 {
            score.take(&seen.obstacles, &tracks);
        }
    }
    score
}

#[test]
fn tracker_makes_no_error_with_a_perfect_detector() {
    let score = followed(0.0);
    let rmse_m = (score.squares / score.matched).sqrt();
    let rmse_mps = (score.speed_squares / score.matched).sqrt();
    assert!((score.mota() - 1.0).abs() < 1e-9, "{score:?}");
    assert!(rmse_m < 0.05 && rmse_mps < 0.3, "{rmse_m} {rmse_mps}");
}

#[test]
fn tracking_accuracy_falls_with_the_error_level() {
    let scores = [0.5, 1.0, 2.0].map(followed);
    let mota = scores.each_ref().map(Score::mota);
    let rmse_m = scores.each_ref().map(|s| (s.squares / s.matched).sqrt());
    println!("MOTA {mota:?}, RMSE {rmse_m:?} m, switches {:?}", scores.each_ref().map(|s| s.switches));
    assert!(mota[0] > mota[1] && mota[1] > mota[2], "{mota:?}");
    assert!(mota[0] > 0.9 && mota[1] > 0.7 && mota[2] > 0.3, "{mota:?}");
    assert!(rmse_m[0] < 1.0 && rmse_m[2] < 2.0, "{rmse_m:?}");
    assert!(scores.iter().all(|s| s.switches <= 12.0), "{scores:?}");
}

#[test]
fn track_of_a_person_who_stops_keeps_its_identity_and_stops_too() {
    for (step_ms, range_m) in [(50_i32, 20.0), (50, 8.0), (120, 20.0), (200, 12.0)] {
        let mut tracker = tracker(Params::default());
        let stops = Time::from_ms(1000);
        for ms in (0..1600_i32).step_by(step_ms as usize) {
            let ran_s = f64::from(ms.min(1000)) * 1e-3;
            let person = found(ActorKind::Pedestrian, range_m, -4.0 + 4.0 * ran_s);
            let tracks = tracker.update(&frame(i64::from(ms), vec![person]), origin()).tracks;
            let stamp = Time::from_ms(i64::from(ms));
            if stamp < Time::from_ms(400) {
                continue;
            }
            assert_eq!(tracks.iter().map(|t| t.id.0).collect::<Vec<_>>(), [1], "{step_ms} ms, at {ms} ms");
            let speed_mps = tracks[0].velocity_mps.y;
            // The stop is detected within two frames and a fifth of a second.
            if stamp - stops >= Span::from_ms(200.max(2 * i64::from(step_ms))) {
                assert!(speed_mps.abs() < 0.8, "{step_ms} ms, {range_m} m, at {ms} ms: {speed_mps} m/s");
            }
        }
    }
}

#[test]
fn tracker_uses_only_the_highest_scoring_boxes() {
    let mut tracker = tracker(Params::default());
    let at = |k: u32| found(ActorKind::Pedestrian, 5.0 + f64::from(k % 100), f64::from(k / 100));
    let boxes: Vec<DetectedBox> =
        (0..10_000).map(|k| DetectedBox { score: if k % 10 == 3 { 0.9 } else { 0.7 }, ..at(k) }).collect();
    let mut told = TrackList::default();
    for k in 0..3 {
        told = tracker.update(&frame(50 * k, boxes.clone()), origin());
    }
    assert_eq!(told.tracks.len(), crate::image_plane::BOXES_MAX);
    assert!(told.tracks.iter().all(|track| tracker.score(track.id) == Some(0.9)));
}

/// A box with a covariance is weighted by it: of two contradicting boxes the more certain one prevails.
#[test]
fn box_covariances_weight_the_update() {
    let place = |covariance_m2| {
        let mut tracker = tracker(Params { floor_noise_m: 0.01, ..Params::default() });
        let first = found(ActorKind::Static, 20.0, 0.0);
        tracker.update(
            &frame(0, vec![DetectedBox { covariance_m2: Some([0.04, 0.0, 0.04]), ..first }]),
            origin(),
        );
        let second = DetectedBox { covariance_m2, ..found(ActorKind::Static, 20.4, 0.0) };
        tracker.update(&frame(100, vec![second]), origin()).tracks[0].pose.x_m
    };
    let (sure, unsure) = (place(Some([0.01, 0.0, 0.01])), place(Some([4.0, 0.0, 0.04])));
    assert!(sure > 20.25 && unsure < 20.05, "{sure} {unsure}");
}

#[test]
fn probation_survives_lists_of_another_sensor() {
    let reported = |probation_s: f64| {
        let mut tracker = tracker(Params { hits_min: 2, probation_s, ..Params::default() });
        let person = || vec![found(ActorKind::Pedestrian, 10.0, 1.0)];
        [(0, person()), (50, vec![]), (100, person())]
            .map(|(ms, boxes)| tracker.update(&frame(ms, boxes), origin()).tracks.len())
    };
    assert_eq!(reported(0.0), [0, 0, 0], "frames in a row");
    assert_eq!(reported(0.11), [0, 0, 1]);
}

const CAR: Extent = Extent { length_m: 4.4, width_m: 1.8, height_m: 1.5 };

/// Car at `x_m`, with this standard deviation along x.
fn car(x_m: f64, sigma_m: f64) -> DetectedBox {
    let covariance_m2 = Some([sigma_m * sigma_m, 0.0, 0.01]);
    DetectedBox { extent: CAR, covariance_m2, ..found(ActorKind::Car, x_m, 0.0) }
}

/// A lidar measures the distance to a standing car to 0.1 m. The camera's distance is 1.5 m too small, with a standard
/// deviation of 3 m, and starts a track of its own whenever it reports the car twice in one list.
#[test]
fn tracks_of_one_object_are_merged() {
    let mut tracker = tracker(Params { probation_s: 0.11, ..Params::default() });
    let in_image = |b| DetectedBox { image_px: Some([400.0, 300.0, 440.0, 330.0]), ..b };
    let mut tracks = Vec::new();
    for k in 0..20_i64 {
        let boxes = match k % 4 {
            0 => vec![car(20.0, 0.1), in_image(car(18.5, 3.0))],
            2 => vec![car(20.0, 0.1)],
            _ => vec![in_image(car(18.5, 3.0))],
        };
        tracks = tracker.update(&frame(25 * k, boxes), origin()).tracks;
        assert!(tracks.len() <= 1, "{k}: {tracks:?}");
    }
    let [track] = tracks.as_slice() else { panic!("{tracks:?}") };
    assert_eq!(track.id, ActorId(1));
    assert!((track.pose.x_m - 20.0).abs() < 0.1 && track.velocity_mps.norm() < 0.5, "{track:?}");
}

/// Boxes of a standing truck beside the ego are at times those of a car, whose unseen side is nearer.
#[test]
fn vehicle_whose_class_changes_keeps_its_near_side() {
    let covariance_m2 = Some([0.01, 0.0, 0.01]);
    let of = |kind, extent: Extent| {
        let y_m = 2.0 + 0.5 * extent.width_m;
        DetectedBox { extent, covariance_m2, ..found(kind, 0.0, y_m) }
    };
    let truck = of(ActorKind::Truck, Extent { length_m: 6.0, width_m: 2.6, height_m: 2.8 });
    let mut tracker = tracker(Params::default());
    for k in 0..40_i64 {
        let found = if k % 7 == 6 { of(ActorKind::Car, CAR) } else { truck };
        let tracks = tracker.update(&frame(50 * k, vec![found]), origin()).tracks;
        let Some(track) = tracks.first() else { continue };
        let near_m = track.pose.y_m - 0.5 * track.extent.width_m;
        assert!((near_m - 2.0).abs() < 0.01 && track.velocity_mps.norm() < 0.01, "{k}: {track:?}");
    }
}

#[test]
fn doubt_removes_the_velocity_that_is_within_its_error() {
    let reported = |velocity_doubt: f64, sigma_m: f64| {
        let mut tracker = tracker(Params { velocity_doubt, ..Params::default() });
        let list = (0..4_i64).map(|k| {
            let covariance_m2 = Some([sigma_m * sigma_m, 0.0, sigma_m * sigma_m]);
            let person = found(ActorKind::Pedestrian, 10.0, 0.08 * k as f64);
            tracker.update(&frame(50 * k, vec![DetectedBox { covariance_m2, ..person }]), origin())
        });
        list.last().unwrap().tracks[0].clone()
    };
    let [sure, doubted] = [0.0, 1.0].map(|doubt| reported(doubt, 0.03));
    assert!(sure.velocity_mps.y > 1.2 && doubted.velocity_mps.y > 0.85 * sure.velocity_mps.y, "{doubted:?}");
    assert_eq!(sure.pose, doubted.pose);
    let [sure, doubted] = [0.0, 1.0].map(|doubt| reported(doubt, 1.0));
    assert!(sure.velocity_mps.y > 0.03 && doubted.velocity_mps == Vector2::default(), "{sure:?} {doubted:?}");
    // The line through the history has the reported velocity.
    let [first, last] = [&doubted.history[0], &doubted.history[3]];
    assert!(last.point.distance(first.point) < 0.2 * sure.history[3].point.distance(sure.history[0].point));
}

#[test]
fn two_boxes_of_one_sensor_are_two_tracks() {
    let beside = |y_m| DetectedBox { extent: CAR, ..found(ActorKind::Car, 20.0, y_m) };
    let mut tracker = tracker(Params::default());
    let mut update = |k: i64, boxes| tracker.update(&frame(50 * k, boxes), origin()).tracks.len();
    assert_eq!(
        [update(0, vec![beside(0.0), beside(0.6)]), update(1, vec![beside(0.0), beside(0.6)])],
        [0, 2]
    );
    assert_eq!(update(2, vec![beside(0.1)]), 1, "a body is not inside another one");
}

#[test]
fn static_object_inside_a_vehicle_is_part_of_it() {
    let part = DetectedBox { extent: PERSON, ..found(ActorKind::Static, 19.0, 0.5) };
    let mut tracker = tracker(Params::default());
    let mut kinds = |k: i64, boxes| -> Vec<(u32, ActorKind)> {
        let tracks = tracker.update(&frame(50 * k, boxes), origin()).tracks;
        tracks.iter().map(|t| (t.id.0, t.kind)).collect()
    };
    assert_eq!([kinds(0, vec![part]), kinds(1, vec![part])], [vec![], vec![(1, ActorKind::Static)]]);
    let both = || vec![car(20.0, 0.1), DetectedBox { score: 0.5, ..part }];
    // The identity stays. The car's box is not in the image, as is the part's: the two may be of one object.
    let seen = DetectedBox { image_px: Some([0.0, 0.0, 9.0, 9.0]), ..both()[0] };
    assert_eq!(kinds(2, vec![seen, both()[1]]), [(1, ActorKind::Car)]);
}

#[test]
fn certain_track_keeps_its_boxes_beside_an_uncertain_one() {
    // Distances and determinants of two tracks and one box: the uncertain track is nearer by its own measure.
    let (sure, unsure) = ((4.0, math::ln(0.02)), (0.5, math::ln(9.0)));
    let of = |t: usize, _: usize| Some(if t == 0 { unsure } else { sure });
    assert_eq!(likeliest(2, 1, 9.21, of), [(1, 0)]);
    assert_eq!(likeliest(1, 1, 9.21, |_, _| Some((9.3, -20.0))), []);
    assert_eq!(likeliest(1, 1, 9.21, |_, _| None), []);
}

#[test]
fn outlier_does_not_change_the_velocity_and_a_second_one_does() {
    let velocities = |second_m: f64| -> Vec<f64> {
        let mut tracker = tracker(Params::default());
        let place = |k: i32| match k {
            20 => 2.0 + 0.3,
            21 => second_m,
            k => 0.1 * f64::from(k),
        };
        let one = |k: i32| {
            let person = found(ActorKind::Pedestrian, 15.0, place(k) - 2.0);
            let tracks = tracker.update(&frame(50 * i64::from(k), vec![person]), origin()).tracks;
            tracks.first().map_or(0.0, |track| track.velocity_mps.y)
        };
        (0..24).map(one).collect()
    };
    // She walks at 2 m/s; one box is 0.3 m off.
    let walks = velocities(2.1);
    assert!(walks[19..].iter().all(|v| (v - 2.0).abs() < 0.5), "{walks:?}");
    // She starts to run at 7 m/s.
    let jumps = velocities(2.6);
    assert!((jumps[20] - 2.0).abs() < 0.5 && jumps[21] > 4.5, "{jumps:?}");
}

#[test]
fn radial_speed_gives_the_velocity_along_the_line_of_sight() {
    let seen = |radial_speed_mps| DetectedBox { radial_speed_mps, ..car(20.0, 0.5) };
    let velocity = |speeds: [Option<f64>; 2]| {
        let mut tracker = tracker(Params::default());
        tracker.update(&frame(0, vec![seen(speeds[0])]), origin());
        let tracks = tracker.update(&frame(50, vec![seen(speeds[1])]), origin()).tracks;
        let spread = tracker.covariance(ActorId(1)).unwrap();
        (tracks[0].velocity_mps.x, spread[(2, 2)].sqrt(), spread[(3, 3)].sqrt())
    };
    let (speed, along, across) = velocity([Some(-9.0), Some(-9.2)]);
    assert!((speed + 9.1).abs() < 0.3 && along < 0.5 && across > 1.0, "{speed} {along} {across}");
    let (speed, ..) = velocity([Some(-9.0), Some(9.0)]);
    assert!((speed + 9.0).abs() < 0.6, "an echo of another object: {speed}");
    let (speed, along, _) = velocity([None, None]);
    assert!(speed.abs() < 1.0 && along > 5.0, "{speed} {along}");
}

/// A car that approaches with 11 m/s along x, its box as a camera supposes it beyond a bend: askew, its distance unsure.
#[test]
fn supposed_axis_is_neither_the_direction_of_motion_nor_a_seen_face() {
    let mut tracker = tracker(Params::default());
    let mut seen = |k: i64| {
        let x_m = 50.0 - 0.55 * k as f64;
        let pose = Pose2::new(x_m, 0.0, 1.2);
        let seen = DetectedBox {
            covariance_m2: Some([0.8, 0.0, 0.05]),
            radial_speed_mps: Some(-11.0),
            ..DetectedBox { pose, ..car(x_m, 0.0) }
        };
        tracker.update(&frame(50 * k, vec![seen]), origin()).tracks
    };
    let track = (0..8).flat_map(&mut seen).last().unwrap();
    assert!(track.velocity_mps.y.abs() < 1.0 && track.pose.y_m.abs() < 0.2, "{track:?}");
    assert!((track.velocity_mps.x + 11.0).abs() < 0.5, "{track:?}");
}

/// Of a person whose distance only the image gives, two boxes 5 m apart make no sprint; across the sight they do.
#[test]
fn unsure_distances_of_a_person_make_no_sprint() {
    let person = Motion { speed_mps: 6.0, ..Params::default().person };
    let velocity = |places: [[f64; 2]; 2]| {
        let mut tracker = tracker(Params { person, probation_s: 1.0, ..Params::default() });
        let mut seen = |k: i64, [x_m, y_m]: [f64; 2]| {
            let covariance_m2 = Some([6.0, 0.0, 0.05]);
            let seen = DetectedBox { covariance_m2, ..found(ActorKind::Pedestrian, x_m, y_m) };
            tracker.update(&frame(450 * k, vec![seen]), origin()).tracks
        };
        seen(0, places[0]);
        seen(1, places[1])[0].velocity_mps
    };
    let along = velocity([[20.0, 0.0], [15.0, 0.0]]);
    let across = velocity([[20.0, 0.0], [20.0, 1.5]]);
    assert!(along.norm() < 2.0 && (across.y - 3.3).abs() < 0.5, "{along:?} {across:?}");
}

#[test]
fn box_with_front_and_rear_confused_does_not_turn_the_track() {
    let mut tracker = tracker(Params::default());
    let mut headings = Vec::new();
    for k in 0..12_i64 {
        let heading_rad = if k == 9 { -1.52 } else { 1.6 };
        let seen = DetectedBox { pose: Pose2::new(20.0, 0.0, heading_rad), ..car(20.0, 0.1) };
        let tracks = tracker.update(&frame(50 * k, vec![seen]), origin()).tracks;
        headings.extend(tracks.iter().map(|track| track.pose.heading_rad));
    }
    assert!(headings.iter().all(|heading| (heading - 1.6).abs() < 0.02), "{headings:?}");
}

#[test]
fn box_across_the_motion_of_a_vehicle_turns_neither_the_track_nor_its_motion() {
    // The front of an oncoming truck, now and then taken for the side of a car.
    let truck = |x_m: f64| DetectedBox {
        kind: ActorKind::Truck,
        pose: Pose2::new(x_m, 4.0, 0.0),
        extent: Extent { length_m: 6.0, width_m: 2.5, height_m: 2.4 },
        covariance_m2: Some([0.7, 0.0, 0.01]),
        radial_speed_mps: Some(-10.0),
        ..found(ActorKind::Truck, x_m, 4.0)
    };
    let side = |x_m: f64| DetectedBox {
        kind: ActorKind::Car,
        // The front stands at the same place, and the car's length is added to the left.
        pose: Pose2::new(x_m - 2.1, 4.9, -1.5),
        extent: Extent { length_m: 4.4, width_m: 1.8, height_m: 2.4 },
        covariance_m2: Some([0.02, 0.0, 0.04]),
        ..truck(x_m)
    };
    let tracks = |is_side: &dyn Fn(i64) -> bool| {
        let mut tracker = tracker(Params::default());
        let mut tracks = Vec::new();
        for k in 0..24_i64 {
            let x_m = 60.0 - 0.5 * k as f64;
            let seen = if is_side(k) { side(x_m) } else { truck(x_m) };
            tracks = tracker.update(&frame(50 * k, vec![seen]), origin()).tracks;
        }
        tracks
    };
    for (name, is_side) in [
        ("in between", &(|k: i64| k % 5 == 4) as &dyn Fn(i64) -> bool),
        ("first", &|k| k < 2),
        ("last", &|k| k > 20),
    ] {
        let tracks = tracks(is_side);
        let [track] = &tracks[..] else { panic!("{name}: {tracks:?}") };
        let off_m = math::hypot(track.pose.x_m - 48.5, track.pose.y_m - 4.0);
        let Vector2 { x, y, .. } = track.velocity_mps;
        assert!(math::sin(track.pose.heading_rad).abs() < 0.1, "{name}: {track:?}");
        assert!((x + 10.0).abs() < 0.5 && y.abs() < 1.0 && off_m < 1.0, "{name}: {off_m} {track:?}");
    }
}
